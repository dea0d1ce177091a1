/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/baseline.h"
#include "host/estimate/clip.h"
#include "host/estimate/trace.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

static struct trace open_trace(const struct channel *channel)
{
	struct trace trace;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	return trace;
}

static void fill(struct channel *channel, uint64_t seed)
{
	struct synth_random random = {seed};

	for (size_t k = 0; k < channel->count; k++)
		channel->value_g[k] = 10 * synth_normal(&random);
}

/* No length is special: values, mask and every block's extremes, whatever is bad where. */
static void copies(void **state)
{
	(void)state;
	for (size_t count = 0; count < 300; count++) {
		struct channel channel = synth_channel("a", 1000, 0, count);
		struct synth_random random = {count};
		struct trace trace;

		fill(&channel, count);
		for (size_t k = 0; count % 3 == 1 && k < count; k++) {
			double u = synth_uniform(&random);

			if (u < 0.02)
				channel.value_g[k] = u < 0.01 ? NAN : -INFINITY;
			else if (u < 0.04)
				channel.sample[k] = u < 0.03 ? SAMPLE_LOST : SAMPLE_BAD;
		}
		trace = open_trace(&channel);
		assert_int_equal(trace.count, count);
		for (size_t k = 0; k < count; k++) {
			const struct trace_block *block = &trace.block[k / TRACE_BLOCK];
			bool good = isfinite(channel.value_g[k]) && channel.sample[k] == 0;

			assert_int_equal(trace_good(&trace, k), good);
			assert_true(good || !block->whole);
			if (good) {
				assert_near(trace.value_g[k], channel.value_g[k], 0);
				assert_true(block->low_g <= trace.value_g[k] &&
				            trace.value_g[k] <= block->high_g);
			}
		}
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* The extremes are readings, not just bounds. */
static void extremes(void **state)
{
	struct channel channel = synth_channel("a", 1000, 0, 64);
	struct trace trace;

	(void)state;
	for (size_t at = 0; at < 64; at++) {
		fill(&channel, at);
		channel.value_g[at] = 77;
		channel.value_g[(at + 31) % 64] = -78;
		trace = open_trace(&channel);
		assert_near(trace.block[0].high_g, 77, 0);
		assert_near(trace.block[0].low_g, -78, 0);
		assert_true(trace.block[0].whole);
		trace.sample[at] |= SAMPLE_SPIKE;
		trace_marked(&trace);
		assert_false(trace_good(&trace, at));
		assert_true(trace.block[0].high_g < 77 && !trace.block[0].whole);
		trace_close(&trace);
	}
	synth_free(&channel);
}

/* One that is no acceleration is bad wherever it stands, and flagged; the record is not touched. */
static void no_acceleration(void **state)
{
	static const double odd[] = {NAN, INFINITY, -INFINITY, 1.1e9, -1e300};
	struct channel channel = synth_channel("a", 1000, 0, 200);

	(void)state;
	for (size_t at = 0; at < 200; at++) {
		struct trace trace;

		fill(&channel, at);
		channel.value_g[at] = odd[at % 5];
		trace = open_trace(&channel);
		assert_int_equal(trace.sample[at], SAMPLE_BAD);
		assert_int_equal(trace.flags, RECORD_FLAG_BAD);
		assert_int_equal(channel.sample[at], 0);
		assert_int_equal(channel.flags, 0);
		trace_close(&trace);
	}
	synth_free(&channel);
}

static void limits(void **state)
{
	struct channel channel = synth_channel("a", 1000, 0, 500);
	struct trace trace;

	(void)state;
	fill(&channel, 5);
	for (size_t k = 190; k < 200; k++)
		channel.value_g[k] = 400;
	channel.value_g[194] = 399;
	trace = open_trace(&channel);
	assert_int_equal(trace.flags, RECORD_FLAG_CLIPPED);
	for (size_t k = 0; k < 500; k++)
		assert_int_equal(trace.sample[k],
		                 k >= 190 && k < 200 && k != 194 ? SAMPLE_CLIPPED | TRACE_LIMIT : 0);
	trace_close(&trace);
	/* One at the known range is enough. */
	fill(&channel, 6);
	channel.value_g[63] = -400;
	channel.range_g = 400;
	trace = open_trace(&channel);
	assert_int_equal(trace.sample[63], SAMPLE_CLIPPED | TRACE_LIMIT);
	trace_close(&trace);
	/* A spike is no limit: what was behind it comes out when it is marked. */
	channel.range_g = 0;
	for (size_t k = 190; k < 200; k++)
		channel.value_g[k] = 390;
	channel.value_g[63] = 800;
	trace = open_trace(&channel);
	assert_int_equal(trace.flags, 0);
	trace.sample[63] |= SAMPLE_SPIKE;
	trace_marked(&trace);
	assert_int_equal(trace.flags, RECORD_FLAG_CLIPPED);
	trace_close(&trace);
	synth_free(&channel);
}

/* Side by side, from the largest on. */
static size_t equal_extremes(const struct trace *trace)
{
	size_t at = 0, n = 1;

	for (size_t k = 1; k < trace->count; k++)
		if (trace->value_g[k] > trace->value_g[at])
			at = k;
	while (at + n < trace->count && !(trace->value_g[at + n] < trace->value_g[at]))
		n++;
	return n;
}

/* The top of a long round pulse in coarse numbers is level; cut, it is a limit. */
static void level_tops(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 400);
	struct synth_random random = {42};
	int level = 0, seen[2] = {0, 0};

	(void)state;
	for (int run = 0; run < 2000; run++) {
		bool cut = run % 2;
		struct trace trace;

		for (size_t k = 0; k < 400; k++) {
			double v = 60 * synth_pulse(SYNTH_HALF_SINE, ((double)k - 200) / 90);

			v = 0.5 * round(2 * (v + 0.1 * synth_normal(&random)));
			channel.value_g[k] = cut ? fmin(v, 54) : v;
		}
		trace = open_trace(&channel);
		level += !cut && equal_extremes(&trace) > 4;
		clip_mark(&trace, 0.15);
		seen[cut] += trace.flags & RECORD_FLAG_CLIPPED ? 1 : 0;
		trace_close(&trace);
	}
	printf("%d of 1000 tops level by chance, %d marked; %d of 1000 limits\n", level, seen[0], seen[1]);
	assert_true(level > 300 && seen[0] == 0);
	assert_int_equal(seen[1], 1000);
	synth_free(&channel);
}

/* The corner of a level top, or of one that sags, is no limit, in numbers of one to two sigma and in fine
 * ones; nor is the level top, whose samples between the equal ones lie lower. */
static void corners(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 300);
	struct synth_random random = {43};
	int seen = 0;

	(void)state;
	for (int run = 0; run < 4000; run++) {
		double code = run % 2 ? 1.0 / 32 : 0.3 + 0.6 * synth_uniform(&random);
		double noise = run % 2 ? 0.3 + 0.5 * synth_uniform(&random)
		                       : code * (0.51 + 0.4 * synth_uniform(&random));
		double rise = 2 + 8 * synth_uniform(&random), level = 8 + 30 * synth_uniform(&random);
		double sag = run % 4 < 2 ? 0 : 0.2 * synth_uniform(&random);
		struct trace trace;

		for (size_t k = 0; k < 300; k++) {
			double at = (double)k - 150, up = fmin(fmax(at / rise, 0), 1);
			double down = fmin(fmax((2 * rise + level - at) / rise, 0), 1);
			double v = 100 * up * up * (3 - 2 * up) * down * down * (3 - 2 * down) *
			           (1 - sag * at / level);

			channel.value_g[k] = code * round((v + noise * synth_normal(&random)) / code);
		}
		trace = open_trace(&channel);
		clip_mark(&trace, noise);
		seen += (trace.flags & RECORD_FLAG_CLIPPED) != 0;
		trace_close(&trace);
	}
	printf("%d of 4000 corners marked\n", seen);
	assert_true(seen <= 1);
	synth_free(&channel);
}

