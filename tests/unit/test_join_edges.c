/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The join at its limits: each case stands one tick, one byte or one frame on either side of a decision.
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

/* One live block of a tick that has nothing to do with the drop's samples. */
static void feed_at(uint32_t tick_ms)
{
	uint32_t first_ms = drop.first_tick_ms;

	drop.first_tick_ms = tick_ms;
	join_by_hand_feed(1, 0, false);
	drop.first_tick_ms = first_ms;
}

static void heartbeat(uint8_t nmt_state)
{
	struct frame frame = {.id = 0x701, .length = 5, .data = {nmt_state}};

	assert_int_equal(join_feed(join, &frame), 0);
}

static struct record take(void)
{
	struct record record;

	assert_int_equal(join_take(join, &record), 0);
	return record;
}

/* The record has exactly these ticks and lacks this many blocks of them. */
static void take_ticks(uint32_t first_ms, uint32_t last_ms, unsigned blocks)
{
	struct record record = take();

	assert_int_equal(record.first_tick_ms, first_ms);
	assert_int_equal(record.last_tick_ms, last_ms);
	assert_int_equal(record.counters.blocks, blocks);
	record_free(&record);
}

static void first_gap(unsigned sensor, uint32_t first_ms, uint32_t last_ms)
{
	struct record_gap gap = {0};

	assert_true(join_next_gap(join, 0, 0, UINT32_MAX, &gap));
	assert_int_equal(gap.sensor, sensor);
	assert_int_equal(gap.first_tick_ms, first_ms);
	assert_int_equal(gap.last_tick_ms, last_ms);
}

/* What memory holds behind a frame's data is none of it. */
static void nothing_behind_the_data_tells_a_conflict(void **state)
{
	struct record record;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 1000, 1, 1);
	join_by_hand_feed_both(0, 0);
	hand_block(&drop, 2, 0, false, &frame);
	memset((uint8_t *)&frame + offsetof(struct frame, data) + sizeof(frame.data), 0xA5,
	       sizeof(frame) - offsetof(struct frame, data) - sizeof(frame.data));
	join_feed(join, &frame);
	join_by_hand_feed_end();
	record = take();
	assert_int_equal(record.counters.repeated, 1);
	assert_int_equal(record.counters.conflicting, 0);
	record_free(&record);
}

static void every_sample_byte_tells_a_conflict(void **state)
{
	struct record record;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 1000, 10, 1);
	join_by_hand_feed_both(0, 9);
	for (unsigned byte = 0; byte < 64; byte++) {
		if (byte >= 2 && byte < 6)
			continue; /* the tick: another block */
		if (byte == 9)
			continue; /* the CRC-8 itself */
		hand_block(&drop, 2, 4, false, &frame);
		frame.data[byte] ^= 0x40;
		frame.data[9] = hand_crc8(frame.data, 64, 9);
		join_feed(join, &frame);
	}
	join_by_hand_feed_end();
	record = take();
	assert_int_equal(record.counters.repeated, 59);
	assert_int_equal(record.counters.conflicting, 54);
	record_free(&record);
}

/* The ring is 2 048 ticks: a resent block of newest - 2 047 has its place, one tick older has none, and does
 * not take that of the newest. */
static void the_oldest_tick_of_the_ring(void **state)
{
	(void)state;
	hand_fill(&drop, 5000, 1, 2);
	join_by_hand_feed_both(0, 0);
	drop.first_tick_ms = 5000 - 2048;
	join_by_hand_feed(1, 0, true);
	drop.first_tick_ms = 5000;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_true(join_complete(join));
	take_ticks(5000, 5000, 2);
	drop.first_tick_ms = 5000 - 2047;
	join_by_hand_feed(1, 0, true);
	assert_int_equal(join_by_hand_feed_end(), 1);
	take_ticks(5000 - 2047, 5000 - 2047, 1);
}

/* A live block 100 ticks behind was overtaken, one 101 behind comes from a tower that started again. */
static void overtaken_or_started_again(void **state)
{
	struct record record;

	(void)state;
	for (unsigned again = 0; again < 2; again++) {
		hand_fill(&drop, 1000, 20, 3);
		join_by_hand_feed_both(0, 9);
		join_by_hand_feed(2, 10, false);
		join_by_hand_feed_both(11, 19);
		feed_at(1110 + again);
		join_by_hand_feed(1, 10, false);
		join_by_hand_feed_end();
		assert_int_equal(join_complete(join), !again);
		record = take();
		assert_int_equal(record.counters.blocks, again ? 1 : 40);
		assert_int_equal(record.counters.reordered, again ? 0 : 1);
		record_free(&record);
		heartbeat(0);
	}
}

