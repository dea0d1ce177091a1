/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Drop after drop: what each takes from the one before, and what is drawn anew.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hil/product.h"
#include "tests/unit/near.h"
#include "tests/unit/tower_by_hand.h"

static void product_comes_to_lie_still(void **state)
{
	struct scene scene = test_scene();
	struct tower *tower;
	int16_t codes[6];

	(void)state;
	scene.drop_angle_deg = 33;
	tower = make(&scene, true, 1);
	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	tower_output(tower, MAGNET, false, fall_time(0.78) - 0.008);
	tower_advance(tower, 8);
	for (int i = 0; i < 50; i++) {
		tower_advance(tower, 8 + i * 0.01);
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
		assert_near(hypot(codes[0], codes[1]), 32.0, 1.0);
		assert_near(hypot(codes[3], codes[4]), 32.0, 1.0);
	}
	tower_destroy(tower);
}

static void drop_does_not_depend_on_who_looks(void **state)
{
	struct tower *often = falling(), *seldom = falling();
	int16_t a[6], b[6];

	(void)state;
	tower_output(seldom, MAGNET, false, fall_time(0.78) - 0.008);
	tower_output(often, MAGNET, false, fall_time(0.78) - 0.008);
	for (double at = fall_time(0.78); at < 0.6; at += 37e-6)
		tower_advance(often, at);
	tower_advance(often, 0.6);
	tower_advance(seldom, 0.6);
	assert_memory_equal(tower_truth(often), tower_truth(seldom), sizeof(struct tower_truth));
	tower_sample(often, SENSORBUS_X | SENSORBUS_YZ, a);
	tower_sample(seldom, SENSORBUS_X | SENSORBUS_YZ, b);
	for (int i = 0; i < 6; i++)
		assert_near(a[i], b[i], 1.0);
	tower_advance(often, 0.5); /* the past is the present */
	tower_sample(often, SENSORBUS_X | SENSORBUS_YZ, b);
	assert_memory_equal(a, b, sizeof(a));
	tower_destroy(often);
	tower_destroy(seldom);
}

/* Bounds that a right generator misses about once in 100 000 seeds; the seed is fixed. */
static void lifting_draws_a_new_drop(void **state)
{
	enum { COUNT = 4000 };
	const uint64_t seed = 77;
	const struct scene scene = test_scene();
	struct tower *tower = make(&scene, false, seed), *twin = make(&scene, false, seed);
	double sum = 0, squares = 0;

	(void)state;
	print_message("seed %u\n", (unsigned)seed);
	for (int i = 0; i < COUNT; i++) {
		const double off = tower_truth(tower)->angle_deg - 25;
		int16_t codes[6];

		tower_sample(twin, SENSORBUS_X, codes); /* noise drawn does not change the drops */
		assert_near(tower_truth(twin)->angle_deg, 25 + off, 0);
		sum += off;
		squares += off * off;
		tower_lift(tower);
		tower_lift(twin);
	}
	assert_near(sum / COUNT, 0.0, 4.4 / sqrt(COUNT));
	assert_near(squares / COUNT, 1.0, 4.4 * sqrt(2.0 / COUNT));
	tower_destroy(twin);
	tower_destroy(tower);
	tower = make(&scene, false, seed);
	for (int bit = 0; bit < 64; bit += 9) {
		twin = make(&scene, false, seed ^ (UINT64_C(1) << bit));
		assert_true(fabs(tower_truth(twin)->angle_deg - tower_truth(tower)->angle_deg) > 1e-9);
		tower_destroy(twin);
	}
	tower_destroy(tower);
}

static void second_drop_is_like_the_first(void **state)
{
	struct tower *tower = falling();
	struct tower_truth first;

	(void)state;
	tower_output(tower, MAGNET, false, fall_time(0.78) - 0.008);
	tower_advance(tower, 2);
	first = *tower_truth(tower);
	tower_output(tower, LATCH, false, 2);
	tower_lift(tower);
	assert_true(isnan(tower_truth(tower)->impact_s) && isnan(tower_truth(tower)->latch_open_s));
	assert_int_equal(tower_inputs(tower) &
	                         (WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD | WIRE_IO_FRAME_DOWN),
	                 WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD);
	tower_output(tower, MAGNET, true, 2.01);
	tower_output(tower, LATCH, true, 2.1);
	tower_output(tower, MAGNET, false, 2 + fall_time(0.78) - 0.008);
	tower_advance(tower, 4);
	assert_near(tower_truth(tower)->impact_s, first.impact_s + 2, 1e-11);
	assert_near(tower_truth(tower)->impact_speed_m_s, first.impact_speed_m_s, 1e-11);
	/* lifted into an energised latch it does not stay */
	tower_lift(tower);
	tower_advance(tower, 4.001);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_LATCH_CLOSED, 0);
	tower_destroy(tower);
}

/* Peaks of S1 X and S2 X over many drops. S2: 1.5 % per degree and 1 % of the resultant, which is 1.1 times
 * X, make 1.9 %. S1: 0.55 % per degree and 2 % make 2.3 %. */
static void drops_scatter_as_the_study_found(void **state)
{
	enum { COUNT = 120 };
	static const double mean_g[2] = {334.9, 475.5}, part[2] = {0.023, 0.019};
	struct scene scene = test_scene();
	struct tower *tower;
	double sum[2] = {0, 0}, squares[2] = {0, 0};
	int16_t codes[6];

	(void)state;
	scene.sensor_noise_g = 0;
	tower = make(&scene, false, 11);
	tower_output(tower, MAGNET, true, 0);
	for (int i = 0; i < COUNT; i++) {
		double peak[2] = {0, 0};

		tower_output(tower, MAGNET, false, i);
		for (int k = 0; k < 180; k++) {
			tower_advance(tower, i + 0.008 + sqrt(2 * HEIGHT_M / G) + k * 20e-6);
			tower_sample(tower, SENSORBUS_X, codes);
			peak[0] = fmax(peak[0], codes[0]);
			peak[1] = fmax(peak[1], codes[3]);
		}
		for (int s = 0; s < 2; s++) {
			sum[s] += peak[s] / 32;
			squares[s] += peak[s] / 32 * peak[s] / 32;
		}
		tower_output(tower, MAGNET, true, i + 0.5);
		tower_lift(tower);
	}
	tower_destroy(tower);
	for (int s = 0; s < 2; s++) {
		const double mean = sum[s] / COUNT;

		assert_near_part(mean, mean_g[s], 0.01);
		assert_near(sqrt(squares[s] / COUNT - mean * mean) / mean, part[s], 0.005);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(product_comes_to_lie_still),
	        cmocka_unit_test(drop_does_not_depend_on_who_looks),
	        cmocka_unit_test(lifting_draws_a_new_drop),
	        cmocka_unit_test(second_drop_is_like_the_first),
	        cmocka_unit_test(drops_scatter_as_the_study_found),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
