/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The sequence: the times of its edges against the physics of a fall, gates and switches; the drop after it.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>

#include "tests/unit/sequence_by_hand.h"

/* Time to a travel under constant acceleration from rest, us. */
static double fall_us(double travel_m, double acceleration)
{
	return 1e6 * sqrt(2 * travel_m / acceleration);
}

static void fall_with(double acceleration, uint32_t start_us)
{
	sequence_gate(&sequence, 0, start_us + (uint32_t)lrint(fall_us(0.2, acceleration)));
	sequence_gate(&sequence, 1, start_us + (uint32_t)lrint(fall_us(0.7, acceleration)));
}

static void edges_follow_the_fall(void **state)
{
	/* mm/s between the gates: 500 mm over the time between them */
	static const struct {
		double acceleration;
		bool slow;
		uint16_t speed_mm_s;
	} falls[] = {{9.81, false, 2843}, {9.60, false, 2813}, {9.40, true, 2783}, {7.0, true, 2402}};

	(void)state;
	for (size_t i = 0; i < sizeof(falls) / sizeof(falls[0]); i++) {
		double a = falls[i].acceleration;
		uint32_t start_us;

		to_falling();
		start_us = fake.now_us + 333;
		fall_with(a, start_us);
		assert_int_equal(fake.planned, WIRE_IO_MAGNET_HOLD | WIRE_IO_DAMPERS_RELIEVE);
		/* gates are whole us: half a us each, carried over from 0.5 m to 0.08 and 0.1 m */
		assert_in_range(fake.off_us[1] + 8000 + 2 - start_us, (uint32_t)lrint(fall_us(0.78, a)),
		                (uint32_t)lrint(fall_us(0.78, a)) + 4);
		assert_in_range(fake.off_us[2] + 2 - start_us, (uint32_t)lrint(fall_us(0.80, a)),
		                (uint32_t)lrint(fall_us(0.80, a)) + 4);
		assert_in_range(sequence.frame_speed_mm_s, falls[i].speed_mm_s - 1u,
		                falls[i].speed_mm_s + 1u);
		assert_int_equal((sequence.marks & WIRE_MARK_SLOW_FRAME) != 0, falls[i].slow);
		assert_int_equal(counters[WIRE_COUNTER_edges_late], 0);
	}
}

static void edges_in_numbers_by_hand(void **state)
{
	uint32_t start_us;

	(void)state;
	/* t1 = 200 ms, t2 = 375 ms: sqrt .78 - sqrt .7 over sqrt .7 - sqrt .2 = .0465165 / .3894464 =
	 * .1194427, 175 ms of it is 20.902 ms; for .80 m .0577671 / .3894464 = .1483313, 25.958 ms */
	to_falling();
	start_us = fake.now_us;
	sequence_gate(&sequence, 0, start_us + 200000);
	sequence_gate(&sequence, 1, start_us + 375000);
	assert_in_range(fake.off_us[1] - start_us, 387901, 387904); /* 8 ms before 395 902 */
	assert_in_range(fake.off_us[2] - start_us, 400957, 400960);
	assert_int_equal(sequence.frame_speed_mm_s, 2857);
}

