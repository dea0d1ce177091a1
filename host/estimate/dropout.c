/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/dropout.h"

#include <math.h>

#include "host/estimate/limits.h"

/* Three zeros hold a sample whose number this divides. */
enum { RUN_MIN = 3 };

static bool is_zero(const struct trace *trace, size_t k)
{
	return !(fabs(trace->value_g[k]) > 0) && trace_good(trace, k);
}

/* The run around sample k, a zero; [*from, *until). */
static void run_around(const struct trace *trace, size_t k, size_t *from, size_t *until)
{
	*from = k;
	while (*from > 0 && is_zero(trace, *from - 1))
		(*from)--;
	*until = k + 1;
	while (*until < trace->count && is_zero(trace, *until))
		(*until)++;
}

static bool stands_off(const struct trace *trace, size_t k, double noise_g)
{
	return trace_good(trace, k) && fabs(trace->value_g[k]) > LIMIT_SURE * noise_g;
}

/* Marks the runs that begin in samples [from, until). */
static bool dropout_mark_in(struct trace *trace, size_t from, size_t until, double noise_g)
{
	bool marked = false;
	size_t first, end;

	for (size_t k = from; k < until; k += RUN_MIN) {
		if (!is_zero(trace, k))
			continue;
		run_around(trace, k, &first, &end);
		if (end - first < RUN_MIN || first == 0 || end == trace->count ||
		    !stands_off(trace, first - 1, noise_g) || !stands_off(trace, end, noise_g))
			continue;
		for (size_t i = first; i < end; i++)
			trace->sample[i] |= SAMPLE_BAD;
		marked = true;
	}
	return marked;
}

bool dropout_mark(struct trace *trace, double noise_g)
{
	bool marked = false, was_loud = false;

	for (size_t i = 0; noise_g > 0 && i < trace_blocks(trace); i++) {
		size_t from = i * TRACE_BLOCK, until = from + TRACE_BLOCK;
		bool loud = trace_most(trace, from) > LIMIT_SURE * noise_g;

		/* A run begins beside a reading that stands off. */
		if (loud || was_loud)
			marked |= dropout_mark_in(trace, from, until < trace->count ? until : trace->count,
			                          noise_g);
		was_loud = loud;
	}
	if (marked)
		trace->flags |= RECORD_FLAG_ZEROED | RECORD_FLAG_BAD;
	return marked;
}
