/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/grid_search.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/block_means.h"
#include "host/estimate/cholesky.h"
#include "host/estimate/limits.h"
#include "host/estimate/simd2.h"

/* Each frequency is given up when fewer of its cycles fit. */
#define CYCLES_LEAST 1.5

/* Points per cycle at the top of an octave. */
#define POINTS 6.0

enum { PER_OCTAVE = 8, LINEAR = 3, OCTAVES = 16, WORTH_SAMPLES = 32, LANES = 8 /* marks in a word */ };

/* What c cos + s sin + b of that decay explains of the first points of the series beyond their mean. */
static double explained(const struct block_means *series, unsigned points, double omega, double decay)
{
	double size = exp(-decay * series->step_s), turn_re = size * cos(omega * series->step_s);
	double turn_im = size * sin(omega * series->step_s), re = 1, im = 0;
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, x[CHOLESKY_MAX];
	struct cholesky factor;

	for (unsigned k = 0; k < points; k++) {
		double y = series->value_g[k], next = re * turn_re - im * turn_im;

		if (series->good[k]) {
			normal[0][0] += 1;
			normal[1][0] += re;
			normal[1][1] += re * re;
			normal[2][0] += im;
			normal[2][1] += im * re;
			normal[2][2] += im * im;
			right[0] += y;
			right[1] += y * re;
			right[2] += y * im;
		}
		im = re * turn_im + im * turn_re;
		re = next;
	}
	if (normal[0][0] < 2 * LINEAR || !cholesky_factor(&factor, LINEAR, normal))
		return 0;
	cholesky_solve(&factor, right, x);
	return x[0] * right[0] + x[1] * right[1] + x[2] * right[2] - right[0] * right[0] / normal[0][0];
}

/* From top_hz down to half of it. */
static void grid_search_octave(struct grid_search *best, const struct block_means *series, double top_hz)
{
	static const double damping[] = {0.02, 0.08, 0.3};

	for (int i = 0; i < PER_OCTAVE; i++) {
		double hz = top_hz * exp2(-(double)i / PER_OCTAVE), omega = 2 * UNITS_PI * hz;
		double points = GRID_CYCLES / (hz * series->step_s);
		unsigned n = points < series->count ? (unsigned)points : series->count;

		if (n * series->step_s * hz < CYCLES_LEAST)
			return;
		for (size_t d = 0; d < sizeof(damping) / sizeof(damping[0]); d++) {
			double squares = series->block * explained(series, n, omega, damping[d] * omega);

			if (squares > best->squares)
				*best = (struct grid_search){omega, damping[d] * omega, squares};
		}
	}
}

bool grid_search_find(struct grid_search *scan, const struct trace *trace, size_t first, size_t last)
{
	struct grid_search best = {0, 0, 0};
	struct block_means series;

	for (unsigned octave = 0; octave < OCTAVES; octave++) {
		unsigned block = 1u << octave;
		double top_hz = trace->rate_hz / (POINTS * block);
		double samples = 2 * GRID_CYCLES * POINTS * block;
		size_t until = samples < (double)(last - first) ? first + (size_t)samples : last;

		if ((double)(last - first) < CYCLES_LEAST * POINTS * block)
			break;
		block_means_take(&series, trace, first, until, trace_time(trace, first), block);
		grid_search_octave(&best, &series, top_hz);
	}
	if (!(best.squares > 0))
		return false;
	*scan = best;
	return true;
}

/* Sum and sum of squares of the usable samples [k, end). Returns how many there are. */
static size_t grid_search_add_up(const struct trace *trace, size_t k, size_t end, double *sum,
                                 double *squares)
{
	PAIR sums[2] = {{0}, {0}}, squared[2] = {{0}, {0}};
	size_t n = 0;

	while (k < end) {
		uint64_t marks = 1;

		if (end - k >= LANES)
			memcpy(&marks, trace->sample + k, sizeof(marks));
		if (marks == 0) {
			for (unsigned i = 0; i < LANES; i += 4) {
				const PAIR a = pair_load(trace->value_g + k + i);
				const PAIR b = pair_load(trace->value_g + k + i + 2);

				sums[0] += a;
				sums[1] += b;
				squared[0] += a * a;
				squared[1] += b * b;
			}
			n += LANES;
			k += LANES;
			continue;
		}
		if (trace_usable(trace, k)) {
			*sum += trace->value_g[k];
			*squares += trace->value_g[k] * trace->value_g[k];
			n++;
		}
		k++;
	}
	sums[0] += sums[1];
	squared[0] += squared[1];
	*sum += sums[0][0] + sums[0][1];
	*squares += squared[0][0] + squared[0][1];
	return n;
}

bool grid_search_worth(const struct trace *trace, size_t first, size_t last, double noise_g)
{
	size_t n = 0, end = first;
	double sum = 0, squares = 0;

	for (size_t length = WORTH_SAMPLES; end < last; length *= 2) {
		size_t k = end;

		end = last - first > length ? first + length : last;
		n += grid_search_add_up(trace, k, end, &sum, &squares);
		if (n > 0 && squares - sum * sum / (double)n >
		                     noise_g * noise_g * ((double)n + LIMIT_CHI * sqrt(2 * (double)n)))
			return true;
	}
	return false;
}
