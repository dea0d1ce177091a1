/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/signal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/baseline.h"
#include "host/estimate/dropout.h"
#include "host/estimate/spike.h"

#define EVENT_LEVEL 0.05  /* of the largest */
#define OFFSET_LEVEL 0.01 /* of the largest: worth a flag */
#define OFFSET_SIGMAS 4.0 /* standard errors of the mean */
#define NOISE_SIGMAS 6.0  /* of one sample */
#define SMOOTH 2.0        /* spread over noise, beyond which it is not noise alone */
#define MISSING_MAX 0.1   /* part of all samples */
#define END_PART 0.01     /* of the samples: the last ones */

enum { HOLE_MAX = 10, START_SAMPLES = 32, QUIET_MIN = 64, PARTS = 8 };

const char *signal_flag_name(unsigned flags)
{
	static const char *const names[] = {"bridged",   "offset",  "offset_unknown",
	                                    "not_ended", "refused", "above_half_rate"};

	for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		if (flags & (1u << i))
			return names[i];
	return "";
}

/* ---- holes ---- */

/* The cubic through the samples from - 2, from - 1, until and until + 1 (Lagrange). */
static void bridge_cubic(double *value, size_t from, size_t until)
{
	double place[4] = {-2, -1, (double)(until - from), (double)(until - from) + 1};
	double node[4] = {value[from - 2], value[from - 1], value[until], value[until + 1]};

	for (size_t k = from; k < until; k++) {
		double x = (double)(k - from), sum = 0;

		for (unsigned i = 0; i < 4; i++) {
			double weight = 1;

			for (unsigned j = 0; j < 4; j++)
				if (j != i)
					weight *= (x - place[j]) / (place[i] - place[j]);
			sum += weight * node[i];
		}
		value[k] = sum;
	}
}

static void bridge_line(double *value, size_t from, size_t until)
{
	double before = value[from - 1], after = value[until];

	for (size_t k = from; k < until; k++)
		value[k] = before + (after - before) * (double)(k - from + 1) / (double)(until - from + 1);
}

/* One hole [from, until) between good samples; false when it is too long for where it is. */
static bool bridge(const struct trace *trace, double *value, size_t from, size_t until, double quiet_g,
                   double middle_g)
{
	bool room = from >= 2 && until + 1 < trace->count && trace_good(trace, from - 2) &&
	            trace_good(trace, until + 1);

	if (until - from <= HOLE_MAX && room)
		bridge_cubic(value, from, until);
	else if (until - from <= HOLE_MAX ||
	         (fabs(value[from - 1] - middle_g) < quiet_g && fabs(value[until] - middle_g) < quiet_g))
		bridge_line(value, from, until);
	else
		return false;
	return true;
}

/* Values are the trace's from first to last, both good; all holes between them are filled. */
static int bridge_all(struct signal *signal, const struct trace *trace, size_t first, size_t last,
                      double quiet_g, double middle_g)
{
	size_t k = first;

	while (k <= last) {
		size_t from = k;

		while (!trace_good(trace, k))
			k++;
		if (k > from) {
			if (!bridge(trace, trace->value_g, from, k, quiet_g, middle_g))
				return DT_E_INCOMPLETE;
			signal->bridged += k - from;
		}
		k++;
	}
	if (signal->bridged > 0)
		signal->flags |= SIGNAL_BRIDGED;
	return (double)signal->bridged > MISSING_MAX * (double)(last - first + 1) ? DT_E_INCOMPLETE : 0;
}

/* ---- offset ---- */

static void mean_and_spread(const double *value, size_t count, double *mean, double *spread)
{
	double sum = 0, squares = 0;

	for (size_t k = 0; k < count; k++)
		sum += value[k];
	*mean = sum / (double)count;
	for (size_t k = 0; k < count; k++)
		squares += (value[k] - *mean) * (value[k] - *mean);
	*spread = count > 1 ? sqrt(squares / (double)(count - 1)) : 0;
}

static double largest(const double *value, size_t count, double middle_g)
{
	double most = 0;

	for (size_t k = 0; k < count; k++)
		most = fmax(most, fabs(value[k] - middle_g));
	return most;
}

/* Noise of the first samples, blind to what is smooth. */
static double rough_noise(const double *value, size_t count)
{
	double squares = 0;

	for (size_t k = 2; k < count; k++) {
		double bend = value[k - 2] - 2 * value[k - 1] + value[k];

		squares += bend * bend;
	}
	return count > 2 ? sqrt(squares / (6.0 * (double)(count - 2))) : 0;
}