/* Two equal extremes in coarse numbers: a limit where their neighbours say so, chance otherwise. */
static void twins(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 200);
	struct synth_random random = {41};
	int seen[2] = {0, 0}, equal = 0;

	(void)state;
	for (int run = 0; run < 4000; run++) {
		/* 2 and 3 are the highest by far enough, or not. */
		double limit = run % 2 ? 490 : 1000, phase = synth_uniform(&random) - 0.5;
		struct trace trace;

		for (size_t k = 0; k < 200; k++) {
			double v = 500 * synth_pulse(SYNTH_HALF_SINE, ((double)k - 100 + 0.25 * phase) / 21) +
			           synth_normal(&random);

			channel.value_g[k] = fmin(round(v * 4) / 4, limit);
			if (run % 2 && channel.value_g[k] > 489 && k != 110 && k != 111)
				channel.value_g[k] = 488.5;
		}
		trace = open_trace(&channel);
		equal += run % 2 == 0 && equal_extremes(&trace) == 2;
		if (!(run % 2 && equal_extremes(&trace) != 2)) {
			clip_mark(&trace, 1);
			seen[run % 2] += trace.flags & RECORD_FLAG_CLIPPED ? 1 : 0;
			if (run % 2 && trace.flags)
				assert_int_equal(trace.sample[110] & trace.sample[111],
				                 SAMPLE_CLIPPED | TRACE_LIMIT);
		}
		trace_close(&trace);
	}
	printf("%d equal by chance, %d of them marked; %d of 2000 limits\n", equal, seen[0], seen[1]);
	assert_true(equal > 50 && seen[0] <= 2);
	assert_true(seen[1] > 1500);
	synth_free(&channel);
}

