/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/pulse.h"

#include <math.h>

#include "common/units.h"

#define EDGE_LEVEL 0.1

/* Standard deviation of the trapezoid's error at a kink, over its place x between two samples, in units of
 * slope times step squared: that of x (1 - x) / 2 for x uniform in 0..1, 1/sqrt(720). The two kinks of a
 * pulse may fall on the same place, so that their errors add up. */
#define KINK 0.0372677996249965

struct edge {
	double time_s;
	double slope_g_s; /* magnitude */
	double sigma_s;   /* at a known level */
};

/* |second difference| around sample k, 0 where a neighbour is missing. */
static double bend(const struct trace *trace, size_t k)
{
	if (k == 0 || k + 1 >= trace->count || !trace_good(trace, k - 1) || !trace_good(trace, k) ||
	    !trace_good(trace, k + 1))
		return 0;
	return fabs(trace->value_g[k - 1] - 2 * trace->value_g[k] + trace->value_g[k + 1]);
}

/* Where the pulse meets level_g on one side, and how well that is known: noise, the bend between the two
 * samples, and the hole when they are no neighbours. */
static bool find_edge(const struct trace *trace, const struct peak *peak, int step, double level_g,
                      struct edge *edge)
{
	size_t before, after;
	double gap, rise, missing;

	if (!trace_edge(trace, peak->at, step, peak->sign, level_g, &edge->time_s))
		return false;
	after = trace_index(trace, edge->time_s);
	if (after == 0)
		after = 1;
	before = after - 1;
	while (before > 0 && !trace_good(trace, before))
		before--;
	while (after + 1 < trace->count && !trace_good(trace, after))
		after++;
	gap = (double)(after - before) / trace->rate_hz;
	rise = fabs(trace->value_g[after] - trace->value_g[before]);
	missing = after - before > 1 ? gap / sqrt(12.0) : 0;
	edge->slope_g_s = rise / gap;
	edge->sigma_s =
	        hypot(trace->noise_g, fmax(bend(trace, before), bend(trace, after)) / 16) / edge->slope_g_s;
	edge->sigma_s = hypot(edge->sigma_s, missing);
	return true;
}

/* Trapezoid sum in g s. *hole_g_s: what a parabola as sharp as the pulse would hide in the holes. */
static double area(const struct trace *trace, double from_s, double until_s, double sharpness_g_s2,
                   double *hole_g_s)
{
	double sum = 0, time = from_s, value = 0, end = 0;

	*hole_g_s = 0;
	if (!trace_at(trace, from_s, &value))
		value = 0;
	for (size_t k = trace_index(trace, from_s); k < trace->count && trace_time(trace, k) <= until_s;
	     k++) {
		double step = trace_time(trace, k) - time;

		if (!trace_good(trace, k))
			continue;
		sum += step * (value + trace->value_g[k]) / 2;
		if (step * trace->rate_hz > 1.5)
			*hole_g_s += step * step * step / 12 * sharpness_g_s2;
		time = trace_time(trace, k);
		value = trace->value_g[k];
	}
	if (!trace_at(trace, until_s, &end))
		end = 0;
	return sum + (until_s - time) * (value + end) / 2;
}

static void velocity(const struct trace *trace, const struct peak *peak,
                     const struct estimate_baseline *baseline, const struct edge edge[2],
                     struct estimate_pulse *pulse)
{
	double from, until, length, sharpness, hole, step = 1 / trace->rate_hz, sigma;

	trace_edge(trace, peak->at, -1, peak->sign, 0, &from);
	trace_edge(trace, peak->at, 1, peak->sign, 0, &until);
	from = fmax(from, pulse->start_s - pulse->duration_s);
	until = fmin(until, pulse->end_s + pulse->duration_s);
	length = until - from;
	sharpness = fabs(peak->result.value_g) * pow(UNITS_PI / peak->width_s, 2);
	pulse->velocity_change_m_s = UNITS_G_M_S2 * area(trace, from, until, sharpness, &hole);
	sigma = hypot(trace->noise_g * sqrt(step * length), hole);
	sigma = hypot(sigma, KINK * step * step * (edge[0].slope_g_s + edge[1].slope_g_s));
	sigma = hypot(sigma, trace->noise_g * length / sqrt((double)baseline->samples));
	pulse->sigma_velocity_m_s = baseline->samples > 0 ? UNITS_G_M_S2 * sigma : NAN;
}

void pulse_measure(const struct trace *trace, const struct peak *peak,
                   const struct estimate_baseline *baseline, struct estimate_pulse *pulse)
{
	struct estimate_pulse found = {
	        .duration_s = NAN,
	        .sigma_duration_s = NAN,
	        .velocity_change_m_s = NAN,
	        .sigma_velocity_m_s = NAN,
	        .start_s = NAN,
	        .end_s = NAN,
	        .status = peak->result.how.status,
	        .contact_time_s = NAN,
	        .sigma_contact_s = NAN,
	        .contact_start_s = NAN,
	        .fitted_velocity_m_s = NAN,
	        .sigma_fitted_velocity_m_s = NAN,
	        .contact = {.method = "", .chi_square = NAN, .status = ESTIMATE_SHORT},
	};
	double level = EDGE_LEVEL * fabs(peak->result.value_g), tilt;
	struct edge edge[2];

	*pulse = found;
	if (found.status == ESTIMATE_SHORT || found.status == ESTIMATE_NO_PEAK)
		return;
	if (!find_edge(trace, peak, -1, level, &edge[0]) || !find_edge(trace, peak, 1, level, &edge[1])) {
		pulse->status = ESTIMATE_SHORT;
		return;
	}
	tilt = 1 / edge[0].slope_g_s + 1 / edge[1].slope_g_s;
	pulse->start_s = edge[0].time_s;
	pulse->end_s = edge[1].time_s;
	pulse->duration_s = pulse->end_s - pulse->start_s;
	pulse->sigma_duration_s =
	        hypot(hypot(edge[0].sigma_s, edge[1].sigma_s), EDGE_LEVEL * peak->result.sigma_g * tilt);
	velocity(trace, peak, baseline, edge, pulse);
}
