/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The sequence: its table against a list written from the design, its guards, the times of its edges against
 * the physics of a fall.
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
#include "firmware/sequence.h"
#include "tests/unit/fake_port.h"

#define STATE(NAME) WIRE_STATE_##NAME
#define EVENT(NAME) SEQUENCE_##NAME

enum { SESSION = 0x7E115A17, NONCE = 0x1EE7C0DE, SET = 0x0D15EA5E };

static struct sequence sequence;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];
static uint32_t now_ms;
static uint32_t checks;
static uint16_t known; /* inputs */
static struct hosts hosts;
static bool no_nonce;

static struct sequence_view look(void)
{
	return (struct sequence_view){
	        .now_us = fake.now_us,
	        .io = port_io(),
	        .known = known,
	        .checks = checks,
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

static int command_by(uint32_t host, unsigned op, uint32_t argument)
{
	struct sequence_order order = {
	        .command = {.op = (uint8_t)op, .host = (uint16_t)host, .argument = argument},
	        .hosts = &hosts,
	        .capture_crc32 = 0xC0FFEE,
	        .parameters_crc32 = SET,
	        .dropout_us = 8000,
	        .nonce = NONCE,
	        .nonce_good = !no_nonce,
	};
	struct sequence_view view = look();

	sequence_plan(&sequence);
	return sequence_command(&sequence, &view, &order);
}

static int command(unsigned op, uint32_t argument)
{
	return command_by(SESSION, op, argument);
}

static int ask(void)
{
	return command(WIRE_OP_ARM, wire_answer(0, SESSION, SET));
}

static int answer(void)
{
	return command(WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET));
}

static int arm(void)
{
	int result = ask();

	return result == 0 ? answer() : result;
}

static int release(void)
{
	return command(WIRE_OP_RELEASE, wire_answer(NONCE, sequence_next_drop(&sequence), SET));
}

static int clear(void)
{
	return command(WIRE_OP_CLEAR, 0);
}

static void boot(enum port_reset cause)
{
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	now_ms = 0;
	checks = 0;
	known = UINT16_MAX;
	no_nonce = false;
	hosts_init(&hosts, &parameters, counters);
	hosts_heard(&hosts, 0, SESSION, true);
	sequence_init(&sequence, &parameters, counters, cause);
}

static void to_ready(void)
{
	boot(PORT_RESET_POWER_ON);
	ticks(102);
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(clear(), 0);
	ticks(1001);
	assert_int_equal(sequence.state, STATE(READY));
}

static void to_armed(void)
{
	to_ready();
	assert_int_equal(arm(), 0);
	assert_int_equal(sequence.state, STATE(ARMED));
}

static void to_warned(void)
{
	to_armed();
	ticks(1000);
}

static void to_falling(void)
{
	to_warned();
	assert_int_equal(release(), 0);
	assert_int_equal(sequence.state, STATE(FALLING));
	assert_false(sequence.acknowledged); /* even if the latch never opens */
	checks |= WIRE_CHECK_LATCH;
	ticks(20);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	tick();
}

/* The gates pass as in free fall from the release. */
static void to_separated(void)
{
	uint32_t start_us;

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
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	ticks(400);
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(CAPTURED));
}

static void to_keep_out(void)
{
	to_braked();
	sequence_triggered(&sequence);
	ticks(400);
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(KEEP_OUT));
}

static void to_uploaded(void)
{
	to_captured();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0xC0FFEE), 0);
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
        to_braked, to_captured, to_uploaded, to_fault_held, to_fault_moving, to_keep_out,
};

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

static void boot_needs_the_self_test(void **state)
{
	(void)state;
	boot(PORT_RESET_POWER_ON);
	ticks(99);
	assert_int_equal(sequence.state, STATE(BOOT));
	tick();
	assert_int_equal(sequence.state, STATE(SAFE));
	boot(PORT_RESET_POWER_ON);
	checks = WIRE_CHECK_CLOCKS;
	ticks(100);
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	assert_int_equal(sequence.fault, WIRE_FAULT_SELF_TEST);
	assert_int_equal(clear(), DT_E_CHECKS);
	checks = 0;
	assert_int_equal(clear(), 0);
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
	assert_int_equal(clear(), DT_E_CHECKS);
	checks = 0;
	assert_int_equal(clear(), 0);
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
	boot(PORT_RESET_COMMAND);
	assert_int_equal(sequence.state, STATE(BOOT));
}

