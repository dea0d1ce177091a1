/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/burst.h"
#include "host/estimate/crossings.h"
#include "host/estimate/grid_search.h"
#include "host/estimate/modes.h"
#include "host/estimate/outlier.h"
#include "host/estimate/spring.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

/* A trace of two decays, 300 g at 129 Hz and 40 g at 170 Hz, -2 g of offset; hum of 5 g on demand. */
static const double w1 = 2 * PI * 129, w2 = 2 * PI * 170, a1 = 80, a2 = 90;

static struct trace open_sum(double second_g, double hum_g, double noise_g, unsigned seed)
{
	struct channel channel = synth_channel("S1X", 7000, 0.25, 700);
	struct synth_random random = {seed};
	struct trace trace;

	for (size_t k = 0; k < channel.count; k++) {
		double t = (double)k / 7000;

		channel.value_g[k] = -2 + 300 * exp(-a1 * t) * cos(w1 * t + 0.4) +
		                     second_g * exp(-a2 * t) * cos(w2 * t - 1) +
		                     hum_g * cos(2 * PI * 50 * t) + noise_g * synth_normal(&random);
	}
	assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
	trace.noise_g = noise_g;
	synth_free(&channel);
	return trace;
}

/* A point is the mean of its block, at the middle of it, and is gone with any sample of it. */
static void series(void **state)
{
	struct trace trace = open_sum(0, 0, 0, 1);
	struct block_means s;

	(void)state;
	trace.sample[13] = SAMPLE_LOST;
	block_means_take(&s, &trace, 10, 30, 0.25, 4);
	assert_int_equal(s.count, 5);
	assert_int_equal(s.used, 4);
	assert_false(s.good[0]);
	assert_near(s.first_s, 11.5 / 7000, 1e-12);
	assert_near(s.step_s, 4.0 / 7000, 1e-12);
	assert_near(s.value_g[1],
	            (trace.value_g[14] + trace.value_g[15] + trace.value_g[16] + trace.value_g[17]) / 4,
	            1e-9);
	/* Longer than there are points: the block grows. */
	s.count = 0;
	block_means_take(&s, &trace, 0, 700, 0.25, 0);
	assert_int_equal(s.block, 1);
	assert_int_equal(s.count, 700);
	block_means_take(&s, &trace, 20, 40, 0.25, 1);
	assert_true(block_means_lengthen(&s, &trace, 12, 8));
	assert_int_equal(s.count, 28);
	assert_int_equal(s.used, 27);
	assert_false(s.good[1]);
	assert_near(s.first_s, 12.0 / 7000, 1e-12);
	assert_near(s.value_g[8], trace.value_g[20], 0);
	assert_false(block_means_lengthen(&s, &trace, 0, BLOCK_MEANS_MAX));
	trace_close(&trace);
}

/* Points thinned are the blocks that were not taken at once. */
static void thinned(void **state)
{
	struct trace trace = open_sum(0, 0, 0, 1);
	struct block_means all, thin, blocks;

	(void)state;
	trace.sample[27] = SAMPLE_LOST;
	block_means_take(&all, &trace, 10, 93, 0.25, 2);
	block_means_thin(&thin, &all, 3);
	block_means_take(&blocks, &trace, 10, 93, 0.25, 6);
	assert_int_equal(thin.block, 6);
	assert_int_equal(thin.count, blocks.count);
	assert_int_equal(thin.used, blocks.used);
	assert_near(thin.first_s, blocks.first_s, 1e-12);
	assert_near(thin.step_s, blocks.step_s, 1e-12);
	for (unsigned k = 0; k < thin.count; k++) {
		assert_int_equal(thin.good[k], blocks.good[k]);
		assert_near(thin.value_g[k], blocks.value_g[k], 1e-9);
	}
	trace_close(&trace);
}

/* Block means of an exponential have its pole; its size comes back when the blocks are undone. */
static void exact(void **state)
{
	struct trace trace = open_sum(40, 5, 0, 2);
	struct modes modes = {.count = 2, .hum_hz = 50, .p = {0, 70, 1.05 * w1, 0, 0, 110, 0.96 * w2}};
	struct block_means s;

	(void)state;
	block_means_take(&s, &trace, 0, 420, 0.25, 3);
	assert_int_equal(modes_size(&modes), 11);
	assert_true(modes_linear(&modes, &s));
	assert_true(modes_fit(&modes, &s));
	assert_near(modes.p[MODES_DECAY], a1, 1e-6);
	assert_near(modes.p[MODES_OMEGA], w1, 1e-6);
	assert_near(modes.p[MODES_DECAY + MODES_EACH], a2, 1e-5);
	assert_near(modes.p[MODES_OMEGA + MODES_EACH], w2, 1e-5);
	assert_near(modes.p[MODES_OFFSET], -2, 1e-6);
	assert_near(modes_at(&modes, s.first_s + 7 * s.step_s), s.value_g[7], 1e-6);
	modes_unblock(&modes, &s);
	assert_near(modes.p[MODES_COSINE], 300 * cos(0.4), 1e-5);
	assert_near(modes.p[MODES_SINE], -300 * sin(0.4), 1e-5);
	trace_close(&trace);
}

