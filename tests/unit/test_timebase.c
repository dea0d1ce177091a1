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

#include "host/record/timebase.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

enum { ROWS = 600 };

static struct timebase_fault fault;

static double rounded(double value, double digit)
{
	return round(value / digit) * digit;
}

/* Times of these places, rounded; returns what becomes of them. */
static int find(const size_t *place, size_t rows, double step_s, double digit_s, double jitter,
                struct synth_random *random, struct timebase *timebase)
{
	static double time_s[4 * ROWS];

	for (size_t k = 0; k < rows; k++)
		time_s[k] =
		        rounded((3.7 + (double)place[k] + jitter * (2 * synth_uniform(random) - 1)) * step_s,
		                digit_s);
	return timebase_find(time_s, rows, digit_s, 0, timebase, &fault);
}

static void all_places(size_t *place, size_t rows)
{
	for (size_t k = 0; k < rows; k++)
		place[k] = k;
}

static double random_rate(struct synth_random *random)
{
	return 100 * pow(10, 4 * synth_uniform(random));
}

/* The digit that leaves so many spare digits of a step. */
static double digit_of(double step_s, int spare)
{
	return pow(10, floor(log10(step_s)) - spare);
}

/* Rows of an even clock, however they are printed: none is made up, and the rate is right. */
static void even(void **state)
{
	struct synth_random random = {71};
	size_t place[ROWS];
	int refused[4] = {0};

	(void)state;
	all_places(place, ROWS);
	for (int run = 0; run < 4000; run++) {
		double step_s = 1 / random_rate(&random), digit_s = digit_of(step_s, run % 4);
		struct timebase timebase;

		if (find(place, ROWS, step_s, digit_s, 0, &random, &timebase) != 0) {
			refused[run % 4]++;
			continue;
		}
		assert_int_equal(timebase.missing, 0);
		assert_null(timebase.place);
		assert_near_part(timebase.step_s, step_s, 2 * digit_s / step_s / ROWS);
	}
	printf("# refused of 1000 each with 0 to 3 spare digits: %d %d %d %d\n", refused[0], refused[1],
	       refused[2], refused[3]);
	/* with no digit to spare a rate next to a whole digit cannot be told from missing rows */
	assert_true(refused[0] < 100);
	assert_int_equal(refused[1] + refused[2] + refused[3], 0);
}

/* Up to five stretches of up to 40 rows left out, some of them single rows. */
static size_t leave_out(size_t *place, struct synth_random *random)
{
	size_t gaps = 1 + (size_t)(5 * synth_uniform(random)), next = 0, rows = 0;
	size_t at[5], length[5];

	for (size_t i = 0; i < gaps; i++) {
		at[i] = (size_t)(20 + (double)(i * 110) + 60 * synth_uniform(random));
		length[i] = synth_uniform(random) < 0.4 ? 1 : 1 + (size_t)(40 * synth_uniform(random));
	}
	for (size_t i = 0; next < ROWS; next++) {
		if (i < gaps && next == at[i])
			next += length[i++];
		place[rows++] = next;
	}
	return rows;
}

/* The rows that are missing are found in their places, or the file is refused; never a third. */
static void missing(void **state)
{
	struct synth_random random = {72};
	int refused[4] = {0};

	(void)state;
	for (int run = 0; run < 4000; run++) {
		double step_s = 1 / random_rate(&random), digit_s = digit_of(step_s, run % 4);
		double jitter = run % 8 < 4 || run % 4 == 0 ? 0 : 0.03;
		size_t place[ROWS], rows = leave_out(place, &random);
		struct timebase timebase;

		if (find(place, rows, step_s, digit_s, jitter, &random, &timebase) != 0) {
			refused[run % 4]++;
			continue;
		}
		assert_non_null(timebase.place);
		assert_int_equal(timebase.missing, place[rows - 1] + 1 - rows);
		assert_int_equal(timebase.places, place[rows - 1] + 1);
		assert_memory_equal(timebase.place, place, rows * sizeof(*place));
		assert_near_part(timebase.step_s, step_s, 0.01);
		timebase_free(&timebase);
	}
	printf("# refused of 1000 each with 0 to 3 spare digits: %d %d %d %d\n", refused[0], refused[1],
	       refused[2], refused[3]);
	assert_true(refused[0] > 500); /* a coarse column shows no single step */
	assert_int_equal(refused[2] + refused[3], 0);
}

