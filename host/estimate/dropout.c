/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/dropout.h"

#include <math.h>

#include "host/estimate/clip.h"
#include "host/estimate/limits.h"

enum {
	ZEROS = 3, /* hold a sample whose number this divides, and so do longer runs */
	HELD = 5,
	HELD_CALM = 4, /* where samples tremble by more */
	RISES_MIN = 32,
};

/* Where half of what differs does so by more than so many steps, one in thirty samples equals the next, and
 * by CLIP_TREMBLE steps one in seventy: a run is chance's once in a million. */
#define HELD_STEPS 8.0

/* Of all samples, those that equal the one before, where half of what differs does so by more than LIMIT_OVER
 * steps: repeated all along. Of noise one in eight does. */
#define REPEATED 0.25

/* From the samples of the window that tells the step of their numbers. */
struct held {
	size_t run; /* the shortest that chance does not make; 0 where any may be */
	bool repeated;
};

static struct held held_find(const struct trace *trace)
{
	double step = clip_step(trace);
	size_t rises = 0, level = 0, some = 0, wide = 0, wider = 0;

	for (size_t k = 1; k < trace->count && k < CLIP_WINDOW; k++) {
		double rise = fabs(trace->value_g[k] - trace->value_g[k - 1]);

		if (!trace_good(trace, k) || !trace_good(trace, k - 1))
			continue;
		level += !(rise > 0);
		rises += rise > 0;
		some += rise > LIMIT_OVER * step;
		wide += rise > HELD_STEPS * step;
		wider += rise > CLIP_TREMBLE * step;
	}
	if (rises < RISES_MIN)
		return (struct held){0, false};
	return (struct held){2 * wider > rises  ? HELD_CALM
	                     : 2 * wide > rises ? HELD
	                                        : 0,
	                     2 * some > rises && (double)level > REPEATED * (double)(level + rises)};
}

static bool is_zero(const struct trace *trace, size_t k)
{
	return !(fabs(trace->value_g[k]) > 0);
}

static bool is_same(const struct trace *trace, size_t k, double value_g)
{
	return trace_good(trace, k) && !(fabs(trace->value_g[k] - value_g) > 0);
}

/* The run around sample k; [*from, *until). */
static void run_around(const struct trace *trace, size_t k, size_t *from, size_t *until)
{
	double value = trace->value_g[k];

	*from = k;
	while (*from > 0 && is_same(trace, *from - 1, value))
		(*from)--;
	*until = k + 1;
	while (*until < trace->count && is_same(trace, *until, value))
		(*until)++;
}

static bool stands_off(const struct trace *trace, size_t k, double noise_g)
{
	return trace_good(trace, k) && fabs(trace->value_g[k]) > LIMIT_SURE * noise_g;
}

/* Whether samples k and beyond, beside a run, led on by two samples into it still stand off. */
static bool leads_off(const struct trace *trace, size_t k, size_t beyond, double noise_g)
{
	double led = 3 * trace->value_g[k] - 2 * trace->value_g[beyond];

	return trace_good(trace, beyond) && led * trace->value_g[k] > 0 && fabs(led) > LIMIT_SURE * noise_g;
}

/* In numbers coarser than noise the case at rest reads nothing but zeros: what is beside them leads there. */
static bool is_rest(const struct trace *trace, size_t first, size_t end, double noise_g)
{
	return trace->step_g > 0 &&
	       !(first > 1 && trace->value_g[first - 1] * trace->value_g[end] > 0 && end + 1 < trace->count &&
	         leads_off(trace, first - 1, first - 2, noise_g) && leads_off(trace, end, end + 1, noise_g));
}

/* Whether the run was left by what is higher: it is no limit. */
static bool is_passed(const struct trace *trace, size_t first, size_t end)
{
	double sign = trace->value_g[first] < 0 ? -1 : 1, value = sign * trace->value_g[first];

	return sign * trace->value_g[first - 1] > value || sign * trace->value_g[end] > value;
}

/* Marks the run [first, end); what it is, as a flag of the record. */
static unsigned dropout_mark_run(struct trace *trace, size_t first, size_t end, size_t held, double noise_g)
{
	bool zeros = is_zero(trace, first), before, after, of_noise;

	if (first == 0 || end == trace->count || (zeros && is_rest(trace, first, end, noise_g)))
		return 0;
	before = stands_off(trace, first - 1, noise_g);
	after = stands_off(trace, end, noise_g);
	of_noise = held == 0 || end - first < held;
	if (!(zeros && end - first >= ZEROS && before && after) &&
	    (of_noise ||
	     !(stands_off(trace, first, noise_g) ? is_passed(trace, first, end) : before || after)))
		return 0;
	for (size_t i = zeros ? first : first + 1; i < end; i++)
		trace->sample[i] |= SAMPLE_BAD;
	return zeros ? RECORD_FLAG_ZEROED : RECORD_FLAG_STUCK;
}

/* Marks the runs that begin in samples [from, until). */
static unsigned dropout_mark_in(struct trace *trace, size_t from, size_t until, size_t held, double noise_g)
{
	unsigned flags = 0;
	size_t first, end;

	for (size_t k = from; k < until; k += ZEROS) {
		if (!trace_good(trace, k) || trace->sample[k] & TRACE_LIMIT)
			continue;
		run_around(trace, k, &first, &end);
		if (end - first >= ZEROS)
			flags |= dropout_mark_run(trace, first, end, held, noise_g);
	}
	return flags;
}

bool dropout_mark(struct trace *trace, double noise_g)
{
	struct held held;
	bool was_loud = false;
	unsigned flags = 0;

	if (!(noise_g > 0))
		return false;
	held = held_find(trace);
	for (size_t i = 0; i < trace_blocks(trace); i++) {
		size_t from = i * TRACE_BLOCK, until = from + TRACE_BLOCK;
		bool loud = trace_most(trace, from) > LIMIT_SURE * noise_g;

		/* A run begins beside a reading that stands off. */
		if (loud || was_loud)
			flags |= dropout_mark_in(trace, from, until < trace->count ? until : trace->count,
			                         held.repeated ? 0 : held.run, noise_g);
		was_loud = loud;
	}
	trace->flags |= flags | (flags ? RECORD_FLAG_BAD : 0) | (held.repeated ? RECORD_FLAG_STUCK : 0);
	return flags != 0;
}
