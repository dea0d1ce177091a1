/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The sequence: its table against a list written from the design, its guards, the times of its edges against
 * the physics of a fall, and random walks that look for a way to an unsafe output.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/wire_table.h"
#include "firmware/health.h"
#include "firmware/sequence.h"
#include "tests/unit/fake_port.h"

#define STATE(NAME) WIRE_STATE_##NAME
#define EVENT(NAME) SEQUENCE_##NAME

enum { TOKEN = 0x5A17 };

static struct sequence sequence;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];
static uint32_t now_ms;
static uint16_t checks;
static bool clocks_good, hash_differs;

static struct sequence_view look(void)
{
	return (struct sequence_view){
	        .now_us = fake.now_us,
	        .io = port_io(),
	        .checks = checks,
	        .clocks_good = clocks_good,
	        .hash_differs = hash_differs,
	};
}

static void tick(void)
{
	struct sequence_view view;

	now_ms++;
	fake_time(now_ms * 1000);
	view = look();
	sequence_tick(&sequence, &view, now_ms);
}

static void ticks(unsigned count)
{
	while (count-- > 0)
		tick();
}

static int command(unsigned op, uint16_t token, uint32_t argument)
{
	struct wire_command c = {.op = (uint8_t)op, .token = token, .argument = argument};
	struct sequence_view view = look();

	return sequence_command(&sequence, &view, &c, 0xC0FFEE);
}

static void boot(enum port_reset cause)
{
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	now_ms = 0;
	checks = 0;
	clocks_good = true;
	hash_differs = false;
	sequence_init(&sequence, &parameters, counters, cause);
}

static void to_ready(void)
{
	boot(PORT_RESET_POWER_ON);
	ticks(102);
	assert_int_equal(sequence.state, STATE(READY));
}

static void to_armed(void)
{
	to_ready();
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), 0);
	assert_int_equal(sequence.state, STATE(ARMED));
}

static void to_falling(void)
{
	to_armed();
	ticks(10);
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
	assert_int_equal(sequence.state, STATE(FALLING));
	checks |= WIRE_CHECK_LATCH;
	ticks(20);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
}

/* The gates pass as in free fall from the release. */
static void to_separated(void)
{
	uint32_t start_us = (now_ms + 1) * 1000;

	to_falling();
	start_us = now_ms * 1000;
	ticks(202);
	sequence_gate(&sequence, 0, start_us + 201928);
	ticks(176);
	sequence_gate(&sequence, 1, start_us + 377773);
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.state, STATE(SEPARATED));
}

static void to_braked(void)
{
	to_separated();
	while (sequence.state == STATE(SEPARATED))
		tick();
	assert_int_equal(sequence.state, STATE(BRAKED));
}

static void to_captured(void)
{
	to_braked();
	sequence_triggered(&sequence);
	ticks(400);
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(CAPTURED));
}

static void to_uploaded(void)
{
	to_captured();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0, 0xC0FFEE), 0);
	assert_int_equal(sequence.state, STATE(UPLOADED));
}

static void to_fault_held(void)
{
	to_armed();
	checks = WIRE_CHECK_ESTOP;
	tick();
	checks = 0;
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
}

static void to_fault_moving(void)
{
	to_falling();
	sequence_abort(&sequence);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
}

static void to_boot(void)
{
	boot(PORT_RESET_POWER_ON);
	ticks(3);
}

static void to_safe(void)
{
	boot(PORT_RESET_POWER_ON);
	checks = WIRE_CHECK_HOST;
	ticks(102);
	assert_int_equal(sequence.state, STATE(SAFE));
}

static void (*const reach[WIRE_STATES])(void) = {
        to_boot,   to_safe,     to_ready,    to_armed,      to_falling,      to_separated,
        to_braked, to_captured, to_uploaded, to_fault_held, to_fault_moving,
};

/* ---- the table in firmware/README.md ---- */

static uint8_t expected[WIRE_STATES][SEQUENCE_EVENTS];
static char reason[WIRE_STATES][SEQUENCE_EVENTS];
static bool explained[128];

static const char *const event_names[SEQUENCE_EVENTS] = {
        "TESTED",  "GREEN",   "RED",  "ARM",   "RELEASE", "ABORT", "CLEAR", "ACCEPT",
        "DISCARD", "EXPIRED", "FREE", "BRAKE", "FULL",    "DONE",  "STILL", "FAULT",
};

