/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/signal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/clean.h"
#include "host/estimate/interpolate.h"

#define EVENT_LEVEL 0.05 /* of the largest */
#define MISSING_MAX 0.1  /* part of all samples */
#define END_PART 0.01    /* of the samples: the last ones */

const char *signal_flag_name(unsigned flags)
{
	static const char *const names[] = {"bridged", "offset_unknown", "not_ended", "refused",
	                                    "above_half_rate"};

	for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		if (flags & (1u << i))
			return names[i];
	return "";
}

/* ---- holes ---- */

/* One hole [from, until) between good samples; false when it is too long for where it is. */
static bool signal_bridge(const struct trace *trace, double *value, size_t from, size_t until, double quiet_g,
                          double zero_g)
{
	if (until - from > INTERPOLATE_CUBIC && !(fabs(trace->value_g[from - 1] - zero_g) < quiet_g &&
	                                          fabs(trace->value_g[until] - zero_g) < quiet_g))
		return false;
	for (size_t k = from; k < until; k++)
		value[k] = interpolate_over(trace, from, until, k);
	return true;
}

/* The samples from first to last, both good, and what stands in for those missing between them. */
static int signal_fill(struct signal *signal, const struct trace *trace, size_t first, size_t last,
                       double zero_g)
{
	double most = 0;

	for (size_t k = first; k <= last; k++)
		if (trace_good(trace, k))
			most = fmax(most, fabs(trace->value_g[k] - zero_g));
	memcpy(signal->value_g, trace->value_g + first, (last - first + 1) * sizeof(*signal->value_g));
	for (size_t k = first; k <= last; k++) {
		size_t from = k;

		while (!trace_good(trace, k))
			k++;
		if (k > from &&
		    !signal_bridge(trace, signal->value_g - first, from, k, EVENT_LEVEL * most, zero_g))
			return DT_E_INCOMPLETE;
		signal->bridged += k - from;
	}
	if (signal->bridged > 0)
		signal->flags |= SIGNAL_BRIDGED;
	return (double)signal->bridged > MISSING_MAX * (double)(last - first + 1) ? DT_E_INCOMPLETE : 0;
}

static void signal_look_at_end(struct signal *signal)
{
	size_t n = (size_t)(END_PART * (double)signal->count) + 1;
	double mean = 0, most = 0;

	for (size_t k = 0; k < signal->count; k++)
		most = fmax(most, fabs(signal->value_g[k]));
	for (size_t k = signal->count - n; k < signal->count; k++)
		mean += signal->value_g[k] / (double)n;
	if (fabs(mean) > EVENT_LEVEL * most)
		signal->flags |= SIGNAL_NOT_ENDED;
}

/* The zero that the estimators find, taken off unless it is to stay; told in any case. */
static void zero(struct signal *signal, struct trace *trace, bool keep_offset)
{
	double *scratch = signal->value_g, *read = signal->value_g + trace->count + 1;
	struct estimate_baseline baseline;

	memcpy(read, trace->value_g, trace->count * sizeof(*read));
	clean_find(trace, scratch, &baseline);
	baseline_remove(trace, &baseline);
	if (keep_offset)
		memcpy(trace->value_g, read, trace->count * sizeof(*read));
	signal->offset_g = baseline.offset_g;
	signal->noise_g = baseline.noise_g;
	signal->flags |= baseline.samples > 0 ? 0u : SIGNAL_NO_OFFSET;
	signal->data_flags = trace->flags;
}

static int signal_take(struct signal *signal, struct trace *trace, bool keep_offset)
{
	size_t first = 0, last = trace->count;

	zero(signal, trace, keep_offset);
	while (first < last && !trace_good(trace, first))
		first++;
	while (last > first && !trace_good(trace, last - 1))
		last--;
	if (first == last)
		return DT_E_EMPTY;
	signal->count = last - first;
	signal->start_s = trace_time(trace, first);
	return signal_fill(signal, trace, first, last - 1, keep_offset ? signal->offset_g : 0);
}

int signal_open(struct signal *signal, const struct channel *channel, bool keep_offset)
{
	struct signal opened = {.rate_hz = channel->rate_hz};
	struct trace trace;
	int result = trace_open(&trace, channel, -INFINITY, INFINITY);

	if (result != 0)
		return result;
	opened.value_g = malloc(2 * (trace.count + 1) * sizeof(*opened.value_g));
	result = opened.value_g ? signal_take(&opened, &trace, keep_offset) : DT_E_MEMORY;
	trace_close(&trace);
	if (result != 0) {
		free(opened.value_g);
		return result;
	}
	signal_look_at_end(&opened);
	*signal = opened;
	return 0;
}

void signal_close(struct signal *signal)
{
	free(signal->value_g);
	signal->value_g = NULL;
}
