/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/trace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/clip.h"

/* Beyond any sensor; keeps squares and sums far from overflow. */
#define VALUE_MAX_G 1e9

static double less(double a, double b)
{
	return a < b ? a : b;
}

static double more(double a, double b)
{
	return a > b ? a : b;
}

/* Of TRACE_BLOCK good values, in strands that need not wait for each other. False, and nothing is known, when
 * one of them is no acceleration. */
static bool extremes(const double *v, struct trace_block *block)
{
	double l0 = v[0], l1 = v[1], l2 = v[2], l3 = v[3], h0 = l0, h1 = l1, h2 = l2, h3 = l3;
	double s0 = 0, s1 = 0, sum; /* finite unless a value is not */

	for (unsigned i = 0; i < TRACE_BLOCK; i += 4) {
		l0 = less(l0, v[i]);
		h0 = more(h0, v[i]);
		l1 = less(l1, v[i + 1]);
		h1 = more(h1, v[i + 1]);
		l2 = less(l2, v[i + 2]);
		h2 = more(h2, v[i + 2]);
		l3 = less(l3, v[i + 3]);
		h3 = more(h3, v[i + 3]);
		s0 += v[i] + v[i + 2];
		s1 += v[i + 1] + v[i + 3];
	}
	sum = s0 + s1;
	block->low_g = less(less(l0, l1), less(l2, l3));
	block->high_g = more(more(h0, h1), more(h2, h3));
	block->whole = true;
	return !isnan(sum) && block->low_g >= -VALUE_MAX_G && block->high_g <= VALUE_MAX_G;
}

/* Sample by sample, from sample k on, marking what is bad. */
static void look_closely(struct trace *trace, size_t k, struct trace_block *block)
{
	size_t end = k + TRACE_BLOCK < trace->count ? k + TRACE_BLOCK : trace->count;

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

static bool all_good(const uint8_t *sample)
{
	uint64_t word[TRACE_BLOCK / 8], any = 0;

	memcpy(word, sample, TRACE_BLOCK);
	for (unsigned i = 0; i < TRACE_BLOCK / 8; i++)
		any |= word[i];
	return any == 0;
}

static void copy(struct trace *trace, const struct channel *channel)
{
	if (trace->count == 0)
		return;
	memcpy(trace->value_g, channel->value_g, trace->count * sizeof(*trace->value_g));
	memcpy(trace->sample, channel->sample, trace->count);
	for (size_t k = 0; k < trace->count; k += TRACE_BLOCK) {
		struct trace_block *block = &trace->block[k / TRACE_BLOCK];

		if (trace->count - k < TRACE_BLOCK || !all_good(trace->sample + k) ||
		    !extremes(trace->value_g + k, block))
			look_closely(trace, k, block);
	}
}

void trace_marked(struct trace *trace)
{
	for (size_t k = 0; k < trace->count; k += TRACE_BLOCK)
		look_closely(trace, k, &trace->block[k / TRACE_BLOCK]);
	clip_mark(trace);
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
	                        .range_g = channel->range_g};
	trace->value_g = memory;
	trace->block = (struct trace_block *)(void *)(trace->value_g + trace->count);
	trace->sample = (uint8_t *)(trace->block + trace_blocks(trace));
	copy(trace, channel);
	clip_mark(trace);
	trace->first = trace_index(trace, from_s);
	trace->last = trace_index(trace, until_s);
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
