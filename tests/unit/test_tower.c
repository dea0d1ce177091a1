/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The tower by its closed forms, written here from the scene's numbers, and by what must happen when
 * something is broken.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "common/wire.h"
#include "hil/product.h"
#include "hil/tower.h"
#include "tests/unit/near.h"

enum { LATCH, MAGNET, RELIEVE, CAMERA };
enum { KEEPER = 2 }; /* the capture behind those of the gates */

#define G 9.81 /* at the site; of a reading it is G_M_S2 */
#define G_M_S2 9.80665
#define HEIGHT_M 0.894
#define ALL_M_S2 (G - 0.3 / 3.183) /* frame and product together */
#define FRAME_M_S2 (G - 0.3 / 3.0)
#define BRAKE_M_S2 (G * 0.8 / (0.8 * 0.1))

static struct scene test_scene(void)
{
	struct scene scene;
	char message[SCENE_MESSAGE_MAX];

	if (scene_read(&scene, "common/scenes/geometry-2A.ini", message) != 0)
		fail_msg("%s", message);
	scene.drop_height_m = HEIGHT_M;
	scene.drop_gravity_m_s2 = G;
	scene.tower_frame_mass_kg = 3.0;
	scene.tower_frame_friction_n = 0.3;
	scene.tower_latch_delay_s = 0.012;
	scene.tower_magnet_dropout_s = 0.008;
	scene.tower_gate_upper_m = 0.2;
	scene.tower_gate_lower_m = 0.7;
	scene.tower_separation_m = 0.78;
	scene.tower_dampers_m = 0.8;
	scene.tower_damper_stroke_m = 0.1;
	return scene;
}

static struct tower *make(const struct scene *scene, bool ideal, uint64_t seed)
{
	const struct tower_options options = {.seed = seed, .ideal = ideal};
	struct tower *tower = tower_create(scene, &options);

	assert_non_null(tower);
	return tower;
}

static struct tower *make_ideal(void)
{
	const struct scene scene = test_scene();

	return make(&scene, true, 1);
}

/* Magnet on, latch energised at 0.1 s: open at 0.112 s. */
static struct tower *falling_of(const struct scene *scene)
{
	struct tower *tower = make(scene, true, 1);

	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	return tower;
}

static struct tower *falling(void)
{
	const struct scene scene = test_scene();

	return falling_of(&scene);
}

static double fall_time(double travel_m)
{
	return 0.112 + sqrt(2 * travel_m / ALL_M_S2);
}

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

static void stuck_latch_and_weak_magnet(void **state)
{
	struct tower *tower = make_ideal();

	(void)state;
	tower_output(tower, MAGNET, true, 0.01);
	tower_fault(tower, TOWER_LATCH_STUCK, true);
	tower_output(tower, LATCH, true, 0.1);
	tower_advance(tower, 1);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_LATCH_CLOSED, WIRE_IO_LATCH_CLOSED);
	assert_true(isnan(tower_truth(tower)->latch_open_s));
	tower_fault(tower, TOWER_LATCH_STUCK, false);
	tower_advance(tower, 1.5);
	assert_near(tower_truth(tower)->latch_open_s, 1.0, 1e-12);
	tower_destroy(tower);

	tower = make_ideal();
	tower_output(tower, LATCH, true, 0.1);
	tower_output(tower, LATCH, false, 0.111); /* before it opened */
	tower_advance(tower, 1);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_LATCH_CLOSED, WIRE_IO_LATCH_CLOSED);
	tower_destroy(tower);

	tower = make_ideal();
	tower_output(tower, MAGNET, true, 0.01);
	tower_fault(tower, TOWER_MAGNET_WEAK, true);
	tower_advance(tower, 0.05);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, WIRE_IO_PRODUCT_HELD);
	tower_output(tower, LATCH, true, 0.1);
	tower_advance(tower, 1);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, 0);
	assert_near(tower_truth(tower)->separation_s, 0.112, 1e-12);
	assert_near(tower_truth(tower)->impact_speed_m_s, 4.18811174636, 1e-10);
	assert_near(tower_truth(tower)->frame_down_s, 0.112 + sqrt(2 * 0.8 / FRAME_M_S2), 1e-11);
	tower_destroy(tower);
}

