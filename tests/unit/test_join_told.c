/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The join and what follows a capture end: a log's capture is whole when all of it has come, and is taken
 * before the next one replaces it.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <string.h>

#include "host/record/join.h"
#include "host/record/read.h"
#include "host/record/write.h"
#include "tests/unit/join_by_hand.h"

enum { TICKS = 6, FOLLOW = 1 + WIRE_PARAMETERS, RANGE_COUNTS = 6400 };

static void begin_capture(void)
{
	hand_fill(&drop, 1000, TICKS, 5);
	join_by_hand_feed_both(0, TICKS - 1);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_true(join_complete(join));
}

static void told_when_all_has_come(void **state)
{
	struct record record;
	struct frame frame;

	(void)state;
	for (unsigned i = 0; i < FOLLOW; i++) { /* before its capture end it is of no capture */
		hand_told(&drop, i, &frame);
		assert_int_equal(join_feed(join, &frame), 0);
	}
	assert_false(join_told(join));
	begin_capture();
	for (unsigned i = 0; i < FOLLOW; i++) {
		hand_told(&drop, i, &frame);
		assert_int_equal(join_feed(join, &frame), 0);
	}
	assert_true(join_told(join));
	assert_int_equal(join_take(join, &record), 0);
	assert_true(record.measured_known);
	assert_true(record.parameters_known);
	assert_true(record.seal_known);
	assert_int_equal(record.counters.corrupt, 0);
	record_free(&record);
	assert_false(join_told(join));
}

/* A drop of a smaller range, with three samples about it; all: its parameters have come, too. */
static void take_ranged(bool all, struct record *record)
{
	struct frame frame;

	hand_fill(&drop, 1000, TICKS, 5);
	memset(drop.sample, 0, sizeof(drop.sample));
	drop.range_counts = RANGE_COUNTS;
	drop.sample[1][2][4] = RANGE_COUNTS;
	drop.sample[1][2][5] = RANGE_COUNTS + 1;
	drop.sample[1][2][6] = -RANGE_COUNTS - 1;
	join_forget_run(join);
	join_by_hand_feed_both(0, TICKS - 1);
	assert_int_equal(join_by_hand_feed_end(), 1);
	for (unsigned i = 0; i < (all ? FOLLOW : FOLLOW - 1); i++) {
		hand_told(&drop, i, &frame);
		assert_int_equal(join_feed(join, &frame), 0);
	}
	assert_int_equal(join_take(join, record), 0);
}

/* The set comes behind the samples, and says from where on they are marked. */
static void range_is_the_parameters(void **state)
{
	struct record record;

	(void)state;
	for (unsigned all = 0; all < 2; all++) {
		take_ranged(all, &record);
		assert_true(record.channels[3].range_g == (all ? RANGE_COUNTS / 32.0 : 500));
		assert_int_equal(record.channels[3].sample[2 * 7 + 4], 0);
		assert_int_equal(record.channels[3].sample[2 * 7 + 5], all ? SAMPLE_CLIPPED : 0);
		assert_int_equal(record.channels[3].sample[2 * 7 + 6], all ? SAMPLE_CLIPPED : 0);
		assert_int_equal(record.flags & RECORD_FLAG_CLIPPED, all ? RECORD_FLAG_CLIPPED : 0);
		record_free(&record);
	}
}

/* Files once had the tower's own range whatever the parameters said, and marks by that. */
static void an_older_file_is_put_right(void **state)
{
	static const char *const ending[] = {".csv", ".unv"};

	(void)state;
	for (unsigned k = 0; k < 2; k++) {
		char message[READ_MESSAGE_MAX] = "", *file = hand_file(ending[k], "", 0);
		struct record record, again;

		take_ranged(true, &record);
		for (size_t i = 0; i < record.channel_count; i++)
			record.channels[i].range_g = 500;
		record.channels[3].sample[2 * 7 + 5] = record.channels[3].sample[2 * 7 + 6] = 0;
		assert_int_equal(write_record(&record, file, message), 0);
		if (read_record(&again, file, NULL, message) != 0)
			fail_msg("%s", message);
		assert_true(again.channels[3].range_g == RANGE_COUNTS / 32.0);
		assert_int_equal(again.channels[3].sample[2 * 7 + 4], 0);
		assert_int_equal(again.channels[3].sample[2 * 7 + 5], SAMPLE_CLIPPED);
		assert_int_equal(again.channels[3].sample[2 * 7 + 6], SAMPLE_CLIPPED);
		assert_true(again.crc_agrees && again.parameters_known);
		record_free(&again);
		record_free(&record);
		hand_unlink(file);
	}
}

