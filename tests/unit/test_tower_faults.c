/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The tower by what must happen when something is broken.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/units.h"
#include "tests/unit/near.h"
#include "tests/unit/tower_by_hand.h"

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

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(stuck_latch_and_weak_magnet),
	        cmocka_unit_test(magnet_lets_go_late_or_not),
	        cmocka_unit_test(frame_jams_and_is_freed),
	        cmocka_unit_test(open_contacts_cut_latch_and_relief),
	        cmocka_unit_test(switches_lie_and_wires_break),
	        cmocka_unit_test(gates_glitch),
	        cmocka_unit_test(sensors_are_swapped_turned_and_disturbed),
	        cmocka_unit_test(each_fault_shows_on_its_input),
	        cmocka_unit_test(dead_gates_and_open_cables_say_nothing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
