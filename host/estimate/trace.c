/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/trace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/clip.h"
#include "host/estimate/limits.h"
#include "host/estimate/simd2.h"

/* Beyond any sensor; keeps squares and sums far from overflow. */
#define VALUE_MAX_G 1e9

static size_t trace_smaller(size_t a, size_t b)
{
	return a < b ? a : b;
}

static double less(double a, double b)
{
	return a < b ? a : b;
}

static double more(double a, double b)
{
	return a > b ? a : b;
}

/* Copies TRACE_BLOCK good values, in strands that need not wait for each other. False, and nothing else is
 * known, when one of them is no acceleration. */
static bool trace_take_block(double *to, const double *from, struct trace_block *block)
{
	PAIR low[2] = {pair_load(from), pair_load(from + 2)}, high[2] = {low[0], low[1]};
	PAIR sum[2] = {{0}, {0}}; /* finite unless a value is not */

	for (unsigned i = 0; i < TRACE_BLOCK; i += 4) {
		const PAIR a = pair_load(from + i), b = pair_load(from + i + 2);

		pair_store(to + i, a);
		pair_store(to + i + 2, b);
		low[0] = pair_less(low[0], a);
		low[1] = pair_less(low[1], b);
		high[0] = pair_more(high[0], a);
		high[1] = pair_more(high[1], b);
		sum[0] += a;
		sum[1] += b;
	}
	low[0] = pair_less(low[0], low[1]);
	high[0] = pair_more(high[0], high[1]);
	sum[0] += sum[1];
	block->low_g = less(low[0][0], low[0][1]);
	block->high_g = more(high[0][0], high[0][1]);
	block->whole = true;
	return !isnan(sum[0][0] + sum[0][1]) && block->low_g >= -VALUE_MAX_G && block->high_g <= VALUE_MAX_G;
}

/* Sample by sample, from sample k on, marking what is bad. */
static void look_closely(struct trace *trace, size_t k, struct trace_block *block)
{
	size_t end = k + trace_smaller(TRACE_BLOCK, trace->count - k);

	*block = (struct trace_block){INFINITY, -INFINITY, true};
	for (; k < end; k++) {
		double v = trace->value_g[k];

		if (!(fabs(v) <= VALUE_MAX_G)) {
			if (trace_good(trace, k)) {
				trace->sample[k] |= SAMPLE_BAD;
				trace->flags |= RECORD_FLAG_BAD;
			}
			trace->value_g[k] = NAN;
			block->whole = false;
		} else if (!trace_good(trace, k)) {
			block->whole = false;
		} else {
			block->low_g = less(v, block->low_g);
			block->high_g = more(v, block->high_g);
		}
	}
}

/* All marks of a whole block's samples, eight samples side by side. */
static uint64_t marks_of(const uint8_t *sample)
{
	uint64_t any = 0;

	for (unsigned i = 0; i < TRACE_BLOCK; i += sizeof(any)) {
		uint64_t word;

		memcpy(&word, sample + i, sizeof(word));
		any |= word;
	}
	return any;
}

/* The block that begins at sample k, from values that lie elsewhere or in the trace itself. */
static void trace_look(struct trace *trace, size_t k, const double *from)
{
	struct trace_block *block = &trace->block[k / TRACE_BLOCK];
	double *to = trace->value_g + k;

	if (trace->count - k >= TRACE_BLOCK && marks_of(trace->sample + k) == 0 &&
	    trace_take_block(to, from, block))
		return;
	if (from != to)
		memcpy(to, from, trace_smaller(TRACE_BLOCK, trace->count - k) * sizeof(*to));
	look_closely(trace, k, block);
}

static void copy(struct trace *trace, const struct channel *channel)
{
	if (trace->count > 0)
		memcpy(trace->sample, channel->sample, trace->count);
	for (size_t k = 0; k < trace->count; k += TRACE_BLOCK)
		trace_look(trace, k, channel->value_g + k);
}

void trace_changed(struct trace *trace)
{
	for (size_t k = 0; k < trace->count; k += TRACE_BLOCK)
		trace_look(trace, k, trace->value_g + k);
}

void trace_marked(struct trace *trace)
{
	const uint64_t bad = (SAMPLE_BAD | SAMPLE_SPIKE) * 0x0101010101010101u;

	for (size_t k = 0; k < trace->count; k += TRACE_BLOCK)
		if (trace->count - k < TRACE_BLOCK || marks_of(trace->sample + k) & bad)
			trace_look(trace, k, trace->value_g + k);
	clip_mark(trace, NAN);
}

/* Without a rate no sample has a time. */
static bool has_time(const struct channel *channel)
{
	return isfinite(channel->rate_hz) && channel->rate_hz > 0 && isfinite(channel->start_s);
}

size_t trace_bytes(const struct channel *channel)
{
	size_t blocks = channel->count / TRACE_BLOCK + 1;

	return blocks * (TRACE_BLOCK * sizeof(double) + sizeof(struct trace_block) + TRACE_BLOCK);
}

void trace_lay(struct trace *trace, const struct channel *channel, double from_s, double until_s,
               void *memory)
{
	bool timed = has_time(channel);

	*trace = (struct trace){.rate_hz = timed ? channel->rate_hz : 1,
	                        .start_s = timed ? channel->start_s : 0,
	                        .count = timed ? channel->count : 0,
	                        .noise_g = NAN,
	                        .hum_hz = NAN,
	                        .flags = channel->flags,
	                        .range_g = channel->range_g,
	                        .highpass_s = channel->highpass_s};
	trace->value_g = memory;
	trace->block = (struct trace_block *)(void *)(trace->value_g + trace->count);
	trace->sample = (uint8_t *)(trace->block + trace_blocks(trace));
	copy(trace, channel);
	clip_mark(trace, NAN);
	trace->first = trace_index(trace, from_s);
	trace->last = trace_index(trace, until_s);
	trace->still = trace->count;
}

int trace_open(struct trace *trace, const struct channel *channel, double from_s, double until_s)
{
	void *memory = malloc(trace_bytes(channel));

	if (!memory)
		return DT_E_MEMORY;
	trace_lay(trace, channel, from_s, until_s, memory);
	trace->memory = memory;
	return 0;
}

void trace_close(struct trace *trace)
{
	free(trace->memory);
	trace->memory = NULL;
	trace->value_g = NULL;
	trace->sample = NULL;
}

size_t trace_reaches(const struct trace *trace, size_t k, size_t last, double level_g)
{
	while (k < last) {
		if (trace_most(trace, k) < level_g) {
			k += TRACE_BLOCK - k % TRACE_BLOCK;
			continue;
		}
		if (fabs(trace->value_g[k]) >= level_g && trace_good(trace, k))
			return k;
		k++;
	}
	return last;
}

size_t trace_index(const struct trace *trace, double time_s)
{
	double k = ceil((time_s - trace->start_s) * trace->rate_hz - LIMIT_SMALL);

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
	size_t end = trace_index(trace, until_s);
	unsigned marks = 0;

	if (end < trace->count && trace_time(trace, end) <= until_s)
		end++;
	for (size_t k = trace_index(trace, from_s); k < end; k++)
		marks |= trace->sample[k];
	return (marks & bits) != 0;
}