static unsigned find_state(const char *name)
{
	for (unsigned i = 0; i < WIRE_STATES; i++)
		if (strcmp(name, wire_state_name(i)) == 0)
			return i;
	return strcmp(name, "stay") == 0 ? SEQUENCE_STAY : strcmp(name, "no") == 0 ? SEQUENCE_NO : 0xEE;
}

static unsigned find_event(const char *name)
{
	unsigned i = 0;

	while (i < SEQUENCE_EVENTS && strcmp(name, event_names[i]) != 0)
		i++;
	return i;
}

/* "| EVENT | NEXT why | NEXT why | ..." with a cell for each state. */
static bool read_row(char *line)
{
	char *rest, *word = strtok_r(line, "| \n", &rest);
	unsigned event = word == NULL ? SEQUENCE_EVENTS : find_event(word);

	if (event == SEQUENCE_EVENTS)
		return false;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		const char *next = strtok_r(NULL, "| \n", &rest), *why = strtok_r(NULL, "| \n", &rest);

		if (next == NULL || why == NULL || why[1] != '\0' || find_state(next) == 0xEE)
			fail_msg("README, %s, column %u: no next state and reason", word, s);
		expected[s][event] = (uint8_t)find_state(next);
		reason[s][event] = why[0];
	}
	return true;
}

static int read_readme(void **state)
{
	FILE *file = fopen("firmware/README.md", "r");
	char line[1024];
	unsigned rows = 0;

	(void)state;
	if (file == NULL)
		return -1;
	while (fgets(line, sizeof(line), file) != NULL) {
		if (line[0] == '|')
			rows += read_row(line);
		else if (strncmp(line, "- **", 4) == 0 && strncmp(line + 5, "** ", 3) == 0)
			explained[line[4] & 0x7F] = true;
	}
	fclose(file);
	return rows == SEQUENCE_EVENTS ? 0 : -1;
}

static unsigned expect(unsigned from, unsigned event)
{
	return expected[from][event];
}

static void table_is_the_one_of_the_design(void **state)
{
	(void)state;
	for (unsigned from = 0; from < WIRE_STATES; from++)
		for (unsigned event = 0; event < SEQUENCE_EVENTS; event++) {
			unsigned to = sequence_next(from, (enum sequence_event)event);

			if (to != expect(from, event))
				fail_msg("state %u event %s: goes to %u, expected %u", from,
				         event_names[event], to, expect(from, event));
			if (!explained[reason[from][event] & 0x7F])
				fail_msg("state %u event %s: no reason \"%c\"", from, event_names[event],
				         reason[from][event]);
		}
}

static void every_state_can_be_reached(void **state)
{
	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		reach[s]();
		assert_int_equal(sequence.state, s);
	}
}

static void outputs_of_every_state(void **state)
{
	static const uint16_t wanted[WIRE_STATES] = {
	        [STATE(BOOT)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(SAFE)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(READY)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(ARMED)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(FALLING)] = WIRE_IO_MAGNET_HOLD | WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE,
	        [STATE(SEPARATED)] = WIRE_IO_DAMPERS_RELIEVE,
	        [STATE(BRAKED)] = 0,
	        [STATE(CAPTURED)] = 0,
	        [STATE(UPLOADED)] = 0,
	        [STATE(FAULT_HELD)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(FAULT_MOVING)] = WIRE_IO_MAGNET_HOLD, /* from FALLING */
	};

	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		reach[s]();
		if (fake.outputs != wanted[s])
			fail_msg("state %u: outputs %#x, expected %#x", s, fake.outputs, wanted[s]);
		assert_int_equal(sequence.token, s == STATE(ARMED) ? TOKEN : 0);
	}
	to_uploaded();
	ticks(200);
	assert_int_equal(sequence.state, STATE(SAFE)); /* which holds again */
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void camera_has_a_pulse_of_ten_ms(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
	for (unsigned ms = 0; ms < 10; ms++) {
		assert_true(fake.outputs & WIRE_IO_CAMERA);
		tick();
	}
	assert_false(fake.outputs & WIRE_IO_CAMERA);
}

