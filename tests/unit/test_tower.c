/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The tower by its closed forms, written here from the scene's numbers.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>

#include "common/units.h"
#include "hil/product.h"
#include "tests/unit/near.h"
#include "tests/unit/tower_by_hand.h"

static void pin_holds_until_the_magnet_does(void **state)
{
	const unsigned quiet = WIRE_IO_LATCH_CLOSED | WIRE_IO_DAMPERS_ENGAGED | WIRE_IO_DOOR_CLOSED |
	                       WIRE_IO_ESTOP_CLEAR | WIRE_IO_SUPPLY_GOOD | WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2 |
	                       WIRE_IO_PRODUCT_HELD;
	struct tower *tower = make_ideal();

	(void)state;
	assert_int_equal(tower_inputs(tower), quiet);
	tower_advance(tower, 3.0);
	assert_int_equal(tower_inputs(tower), quiet);
	assert_true(isnan(tower_truth(tower)->separation_s));
	tower_output(tower, MAGNET, true, 3.0);
	assert_int_equal(tower_inputs(tower), quiet);
	tower_output(tower, MAGNET, false, 3.1); /* the pin is gone */
	tower_advance(tower, 3.2);
	assert_int_equal(tower_inputs(tower), quiet - WIRE_IO_PRODUCT_HELD);
	tower_destroy(tower);
}

static void gates_see_the_frame_at_its_time(void **state)
{
	static const double gate_m[2] = {0.2, 0.7};
	static const unsigned input[2] = {WIRE_IO_GATE_UPPER, WIRE_IO_GATE_LOWER};
	struct tower *tower = falling();
	uint32_t us = 0;

	(void)state;
	for (unsigned gate = 0; gate < 2; gate++) {
		const double passes_s = fall_time(gate_m[gate]), clear_s = fall_time(gate_m[gate] + 0.02);

		tower_advance(tower, passes_s - 2e-6);
		assert_int_equal(tower_inputs(tower) & input[gate], 0);
		assert_false(tower_capture(tower, gate, &us));
		tower_advance(tower, passes_s + 2e-6);
		assert_int_equal(tower_inputs(tower) & input[gate], input[gate]);
		assert_true(tower_capture(tower, gate, &us));
		assert_near(us, passes_s * 1e6 - 0.5, 0.5 + 1e-3);
		assert_false(tower_capture(tower, gate, &us));
		tower_advance(tower, clear_s - 1e-6);
		assert_int_equal(tower_inputs(tower) & input[gate], input[gate]);
		tower_advance(tower, clear_s + 1e-6);
		assert_int_equal(tower_inputs(tower) & input[gate], 0);
	}
	assert_near(tower_truth(tower)->latch_open_s, 0.112, 1e-12);
	assert_false(tower_capture(tower, KEEPER, &us));
	assert_false(tower_capture(tower, KEEPER + 1, &us));
	tower_destroy(tower);
}

static void product_separates_where_planned(void **state)
{
	const double separates_s = fall_time(0.78), speed = sqrt(2 * ALL_M_S2 * 0.78);
	const double hits_m_s = sqrt(speed * speed + 2 * G * (HEIGHT_M - 0.78));
	const double down_m_s = sqrt(speed * speed + 2 * FRAME_M_S2 * 0.02);
	struct tower *tower = falling();
	const struct tower_truth *truth = tower_truth(tower);
	uint32_t us = 0;

	(void)state;
	tower_output(tower, MAGNET, false, separates_s - 0.008);
	tower_advance(tower, separates_s - 1e-6);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, WIRE_IO_PRODUCT_HELD);
	assert_true(isnan(truth->separation_s));
	assert_false(tower_capture(tower, KEEPER, &us));
	assert_true(truth->frame_away);
	tower_advance(tower, separates_s + 1e-6);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, 0);
	assert_true(tower_capture(tower, KEEPER, &us));
	assert_near(us, separates_s * 1e6 - 0.5, 0.5 + 1e-3); /* rounded down */
	assert_false(tower_capture(tower, KEEPER, &us));
	tower_advance(tower, 1);
	assert_false(truth->frame_away);
	assert_near(truth->magnet_off_s, separates_s - 0.008, 1e-12);
	assert_near(truth->separation_s, separates_s, 1e-12);
	assert_near(truth->separation_travel_m, 0.78, 1e-11);
	assert_near(truth->frame_speed_at_separation_m_s, speed, 1e-11);
	assert_near(truth->impact_speed_m_s, hits_m_s, 1e-11);
	assert_near(truth->impact_s, separates_s + (hits_m_s - speed) / G, 1e-11);
	assert_near(truth->frame_down_s, separates_s + (down_m_s - speed) / FRAME_M_S2, 1e-11);
	assert_near(truth->angle_deg, 25.0, 0);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_FRAME_DOWN, WIRE_IO_FRAME_DOWN);
	tower_destroy(tower);
}