/* Coarse numbers show by stairs or by rises of three sizes: straight lines without noise have equal rises
 * too. */
static void stairs(void **state)
{
	static const struct {
		double step_g;   /* 0: as drawn */
		double up, down; /* samples of a triangle of 100 g; 0: a half-sine of 60 */
		double resolution_g;
	} cases[] = {
	        {0, 30, 30, 0}, {0, 20, 30, 0}, {0, 30, 1, 0},  /* lines */
	        {2, 0, 0, 2},   {10, 0, 0, 10}, {8, 40, 60, 8}, /* steps */
	        {7, 25, 40, 7}, {0, 0, 0, 0},   {0.25, 0, 0, 0.25},
	};
	struct channel channel = synth_channel("a", 10000, 0, 300);

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const double step_g = cases[i].step_g, up = cases[i].up, down = cases[i].down;
		struct trace trace;

		for (size_t k = 0; k < channel.count; k++) {
			double at = (double)k - 150, line = at < 0 ? 1 + at / up : 1 - at / down;
			double v = 100 * (up > 0 ? fmax(0, line) : synth_pulse(SYNTH_HALF_SINE, at / 60));

			channel.value_g[k] = step_g > 0 ? step_g * round(v / step_g) : v;
		}
		trace = open_trace(&channel);
		if (fabs(clip_resolution(&trace, 0) - cases[i].resolution_g) > 1e-9)
			fail_msg("case %zu: a step of %g g, expected %g", i, clip_resolution(&trace, 0),
			         cases[i].resolution_g);
		trace_close(&trace);
	}
	synth_free(&channel);
}

/* In the caller's memory, and not a byte beyond it: the sanitizer looks on. */
static void laid(void **state)
{
	(void)state;
	for (size_t count = 0; count < 200; count++) {
		struct channel channel = synth_channel("a", 7000, 2, count);
		void *memory = malloc(trace_bytes(&channel));
		struct trace trace;

		assert_non_null(memory);
		fill(&channel, count);
		assert_int_equal(trace_bytes(&channel) % sizeof(double), 0);
		trace_lay(&trace, &channel, 2.005, 2.01, memory);
		assert_int_equal(trace.first, count < 35 ? count : 35);
		assert_int_equal(trace.last, count < 70 ? count : 70);
		if (count > 0) {
			trace.value_g[count - 1] = 1;
			trace.sample[count - 1] = 1;
			trace_marked(&trace);
		}
		free(memory);
		synth_free(&channel);
	}
}