static void boot_needs_the_self_test(void **state)
{
	(void)state;
	boot(PORT_RESET_POWER_ON);
	ticks(99);
	assert_int_equal(sequence.state, STATE(BOOT));
	tick();
	assert_int_equal(sequence.state, STATE(READY));
	boot(PORT_RESET_POWER_ON);
	clocks_good = false;
	ticks(100);
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_SELF_TEST);
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), DT_E_CHECKS);
	clocks_good = true;
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), 0);
	assert_int_equal(sequence.state, STATE(SAFE));
}

static void reset_causes_are_faults(void **state)
{
	(void)state;
	boot(PORT_RESET_WATCHDOG);
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_WATCHDOG);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	boot(PORT_RESET_BROWN_OUT);
	assert_int_equal(sequence.fault, WIRE_FAULT_BROWN_OUT);
	checks = WIRE_CHECK_SUPPLY;
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), DT_E_CHECKS);
	checks = 0;
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), 0);
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
	boot(PORT_RESET_COMMAND);
	assert_int_equal(sequence.state, STATE(BOOT));
}

static void arm_and_release_are_guarded(void **state)
{
	(void)state;
	to_safe();
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), DT_E_CHECKS);
	hash_differs = true;
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), DT_E_HASH);
	to_ready();
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), DT_E_STATE);
	assert_int_equal(command(WIRE_OP_ARM, 0, 0), DT_E_TOKEN);
	checks = WIRE_CHECK_DOOR; /* opened since the last tick */
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), DT_E_CHECKS);
	assert_int_equal(sequence.state, STATE(READY));
	to_armed();
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), DT_E_STATE);
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN + 1, 0), DT_E_TOKEN);
	assert_int_equal(command(WIRE_OP_RELEASE, 0, 0), DT_E_TOKEN);
	checks = WIRE_CHECK_DAMPERS;
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), DT_E_CHECKS);
	assert_int_equal(sequence.state, STATE(ARMED));
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(sequence.drop_id, 0);
	assert_int_equal(command(77, TOKEN, 0), DT_E_UNKNOWN);
}

static void armed_expires(void **state)
{
	(void)state;
	to_armed();
	ticks(9999);
	assert_int_equal(sequence.state, STATE(ARMED));
	tick();
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), DT_E_STATE);
}

static void lost_check_while_armed(void **state)
{
	static const struct {
		uint16_t check;
		uint8_t fault;
	} faults[] = {
	        {WIRE_CHECK_LATCH, WIRE_FAULT_LATCH},     {WIRE_CHECK_PRODUCT, WIRE_FAULT_MAGNET},
	        {WIRE_CHECK_DAMPERS, WIRE_FAULT_DAMPERS}, {WIRE_CHECK_DOOR, WIRE_FAULT_DOOR},
	        {WIRE_CHECK_ESTOP, WIRE_FAULT_ESTOP},     {WIRE_CHECK_SUPPLY, WIRE_FAULT_BROWN_OUT},
	        {WIRE_CHECK_GATES, WIRE_FAULT_GATES},     {WIRE_CHECK_HOST, WIRE_FAULT_HOST_LOST},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(faults) / sizeof(faults[0]); i++) {
		to_armed();
		checks = faults[i].check;
		tick();
		assert_int_equal(sequence.state, STATE(FAULT_HELD));
		assert_int_equal(sequence.fault, faults[i].fault);
		assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	}
	to_armed();
	checks = WIRE_CHECK_SENSOR_S2; /* no danger: disarm only */
	tick();
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
}

static void clear_waits_until_the_cause_is_gone(void **state)
{
	(void)state;
	to_fault_held();
	checks = WIRE_CHECK_ESTOP;
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), DT_E_CHECKS);
	assert_int_equal(sequence.fault, WIRE_FAULT_ESTOP);
	checks = WIRE_CHECK_HOST; /* another one does not matter */
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), 0);
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), DT_E_STATE);
}

