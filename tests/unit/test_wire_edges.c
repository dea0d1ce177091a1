/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The wire at its limits: every length, every refusal, every field read from the frame and nowhere else.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/crc.h"
#include "common/wire.h"

/* A struct full of something else before: a field that unpack leaves out cannot come back right. Neither
 * writes a byte beyond its own. */
#define WIRE_LAYOUT(layout, doc)                                                                   \
	static void all_of_##layout(const uint8_t *bytes, int before)                              \
	{                                                                                          \
		struct frame frame = {.id = 0x123, .length = WIRE_LENGTH_##layout}, back = {0};    \
		struct {                                                                           \
			struct wire_##layout message;                                              \
			uint8_t after[8];                                                          \
		} here;                                                                            \
		memcpy(frame.data, bytes, sizeof(frame.data));                                     \
		memset(&here, before, sizeof(here));                                               \
		assert_int_equal(wire_unpack_##layout(&frame, &here.message), 0);                  \
		memset(back.data, ~before, sizeof(back.data));                                     \
		wire_pack_##layout(&back, 0x7FF, &here.message);                                   \
		assert_int_equal(back.id, 0x7FF);                                                  \
		assert_int_equal(back.length, WIRE_LENGTH_##layout);                               \
		assert_int_equal(back.flags, WIRE_LENGTH_##layout > 8 ? FRAME_FD | FRAME_BRS : 0); \
		assert_memory_equal(back.data, bytes, WIRE_LENGTH_##layout);                       \
		for (unsigned i = WIRE_LENGTH_##layout; i < sizeof(back.data); i++)                \
			assert_int_equal(back.data[i], (uint8_t)~before);                          \
		for (unsigned i = 0; i < sizeof(here.after); i++)                                  \
			assert_int_equal(here.after[i], (uint8_t)before);                          \
	}
#include "common/wire.def"

static void every_field_of_every_layout(void **state)
{
	uint8_t bytes[64];

	(void)state;
	for (int before = 0; before <= 0xFF; before += 0xFF) {
		for (unsigned i = 0; i < sizeof(bytes); i++)
			bytes[i] = (uint8_t)(0x11 + 37 * i);
#define WIRE_LAYOUT(layout, doc) all_of_##layout(bytes, before);
#include "common/wire.def"
	}
}

static void what_is_no_data_frame_is_refused(void **state)
{
	static const uint8_t flags[] = {FRAME_REMOTE, FRAME_ERROR, FRAME_EXTENDED};
	struct wire_status status = {.state = 77};
	struct frame frame;

	(void)state;
	wire_pack_status(&frame, WIRE_ID_STATUS, &(struct wire_status){.state = 3});
	for (size_t i = 0; i < sizeof(flags); i++) {
		frame.flags = flags[i];
		assert_int_equal(wire_unpack_status(&frame, &status), DT_E_LENGTH);
		assert_int_equal(status.state, 77); /* unchanged */
	}
	for (unsigned good = 0; good < 8; good++) { /* FD, BRS and ESI are the bus's business */
		frame.flags = (uint8_t)good;
		assert_int_equal(wire_unpack_status(&frame, &status), 0);
		assert_int_equal(status.state, 3);
		status.state = 77;
	}
}

/* The text that the hash is over, from wire.def once more, and its CRC-32 with nothing before or behind. */
static void the_hash_is_of_the_whole_text(void **state)
{
	static const char text[] =
#define WIRE_LAYOUT(layout, doc) "{" #layout
#define WIRE_FIELD(layout, type, name, scale, unit, doc) ";" #type " " #name " " #scale
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) ";" #type " " #name "[" #count "] " #scale
#define WIRE_END(layout) "}"
#define WIRE_ID(NAME, id, layout, sender, doc) #NAME " " #id " " #layout " " #sender ";"
#define WIRE_STATE(NAME, moving, doc) #NAME " " #moving ";"
#define WIRE_FAULT(NAME, emcy, doc) #NAME " " #emcy ";"
#define WIRE_CHECK(NAME, doc) #NAME ";"
#define WIRE_OUTPUT(NAME, bit, doc) #NAME " out " #bit ";"
#define WIRE_INPUT(NAME, bit, doc) #NAME " in " #bit ";"
#define WIRE_OP(NAME, value, doc) #NAME " " #value ";"
#define WIRE_MARK(NAME, bit, doc) #NAME " " #bit ";"
#define WIRE_COUNTER(name, doc) #name ";"
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) #name " " #index " " #min " " #max ";"
#include "common/wire.def"
	        ;

	(void)state;
	assert_int_equal(wire_hash(), crc32(CRC32_INIT, (const uint8_t *)text, strlen(text)));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(every_field_of_every_layout),
	        cmocka_unit_test(what_is_no_data_frame_is_refused),
	        cmocka_unit_test(the_hash_is_of_the_whole_text),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
