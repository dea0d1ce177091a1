/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/lag.h"

#include <math.h>
#include <stddef.h>

enum {
	SHIFTS = 48,     /* tried to either side */
	BRIDGE_MAX = 64, /* samples missing in a row that are bridged; more count as 0 */
};

/* S2's pulse is taken this many widths to either side of its peak, and S1 shifted by up to that much. */
#define GATE_WIDTHS 1.1
#define REACH_WIDTHS 1.5

/* Sample k, or the straight line across the hole it lies in. Leaving holes out instead would favour the
 * shift at which the hole costs least. */
static double bridged(const struct trace *trace, ptrdiff_t k)
{
	ptrdiff_t before = k, after = k, count = (ptrdiff_t)trace->count;

	if (k < 0 || k >= count)
		return 0;
	if (trace_good(trace, (size_t)k))
		return trace->value_g[k];
	while (before >= 0 && k - before <= BRIDGE_MAX && !trace_good(trace, (size_t)before))
		before--;
	while (after < count && after - k <= BRIDGE_MAX && !trace_good(trace, (size_t)after))
		after++;
	if (before < 0 || after >= count || after - before > BRIDGE_MAX)
		return 0;
	return trace->value_g[before] + (trace->value_g[after] - trace->value_g[before]) *
	                                        (double)(k - before) / (double)(after - before);
}

/* Cubic through the four samples around time_s: a straight line would favour shifts by whole samples. */
static double smooth_at(const struct trace *trace, double time_s)
{
	double place = (time_s - trace->start_s) * trace->rate_hz, x;
	ptrdiff_t k;

	if (!(place >= 0) || place > (double)trace->count)
		return 0;
	k = (ptrdiff_t)place;
	x = place - (double)k;
	return -x * (x - 1) * (x - 2) / 6 * bridged(trace, k - 1) +
	       (x + 1) * (x - 1) * (x - 2) / 2 * bridged(trace, k) -
	       (x + 1) * x * (x - 2) / 2 * bridged(trace, k + 1) +
	       (x + 1) * x * (x - 1) / 6 * bridged(trace, k + 2);
}

/* Of S2's gated pulse with S1 shift_s later. */
static double correlate(const struct lag_sensor *s1, const struct lag_sensor *s2, double shift_s)
{
	double middle = s2->resultant->result.time_s, gate = GATE_WIDTHS * s2->resultant->width_s, sum = 0;

	for (unsigned i = 0; i < 2; i++) {
		const struct trace *trace = s2->axes.trace[i];
		size_t last = trace_index(trace, middle + gate);

		for (size_t k = trace_index(trace, middle - gate); k < last; k++)
			sum += bridged(trace, (ptrdiff_t)k) *
			       smooth_at(s1->axes.trace[i], trace_time(trace, k) + shift_s) / trace->rate_hz;
	}
	return sum;
}

/* NAN when the best shift lies at the end of the reach. */
static double cross_correlation(const struct lag_sensor *s1, const struct lag_sensor *s2)
{
	double step = REACH_WIDTHS * s2->resultant->width_s / SHIFTS, value[2 * SHIFTS + 1], bend;
	int top = 0;

	for (int i = 0; i <= 2 * SHIFTS; i++) {
		value[i] = correlate(s1, s2, (i - SHIFTS) * step);
		if (value[i] > value[top])
			top = i;
	}
	if (top == 0 || top == 2 * SHIFTS)
		return NAN;
	bend = value[top - 1] - 2 * value[top] + value[top + 1];
	if (!(bend < 0))
		return NAN;
	return ((top - SHIFTS) + (value[top - 1] - value[top + 1]) / (2 * bend)) * step;
}

static bool usable(const struct resultant *resultant)
{
	return isfinite(resultant->result.time_s);
}

void lag_find(const struct lag_sensor *s1, const struct lag_sensor *s2, struct estimate_lag *lag)
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

	if (found.status == ESTIMATE_OK || !usable(r1))
		found.status = r1->result.how.status;
	*lag = found;
	if (!usable(r1) || !usable(r2))
		return;
	lag->largest_peak_s = r1->result.time_s - r2->result.time_s;
	lag->first_peak_s = r1->first_peak_s - r2->first_peak_s;
	lag->cross_correlation_s = cross_correlation(s1, s2);
	/* fmax and fmin pass over a missing cross-correlation. */
	lag->spread_s = fmax(fmax(lag->first_peak_s, lag->largest_peak_s), lag->cross_correlation_s) -
	                fmin(fmin(lag->first_peak_s, lag->largest_peak_s), lag->cross_correlation_s);
	lag->sigma_s = hypot(r1->sigma_time_s, r2->sigma_time_s);
	if (lag->status == ESTIMATE_OK &&
	    (lag->spread_s > LAG_SPREAD_MAX_S || isnan(lag->cross_correlation_s)))
		lag->status = ESTIMATE_AMBIGUOUS;
}