static void abort_in_every_state(void **state)
{
	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		unsigned to = expect(s, EVENT(ABORT));

		reach[s]();
		assert_int_equal(command(WIRE_OP_ABORT, 0, 0), 0);
		assert_int_equal(sequence.state, to == SEQUENCE_STAY ? s : to);
		assert_int_equal(fake.outputs & (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE), 0);
		assert_int_equal(fake.planned, 0);
		if (to == STATE(FAULT_MOVING)) {
			assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
			assert_true(sequence.marks & WIRE_MARK_FAULT);
		}
	}
}

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
	(void)state;
	/* t1 = 200 ms, t2 = 375 ms: sqrt .78 - sqrt .7 over sqrt .7 - sqrt .2 = .0465165 / .3894464 =
	 * .1194427, 175 ms of it is 20.902 ms; for .80 m .0577671 / .3894464 = .1483313, 25.958 ms */
	to_falling();
	sequence_gate(&sequence, 0, 1000000 + 200000);
	sequence_gate(&sequence, 1, 1000000 + 375000);
	assert_in_range(fake.off_us[1], 1387901, 1387904); /* 8 ms before 1 395 902 */
	assert_in_range(fake.off_us[2], 1400957, 1400960);
	assert_int_equal(sequence.frame_speed_mm_s, 2857);
}

static void late_edge_is_made_at_once(void **state)
{
	(void)state;
	boot(PORT_RESET_POWER_ON);
	parameters.value[WIRE_PARAMETER_dropout_us] = 50000;
	sequence_plan(&sequence);
	ticks(102);
	assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), 0);
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
	fake_time(500000);
	fall_with(9.81, 500000 - 378000);
	assert_int_equal(counters[WIRE_COUNTER_edges_late], 1);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	assert_true(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
}

static void gates_out_of_order_or_missing(void **state)
{
	uint32_t start_ms;

	(void)state;
	to_falling();
	sequence_gate(&sequence, 1, fake.now_us);
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
	sequence_gate(&sequence, 0, fake.now_us);
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(now_ms - start_ms, 756);
	to_falling(); /* frame down without it */
	sequence_gate(&sequence, 0, fake.now_us);
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	tick();
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	to_falling(); /* faster than any fall: not the frame */
	sequence_gate(&sequence, 0, fake.now_us);
	sequence_gate(&sequence, 1, fake.now_us + 100000);
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	to_falling(); /* a beam broken again is the same gate */
	sequence_gate(&sequence, 0, 1200000);
	sequence_gate(&sequence, 0, 1203000);
	sequence_gate(&sequence, 1, 1375000);
	assert_in_range(fake.off_us[1], 1387901, 1387904);
}

/* Twice the free fall to the lower gate, 0.7 m: 755.55 ms. */
static void latch_must_open(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
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
	assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), 0);
}

