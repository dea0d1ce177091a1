/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The wire: bytes written by hand against pack and unpack, every layout there and back with random
 * content, refusals, and the tables against the structs.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/crc.h"
#include "common/wire.h"
#include "common/wire_table.h"

static void command_has_the_bytes_of_the_design(void **state)
{
	static const uint8_t bytes[8] = {2, 7, 0x34, 0x12, 0xEF, 0xBE, 0xAD, 0xDE};
	struct wire_command command = {.op = 2, .sequence = 7, .host = 0x1234, .argument = 0xDEADBEEF};
	struct wire_command back = {0};
	struct frame frame = {.time_us = 99};

	(void)state;
	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	assert_int_equal(frame.id, 0x201);
	assert_int_equal(frame.length, 8);
	assert_int_equal(frame.flags, 0);
	assert_int_equal(frame.time_us, 99);
	assert_memory_equal(frame.data, bytes, 8);
	assert_int_equal(wire_unpack_command(&frame, &back), 0);
	assert_int_equal(back.argument, 0xDEADBEEF);
	assert_int_equal(back.host, 0x1234);
}

/* Bytes and checksums worked out apart, with Python's struct and zlib. */
static void capture_end_is_sealed(void **state)
{
	static const uint8_t bytes[32] = {0x02, 0x01, 0x03, 0x10, 0x14, 0x13, 0x12, 0x11, 0x24, 0x23, 0x22,
	                                  0x21, 0x1B, 0x87, 0x01, 0x00, 0xEF, 0xBE, 0xAD, 0xDE, 0x1B, 0x0B,
	                                  0xF9, 0xFF, 0xF0, 0xDE, 0xBC, 0x9A, 0xCA, 0xCB, 0xFE, 0x94};
	struct wire_capture_end end = {.drop_id = 0x0102,
	                               .marks = WIRE_MARK_CALIBRATED | WIRE_MARK_SLOW_FRAME |
	                                        WIRE_MARK_NO_IMPACT,
	                               .first_tick_ms = 0x11121314,
	                               .last_tick_ms = 0x21222324,
	                               .trigger_us = 100123,
	                               .crc32 = 0xDEADBEEF,
	                               .frame_speed_mm_s = 2843,
	                               .camera_frame = -7,
	                               .parameters_crc32 = 0x9ABCDEF0};
	struct frame frame = {0};

	(void)state;
	wire_pack_capture_end(&frame, WIRE_ID_CAPTURE_END, &end);
	assert_int_equal(wire_check_capture_end(&frame), DT_E_CORRUPT);
	wire_seal_capture_end(&frame);
	assert_int_equal(frame.id, 0x681);
	assert_int_equal(frame.length, 32);
	assert_memory_equal(frame.data, bytes, 32);
	assert_int_equal(wire_check_capture_end(&frame), 0);
	for (unsigned bit = 0; bit < 32 * 8; bit++) {
		frame.data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
		assert_int_equal(wire_check_capture_end(&frame), DT_E_CORRUPT);
		frame.data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
	}
	frame.length = 24;
	assert_int_equal(wire_check_capture_end(&frame), DT_E_LENGTH);
}

static void measured_carries_its_checksum(void **state)
{
	static const uint8_t bytes[24] = {0x03, 0x00, 0xBB, 0x1F, 0x40, 0x1F, 0x41, 0x0F,
	                                  0x58, 0xE7, 0x0B, 0x00, 0x4E, 0x26, 0x82, 0x3B,
	                                  0xFD, 0xFF, 0x9C, 0x01, 0xB9, 0xEA, 0xA9, 0x2D};
	struct wire_measured measured = {.drop_id = 3,
	                                 .dropout_us = 8123,
	                                 .dropout_used_us = 8000,
	                                 .separation_mm_s = 3905,
	                                 .separation_um = 780120,
	                                 .acceleration_mm_s2 = 9806,
	                                 .latch_delay_us = 15234,
	                                 .clock_ppm = -3,
	                                 .trigger_latency_us = 412};
	struct frame frame = {0};

	(void)state;
	wire_pack_measured(&frame, WIRE_ID_MEASURED, &measured);
	wire_seal_measured(&frame);
	assert_int_equal(frame.id, 0x686);
	assert_int_equal(frame.length, 24);
	assert_memory_equal(frame.data, bytes, 24);
	assert_int_equal(wire_check_measured(&frame), 0);
	frame.data[9] ^= 4;
	assert_int_equal(wire_check_measured(&frame), DT_E_CORRUPT);
}

