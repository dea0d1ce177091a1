/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/clip.h"

#include <math.h>

#include "host/estimate/limits.h"

enum {
	EQUAL_EXTREMES = 3,
	EQUAL_APART = 3, /* noise may keep samples between them below the limit */
};

/* Where samples tremble by so many steps of their numbers, two do not come out equal by chance. */
#define TREMBLE_STEPS 200.0

/* The largest that both are whole numbers of, to rounding. */
static double clip_common(double a, double b)
{
	double least = LIMIT_LEAST * fmin(a, b);

	while (b > least) {
		double rest = fabs(remainder(a, b));

		a = b;
		b = rest;
	}
	return a;
}

double clip_step(const struct trace *trace)
{
	double least = INFINITY, common = 0;

	for (size_t k = 1; k < trace->count && (k < CLIP_WINDOW || !isfinite(least)); k++) {
		double rise = fabs(trace->value_g[k] - trace->value_g[k - 1]);

		if (!trace_good(trace, k) || !trace_good(trace, k - 1) || !(rise > 0))
			continue;
		if (k < CLIP_WINDOW)
			least = fmin(least, rise);
		else /* the beginning is level */
			common = common > 0 ? clip_common(rise, common) : rise;
	}
	return isfinite(least) ? least : common;
}

/* Whether samples tremble by many steps of the numbers they come in. */
static bool trembles(const struct trace *trace, double steps)
{
	double least = clip_step(trace);
	size_t n = 0, wide = 0;

	for (size_t k = 1; k < trace->count && k < CLIP_WINDOW; k++) {
		if (!trace_good(trace, k) || !trace_good(trace, k - 1))
			continue;
		n++;
		wide += fabs(trace->value_g[k] - trace->value_g[k - 1]) > steps * least;
	}
	return 2 * wide > n;
}

static bool clip_whole(double steps)
{
	return fabs(steps) < 1 / LIMIT_SMALL && fabs(steps - round(steps)) < LIMIT_LEAST;
}

/* Steps show as stairs, one side of which has levels between its rises, or as rises of three sizes. Straight
 * lines without noise are equal rises too, and come in any numbers. */
struct stairs {
	double last, size[2]; /* steps of the last rise, of other ones */
	unsigned sizes;
	bool level, seen;
};

static void clip_climb(struct stairs *stairs, double steps)
{
	const double size = fabs(steps);

	if (size == 0) {
		stairs->level = true;
		return;
	}
	stairs->seen |= stairs->level && stairs->last * steps > 0;
	if (size != stairs->size[0] && size != stairs->size[1]) {
		stairs->size[stairs->sizes % 2] = size;
		stairs->sizes++;
	}
	stairs->last = steps;
	stairs->level = false;
}

double clip_resolution(const struct trace *trace, double noise_g)
{
	double step = clip_step(trace);
	struct stairs stairs = {0};

	if (!(noise_g < step / 2))
		return 0;
	for (size_t k = trace->first + 1; k < trace->last; k++) {
		double steps = (trace->value_g[k] - trace->value_g[k - 1]) / step;

		if (!trace_good(trace, k) || !trace_good(trace, k - 1))
			continue;
		if (!clip_whole(steps))
			return 0;
		clip_climb(&stairs, round(steps));
	}
	return stairs.seen || stairs.sizes > 2 ? step : 0;
}

/* Whether those beside a group, and it, are whole steps apart. */
static bool clip_coarse(const struct trace *trace, size_t first, size_t last)
{
	const double *v = trace->value_g;
	double step = clip_step(trace);

	return first >= 2 && last + 1 < trace->count && clip_whole((v[first] - v[first - 1]) / step) &&
	       clip_whole((v[first] - v[last + 1]) / step) && clip_whole((v[first] - v[first - 2]) / step);
}

/* The samples to either side that foretell: the next, and some further out than half of what they are about.
 */
static size_t clip_aside(size_t first, size_t last)
{
	return 2 + (last - first) / 4;
}