/* The last block of the window may be overtaken by live blocks after the capture end. */
static void a_live_block_after_the_capture_end(void **state)
{
	(void)state;
	hand_fill(&drop, 1000, 20, 4);
	join_by_hand_feed_both(0, 18);
	join_by_hand_feed(1, 19, false);
	join_by_hand_feed_end();
	feed_at(1119);
	join_by_hand_feed(2, 19, false);
	assert_true(join_complete(join));
}

/* The tick after the window, and the one before it, are nobody's. */
static void neighbours_stay_out_of_the_window(void **state)
{
	(void)state;
	hand_fill(&drop, 1000, 20, 5);
	join_by_hand_feed_both(1, 18);
	join_by_hand_feed(1, 0, false);
	join_by_hand_feed(2, 19, false);
	join_by_hand_feed_end();
	feed_at(1020);
	feed_at(1021);
	feed_at(999);
	first_gap(1, 1019, 1019);
	join_by_hand_feed(1, 19, true);
	join_by_hand_feed(2, 0, true);
	assert_true(join_complete(join));
}

/* 49.7 days later the ticks come by the window again: live blocks are not of it, resent ones are. */
static void ticks_come_round(void **state)
{
	(void)state;
	hand_fill(&drop, 1000, 20, 6);
	join_by_hand_feed_both(0, 18);
	join_by_hand_feed_end();
	feed_at(1000 + 0x40000000);
	feed_at(1000 + 0x80000000);
	feed_at(1000 + 0xC0000000);
	feed_at(990);
	join_by_hand_feed(1, 19, false);
	join_by_hand_feed(2, 19, false);
	first_gap(1, 1019, 1019);
	join_by_hand_feed(1, 19, true);
	join_by_hand_feed(2, 19, true);
	assert_true(join_complete(join));
}

/* That a window is over is seen by a live block more than 100 ticks after it, no sooner: seen here half a
 * round of the ticks later, when they no longer compare as later. */
static void live_blocks_belong_to_a_window_for_100_ticks(void **state)
{
	(void)state;
	for (uint32_t after = 100; after <= 101; after++) {
		hand_fill(&drop, 1000, 20, 7);
		drop.drop_id = (uint16_t)after;
		join_by_hand_feed_both(0, 18);
		join_by_hand_feed(2, 19, false);
		join_by_hand_feed_end();
		feed_at(1019 + after);
		feed_at(1019 + 0x80000000 + 50);
		feed_at(1019 + 0xC0000000);
		feed_at(990);
		join_by_hand_feed(1, 19, false);
		assert_int_equal(join_complete(join), after == 100);
		heartbeat(0);
	}
}

static void a_restart_between_capture_end_and_blocks(void **state)
{
	(void)state;
	hand_fill(&drop, 3000, 1, 8);
	join_by_hand_feed_both(0, 0);
	heartbeat(0);
	hand_fill(&drop, 1000, 20, 9);
	assert_int_equal(join_by_hand_feed_end(), 1);
	join_by_hand_feed_both(0, 19); /* far behind what was the newest, but that was before the restart */
	assert_true(join_complete(join));
	assert_int_equal(join_by_hand_feed_end(), 0);
}

static void nothing_is_held_after_a_restart(void **state)
{
	(void)state;
	heartbeat(0);
	hand_fill(&drop, 0x01010101 - 10, 20, 10); /* bytes that a careless clearing would leave */
	assert_int_equal(join_by_hand_feed_end(), 1);
	first_gap(1, drop.first_tick_ms, drop.first_tick_ms + 19);
}

static void heartbeats_of_a_running_tower(void **state)
{
	struct frame frame = {.id = 0x701, .length = 4};

	(void)state;
	hand_fill(&drop, 1000, 20, 11);
	join_by_hand_feed_both(0, 9);
	heartbeat(5);
	heartbeat(127);
	assert_int_equal(join_feed(join, &frame), 0); /* too short to mean anything */
	frame = (struct frame){.id = 0x481, .length = 5};
	assert_int_equal(join_feed(join, &frame), 0); /* a damaged block, not a boot-up */
	join_by_hand_feed_both(10, 19);
	join_by_hand_feed_end();
	assert_true(join_complete(join));
	{
		struct record record = take();

		assert_int_equal(record.counters.corrupt, 1);
		record_free(&record);
	}
}

