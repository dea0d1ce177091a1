/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/peak.h"

#include <math.h>

#include "host/estimate/crest.h"

#define NOISE_FACTOR_MIN 5.0
#define FOOT_LEVEL 0.05

/* A hole at the summit wider than this part of the width may hide more than the fit can know. */
#define HOLE_MAX 0.25

/* A half-sine is two thirds of its base wide at half height. */
#define BASE_PER_HALF_WIDTH 1.5

static size_t highest(const struct trace *trace, size_t *good)
{
	size_t at = trace->count;

	*good = 0;
	for (size_t k = trace->first; k < trace->last; k++) {
		if (!trace_good(trace, k))
			continue;
		if (at == trace->count || fabs(trace->value_g[k]) > fabs(trace->value_g[at]))
			at = k;
		(*good)++;
	}
	return at;
}

/* Half width and feet around the highest sample. A side cut off by the end of the trace is taken as wide
 * as the other one. */
static bool measure_width(const struct trace *trace, struct peak *peak)
{
	double value = fabs(trace->value_g[peak->at]), time = trace_time(trace, peak->at);
	double left, right;
	bool has_left = trace_edge(trace, peak->at, -1, peak->sign, value / 2, &left);
	bool has_right = trace_edge(trace, peak->at, 1, peak->sign, value / 2, &right);

	if (!has_left && !has_right)
		return false;
	left = time - left;
	right = right - time;
	if (!has_left)
		left = right;
	if (!has_right)
		right = left;
	peak->width_s = BASE_PER_HALF_WIDTH * (left + right);
	trace_edge(trace, peak->at, -1, peak->sign, FOOT_LEVEL * value, &peak->span.from_s);
	trace_edge(trace, peak->at, 1, peak->sign, FOOT_LEVEL * value, &peak->span.until_s);
	return true;
}

/* Time from the last good sample before time_s to the first one after it; INFINITY at the trace's ends. */
static double hole(const struct trace *trace, double time_s)
{
	size_t after = trace_index(trace, time_s), before = after;

	while (after < trace->count && !trace_good(trace, after))
		after++;
	while (before > 0 && !trace_good(trace, before - 1))
		before--;
	if (before == 0 || after == trace->count)
		return INFINITY;
	return (double)(after - before + 1) / trace->rate_hz;
}

/* The raw sample; it stands at a hole, or at an end of the trace. */
static void take_sample(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *result = &peak->result;
	size_t k = peak->at;

	result->how.method = "sample";
	result->value_g = trace->value_g[k];
	result->time_s = trace_time(trace, k);
	result->sigma_g = NAN;
	result->sigma_time_s = 1 / trace->rate_hz;
	result->how.status = ESTIMATE_AMBIGUOUS;
}

/* Top of the parabola through the highest sample and its neighbours. */
static bool take_parabola(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *result = &peak->result;
	size_t k = peak->at;
	double before, top, after, bend, shift, rise;

	if (k == 0 || k + 1 >= trace->count || !trace_good(trace, k - 1) || !trace_good(trace, k + 1))
		return false;
	before = trace->value_g[k - 1];
	top = trace->value_g[k];
	after = trace->value_g[k + 1];
	bend = before - 2 * top + after;
	if (!(peak->sign * bend < 0))
		return false;
	shift = (before - after) / (2 * bend);
	rise = (before - after) * shift / -4;
	result->how.method = "parabola";
	result->value_g = top + rise;
	result->time_s = trace_time(trace, k) + shift / trace->rate_hz;
	result->sigma_g = hypot(trace->noise_g, fmax(fabs(rise), fabs(bend) / 8));
	result->sigma_time_s = hypot(trace->noise_g / (sqrt(2.0) * bend), shift / 2) / trace->rate_hz;
	return true;
}

static bool take_crest(const struct trace *trace, struct peak *peak)
{
	const struct trace *axes[1] = {trace};
	struct estimate_peak *result = &peak->result;
	struct crest crest;

	if (!crest_fit(&crest, axes, 1, trace_time(trace, peak->at), peak->width_s, &peak->span))
		return false;
	result->how.method = "poly4/poly6";
	result->value_g = peak->sign * crest.value_g;
	result->sigma_g = crest.sigma_g;
	result->time_s = crest.time_s;
	result->sigma_time_s = crest.sigma_time_s;
	if (hole(trace, crest.time_s) > fmax(HOLE_MAX * peak->width_s, 1.5 / trace->rate_hz))
		result->how.status = ESTIMATE_AMBIGUOUS;
	return true;
}

/* Half the clipped time under the pulse; 0 if none. */
static double clipped_half(const struct trace *trace, const struct peak *peak)
{
	size_t k = trace_index(trace, peak->span.from_s), first = trace->count, last = 0;

	for (; k < trace->count && trace_time(trace, k) <= peak->span.until_s; k++) {
		if (!(trace->sample[k] & SAMPLE_CLIPPED))
			continue;
		if (first == trace->count)
			first = k;
		last = k;
	}
	return first == trace->count ? 0 : ((double)(last - first) + 1) / (2 * trace->rate_hz);
}

void peak_find(const struct trace *trace, struct peak *peak)
{
	struct peak found = {.result = {NAN,
	                                NAN,
	                                NAN,
	                                NAN,
	                                {.method = "sample", .chi_square = NAN, .status = ESTIMATE_SHORT}}};
	size_t good;
	double half;

	found.at = highest(trace, &good);
	*peak = found;
	if (good < 3)
		return;
	peak->sign = trace->value_g[found.at] < 0 ? -1 : 1;
	if (!(fabs(trace->value_g[found.at]) > 0) ||
	    fabs(trace->value_g[found.at]) < NOISE_FACTOR_MIN * trace->noise_g) {
		peak->result.how.status = ESTIMATE_NO_PEAK;
		return;
	}
	if (!measure_width(trace, peak))
		return;
	peak->result.how.status = ESTIMATE_OK;
	if (!take_crest(trace, peak) && !take_parabola(trace, peak))
		take_sample(trace, peak);
	half = clipped_half(trace, peak);
	if (half > 0) {
		peak->result.how.status = ESTIMATE_CLIPPED;
		peak->result.sigma_g = NAN;
		peak->result.sigma_time_s = fmax(peak->result.sigma_time_s, half);
	}
}
