/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/control_variate.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/phasor.h"

/* The bulge moves an edge by little: each round leaves a hundredth of that. */
enum { EDGE_ROUNDS = 4 };

bool control_variate_from_shape(const struct shape *shape, struct control_variate *variate)
{
	if (isnan(shape->chi_square))
		return false;
	variate->curve = (struct cosine_pulse){.height_g = shape->peak_g,
	                                       .centre_s = shape->peak_s,
	                                       .base_s = shape->base_s,
	                                       .power = shape->power};
	variate->area_g_s = shape->area_g_s;
	variate->sigma_peak_g = shape->sigma_peak_g;
	variate->sigma_base_s = shape->power <= 1 ? shape->sigma_base_s : 0;
	return true;
}

bool control_variate_from_cosine_pulse(const struct trace *trace, const struct peak *peak,
                                       struct control_variate *variate)
{
	if (!(trace->noise_g > 0) || !cosine_pulse_fit(trace, peak, &variate->curve))
		return false;
	variate->area_g_s = cosine_pulse_area(&variate->curve);
	variate->sigma_peak_g = peak->result.sigma_g;
	variate->sigma_base_s = 0;
	return true;
}

/* Sum of the good samples in between in g s; *n of them. */
static double control_variate_beyond_sum(const struct trace *trace, double from_s, double until_s, double *n)
{
	double sum = 0;

	*n = 0;
	for (size_t k = trace_index(trace, from_s); k < trace->count && trace_time(trace, k) < until_s; k++) {
		if (!trace_usable(trace, k))
			continue;
		sum += trace->value_g[k];
		(*n)++;
	}
	return sum / trace->rate_hz;
}

bool control_variate_ends(const struct control_variate *variate, const struct trace *trace)
{
	double half = variate->curve.base_s / 2, centre = variate->curve.centre_s, n;

	for (int side = -1; side <= 1; side += 2) {
		double sum = control_variate_beyond_sum(trace, centre + (side < 0 ? -2 : 1) * half,
		                                        centre + (side < 0 ? -1 : 2) * half, &n);

		if (fabs(sum) > LIMIT_PART * fabs(variate->area_g_s) &&
		    fabs(sum) > LIMIT_AGREE * trace->noise_g * sqrt(n) / trace->rate_hz)
			return false;
	}
	return true;
}

/* Cosine of the angle at which the curve is level parts of its height; negative where there is none. */
static double edge_cosine(const struct cosine_pulse *curve, double level)
{
	const int rounds = fabs(curve->bulge) > 0 ? EDGE_ROUNDS : 1;
	double c = 0;

	for (int i = 0; i < rounds; i++)
		c = pow(level / (1 + curve->bulge * (1 - c * c)), 1 / curve->power);
	return level > 0 && c < 1 ? c : -1;
}

/* What a sample says beyond the curve, in the pulse's direction. */
static double control_variate_beyond(const struct control_variate *variate, const struct trace *trace,
                                     size_t k)
{
	double over = trace->value_g[k] - cosine_pulse_at(&variate->curve, trace_time(trace, k));

	return variate->curve.height_g < 0 ? -over : over;
}

bool control_variate_edge(const struct control_variate *variate, const struct trace *trace, int step,
                          double level_g, struct control_variate_edge *edge)
{
	const struct cosine_pulse *curve = &variate->curve;
	double height = fabs(curve->height_g), c = edge_cosine(curve, level_g / height), half, place, outside;
	size_t after;

	if (!(c > 0))
		return false;
	half = acos(c) * curve->base_s / UNITS_PI;
	edge->time_s = curve->centre_s + step * half;
	after = trace_index(trace, edge->time_s);
	if (after == 0 || after == trace->count || !trace_good(trace, after - 1) || !trace_good(trace, after))
		return false;
	place = (edge->time_s - trace_time(trace, after - 1)) * trace->rate_hz;
	edge->slope_g_s = UNITS_PI / curve->base_s * sqrt(1 - c * c) *
	                  (curve->power * level_g / c - 2 * height * curve->bulge * pow(c, curve->power + 1));
	if (!(edge->slope_g_s > 0))
		return false;
	edge->sigma_s = trace->noise_g * hypot(place, 1 - place) / edge->slope_g_s;
	outside = step < 0 ? 1 - place : place;
	edge->stays = edge->taken = 0;
	if (half + (1 - outside) / trace->rate_hz > curve->base_s / 2) {
		edge->stays = outside;
		edge->taken = 1 - outside;
	}
	edge->time_s += step *
	                ((1 - place) * control_variate_beyond(variate, trace, after - 1) +
	                 place * control_variate_beyond(variate, trace, after)) /
	                edge->slope_g_s;
	return true;
}

double control_variate_spread(const struct control_variate *variate,
                              const struct control_variate_edge edge[2])
{
	double stays = (edge[0].stays + edge[1].stays) / 2, taken = (edge[0].taken + edge[1].taken) / 2;
	/* The base hangs on the very samples that correct it. */
	double foot = variate->sigma_base_s * sqrt(stays * (stays + 2 * taken));

	return hypot(foot, hypot(edge[0].sigma_s, edge[1].sigma_s));
}

double control_variate_area(const struct control_variate *variate, const struct trace *trace,
                            const struct peak *peak, double *sigma_g_s)
{
	const struct cosine_pulse *curve = &variate->curve;
	double turn = UNITS_PI / curve->base_s, step = 1 / trace->rate_hz, sum = 0;
	size_t k = trace_index(trace, curve->centre_s - curve->base_s / 2), used = 0, follow = 0;
	double angle = turn * (trace_time(trace, k) - curve->centre_s);
	struct phasor at = phasor_at(angle, turn * step);

	for (; k < trace->count && angle < UNITS_PI / 2; k++, angle += turn * step) {
		double time = trace_time(trace, k), cosine = fmax(at.cosine, 0);

		phasor_turn(&at);
		if (!trace_good(trace, k) || (time > peak->clipped_from_s && time < peak->clipped_until_s)) {
			follow++;
			continue;
		}
		used++;
		sum += trace->value_g[k] - cosine_pulse_of(curve, cosine);
	}
	/* What stands in for a missing sample is a mean of the others: it errs as they do. */
	*sigma_g_s = step * hypot(trace->noise_g * sqrt((double)(used + 2 * follow)),
	                          variate->sigma_peak_g * (double)follow);
	return variate->area_g_s + step * sum;
}
