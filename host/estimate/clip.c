/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/clip.h"

#include <math.h>

#include "host/estimate/limits.h"

enum {
	EQUAL_EXTREMES = 3,
	EQUAL_APART = 3,         /* noise may keep samples between them below the limit */
	COARSENESS_WINDOW = 256, /* samples the step of the numbers is looked for in */
};

/* Where samples tremble by so many steps of their numbers, two do not come out equal by chance. */
#define TREMBLE_STEPS 200.0

/* Whether samples tremble by many steps of the numbers they come in. */
static bool trembles(const struct trace *trace)
{
	double least = INFINITY;
	size_t n = 0, wide = 0;

	for (int pass = 0; pass < 2; pass++) {
		for (size_t k = 1; k < trace->count && k < COARSENESS_WINDOW; k++) {
			double rise;

			if (!trace_good(trace, k) || !trace_good(trace, k - 1))
				continue;
			rise = fabs(trace->value_g[k] - trace->value_g[k - 1]);
			if (pass == 0) {
				least = rise > 0 ? fmin(least, rise) : least;
				n++;
			} else if (rise > TREMBLE_STEPS * least) {
				wide++;
			}
		}
	}
	return 2 * wide > n;
}

/* Whether so many equal extremes make a limit: one at the known range, two where chance cannot make them
 * equal. */
static bool enough(const struct trace *trace, double extreme_g, size_t n)
{
	if (n >= EQUAL_EXTREMES)
		return true;
	if (trace->range_g > 0 && fabs(fabs(extreme_g) - trace->range_g) <= 1e-9 * trace->range_g)
		return true;
	return n == EQUAL_EXTREMES - 1 && trembles(trace);
}

static bool at_extreme(const struct trace *trace, size_t k, double extreme_g)
{
	return trace_good(trace, k) && !(trace->value_g[k] < extreme_g) && !(trace->value_g[k] > extreme_g);
}

/* The first sample from k on that equals the extreme; count when there is none. */
static size_t next_extreme(const struct trace *trace, size_t k, double extreme_g)
{
	for (size_t i = k / TRACE_BLOCK, end; i < trace_blocks(trace); i++, k = end) {
		end = (i + 1) * TRACE_BLOCK;
		if (trace->block[i].low_g > extreme_g || trace->block[i].high_g < extreme_g)
			continue;
		for (; k < end && k < trace->count; k++)
			if (at_extreme(trace, k, extreme_g))
				return k;
	}
	return trace->count;
}

static void mark_groups(struct trace *trace, double extreme_g)
{
	size_t k = next_extreme(trace, 0, extreme_g);

	while (k < trace->count) {
		size_t first = k, last = k, n = 0;

		for (; k < trace->count && k - last <= EQUAL_APART;
		     k = next_extreme(trace, k + 1, extreme_g)) {
			last = k;
			n++;
		}
		if (n == 2 && last - first == 1)
			trace->twins = first;
		if (!enough(trace, extreme_g, n) || 2 * n <= last - first)
			continue;
		trace->flags |= RECORD_FLAG_CLIPPED;
		for (size_t i = first; i <= last; i++)
			if (at_extreme(trace, i, extreme_g))
				trace->sample[i] |= SAMPLE_CLIPPED | TRACE_LIMIT;
	}
}

void clip_mark(struct trace *trace)
{
	double low = INFINITY, high = -INFINITY;

	trace->twins = trace->count;
	for (size_t i = 0; i < trace_blocks(trace); i++) {
		low = trace->block[i].low_g < low ? trace->block[i].low_g : low;
		high = trace->block[i].high_g > high ? trace->block[i].high_g : high;
	}
	if (!(high > low))
		return;
	if (high >= -low / 2)
		mark_groups(trace, high);
	if (-low >= high / 2)
		mark_groups(trace, low);
}

void clip_judge_twins(struct trace *trace, double noise_g)
{
	size_t k = trace->twins;
	const double *v = trace->value_g + k;
	double near, far, beyond;

	if (k < 2 || k + 4 > trace->count || trace->sample[k] & TRACE_LIMIT || !trace_good(trace, k - 2) ||
	    !trace_good(trace, k - 1) || !trace_good(trace, k + 2) || !trace_good(trace, k + 3))
		return;
	/* Means of the pairs 1.5 and 2.5 samples from the middle; the twins are 0.5 from it. */
	near = (v[-1] + v[2]) / 2;
	far = (v[-2] + v[3]) / 2;
	beyond = near + (near - far) / 2 - v[0];
	if (!(beyond * (v[0] - near) > 0) || !(fabs(beyond) > LIMIT_AGREE * sqrt(1.75) * noise_g))
		return;
	trace->flags |= RECORD_FLAG_CLIPPED;
	trace->sample[k] |= SAMPLE_CLIPPED | TRACE_LIMIT;
	trace->sample[k + 1] |= SAMPLE_CLIPPED | TRACE_LIMIT;
}
