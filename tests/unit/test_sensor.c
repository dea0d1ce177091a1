/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hil/sensor.h"
#include "tests/unit/near.h"

static void high_pass_fades_a_step(void **state)
{
	struct sensor fine = {.time_constant_s = 0.3}, coarse = fine;
	double time_s = 0;

	(void)state;
	sensor_settle(&fine, 1);
	assert_near(fine.output_g, 0.0, 0);
	sensor_settle(&coarse, 1);
	sensor_advance(&fine, sensor_fading(fine.time_constant_s, 0), 101);
	sensor_advance(&coarse, sensor_fading(coarse.time_constant_s, 0), 101);
	assert_near(fine.output_g, 100.0, 1e-12);
	for (int i = 0; i < 9000; i++) {
		const double step_s = i % 2 ? 59e-6 : 142e-6;

		sensor_advance(&fine, sensor_fading(fine.time_constant_s, step_s), 101);
		time_s += step_s;
		assert_near(fine.output_g, 100 * exp(-time_s / 0.3), 1e-9);
	}
	sensor_advance(&coarse, sensor_fading(coarse.time_constant_s, time_s), 101);
	assert_near(coarse.output_g, fine.output_g, 1e-9);
}

static void high_pass_follows_a_ramp(void **state)
{
	struct sensor s = {.time_constant_s = 0.05};

	(void)state;
	sensor_settle(&s, -3);
	for (int i = 1; i <= 100; i++) { /* 200 g/s */
		sensor_advance(&s, sensor_fading(s.time_constant_s, 1e-3), -3 + 0.2 * i);
		assert_near(s.output_g, 200 * 0.05 * (1 - exp(-1e-3 * i / 0.05)), 1e-10);
	}
}

static void without_time_constant_all_passes(void **state)
{
	struct sensor s = {.time_constant_s = 0};

	(void)state;
	sensor_settle(&s, 1);
	assert_near(s.output_g, 1.0, 0);
	sensor_advance(&s, sensor_fading(s.time_constant_s, 10), 400);
	sensor_advance(&s, sensor_fading(s.time_constant_s, 10), 400);
	assert_near(s.output_g, 400.0, 0);
}

static void codes_are_rounded_and_limited(void **state)
{
	static const struct {
		double g;
		int code;
	} known[] = {
	        {0, 0},           {1, 32},          {-1, -32},        {0.015, 0},        {0.016, 1},
	        {-0.015, 0},      {-0.016, -1},     {485.39, 15532},  {-485.39, -15532}, {1023.9, 32765},
	        {1023.95, 32766}, {1023.97, 32767}, {1024, 32767},    {1e9, 32767},      {-1023.97, -32767},
	        {-1024, -32767},  {-1025, -32767},  {-1e300, -32767}, {INFINITY, 32767}, {-INFINITY, -32767},
	};
	struct sensor s = {.time_constant_s = 0};

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
		sensor_settle(&s, known[i].g);
		assert_int_equal(sensor_convert(&s, 0, NULL), known[i].code);
	}
}

/* Bounds that a right generator misses about once in 100 000 seeds; this seed is fixed. */
static void noise_is_white_and_as_large_as_said(void **state)
{
	enum { COUNT = 40000 };
	const unsigned long seed = 20240811;
	const double sigma = 2.5 * 32, part = 4.4 / sqrt(COUNT);
	struct sensor s = {.time_constant_s = 0, .noise_g = 2.5};
	gsl_rng *rng = gsl_rng_alloc(gsl_rng_mt19937);
	double sum = 0, squares = 0, products = 0, before = 0;
	int beyond = 0;

	(void)state;
	assert_non_null(rng);
	print_message("seed %lu\n", seed);
	gsl_rng_set(rng, seed);
	sensor_settle(&s, 10);
	for (int i = 0; i < COUNT; i++) {
		const double off = sensor_convert(&s, 0, rng) - 320;

		sum += off;
		squares += off * off;
		products += off * before;
		beyond += fabs(off) > 2 * sigma;
		before = off;
	}
	gsl_rng_free(rng);
	assert_near(sum / COUNT, 0.0, part * sigma);
	assert_near_part(squares / COUNT, sigma * sigma + 1.0 / 12, part * sqrt(2)); /* 1/12: rounding */
	assert_near(products / COUNT, 0.0, part * sigma * sigma);
	assert_near((double)beyond / COUNT, 0.0455, part * sqrt(0.0455) + 0.0007); /* |codes| > 160 */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(high_pass_fades_a_step),
	        cmocka_unit_test(high_pass_follows_a_ramp),
	        cmocka_unit_test(without_time_constant_all_passes),
	        cmocka_unit_test(codes_are_rounded_and_limited),
	        cmocka_unit_test(noise_is_white_and_as_large_as_said),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
