/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What follows a capture end: in whatever order and however often it comes, of which drop, damaged, and
 * whether it makes up the set that the capture end names or an altered one. The CRC-32 of the sets is worked
 * out by Python's zlib.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <string.h>

#include "common/wire_table.h"
#include "host/record/told.h"

/* zlib.crc32(b"".join(struct.pack("<I", 1000 + i) for i in range(21))) */
enum { SET = WIRE_PARAMETERS };
static const uint32_t SET_CRC32 = 0xE2A74080u;

static struct told told;

static int begin(void **state)
{
	(void)state;
	memset(&told, 0xA5, sizeof(told));
	told_begin(&told, 7);
	return 0;
}

static int feed_parameter(uint16_t drop_id, uint16_t index, uint32_t value)
{
	struct wire_parameter parameter = {.drop_id = drop_id, .index = index, .value = value};
	struct frame frame;

	wire_pack_parameter(&frame, WIRE_ID_PARAMETER, &parameter);
	return told_feed(&told, &frame);
}

static struct frame measured_of(uint16_t drop_id, uint16_t dropout_us)
{
	struct wire_measured measured = {.drop_id = drop_id, .dropout_us = dropout_us};
	struct frame frame;

	wire_pack_measured(&frame, WIRE_ID_MEASURED, &measured);
	wire_seal_measured(&frame);
	return frame;
}

static int feed_measured(uint16_t drop_id, uint16_t dropout_us)
{
	struct frame frame = measured_of(drop_id, dropout_us);

	return told_feed(&told, &frame);
}

static void feed_set(uint16_t drop_id)
{
	for (unsigned i = 0; i < SET; i++)
		assert_int_equal(feed_parameter(drop_id, (uint16_t)(0x2000 + i), 1000 + i), 0);
}

static bool whole(uint32_t parameters_crc32)
{
	const struct wire_capture_end end = {.drop_id = 7, .parameters_crc32 = parameters_crc32};

	return told_whole(&told, &end);
}

/* What the record of that capture end has of the parameters: all of them that are held. */
static uint32_t held(uint32_t parameters_crc32, unsigned corrupt)
{
	const struct wire_capture_end end = {.drop_id = 7, .parameters_crc32 = parameters_crc32};
	struct record record;

	memset(&record, 0, sizeof(record));
	record.counters.corrupt = 5;
	told_fill(&told, &end, &record);
	assert_int_equal(record.counters.corrupt, 5 + corrupt);
	assert_int_equal(told_is_altered(&told, &end), corrupt);
	assert_memory_equal(record.parameters, told.parameter, sizeof(record.parameters));
	return record.parameters_held;
}

static void all_of_it(void **state)
{
	const struct wire_capture_end end = {.drop_id = 7, .parameters_crc32 = SET_CRC32};
	struct record record;

	(void)state;
	assert_int_equal(feed_measured(7, 8123), 0);
	assert_false(whole(SET_CRC32));
	feed_set(7);
	assert_true(whole(SET_CRC32));
	memset(&record, 0, sizeof(record));
	told_fill(&told, &end, &record);
	assert_true(record.measured_known);
	assert_int_equal(record.measured.dropout_us, 8123);
	assert_int_equal(record.parameters_held, 0x1FFFFF);
	for (unsigned i = 0; i < SET; i++)
		assert_int_equal(record.parameters[i], 1000 + i);
	assert_int_equal(record.counters.corrupt, 0);
}

/* One that lacks is no set, whichever it is. One that has another value is an altered one, until it comes
 * again as it was. */
static void any_that_lacks(void **state)
{
	for (unsigned lost = 0; lost < SET; lost++) {
		begin(state);
		assert_int_equal(feed_measured(7, 1), 0);
		for (unsigned i = 0; i < SET; i++)
			if (i != lost)
				assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + i), 1000 + i), 0);
		assert_false(whole(SET_CRC32));
		assert_int_equal(held(SET_CRC32, 0), 0x1FFFFF & ~(1u << lost));
		assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + lost), 1001 + lost), 0);
		assert_false(whole(SET_CRC32));
		assert_int_equal(held(SET_CRC32, 1), 0x1FFFFF);
		assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + lost), 1000 + lost), DT_E_CORRUPT);
		assert_true(whole(SET_CRC32));
		assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + lost), 1000 + lost), 0);
		assert_int_equal(held(SET_CRC32, 0), 0x1FFFFF);
	}
}

static void another_set_is_altered(void **state)
{
	(void)state;
	feed_set(7);
	assert_false(whole(SET_CRC32)); /* nothing measured */
	assert_int_equal(held(SET_CRC32, 0), 0x1FFFFF);
	assert_int_equal(held(SET_CRC32 ^ 1, 1), 0x1FFFFF);
	assert_int_equal(feed_measured(7, 1), 0);
	assert_true(whole(SET_CRC32));
	assert_false(whole(SET_CRC32 ^ 1));
}

static void of_another_drop(void **state)
{
	(void)state;
	memset(&told, 0, sizeof(told)); /* no capture end came: of no drop */
	assert_int_equal(feed_measured(0, 8000), 0);
	feed_set(0);
	assert_false(told.measured_known);
	assert_int_equal(told.held, 0);
	begin(state);
	assert_int_equal(feed_measured(7, 8000), 0);
	feed_set(7);
	assert_int_equal(feed_measured(8, 8001), DT_E_CORRUPT);
	for (unsigned i = 0; i < SET; i++)
		assert_int_equal(feed_parameter(8, (uint16_t)(0x2000 + i), 5), DT_E_CORRUPT);
	assert_true(whole(SET_CRC32));
	assert_int_equal(told.measured.dropout_us, 8000);
	told_begin(&told, 8); /* the next one's: what was is forgotten */
	assert_false(whole(SET_CRC32));
	assert_int_equal(held(SET_CRC32, 0), 0);
	assert_int_equal(feed_measured(8, 8001), 0);
	assert_int_equal(feed_measured(7, 8000), DT_E_CORRUPT);
	assert_int_equal(told.measured.dropout_us, 8001);
}

/* An index that is no parameter's, or beyond the table. */
static void what_is_no_parameter(void **state)
{
	(void)state;
	for (uint32_t index = 0; index <= UINT16_MAX; index++)
		if (index < 0x2000 || index >= 0x2000 + SET)
			assert_int_equal(feed_parameter(7, (uint16_t)index, 5), DT_E_UNKNOWN);
	assert_int_equal(told.held, 0);
	for (unsigned i = 0; i < SET; i++)
		assert_int_equal(told.parameter[i], 0);
}

static void damaged(void **state)
{
	struct frame good = measured_of(7, 8000);

	(void)state;
	for (unsigned bit = 0; bit < 8 * WIRE_LENGTH_measured; bit++) {
		struct frame frame = good;

		frame.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
		assert_int_equal(told_feed(&told, &frame), DT_E_CORRUPT);
	}
	good.length = 20;
	assert_int_equal(told_feed(&told, &good), DT_E_LENGTH);
	good = (struct frame){.id = WIRE_ID_PARAMETER, .length = 7};
	assert_int_equal(told_feed(&told, &good), DT_E_LENGTH);
	assert_false(told.measured_known);
	assert_int_equal(told.held, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(all_of_it, begin),
	        cmocka_unit_test_setup(any_that_lacks, begin),
	        cmocka_unit_test_setup(another_set_is_altered, begin),
	        cmocka_unit_test_setup(of_another_drop, begin),
	        cmocka_unit_test_setup(what_is_no_parameter, begin),
	        cmocka_unit_test_setup(damaged, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
