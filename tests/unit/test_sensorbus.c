/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The simulated sensor bus: bytes written by hand and the way there and back.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/error.h"
#include "common/sensorbus.h"

static void request_bytes(void **state)
{
	static const uint8_t bytes[SENSORBUS_REQUEST_BYTES] = {
	        0x78, 0x56, 0x34, 0x12, 3, 0, 0x0B, 0x00, 2, 1, 3, 6, 0, 0, 0, 0, 0xD2, 0x04, 0, 0};
	struct sensorbus_request request = {.tick_ms = 0x12345678,
	                                    .group = SENSORBUS_X | SENSORBUS_YZ,
	                                    .outputs = 0x000B,
	                                    .edges = 2,
	                                    .frames = 1,
	                                    .reset = 1,
	                                    .ahead = 1,
	                                    .kept = 6,
	                                    .edge_us = {0, 1234}};
	struct sensorbus_request back;
	uint8_t out[SENSORBUS_REQUEST_BYTES];

	(void)state;
	assert_int_equal(sensorbus_put_request(out, &request), SENSORBUS_REQUEST_BYTES);
	assert_memory_equal(out, bytes, sizeof(bytes));
	assert_int_equal(sensorbus_get_request(bytes, &back), SENSORBUS_REQUEST_BYTES);
	assert_int_equal(back.tick_ms, request.tick_ms); /* by members: between them is padding */
	assert_int_equal(back.group, request.group);
	assert_int_equal(back.index, request.index);
	assert_int_equal(back.outputs, request.outputs);
	assert_int_equal(back.edges, request.edges);
	assert_int_equal(back.frames, request.frames);
	assert_int_equal(back.reset, request.reset);
	assert_int_equal(back.ahead, request.ahead);
	assert_int_equal(back.kept, request.kept);
	assert_memory_equal(back.edge_us, request.edge_us, sizeof(back.edge_us));
}

static void answer_bytes(void **state)
{
	static const uint8_t bytes[SENSORBUS_ANSWER_BYTES] = {
	        1, 0, 0xFF, 0xFF, 0, 0x80, 4,    0,    5,    0,    6,    0,   0xF0, 0x03,
	        6, 1, 0,    0,    0, 0,    0x40, 0xE2, 0x01, 0,    0x07, 0,   0,    1,
	        3, 1, 9,    0,    2, 1,    2,    1,    0x78, 0x56, 0x34, 0x92};
	struct sensorbus_answer back;
	uint8_t out[SENSORBUS_ANSWER_BYTES];

	(void)state;
	assert_int_equal(sensorbus_get_answer(bytes, &back), SENSORBUS_ANSWER_BYTES);
	assert_int_equal(back.codes[0], 1);
	assert_int_equal(back.codes[1], -1);
	assert_int_equal(back.codes[2], -32768);
	assert_int_equal(back.codes[5], 6);
	assert_int_equal(back.inputs, 0x3F0);
	assert_int_equal(back.captures, 6);
	assert_int_equal(back.frames, 1);
	assert_int_equal(back.capture_us[1], 123456);
	assert_int_equal(back.capture_us[2], 0x01000007);
	assert_int_equal(back.ready, 3);
	assert_int_equal(back.then, SENSORBUS_STOP);
	assert_int_equal(back.bus_errors, 9);
	assert_int_equal(back.bus_state, SENSORBUS_BUS_OFF);
	assert_int_equal(back.tx_blocked, 1);
	assert_int_equal(back.bias_high, 2);
	assert_int_equal(back.hang, 1);
	assert_int_equal(back.random, 0x92345678);
	assert_int_equal(sensorbus_put_answer(out, &back), SENSORBUS_ANSWER_BYTES);
	assert_memory_equal(out, bytes, sizeof(bytes));
}

static void frame_bytes(void **state)
{
	static const uint8_t bytes[] = {0x01, 0xE2, 0x03, 3, 9, 8, 7};
	static const uint8_t too_long[] = {0x01, 0x02, 0x03, 65};
	struct frame frame = {.id = 0x201, .flags = FRAME_FD | FRAME_BRS, .length = 3, .data = {9, 8, 7}};
	struct frame back = {0};
	uint8_t out[SENSORBUS_FRAME_BYTES_MAX];
	unsigned behind = 0;

	(void)state;
	assert_int_equal(sensorbus_put_frame(out, &frame, 14), sizeof(bytes));
	assert_memory_equal(out, bytes, sizeof(bytes));
	assert_int_equal(sensorbus_frame_head(bytes, &back, &behind), 3);
	assert_int_equal(back.id, 0x201);
	assert_int_equal(behind, 14);
	assert_int_equal(back.flags, FRAME_FD | FRAME_BRS);
	assert_int_equal(sensorbus_frame_head(too_long, &back, &behind), DT_E_LENGTH);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(request_bytes),
	        cmocka_unit_test(answer_bytes),
	        cmocka_unit_test(frame_bytes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