static void without_a_rate(void **state)
{
	static const double rate[] = {0, -1, NAN, INFINITY};
	struct channel channel = synth_channel("a", 0, 0, 100);

	(void)state;
	for (size_t i = 0; i < 4; i++) {
		struct trace trace;

		channel.rate_hz = rate[i];
		trace = open_trace(&channel);
		assert_int_equal(trace.count, 0);
		assert_int_equal(trace_index(&trace, 0.01), 0);
		trace_close(&trace);
	}
	synth_free(&channel);
}

static void edges(void **state)
{
	static const double value[] = {0, 2, 8, 10, 6, 1, 0};
	struct channel channel = synth_channel("a", 1000, 0, 7);
	struct trace trace;
	double time_s;

	(void)state;
	memcpy(channel.value_g, value, sizeof(value));
	synth_lose(&channel, 4, 1);
	trace = open_trace(&channel);
	assert_true(trace_edge(&trace, 3, -1, 1, 5, &time_s));
	assert_near(time_s, 1.5e-3, 1e-12);
	assert_true(trace_edge(&trace, 3, 1, 1, 5.5, &time_s)); /* across the lost one: 10 to 1 in 2 ms */
	assert_near(time_s, 4e-3, 1e-12);
	assert_false(trace_edge(&trace, 3, 1, 1, -1, &time_s));
	assert_near(time_s, 6e-3, 1e-12);
	assert_true(trace_at(&trace, 2.25e-3, &time_s));
	assert_near(time_s, 8.5, 1e-12);
	assert_false(trace_at(&trace, 3.5e-3, &time_s));
	assert_true(trace_any(&trace, 3.5e-3, 4.1e-3, SAMPLE_LOST));
	assert_false(trace_any(&trace, 4.5e-3, 6e-3, SAMPLE_LOST));
	trace_close(&trace);
	synth_free(&channel);
}

/* What is known of the blocks follows the values, and a search by blocks finds what a plain one does. */
static void follows_changes(void **state)
{
	static const struct estimate_baseline moved[] = {
	        {.offset_g = 7.5, .hum_hz = NAN},
	        {.offset_g = -3, .drift_g_s = 40, .hum_g = 6, .hum_hz = 50, .from_s = 0, .until_s = 0.2},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(moved) / sizeof(moved[0]); i++) {
		struct channel channel = synth_channel("a", 1000, 0, 333);
		struct trace trace;

		fill(&channel, 5 + i);
		synth_lose(&channel, 100, 20);
		trace = open_trace(&channel);
		baseline_remove(&trace, &moved[i]);
		for (size_t k = 0; k < trace.count; k++) {
			const struct trace_block *block = &trace.block[k / TRACE_BLOCK];

			assert_true(!trace_good(&trace, k) ||
			            (block->low_g <= trace.value_g[k] && trace.value_g[k] <= block->high_g));
		}
		for (double level_g = 0; level_g < 60; level_g += 0.7) {
			size_t k = 17;

			while (k < 300 && !(trace_good(&trace, k) && fabs(trace.value_g[k]) >= level_g))
				k++;
			assert_int_equal(trace_reaches(&trace, 17, 300, level_g), k);
		}
		trace_close(&trace);
		synth_free(&channel);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(copies), cmocka_unit_test(extremes),   cmocka_unit_test(no_acceleration),
	        cmocka_unit_test(limits), cmocka_unit_test(level_tops), cmocka_unit_test(corners),
	        cmocka_unit_test(twins),  cmocka_unit_test(stairs),     cmocka_unit_test(without_a_rate),
	        cmocka_unit_test(laid),   cmocka_unit_test(edges),      cmocka_unit_test(follows_changes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