static void challenge_and_heartbeat_have_their_bytes(void **state)
{
	static const uint8_t challenge_bytes[8] = {0x07, 0x00, 0xD3, 0xA0, 0x0D, 0xF0, 0xFE, 0xCA};
	static const uint8_t beat_bytes[7] = {5, 0xD3, 0xA0, 0xE7, 0x51, 0x22, 0x11};
	static const uint8_t parameter_bytes[8] = {0x07, 0x00, 0x04, 0x20, 0x40, 0x1F, 0x00, 0x00};
	struct frame frame = {0};

	(void)state;
	wire_pack_challenge(&frame, WIRE_ID_CHALLENGE,
	                    &(struct wire_challenge){.drop_id = 7, .host = 0xA0D3, .nonce = 0xCAFEF00D});
	assert_int_equal(frame.id, 0x685);
	assert_int_equal(frame.length, 8);
	assert_memory_equal(frame.data, challenge_bytes, 8);
	wire_pack_host_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST,
	                         &(struct wire_host_heartbeat){
	                                 .nmt_state = 5, .session = 0x51E7A0D3, .wire_hash_low = 0x1122});
	assert_int_equal(frame.id, 0x77F);
	assert_int_equal(frame.length, 7);
	assert_memory_equal(frame.data, beat_bytes, 7);
	wire_pack_parameter(&frame, WIRE_ID_PARAMETER,
	                    &(struct wire_parameter){.drop_id = 7, .index = 0x2004, .value = 8000});
	assert_int_equal(frame.id, 0x687);
	assert_memory_equal(frame.data, parameter_bytes, 8);
}

static void answers_of_arm_and_release(void **state)
{
	uint32_t value[WIRE_PARAMETERS];

	(void)state;
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		value[i] = wire_parameters[i].initial;
	assert_int_equal(wire_parameters_crc32(value), 0xA7DEE12E);
	assert_int_equal(wire_answer(0, 0x51E7A0D3, 0xA7DEE12E), 0x051A15FF);
	assert_int_equal(wire_answer(0xCAFEF00D, 0x51E7A0D3, 0xA7DEE12E), 0x311A4681);
	assert_int_equal(wire_answer(0xCAFEF00D, 0x12345678, 0x9ABCDEF0), 0xAC75D793);
	assert_int_equal(wire_answer(0xCAFEF00D, 7, 0xA7DEE12E), 0xFAD42048);
	assert_int_equal(wire_answer(0x11223344, 0xFFFF, 0x9ABCDEF0), 0xE48D3B87);
}

static void block_has_the_bytes_of_the_design(void **state)
{
	struct wire_block block = {.drop_id = 0x0102, .tick_ms = 0x03040506, .status = 0x17, .io = 0x0809};
	struct wire_block back;
	struct frame frame;
	uint8_t expected[64] = {0x02, 0x01, 0x06, 0x05, 0x04, 0x03, 0x17, 0x09, 0x08};
	uint8_t without_crc[63];

	(void)state;
	block.x[0] = -32768;
	block.x[6] = 0x0A0B;
	block.y[0] = -2;
	block.z[9] = 16000;
	expected[11] = 0x80; /* x[0] at 10 */
	expected[22] = 0x0B; /* x[6] at 10 + 12 */
	expected[23] = 0x0A;
	expected[24] = 0xFE; /* y[0] at 10 + 14 */
	expected[25] = 0xFF;
	expected[62] = 0x80; /* z[9] = 0x3E80 at 44 + 18 */
	expected[63] = 0x3E;

	wire_pack_block(&frame, WIRE_ID_BLOCK_S2, &block);
	wire_seal_block(&frame);
	memcpy(without_crc, expected, 9);
	memcpy(without_crc + 9, expected + 10, 54);
	expected[9] = crc8(CRC8_INIT, without_crc, sizeof(without_crc));
	assert_int_equal(frame.id, 0x281);
	assert_int_equal(frame.length, 64);
	assert_int_equal(frame.flags, FRAME_FD | FRAME_BRS);
	assert_memory_equal(frame.data, expected, 64);
	assert_int_equal(wire_check_block(&frame), 0);
	assert_int_equal(wire_unpack_block(&frame, &back), 0);
	assert_int_equal(back.x[0], -32768);
	assert_int_equal(back.z[9], 16000);
}

