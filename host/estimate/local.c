/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/local.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/simd2.h"

/* Sums over the samples: of the powers of x, of those times the value, of the value's square. */
struct sums {
	/* an even power and the odd one after it */
	PAIR moments[CHOLESKY_MAX], products[CHOLESKY_MAX];
	double squares;
	size_t used;
};

static inline void local_add_up(struct sums *sums, const struct trace *trace, size_t first, size_t last,
                                double start, double step, unsigned terms)
{
	for (size_t k = first; k < last; k++) {
		double x = start + (double)(k - first) * step, value = trace->value_g[k];
		PAIR power = {1, x};

		if (!trace_good(trace, k))
			continue;
		sums->used++;
		sums->squares += value * value;
		for (unsigned i = 0; 2 * i < terms; i++, power *= x * x) {
			sums->moments[i] += power;
			sums->products[i] += power * value;
		}
		for (unsigned i = (terms + 1) / 2; i < terms; i++, power *= x * x)
			sums->moments[i] += power;
	}
}

bool local_fit(struct local *local, const struct trace *trace, double centre_s, double half_s,
               const struct local_span *span, unsigned order)
{
	double from = fmax(centre_s - half_s, span->from_s), until = fmin(centre_s + half_s, span->until_s);
	double normal[CHOLESKY_MAX][CHOLESKY_MAX], right[CHOLESKY_MAX], start, step;
	struct sums sums = {.used = 0};
	unsigned terms = order + 1;
	size_t first, last;

	if (!(half_s > 0))
		return false;
	first = trace_index(trace, from);
	/* A sample on the end of the window belongs to it, whatever rounding says. */
	last = trace_index(trace, until + 2 * LIMIT_SMALL / trace->rate_hz);
	start = (trace_time(trace, first) - centre_s) / half_s;
	step = 1 / (trace->rate_hz * half_s);
	/* The orders in use, so that the compiler knows how often the loops go round. */
	if (terms == 7)
		local_add_up(&sums, trace, first, last, start, step, 7);
	else if (terms == 5)
		local_add_up(&sums, trace, first, last, start, step, 5);
	else
		local_add_up(&sums, trace, first, last, start, step, terms);
	if (sums.used < terms + 2)
		return false;
	for (unsigned i = 0; i < terms; i++) {
		for (unsigned j = 0; j <= i; j++)
			normal[i][j] = sums.moments[(i + j) / 2][(i + j) % 2];
		right[i] = sums.products[i / 2][i % 2];
	}
	if (!cholesky_factor(&local->normal, terms, normal))
		return false;
	cholesky_solve(&local->normal, right, local->coefficient);
	for (unsigned i = 0; i < terms; i++)
		sums.squares -= local->coefficient[i] * right[i];
	local->freedom = (unsigned)(sums.used - terms);
	local->residual_g = sqrt(fmax(sums.squares, 0) / local->freedom);
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
	double x = (time_s - local->centre_s) / local->half_s, power = 1;
	double row[CHOLESKY_MAX] = {0};

	for (unsigned d = 0; d < order; d++)
		power /= local->half_s;
	for (unsigned i = order; i < local->terms; i++) {
		row[i] = power;
		for (unsigned d = 0; d < order; d++)
			row[i] *= (double)(i - d);
		power *= x;
	}
	return sqrt(cholesky_variance(&local->normal, row));
}