/* Switched off it lets go when the fault does, and its drop-out is as long as it was set to. */
static void magnet_lets_go_late_or_not(void **state)
{
	struct tower *tower = make_ideal();
	uint32_t us = 0;

	(void)state;
	tower_output(tower, MAGNET, true, 0.01);
	tower_fault(tower, TOWER_MAGNET_STUCK, true);
	tower_output(tower, MAGNET, false, 0.1);
	tower_advance(tower, 5);
	assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, WIRE_IO_PRODUCT_HELD);
	tower_set_dropout(tower, 0.05);
	tower_fault(tower, TOWER_MAGNET_STUCK, false);
	tower_advance(tower, 6);
	assert_near(tower_truth(tower)->separation_s, 5.05, 1e-12);
	assert_true(tower_capture(tower, KEEPER, &us));
	assert_int_equal(us, 5050000);
	tower_destroy(tower);
	tower = make_ideal();
	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, MAGNET, false, 1);
	tower_set_dropout(tower, 0.002); /* too late for this one */
	tower_advance(tower, 2);
	assert_near(tower_truth(tower)->separation_s, 1.008, 1e-12);
	tower_lift(tower);
	tower_output(tower, MAGNET, true, 2.01);
	tower_output(tower, MAGNET, false, 3);
	tower_advance(tower, 4);
	assert_near(tower_truth(tower)->separation_s, 3.002, 1e-12);
	tower_destroy(tower);
}

/* Jammed after 0.3 m it comes to rest within 3 g's way with the product on it, and falls on when it is freed.
 */
static void frame_jams_and_is_freed(void **state)
{
	const double jam_s = fall_time(0.3), speed = sqrt(2 * ALL_M_S2 * 0.3);
	const double rest_m = 0.3 + speed * speed / (2 * 3 * UNITS_G_M_S2);
	struct tower *tower = falling();
	const struct tower_truth *truth = tower_truth(tower);

	(void)state;
	tower_advance(tower, jam_s);
	tower_fault(tower, TOWER_FRAME_JAMMED, true);
	tower_advance(tower, 5);
	assert_true(truth->frame_away);
	assert_true(isnan(truth->frame_down_s) && isnan(truth->separation_s));
	assert_int_equal(tower_inputs(tower) &
	                         (WIRE_IO_FRAME_DOWN | WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD),
	                 WIRE_IO_PRODUCT_HELD);
	tower_fault(tower, TOWER_FRAME_JAMMED, false);
	tower_advance(tower, 6);
	assert_false(truth->frame_away);
	assert_near(truth->frame_down_s, 5 + sqrt(2 * (0.8 - rest_m) / ALL_M_S2), 1e-9);
	tower_destroy(tower);
}

/* Door and emergency stop lie in series with the coils, whatever the outputs say; never with the magnet. */
static void open_contacts_cut_latch_and_relief(void **state)
{
	static const enum tower_fault contacts[2] = {TOWER_DOOR_OPEN, TOWER_ESTOP};
	const double down_m_s = sqrt(2 * ALL_M_S2 * 0.8);

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct tower *tower = make_ideal();

		tower_output(tower, MAGNET, true, 0.01);
		tower_output(tower, LATCH, true, 0.1);
		tower_advance(tower, 0.111);
		tower_fault(tower, contacts[i], true); /* a ms before it would have opened */
		tower_advance(tower, 1);
		assert_true(isnan(tower_truth(tower)->latch_open_s));
		tower_output(tower, LATCH, false, 1);
		tower_output(tower, LATCH, true, 1.1);
		tower_advance(tower, 2);
		assert_true(isnan(tower_truth(tower)->latch_open_s));
		assert_int_equal(tower_inputs(tower) & WIRE_IO_PRODUCT_HELD, WIRE_IO_PRODUCT_HELD);
		tower_fault(tower, contacts[i], false);
		tower_advance(tower, 3);
		assert_near(tower_truth(tower)->latch_open_s, 2.012, 1e-12);
		tower_destroy(tower);
		tower = falling();
		tower_output(tower, RELIEVE, true, 0.2);
		tower_advance(tower, 0.3);
		tower_fault(tower, contacts[i], true);
		tower_advance(tower, 1); /* full braking tears the product off */
		assert_near(tower_truth(tower)->separation_travel_m, 0.8, 1e-11);
		assert_near(tower_truth(tower)->frame_speed_at_separation_m_s, down_m_s, 1e-11);
		tower_destroy(tower);
	}
}

