/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_INTERPOLATE_H
#define DT_HOST_ESTIMATE_INTERPOLATE_H
/*
 * What stands in for missing samples, and a trace as a function of time where one is needed between samples.
 *
 * A hole of up to INTERPOLATE_CUBIC samples is the cubic through the two good samples on either side, a
 * longer one or one beside another hole the straight line. As a function of time a trace is the cubic through
 * the four samples around; holes of more than INTERPOLATE_MAX samples and what lies outside are 0 there.
 * Leaving holes out instead would favour the shift at which the hole costs least.
 */
#include <stddef.h>
#include <string.h>

#include "host/estimate/trace.h"

enum { INTERPOLATE_CUBIC = 10, INTERPOLATE_MAX = 64 };

/* Sample k of the hole [from, until), between good samples. */
double interpolate_over(const struct trace *trace, size_t from, size_t until, size_t k);

/* Sample k where it is missing or outside. */
double interpolate_hole(const struct trace *trace, ptrdiff_t k);

static inline double bridge_sample(const struct trace *trace, ptrdiff_t k)
{
	return k >= 0 && k < (ptrdiff_t)trace->count && trace_good(trace, (size_t)k)
	               ? trace->value_g[k]
	               : interpolate_hole(trace, k);
}

/* Whether the four samples from k on are there and carry no mark at all. */
static inline bool bridge_plain(const struct trace *trace, ptrdiff_t k)
{
	uint32_t four;

	if (k < 0 || k + 3 >= (ptrdiff_t)trace->count)
		return false;
	memcpy(&four, trace->sample + k, sizeof(four));
	return four == 0;
}

/* A straight line would favour whole samples. */
static inline double interpolate_at(const struct trace *trace, double time_s)
{
	double place = (time_s - trace->start_s) * trace->rate_hz, x, value[4];
	ptrdiff_t k;

	if (!(place >= 0) || place > (double)trace->count)
		return 0;
	k = (ptrdiff_t)place;
	x = place - (double)k;
	if (bridge_plain(trace, k - 1))
		memcpy(value, trace->value_g + k - 1, sizeof(value));
	else
		for (ptrdiff_t i = 0; i < 4; i++)
			value[i] = bridge_sample(trace, k - 1 + i);
	return (1 + x) * (2 - x) / 2 * ((1 - x) * value[1] + x * value[2]) -
	       x * (1 - x) / 6 * ((2 - x) * value[0] + (1 + x) * value[3]);
}

#endif