/* The covariance is that of the points that are there, whatever is missing at either end or between. */
static void holes(void **state)
{
	static const size_t lost[] = {0, 1, 2, 60, 61, 63, 140, 295, 299, 300};
	struct trace trace = open_sum(40, 5, 0, 2);
	struct modes modes = {.count = 2, .hum_hz = 50, .p = {0, 70, 1.05 * w1, 0, 0, 110, 0.96 * w2}};
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}};
	struct cholesky factor;
	struct block_means s;

	(void)state;
	for (size_t i = 0; i < sizeof(lost) / sizeof(lost[0]); i++)
		trace.sample[lost[i]] = SAMPLE_LOST;
	block_means_take(&s, &trace, 0, 301, 0.25, 1);
	assert_int_equal(s.used, 291);
	assert_true(modes_linear(&modes, &s));
	assert_true(modes_fit(&modes, &s));
	assert_int_equal(modes.fit.used, 291);
	for (unsigned k = 0; k < s.count; k++) {
		double t = s.first_s + k * s.step_s, hum = 2 * PI * 50 * t;
		double row[CHOLESKY_MAX] = {[MODES_OFFSET] = 1, [9] = cos(hum), [10] = sin(hum)};

		for (unsigned m = 0; m < 2; m++) {
			const double *p = modes.p + MODES_EACH * m;
			double *mine = row + MODES_EACH * m, size = exp(-p[MODES_DECAY] * t);
			double re = size * cos(p[MODES_OMEGA] * t), im = size * sin(p[MODES_OMEGA] * t);

			mine[MODES_DECAY] = -t * (p[MODES_COSINE] * re + p[MODES_SINE] * im);
			mine[MODES_OMEGA] = t * (p[MODES_SINE] * re - p[MODES_COSINE] * im);
			mine[MODES_COSINE] = re;
			mine[MODES_SINE] = im;
		}
		for (unsigned i = 0; s.good[k] && i < CHOLESKY_MAX; i++)
			for (unsigned j = 0; j <= i; j++)
				normal[i][j] += row[i] * row[j];
	}
	assert_true(cholesky_factor(&factor, CHOLESKY_MAX, normal));
	for (unsigned i = 0; i < CHOLESKY_MAX; i++) {
		double unit[CHOLESKY_MAX] = {0};

		unit[i] = 1;
		assert_near_part(cholesky_variance(&modes.fit.factor, unit), cholesky_variance(&factor, unit),
		                 1e-5);
	}
	trace_close(&trace);
}

/* No place, no fit; nothing crashes on a series that determines nothing. */
static void impossible(void **state)
{
	struct trace trace = open_sum(0, 0, 0, 3);
	struct modes modes = {.count = 1, .p = {0, 80, -1}};
	struct block_means s;

	(void)state;
	block_means_take(&s, &trace, 0, 300, 0.25, 1);
	assert_false(modes_fit(&modes, &s));
	modes.p[MODES_OMEGA] = w1;
	memset(s.good, 0, sizeof(s.good));
	s.used = 0;
	assert_false(modes_linear(&modes, &s));
	assert_false(modes_fit(&modes, &s));
	trace_close(&trace);
}

