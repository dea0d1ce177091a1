/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The sequence: its table against the one of the design, and what holds in every state. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/sequence_by_hand.h"

/* ---- the table in firmware/README.md ---- */

static uint8_t expected[WIRE_STATES][SEQUENCE_EVENTS];
static char reason[WIRE_STATES][SEQUENCE_EVENTS];
static bool explained[128];

static const char *const event_names[SEQUENCE_EVENTS] = {
        "TESTED",  "GREEN", "RED",   "ARM",  "RELEASE", "ABORT", "CLEAR", "ACCEPT", "DISCARD",
        "EXPIRED", "FREE",  "BRAKE", "FULL", "JAMMED",  "DOWN",  "DONE",  "STILL",  "FAULT",
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
	        [STATE(ARMED)] = WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING,
	        [STATE(FALLING)] =
	                WIRE_IO_MAGNET_HOLD | WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_WARNING,
	        [STATE(SEPARATED)] = WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_WARNING,
	        [STATE(BRAKED)] = 0,
	        [STATE(CAPTURED)] = 0,
	        [STATE(UPLOADED)] = 0,
	        [STATE(FAULT_HELD)] = WIRE_IO_MAGNET_HOLD,
	        [STATE(FAULT_MOVING)] = WIRE_IO_MAGNET_HOLD, /* from FALLING */
	        [STATE(KEEP_OUT)] = 0,
	};

	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		reach[s]();
		if (fake.outputs != wanted[s])
			fail_msg("state %u: outputs %#x, expected %#x", s, fake.outputs, wanted[s]);
		assert_int_equal(sequence.nonce, s == STATE(ARMED) ? NONCE : 0);
		assert_int_equal(sequence.session, s == STATE(ARMED) ? SESSION : 0);
		assert_int_equal(fake.kept,
		                 s | (unsigned)sequence.fault << 4); /* for the time after a reset */
	}
	to_uploaded();
	ticks(200);
	assert_int_equal(sequence.state, STATE(SAFE)); /* which holds again */
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void camera_has_a_pulse_of_ten_ms(void **state)
{
	(void)state;
	to_warned();
	assert_int_equal(release(), 0);
	for (unsigned ms = 0; ms < 10; ms++) {
		assert_true(fake.outputs & WIRE_IO_CAMERA);
		tick();
	}
	assert_false(fake.outputs & WIRE_IO_CAMERA);
}

static void abort_in_every_state(void **state)
{
	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++) {
		unsigned to = expect(s, EVENT(ABORT));

		reach[s]();
		assert_int_equal(command(WIRE_OP_ABORT, 0), 0);
		assert_int_equal(sequence.state, to == SEQUENCE_STAY ? s : to);
		assert_int_equal(fake.outputs & (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE), 0);
		assert_int_equal(fake.planned, 0);
		if (to == STATE(FAULT_MOVING) && s != to) {
			assert_int_equal(sequence.fault, WIRE_FAULT_ABORTED);
			assert_true(sequence.marks & WIRE_MARK_FAULT);
		}
	}
}

/* What a lost check leads to at rest, armed and in motion: firmware/README.md's second table. */
static void loss_in_every_state(void **state)
{
	static const struct {
		uint32_t check;
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
			fake.inputs = FAKE_ALL_GOOD;
			checks = 0;
			now_ms = 0;
			sequence_init(&sequence, &parameters, counters, causes[i]);
			ticks(200);
			assert_int_equal(sequence.state, STATE(FAULT_HELD));
			assert_int_equal(sequence.fault, faults[i]);
			assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
			assert_int_equal(arm(), DT_E_STATE);
			assert_int_equal(release(), DT_E_STATE);
			assert_int_equal(clear(), 0);
			assert_int_equal(sequence.state, STATE(SAFE));
		}
}

/* Any other reset: known by the state that was kept. */
static void reset_in_motion_is_a_fault(void **state)
{
	static const enum port_reset causes[] = {PORT_RESET_POWER_ON, PORT_RESET_COMMAND, PORT_RESET_PIN};

	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++)
		for (size_t i = 0; i < 3; i++) {
			bool moving = (s >= STATE(FALLING) && s <= STATE(BRAKED)) ||
			              s == STATE(FAULT_MOVING) || s == STATE(KEEP_OUT);
			bool held = moving || s == STATE(FAULT_HELD); /* whose fault outlives it */
			uint8_t fault;

			reach[s]();
			fault = moving ? WIRE_FAULT_RESET : sequence.fault;
			fake.outputs = WIRE_IO_MAGNET_HOLD;
			fake.planned = 0;
			fake.inputs = FAKE_ALL_GOOD;
			checks = 0;
			now_ms = 0;
			sequence_init(&sequence, &parameters, counters, causes[i]);
			assert_int_equal(sequence.fault, fault);
			assert_int_equal(sequence.state, held ? STATE(FAULT_HELD) : STATE(BOOT));
			ticks(200);
			assert_int_equal(sequence.state, held ? STATE(FAULT_HELD) : STATE(SAFE));
			assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
			assert_int_equal(clear(), 0);
			sequence_init(&sequence, &parameters, counters, causes[i]);
			assert_int_equal(sequence.fault, WIRE_FAULT_NONE); /* it was told */
		}
	reach[STATE(FALLING)](); /* the supply flutters: a second reset within BOOT */
	fake.kept = STATE(FALLING);
	sequence_init(&sequence, &parameters, counters, PORT_RESET_PIN);
	fake.kept = UINT8_MAX; /* nothing that makes sense */
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
	assert_int_equal(sequence.state, STATE(BOOT));
	fake.kept = WIRE_STATES | WIRE_FAULT_ABORTED << 4; /* nor a state beyond the last */
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
	assert_int_equal(sequence.state, STATE(BOOT));
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
}

int main(void)
{
	static const struct CMUnitTest tests[] = {
	        cmocka_unit_test(table_is_the_one_of_the_design),
	        cmocka_unit_test(every_state_can_be_reached),
	        cmocka_unit_test(outputs_of_every_state),
	        cmocka_unit_test(camera_has_a_pulse_of_ten_ms),
	        cmocka_unit_test(abort_in_every_state),
	        cmocka_unit_test(loss_in_every_state),
	        cmocka_unit_test(reset_in_every_state),
	        cmocka_unit_test(reset_in_motion_is_a_fault),
	};

	return cmocka_run_group_tests(tests, read_readme, NULL);
}
