/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/crossings.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/modes.h"

/* Half-cycles without a swing after which there will be none. */
#define QUIET 2.5

enum { CROSSINGS_START = 3 };

static double meet(const struct trace *trace, size_t before, size_t after, double offset)
{
	double a = trace->value_g[before] - offset, b = trace->value_g[after] - offset;
	double from = trace_time(trace, before);

	return from + (trace_time(trace, after) - from) * a / (a - b);
}

static void note_swing(struct crossings *found, double value, const struct trace *trace, size_t k)
{
	unsigned i = found->count - 1;

	if (found->count == 0 || fabs(value) <= found->swing_g[i])
		return;
	found->swing_g[i] = fabs(value);
	found->swing_s[i] = trace_time(trace, k);
}

/* Whether time is so long after the latest crossing that the swings are over. */
static bool over(const struct crossings *found, double time)
{
	unsigned last = found->count - 1;

	return found->count > 1 &&
	       (time - found->time_s[last]) * last > QUIET * (found->time_s[last] - found->time_s[0]);
}

/* The end of the last block of [first, last) in which a sample may lie so far from the offset. */
static size_t loud_until(const struct trace *trace, size_t first, size_t last, double offset_g,
                         double threshold_g)
{
	size_t block = (last + TRACE_BLOCK - 1) / TRACE_BLOCK, end;

	while (block * TRACE_BLOCK > first && trace->block[block - 1].high_g - offset_g < threshold_g &&
	       offset_g - trace->block[block - 1].low_g < threshold_g)
		block--;
	end = block * TRACE_BLOCK;
	return end < last ? end : last;
}

void crossings_find(struct crossings *found, const struct trace *trace, size_t first, size_t last,
                    double offset_g, double threshold_g)
{
	double side = 0, early = NAN, late = NAN, value = 0, value_before = 0;
	size_t before = first, end = loud_until(trace, first, last, offset_g, threshold_g);

	memset(found, 0, sizeof(*found));
	for (size_t k = first; k < end && found->count < CROSSINGS_MAX; k++) {
		if (!trace_usable(trace, k))
			continue;
		value = trace->value_g[k] - offset_g;
		if (value * value_before < 0) {
			late = meet(trace, before, k, offset_g);
			early = isnan(early) ? late : early;
			if (over(found, late))
				return;
		}
		/* An exact zero belongs to neither side. */
		if (fabs(value) > 0) {
			before = k;
			value_before = value;
		}
		if (fabs(value) < threshold_g)
			continue;
		if (value * side < 0)
			found->time_s[found->count++] = (early + late) / 2;
		side = value > 0 ? 1 : -1;
		early = NAN;
		note_swing(found, value, trace, k);
	}
	/* Still under way when the samples ran out? */
	if (found->count > 1)
		found->ended = !over(found, trace_time(trace, end < last ? last - 1 : before));
	else
		found->ended = end == last && fabs(value) >= threshold_g;
}

/* Decay rate from the first swing to the last whole one, which the last crossing ends. */
static double swings_decay(const struct crossings *found, double omega)
{
	unsigned last = found->count - 2;
	double a = 0;

	if (found->swing_g[last] > 0 && found->swing_s[last] > found->swing_s[0])
		a = log(found->swing_g[0] / found->swing_g[last]) /
		    (found->swing_s[last] - found->swing_s[0]);
	/* A swing that noise lets grow decays all the same. */
	return fmin(fmax(a, LIMIT_PART * omega), MODES_DAMPING_MAX * omega);
}

bool crossings_start(const struct crossings *found, double *omega, double *decay)
{
	if (found->count < CROSSINGS_START)
		return false;
	*omega = UNITS_PI * (found->count - 1) / (found->time_s[found->count - 1] - found->time_s[0]);
	*decay = swings_decay(found, *omega);
	return true;
}
