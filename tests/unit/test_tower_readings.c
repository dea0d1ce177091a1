/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the converter gives is what the product feels.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "hil/product.h"
#include "tests/unit/near.h"
#include "tests/unit/tower_by_hand.h"

/* One drop sampled as the controller does it; codes[k] of S1 X Y, S2 X Y, and when. */
enum { TRACE = 400 };

static void trace(struct tower *tower, double from_s, int16_t codes[TRACE][6], double time_s[TRACE])
{
	for (int i = 0; i < TRACE; i++) {
		const double at = from_s + i * 1e-3 / 7;

		tower_advance(tower, at);
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes[i]);
		time_s[i] = at;
	}
}

static double between(const struct product_reading *r, double place, size_t offset)
{
	const size_t i = (size_t)place;
	double low, high;

	memcpy(&low, (const char *)&r[i] + offset, sizeof(low));
	memcpy(&high, (const char *)&r[i + 1] + offset, sizeof(high));
	return low + (high - low) * (place - (double)i);
}

/* Within tolerance, where the converter is not at its end. Returns S2's largest X. */
static int16_t codes_are_readings_of(const struct scene *scene, double tolerance)
{
	enum { STEPS = 40000, FINER = 10 };
	static const size_t part[4] = {
	        offsetof(struct product_reading, s1_x), offsetof(struct product_reading, s1_y),
	        offsetof(struct product_reading, s2_x), offsetof(struct product_reading, s2_y)};
	static const int channel[4] = {0, 1, 3, 4};
	static int16_t codes[TRACE][6];
	static double time_s[TRACE];
	static struct product_reading r[STEPS];
	struct product p;
	struct tower *tower = falling_of(scene);
	const struct tower_truth *truth = tower_truth(tower);
	int16_t largest = 0;

	tower_output(tower, MAGNET, false, fall_time(0.78) - 0.008);
	trace(tower, 0.53, codes, time_s);
	product_init(&p, scene, UNITS_RAD(25));
	product_strike(&p, truth->impact_speed_m_s);
	for (int i = 0; i < STEPS; i++) {
		product_read(&p, &r[i]);
		for (int k = 0; k < FINER; k++)
			assert_true(product_step(&p, 1e-6 / FINER) == 1e-6 / FINER);
	}
	for (int i = 0; i < TRACE; i++) {
		const double place = (time_s[i] - truth->impact_s) * 1e6;

		for (int c = 0; c < 4 && place < STEPS - 1; c++) {
			const double g = place < 0 ? 0 : between(r, place, part[c]) / G_M_S2;

			if (time_s[i] > truth->separation_s && fabs(g) < 1000)
				assert_near(codes[i][channel[c]], g * 32, tolerance);
		}
		if (abs(codes[i][0]) < 32000) /* Z of S1 and S2 over their X */
			assert_near(codes[i][2], 0.094 * codes[i][0], 0.6);
		if (abs(codes[i][3]) < 32000)
			assert_near(codes[i][5], -0.005 * codes[i][3], 0.6);
		largest = codes[i][3] > largest ? codes[i][3] : largest;
	}
	tower_destroy(tower);
	return largest;
}

static void codes_are_the_products_readings(void **state)
{
	const struct scene scene = test_scene();

	(void)state;
	assert_in_range(codes_are_readings_of(&scene, 0.6), 460 * 32, 480 * 32);
}

/* A tenth of the contact time, mounts ten times as fast: what is left of errors is in the flight. */
static void short_contacts_are_followed_too(void **state)
{
	struct scene scene = test_scene();

	(void)state;
	scene.contact_stiffness_n_m15 *= pow(10, 2.5);
	scene.mount_stiffness_n_m *= 100;
	scene.mount_damping_n_s_m *= 10;
	codes_are_readings_of(&scene, 4);
}

static void sensors_at_rest_and_in_fall(void **state)
{
	int16_t codes[6] = {9, 9, 9, 9, 9, 9};
	static const int16_t rest[6] = {29, 14, 3, 29, 14, 0}; /* 32 cos, sin 25 deg; Z by its ratio */
	struct tower *tower = falling();
	struct scene scene = test_scene();

	(void)state;
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[0], 29);
	assert_int_equal(codes[1], 9);
	assert_int_equal(codes[3], 29);
	tower_sample(tower, SENSORBUS_YZ, codes);
	assert_memory_equal(codes, rest, sizeof(rest));
	tower_advance(tower, 0.3); /* on the frame: friction alone, 0.01 g */
	tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
	for (int i = 0; i < 6; i++)
		assert_int_equal(codes[i], 0);
	tower_destroy(tower);
	/* a real supply has forgotten gravity, so that the fall reads as a step of -1 g that fades */
	scene.sensor_noise_g = 0;
	scene.sensor_iepe_time_constant_s = 0.3;
	scene.tower_frame_friction_n = 0;
	tower = make(&scene, false, 3);
	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[3], 0);
	tower_advance(tower, 0.112 + 1e-9);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_near(codes[3], -32 * cos(UNITS_RAD(tower_truth(tower)->angle_deg)), 2);
	tower_advance(tower, 0.412);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_near(codes[3], -32 * cos(UNITS_RAD(25)) * exp(-1), 1.5);
	tower_destroy(tower);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(codes_are_the_products_readings),
	        cmocka_unit_test(short_contacts_are_followed_too),
	        cmocka_unit_test(sensors_at_rest_and_in_fall),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
