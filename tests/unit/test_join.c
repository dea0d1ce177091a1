/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * One drop: its samples, marks and times, by FD, classic CAN or without an end.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "host/record/join.h"
#include "tests/unit/join_by_hand.h"

static void test_a_lossless_drop(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 5000, 500, 1);
	assert_int_equal(join_take(join, &record), DT_E_EMPTY);
	join_by_hand_feed_both(0, 499);
	assert_false(join_has_capture(join));
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_true(join_has_capture(join) && join_complete(join));
	assert_int_equal(join_crc32(join), hand_drop_crc32(&drop));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 1000});
	assert_true(record.crc_known && record.crc_agrees);
	assert_int_equal(record.crc32, hand_drop_crc32(&drop));
	assert_true(record.trigger_s == 0.100123);
	assert_true(record.frame_speed_m_s == 3.912);
	assert_int_equal(record.camera_frame, 341);
	assert_true(record.channels[0].range_g == 500);
	assert_int_equal(record.lost_samples, 0);
	assert_int_equal(record.flags, 0);
	assert_int_equal(record.gap_count, 0);
	record_free(&record);
	assert_false(join_has_capture(join));
}

static void test_classic_upload(void **state)
{
	struct record record;
	struct record_gap gap;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 5000, 300, 9);
	hand_capture_end(&drop, &frame);
	assert_int_equal(join_by_hand_feed_segments(&frame, 2), 0);
	assert_int_equal(join_by_hand_feed_segments(&frame, 99), 1);
	for (unsigned sensor = 1; sensor <= 2; sensor++)
		for (uint32_t tick = 0; tick < 300; tick++) {
			hand_block(&drop, sensor, tick, true, &frame);
			join_by_hand_feed_segments(&frame, sensor == 2 && tick == 77 ? 4 : 99);
		}
	assert_false(join_complete(join));
	assert_true(join_next_gap(join, 0, 0, 32, &gap));
	assert_int_equal(gap.sensor, 2);
	assert_int_equal(gap.first_tick_ms, 5077);
	assert_int_equal(gap.last_tick_ms, 5077);
	hand_block(&drop, 2, 77, true, &frame);
	join_by_hand_feed_segments(&frame, 99);
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(
	        &record, (struct record_counters){.blocks = 600, .resent = 600, .corrupt = 2, .gaps = 2});
	assert_int_equal(record.camera_frame, 341);
	record_free(&record);
}

static void test_marks_and_marked_samples(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 100, 20, 2);
	drop.marks = 1u << 1 | 1u << 3; /* NO_IMPACT, CLIPPED */
	drop.frame_speed_mm_s = 0;
	drop.sample[0][3][0] = -32768; /* S1X not taken */
	drop.sample[0][4][7] = 16001;  /* S1Y beyond the range, but not 16000 */
	drop.sample[0][4][8] = 16000;
	drop.sample[1][19][26] = -32767; /* the last of S2Z, full scale */
	join_by_hand_feed_both(0, 19);
	join_by_hand_feed_end();
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	assert_true(isnan(record.trigger_s) && isnan(record.frame_speed_m_s));
	assert_int_equal(record.channels[0].flags, RECORD_FLAG_BAD);
	assert_int_equal(record.channels[1].flags, RECORD_FLAG_CLIPPED);
	assert_int_equal(record.channels[2].flags, 0);
	assert_int_equal(record.channels[5].flags, RECORD_FLAG_CLIPPED | RECORD_FLAG_FULL_SCALE);
	assert_int_equal(record.flags, RECORD_FLAG_BAD | RECORD_FLAG_CLIPPED | RECORD_FLAG_FULL_SCALE |
	                                       RECORD_FLAG_NO_IMPACT);
	record_free(&record);
}