static void late_edge_is_made_at_once(void **state)
{
	(void)state;
	to_falling();
	sequence.times.dropout_us = 50000; /* as ARM may bring it */
	fake_time(sequence.times.released_us + 380000);
	fall_with(9.81, sequence.times.released_us + 2000);
	assert_int_equal(counters[WIRE_COUNTER_edges_late], 1);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	assert_true(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
	assert_int_equal(sequence.times.magnet_off_us, fake.now_us);
}

/* Free fall, 9.80665 m/s2: 0.2 m in 201.962 ms, 0.7 m in 377.837 ms; the dampers at 0.8 m, with 9.84, in
 * 403.239 ms. */
static void the_relief_ends_in_time(void **state)
{
	(void)state;
	to_falling(); /* no gate says anything */
	assert_int_equal(fake.planned, WIRE_IO_DAMPERS_RELIEVE);
	assert_in_range(fake.off_us[2] - sequence.times.released_us, 403237, 403239);
	while (now_ms * 1000 < sequence.times.released_us + 404000)
		tick();
	assert_false(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
	to_falling(); /* the lower gate comes after it: nothing brings the relief back */
	sequence_gate(&sequence, 0, sequence.times.released_us + 230000);
	fake_time(sequence.times.released_us + 430000);
	sequence_gate(&sequence, 1, sequence.times.released_us + 430000);
	assert_false(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
	assert_int_equal(fake.planned, WIRE_IO_MAGNET_HOLD);
}

static void a_gate_must_be_plausible(void **state)
{
	uint32_t released_us;

	(void)state;
	to_falling();
	released_us = sequence.times.released_us;
	sequence_gate(&sequence, 0, released_us + 5000);   /* the latch's shock */
	sequence_gate(&sequence, 0, released_us + 176710); /* 7/8 of 201 962 is 176 716 */
	sequence_gate(&sequence, 1, released_us + 330600); /* 7/8 of 377 837 is 330 607 */
	assert_int_equal(sequence.times.gates, 0);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 3);
	sequence_gate(&sequence, 0, released_us + 176720); /* the last one before the lower gate counts */
	sequence_gate(&sequence, 0, released_us + 200000);
	sequence_gate(&sequence, 1, released_us + 330600);
	sequence_gate(&sequence, 1, released_us + 375000);
	assert_in_range(fake.off_us[1] - released_us, 387901, 387904);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 4);
	sequence_gate(&sequence, 0, released_us + 376000); /* the beam again */
	sequence_gate(&sequence, 1, released_us + 376000);
	assert_in_range(fake.off_us[1] - released_us, 387901, 387904);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 6);
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
	to_falling(); /* a latch whose switch is closed holds the frame */
	fake.inputs |= WIRE_IO_LATCH_CLOSED;
	tick();
	sequence_gate(&sequence, 0, sequence.times.released_us + 200000);
	sequence_gate(&sequence, 1, sequence.times.released_us + 375000);
	assert_int_equal(fake.planned, WIRE_IO_DAMPERS_RELIEVE);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 2);
	to_ready(); /* somebody lifts a frame through them */
	sequence_gate(&sequence, 1, fake.now_us);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 1);
}

static void gates_out_of_order_or_missing(void **state)
{
	uint32_t start_ms;

	(void)state;
	to_falling();
	sequence_gate(&sequence, 1, fake.now_us + 377773);
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(counters[WIRE_COUNTER_gates_missed], 1);
	to_falling(); /* no upper gate: at twice 201.93 ms after the release */
	start_ms = sequence.released_ms;
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(now_ms - start_ms, 404);
	to_falling(); /* no lower gate: 755.55 ms */
	start_ms = sequence.released_ms;
	sequence_gate(&sequence, 0, fake.now_us + 201928);
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(now_ms - start_ms, 756);
	to_falling(); /* frame down without it */
	sequence_gate(&sequence, 0, fake.now_us + 201928);
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	to_falling(); /* faster than any fall: not the frame */
	sequence_gate(&sequence, 0, fake.now_us + 300000);
	sequence_gate(&sequence, 1, fake.now_us + 400000);
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
}

/* Gates 10 mm apart and a frame that crawls: the magnet's edge would come seconds later. Twice the free fall
 * to the dampers, 2.4 m in 699.50 ms, ends it. */