static void magnet_off_at_rest_drops_the_product(void **state)
{
	struct tower *tower = make_ideal();
	const struct tower_truth *truth = tower_truth(tower);

	(void)state;
	tower_output(tower, MAGNET, true, 0.1);
	tower_output(tower, MAGNET, false, 0.2);
	tower_output(tower, MAGNET, true, 0.207); /* in time */
	tower_advance(tower, 1);
	assert_true(isnan(truth->separation_s) && isnan(truth->magnet_off_s));
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, WIRE_IO_PRODUCT_HELD);
	tower_output(tower, MAGNET, false, 1);
	tower_output(tower, MAGNET, true, 1.009); /* too late */
	tower_advance(tower, 2);
	assert_int_equal(tower_inputs(tower) & (WIRE_IO_PRODUCT_HELD | WIRE_IO_LATCH_CLOSED),
	                 WIRE_IO_LATCH_CLOSED);
	assert_near(truth->separation_s, 1.008, 1e-12);
	assert_near(truth->separation_travel_m, 0.0, 0);
	assert_near(truth->impact_s, 1.008 + sqrt(2 * HEIGHT_M / G), 1e-11);
	assert_near(truth->impact_speed_m_s, 4.18811174636, 1e-10);
	assert_true(isnan(truth->latch_open_s) && isnan(truth->frame_down_s));
	tower_destroy(tower);
}

static void braking_tears_the_product_off(void **state)
{
	const double down_m_s = sqrt(2 * ALL_M_S2 * 0.8);
	struct tower *tower = falling();
	struct scene scene = test_scene();

	(void)state;
	tower_advance(tower, 1);
	assert_near(tower_truth(tower)->separation_s, fall_time(0.8), 1e-11);
	assert_near(tower_truth(tower)->separation_travel_m, 0.8, 1e-11);
	assert_near(tower_truth(tower)->frame_speed_at_separation_m_s, down_m_s, 1e-11);
	assert_near(tower_truth(tower)->impact_speed_m_s, sqrt(down_m_s * down_m_s + 2 * G * 0.094), 1e-11);
	assert_true(isnan(tower_truth(tower)->magnet_off_s));
	tower_destroy(tower);
	/* relieved dampers brake too little for that: it rides down to the mat */
	tower = falling();
	tower_output(tower, RELIEVE, true, 0.2);
	assert_true(tower_inputs(tower) & WIRE_IO_DAMPERS_ENGAGED); /* a position switch */
	tower_advance(tower, 1);
	assert_near(tower_truth(tower)->separation_travel_m, HEIGHT_M, 1e-11);
	assert_near(tower_truth(tower)->impact_speed_m_s,
	            sqrt(down_m_s * down_m_s - 2 * BRAKE_M_S2 / 4 * 0.094), 1e-11);
	tower_destroy(tower);
	/* with dampers out and a short way, the hard stop does it */
	scene.tower_damper_stroke_m = 0.05;
	tower = make(&scene, true, 1);
	tower_output(tower, MAGNET, true, 0.01);
	tower_fault(tower, TOWER_DAMPERS_OUT, true);
	tower_output(tower, LATCH, true, 0.1);
	tower_advance(tower, 1);
	assert_near(tower_truth(tower)->separation_travel_m, 0.85, 1e-11);
	assert_near(tower_truth(tower)->frame_speed_at_separation_m_s, sqrt(2 * ALL_M_S2 * 0.85), 1e-11);
	tower_destroy(tower);
}