/* Each for itself while the frame falls, and what then remains true. */
static void switches_lie_and_wires_break(void **state)
{
	static const struct {
		enum tower_fault fault;
		unsigned always, never;
	} known[] = {
	        {TOWER_GATE_UPPER_WIRE, WIRE_IO_GATE_UPPER, 0},
	        {TOWER_GATE_LOWER_WIRE, WIRE_IO_GATE_LOWER, 0},
	        {TOWER_FRAME_DOWN_WIRE, WIRE_IO_FRAME_DOWN, 0},
	        {TOWER_FRAME_READS_UP, 0, WIRE_IO_FRAME_DOWN},
	        {TOWER_LATCH_READS_CLOSED, WIRE_IO_LATCH_CLOSED, 0},
	        {TOWER_LATCH_READS_OPEN, 0, WIRE_IO_LATCH_CLOSED},
	        {TOWER_GATE_UPPER_DEAD, 0, WIRE_IO_GATE_UPPER},
	        {TOWER_GATE_LOWER_DEAD, 0, WIRE_IO_GATE_LOWER},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
		struct tower *tower = falling();
		uint32_t us = 0;

		tower_fault(tower, known[i].fault, true);
		for (unsigned gate = 0; gate < 2;
		     gate++) /* a wire that breaks is an edge, then nothing more */
			assert_int_equal(tower_capture(tower, gate, &us),
			                 known[i].always == (gate ? WIRE_IO_GATE_LOWER : WIRE_IO_GATE_UPPER));
		for (double at = 0.1; at < 1; at += 0.001) {
			tower_advance(tower, at);
			assert_int_equal(tower_inputs(tower) & known[i].always, known[i].always);
			assert_int_equal(tower_inputs(tower) & known[i].never, 0);
		}
		assert_int_equal(tower_capture(tower, 0, &us),
		                 known[i].fault != TOWER_GATE_UPPER_WIRE &&
		                         known[i].fault != TOWER_GATE_UPPER_DEAD);
		assert_int_equal(tower_capture(tower, 1, &us),
		                 known[i].fault != TOWER_GATE_LOWER_WIRE &&
		                         known[i].fault != TOWER_GATE_LOWER_DEAD);
		assert_near(tower_truth(tower)->frame_down_s, fall_time(0.8), 1e-11);
		tower_destroy(tower);
	}
}