static void test_ticks_wrap(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, UINT32_MAX - 20, 100, 14);
	for (uint32_t tick = 0; tick < 100; tick++)
		if (tick < 15 || tick > 30)
			join_by_hand_feed(1, tick, false), join_by_hand_feed(2, tick, false);
	assert_int_equal(join_by_hand_feed_end(), 1);
	join_by_hand_check_next(0, 0, 100, (struct record_gap){1, UINT32_MAX - 5, 9});
	assert_int_equal(join_by_hand_serve_gaps(10), 32);
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.counters.reordered, 0);
	assert_int_equal(record.counters.gaps, 2);
	record_free(&record);
}

static void test_without_a_capture_end(void **state)
{
	static bool held[2][HAND_TICKS_MAX];
	struct record record;

	(void)state;
	hand_fill(&drop, 500, 10, 15); /* a shorter run, a hole, and the longer one */
	join_by_hand_feed_both(0, 9);
	hand_fill(&drop, 700, 300, 16);
	for (uint32_t tick = 0; tick < 300; tick++) {
		held[0][tick] = tick < 100 || tick >= 150;
		held[1][tick] = tick < 100 || tick >= 160;
		for (unsigned s = 0; s < 2; s++)
			if (held[s][tick])
				join_by_hand_feed(s + 1, tick, false);
	}
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, held);
	join_by_hand_check_gap_list(&record, held);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 490, .gaps = 2});
	assert_false(record.crc_known || record.crc_agrees);
	assert_true(isnan(record.trigger_s) && isnan(record.frame_speed_m_s));
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_NO_CRC);
	record_free(&record);
	assert_int_equal(join_take(join, &record), DT_E_EMPTY);
}

static void test_other_frames(void **state)
{
	struct frame frame;
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 17);
	join_by_hand_feed_both(0, 49);
	for (unsigned flag = FRAME_EXTENDED; flag <= FRAME_ERROR; flag <<= 1) {
		hand_block(&drop, 1, 0, false, &frame);
		frame.flags |= (uint8_t)flag;
		frame.data[50] ^= 1; /* would be corrupt */
		assert_int_equal(join_feed(join, &frame), 0);
		hand_capture_end(&drop, &frame);
		frame.flags |= (uint8_t)flag;
		assert_int_equal(join_feed(join, &frame), 0);
	}
	frame = (struct frame){.id = 0x123, .length = 8};
	assert_int_equal(join_feed(join, &frame), 0);
	hand_block(&drop, 1, 0, false, &frame);
	frame.length = 48; /* corrupt */
	assert_int_equal(join_feed(join, &frame), 0);
	join_by_hand_feed_end();
	record = join_by_hand_take();
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 100, .corrupt = 1});
	record_free(&record);
}

static void test_impossible_windows(void **state)
{
	struct frame frame;
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 18);
	join_by_hand_feed_both(0, 49);
	hand_capture_end(&drop, &frame);
	frame.data[9] = 0x40; /* last tick: 16 s away */
	assert_int_equal(join_feed(join, &frame), 0);
	memset(frame.data + 8, 0, 4); /* last before first */
	assert_int_equal(join_feed(join, &frame), 0);
	hand_capture_end(&drop, &frame);
	frame.length = 20;
	assert_int_equal(join_feed(join, &frame), 0);
	assert_false(join_has_capture(join));
	assert_int_equal(join_by_hand_feed_end(), 1);
	record = join_by_hand_take();
	assert_int_equal(record.counters.corrupt, 3);
	record_free(&record);
}

static void test_a_capture_without_a_block(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 19);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_take(join, &record), DT_E_EMPTY);
	assert_int_equal(join_by_hand_serve_gaps(64),
	                 100); /* the host came late: all of it can still be had */
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	record_free(&record);
}