static void falling_ends_by_time(void **state)
{
	uint32_t start_ms;

	(void)state;
	to_ready();
	parameters.value[WIRE_PARAMETER_dampers_um] = 2400000;
	parameters.value[WIRE_PARAMETER_separation_um] = 2390000;
	parameters.value[WIRE_PARAMETER_gate_lower_um] = 1010000;
	parameters.value[WIRE_PARAMETER_gate_upper_um] = 1000000;
	sequence_replan(&sequence);
	assert_int_equal(arm(), 0);
	ticks(1000);
	assert_int_equal(release(), 0);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	ticks(450);
	start_ms = sequence.released_ms;
	sequence_gate(&sequence, 0, fake.now_us);
	ticks(430);
	sequence_gate(&sequence, 1, fake.now_us);
	assert_true(fake.planned & WIRE_IO_MAGNET_HOLD);
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(now_ms - start_ms, 1400); /* twice 699.617 ms */
	assert_int_equal(fake.planned, 0);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void the_plan_is_made_at_arm_only(void **state)
{
	uint32_t relief_us;

	(void)state;
	to_ready();
	assert_int_equal(arm(), 0);
	relief_us = sequence.plan.relief_us;
	parameters.value[WIRE_PARAMETER_dampers_um] = 1000000;
	sequence_plan(&sequence); /* nothing was said to have changed */
	assert_int_equal(sequence.plan.relief_us, relief_us);
	sequence_replan(&sequence);
	assert_int_equal(sequence.plan.relief_us, relief_us);
	sequence_plan(&sequence);
	assert_in_range(sequence.plan.relief_us, 450833, 450836); /* sqrt(2 / 9.84) s */
}

static void motion_ends_by_a_switch(void **state)
{
	static const uint16_t switches[] = {WIRE_IO_FRAME_DOWN, WIRE_IO_LATCH_CLOSED};

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		to_keep_out();
		assert_true(sequence.marks & WIRE_MARK_FRAME_NOT_DOWN);
		ticks(60000);
		assert_int_equal(sequence.state, STATE(KEEP_OUT));
		for (unsigned op = WIRE_OP_ARM; op <= WIRE_OP_DISCARD; op++)
			assert_int_equal(command(op, op == WIRE_OP_DISCARD ? 1 : 0xC0FFEE),
			                 op == WIRE_OP_ABORT ? 0 : DT_E_STATE);
		checks |= WIRE_CHECK_DOOR | WIRE_CHECK_ESTOP; /* somebody goes in to help it down */
		tick();
		assert_int_equal(sequence.state, STATE(KEEP_OUT));
		assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
		fake.inputs |= switches[i];
		tick();
		assert_int_equal(sequence.state, STATE(CAPTURED));
		assert_true(sequence.marks & WIRE_MARK_FRAME_NOT_DOWN);
	}
	to_fault_moving();
	fake.inputs &= (uint16_t)~WIRE_IO_FRAME_DOWN;
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(KEEP_OUT));
	assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
	to_captured();
	assert_false(sequence.marks & WIRE_MARK_FRAME_NOT_DOWN);
}

/* The keeper current counts once, and only behind the edge. */
static void the_keeper_tells_when_the_product_left(void **state)
{
	(void)state;
	to_falling();
	fall_with(9.81, fake.now_us);
	sequence_keeper(&sequence, fake.off_us[1] + 100); /* a magnet that is still on */
	assert_false(sequence.times.keeper_fell);
	fake_time(fake.off_us[1] + 9000);
	sequence_keeper(&sequence, fake.off_us[1] - 1);
	assert_false(sequence.times.keeper_fell);
	sequence_keeper(&sequence, fake.off_us[1] + 7300);
	sequence_keeper(&sequence, fake.off_us[1] + 8800);
	assert_true(sequence.times.keeper_fell);
	assert_int_equal(sequence.times.keeper_us, fake.off_us[1] + 7300);
}

/* Twice the free fall to the lower gate, 0.7 m: 755.55 ms. */
static void latch_must_open(void **state)
{
	(void)state;
	to_warned();
	assert_int_equal(release(), 0);
	ticks(100);
	assert_int_equal(sequence.state, STATE(FALLING));
	tick();
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	assert_int_equal(sequence.fault, WIRE_FAULT_LATCH);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	ticks(654);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	assert_int_equal(sequence_tick_marks(&sequence), 0); /* nothing to record */
	tick();
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_LATCH);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(clear(), 0);
}