static void abort_before_the_latch_opens_holds(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
	ticks(5);
	assert_int_equal(command(WIRE_OP_ABORT, 0, 0), 0);
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
		to_armed();
		assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
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
	to_armed(); /* and so is a window that is open already */
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
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
		uint16_t check;
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

/* What a lost check leads to at rest, armed and in motion: firmware/README.md's second table. */
static void loss_in_every_state(void **state)
{
	static const struct {
		uint16_t check;
		uint8_t armed, moving; /* fault */
	} losses[] = {
	        {WIRE_CHECK_ESTOP, WIRE_FAULT_ESTOP, WIRE_FAULT_ESTOP},
	        {WIRE_CHECK_DOOR, WIRE_FAULT_DOOR, WIRE_FAULT_DOOR},
	        {WIRE_CHECK_SUPPLY, WIRE_FAULT_BROWN_OUT, WIRE_FAULT_BROWN_OUT},
	        {WIRE_CHECK_DAMPERS, WIRE_FAULT_DAMPERS, WIRE_FAULT_DAMPERS},
	        {WIRE_CHECK_LATCH, WIRE_FAULT_LATCH, 0},
	        {WIRE_CHECK_PRODUCT, WIRE_FAULT_MAGNET, 0},
	        {WIRE_CHECK_GATES, WIRE_FAULT_GATES, 0},
	        {WIRE_CHECK_HOST, WIRE_FAULT_HOST_LOST, 0},
	        {WIRE_CHECK_SENSOR_S1, 0, 0},
	        {WIRE_CHECK_SENSOR_S2, 0, 0},
	        {WIRE_CHECK_TRIGGER, 0, 0},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(losses) / sizeof(losses[0]); i++)
		for (unsigned s = 0; s < WIRE_STATES; s++) {
			bool moving = s >= STATE(FALLING) && s <= STATE(BRAKED);
			unsigned fault = s == STATE(ARMED) ? losses[i].armed : moving ? losses[i].moving : 0;
			unsigned next = s, magnet;

			if (s == STATE(READY) || s == STATE(ARMED))
				next = fault ? STATE(FAULT_HELD) : STATE(SAFE);
			else if (fault)
				next = STATE(FAULT_MOVING);
			reach[s]();
			if (s != STATE(FAULT_HELD) && s != STATE(FAULT_MOVING))
				assert_int_equal(sequence.fault, 0);
			else
				fault = sequence.fault;
			magnet = fake.outputs & WIRE_IO_MAGNET_HOLD;
			checks |= losses[i].check;
			tick();
			if (sequence.state != next || sequence.fault != fault)
				fail_msg("state %u, check %#x lost: state %u fault %u, expected %u %u", s,
				         losses[i].check, sequence.state, sequence.fault, next, fault);
			assert_int_equal(fake.outputs & WIRE_IO_MAGNET_HOLD, magnet);
		}
}

/* The controller forgets everything; what is at the pins is what a fault in motion wants. */
static void reset_in_every_state(void **state)
{
	static const enum port_reset causes[] = {PORT_RESET_WATCHDOG, PORT_RESET_BROWN_OUT};
	static const uint8_t faults[] = {WIRE_FAULT_WATCHDOG, WIRE_FAULT_BROWN_OUT};

	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++)
		for (size_t i = 0; i < 2; i++) {
			reach[s]();
			fake.outputs = WIRE_IO_MAGNET_HOLD; /* as the drivers hold it in reset */
			fake.planned = 0;
			now_ms = 0;
			sequence_init(&sequence, &parameters, counters, causes[i]);
			ticks(200);
			assert_int_equal(sequence.state, STATE(FAULT_HELD));
			assert_int_equal(sequence.fault, faults[i]);
			assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
			assert_int_equal(command(WIRE_OP_ARM, TOKEN, 0), DT_E_STATE);
			assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), DT_E_STATE);
			assert_int_equal(command(WIRE_OP_CLEAR, 0, 0), 0);
			assert_int_equal(sequence.state, STATE(SAFE));
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
	assert_int_equal(command(WIRE_OP_ACCEPT, 0, 0xC0FFED), DT_E_CORRUPT);
	assert_int_equal(sequence.state, STATE(CAPTURED));
	assert_int_equal(command(WIRE_OP_DISCARD, 0, 0), 0);
	assert_int_equal(sequence.state, STATE(UPLOADED));
	to_ready();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0, 0xC0FFEE), DT_E_STATE);
	assert_int_equal(command(WIRE_OP_DISCARD, 0, 0), DT_E_STATE);
}

static void fault_in_motion_ends_in_fault_held(void **state)
{
	(void)state;
	to_fault_moving();
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(CAPTURED));
	assert_int_equal(command(WIRE_OP_DISCARD, 0, 0), 0);
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
	to_armed();
	sequence.drop_id = 65535;
	assert_int_equal(command(WIRE_OP_RELEASE, TOKEN, 0), 0);
	assert_int_equal(sequence.drop_id, 1);
}

/* ---- random walks ---- */

/* What the invariants need to know is kept here, from inputs, commands and outputs alone. */
struct walk {
	uint32_t seed, start_seed, step;
	bool released;        /* since the magnet was last seen on at rest */
	uint16_t armed_token; /* of the last ARM that was taken; 0 once it cannot count any more */
	uint16_t release_token;
	uint32_t moving_ms; /* how long it has been in motion */
	unsigned visited[WIRE_STATES];
	unsigned opened, let_go, still;
};

static struct health health;

static void complain(const struct walk *walk, const char *wrong)
{
	fail_msg("%s: seed %u step %u state %s outputs %#x inputs %#x", wrong, walk->start_seed, walk->step,
	         wire_state_name(sequence.state), fake.outputs, fake.inputs);
}

static void check_outputs(struct walk *walk, uint16_t before)
{
	bool moving = sequence_moving(sequence.state);

	if (!(fake.outputs & WIRE_IO_MAGNET_HOLD) && !walk->released)
		complain(walk, "magnet off without a release");
	if (!(fake.outputs & ~before & WIRE_IO_LATCH_OPEN))
		return;
	walk->opened++;
	if (walk->armed_token == 0 || walk->release_token != walk->armed_token)
		complain(walk, "latch opened without an armed token");
	if (!(fake.inputs & WIRE_IO_DAMPERS_ENGAGED) || !(fake.inputs & WIRE_IO_DOOR_CLOSED) ||
	    !(fake.inputs & WIRE_IO_ESTOP_CLEAR) || !(fake.inputs & WIRE_IO_PRODUCT_HELD))
		complain(walk, "latch opened without dampers, door, emergency stop or product");
	if (!moving)
		complain(walk, "latch opened at rest");
}

