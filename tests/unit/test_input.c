/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Debouncing: each bit by itself, three readings that agree, both ways.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/wire.h"
#include "firmware/input.h"
#include "tests/unit/fake_port.h"

static void readings(const uint16_t *pins, const uint16_t *agreed, unsigned count)
{
	struct input input;

	input_init(&input);
	for (unsigned i = 0; i < count; i++) {
		input_read(&input, pins[i]);
		assert_int_equal(input.agreed, agreed[i]);
		assert_int_equal(input.readings, i < 3 ? i + 1 : 3);
	}
}

static void three_that_agree(void **state)
{
	static const uint16_t pins[] = {0x21, 0x21, 0x21, 0x20, 0x21, 0x20, 0x20,
	                                0x21, 0x20, 0x20, 0x20, 0x23, 0x23, 0x23};
	static const uint16_t agreed[] = {0,    0,    0x21, 0x21, 0x21, 0x21, 0x21,
	                                  0x21, 0x21, 0x21, 0x20, 0x20, 0x20, 0x23};

	(void)state;
	readings(pins, agreed, sizeof(pins) / sizeof(pins[0]));
}

static void what_flickers_from_the_start_is_not_known(void **state)
{
	struct input input;

	(void)state;
	input_init(&input);
	input_read(&input, 0x8001);
	input_read(&input, 0x8000);
	assert_int_equal(input.known, 0);
	input_read(&input, 0x8001);
	assert_int_equal(input.known, 0xFFFE);
	assert_int_equal(input.agreed, 0x8000);
	for (unsigned i = 0; i < 1000; i++)
		input_read(&input, i % 2 ? 0x8001 : 0x8000);
	assert_int_equal(input.known, 0xFFFE);
	input_read(&input, 0x8001);
	input_read(&input, 0x8001);
	assert_int_equal(input.known, 0xFFFF);
	assert_int_equal(input.agreed, 0x8001);
}

/* Outputs as they are driven, inputs as agreed on; not a pin that has only just changed. */
static void the_word_is_outputs_and_agreed_inputs(void **state)
{
	struct input input = {.agreed = WIRE_IO_DOOR_CLOSED};

	(void)state;
	assert_int_equal(input_io(&input, WIRE_IO_OUTPUTS | WIRE_IO_ESTOP_CLEAR),
	                 WIRE_IO_OUTPUTS | WIRE_IO_DOOR_CLOSED);
	assert_int_equal(input_io(&input, WIRE_IO_LATCH_OPEN | WIRE_IO_ESTOP_CLEAR),
	                 WIRE_IO_LATCH_OPEN | WIRE_IO_DOOR_CLOSED);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(three_that_agree),
	        cmocka_unit_test(what_flickers_from_the_start_is_not_known),
	        cmocka_unit_test(the_word_is_outputs_and_agreed_inputs),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
