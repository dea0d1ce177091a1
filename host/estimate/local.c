/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/local.h"

#include <math.h>

bool local_fit(struct local *local, const struct trace *trace, double centre_s, double half_s,
               const struct local_span *span, unsigned order)
{
	double from = fmax(centre_s - half_s, span->from_s), until = fmin(centre_s + half_s, span->until_s);
	double moment[2 * CHOLESKY_MAX - 1] = {0}, normal[CHOLESKY_MAX][CHOLESKY_MAX],
	                                 right[CHOLESKY_MAX] = {0};
	double squares = 0;
	unsigned terms = order + 1;
	size_t used = 0;

	if (!(half_s > 0))
		return false;
	for (size_t k = trace_index(trace, from); k < trace->count && trace_time(trace, k) <= until; k++) {
		double x = (trace_time(trace, k) - centre_s) / half_s, power = 1;

		if (!trace_good(trace, k))
			continue;
		used++;
		squares += trace->value_g[k] * trace->value_g[k];
		for (unsigned i = 0; i < 2 * terms - 1; i++) {
			moment[i] += power;
			if (i < terms)
				right[i] += power * trace->value_g[k];
			power *= x;
		}
	}
	if (used < terms + 2)
		return false;
	for (unsigned i = 0; i < terms; i++)
		for (unsigned j = 0; j <= i; j++)
			normal[i][j] = moment[i + j];
	if (!cholesky_factor(&local->normal, terms, normal))
		return false;
	cholesky_solve(&local->normal, right, local->coefficient);
	for (unsigned i = 0; i < terms; i++)
		squares -= local->coefficient[i] * right[i];
	local->freedom = (unsigned)(used - terms);
	local->residual_g = sqrt(fmax(squares, 0) / local->freedom);
	local->terms = terms;
	local->centre_s = centre_s;
	local->half_s = half_s;
	return true;
}

void local_at(const struct local *local, double time_s, double derivative[3])
{
	double x = (time_s - local->centre_s) / local->half_s;
	double value = 0, slope = 0, half_curvature = 0;

	for (unsigned i = local->terms; i-- > 0;) {
		half_curvature = half_curvature * x + slope;
		slope = slope * x + value;
		value = value * x + local->coefficient[i];
	}
	derivative[0] = value;
	derivative[1] = slope / local->half_s;
	derivative[2] = 2 * half_curvature / (local->half_s * local->half_s);
}

double local_spread(const struct local *local, double time_s, unsigned order)
{
	double x = (time_s - local->centre_s) / local->half_s, power = pow(local->half_s, -(double)order);
	double row[CHOLESKY_MAX] = {0};

	for (unsigned i = order; i < local->terms; i++) {
		row[i] = power;
		for (unsigned d = 0; d < order; d++)
			row[i] *= (double)(i - d);
		power *= x;
	}
	return sqrt(cholesky_variance(&local->normal, row));
}
