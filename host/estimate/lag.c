/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/lag.h"

#include <math.h>
#include <stddef.h>

#include "host/estimate/interpolate.h"
#include "host/estimate/limits.h"

enum {
	SHIFTS = 48,     /* to either side */
	COARSE = 12,     /* shifts left out between the first ones tried */
	COARSE_USE = 16, /* samples used of S2's gate then */
};

/* S2's pulse is taken this many widths to either side of its peak, and S1 shifted by up to that much. */
#define GATE_WIDTHS 1.1
#define REACH_WIDTHS 1.5

/* Of S2's gated pulse with S1 shift_s later; about use samples of the gate, all when 0. */
static double correlate(const struct lag_sensor *s1, const struct lag_sensor *s2, double shift_s, size_t use)
{
	double middle = s2->resultant->result.time_s, gate = GATE_WIDTHS * s2->resultant->width_s, sum = 0;

	for (unsigned i = 0; i < 2; i++) {
		const struct trace *trace = s2->axes.trace[i];
		size_t first = trace_index(trace, middle - gate), last = trace_index(trace, middle + gate);
		size_t stride = use ? (last - first) / use + 1 : 1;
		double part = 0;

		for (size_t k = first; k < last; k += stride)
			part += bridge_sample(trace, (ptrdiff_t)k) *
			        interpolate_at(s1->axes.trace[i], trace_time(trace, k) + shift_s);
		sum += part * (double)stride / trace->rate_hz;
	}
	return sum;
}

/* The top of a parabola through three values, in steps from the middle one; NAN unless it has one. */
static double top_of(double before, double middle, double after)
{
	double bend = before - 2 * middle + after;

	return bend < 0 ? (before - after) / (2 * bend) : NAN;
}

/* The coarse shift that correlates best; SHIFTS to either side stand for an end of the reach. */
static int coarse_shift(const struct lag_sensor *s1, const struct lag_sensor *s2, double step)
{
	double value[2 * SHIFTS / COARSE + 1], offset;
	int top = 0;

	for (int i = 0; i <= 2 * SHIFTS / COARSE; i++) {
		value[i] = correlate(s1, s2, (COARSE * i - SHIFTS) * step, COARSE_USE);
		if (value[i] > value[top])
			top = i;
	}
	if (top == 0 || top == 2 * SHIFTS / COARSE)
		return COARSE * top - SHIFTS;
	offset = top_of(value[top - 1], value[top], value[top + 1]);
	return COARSE * top - SHIFTS + (int)lround(isnan(offset) ? 0 : COARSE * offset);
}

/* NAN when the best shift lies at the end of the reach. */
static double cross_correlation(const struct lag_sensor *s1, const struct lag_sensor *s2)
{
	double step = REACH_WIDTHS * s2->resultant->width_s / SHIFTS, before, middle, after;
	int at = coarse_shift(s1, s2, step);

	before = correlate(s1, s2, (at - 1) * step, 0);
	middle = correlate(s1, s2, at * step, 0);
	after = correlate(s1, s2, (at + 1) * step, 0);
	while (at > -SHIFTS && before > middle) {
		after = middle;
		middle = before;
		at--;
		before = correlate(s1, s2, (at - 1) * step, 0);
	}
	while (at < SHIFTS && after > middle) {
		before = middle;
		middle = after;
		at++;
		after = correlate(s1, s2, (at + 1) * step, 0);
	}
	if (at <= -SHIFTS || at >= SHIFTS)
		return NAN;
	return (at + top_of(before, middle, after)) * step;
}

static bool lag_usable(const struct resultant *resultant)
{
	return isfinite(resultant->result.time_s);
}

static void lag_combine(const struct driven axis[2], struct estimate_lag *lag)
{
	double weight[2] = {0, 0}, sum = 0, doubt = 0, both, apart;
	unsigned tried = 0;

	if (axis[0].smooth || axis[1].smooth)
		lag->driven.path[tried++] = "pulse";
	if (axis[0].sampled || axis[1].sampled)
		lag->driven.path[tried++] = "samples";
	for (unsigned i = 0; i < 2; i++) {
		lag->driven_axis_s[i] = axis[i].lag_s;
		lag->sigma_driven_axis_s[i] = axis[i].sigma_s;
		if (axis[i].status == ESTIMATE_OK && axis[i].sigma_s > 0) {
			/* By what each has of its own, which is nothing without noise. */
			weight[i] = 1 / fmax(pow(axis[i].sigma_s, 2) - pow(axis[i].doubt_s, 2),
			                     LIMIT_SMALL * pow(axis[i].sigma_s, 2));
			sum += weight[i] * axis[i].lag_s;
			doubt += weight[i] * axis[i].doubt_s;
			lag->driven.flags |= axis[i].flags;
			lag->driven.chi_square = fmax(lag->driven.chi_square, axis[i].chi_square);
		}
	}
	both = weight[0] + weight[1];
	lag->driven.status = axis[0].status;
	if (!(both > 0))
		return;
	lag->driven.status = ESTIMATE_OK;
	lag->driven.method = "driven-oscillator";
	lag->driven_s = sum / both;
	lag->sigma_driven_s = hypot(doubt / both, 1 / sqrt(both));
	apart = weight[0] > 0 && weight[1] > 0
	                ? fabs(axis[0].lag_s - axis[1].lag_s) / hypot(axis[0].sigma_s, axis[1].sigma_s)
	                : 0;
	if (apart > LIMIT_AGREE)
		lag->sigma_driven_s *= apart;
}

void lag_find(const struct lag_sensor *s1, const struct lag_sensor *s2, const struct driven driven[2],
              struct estimate_lag *lag)
{
	const struct resultant *r1 = s1->resultant, *r2 = s2->resultant;
	struct estimate_lag found = {
	        .first_peak_s = NAN,
	        .largest_peak_s = NAN,
	        .cross_correlation_s = NAN,
	        .spread_s = NAN,
	        .sigma_s = NAN,
	        .driven_s = NAN,
	        .sigma_driven_s = NAN,
	        .driven_axis_s = {NAN, NAN},
	        .sigma_driven_axis_s = {NAN, NAN},
	        .driven = {.method = "", .chi_square = NAN, .status = ESTIMATE_SHORT},
	        .status = r2->result.how.status,
	};

	if (found.status == ESTIMATE_OK || !lag_usable(r1))
		found.status = r1->result.how.status;
	*lag = found;
	lag_combine(driven, lag);
	if (!lag_usable(r1) || !lag_usable(r2))
		return;
	lag->largest_peak_s = r1->result.time_s - r2->result.time_s;
	lag->first_peak_s = r1->first_peak_s - r2->first_peak_s;
	lag->cross_correlation_s = cross_correlation(s1, s2);
	/* fmax and fmin pass over a missing cross-correlation. */
	lag->spread_s = fmax(fmax(lag->first_peak_s, lag->largest_peak_s), lag->cross_correlation_s) -
	                fmin(fmin(lag->first_peak_s, lag->largest_peak_s), lag->cross_correlation_s);
	lag->sigma_s = hypot(r1->result.sigma_time_s, r2->result.sigma_time_s);
	if (lag->status == ESTIMATE_OK &&
	    (lag->spread_s > LAG_SPREAD_MAX_S || isnan(lag->cross_correlation_s)))
		lag->status = ESTIMATE_AMBIGUOUS;
}