/* The frame is neither held nor down: it is on its way, whatever the reset was. */
static void boot_looks_for_the_frame(void **state)
{
	(void)state;
	for (unsigned cause = 0; cause < PORT_RESETS; cause++) {
		boot((enum port_reset)cause);
		fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
		known = (uint16_t)~WIRE_IO_FRAME_DOWN; /* not read yet */
		ticks(3);
		assert_int_not_equal(sequence.fault, WIRE_FAULT_RESET);
		known = UINT16_MAX;
		tick();
		assert_int_equal(sequence.state, STATE(FAULT_HELD));
		assert_int_equal(sequence.fault, cause == PORT_RESET_WATCHDOG    ? WIRE_FAULT_WATCHDOG
		                                 : cause == PORT_RESET_BROWN_OUT ? WIRE_FAULT_BROWN_OUT
		                                                                 : WIRE_FAULT_RESET);
		assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
		boot((enum port_reset)cause);
		fake.inputs ^= WIRE_IO_LATCH_CLOSED | WIRE_IO_FRAME_DOWN; /* down is at rest */
		ticks(3);
		assert_int_not_equal(sequence.fault, WIRE_FAULT_RESET);
	}
}

static void arm_and_release_are_guarded(void **state)
{
	(void)state;
	to_safe();
	assert_int_equal(arm(), DT_E_CHECKS);
	hosts_heard(&hosts, 0, SESSION, false);
	assert_int_equal(arm(), DT_E_HASH);
	to_ready();
	assert_int_equal(release(), DT_E_STATE);
	checks = WIRE_CHECK_DOOR; /* opened since the last tick */
	assert_int_equal(arm(), DT_E_CHECKS);
	checks = 0;
	assert_int_equal(command_by(SESSION + 1, WIRE_OP_ARM, wire_answer(0, SESSION + 1, SET)),
	                 DT_E_SESSION);
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(0, SESSION, SET + 1)), DT_E_PARAMETERS);
	no_nonce = true;
	assert_int_equal(ask(), DT_E_SYSTEM);
	no_nonce = false;
	assert_int_equal(ask(), 0);
	no_nonce = true;
	assert_int_equal(answer(), DT_E_SYSTEM);
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	to_armed();
	assert_int_equal(ask(), DT_E_STATE);
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET + 1)), DT_E_STATE);
	assert_int_equal(command_by(SESSION + 1, WIRE_OP_ARM, wire_answer(NONCE, SESSION + 1, SET)),
	                 DT_E_STATE);
	assert_int_equal(command_by(SESSION + 1, WIRE_OP_RELEASE, wire_answer(NONCE, 1, SET)), DT_E_SESSION);
	assert_int_equal(command(WIRE_OP_RELEASE, wire_answer(NONCE + 1, 1, SET)), DT_E_TOKEN);
	assert_int_equal(command(WIRE_OP_RELEASE, wire_answer(NONCE, 2, SET)), DT_E_TOKEN);
	assert_int_equal(command(WIRE_OP_RELEASE, wire_answer(NONCE, 1, SET + 1)), DT_E_TOKEN);
	assert_int_equal(command(WIRE_OP_RELEASE, 0), DT_E_TOKEN);
	checks = WIRE_CHECK_DAMPERS;
	assert_int_equal(release(), DT_E_EARLY);
	checks = 0;
	ticks(999);
	assert_int_equal(release(), DT_E_EARLY);
	tick();
	checks = WIRE_CHECK_DAMPERS;
	assert_int_equal(release(), DT_E_CHECKS);
	assert_int_equal(sequence.state, STATE(ARMED));
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING);
	assert_int_equal(sequence.drop_id, 0);
	assert_int_equal(command(77, 0), DT_E_UNKNOWN);
	checks = 0;
	assert_int_equal(release(), 0);
	assert_int_equal(sequence.drop_id, 1);
}

/* Each guard, in SAFE and in READY; the other checks only want their second. */
/* Only the answer to the host that has armed, with what it armed with, may be said again. */
static void nobody_else_is_told_that_it_has_armed(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(command_by(SESSION ^ 1, WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET)), DT_E_STATE);
	assert_int_equal(command_by(SESSION, WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET) ^ 1), DT_E_STATE);
	assert_int_equal(answer(), 0);
	to_ready(); /* where session and key are 0 */
	assert_int_equal(command_by(0, WIRE_OP_ARM, 0), DT_E_SESSION);
	assert_int_equal(command_by(SESSION, WIRE_OP_ARM, 0), DT_E_PARAMETERS);
	assert_int_equal(command_by(0, WIRE_OP_ARM, wire_answer(0, SESSION, SET)), DT_E_SESSION);
	assert_int_equal(sequence.state, STATE(READY));
}

