/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/bridge.h"

#include <stddef.h>
#include <string.h>

/* The straight line across the hole around k. */
static double across(const struct trace *trace, ptrdiff_t k)
{
	ptrdiff_t before = k, after = k, count = (ptrdiff_t)trace->count;

	while (before >= 0 && k - before <= BRIDGE_MAX && !trace_good(trace, (size_t)before))
		before--;
	while (after < count && after - k <= BRIDGE_MAX && !trace_good(trace, (size_t)after))
		after++;
	if (before < 0 || after >= count || after - before > BRIDGE_MAX)
		return 0;
	return trace->value_g[before] + (trace->value_g[after] - trace->value_g[before]) *
	                                        (double)(k - before) / (double)(after - before);
}

double bridge_sample(const struct trace *trace, ptrdiff_t k)
{
	if (k < 0 || k >= (ptrdiff_t)trace->count)
		return 0;
	return trace_good(trace, (size_t)k) ? trace->value_g[k] : across(trace, k);
}

/* Whether four samples carry no mark at all. */
static bool all_good(const uint8_t *sample)
{
	uint32_t four;

	memcpy(&four, sample, sizeof(four));
	return four == 0;
}

/* A straight line would favour whole samples. */
double bridge_at(const struct trace *trace, double time_s)
{
	double place = (time_s - trace->start_s) * trace->rate_hz, x;
	ptrdiff_t k;
	double value[4];

	if (!(place >= 0) || place > (double)trace->count)
		return 0;
	k = (ptrdiff_t)place;
	x = place - (double)k;
	if (k >= 1 && k + 2 < (ptrdiff_t)trace->count && all_good(trace->sample + k - 1))
		memcpy(value, trace->value_g + k - 1, sizeof(value));
	else
		for (ptrdiff_t i = 0; i < 4; i++)
			value[i] = bridge_sample(trace, k - 1 + i);
	return (1 + x) * (2 - x) / 2 * ((1 - x) * value[1] + x * value[2]) -
	       x * (1 - x) / 6 * ((2 - x) * value[0] + (1 + x) * value[3]);
}