/* On the pin the product stays on the frame, so its sensors tell how the frame is braked. */
static void frame_brakes_and_stands(void **state)
{
	const double down_s = fall_time(0.8), down_m_s = sqrt(2 * ALL_M_S2 * 0.8);
	struct tower *tower = make_ideal();
	int16_t codes[6];

	(void)state;
	tower_output(tower, LATCH, true, 0.1);
	tower_advance(tower, down_s + 1e-3);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_near(codes[3], 32 * (G + BRAKE_M_S2) / G_M_S2 * cos(UNITS_RAD(25)), 0.51);
	tower_advance(tower, down_s + down_m_s / BRAKE_M_S2 - 1e-4);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_near(codes[3], 32 * (G + BRAKE_M_S2) / G_M_S2 * cos(UNITS_RAD(25)), 0.51);
	tower_advance(tower, down_s + down_m_s / BRAKE_M_S2 + 1e-4);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[3], 29);
	tower_advance(tower, 9);
	assert_true(isnan(tower_truth(tower)->separation_s));
	assert_int_equal(tower_inputs(tower) & WIRE_IO_FRAME_DOWN, WIRE_IO_FRAME_DOWN);
	tower_destroy(tower);
}

static void friction_can_hold_the_frame(void **state)
{
	struct scene scene = test_scene();
	struct tower *tower;

	(void)state;
	scene.tower_frame_friction_n = 1000;
	tower = make(&scene, true, 1);
	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	tower_advance(tower, 9);
	assert_near(tower_truth(tower)->latch_open_s, 0.112, 1e-12);
	assert_int_equal(tower_inputs(tower) & (WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD),
	                 WIRE_IO_PRODUCT_HELD);
	assert_true(isnan(tower_truth(tower)->separation_s) && isnan(tower_truth(tower)->frame_down_s));
	tower_destroy(tower);
}

/* From rest with 0.3 N for 0.188 s, then with 6 N. */
static void friction_changes_on_the_way(void **state)
{
	const double before_s = 0.188, speed = ALL_M_S2 * before_s,
	             way_m = ALL_M_S2 * before_s * before_s / 2;
	const double rougher = G - 6 / 3.183;
	struct tower *tower = falling();
	uint32_t us = 0;

	(void)state;
	tower_advance(tower, 0.112 + before_s);
	tower_set_friction(tower, 6);
	tower_advance(tower, 1);
	assert_true(tower_capture(tower, 1, &us));
	assert_near(us,
	            1e6 * (0.3 + (sqrt(speed * speed + 2 * rougher * (0.7 - way_m)) - speed) / rougher) - 0.5,
	            0.5 + 1e-3);
	assert_near(tower_truth(tower)->frame_down_s,
	            0.3 + (sqrt(speed * speed + 2 * rougher * (0.8 - way_m)) - speed) / rougher, 1e-11);
	tower_destroy(tower);
}