/* What answers a challenge does so once, and not after anything else has happened. */
static void an_answer_is_good_once(void **state)
{
	(void)state;
	to_ready();
	assert_int_equal(answer(), DT_E_PARAMETERS); /* to nothing */
	assert_int_equal(ask(), 0);
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	checks = WIRE_CHECK_DOOR; /* refused it is used up, too */
	assert_int_equal(answer(), DT_E_CHECKS);
	checks = 0;
	assert_int_equal(answer(), DT_E_PARAMETERS);
	assert_int_equal(ask(), 0);
	assert_int_equal(command_by(7, WIRE_OP_ARM, 7), DT_E_SESSION); /* nor after another's */
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(1, SESSION, SET)), DT_E_PARAMETERS);
	assert_int_equal(answer(), DT_E_PARAMETERS);
	assert_int_equal(ask(), 0);
	assert_int_equal(command(WIRE_OP_ABORT, 0), 0);
	ticks(1);
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(answer(), DT_E_PARAMETERS);
	assert_int_equal(ask(), 0);
	ticks(1001);
	assert_int_equal(answer(), DT_E_PARAMETERS);
	/* what is over has no number that could be guessed */
	assert_int_equal(ask(), 0);
	ticks(1001);
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(1, SESSION, SET)), DT_E_PARAMETERS);
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(1, SESSION, SET)), DT_E_PARAMETERS);
	assert_int_equal(ask(), 0);
	ticks(1000);
	assert_int_equal(answer(), 0);
	assert_int_equal(sequence.state, STATE(ARMED));
	assert_int_equal(command(WIRE_OP_ABORT, 0), 0);
	ticks(1);
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(answer(), DT_E_PARAMETERS); /* the one that armed */
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

/* A fault at rest, and one in motion that has been uploaded; not one that was cleared. */
static void a_fault_outlives_a_reset(void **state)
{
	(void)state;
	for (unsigned cause = 0; cause < PORT_RESETS; cause++)
		for (unsigned from = 0; from < 3; from++) {
			uint8_t kept, fault = from == 1 ? WIRE_FAULT_ABORTED : WIRE_FAULT_DOOR;

			if (from == 1)
				to_fault_moving();
			else
				to_armed();
			checks = from == 1 ? 0 : WIRE_CHECK_DOOR;
			if (from != 1)
				tick();
			checks = 0;
			if (from == 1) {
				fake.inputs |= WIRE_IO_FRAME_DOWN;
				tick();
				sequence_full(&sequence);
				assert_int_equal(command(WIRE_OP_ACCEPT, 0xC0FFEE), 0);
			}
			if (from == 2)
				assert_int_equal(clear(), 0);
			assert_int_equal(sequence.fault, from == 2 ? WIRE_FAULT_NONE : fault);
			kept = fake.kept;
			fake_init();
			fake.kept = kept;
			sequence_init(&sequence, &parameters, counters, (enum port_reset)cause);
			if (cause == PORT_RESET_WATCHDOG)
				fault = WIRE_FAULT_WATCHDOG;
			else if (cause == PORT_RESET_BROWN_OUT)
				fault = WIRE_FAULT_BROWN_OUT;
			else if (from == 2)
				fault = WIRE_FAULT_NONE;
			assert_int_equal(sequence.fault, fault);
			assert_int_equal(sequence.state, fault ? STATE(FAULT_HELD) : STATE(BOOT));
		}
}

/* The switches of latch and dampers, both open: the frame hangs. */
static void nothing_is_cleared_under_a_hanging_frame(void **state)
{
	(void)state;
	to_fault_held();
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	assert_int_equal(clear(), DT_E_CHECKS);
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	assert_int_equal(clear(), 0);
	assert_int_equal(sequence.state, STATE(SAFE));
}

static void a_guard_wants_to_be_acknowledged(void **state)
{
	static const uint32_t guards[] = {WIRE_CHECK_ESTOP, WIRE_CHECK_DOOR, WIRE_CHECK_LATCH,
	                                  WIRE_CHECK_PRODUCT};
	uint32_t all = 0;

	(void)state;
	for (size_t i = 0; i < 4; i++) {
		all |= guards[i];
		to_ready();
		checks = guards[i];
		tick();
		assert_int_equal(sequence.state, STATE(SAFE));
		assert_int_equal(sequence_checks(&sequence, checks), guards[i] | WIRE_CHECK_ACKNOWLEDGE);
		assert_int_equal(clear(), DT_E_CHECKS);
		checks = 0;
		ticks(5000);
		assert_int_equal(sequence.state, STATE(SAFE));
		assert_int_equal(sequence_checks(&sequence, 0), WIRE_CHECK_ACKNOWLEDGE);
		assert_int_equal(clear(), 0);
		assert_int_equal(sequence.state, STATE(SAFE));
		assert_int_equal(sequence_checks(&sequence, 0), WIRE_CHECK_SETTLE);
		ticks(1000);
		assert_int_equal(sequence.state, STATE(SAFE));
		tick();
		assert_int_equal(sequence.state, STATE(READY));
		assert_int_equal(clear(), DT_E_STATE);
	}
	for (unsigned i = 0; i < WIRE_CHECK_NUMBER_ACKNOWLEDGE; i++) {
		if (all & 1u << i)
			continue;
		to_ready();
		checks = 1u << i;
		tick();
		assert_int_equal(sequence.state, STATE(SAFE));
		checks = 0;
		ticks(1000);
		assert_int_equal(sequence.state, STATE(SAFE));
		tick();
		assert_int_equal(sequence.state, STATE(READY));
	}
	to_ready();
	parameters.value[WIRE_PARAMETER_settle_ms] = 3000;
	checks = WIRE_CHECK_TRIGGER;
	tick();
	checks = 0;
	ticks(3000);
	assert_int_equal(sequence.state, STATE(SAFE));
	tick();
	assert_int_equal(sequence.state, STATE(READY));
}

