/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The names and texts that people and other tools see: each number of the wire has one of its own, no other
 * number has any, and a few are what the design calls them.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/error.h"
#include "common/wire.h"
#include "common/wire_table.h"

/* Numbers 0 to count - 1 have names that differ, the next hundred none. */
static void check_names(const char *(*name)(unsigned), unsigned count)
{
	for (unsigned i = 0; i < count; i++) {
		assert_true(strlen(name(i)) > 1);
		for (unsigned j = 0; j < i; j++)
			assert_string_not_equal(name(i), name(j));
	}
	for (unsigned i = count; i < count + 100; i++)
		assert_string_equal(name(i), "?");
}

static void names_of_numbers(void **state)
{
	(void)state;
	check_names(wire_state_name, WIRE_STATES);
	check_names(wire_state_text, WIRE_STATES);
	check_names(wire_fault_name, WIRE_FAULTS);
	check_names(wire_fault_text, WIRE_FAULTS);
	check_names(wire_counter_name, WIRE_COUNTERS);
	check_names(wire_check_name, WIRE_CHECKS);
	check_names(wire_check_text, WIRE_CHECKS);
	check_names(wire_mark_name, 13);
	assert_string_equal(wire_op_name(0), "?");
	for (unsigned op = 1; op <= 6; op++)
		assert_string_not_equal(wire_op_name(op), "?");
	assert_string_equal(wire_op_name(7), "?");
}

static void names_of_the_design(void **state)
{
	(void)state;
	assert_string_equal(wire_state_name(WIRE_STATE_FAULT_MOVING), "FAULT_MOVING");
	assert_string_equal(wire_fault_name(WIRE_FAULT_ESTOP), "ESTOP");
	assert_string_equal(wire_op_name(WIRE_OP_ABORT), "ABORT");
	assert_string_equal(wire_mark_name(0), "SLOW_FRAME");
	assert_string_equal(wire_check_text(WIRE_CHECK_NUMBER_DOOR), "close the door");
	assert_int_equal(wire_fault_emcy(WIRE_FAULT_HOST_LOST), 0x8130);
	assert_int_equal(wire_fault_emcy(WIRE_FAULTS), 0xFF00);
	for (unsigned s = 0; s < WIRE_STATES + 5; s++)
		assert_int_equal(wire_state_moving(s), (s >= 4 && s <= 6) || s == 10 || s == 11);
}

static void messages_by_identifier(void **state)
{
	(void)state;
	assert_string_equal(wire_message_of(0x481)->name, "RESENT_S2");
	assert_string_equal(wire_message_of(0x481)->sender, "tower");
	assert_int_equal(wire_message_of(0x481)->layout->length, 64);
	assert_null(wire_message_of(0x480));
}

static void errors_have_texts(void **state)
{
	(void)state;
	assert_string_equal(error_text(0), "done");
	assert_string_equal(error_text(DT_E_TOKEN), "not the answer to this ARM");
	assert_string_equal(error_text(1), "unknown error");
	for (int code = -1; code >= -23; code--) {
		assert_string_not_equal(error_text(code), "unknown error");
		for (int other = 0; other > code; other--)
			assert_string_not_equal(error_text(code), error_text(other));
	}
	for (int code = -24; code >= -128; code--)
		assert_string_equal(error_text(code), "unknown error");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(names_of_numbers),
	        cmocka_unit_test(names_of_the_design),
	        cmocka_unit_test(messages_by_identifier),
	        cmocka_unit_test(errors_have_texts),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