static void abort_before_the_latch_opens_holds(void **state)
{
	(void)state;
	to_warned();
	assert_int_equal(release(), 0);
	ticks(5);
	assert_int_equal(command(WIRE_OP_ABORT, 0), 0);
	ticks(750);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	tick();
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
}

/* Any one of the witnesses is enough: then it was a fall. */
static void frame_that_moved_is_recorded(void **state)
{
	static const struct {
		uint16_t toggle;
		int gate;
	} witnesses[] = {{WIRE_IO_LATCH_CLOSED, -1},
	                 {WIRE_IO_GATE_UPPER, -1},
	                 {WIRE_IO_GATE_LOWER, -1},
	                 {WIRE_IO_FRAME_DOWN, -1},
	                 {0, 0},
	                 {0, 1}};

	(void)state;
	for (size_t i = 0; i < sizeof(witnesses) / sizeof(witnesses[0]); i++) {
		to_warned();
		assert_int_equal(release(), 0);
		ticks(101);
		assert_int_equal(sequence.state, STATE(FAULT_MOVING));
		ticks(640); /* beyond the time for an impact: 600 ms */
		assert_int_equal(sequence_tick_marks(&sequence), 0);
		fake.inputs ^= witnesses[i].toggle;
		if (witnesses[i].gate >= 0)
			sequence_gate(&sequence, (unsigned)witnesses[i].gate, fake.now_us);
		tick();
		fake.inputs ^= witnesses[i].toggle;
		assert_int_equal(sequence_tick_marks(&sequence), WIRE_MARK_NO_IMPACT);
		ticks(200);
		assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	}
	to_warned(); /* and so is a window that is open already */
	assert_int_equal(release(), 0);
	ticks(200);
	sequence_triggered(&sequence);
	ticks(800);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
}

static void product_must_stay_until_magnet_off(void **state)
{
	(void)state;
	to_falling();
	fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
	tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_MAGNET);
	to_separated();
	fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
	tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
}

static void frame_down_ends_the_relief(void **state)
{
	(void)state;
	to_separated();
	fake.inputs |= WIRE_IO_FRAME_DOWN; /* before the edge for the dampers */
	tick();
	assert_int_equal(sequence.state, STATE(BRAKED));
	assert_int_equal(fake.outputs, 0);
	assert_int_equal(fake.planned, 0);
}