static void gates_glitch(void **state)
{
	struct tower *tower = make_ideal();
	uint32_t us = 0;

	(void)state;
	tower_glitch(tower, 1, 2);
	tower_glitch(tower, 7, 2);
	tower_advance(tower, 0.5);
	assert_false(tower_capture(tower, 0, &us));
	assert_true(tower_capture(tower, 1, &us));
	assert_int_equal(us, 500000);
	tower_advance(tower, 0.625);
	assert_true(tower_capture(tower, 1, &us));
	assert_int_equal(us, 625000);
	assert_false(tower_capture(tower, 1, &us));
	assert_int_equal(tower_inputs(tower) & WIRE_IO_GATE_LOWER, 0);
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

static void sensors_are_swapped_turned_and_disturbed(void **state)
{
	static const struct {
		enum tower_fault fault;
		int16_t codes[6];
	} known[] = {/* 32 cos, sin 25 deg; Z by its ratio */
	             {TOWER_SENSORS_SWAPPED, {29, 14, 0, 29, 14, 3}},
	             {TOWER_S1_REVERSED, {-29, -14, 3, 29, 14, 0}},
	             {TOWER_S2_REVERSED, {29, 14, 3, -29, -14, 0}}};
	struct tower *tower = make_ideal();
	int16_t codes[6];

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
		tower_fault(tower, known[i].fault, true);
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
		assert_memory_equal(codes, known[i].codes, sizeof(codes));
		tower_fault(tower, known[i].fault, false);
	}
	tower_fault(tower, TOWER_SENSORS_SWAPPED, true);
	tower_fault(tower, TOWER_CABLE_S1, true);
	assert_int_equal(tower_inputs(tower) & (WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2), WIRE_IO_IEPE_S1);
	assert_int_equal(tower_bias_high(tower), 2);
	tower_destroy(tower);
	tower = make_ideal();
	tower_spike(tower, 1, 100);
	tower_spike(tower, 2, 100); /* there is none */
	tower_sample(tower, SENSORBUS_X, codes);
	assert_int_equal(codes[0], 29);
	assert_int_equal(codes[3], 29 + 3200);
	tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
	assert_int_equal(codes[3], 29);
	assert_int_equal(codes[4], 14 + 3200);
	tower_sample(tower, SENSORBUS_YZ, codes);
	assert_int_equal(codes[4], 14);
	tower_destroy(tower);
}

static void each_fault_shows_on_its_input(void **state)
{
	static const struct {
		enum tower_fault fault;
		const char *name;
		unsigned clears, sets;
	} known[] = {
	        {TOWER_DOOR_OPEN, "door_open", WIRE_IO_DOOR_CLOSED, 0},
	        {TOWER_ESTOP, "estop", WIRE_IO_ESTOP_CLEAR, 0},
	        {TOWER_SUPPLY_LOW, "supply_low", WIRE_IO_SUPPLY_GOOD, 0},
	        {TOWER_DAMPERS_OUT, "dampers_out", WIRE_IO_DAMPERS_ENGAGED, 0},
	        {TOWER_GATE_UPPER_DEAD, "gate_upper_dead", 0, 0},
	        {TOWER_GATE_LOWER_DEAD, "gate_lower_dead", 0, 0},
	        {TOWER_GATE_UPPER_WIRE, "gate_upper_wire", 0, WIRE_IO_GATE_UPPER},
	        {TOWER_GATE_LOWER_WIRE, "gate_lower_wire", 0, WIRE_IO_GATE_LOWER},
	        {TOWER_FRAME_DOWN_WIRE, "frame_down_wire", 0, WIRE_IO_FRAME_DOWN},
	        {TOWER_FRAME_READS_UP, "frame_reads_up", 0, 0},
	        {TOWER_LATCH_READS_CLOSED, "latch_reads_closed", 0, 0},
	        {TOWER_LATCH_READS_OPEN, "latch_reads_open", WIRE_IO_LATCH_CLOSED, 0},
	        {TOWER_FRAME_JAMMED, "frame_jammed", 0, 0},
	        {TOWER_LATCH_STUCK, "latch_stuck", 0, 0},
	        {TOWER_MAGNET_WEAK, "magnet_weak", 0, 0},
	        {TOWER_MAGNET_STUCK, "magnet_stuck", 0, 0},
	        {TOWER_CABLE_S1, "cable_s1", WIRE_IO_IEPE_S1, 0},
	        {TOWER_CABLE_S2, "cable_s2", WIRE_IO_IEPE_S2, 0},
	        {TOWER_SHORT_S1, "short_s1", WIRE_IO_IEPE_S1, 0},
	        {TOWER_SHORT_S2, "short_s2", WIRE_IO_IEPE_S2, 0},
	        {TOWER_SENSORS_SWAPPED, "sensors_swapped", 0, 0},
	        {TOWER_S1_REVERSED, "s1_reversed", 0, 0},
	        {TOWER_S2_REVERSED, "s2_reversed", 0, 0},
	};
	struct tower *tower = make_ideal();
	const unsigned quiet = tower_inputs(tower);

	(void)state;
	assert_int_equal(sizeof(known) / sizeof(known[0]), TOWER_FAULTS);
	for (size_t i = 0; i < TOWER_FAULTS; i++) {
		tower_fault(tower, known[i].fault, true);
		assert_int_equal(tower_inputs(tower), (quiet & ~known[i].clears) | known[i].sets);
		assert_int_equal(tower_bias_high(tower), known[i].fault == TOWER_CABLE_S1   ? 1
		                                         : known[i].fault == TOWER_CABLE_S2 ? 2
		                                                                            : 0);
		for (size_t j = 0; j < TOWER_FAULTS; j++)
			assert_int_equal(tower_has_fault(tower, known[j].fault), j == i);
		tower_fault(tower, known[i].fault, false);
		assert_int_equal(tower_inputs(tower), quiet);
		assert_string_equal(tower_fault_name(known[i].fault), known[i].name);
	}
	assert_null(tower_fault_name(TOWER_FAULTS));
	assert_false(tower_has_fault(tower, TOWER_FAULTS));
	tower_destroy(tower);
}