static void lengths_of_a_window(void **state)
{
	static const struct {
		uint32_t ticks;
		int taken;
	} cases[] = {{0, 0}, {1, 1}, {2, 1}, {2047, 1}, {2048, 1}, {2049, 0}};
	struct frame frame;

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		uint32_t last_ms = 10000 + cases[i].ticks - 1;

		hand_fill(&drop, 10000, 1, 12);
		drop.drop_id = (uint16_t)(100 + i);
		hand_capture_end(&drop, &frame);
		for (unsigned k = 0; k < 4; k++)
			frame.data[8 + k] = (uint8_t)(last_ms >> 8 * k);
		hand_seal(&frame);
		assert_int_equal(join_feed(join, &frame), cases[i].taken);
	}
}

/* Each of the three that tell one capture from another. */
static void ends_that_are_news(void **state)
{
	(void)state;
	hand_fill(&drop, 1000, 20, 13);
	drop.drop_id = 3;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_by_hand_feed_end(), 0);
	drop.drop_id = 4;
	assert_int_equal(join_by_hand_feed_end(), 1);
	drop.ticks = 21;
	assert_int_equal(join_by_hand_feed_end(), 1);
	drop.first_tick_ms = 1001;
	drop.ticks = 20;
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_by_hand_feed_end(), 0);
}

static void what_was_taken_is_gone(void **state)
{
	struct record record;
	struct record_gap gap;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 1000, 20, 14);
	join_by_hand_feed_both(0, 19);
	hand_block(&drop, 1, 0, false, &frame);
	frame.data[30] ^= 1;
	join_feed(join, &frame);
	frame = (struct frame){.id = 0x381, .length = 8, .data = {1}}; /* a segment without the one before */
	join_feed(join, &frame);
	join_by_hand_feed_end();
	assert_true(join_complete(join));
	record = take();
	assert_int_equal(record.counters.corrupt, 2);
	record_free(&record);
	assert_false(join_complete(join));
	drop.drop_id++;
	join_by_hand_feed_end();
	record = take();
	assert_int_equal(record.counters.corrupt, 0); /* counted since the last take */
	record_free(&record);
	drop.first_tick_ms += 10;
	drop.drop_id++;
	join_by_hand_feed_end();
	first_gap(1, 1020, 1029);
	record = take();
	record_free(&record);
	assert_false(join_next_gap(join, 0, 0, 100, &gap));
}

/* Each bit of the capture end is under its seal. */
static void an_altered_end_is_no_end(void **state)
{
	struct frame frame;

	(void)state;
	hand_fill(&drop, 1000, 20, 16);
	join_by_hand_feed_both(0, 19);
	for (unsigned bit = 0; bit < 32 * 8; bit++) {
		hand_capture_end(&drop, &frame);
		frame.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
		assert_int_equal(join_feed(join, &frame), 0);
		assert_false(join_is_news(join, &frame));
	}
	assert_false(join_has_capture(join));
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_true(join_complete(join));
	for (unsigned i = 0; i <= HAND_PARAMETERS; i++) {
		assert_false(join_told(join));
		hand_told(&drop, i, &frame);
		assert_int_equal(join_feed(join, &frame), 0);
	}
	assert_true(join_told(join));
}

static void the_longest_window(void **state)
{
	struct frame frame;

	(void)state;
	for (uint32_t half = 0; half < 2; half++) {
		hand_fill(&drop, 20000 + 1024 * half, 1024, 15 + half);
		join_by_hand_feed_both(0, 1022);
	}
	drop.first_tick_ms = 20000;
	hand_capture_end(&drop, &frame);
	frame.data[8] = (20000 + 2047) & 0xFF;
	frame.data[9] = (20000 + 2047) >> 8;
	hand_seal(&frame);
	assert_int_equal(join_feed(join, &frame), 1);
	first_gap(1, 21023, 21023);
	take_ticks(20000, 22047, 4092);
	frame.data[0]++; /* another drop, of the same ticks */
	hand_seal(&frame);
	assert_int_equal(join_feed(join, &frame), 1);
	join_forget(join);
	first_gap(1, 20000, 22047);
}

