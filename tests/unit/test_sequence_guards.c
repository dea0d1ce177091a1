/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The sequence: its guards, from the self-test to ARM and RELEASE; faults, their clearing and acknowledging.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "tests/unit/sequence_by_hand.h"

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

int main(void)
{
	static const struct CMUnitTest tests[] = {
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
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