/* Whoever has lifted the frame and put the product on before the upload was over has to say so too. */
static void a_drop_wants_to_be_acknowledged(void **state)
{
	(void)state;
	to_captured();
	fake.inputs = FAKE_ALL_GOOD;
	checks = 0;
	ticks(100);
	assert_int_equal(command(WIRE_OP_DISCARD, 1), 0);
	ticks(5000);
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(sequence_checks(&sequence, 0), WIRE_CHECK_ACKNOWLEDGE);
	assert_int_equal(clear(), 0);
	ticks(1001);
	assert_int_equal(sequence.state, STATE(READY));
}

/* CLEAR of a fault acknowledges, but only with all four guards closed. */
static void clear_of_a_fault_acknowledges_if_it_may(void **state)
{
	(void)state;
	to_fault_held();
	ticks(2000);
	assert_int_equal(clear(), 0);
	ticks(1001);
	assert_int_equal(sequence.state, STATE(READY));
	to_fault_held();
	checks = WIRE_CHECK_DOOR;
	tick();
	assert_int_equal(clear(), 0); /* the emergency stop was its cause */
	checks = 0;
	ticks(2000);
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(sequence_checks(&sequence, 0), WIRE_CHECK_ACKNOWLEDGE);
}

static void warning_may_be_longer(void **state)
{
	(void)state;
	to_ready();
	parameters.value[WIRE_PARAMETER_warning_ms] = 4000;
	assert_int_equal(arm(), 0);
	ticks(2000);
	assert_int_equal(answer(), 0); /* again: no timer begins anew */
	ticks(1999);
	assert_int_equal(release(), DT_E_EARLY);
	tick();
	assert_int_equal(release(), 0);
}

static void armed_expires(void **state)
{
	(void)state;
	to_armed();
	ticks(9999);
	assert_int_equal(sequence.state, STATE(ARMED));
	tick();
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(release(), DT_E_STATE);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void lost_check_while_armed(void **state)
{
	static const struct {
		uint32_t check;
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
	assert_int_equal(clear(), DT_E_CHECKS);
	assert_int_equal(sequence.fault, WIRE_FAULT_ESTOP);
	checks = WIRE_CHECK_HOST; /* another one does not matter */
	assert_int_equal(clear(), 0);
	assert_int_equal(sequence.state, STATE(SAFE));
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
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(table_is_the_one_of_the_design),
	        cmocka_unit_test(every_state_can_be_reached),
	        cmocka_unit_test(outputs_of_every_state),
	        cmocka_unit_test(camera_has_a_pulse_of_ten_ms),
	        cmocka_unit_test(boot_needs_the_self_test),
	        cmocka_unit_test(reset_causes_are_faults),
	        cmocka_unit_test(boot_looks_for_the_frame),
	        cmocka_unit_test(arm_and_release_are_guarded),
	        cmocka_unit_test(nobody_else_is_told_that_it_has_armed),
	        cmocka_unit_test(an_answer_is_good_once),
	        cmocka_unit_test(a_fault_outlives_a_reset),
	        cmocka_unit_test(nothing_is_cleared_under_a_hanging_frame),
	        cmocka_unit_test(a_guard_wants_to_be_acknowledged),
	        cmocka_unit_test(a_drop_wants_to_be_acknowledged),
	        cmocka_unit_test(clear_of_a_fault_acknowledges_if_it_may),
	        cmocka_unit_test(warning_may_be_longer),
	        cmocka_unit_test(armed_expires),
	        cmocka_unit_test(lost_check_while_armed),
	        cmocka_unit_test(clear_waits_until_the_cause_is_gone),
	        cmocka_unit_test(abort_in_every_state),
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
	        cmocka_unit_test(loss_in_every_state),
	        cmocka_unit_test(reset_in_every_state),
	        cmocka_unit_test(reset_in_motion_is_a_fault),
	        cmocka_unit_test(no_impact_is_forced_after_600_ms),
	        cmocka_unit_test(accept_needs_the_crc),
	        cmocka_unit_test(fault_in_motion_ends_in_fault_held),
	        cmocka_unit_test(drop_id_counts_releases_and_skips_zero),
	};

	return cmocka_run_group_tests(tests, read_readme, NULL);
}