static void the_end_says_which_drop(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 20, 17);
	drop.drop_id = 6;
	join_by_hand_feed_both(0, 19);
	drop.drop_id = 7;
	drop.marks = 1; /* SLOW_FRAME: the trigger stands */
	drop.trigger_us = 5123;
	join_by_hand_feed_end();
	record = take();
	assert_int_equal(record.drop_id, 7);
	assert_int_equal(record.marks, 1);
	assert_true(record.trigger_s == 0.005123);
	record_free(&record);
}

/* ---- no capture end ---- */

static void a_run_of_one_tick(void **state)
{
	(void)state;
	hand_fill(&drop, 3000, 1, 18);
	join_by_hand_feed(1, 0, false);
	take_ticks(3000, 3000, 1);
}

static void a_run_that_began_soon_after_boot(void **state)
{
	(void)state;
	hand_fill(&drop, 50, 31, 19);
	join_by_hand_feed_both(0, 30);
	take_ticks(50, 80, 62);
}

static void a_run_of_one_sensor(void **state)
{
	(void)state;
	for (unsigned sensor = 1; sensor <= 2; sensor++) {
		hand_fill(&drop, 4099, 31, 20);
		for (uint32_t tick = 0; tick < 31; tick++)
			join_by_hand_feed(sensor, tick, false);
		take_ticks(4099, 4129, 31);
	}
}

static void a_run_as_long_as_the_ring(void **state)
{
	(void)state;
	for (uint32_t part = 0; part < 3; part++) {
		hand_fill(&drop, 30000 + 1000 * part, 1000, 21 + part);
		join_by_hand_feed_both(0, 999);
	}
	take_ticks(30952, 32999, 4096);
}

/* Slots that still hold a tick of 2 048 before are no part of the run. */
static void a_run_over_old_slots(void **state)
{
	(void)state;
	for (unsigned sensor = 0; sensor <= 2; sensor++) { /* 0: both */
		hand_fill(&drop, 1000, 60, 22);
		for (uint32_t tick = 0; tick < 60; tick++)
			for (unsigned s = 1; s <= 2; s++)
				if (sensor == 0 || s == sensor)
					join_by_hand_feed(s, tick, false);
		hand_fill(&drop, 3100, 41, 23);
		join_by_hand_feed_both(0, 40);
		take_ticks(3100, 3140, 82);
	}
}

/* Two runs 100 ticks apart are one with a hole, 101 apart are two, and the first of equals is taken. */
static void runs_and_holes(void **state)
{
	(void)state;
	hand_fill(&drop, 1000, 200, 24);
	join_by_hand_feed_both(0, 30);
	join_by_hand_feed_both(130, 160);
	take_ticks(1000, 1160, 124);
	join_by_hand_feed_both(0, 30);
	join_by_hand_feed_both(131, 161);
	take_ticks(1000, 1030, 62);
	join_by_hand_feed_both(0, 30);
	join_by_hand_feed_both(131, 160);
	take_ticks(1000, 1030, 62);
	join_by_hand_feed_both(0, 30);
	join_by_hand_feed_both(131, 162);
	take_ticks(1131, 1162, 64);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, join_by_hand_begin, join_by_hand_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(nothing_behind_the_data_tells_a_conflict),
	        TEST(every_sample_byte_tells_a_conflict),
	        TEST(the_oldest_tick_of_the_ring),
	        TEST(overtaken_or_started_again),
	        TEST(a_live_block_after_the_capture_end),
	        TEST(neighbours_stay_out_of_the_window),
	        TEST(ticks_come_round),
	        TEST(live_blocks_belong_to_a_window_for_100_ticks),
	        TEST(a_restart_between_capture_end_and_blocks),
	        TEST(nothing_is_held_after_a_restart),
	        TEST(heartbeats_of_a_running_tower),
	        TEST(lengths_of_a_window),
	        TEST(ends_that_are_news),
	        TEST(what_was_taken_is_gone),
	        TEST(an_altered_end_is_no_end),
	        TEST(the_longest_window),
	        TEST(the_end_says_which_drop),
	        TEST(a_run_of_one_tick),
	        TEST(a_run_that_began_soon_after_boot),
	        TEST(a_run_of_one_sensor),
	        TEST(a_run_as_long_as_the_ring),
	        TEST(a_run_over_old_slots),
	        TEST(runs_and_holes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