/* What is known of a capture without its samples is what its record says. */
static void test_skipped_is_as_taken(void **state)
{
	struct log_capture taken = {0}, skipped = {0};
	struct record record;

	(void)state;
	for (unsigned round = 0; round < 4; round++) {
		bool losses = round & 1u, ended = round < 2;

		for (unsigned skip = 0; skip < 2; skip++) {
			struct frame boot = {.id = 0x701, .length = 5};

			hand_fill(&drop, 5000, 200, 40 + round);
			drop.drop_id = (uint16_t)(300 + round);
			drop.marks = 5;
			join_feed(join, &boot);
			join_by_hand_feed_both(0, 99);
			join_by_hand_feed_both(losses ? 120 : 100, 199);
			join_by_hand_feed_both(150, 151); /* again */
			if (ended)
				assert_int_equal(join_by_hand_feed_end(), 1);
			if (skip) {
				assert_int_equal(join_skip(join, &skipped), 0);
			} else {
				assert_int_equal(join_take(join, &record), 0);
				log_capture_of_record(&record, &taken);
				record_free(&record);
			}
			assert_false(join_has_capture(join));
		}
		assert_true(log_capture_equal(&taken, &skipped));
		assert_int_equal(skipped.ended, ended);
		assert_int_equal(skipped.drop_id, 300 + round);
		assert_int_equal(skipped.marks, ended ? 5 : 0);
		assert_int_equal(skipped.crc_agrees, ended && !losses);
		assert_int_equal(log_capture_missing(&skipped), losses ? 40 : 0);
		assert_int_equal(skipped.counters.corrupt, taken.counters.corrupt);
		assert_int_equal(skipped.counters.repeated, 4);
		skipped.counters.resent++;
		assert_false(log_capture_equal(&taken, &skipped));
	}
	assert_int_equal(join_skip(join, &skipped), DT_E_EMPTY);
	/* the CRC-32 that agreed was another capture's */
	hand_fill(&drop, 7000, 60, 45);
	join_by_hand_feed_both(0, 59);
	drop.ticks = 50;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_skip(join, &skipped), 0);
	assert_true(skipped.crc_agrees);
	assert_int_equal(join_skip(join, &skipped), 0);
	assert_int_equal(skipped.counters.blocks, 20);
	assert_false(skipped.crc_agrees);
	/* a capture end without a block */
	hand_fill(&drop, 90000, 50, 47);
	drop.drop_id = 999;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_skip(join, &skipped), 0);
	assert_int_equal(skipped.drop_id, 999);
	assert_int_equal(log_capture_missing(&skipped), 100);
}

/* What is told of the capture and of the stream without taking anything. */
static void test_what_the_join_has(void **state)
{
	struct record record;
	uint32_t tick_ms = 77;
	uint64_t touched;

	(void)state;
	hand_fill(&drop, 5000, 60, 46);
	assert_false(join_newest(join, &tick_ms));
	assert_int_equal(tick_ms, 77);
	join_by_hand_feed_both(0, 48);
	assert_true(join_newest(join, &tick_ms));
	assert_int_equal(tick_ms, 5048);
	assert_null(join_end(join));
	touched = join_touched(join);
	assert_int_equal(touched, 0);
	drop.ticks = 50;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_end(join)->first_tick_ms, 5000);
	join_by_hand_feed_both(49, 49);
	assert_int_equal(join_touched(join), 2);
	drop.ticks = 60;
	join_by_hand_feed_both(50, 59);
	assert_int_equal(join_touched(join), 2);
	drop.ticks = 50;
	record = join_by_hand_take();
	assert_true(record.crc_agrees);
	record_free(&record);
	assert_null(join_end(join));
	/* what comes behind a capture is a run of its own */
	assert_int_equal(join_take(join, &record), 0);
	assert_int_equal(record.first_tick_ms, 5050);
	assert_int_equal(record.last_tick_ms, 5059);
	assert_false(record.crc_known);
	record_free(&record);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, join_by_hand_begin, join_by_hand_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_skipped_is_as_taken),      TEST(test_what_the_join_has),
	        TEST(test_a_lossless_drop),          TEST(test_classic_upload),
	        TEST(test_marks_and_marked_samples), TEST(test_ticks_wrap),
	        TEST(test_without_a_capture_end),    TEST(test_other_frames),
	        TEST(test_impossible_windows),       TEST(test_a_capture_without_a_block),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