static void fault_in_motion_brakes_and_keeps_holding(void **state)
{
	static const struct {
		uint32_t check;
		uint8_t fault;
	} faults[] = {
	        {WIRE_CHECK_ESTOP, WIRE_FAULT_ESTOP},      {WIRE_CHECK_DOOR, WIRE_FAULT_DOOR},
	        {WIRE_CHECK_SUPPLY, WIRE_FAULT_BROWN_OUT}, {WIRE_CHECK_DAMPERS, WIRE_FAULT_DAMPERS},
	        {WIRE_CHECK_HOST, WIRE_FAULT_NONE}, /* the drop goes on */
	};

	(void)state;
	for (size_t i = 0; i < sizeof(faults) / sizeof(faults[0]); i++) {
		bool braked = faults[i].fault != WIRE_FAULT_NONE;

		to_falling();
		fall_with(9.81, fake.now_us);
		checks |= faults[i].check;
		tick();
		assert_int_equal(sequence.state, braked ? STATE(FAULT_MOVING) : STATE(FALLING));
		assert_int_equal(sequence.fault, faults[i].fault);
		assert_int_equal(fake.planned == 0, braked);
		ticks(500);
		assert_int_equal((fake.outputs & WIRE_IO_MAGNET_HOLD) != 0, braked);
		assert_false(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
	}
}

static void no_impact_is_forced_after_600_ms(void **state)
{
	uint32_t since_ms;

	(void)state;
	to_separated();
	since_ms = now_ms;
	while (sequence.fault == WIRE_FAULT_NONE) {
		assert_int_equal(sequence_tick_marks(&sequence), 0);
		tick();
	}
	assert_int_equal(now_ms - since_ms, 600);
	assert_int_equal(sequence.fault, WIRE_FAULT_NO_IMPACT);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	assert_int_equal(sequence_tick_marks(&sequence), WIRE_MARK_NO_IMPACT);
	to_separated();
	sequence_triggered(&sequence);
	ticks(700);
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
	to_fault_moving();
	ticks(599);
	assert_int_equal(sequence_tick_marks(&sequence), 0);
	tick();
	assert_int_equal(sequence_tick_marks(&sequence), WIRE_MARK_NO_IMPACT);
	assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
}

static void accept_needs_the_crc(void **state)
{
	(void)state;
	to_captured();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0xC0FFED), DT_E_CORRUPT);
	assert_int_equal(sequence.state, STATE(CAPTURED));
	assert_int_equal(command(WIRE_OP_DISCARD, 0), DT_E_CORRUPT); /* not this drop */
	assert_int_equal(command(WIRE_OP_DISCARD, 2), DT_E_CORRUPT);
	assert_int_equal(sequence.state, STATE(CAPTURED));
	assert_int_equal(command(WIRE_OP_DISCARD, 1), 0);
	assert_int_equal(sequence.state, STATE(UPLOADED));
	to_ready();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0xC0FFEE), DT_E_STATE);
	assert_int_equal(command(WIRE_OP_DISCARD, 0), DT_E_STATE);
}

static void fault_in_motion_ends_in_fault_held(void **state)
{
	(void)state;
	to_fault_moving();
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	tick();
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(CAPTURED));
	assert_int_equal(command(WIRE_OP_DISCARD, 1), 0);
	ticks(199);
	assert_int_equal(sequence.state, STATE(UPLOADED));
	tick();
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD); /* it was never let go */
}

static void drop_id_counts_releases_and_skips_zero(void **state)
{
	(void)state;
	to_falling();
	assert_int_equal(sequence.drop_id, 1);
	to_warned();
	sequence.drop_id = 65535;
	assert_int_equal(release(), 0);
	assert_int_equal(sequence.drop_id, 1);
}

int main(void)
{
	static const struct CMUnitTest tests[] = {
	        cmocka_unit_test(edges_follow_the_fall),
	        cmocka_unit_test(edges_in_numbers_by_hand),
	        cmocka_unit_test(late_edge_is_made_at_once),
	        cmocka_unit_test(the_relief_ends_in_time),
	        cmocka_unit_test(a_gate_must_be_plausible),
	        cmocka_unit_test(gates_out_of_order_or_missing),
	        cmocka_unit_test(falling_ends_by_time),
	        cmocka_unit_test(the_plan_is_made_at_arm_only),
	        cmocka_unit_test(motion_ends_by_a_switch),
	        cmocka_unit_test(the_keeper_tells_when_the_product_left),
	        cmocka_unit_test(latch_must_open),
	        cmocka_unit_test(abort_before_the_latch_opens_holds),
	        cmocka_unit_test(frame_that_moved_is_recorded),
	        cmocka_unit_test(product_must_stay_until_magnet_off),
	        cmocka_unit_test(frame_down_ends_the_relief),
	        cmocka_unit_test(fault_in_motion_brakes_and_keeps_holding),
	        cmocka_unit_test(no_impact_is_forced_after_600_ms),
	        cmocka_unit_test(accept_needs_the_crc),
	        cmocka_unit_test(fault_in_motion_ends_in_fault_held),
	        cmocka_unit_test(drop_id_counts_releases_and_skips_zero),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
