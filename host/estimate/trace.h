/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_TRACE_H
#define DT_HOST_ESTIMATE_TRACE_H
/*
 * A trace: the analyzer's own copy of one channel, with its own mask, so that the record stays as it was
 * read. Every estimator works on a trace and asks trace_good of each sample; time is always explicit and
 * nothing is resampled. Sample k is at start_s + k/rate_hz.
 *
 * Opening copies and marks: a sample that is not finite, or larger than any accelerometer reads, is bad;
 * groups of equal extreme samples are clipped and at the limit (clip.h). The extremes of each run of
 * TRACE_BLOCK samples are kept, so that a search need not look at what is quiet: who changes values says so
 * (trace_changed).
 *
 * trace_open allocates and trace_close frees. trace_lay uses the caller's memory, aligned for a double and
 * trace_bytes long, that must outlive the trace; such a trace is not closed.
 */
#include <stdbool.h>

#include "host/record/record.h"

/* Beside the SAMPLE_* bits: the sensor or converter shows nothing beyond this value, so that the true one is
 * at least this. SAMPLE_CLIPPED is set too. Clipped alone: a reading beyond the sensor's range. */
enum { TRACE_LIMIT = 1u << 7 };

enum { TRACE_BLOCK = 64 };

/* No good sample of the block lies outside; low > high where none is good. */
struct trace_block {
	double low_g, high_g;
	bool whole; /* every sample of it is good */
};

struct trace {
	double highpass_s; /* the channel's */
	double rate_hz;
	double start_s;
	size_t count;
	double *value_g;    /* [count]; meaningless where the mask says lost or bad */
	uint8_t *sample;    /* [count], SAMPLE_* and TRACE_LIMIT */
	size_t first, last; /* the event is looked for in [first, last) */
	size_t still;       /* nothing of it is before this, on any channel; count: that is not known */
	double noise_g;     /* per sample, before any filter; NAN while unknown */
	double hum_hz;  /* of the strongest hum that was taken off, a little of which may be left; NAN if none
	                 */
	unsigned flags; /* RECORD_FLAG_* */
	double range_g; /* the channel's */
	double step_g;  /* that readings are whole numbers of, where noise does not spread them; 0: finer */
	struct trace_block *block; /* [trace_blocks] */
	void *memory;              /* of trace_open */
};

/* The event is looked for from from_s until until_s. DT_E_MEMORY. */
DT_MUST_USE int trace_open(struct trace *trace, const struct channel *channel, double from_s, double until_s);
void trace_close(struct trace *trace);

size_t trace_bytes(const struct channel *channel); /* a multiple of a double's size */
void trace_lay(struct trace *trace, const struct channel *channel, double from_s, double until_s,
               void *memory);

/* After values changed: blocks anew. After good samples were marked bad: limits too. */
void trace_changed(struct trace *trace);
void trace_marked(struct trace *trace);

static inline size_t trace_blocks(const struct trace *trace)
{
	return (trace->count + TRACE_BLOCK - 1) / TRACE_BLOCK;
}

static inline bool trace_good(const struct trace *trace, size_t k)
{
	return !(trace->sample[k] & (SAMPLE_LOST | SAMPLE_BAD | SAMPLE_SPIKE));
}

/* Whether a sample, or samples by all their marks, say where the signal is: there, not bad and not clipped.
 */
static inline bool trace_usable_mark(unsigned marks)
{
	return !(marks & (SAMPLE_LOST | SAMPLE_BAD | SAMPLE_SPIKE | SAMPLE_CLIPPED));
}

static inline bool trace_usable(const struct trace *trace, size_t k)
{
	return trace_usable_mark(trace->sample[k]);
}

static inline double trace_time(const struct trace *trace, size_t k)
{
	return trace->start_s + (double)k / trace->rate_hz;
}

/* No good sample of sample k's block is larger in magnitude; negative where none is good. */
static inline double trace_most(const struct trace *trace, size_t k)
{
	const struct trace_block *block = &trace->block[k / TRACE_BLOCK];

	return block->high_g > -block->low_g ? block->high_g : -block->low_g;
}

/* The first good sample of [k, last) whose magnitude reaches level_g; last when there is none. */
size_t trace_reaches(const struct trace *trace, size_t k, size_t last, double level_g);

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
