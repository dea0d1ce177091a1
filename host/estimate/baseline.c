/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/baseline.h"

#include <float.h>
#include <math.h>

#include "host/estimate/hum.h"
#include "host/estimate/limits.h"
#include "host/estimate/median.h"
#include "host/estimate/quiet.h"
#include "host/estimate/simd2.h"
#include "host/estimate/zero.h"

enum { DIFFERENCES_MIN = 16, BEGINNING = 16 };

/* What the last samples before a pulse are off those before them, of what they are off zero: at rest. */
#define AT_REST 0.25

/* Samples of a record's beginning for each of its rise: more than the foot of any pulse has. */
#define LINGERS 6.0

/* A sensor on a high-pass and gravity leave less. */
#define OFFSET_MIN_G 3.0

static const struct estimate_baseline nothing_found = {
        .noise_g = NAN, .deviation_g = NAN, .hum_hz = NAN, .from_s = NAN, .until_s = NAN};

static double noise_of_differences(const struct trace *trace, double *scratch)
{
	size_t n = 0;

	for (size_t k = 2; k < trace->count; k++)
		if (trace_good(trace, k - 2) && trace_good(trace, k - 1) && trace_good(trace, k))
			scratch[n++] =
			        fabs(trace->value_g[k - 2] - 2 * trace->value_g[k - 1] + trace->value_g[k]);
	if (n < DIFFERENCES_MIN)
		return NAN;
	return MAD_TO_SIGMA * median_find(scratch, n) / sqrt(6.0);
}

/* Of a quiet part that is long enough. */
static void baseline_measure(struct quiet *quiet, struct estimate_baseline *found)
{
	const struct trace *trace = quiet->trace;
	double half_s = (double)(quiet->until - quiet->from) / (2 * trace->rate_hz), sigma = 0;
	double about = quiet_glance(trace, quiet->from, quiet->until, &sigma);
	/* More than half of the samples equal: the median deviation is blind there. */
	double reach = sigma > 0 ? LIMIT_NOISE * sigma : DBL_MAX;
	struct quiet_moments inner = quiet_take(quiet, about, reach), plain = inner;
	struct hum_line line;

	if (inner.count < inner.good) {
		plain = quiet_take(quiet, about, DBL_MAX);
		reach = LIMIT_NOISE * inner.deviation; /* of many more samples than the glance took */
		inner = quiet_take(quiet, inner.mean, reach);
	}
	line = hum_find(quiet, half_s, &inner, reach);
	found->offset_g = inner.mean;
	found->noise_g = inner.deviation;
	found->deviation_g = plain.deviation;
	found->samples = inner.count;
	found->from_s = trace_time(trace, quiet->from);
	found->until_s = trace_time(trace, quiet->until - 1);
	found->doubtful = found->doubtful || quiet->doubtful ||
	                  (double)inner.count < (1 - LIMIT_KNOWN) * (double)inner.good;
	if (line.terms == 0)
		return;
	hum_note(&line, half_s, (double)quiet->length / trace->rate_hz, found);
	quiet->zero = found;
	found->noise_g = quiet_take(quiet, 0, reach).deviation;
	quiet->zero = NULL;
}

/* Once more without what moved before the pulse. */
static void measure_quietest(struct quiet *quiet, struct estimate_baseline *found)
{
	bool restless;

	baseline_measure(quiet, found);
	restless = quiet_restless(quiet, found->noise_g);
	if (!restless && !found->doubtful)
		return;
	if (quiet_settled(quiet)) {
		*found = nothing_found;
		baseline_measure(quiet, found);
		found->doubtful = found->unsettled = true;
		return;
	}
	if (!restless)
		return;
	found->doubtful = true;
	if (!quiet_narrow(quiet))
		return;
	*found = nothing_found;
	found->doubtful = true;
	baseline_measure(quiet, found);
}

/* The largest good sample, signed, and its place. */
static double baseline_largest(const struct trace *trace, size_t *at)
{
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++)
		if (trace_good(trace, k) && fabs(trace->value_g[k]) > fabs(most)) {
			most = trace->value_g[k];
			*at = k;
		}
	return most;
}

/* Whether it lingers where it begins: many more samples before the peak are nearer to the first than to the
 * peak than the other way round, which no rise is. */
static bool lingers(const struct trace *trace, double sign, double first, double peak, size_t at)
{
	size_t below = 0, above = 0;

	for (size_t k = 0; k < at; k++)
		if (trace_good(trace, k)) {
			bool is_above = sign * trace->value_g[k] > (first + peak) / 2;

			above += is_above;
			below += !is_above;
		}
	return (double)below > LINGERS * (double)(above + 1);
}

/* Of a record without a quiet part: whether it begins on something else than the rise of its pulse. Then it
 * is as high as the pulse from the first sample on, falls before it rises, or lingers far from 0. */
static bool begins_in_motion(const struct trace *trace, double noise_g)
{
	double low = INFINITY, first, sign, peak;
	size_t at = 0;

	if (trace->count < QUIET_SAMPLES_MIN)
		return false;
	peak = baseline_largest(trace, &at);
	sign = peak < 0 ? -1 : 1;
	first = sign * quiet_glance(trace, 0, BEGINNING, NULL);
	for (size_t k = 0; k < at; k++)
		if (trace_good(trace, k))
			low = fmin(low, sign * trace->value_g[k]);
	return fmin(first, low) > LIMIT_MOST * fabs(peak) ||
	       first - low > fmax(LIMIT_NOISE * noise_g, LIMIT_EDGE * fabs(peak)) ||
	       (first > LIMIT_EDGE * fabs(peak) && lingers(trace, sign, first, fabs(peak), at));
}