static void damage_is_counted(void **state)
{
	struct record record;
	struct frame frame;

	(void)state;
	begin_capture();
	hand_told(&drop, 0, &frame);
	frame.data[2] ^= 1;
	assert_int_equal(join_feed(join, &frame), 0);
	for (unsigned i = 1; i < FOLLOW; i++) {
		hand_told(&drop, i, &frame);
		assert_int_equal(join_feed(join, &frame), 0);
	}
	assert_false(join_told(join));
	hand_capture_end(&drop, &frame); /* and a capture end whose seal does not agree */
	frame.data[4] ^= 1;
	assert_int_equal(join_feed(join, &frame), 0);
	hand_capture_end(&drop, &frame); /* and one of more ticks than any drop has, under its seal */
	frame.data[11] ^= 0x40;
	hand_seal(&frame);
	assert_int_equal(join_feed(join, &frame), 0);
	assert_int_equal(join_take(join, &record), 0);
	assert_false(record.measured_known);
	assert_int_equal(record.counters.corrupt, 3);
	record_free(&record);
}

/* A set with another value: counted, marked, and kept as it came, under whatever way it was read. */
static void an_altered_set_is_marked(void **state)
{
	struct log_capture capture;
	struct record record;
	struct frame frame;

	(void)state;
	for (unsigned altered = 1; altered < FOLLOW; altered++)
		for (unsigned skip = 0; skip < 2; skip++) {
			join_forget_run(join);
			begin_capture();
			for (unsigned i = 0; i < FOLLOW; i++) {
				hand_told(&drop, i, &frame);
				frame.data[4 + altered % 4] ^= (uint8_t)(i == altered ? 0x10 : 0);
				assert_int_equal(join_feed(join, &frame), 0);
			}
			assert_false(join_told(join)); /* it may come again as it was */
			if (skip) {
				assert_int_equal(join_skip(join, &capture), 0);
				assert_true(capture.seal_known);
				assert_false(capture.seal_agrees);
				continue;
			}
			assert_int_equal(join_take(join, &record), 0);
			assert_int_equal(record.flags & RECORD_FLAG_ALTERED, RECORD_FLAG_ALTERED);
			assert_true(record.seal_agrees);
			assert_false(record.parameters_known);
			assert_int_equal(record.parameters_held, 0x1FFFFF);
			assert_int_equal(record.counters.corrupt, 1);
			log_capture_of_record(&record, &capture);
			assert_true(capture.seal_known);
			assert_false(capture.seal_agrees);
			record_free(&record);
		}
}

static void only_another_capture_is_news(void **state)
{
	struct frame end, other;

	(void)state;
	begin_capture();
	hand_capture_end(&drop, &end);
	assert_false(join_is_news(join, &end));
	other = end;
	other.data[0] ^= 1; /* another drop, under its seal */
	hand_seal(&other);
	assert_true(join_is_news(join, &other));
	other.data[1] ^= 1; /* altered */
	assert_false(join_is_news(join, &other));
	hand_seal(&other);
	other.id = 0x680;
	assert_false(join_is_news(join, &other));
	other.id = 0x682;
	assert_false(join_is_news(join, &other));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup_teardown(told_when_all_has_come, join_by_hand_begin, join_by_hand_end),
	        cmocka_unit_test_setup_teardown(range_is_the_parameters, join_by_hand_begin,
	                                        join_by_hand_end),
	        cmocka_unit_test_setup_teardown(an_older_file_is_put_right, join_by_hand_begin,
	                                        join_by_hand_end),
	        cmocka_unit_test_setup_teardown(damage_is_counted, join_by_hand_begin, join_by_hand_end),
	        cmocka_unit_test_setup_teardown(an_altered_set_is_marked, join_by_hand_begin,
	                                        join_by_hand_end),
	        cmocka_unit_test_setup_teardown(only_another_capture_is_news, join_by_hand_begin,
	                                        join_by_hand_end),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