/* 20 mm of slack, then three tenths of the weight. */
static void wires_pull_when_they_are_taut(void **state)
{
	const double speed = sqrt(2 * ALL_M_S2 * 0.78), away = G - FRAME_M_S2;
	const double down_s = (sqrt(speed * speed + 2 * FRAME_M_S2 * 0.02) - speed) / FRAME_M_S2;
	const double lead_m = away * down_s * down_s / 2, lead_m_s = away * down_s, braked = G + BRAKE_M_S2;
	const double taut_s =
	        down_s + (sqrt(lead_m_s * lead_m_s + 2 * braked * (0.02 - lead_m)) - lead_m_s) / braked;
	const double taut_m_s = speed + G * taut_s, taut_m = 0.78 + speed * taut_s + G * taut_s * taut_s / 2;
	const double hits_m_s = sqrt(taut_m_s * taut_m_s + 2 * 0.7 * G * (HEIGHT_M - taut_m));
	struct scene scene = test_scene();
	struct tower *tower;
	int16_t codes[6];

	(void)state;
	scene.tower_wire_slack_m = 0.02;
	scene.tower_wire_pull_ratio = 0.3;
	tower = falling_of(&scene);
	tower_output(tower, MAGNET, false, fall_time(0.78) - 0.008);
	tower_advance(tower, fall_time(0.78) + taut_s - 1e-6);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[3], 0);
	tower_advance(tower, fall_time(0.78) + taut_s + 1e-6);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_near(codes[3], 32 * 0.3 * G / G_M_S2 * cos(UNITS_RAD(25)), 0.51);
	tower_advance(tower, 1);
	assert_near(tower_truth(tower)->impact_speed_m_s, hits_m_s, 1e-10);
	assert_near(tower_truth(tower)->impact_s,
	            fall_time(0.78) + taut_s + (hits_m_s - taut_m_s) / (0.7 * G), 1e-11);
	tower_destroy(tower);
	tower = falling_of(&scene); /* the same if nobody looks */
	tower_output(tower, MAGNET, false, fall_time(0.78) - 0.008);
	tower_advance(tower, 1);
	assert_near(tower_truth(tower)->impact_speed_m_s, hits_m_s, 1e-10);
	tower_destroy(tower);
}

/* Below the centre of gravity. */
static double corner_m(double angle)
{
	const double half_m = 0.0505;

	return half_m / tan(UNITS_RAD(25)) * fabs(cos(angle)) + half_m * fabs(sin(angle));
}

static void a_kick_turns_the_product_in_its_fall(void **state)
{
	static const double kick_deg_s[3] = {100, -60, 500}; /* the last turns it over */

	(void)state;
	for (int i = 0; i < 3; i++) {
		const double spin = UNITS_RAD(kick_deg_s[i]), angle = UNITS_RAD(15);
		double low = 0.3, high = 0.6;
		struct scene scene = test_scene();
		struct tower *tower;
		int16_t codes[6];

		scene.tower_magnet_kick_deg_s = kick_deg_s[i];
		scene.drop_angle_deg = 15;
		for (int k = 0; k < 60; k++) {
			const double s = (low + high) / 2;

			if (G * s * s / 2 + corner_m(angle + spin * s) < HEIGHT_M + corner_m(angle))
				low = s;
			else
				high = s;
		}
		tower = make(&scene, true, 1);
		tower_output(tower, MAGNET, true, 0.1);
		tower_output(tower, MAGNET, false, 1);
		tower_advance(tower, 1.3);
		assert_true(tower_truth(tower)->angle_deg == 15);
		tower_advance(tower, 2);
		assert_near(tower_truth(tower)->impact_s, 1.008 + low, 1e-11);
		assert_near(tower_truth(tower)->impact_speed_m_s, G * low, 1e-10);
		assert_near(tower_truth(tower)->angle_deg, 15 + kick_deg_s[i] * low, 1e-9);
		tower_destroy(tower);
		/* S2 is 65 mm off the centre: w^2 s, in the air and as the corner touches */
		tower = make(&scene, true, 1);
		tower_output(tower, MAGNET, true, 0.1);
		tower_output(tower, MAGNET, false, 1);
		for (int k = 0; k < 2; k++) {
			tower_advance(tower, 1.008 + low + (k ? 1e-8 : -1e-8));
			tower_sample(tower, SENSORBUS_X, codes);
			assert_near(codes[3], -32 * spin * spin * 0.065 / G_M_S2, 0.6);
		}
		tower_advance(tower, 1.008 + low + 30e-6);
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
		assert_in_range(abs(codes[3]) + abs(codes[4]), 32 * 3, 32 * 40);
		tower_destroy(tower);
	}
}