/* One rate up to a row and another from there on: refused beside that row, both named. */
static void two_rates(void **state)
{
	static const double ratio[] = {0.1, 0.5, 0.8, 1.25, 2, 3, 10, 2.5};
	struct synth_random random = {73};
	static double time_s[ROWS];

	(void)state;
	for (int run = 0; run < 2000; run++) {
		double step_s = 1 / random_rate(&random), digit_s = digit_of(step_s, 2 + run % 3);
		double other_s = step_s * ratio[run % 8];
		size_t from = 50 + (size_t)(500 * synth_uniform(&random));
		struct timebase timebase;

		for (size_t k = 0; k < ROWS; k++)
			time_s[k] = rounded((double)(k < from ? k : from) * step_s +
			                            (k > from ? (double)(k - from) * other_s : 0),
			                    digit_s);
		assert_int_equal(timebase_find(time_s, ROWS, digit_s, 0, &timebase, &fault), DT_E_FORMAT);
		if (strncmp(fault.why, "two rates", 9) != 0 || labs((long)fault.row - (long)from) > 3)
			fail_msg("%g Hz then %g Hz from %zu: row %zu %s", 1 / step_s, 1 / other_s, from,
			         fault.row, fault.why);
	}
}

/* A clock that runs away by a twentieth, or jumps by half a step and more, is refused. */
static void drift_and_jump(void **state)
{
	static double time_s[ROWS];
	struct timebase timebase;

	(void)state;
	for (int jump = 0; jump < 2; jump++) {
		for (size_t k = 0; k < ROWS; k++) {
			double x = (double)k;

			time_s[k] = 1e-4 * (jump ? x + (k > 300 ? 0.45 : 0) + (k > 400 ? 1.45 : 0)
			                         : x + 0.05 * x * x / ROWS);
		}
		assert_int_equal(timebase_find(time_s, ROWS, 1e-9, 0, &timebase, &fault), DT_E_FORMAT);
	}
	assert_int_equal(fault.row, 301);
}

/* Times that tremble by less than half a step lie on their even grid, and are called uneven. */
static void jitter(void **state)
{
	struct synth_random random = {74};
	size_t place[ROWS];
	struct timebase timebase;

	(void)state;
	all_places(place, ROWS);
	assert_int_equal(find(place, ROWS, 1e-4, 1e-9, 0.3, &random, &timebase), 0);
	assert_true(timebase.uneven && !timebase.place);
	assert_near_part(timebase.step_s, 1e-4, 2e-3);
	assert_int_equal(find(place, ROWS, 1e-4, 1e-9, 0.04, &random, &timebase), 0);
	assert_false(timebase.uneven);
}

static void order(void **state)
{
	static const double times[][4] = {{0, 1, 1, 2}, {0, 1, 2, 1.5}, {0, 1, NAN, 3}};
	struct timebase timebase;

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		assert_int_equal(timebase_find(times[i], 4, 0.1, 0, &timebase, &fault), DT_E_FORMAT);
		assert_int_equal(fault.row, i == 1 ? 3 : 2);
	}
	/* a header's step lets rounding make two times equal, not one go back */
	assert_int_equal(timebase_find((const double[]){0, 1, 1, 2}, 4, 1, 0.7, &timebase, &fault), 0);
	assert_near(timebase.step_s, 0.7, 0);
	assert_int_equal(timebase_find(times[1], 4, 0.1, 0.7, &timebase, &fault), DT_E_FORMAT);
}

/* An hour between two recordings in one column is no gap. */
static void pause(void **state)
{
	static double time_s[ROWS];
	struct timebase timebase;

	(void)state;
	for (size_t k = 0; k < ROWS; k++)
		time_s[k] = (double)k * 1e-4 + (k < 300 ? 0 : 3600);
	assert_int_equal(timebase_find(time_s, ROWS, 1e-6, 0, &timebase, &fault), DT_E_FORMAT);
	assert_int_equal(fault.row, 300);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(even),           cmocka_unit_test(missing), cmocka_unit_test(two_rates),
	        cmocka_unit_test(drift_and_jump), cmocka_unit_test(jitter),  cmocka_unit_test(order),
	        cmocka_unit_test(pause),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
