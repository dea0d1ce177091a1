/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/block_means.h"

#include <string.h>

static inline void take_point(struct block_means *series, const struct trace *trace, size_t first)
{
	const double *value = trace->value_g + first;
	const uint8_t *sample = trace->sample + first;
	unsigned marks = 0;
	double sum = 0;
	bool good;

	for (unsigned i = 0; i < series->block; i++) {
		marks |= sample[i];
		sum += value[i];
	}
	good = trace_usable_mark(marks);
	series->value_g[series->count] = good ? sum / series->block : 0;
	series->good[series->count++] = good;
	series->used += good;
}

void block_means_take(struct block_means *series, const struct trace *trace, size_t first, size_t last,
                      double from_s, unsigned block)
{
	size_t samples = last > first ? last - first : 0;
	unsigned least = (unsigned)((samples + BLOCK_MEANS_MAX - 1) / BLOCK_MEANS_MAX);

	series->block = block > least ? block : least;
	if (series->block == 0)
		series->block = 1;
	series->count = 0;
	series->used = 0;
	series->step_s = series->block / trace->rate_hz;
	series->first_s = trace_time(trace, first) - from_s + (series->block - 1) / (2 * trace->rate_hz);
	for (size_t k = first; k + series->block <= last; k += series->block)
		take_point(series, trace, k);
}

void block_means_thin(struct block_means *thin, const struct block_means *series, unsigned points)
{
	thin->first_s = series->first_s + (points - 1) * series->step_s / 2;
	thin->step_s = series->step_s * points;
	thin->block = series->block * points;
	thin->count = series->count / points;
	thin->used = 0;
	for (unsigned i = 0; i < thin->count; i++) {
		double sum = 0;
		bool good = true;

		for (unsigned k = i * points; k < (i + 1) * points; k++) {
			good = good && series->good[k];
			sum += series->value_g[k];
		}
		thin->value_g[i] = good ? sum / points : 0;
		thin->good[i] = good;
		thin->used += good;
	}
}

bool block_means_lengthen(struct block_means *series, const struct trace *trace, size_t first, unsigned more)
{
	if (more > BLOCK_MEANS_MAX - series->count)
		return false;
	memmove(series->value_g + more, series->value_g, series->count * sizeof(*series->value_g));
	memmove(series->good + more, series->good, series->count * sizeof(*series->good));
	for (unsigned k = 0; k < more; k++) {
		series->good[k] = trace_usable(trace, first + k);
		series->value_g[k] = series->good[k] ? trace->value_g[first + k] : 0;
		series->used += series->good[k];
	}
	series->count += more;
	series->first_s -= more * series->step_s;
	return true;
}

double block_means_squares(const struct block_means *series)
{
	double sum = 0, squares = 0, mean;

	for (unsigned k = 0; k < series->count; k++)
		sum += series->good[k] ? series->value_g[k] : 0;
	mean = sum / series->used;
	for (unsigned k = 0; k < series->count; k++) {
		double off = series->good[k] ? series->value_g[k] - mean : 0;

		squares += off * off;
	}
	return squares;
}