static void check_state(struct walk *walk)
{
	uint8_t s = sequence.state;
	bool driven = s >= STATE(FALLING) && s <= STATE(BRAKED), faulty = sequence.fault != 0;

	if ((fake.outputs & (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE)) && !driven)
		complain(walk, "latch open or dampers relieved at rest or in a fault");
	if (s == STATE(BRAKED) && (fake.outputs & WIRE_IO_DAMPERS_RELIEVE))
		complain(walk, "braked with dampers relieved");
	if (fake.planned != 0 && s != STATE(FALLING) && s != STATE(SEPARATED))
		complain(walk, "an edge is left to come");
	if ((s == STATE(FAULT_HELD) || s == STATE(FAULT_MOVING)) != faulty && s < STATE(CAPTURED))
		complain(walk, "fault and state disagree");
	if ((sequence.token != 0) != (s == STATE(ARMED)))
		complain(walk, "a token outlives ARMED");
	if (walk->moving_ms > 5000) /* the walk fills a window 600 ms after the last impact */
		complain(walk, "motion does not end");
}

/* One of the inputs is wrong now and then, for a while. */
static void random_inputs(struct walk *walk)
{
	uint32_t r = fake_random(&walk->seed);
	uint16_t wrong = r % 16 ? 0 : (uint16_t)(1u << (4 + (r >> 8) % 11));
	bool held = sequence.state < STATE(FALLING) || (r >> 13) % 2048 == 0;

	fake.inputs = FAKE_ALL_GOOD ^ wrong;
	if (!held && walk->still == 0)
		fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	clocks_good = (r >> 4) % 64 != 0;
	health.sensor_checks = (r >> 24) % 32 ? 0 : (uint16_t)(WIRE_CHECK_SENSOR_S1 << (r >> 20) % 3);
	health.host_here = (r >> 16) % 32 != 0;
	checks = health_checks(&health, fake.inputs, 0);
}

static void random_gate(struct walk *walk, uint32_t r)
{
	if (r % 8 == 0)
		sequence_gate(&sequence, r >> 8 & 1, fake.now_us - (r >> 9) % 1000);
	else if (walk->still == 0)
		sequence_gate(&sequence, sequence.gates_seen,
		              sequence.released_us + (sequence.gates_seen ? 377773 : 201928));
}

static void random_command(struct walk *walk, uint32_t r)
{
	unsigned op = 1 + r % 6;
	uint16_t token = (r >> 8) % 4 ? TOKEN : (uint16_t)(r >> 16);
	int result;

	result = command(op, token, (r >> 12) % 2 ? 0xC0FFEE : 0);
	if (op == WIRE_OP_ARM && result == 0)
		walk->armed_token = token;
	if (op == WIRE_OP_RELEASE && result == 0) {
		walk->release_token = token;
		walk->released = true;
		walk->still = (r >> 23) % 16 == 0; /* this latch is stuck */
	}
}

/* Ticks until the planned edges are made, or as many as told. */
static void random_ticks(struct walk *walk, uint32_t r)
{
	unsigned count = r % 4 ? 1 : r >> 8 & 0xFF;

	if (fake.planned && r % 2)
		count = (fake.off_us[1] - fake.now_us) / 1000 % 1000;
	for (; count > 0; count--) {
		bool was_moving = sequence_moving(sequence.state);

		tick();
		walk->moving_ms = was_moving ? walk->moving_ms + 1 : 0;
		if (sequence_separated(sequence.state) && walk->moving_ms > 2000)
			sequence_full(&sequence);
	}
}