/* Whether they foretell more than the equal ones show: a parabola through them, about their middle, and each
 * side of it alone, which a corner's level side does not. */
static bool clip_foretold(const struct trace *trace, size_t first, size_t last, double noise_g)
{
	const double *v = trace->value_g;
	size_t aside = clip_aside(first, last);
	double half = (double)(last - first) / 2, square = (half + 1) * (half + 1);
	double reach = square / ((half + (double)aside) * (half + (double)aside) - square);
	double near = (v[first - 1] + v[last + 1]) / 2, far = (v[first - aside] + v[last + aside]) / 2;
	double beyond = near + reach * (near - far) - v[first];
	double before = v[first - 1] + reach * (v[first - 1] - v[first - aside]) - v[first];
	double after = v[last + 1] + reach * (v[last + 1] - v[last + aside]) - v[first];
	double sigma = sqrt(((1 + reach) * (1 + reach) + reach * reach) / 2 + 0.5) *
	               hypot(noise_g, clip_step(trace) / sqrt(12.0));
	double sign = v[first] < 0 ? -1 : 1;

	return fmin(sign * before, sign * after) > LIMIT_HINT * sigma &&
	       sign * beyond > LIMIT_SIGNIFICANT * sigma + LIMIT_EDGE * fabs(v[first] - near);
}

/* Whether n equal extremes make a limit: one at the known range, others where chance cannot make them equal,
 * or where those beside foretell more once noise is known. */
static bool enough(const struct trace *trace, size_t first, size_t last, size_t n, double noise_g)
{
	double extreme = fabs(trace->value_g[first]);
	size_t aside = clip_aside(first, last);

	if (trace->range_g > 0 && fabs(extreme - trace->range_g) <= 1e-9 * trace->range_g)
		return true;
	if (trace->step_g > 0) /* coarser than noise: a level top reads so, whatever made it (doubt.h) */
		return false;
	if (trembles(trace, n < EQUAL_EXTREMES ? TREMBLE_STEPS : CLIP_TREMBLE))
		return n >= EQUAL_EXTREMES - 1;
	if (n >= EQUAL_EXTREMES && !clip_coarse(trace, first, last))
		return true;
	if (!isfinite(noise_g) || n < 2 ||
	    n <= last - first) /* noise does not fall below a limit by chance */
		return false;
	if (first >= aside && last + aside < trace->count && trace_good(trace, first - aside) &&
	    trace_good(trace, first - 1) && trace_good(trace, last + 1) && trace_good(trace, last + aside))
		return clip_foretold(trace, first, last, noise_g);
	return n >= EQUAL_EXTREMES;
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

static void mark_groups(struct trace *trace, double extreme_g, double noise_g)
{
	size_t k = next_extreme(trace, 0, extreme_g);

	while (k < trace->count) {
		size_t first = k, last = k, n = 0;

		for (; k < trace->count && k - last <= EQUAL_APART;
		     k = next_extreme(trace, k + 1, extreme_g)) {
			last = k;
			n++;
		}
		if (2 * n <= last - first || !enough(trace, first, last, n, noise_g))
			continue;
		trace->flags |= RECORD_FLAG_CLIPPED;
		for (size_t i = first; i <= last; i++)
			if (at_extreme(trace, i, extreme_g))
				trace->sample[i] |= SAMPLE_CLIPPED | TRACE_LIMIT;
	}
}

void clip_mark(struct trace *trace, double noise_g)
{
	double low = INFINITY, high = -INFINITY;

	for (size_t i = 0; i < trace_blocks(trace); i++) {
		low = trace->block[i].low_g < low ? trace->block[i].low_g : low;
		high = trace->block[i].high_g > high ? trace->block[i].high_g : high;
	}
	if (!(high > low))
		return;
	if (high >= -low / 2)
		mark_groups(trace, high, noise_g);
	if (-low >= high / 2)
		mark_groups(trace, low, noise_g);
}
