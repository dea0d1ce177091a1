/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Commands at the limits: what each of them leaves alone, seen through frames and counters.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "firmware/app.h"
#include "tests/unit/fake_port.h"
#include "tests/unit/firmware_by_hand.h"

static uint32_t given; /* frames, to the tower */

static void count_given(const struct frame *frame)
{
	(void)frame;
	given++;
}

static void nmt(uint8_t command)
{
	struct frame frame;

	wire_pack_nmt(&frame, WIRE_ID_NMT, &(struct wire_nmt){.command = command, .node = 1});
	fake_receive(&frame);
	app_poll();
}

/* An ABORT that changes nothing leaves the window where it is. */
static void abort_leaves_the_window_alone(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_captured();
	firmware_forget_frames();
	firmware_run(101);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).state, WIRE_STATE_UPLOADED);
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0).state, WIRE_STATE_UPLOADED);
	firmware_forget_frames();
	firmware_ask(1, end.first_tick_ms, 10);
	firmware_run(10);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S1), 10);
}

static void a_reset_in_motion_is_refused_and_counted(void **state)
{
	(void)state;
	firmware_to_falling();
	nmt(129);
	nmt(130);
	assert_int_equal(fake.resets, 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_resends_out_of_range), 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_blocks_resent), 0);
}

/* Each does its own and is no malformed frame. */
static void nmt_does_one_thing(void **state)
{
	(void)state;
	firmware_to_ready();
	firmware_forget_frames();
	nmt(2);
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	assert_int_equal(fake.resets, 0);
	nmt(129);
	assert_int_equal(fake.resets, 1);
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	nmt(1);
	nmt(128);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_unknown), 0);
}

/* What is handled well asks for nothing else. */
static void only_its_request_sends_a_capture_end(void **state)
{
	static const struct frame strange[] = {{.id = 0x555, .length = 3},
	                                       {.id = 0x201, .length = 8, .flags = FRAME_EXTENDED}};
	static const uint8_t commands[] = {1, 2, 128, 129, 130};

	(void)state;
	firmware_to_ready();
	firmware_forget_frames();
	for (size_t i = 0; i < sizeof(commands); i++)
		nmt(commands[i]);
	for (size_t i = 0; i < sizeof(strange) / sizeof(strange[0]); i++)
		fake_receive(&strange[i]);
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(firmware_sdo(0x40, 0x2007, 0, 0).specifier, 0x43);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
}

static void parameters_in_safe(void **state)
{
	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	firmware_run(50);
	assert_int_equal(firmware_status().state, WIRE_STATE_BOOT);
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	firmware_run(200);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).specifier, 0x60);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 0);
}

static void every_frame_is_counted(void **state)
{
	static const struct frame strange[] = {
	        {.id = 0x555, .length = 3},
	        {.id = 0x201, .length = 3},
	        {.id = 0x201, .length = 8, .flags = FRAME_EXTENDED},
	        {.id = 0x201, .length = 8, .flags = FRAME_FD | FRAME_BRS | FRAME_ESI}, /* a command, op 0 */
	};
	uint32_t before = 0, received = 0;

	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	given = 0;
	fake.tape = count_given;
	firmware_run(150);
	for (size_t i = 0; i < sizeof(strange) / sizeof(strange[0]); i++)
		fake_receive(&strange[i]);
	app_poll();
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 1);
	for (unsigned i = 0; received == 0 && i < 120 * WIRE_COUNTERS; i++) {
		struct wire_counter m;

		firmware_forget_frames();
		before = given;
		firmware_run_ms();
		if (fake_count(WIRE_ID_COUNTER) == 1 &&
		    wire_unpack_counter(firmware_last(WIRE_ID_COUNTER), &m) == 0 &&
		    m.index == WIRE_COUNTER_frames_received)
			received = m.value;
	}
	assert_int_equal(received, before);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_unknown), 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 1);
}

/* It is counted; what it would have asked for is not known. */
static void a_parameter_frame_of_another_length_has_no_answer(void **state)
{
	(void)state;
	firmware_to_ready();
	firmware_forget_frames();
	fake_receive(&(struct frame){.id = WIRE_ID_SDO_REQUEST, .length = 7, .data = {0x40, 0x02, 0x20}});
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(abort_leaves_the_window_alone),
	        cmocka_unit_test(a_reset_in_motion_is_refused_and_counted),
	        cmocka_unit_test(nmt_does_one_thing),
	        cmocka_unit_test(only_its_request_sends_a_capture_end),
	        cmocka_unit_test(parameters_in_safe),
	        cmocka_unit_test(every_frame_is_counted),
	        cmocka_unit_test(a_parameter_frame_of_another_length_has_no_answer),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