static void any_flipped_bit_of_a_block_is_seen(void **state)
{
	struct wire_block block = {.drop_id = 1, .tick_ms = 1234, .x = {1, 2, 3, 4, 5, 6, 7}};
	struct frame frame;

	(void)state;
	wire_pack_block(&frame, WIRE_ID_BLOCK_S1, &block);
	wire_seal_block(&frame);
	for (unsigned bit = 0; bit < 64 * 8; bit++) {
		frame.data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
		assert_int_equal(wire_check_block(&frame), DT_E_CORRUPT);
		frame.data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
	}
	frame.length = 48;
	assert_int_equal(wire_check_block(&frame), DT_E_LENGTH);
}

static uint32_t random_state;

static uint8_t random_byte(void)
{
	random_state = random_state * 1664525u + 1013904223u;
	return (uint8_t)(random_state >> 24);
}

/* Random data through unpack and pack of one layout must come back byte for byte. */
#define WIRE_LAYOUT(layout, doc)                                                      \
	static void there_and_back_##layout(struct frame *frame)                      \
	{                                                                             \
		struct wire_##layout message;                                         \
		struct frame back = {0};                                              \
		frame->length = WIRE_LENGTH_##layout;                                 \
		assert_int_equal(wire_unpack_##layout(frame, &message), 0);           \
		wire_pack_##layout(&back, frame->id, &message);                       \
		assert_int_equal(back.length, frame->length);                         \
		assert_memory_equal(back.data, frame->data, frame->length);           \
		frame->length = (uint8_t)(frame->length - 1);                         \
		assert_int_equal(wire_unpack_##layout(frame, &message), DT_E_LENGTH); \
		frame->length = WIRE_LENGTH_##layout;                                 \
		frame->flags = FRAME_ERROR;                                           \
		assert_int_equal(wire_unpack_##layout(frame, &message), DT_E_LENGTH); \
		frame->flags = 0;                                                     \
	}
#include "common/wire.def"

static void every_layout_there_and_back(void **state)
{
	struct frame frame = {.id = 0x123};

	(void)state;
	random_state = 20;
	for (int round = 0; round < 100; round++) {
		for (int i = 0; i < 64; i++)
			frame.data[i] = random_byte();
#define WIRE_LAYOUT(layout, doc) there_and_back_##layout(&frame);
#include "common/wire.def"
	}
}

/* Element i of a field in packed data, by what the table says of the field. */
static int64_t field_value(const struct wire_field *field, const uint8_t *data, unsigned i)
{
	uint64_t value = 0;

	for (unsigned byte = 0; byte < field->size; byte++)
		value |= (uint64_t)data[field->offset + i * field->size + byte] << (8u * byte);
	return field->is_signed && value >> (8u * field->size - 1u) != 0
	               ? (int64_t)value - ((int64_t)1 << (8u * field->size))
	               : (int64_t)value;
}

static void tables_agree_with_the_structs(void **state)
{
	struct wire_block block = {0};
	struct frame frame;
	const struct wire_message *message = wire_message_of(0x181);

	(void)state;
	assert_non_null(message);
	assert_string_equal(message->name, "BLOCK_S1");
	assert_string_equal(message->sender, "tower");
	assert_int_equal(message->layout->length, 64);
	assert_int_equal(message->layout->field_count, 8);
	block.tick_ms = 4000000000u;
	block.y[3] = -12345;
	wire_pack_block(&frame, 0x181, &block);
	assert_int_equal(field_value(&message->layout->fields[1], frame.data, 0), 4000000000);
	assert_int_equal(field_value(&message->layout->fields[6], frame.data, 3), -12345);
	assert_null(wire_message_of(0x7FF));
	for (size_t i = 0; i < wire_message_count; i++) {
		const struct wire_layout *layout = wire_messages[i].layout;
		size_t bytes = 0;

		for (size_t f = 0; f < layout->field_count; f++) {
			assert_int_equal(layout->fields[f].offset, bytes);
			bytes += (size_t)layout->fields[f].size * layout->fields[f].count;
		}
		assert_int_equal(bytes, layout->length);
	}
}

static void identifiers_are_those_of_cia_301_for_node_1(void **state)
{
	/* CiA 301 table: NMT 0, SYNC 80, EMCY 81, TIME 100, TPDO1-4 181 281 381 481, RPDO1-2 201 301,
	 * SDO 581 601, heartbeat 701 */
	static const uint32_t expected[] = {0x000, 0x080, 0x081, 0x100, 0x181, 0x281, 0x381,
	                                    0x481, 0x201, 0x301, 0x581, 0x601, 0x681, 0x682,
	                                    0x683, 0x684, 0x685, 0x686, 0x687, 0x701, 0x77F};

	(void)state;
	assert_int_equal(wire_message_count, sizeof(expected) / sizeof(expected[0]));
	for (size_t i = 0; i < wire_message_count; i++) {
		assert_int_equal(wire_messages[i].id, expected[i]);
		for (size_t j = 0; j < i; j++)
			assert_int_not_equal(wire_messages[i].id, wire_messages[j].id);
	}
}

static void names_of_numbers_that_are_none(void **state)
{
	(void)state;
	assert_string_equal(wire_state_name(0), "BOOT");
	assert_string_equal(wire_state_name(10), "FAULT_MOVING");
	assert_string_equal(wire_state_name(11), "KEEP_OUT");
	assert_string_equal(wire_state_name(12), "?");
	assert_string_equal(wire_fault_name(1), "ESTOP");
	assert_string_equal(wire_fault_name(200), "?");
	assert_string_equal(wire_op_name(3), "ABORT");
	assert_string_equal(wire_op_name(0), "?");
	assert_string_equal(wire_mark_name(15), "?");
	assert_string_equal(wire_check_text(99), "?");
	assert_string_equal(wire_counter_name(255), "?");
	assert_int_equal(wire_fault_emcy(3), 0x8130);
	assert_int_equal(wire_state_moving(WIRE_STATE_FALLING), 1);
	assert_int_equal(wire_state_moving(WIRE_STATE_ARMED), 0);
	assert_string_equal(error_text(0), "done");
	assert_string_equal(error_text(-9), "not the answer to this ARM");
	assert_string_equal(error_text(-100), "unknown error");
}

static void parameters_hold_their_own_limits(void **state)
{
	(void)state;
	for (int i = 0; i < WIRE_PARAMETERS; i++) {
		assert_true(wire_parameters[i].min <= wire_parameters[i].initial);
		assert_true(wire_parameters[i].initial <= wire_parameters[i].max);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(command_has_the_bytes_of_the_design),
	        cmocka_unit_test(capture_end_is_sealed),
	        cmocka_unit_test(measured_carries_its_checksum),
	        cmocka_unit_test(challenge_and_heartbeat_have_their_bytes),
	        cmocka_unit_test(answers_of_arm_and_release),
	        cmocka_unit_test(block_has_the_bytes_of_the_design),
	        cmocka_unit_test(any_flipped_bit_of_a_block_is_seen),
	        cmocka_unit_test(every_layout_there_and_back),
	        cmocka_unit_test(tables_agree_with_the_structs),
	        cmocka_unit_test(identifiers_are_those_of_cia_301_for_node_1),
	        cmocka_unit_test(names_of_numbers_that_are_none),
	        cmocka_unit_test(parameters_hold_their_own_limits),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