static void random_event(struct walk *walk)
{
	uint32_t r = fake_random(&walk->seed), kind = r % 24, more = r >> 5;

	if (kind < 6)
		random_command(walk, more);
	else if (kind == 6 && more % 2)
		sequence_fault(&sequence, (enum wire_fault)(1 + more / 2 % (WIRE_FAULTS - 1)));
	else if (kind == 7 && more % 4 == 0)
		sequence_triggered(&sequence);
	else if (kind == 8 && sequence_separated(sequence.state) && sequence.triggered)
		sequence_full(&sequence);
	else if (kind < 14 && sequence.state == STATE(FALLING))
		random_gate(walk, more);
	else
		random_ticks(walk, more);
}

static void random_reset(struct walk *walk)
{
	static const enum port_reset causes[] = {PORT_RESET_POWER_ON, PORT_RESET_WATCHDOG,
	                                         PORT_RESET_BROWN_OUT};

	fake.outputs = WIRE_IO_MAGNET_HOLD;
	fake.planned = 0;
	sequence_init(&sequence, &parameters, counters, causes[fake_random(&walk->seed) % 3]);
	sequence.tick_ms = sequence.entered_ms = now_ms;
	walk->armed_token = 0;
	walk->moving_ms = 0;
}

static void random_walks_stay_safe(void **state)
{
	struct walk walk = {.seed = 20261121, .start_seed = 20261121};
	unsigned mask = WIRE_IO_MAGNET_HOLD;

	(void)state;
	boot(PORT_RESET_POWER_ON);
	health_init(&health, &parameters, counters);
	health.host_hash_good = true;
	for (walk.step = 0; walk.step < 1000000; walk.step++) {
		uint16_t before = fake.outputs;
		uint8_t state_before = sequence.state;

		random_inputs(&walk);
		if (fake_random(&walk.seed) % 2000 == 0)
			random_reset(&walk);
		random_event(&walk);
		check_outputs(&walk, before);
		check_state(&walk);
		walk.let_go += (before & ~fake.outputs & mask) != 0;
		walk.released &= sequence_moving(sequence.state) || !(fake.outputs & mask);
		if (state_before == STATE(ARMED) && sequence.state != STATE(ARMED))
			walk.armed_token = 0;
		walk.visited[sequence.state]++;
	}
	for (unsigned s = 0; s < WIRE_STATES; s++)
		if (walk.visited[s] < 200)
			fail_msg("state %s visited %u times only, seed %u", wire_state_name(s),
			         walk.visited[s], walk.start_seed);
	if (walk.opened < 1000 || walk.let_go < 200)
		fail_msg("%u times opened, %u let go only, seed %u", walk.opened, walk.let_go,
		         walk.start_seed);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(table_is_the_one_of_the_design),
	        cmocka_unit_test(every_state_can_be_reached),
	        cmocka_unit_test(outputs_of_every_state),
	        cmocka_unit_test(camera_has_a_pulse_of_ten_ms),
	        cmocka_unit_test(boot_needs_the_self_test),
	        cmocka_unit_test(reset_causes_are_faults),
	        cmocka_unit_test(arm_and_release_are_guarded),
	        cmocka_unit_test(armed_expires),
	        cmocka_unit_test(lost_check_while_armed),
	        cmocka_unit_test(clear_waits_until_the_cause_is_gone),
	        cmocka_unit_test(abort_in_every_state),
	        cmocka_unit_test(edges_follow_the_fall),
	        cmocka_unit_test(edges_in_numbers_by_hand),
	        cmocka_unit_test(late_edge_is_made_at_once),
	        cmocka_unit_test(gates_out_of_order_or_missing),
	        cmocka_unit_test(latch_must_open),
	        cmocka_unit_test(abort_before_the_latch_opens_holds),
	        cmocka_unit_test(frame_that_moved_is_recorded),
	        cmocka_unit_test(product_must_stay_until_magnet_off),
	        cmocka_unit_test(frame_down_ends_the_relief),
	        cmocka_unit_test(fault_in_motion_brakes_and_keeps_holding),
	        cmocka_unit_test(loss_in_every_state),
	        cmocka_unit_test(reset_in_every_state),
	        cmocka_unit_test(no_impact_is_forced_after_600_ms),
	        cmocka_unit_test(accept_needs_the_crc),
	        cmocka_unit_test(fault_in_motion_ends_in_fault_held),
	        cmocka_unit_test(drop_id_counts_releases_and_skips_zero),
	        cmocka_unit_test(random_walks_stay_safe),
	};

	return cmocka_run_group_tests(tests, read_readme, NULL);
}
