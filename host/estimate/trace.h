/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_TRACE_H
#define DT_HOST_ESTIMATE_TRACE_H
/*
 * A trace: the analyzer's own copy of one channel, with its own mask, so that the record stays as it was
 * read. Every estimator works on a trace and asks trace_good of each sample; time is always explicit and
 * nothing is resampled.
 *
 * trace_open copies and marks: a sample that is not finite, or larger than any accelerometer reads, is
 * bad; runs of equal extreme samples are clipped. trace_close frees. Sample k is at start_s + k/rate_hz.
 */
#include <stdbool.h>

#include "host/record/record.h"

struct trace {
	double rate_hz;
	double start_s;
	size_t count;
	double *value_g;    /* [count]; meaningless where the mask says lost or bad */
	uint8_t *sample;    /* [count], SAMPLE_* */
	size_t first, last; /* the event is looked for in [first, last) */
	double noise_g;     /* per sample, before any filter; NAN while unknown */
	unsigned flags;     /* RECORD_FLAG_* */
};

/* The event is looked for from from_s until until_s. DT_E_MEMORY. */
DT_MUST_USE int trace_open(struct trace *trace, const struct channel *channel, double from_s, double until_s);
void trace_close(struct trace *trace);

static inline bool trace_good(const struct trace *trace, size_t k)
{
	return !(trace->sample[k] & (SAMPLE_LOST | SAMPLE_BAD));
}

static inline double trace_time(const struct trace *trace, size_t k)
{
	return trace->start_s + (double)k / trace->rate_hz;
}

/* The first sample at or after time_s; count when there is none. */
size_t trace_index(const struct trace *trace, double time_s);

/* Linear interpolation between two good neighbours; false where there are none. */
bool trace_at(const struct trace *trace, double time_s, double *value_g);

/* Walks from sample k outward, step +1 or -1, until sign times the value is below level_g; *time_s is
 * where the straight line between the last sample above and the first below meets the level, whatever is
 * missing in between. False when the trace ends first; *time_s is then its end. */
bool trace_edge(const struct trace *trace, size_t k, int step, double sign, double level_g, double *time_s);

/* Whether any sample from from_s to until_s has one of the SAMPLE_* bits. */
bool trace_any(const struct trace *trace, double from_s, double until_s, unsigned bits);

#endif