/* Whatever the phase and where the decay is hidden from crossings: within what a fit finds its way from. */
static void scanned(void **state)
{
	struct grid_search scan;

	(void)state;
	for (unsigned seed = 10; seed < 40; seed++) {
		struct trace trace = open_sum(0, 0, 100, seed);

		assert_true(grid_search_worth(&trace, 0, 700, 100));
		assert_true(grid_search_find(&scan, &trace, 0, 700));
		assert_near_part(scan.omega, w1, 0.1);
		trace_close(&trace);
	}
	for (unsigned seed = 40; seed < 50; seed++) {
		struct channel channel = synth_channel("S1X", 7000, 0, 700);
		struct synth_random random = {seed};
		struct trace trace;

		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] = synth_normal(&random);
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		assert_false(grid_search_worth(&trace, 0, 700, 1));
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* Spikes go, alone or two together, first sample or last; a residual that is smooth stays. */
static void outliers(void **state)
{
	static const unsigned at[] = {0, 60, 61, 200, 299};
	struct trace trace = open_sum(40, 0, 1, 6);
	struct modes modes = {.count = 1, .p = {0, a1, w1}};
	double residual[BLOCK_MEANS_MAX];
	bool usable[BLOCK_MEANS_MAX];
	struct block_means s;

	(void)state;
	block_means_take(&s, &trace, 0, 300, 0.25, 1);
	memcpy(usable, s.good, sizeof(usable));
	assert_true(modes_linear(&modes, &s));
	modes_residual(&modes, &s, residual);
	for (unsigned k = 0; k < s.count; k += 37)
		assert_near(residual[k], s.value_g[k] - modes_at(&modes, s.first_s + k * s.step_s), 1e-9);
	/* The second mode is the residual. */
	assert_int_equal(outlier_drop(&s, &modes, usable), 0);
	for (size_t i = 0; i < sizeof(at) / sizeof(at[0]); i++)
		s.value_g[at[i]] += 300;
	assert_int_equal(outlier_drop(&s, &modes, usable), sizeof(at) / sizeof(at[0]));
	for (size_t i = 0; i < sizeof(at) / sizeof(at[0]); i++)
		assert_false(s.good[at[i]]);
	assert_int_equal(s.used, 300 - sizeof(at) / sizeof(at[0]));
	/* Judged anew each time. */
	s.value_g[200] -= 300;
	assert_int_equal(outlier_drop(&s, &modes, usable), 4);
	assert_true(s.good[200]);
	trace_close(&trace);
}

static void crossings(void **state)
{
	struct trace trace = open_sum(0, 0, 0, 7);
	struct crossings found;
	double omega, decay;

	(void)state;
	crossings_find(&found, &trace, 0, 700, -2, 20);
	assert_int_equal(found.count, CROSSINGS_MAX);
	/* The first is where w t + 0.4 = pi / 2. */
	assert_near(found.time_s[0], 0.25 + (PI / 2 - 0.4) / w1, 1e-5);
	assert_true(crossings_start(&found, &omega, &decay));
	assert_near_part(omega, w1, 0.002);
	assert_near_part(decay, a1, 0.1);
	crossings_find(&found, &trace, 0, 40, -2, 20);
	assert_true(found.ended);
	assert_false(crossings_start(&found, &omega, &decay));
	trace_close(&trace);
}

/* A half-sine of 3 ms and 485 g under 100 g of noise, of which no sample stands out. */
static void burst(void **state)
{
	struct burst found;

	(void)state;
	for (unsigned seed = 60; seed < 90; seed++) {
		struct channel channel = synth_channel("S2X", 7000, 0, 3500);
		struct synth_random random = {seed};
		struct trace trace;

		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] =
			        100 * synth_normal(&random) -
			        485 * synth_pulse(SYNTH_HALF_SINE, ((double)k / 7000 - 0.2) / 0.003);
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		trace.noise_g = 100;
		assert_true(burst_find(&trace, &found));
		assert_near((found.start_s + found.end_s) / 2, 0.2015, 0.0008);
		assert_true(found.end_s > 0.2018 && found.end_s < 0.2045);
		trace.noise_g = 400;
		assert_false(burst_find(&trace, &found));
		trace.noise_g = NAN;
		assert_false(burst_find(&trace, &found));
		trace.noise_g = 0;
		assert_false(burst_find(&trace, &found));
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* What the derivatives say of the sum of squares is what it does, and the model is the spring. */
static void spring_slopes(void **state)
{
	static const double by[SPRING_SIZE] = {1e-3, 1e-3, 1e-2, 1e-2, 1e-2, 1e-9, 1e-5};
	static const double d[] = {0.3, -0.2};

	(void)state;
	for (unsigned round = 0; round < 6; round++) {
		const double p[SPRING_SIZE] = {
		        -2, 80, w1, 200, -150, (1.0 + round) / (250.0 * 250.0), d[round % 2]};
		struct trace trace = open_sum(0, 0, 3, 1);
		struct block_means s;
		double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, squares,
		       model = 0;

		trace.sample[100] = SAMPLE_LOST;
		block_means_take(&s, &trace, 3, 300, 0.25, 1 + round % 4);
		assert_int_equal(spring_normal(&s, p, normal, right, &squares), s.used);
		for (unsigned k = 0; k < s.count; k++) {
			double mean = 0;

			for (unsigned j = 0; j < s.block; j++)
				mean += spring_at(p, s.first_s + k * s.step_s +
				                             (j - (s.block - 1) / 2.0) * s.step_s / s.block) /
				        s.block;
			model += s.good[k] ? (s.value_g[k] - mean) * (s.value_g[k] - mean) : 0;
		}
		assert_near(model / squares, 1, 1e-4);
		for (unsigned i = 0; i < SPRING_SIZE; i++) {
			double q[SPRING_SIZE], none[CHOLESKY_MAX][CHOLESKY_MAX], unused[CHOLESKY_MAX],
			        side[2];

			for (int up = 0; up < 2; up++) {
				memset(none, 0, sizeof(none));
				memset(unused, 0, sizeof(unused));
				memcpy(q, p, sizeof(q));
				q[i] += up ? by[i] : -by[i];
				assert_true(spring_normal(&s, q, none, unused, &side[up]) > 0);
			}
			assert_near((side[0] - side[1]) / (4 * by[i]) / sqrt(normal[i][i] * squares),
			            right[i] / sqrt(normal[i][i] * squares), 1e-4);
		}
		trace_close(&trace);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(spring_slopes), cmocka_unit_test(series),   cmocka_unit_test(thinned),
	        cmocka_unit_test(exact),         cmocka_unit_test(holes),    cmocka_unit_test(impossible),
	        cmocka_unit_test(scanned),       cmocka_unit_test(outliers), cmocka_unit_test(crossings),
	        cmocka_unit_test(burst),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