/* Mean of the good samples [from, until) without zero as it was found; *n of them. */
static double mean_off(const struct trace *trace, const struct estimate_baseline *found, size_t from,
                       size_t until, double *n)
{
	struct zero zero = zero_from(found, trace, from);
	double sum = 0;

	*n = 0;
	for (size_t k = from; k + 2 <= until; k += 2) {
		const PAIR here = zero_next(&zero);

		for (size_t i = 0; i < 2; i++)
			if (trace_good(trace, k + i)) {
				sum += trace->value_g[k + i] - here[i];
				++*n;
			}
	}
	return *n > 0 ? sum / *n : 0;
}

/* Whether zero, as it was found, is not that of the last samples before the pulse, which have come to rest:
 * the foot of a slow pulse has not. */
static bool ends_elsewhere(const struct quiet *quiet, const struct estimate_baseline *found)
{
	const struct trace *trace = quiet->trace;
	const size_t last = quiet->until - QUIET_SAMPLES_MIN;
	double noise = quiet_noise(trace, quiet->from, quiet->until), n, m;
	size_t at = 0;
	double off = mean_off(trace, found, last, quiet->until, &n), before = off;

	if (last >= quiet->from + QUIET_SAMPLES_MIN)
		before = mean_off(trace, found, last - QUIET_SAMPLES_MIN, last, &m);
	return fabs(off - before) < AT_REST * fabs(off) && fabs(off) > LIMIT_SURE * noise / sqrt(n) &&
	       fabs(off) > ESTIMATE_TOLERANCE * fabs(baseline_largest(trace, &at) - found->offset_g);
}

void baseline_find(const struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	struct estimate_baseline found = nothing_found;
	double length = ceil(QUIET_BLOCK_S * trace->rate_hz - 1e-6);
	struct quiet quiet = {.trace = trace};

	quiet_find(trace, &quiet.from, &quiet.until);
	if (quiet_enough(&quiet)) {
		quiet.length = length > 1 ? (size_t)length : 1;
		measure_quietest(&quiet, &found);
		if ((found.doubtful || fabs(found.drift_g_s) > 0) && ends_elsewhere(&quiet, &found))
			found.doubtful = found.unsettled = true;
	} else {
		found.noise_g = found.deviation_g = noise_of_differences(trace, scratch);
		found.doubtful = true;
		found.unsettled = begins_in_motion(trace, found.noise_g);
	}
	*baseline = found;
}

bool baseline_holds(const struct trace *trace, const struct estimate_baseline *baseline)
{
	size_t from, until;

	quiet_find(trace, &from, &until);
	if (baseline->samples == 0 || trace_index(trace, baseline->from_s) != from ||
	    trace_index(trace, baseline->until_s) + 1 != until)
		return false;
	return !trace_any(trace, baseline->from_s, baseline->until_s, SAMPLE_SPIKE | SAMPLE_BAD);
}

static void subtract(struct trace *trace, const struct estimate_baseline *baseline)
{
	double offset = baseline->offset_g, *value = trace->value_g;
	const size_t count = trace->count;
	size_t k = 0;

	if (baseline->hum_g > 0 || fabs(baseline->drift_g_s) > 0) {
		struct zero zero = zero_from(baseline, trace, 0);

		for (; k + 2 <= count; k += 2)
			pair_store(value + k, pair_load(value + k) - zero_next(&zero));
		if (k < count)
			value[k] -= zero_next(&zero)[0];
		trace_changed(trace);
		return;
	}
	for (; k + 8 <= count; k += 8) {
		pair_store(value + k, pair_load(value + k) - offset);
		pair_store(value + k + 2, pair_load(value + k + 2) - offset);
		pair_store(value + k + 4, pair_load(value + k + 4) - offset);
		pair_store(value + k + 6, pair_load(value + k + 6) - offset);
	}
	for (; k < count; k++)
		value[k] -= offset;
	for (size_t i = 0; i < trace_blocks(trace); i++) {
		trace->block[i].low_g -= offset;
		trace->block[i].high_g -= offset;
	}
}

void baseline_remove(struct trace *trace, const struct estimate_baseline *baseline)
{
	double offset = baseline->offset_g, most = 0;

	for (size_t i = 0; i < trace_blocks(trace); i++) {
		double high = trace->block[i].high_g - offset, low = offset - trace->block[i].low_g;

		most = high > most ? high : most;
		most = low > most ? low : most;
	}
	subtract(trace, baseline);
	if (fabs(offset) > fmax(OFFSET_MIN_G, LIMIT_PART * most))
		trace->flags |= RECORD_FLAG_OFFSET;
	if (baseline->doubtful && baseline->samples > 0)
		trace->flags |= RECORD_FLAG_ZERO_UNSURE;
	if (fabs(baseline->drift_g_s) > 0)
		trace->flags |= RECORD_FLAG_DRIFT;
	if (baseline->hum_g > 0)
		trace->flags |= RECORD_FLAG_HUM;
	trace->noise_g = baseline->noise_g;
	trace->hum_hz = baseline->hum_hz;
}