/* Samples before the event; 0 when the record starts with more than noise. */
static size_t quiet_count(const struct signal *signal)
{
	size_t start = signal->count < START_SAMPLES ? signal->count : START_SAMPLES, k = 0;
	double middle, spread, event;

	mean_and_spread(signal->value_g, start, &middle, &spread);
	event = EVENT_LEVEL * largest(signal->value_g, signal->count, middle);
	if (NOISE_SIGMAS * spread > event && spread > SMOOTH * rough_noise(signal->value_g, start))
		return 0;
	while (k < signal->count && fabs(signal->value_g[k] - middle) <= fmax(event, NOISE_SIGMAS * spread))
		k++;
	return k == signal->count ? k : k - k / 16; /* a slow rise begins below the level */
}

static void find_offset(struct signal *signal)
{
	size_t quiet = quiet_count(signal), part = quiet / PARTS;
	double mean[PARTS], all, spread, ignored;

	signal->noise_g = NAN;
	signal->offset_g = 0;
	if (quiet < QUIET_MIN) {
		signal->flags |= SIGNAL_NO_OFFSET;
		return;
	}
	for (unsigned i = 0; i < PARTS; i++)
		mean_and_spread(signal->value_g + i * part, part, &mean[i], &ignored);
	mean_and_spread(mean, PARTS, &all, &spread);
	mean_and_spread(signal->value_g, quiet, &all, &signal->noise_g);
	if (fabs(all) <= OFFSET_SIGMAS * spread / sqrt(PARTS))
		return;
	signal->offset_g = all;
	if (fabs(all) > OFFSET_LEVEL * largest(signal->value_g, signal->count, all))
		signal->flags |= SIGNAL_OFFSET;
}

static void look_at_end(struct signal *signal)
{
	size_t n = (size_t)(END_PART * (double)signal->count) + 1;
	double mean, spread;

	mean_and_spread(signal->value_g + signal->count - n, n, &mean, &spread);
	if (fabs(mean) > EVENT_LEVEL * largest(signal->value_g, signal->count, 0))
		signal->flags |= SIGNAL_NOT_ENDED;
}

/* ---- all of it ---- */

static int fill(struct signal *signal, const struct trace *trace)
{
	size_t first = 0, last = trace->count, start = 0;
	double middle = 0, most = 0;
	int result;

	while (first < last && !trace_good(trace, first))
		first++;
	while (last > first && !trace_good(trace, last - 1))
		last--;
	if (first == last)
		return DT_E_EMPTY;
	for (size_t k = first; k < last && start < START_SAMPLES; k++) {
		if (trace_good(trace, k)) {
			middle += (trace->value_g[k] - middle) / (double)(start + 1);
			start++;
		}
	}
	for (size_t k = first; k < last; k++)
		if (trace_good(trace, k))
			most = fmax(most, fabs(trace->value_g[k] - middle));
	result = bridge_all(signal, trace, first, last - 1, EVENT_LEVEL * most, middle);
	if (result != 0)
		return result;
	signal->count = last - first;
	signal->start_s = trace_time(trace, first);
	memcpy(signal->value_g, trace->value_g + first, signal->count * sizeof(*signal->value_g));
	return 0;
}

/* What the estimators find wrong with single samples is a hole here. */
static void mark(struct trace *trace, double *scratch)
{
	struct estimate_baseline baseline;

	baseline_find(trace, scratch, &baseline);
	(void)spike_mark(trace, baseline.noise_g);
	(void)dropout_mark(trace, baseline.noise_g);
}

int signal_open(struct signal *signal, const struct channel *channel, bool keep_offset)
{
	struct signal opened = {.rate_hz = channel->rate_hz};
	struct trace trace;
	int result = trace_open(&trace, channel, -INFINITY, INFINITY);

	if (result != 0)
		return result;
	opened.value_g = malloc(2 * (trace.count + 1) * sizeof(*opened.value_g));
	if (opened.value_g) {
		mark(&trace, opened.value_g);
		result = fill(&opened, &trace);
	} else {
		result = DT_E_MEMORY;
	}
	opened.data_flags = trace.flags;
	trace_close(&trace);
	if (result != 0) {
		free(opened.value_g);
		return result;
	}
	find_offset(&opened);
	if (!keep_offset)
		for (size_t k = 0; k < opened.count; k++)
			opened.value_g[k] -= opened.offset_g;
	look_at_end(&opened);
	*signal = opened;
	return 0;
}

void signal_close(struct signal *signal)
{
	free(signal->value_g);
	signal->value_g = NULL;
}
