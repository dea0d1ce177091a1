/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/trace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Beyond any sensor; keeps squares and sums far from overflow. */
#define VALUE_MAX_G 1e9

enum { EQUAL_EXTREMES = 3 };

static void mark_bad(struct trace *trace)
{
	for (size_t k = 0; k < trace->count; k++) {
		if (isfinite(trace->value_g[k]) && fabs(trace->value_g[k]) <= VALUE_MAX_G)
			continue;
		if (trace_good(trace, k)) {
			trace->sample[k] |= SAMPLE_BAD;
			trace->flags |= RECORD_FLAG_BAD;
		}
		trace->value_g[k] = NAN;
	}
}

/* Marks runs of EQUAL_EXTREMES or more good samples that equal the extreme. */
static void mark_runs(struct trace *trace, double extreme_g)
{
	size_t run = 0;

	for (size_t k = 0; k <= trace->count; k++) {
		if (k < trace->count && trace_good(trace, k) && !(trace->value_g[k] < extreme_g) &&
		    !(trace->value_g[k] > extreme_g)) {
			run++;
			continue;
		}
		if (run >= EQUAL_EXTREMES) {
			trace->flags |= RECORD_FLAG_CLIPPED;
			for (size_t i = k - run; i < k; i++)
				trace->sample[i] |= SAMPLE_CLIPPED;
		}
		run = 0;
	}
}

/* A sensor at its limit repeats its extreme. Only extremes on the outside count: half the largest
 * magnitude or more, so that the small side of a one-sided shock is not taken for one. */
static void mark_clipped(struct trace *trace)
{
	double low = INFINITY, high = -INFINITY;

	for (size_t k = 0; k < trace->count; k++) {
		if (!trace_good(trace, k))
			continue;
		low = fmin(low, trace->value_g[k]);
		high = fmax(high, trace->value_g[k]);
	}
	if (!(high > low))
		return;
	if (high >= -low / 2)
		mark_runs(trace, high);
	if (-low >= high / 2)
		mark_runs(trace, low);
}

int trace_open(struct trace *trace, const struct channel *channel, double from_s, double until_s)
{
	struct trace opened = {.rate_hz = channel->rate_hz, .start_s = channel->start_s, .noise_g = NAN};
	size_t count = channel->count;

	/* Without a rate no sample has a time. */
	if (!isfinite(channel->rate_hz) || channel->rate_hz <= 0 || !isfinite(channel->start_s)) {
		count = 0;
		opened.rate_hz = 1;
		opened.start_s = 0;
	}
	opened.value_g = malloc((count + 1) * sizeof(*opened.value_g));
	opened.sample = malloc(count + 1);
	if (!opened.value_g || !opened.sample) {
		trace_close(&opened);
		return DT_E_MEMORY;
	}
	if (count > 0) {
		memcpy(opened.value_g, channel->value_g, count * sizeof(*opened.value_g));
		memcpy(opened.sample, channel->sample, count);
	}
	opened.count = count;
	opened.flags = channel->flags;
	mark_bad(&opened);
	mark_clipped(&opened);
	opened.first = trace_index(&opened, from_s);
	opened.last = trace_index(&opened, until_s);
	*trace = opened;
	return 0;
}

void trace_close(struct trace *trace)
{
	free(trace->value_g);
	free(trace->sample);
	trace->value_g = NULL;
	trace->sample = NULL;
}

size_t trace_index(const struct trace *trace, double time_s)
{
	double k = ceil((time_s - trace->start_s) * trace->rate_hz - 1e-6);

	if (!(k > 0))
		return 0;
	return k >= (double)trace->count ? trace->count : (size_t)k;
}

bool trace_at(const struct trace *trace, double time_s, double *value_g)
{
	double place = (time_s - trace->start_s) * trace->rate_hz;
	size_t k;

	if (trace->count < 2 || !(place >= 0) || place > (double)(trace->count - 1))
		return false;
	k = (size_t)place;
	if (k == trace->count - 1)
		k--;
	if (!trace_good(trace, k) || !trace_good(trace, k + 1))
		return false;
	place -= (double)k;
	*value_g = trace->value_g[k] + place * (trace->value_g[k + 1] - trace->value_g[k]);
	return true;
}

bool trace_edge(const struct trace *trace, size_t k, int step, double sign, double level_g, double *time_s)
{
	size_t inside = k;

	for (;;) {
		if (step < 0 ? k == 0 : k + 1 >= trace->count)
			break;
		k = step < 0 ? k - 1 : k + 1;
		if (!trace_good(trace, k))
			continue;
		if (sign * trace->value_g[k] < level_g) {
			double above = sign * trace->value_g[inside] - level_g;
			double below = level_g - sign * trace->value_g[k];
			double from = trace_time(trace, inside), to = trace_time(trace, k);

			*time_s = above > 0 ? from + (to - from) * above / (above + below) : from;
			return true;
		}
		inside = k;
	}
	*time_s = trace_time(trace, inside);
	return false;
}

bool trace_any(const struct trace *trace, double from_s, double until_s, unsigned bits)
{
	for (size_t k = trace_index(trace, from_s); k < trace->count; k++) {
		if (trace_time(trace, k) > until_s)
			return false;
		if (trace->sample[k] & bits)
			return true;
	}
	return false;
}