/* One swing of 50 g at 500 Hz: a quarter of it up, three quarters down, then nothing. */
static void the_latch_knocks_once(void **state)
{
	static const double at_s[4] = {0.0005, 0.001, 0.0015, 0.0025}, swing_g[4] = {50, 0, -50, 0};
	struct scene scene = test_scene();
	struct tower *tower;
	int16_t codes[6];
	uint32_t us;

	(void)state;
	scene.tower_knock_g = 50;
	scene.tower_knock_hz = 500;
	tower = falling_of(&scene);
	for (int i = 0; i < 4; i++) {
		tower_advance(tower, 0.112 + at_s[i]);
		tower_sample(tower, SENSORBUS_X, codes);
		assert_near(codes[3], 32 * ((G - ALL_M_S2) / G_M_S2 + swing_g[i]) * cos(UNITS_RAD(25)), 0.6);
	}
	tower_advance(tower, 1);
	assert_true(tower_capture(tower, 1, &us));
	assert_near(us, 1e6 * fall_time(0.7) - 0.5, 0.5 + 1e-3);
	tower_destroy(tower);
	/* not felt by a product that has left */
	tower = make(&scene, true, 1);
	tower_output(tower, LATCH, true, 0.1);
	tower_let_go(tower);
	tower_advance(tower, 0.1125);
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[3], 0);
	tower_destroy(tower);
}

/* The study's rebound: let go from a standing frame, the speed changes by 1.5 times that of the fall, 6.28
 * m/s. */
static void a_hand_lets_the_product_go(void **state)
{
	struct scene scene = test_scene();
	struct tower *tower;
	int16_t codes[6];
	double change_m_s = 0;

	(void)state;
	if (scene_read(&scene, "common/scenes/geometry-1.ini", (char[SCENE_MESSAGE_MAX]){0}) != 0)
		fail();
	scene.drop_height_m = HEIGHT_M;
	scene.drop_gravity_m_s2 = G;
	tower = make(&scene, true, 1);
	tower_advance(tower, 1);
	tower_let_go(tower);
	tower_let_go(tower); /* it has no other */
	tower_advance(tower, 1 + sqrt(2 * HEIGHT_M / G) - 1e-5);
	assert_true(tower_truth(tower)->separation_s == 1 && isnan(tower_truth(tower)->impact_s));
	assert_int_equal(tower_inputs(tower) & (WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD),
	                 WIRE_IO_LATCH_CLOSED);
	for (int i = 0; i < 500; i++) {
		tower_advance(tower, 1 + sqrt(2 * HEIGHT_M / G) + 10e-6 * i);
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
		change_m_s +=
		        (codes[0] * cos(UNITS_RAD(25)) + codes[1] * sin(UNITS_RAD(25))) / 32 * G_M_S2 * 10e-6;
	}
	assert_near(tower_truth(tower)->impact_speed_m_s, 4.18811174636, 1e-9);
	assert_near_part(change_m_s, 6.28, 0.01);
	tower_destroy(tower);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(pin_holds_until_the_magnet_does),
	        cmocka_unit_test(gates_see_the_frame_at_its_time),
	        cmocka_unit_test(product_separates_where_planned),
	        cmocka_unit_test(magnet_off_at_rest_drops_the_product),
	        cmocka_unit_test(braking_tears_the_product_off),
	        cmocka_unit_test(frame_brakes_and_stands),
	        cmocka_unit_test(friction_can_hold_the_frame),
	        cmocka_unit_test(friction_changes_on_the_way),
	        cmocka_unit_test(wires_pull_when_they_are_taut),
	        cmocka_unit_test(a_kick_turns_the_product_in_its_fall),
	        cmocka_unit_test(the_latch_knocks_once),
	        cmocka_unit_test(a_hand_lets_the_product_go),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
