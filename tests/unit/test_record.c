/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "common/wire.h"
#include "host/record/record.h"

static void test_a_new_channel_is_all_lost(void **state)
{
	struct record record;
	struct channel *channel;

	(void)state;
	record_init(&record);
	assert_true(isnan(record.trigger_s) && isnan(record.frame_speed_m_s));
	channel =
	        record_add_channel(&record, "a name that is much longer than a channel has room for", 10, 3);
	assert_non_null(channel);
	assert_string_equal(channel->name, "a name that is much longer than");
	assert_int_equal(channel->count, 3);
	for (int k = 0; k < 3; k++) {
		assert_int_equal(channel->sample[k], SAMPLE_LOST);
		assert_true(isnan(channel->value_g[k]));
	}
	assert_non_null(record_add_channel(&record, "empty", 10, 0));
	record_finish(&record);
	assert_int_equal(record.lost_samples, 3);
	assert_int_equal(record.flags, RECORD_FLAG_LOST);
	assert_ptr_equal(record_channel(&record, "empty"), &record.channels[1]);
	assert_null(record_channel(&record, "none"));
	record_free(&record);
	assert_int_equal(record.channel_count, 0);
}

static void set(struct channel *channel, size_t k, double value_g, uint8_t sample)
{
	channel->value_g[k] = value_g;
	channel->sample[k] = sample;
}

static void test_flags_follow_from_samples(void **state)
{
	struct record record;
	struct channel *channel;

	(void)state;
	record_init(&record);
	channel = record_add_channel(&record, "a", 10, 3);
	set(channel, 0, 1, 0);
	set(channel, 1, NAN, SAMPLE_BAD);
	set(channel, 2, 600, SAMPLE_CLIPPED);
	channel->flags = RECORD_FLAG_UNEVEN | RECORD_FLAG_LOST; /* only the reader knows the first */
	channel = record_add_channel(&record, "b", 10, 1);
	set(channel, 0, 2000, 0); /* full scale means nothing on somebody else's sensor */
	record_finish(&record);
	assert_int_equal(record.channels[0].flags,
	                 RECORD_FLAG_BAD | RECORD_FLAG_CLIPPED | RECORD_FLAG_UNEVEN);
	assert_int_equal(record.channels[1].flags, 0);
	assert_int_equal(record.flags, record.channels[0].flags);
	assert_int_equal(record.lost_samples, 0);
	record_finish(&record); /* once more changes nothing */
	assert_int_equal(record.flags, record.channels[0].flags);
	record_free(&record);
}

static unsigned flags_of(unsigned marks, bool known, bool agrees)
{
	struct record record;

	record_init(&record);
	record.is_drop = true;
	record.marks = (uint16_t)marks;
	record.crc_known = known;
	record.crc_agrees = agrees;
	record_finish(&record);
	return record.flags;
}

static void test_flags_follow_from_the_drop(void **state)
{
	(void)state;
	assert_int_equal(flags_of(0, true, true), 0);
	assert_int_equal(flags_of(0, true, false), RECORD_FLAG_INCOMPLETE);
	assert_int_equal(flags_of(0, false, false), RECORD_FLAG_NO_CRC);
	assert_int_equal(flags_of(WIRE_MARK_SLOW_FRAME, true, true), RECORD_FLAG_SLOW_FRAME);
	assert_int_equal(flags_of(WIRE_MARK_NO_IMPACT, true, true), RECORD_FLAG_NO_IMPACT);
	assert_int_equal(flags_of(WIRE_MARK_FAULT, true, true), RECORD_FLAG_FAULT);
	assert_int_equal(flags_of(WIRE_MARK_CLIPPED, true, true), RECORD_FLAG_CLIPPED);
	assert_int_equal(flags_of(WIRE_MARK_OVERRUN, true, true), RECORD_FLAG_OVERRUN);
	assert_int_equal(flags_of(WIRE_MARK_FULL_SCALE, true, true), RECORD_FLAG_FULL_SCALE);
	assert_int_equal(flags_of(WIRE_MARK_ZERO_SHIFT, true, true), RECORD_FLAG_ZERO_SHIFT);
	assert_int_equal(flags_of(WIRE_MARK_CABLE, true, true), RECORD_FLAG_CABLE);
	assert_int_equal(flags_of(WIRE_MARK_STUCK, true, true), RECORD_FLAG_STUCK);
}

static void test_names(void **state)
{
	static const struct {
		unsigned flag;
		const char *name;
	} table[] = {
	        {RECORD_FLAG_LOST, "lost_samples"},
	        {RECORD_FLAG_BAD, "bad_samples"},
	        {RECORD_FLAG_CLIPPED, "clipped"},
	        {RECORD_FLAG_INCOMPLETE, "incomplete"},
	        {RECORD_FLAG_NO_CRC, "crc_unknown"},
	        {RECORD_FLAG_SLOW_FRAME, "slow_frame"},
	        {RECORD_FLAG_NO_IMPACT, "no_impact"},
	        {RECORD_FLAG_FAULT, "fault"},
	        {RECORD_FLAG_UNEVEN, "uneven_sampling"},
	        {RECORD_FLAG_FULL_SCALE, "full_scale"},
	        {RECORD_FLAG_OVERRUN, "overrun"},
	        {RECORD_FLAG_ZERO_SHIFT, "zero_shift"},
	        {RECORD_FLAG_CABLE, "cable"},
	        {RECORD_FLAG_STUCK, "stuck"},
	        {RECORD_FLAG_SPIKE, "spike"},
	        {RECORD_FLAG_ZEROED, "zeroed"},
	        {RECORD_FLAG_OFFSET, "offset"},
	        {RECORD_FLAG_DRIFT, "drift"},
	        {RECORD_FLAG_HUM, "hum"},
	        {RECORD_FLAG_SHORT, "too_short"},
	        {RECORD_FLAG_ZERO_UNSURE, "zero_unsure"},
	        {RECORD_FLAG_UNFILTERED, "unfiltered"},
	        {RECORD_FLAG_NO_LINE_END, "no_line_end"},
	        {RECORD_FLAG_SAME_NAMES, "same_names"},
	        {RECORD_FLAG_SETTLING, "settling"},
	        {0, ""},
	        {RECORD_FLAG_ASSUMED, "assumed"},
	        {RECORD_FLAG_OVERDUE, "overdue"},
	        {RECORD_FLAG_DEFAULT_USED, "default_used"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++)
		assert_string_equal(record_flag_name(table[i].flag), table[i].name);
	assert_string_equal(record_flag_name(RECORD_FLAG_FAULT | RECORD_FLAG_CLIPPED), "clipped");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_new_channel_is_all_lost),
	        cmocka_unit_test(test_flags_follow_from_samples),
	        cmocka_unit_test(test_flags_follow_from_the_drop),
	        cmocka_unit_test(test_names),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
