/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What follows a capture end: in whatever order and however often it comes, of which drop, damaged, and
 * whether it makes up the set that the capture end names. The CRC-32 of the sets is worked out by Python's
 * zlib.
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
	memset(&told, 0, sizeof(told));
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

static struct record filled(uint16_t drop_id, uint32_t parameters_crc32)
{
	struct wire_capture_end end = {.drop_id = drop_id, .parameters_crc32 = parameters_crc32};
	struct record record;

	memset(&record, 0, sizeof(record));
	told_fill(&told, &end, &record);
	return record;
}

static void all_of_it(void **state)
{
	struct record record;

	(void)state;
	assert_int_equal(feed_measured(7, 8123), 0);
	assert_false(told_whole(&told, 7));
	feed_set(7);
	assert_true(told_whole(&told, 7));
	assert_false(told_whole(&told, 8));
	record = filled(7, SET_CRC32);
	assert_true(record.measured_known);
	assert_int_equal(record.measured.dropout_us, 8123);
	assert_true(record.parameters_known);
	for (unsigned i = 0; i < SET; i++)
		assert_int_equal(record.parameters[i], 1000 + i);
}

/* One that lacks is no set, whichever it is; nor is one that has another value. */
static void any_that_lacks(void **state)
{
	for (unsigned lost = 0; lost < SET; lost++) {
		begin(state);
		assert_int_equal(feed_measured(7, 1), 0);
		for (unsigned i = 0; i < SET; i++)
			if (i != lost)
				assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + i), 1000 + i), 0);
		assert_false(told_whole(&told, 7));
		assert_false(filled(7, SET_CRC32).parameters_known);
		assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + lost), 1001 + lost), 0);
		assert_true(told_whole(&told, 7));
		assert_false(filled(7, SET_CRC32).parameters_known);
		assert_int_equal(feed_parameter(7, (uint16_t)(0x2000 + lost), 1000 + lost), 0);
		assert_true(filled(7, SET_CRC32).parameters_known);
	}
}

static void another_set_is_none(void **state)
{
	(void)state;
	feed_set(7);
	assert_false(told_whole(&told, 7)); /* nothing measured */
	assert_false(filled(7, SET_CRC32).measured_known);
	assert_true(filled(7, SET_CRC32).parameters_known);
	assert_false(filled(7, SET_CRC32 ^ 1).parameters_known);
	assert_int_equal(filled(7, SET_CRC32 ^ 1).parameters[0], 0);
}

static void of_another_drop(void **state)
{
	(void)state;
	assert_int_equal(feed_measured(7, 8000), 0);
	feed_set(7);
	assert_false(filled(8, SET_CRC32).parameters_known);
	assert_false(filled(8, SET_CRC32).measured_known);
	assert_int_equal(feed_parameter(8, 0x2000, 1000), 0); /* the next one's: what was is forgotten */
	assert_false(told_whole(&told, 7));
	assert_false(filled(8, SET_CRC32).parameters_known);
	feed_set(8);
	assert_false(told_whole(&told, 8));
	assert_int_equal(feed_measured(8, 8001), 0);
	assert_true(told_whole(&told, 8));
	assert_int_equal(filled(8, SET_CRC32).measured.dropout_us, 8001);
	assert_int_equal(feed_measured(9, 8002), 0);
	assert_false(filled(9, SET_CRC32).parameters_known);
	assert_true(filled(9, SET_CRC32).measured_known);
}

/* An index that is no parameter's, or beyond the table. */
static void what_is_no_parameter(void **state)
{
	(void)state;
	for (uint32_t index = 0; index <= UINT16_MAX; index++)
		if (index < 0x2000 || index >= 0x2000 + SET)
			assert_int_equal(feed_parameter(7, (uint16_t)index, 5), 0);
	assert_int_equal(told.parameters_held, 0);
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
	assert_int_equal(told.drop_id, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(all_of_it, begin),
	        cmocka_unit_test_setup(any_that_lacks, begin),
	        cmocka_unit_test_setup(another_set_is_none, begin),
	        cmocka_unit_test_setup(of_another_drop, begin),
	        cmocka_unit_test_setup(what_is_no_parameter, begin),
	        cmocka_unit_test_setup(damaged, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