static void dead_gates_and_open_cables_say_nothing(void **state)
{
	const struct scene scene = test_scene();
	struct tower *tower = make(&scene, false, 5);
	int16_t codes[6];
	uint32_t us;

	(void)state;
	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	tower_fault(tower, TOWER_GATE_LOWER_DEAD, true);
	tower_fault(tower, TOWER_CABLE_S1, true);
	tower_advance(tower, fall_time(0.71));
	assert_int_equal(tower_inputs(tower) & (WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER), 0);
	tower_advance(tower, 6); /* long after the supply forgot the jump */
	assert_true(tower_capture(tower, 0, &us));
	assert_false(tower_capture(tower, 1, &us));
	for (int i = 0; i < 50; i++) {
		tower_sample(tower, SENSORBUS_X | SENSORBUS_YZ, codes);
		assert_int_equal(codes[0], 0);
		assert_int_equal(codes[1], 0);
		assert_int_equal(codes[2], 0);
	}
	tower_destroy(tower);
}

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
	        cmocka_unit_test(pin_holds_until_the_magnet_does),
	        cmocka_unit_test(gates_see_the_frame_at_its_time),
	        cmocka_unit_test(product_separates_where_planned),
	        cmocka_unit_test(codes_are_the_products_readings),
	        cmocka_unit_test(short_contacts_are_followed_too),
	        cmocka_unit_test(sensors_at_rest_and_in_fall),
	        cmocka_unit_test(magnet_off_at_rest_drops_the_product),
	        cmocka_unit_test(braking_tears_the_product_off),
	        cmocka_unit_test(frame_brakes_and_stands),
	        cmocka_unit_test(stuck_latch_and_weak_magnet),
	        cmocka_unit_test(magnet_lets_go_late_or_not),
	        cmocka_unit_test(frame_jams_and_is_freed),
	        cmocka_unit_test(open_contacts_cut_latch_and_relief),
	        cmocka_unit_test(switches_lie_and_wires_break),
	        cmocka_unit_test(gates_glitch),
	        cmocka_unit_test(friction_can_hold_the_frame),
	        cmocka_unit_test(friction_changes_on_the_way),
	        cmocka_unit_test(wires_pull_when_they_are_taut),
	        cmocka_unit_test(a_kick_turns_the_product_in_its_fall),
	        cmocka_unit_test(the_latch_knocks_once),
	        cmocka_unit_test(a_hand_lets_the_product_go),
	        cmocka_unit_test(sensors_are_swapped_turned_and_disturbed),
	        cmocka_unit_test(each_fault_shows_on_its_input),
	        cmocka_unit_test(dead_gates_and_open_cables_say_nothing),
	        cmocka_unit_test(product_comes_to_lie_still),
	        cmocka_unit_test(drop_does_not_depend_on_who_looks),
	        cmocka_unit_test(lifting_draws_a_new_drop),
	        cmocka_unit_test(second_drop_is_like_the_first),
	        cmocka_unit_test(drops_scatter_as_the_study_found),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
