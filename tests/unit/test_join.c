/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/join.h"
#include "tests/unit/join_by_hand.h"

static struct record take(void)
{
	struct record record;

	assert_int_equal(join_take(join, &record), 0);
	assert_true(record.is_drop);
	assert_string_equal(record.format, "live");
	assert_int_equal(record.first_tick_ms, drop.first_tick_ms);
	assert_int_equal(record.last_tick_ms, drop.first_tick_ms + drop.ticks - 1);
	assert_int_equal(record.drop_id, drop.drop_id);
	return record;
}

static void check_counters(const struct record *record, struct record_counters expected)
{
	assert_int_equal(record->counters.blocks, expected.blocks);
	assert_int_equal(record->counters.repeated, expected.repeated);
	assert_int_equal(record->counters.reordered, expected.reordered);
	assert_int_equal(record->counters.corrupt, expected.corrupt);
	assert_int_equal(record->counters.gaps, expected.gaps);
	assert_int_equal(record->counters.resent, expected.resent);
	assert_int_equal(record->counters.conflicting, expected.conflicting);
}

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
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 1000});
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

/* A message in segments of seven bytes, laid out by hand, but for segment `lost`. */
static int feed_segments(const struct frame *whole, unsigned lost)
{
	unsigned count = (whole->length + 6u) / 7u;
	int result = 0;

	for (unsigned i = 0; i < count; i++) {
		struct frame segment = {.id = whole->id, .length = 8, .time_us = 1};

		segment.data[0] = (uint8_t)(i | (i + 1 == count ? 0x80 : 0));
		for (unsigned k = 0; k < 7 && 7 * i + k < whole->length; k++)
			segment.data[1 + k] = whole->data[7 * i + k];
		if (i != lost)
			result |= join_feed(join, &segment);
	}
	return result;
}

static void test_classic_upload(void **state)
{
	struct record record;
	struct record_gap gap;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 5000, 300, 9);
	hand_capture_end(&drop, &frame);
	assert_int_equal(feed_segments(&frame, 2), 0);
	assert_int_equal(feed_segments(&frame, 99), 1);
	for (unsigned sensor = 1; sensor <= 2; sensor++)
		for (uint32_t tick = 0; tick < 300; tick++) {
			hand_block(&drop, sensor, tick, true, &frame);
			feed_segments(&frame, sensor == 2 && tick == 77 ? 4 : 99);
		}
	assert_false(join_complete(join));
	assert_true(join_next_gap(join, 0, 0, 32, &gap));
	assert_int_equal(gap.sensor, 2);
	assert_int_equal(gap.first_tick_ms, 5077);
	assert_int_equal(gap.last_tick_ms, 5077);
	hand_block(&drop, 2, 77, true, &frame);
	feed_segments(&frame, 99);
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record,
	               (struct record_counters){.blocks = 600, .resent = 600, .corrupt = 2, .gaps = 2});
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
	record = take();
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

/* ---- random losses ---- */

/* What a bus did to the frames of a drop, and what the join must count. */
struct plan {
	struct frame *frames;
	size_t count;
	bool movable[4 * HAND_TICKS_MAX];
	bool held[2][HAND_TICKS_MAX];
	struct record_counters expected;
};

static void plan_one(struct plan *plan, unsigned s, uint32_t tick, uint64_t *random)
{
	unsigned luck = hand_random(random) % 100;
	struct frame *frame = &plan->frames[plan->count];

	hand_block(&drop, s + 1, tick, false, frame);
	if (luck < 5) /* lost */
		return;
	plan->count++;
	if (luck < 7) { /* corrupt */
		frame->data[hand_random(random) % 64] ^= (uint8_t)(1u << hand_random(random) % 8);
		plan->expected.corrupt++;
		return;
	}
	plan->held[s][tick] = true;
	plan->expected.blocks++;
	if (luck >= 12) {
		plan->movable[plan->count - 1] = true;
		return;
	}
	plan->frames[plan->count] = *frame; /* repeated, */
	plan->expected.repeated++;
	if (luck >= 10) { /* and not the same */
		struct frame *other = &plan->frames[plan->count];

		other->data[20] ^= 1;
		other->data[9] = hand_crc8(other->data, 64, 9);
		plan->expected.conflicting++;
	}
	plan->count++;
}

static int sensor_of(const struct frame *frame)
{
	return frame->id == 0x281;
}

static uint32_t tick_of(const struct frame *frame)
{
	return frame->data[2] | (uint32_t)frame->data[3] << 8 | (uint32_t)frame->data[4] << 16 |
	       (uint32_t)frame->data[5] << 24;
}

/* Blocks change places with others up to 20 frames away: only those that came once and whole, so that what
 * is the first of two stays as planned. */
static void shuffle(struct plan *plan, uint64_t *random)
{
	for (size_t i = 0; i + 20 < plan->count; i++) {
		size_t j = i + 1 + hand_random(random) % 19;
		struct frame swap = plan->frames[i];

		if (hand_random(random) % 20 || !plan->movable[i] || !plan->movable[j])
			continue;
		plan->frames[i] = plan->frames[j];
		plan->frames[j] = swap;
	}
}

static void count_reordered(struct plan *plan)
{
	uint32_t newest[2] = {0, 0};

	for (size_t i = 0; i < plan->count; i++) {
		const struct frame *frame = &plan->frames[i];

		if (hand_crc8(frame->data, 64, 9) != frame->data[9])
			continue;
		if (tick_of(frame) < newest[sensor_of(frame)])
			plan->expected.reordered++;
		else
			newest[sensor_of(frame)] = tick_of(frame);
	}
}

static void count_gaps(struct plan *plan)
{
	for (unsigned s = 0; s < 2; s++)
		for (uint32_t tick = 0; tick < drop.ticks; tick++)
			if (!plan->held[s][tick] && (tick == 0 || plan->held[s][tick - 1]))
				plan->expected.gaps++;
}

static void check_gap_list(const struct record *record, bool held[2][HAND_TICKS_MAX])
{
	size_t at = 0;

	for (unsigned s = 0; s < 2; s++) {
		for (uint32_t tick = 0; tick < drop.ticks; tick++) {
			if (held[s][tick] || (tick > 0 && !held[s][tick - 1]))
				continue;
			assert_true(at < record->gap_count);
			assert_int_equal(record->gaps[at].sensor, s + 1);
			assert_int_equal(record->gaps[at].first_tick_ms, drop.first_tick_ms + tick);
			while (tick + 1 < drop.ticks && !held[s][tick + 1])
				tick++;
			assert_int_equal(record->gaps[at++].last_tick_ms, drop.first_tick_ms + tick);
		}
	}
	assert_int_equal(record->gap_count, at);
}

static struct plan make_plan(uint64_t seed)
{
	struct plan plan = {.frames = calloc(4u * HAND_TICKS_MAX, sizeof(struct frame))};
	uint64_t random = seed;

	print_message("# seed %llu\n", (unsigned long long)seed);
	assert_non_null(plan.frames);
	hand_fill(&drop, 100000, 500, seed);
	for (uint32_t tick = 0; tick < drop.ticks; tick++)
		for (unsigned s = 0; s < 2; s++)
			plan_one(&plan, s, tick, &random);
	shuffle(&plan, &random);
	count_reordered(&plan);
	count_gaps(&plan);
	assert_true(plan.expected.reordered > 10 && plan.expected.corrupt > 3 && plan.expected.gaps > 20);
	return plan;
}

/* Serves every gap the join tells, as the tower would; returns the blocks sent. */
static uint64_t serve_gaps(uint32_t limit)
{
	struct record_gap gap = {0};
	uint64_t sent = 0;

	while (join_next_gap(join, 0, 0, limit, &gap)) {
		assert_true(gap.last_tick_ms - gap.first_tick_ms < limit);
		for (uint32_t tick = gap.first_tick_ms; tick != gap.last_tick_ms + 1; tick++) {
			join_by_hand_feed(gap.sensor, tick - drop.first_tick_ms, true);
			sent++;
		}
	}
	return sent;
}

static void test_random_losses_are_counted_and_recovered(void **state)
{
	(void)state;
	for (uint64_t seed = 11; seed < 21; seed++) {
		struct plan plan = make_plan(seed);
		struct record record;

		for (size_t i = 0; i < plan.count; i++)
			assert_int_equal(join_feed(join, &plan.frames[i]), 0);
		assert_int_equal(join_by_hand_feed_end(), 1);
		assert_false(join_complete(join));
		plan.expected.resent = serve_gaps(1 + (uint32_t)seed % 7);
		assert_int_equal(plan.expected.resent, 1000 - plan.expected.blocks);
		/* the first of two that differ may be the wrong one: then the CRC-32 says so */
		if (!join_complete(join)) {
			join_forget(join);
			plan.expected.resent += serve_gaps(100);
		}
		assert_true(join_complete(join));
		record = take();
		hand_check_samples(&record, &drop, NULL);
		plan.expected.blocks = 1000;
		check_counters(&record, plan.expected);
		assert_int_equal(record.gap_count, 0);
		assert_int_equal(record.flags, 0);
		record_free(&record);
		free(plan.frames);
		join_destroy(join);
		join = join_create();
		assert_non_null(join);
	}
}

static void test_what_stays_missing_is_listed(void **state)
{
	struct plan plan = make_plan(31);
	struct record record;

	(void)state;
	for (size_t i = 0; i < plan.count; i++)
		assert_int_equal(join_feed(join, &plan.frames[i]), 0);
	join_by_hand_feed_end();
	record = take();
	hand_check_samples(&record, &drop, plan.held);
	check_counters(&record, plan.expected);
	check_gap_list(&record, plan.held);
	assert_int_equal(record.lost_samples, (1000 - plan.expected.blocks) * 27);
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_INCOMPLETE);
	assert_true(record.crc_known && !record.crc_agrees);
	record_free(&record);
	free(plan.frames);
}

/* ---- asking again ---- */

static void check_next(unsigned sensor, uint32_t tick_ms, uint32_t limit, struct record_gap expected)
{
	struct record_gap gap = {0};

	assert_true(join_next_gap(join, sensor, tick_ms, limit, &gap));
	assert_int_equal(gap.sensor, expected.sensor);
	assert_int_equal(gap.first_tick_ms, expected.first_tick_ms);
	assert_int_equal(gap.last_tick_ms, expected.last_tick_ms);
}

static void test_gaps_in_order_and_in_pieces(void **state)
{
	struct record_gap gap;

	(void)state;
	hand_fill(&drop, 1000, 100, 3);
	assert_false(join_next_gap(join, 0, 0, 10, &gap));
	for (uint32_t tick = 0; tick < 100; tick++) {
		if (tick < 20 || tick > 44) /* S1 lacks 1020 to 1044 */
			join_by_hand_feed(1, tick, false);
		if (tick != 0 && tick != 99) /* S2 its first and last */
			join_by_hand_feed(2, tick, false);
	}
	join_by_hand_feed_end();
	check_next(0, 0, 100, (struct record_gap){1, 1020, 1044});
	check_next(1, 500, 10, (struct record_gap){1, 1020, 1029});
	check_next(1, 1030, 10, (struct record_gap){1, 1030, 1039});
	check_next(1, 1040, 10, (struct record_gap){1, 1040, 1044});
	check_next(1, 1045, 10, (struct record_gap){2, 1000, 1000});
	check_next(2, 1001, 10, (struct record_gap){2, 1099, 1099});
	assert_false(join_next_gap(join, 2, 1100, 10, &gap));
	assert_false(join_next_gap(join, 3, 1000, 10, &gap));
	assert_false(join_next_gap(join, 0, 0, 0, &gap));
}

static void test_forget_asks_for_everything(void **state)
{
	struct record record;
	struct frame frame;

	(void)state;
	hand_fill(&drop, 1000, 50, 4);
	for (uint32_t tick = 0; tick < 50; tick++) {
		join_by_hand_feed(1, tick, false);
		hand_block(&drop, 2, tick, false, &frame);
		if (tick == 30) { /* slips through its CRC-8 */
			frame.data[40] ^= 0x10;
			frame.data[9] = hand_crc8(frame.data, 64, 9);
		}
		if (tick != 31)
			join_feed(join, &frame);
	}
	join_by_hand_feed_end();
	assert_false(join_complete(join));
	assert_int_equal(serve_gaps(10), 1);
	assert_false(join_complete(join));
	assert_int_not_equal(join_crc32(join), hand_drop_crc32(&drop));
	join_forget(join);
	assert_int_equal(serve_gaps(10), 100);
	assert_true(join_complete(join));
	join_forget(join);
	assert_false(join_complete(join));
	assert_int_equal(serve_gaps(64), 100);
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 100, .gaps = 1, .resent = 201});
	record_free(&record);
}

/* A missing block is no block of zeros, though the CRC-32 would not tell. */
static void test_zeros_are_not_missing(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 20);
	memset(drop.sample[1][7], 0, sizeof(drop.sample[1][7]));
	for (uint32_t tick = 0; tick < 50; tick++) {
		join_by_hand_feed(1, tick, false);
		if (tick != 7)
			join_by_hand_feed(2, tick, false);
	}
	join_by_hand_feed_end();
	assert_int_equal(join_crc32(join), hand_drop_crc32(&drop));
	assert_false(join_complete(join));
	record = take();
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_INCOMPLETE);
	assert_false(record.crc_agrees);
	record_free(&record);
}

/* A resent block that was not needed, and a late live one. */
static void test_late_blocks(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 5);
	join_by_hand_feed_both(0, 48);
	join_by_hand_feed(2, 49, false);
	join_by_hand_feed_end();
	join_by_hand_feed(2, 10, true);
	assert_false(join_complete(join));
	join_by_hand_feed(1, 49, false);
	assert_true(join_complete(join));
	record = take();
	check_counters(&record,
	               (struct record_counters){.blocks = 100, .gaps = 1, .repeated = 1, .resent = 1});
	record_free(&record);
}

/* ---- more than one drop ---- */

static void test_a_capture_end_repeated_is_no_news(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 6);
	join_by_hand_feed_both(0, 49);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_by_hand_feed_end(), 0);
	record = take();
	record_free(&record);
	assert_int_equal(join_by_hand_feed_end(), 0); /* also after it was taken */
	assert_false(join_has_capture(join));
}

static void test_the_next_drop(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 7);
	join_by_hand_feed_both(0, 40);
	assert_int_equal(join_by_hand_feed_end(), 1); /* incomplete, and not taken */
	hand_fill(&drop, 1100, 50, 8);
	drop.drop_id = 4;
	join_by_hand_feed_both(0, 49);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 100});
	record_free(&record);
}

/* The window is kept whatever comes after it, and what comes after it does not get into it. */
static void test_a_capture_outlives_the_ring(void **state)
{
	static struct hand_drop first;
	struct record record;

	(void)state;
	hand_fill(&first, 1000, 50, 9);
	drop = first;
	join_by_hand_feed_both(0, 49);
	join_by_hand_feed_end();
	for (uint32_t k = 0; k < 5; k++) {
		hand_fill(&drop, 1050 + 1000 * k, 1000, 10);
		join_by_hand_feed_both(0, 999);
	}
	drop = first;
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 100});
	record_free(&record);
}

/* The tower starts again and its ticks cross those of the drop before. */
static void check_restart(bool boot_message)
{
	static const uint8_t boot[5] = {0};
	struct frame heartbeat = {.id = 0x701, .length = 5};
	uint32_t first_ms = boot_message ? 30 : 3000;
	struct record record;

	memcpy(heartbeat.data, boot, sizeof(boot));
	hand_fill(&drop, first_ms, 60, 12);
	join_by_hand_feed_both(0, 59);
	if (boot_message)
		join_feed(join, &heartbeat);
	hand_fill(&drop, 0, 40, 13);
	join_by_hand_feed_both(0, 39);
	join_by_hand_feed_end();
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 80});
	record_free(&record);
}

static void test_a_restart_seen_by_its_ticks(void **state)
{
	(void)state;
	check_restart(false);
}

static void test_a_restart_seen_by_its_boot_message(void **state)
{
	(void)state;
	check_restart(true);
}

/* The capture of before the restart is still to be had, but not from what the tower sends now. */
static void test_a_restart_leaves_the_capture_alone(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 3000, 60, 21);
	join_by_hand_feed_both(0, 50);
	join_by_hand_feed_end();
	hand_fill(&drop, 2000, 1024, 22);
	join_by_hand_feed_both(0, 1023); /* goes back, and then over ticks 3000 to 3023 */
	hand_fill(&drop, 3024, 60, 23);
	join_by_hand_feed_both(0, 59);
	hand_fill(&drop, 3000, 60, 21);
	record = take();
	assert_int_equal(record.gap_count, 2);
	check_counters(&record, (struct record_counters){.blocks = 102, .gaps = 2});
	record_free(&record);
}

/* A slot of the ring is used again after 2 048 ticks. */
static void test_the_ring_does_not_confuse_ticks(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 24);
	join_by_hand_feed_both(0, 49);
	hand_fill(&drop, 1000 + 2048, 50, 25);
	join_by_hand_feed_both(0, 9);
	join_by_hand_feed_both(20, 49);
	hand_fill(&drop, 1000, 50, 24);
	join_by_hand_feed(1, 30, true); /* too old for the ring: must not take the place of tick 3078 */
	hand_fill(&drop, 1000 + 2048, 50, 25);
	join_by_hand_feed_end();
	assert_int_equal(serve_gaps(64), 20);
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	check_counters(&record, (struct record_counters){.blocks = 100, .gaps = 2, .resent = 20});
	record_free(&record);
}

static void test_the_same_drop_after_a_restart_is_another(void **state)
{
	struct record record;

	(void)state;
	for (uint64_t seed = 1; seed < 3; seed++) {
		hand_fill(&drop, 400, 60, seed); /* same id, same ticks, other samples */
		join_by_hand_feed_both(0, 59);
		assert_int_equal(join_by_hand_feed_end(), 1);
		record = take();
		hand_check_samples(&record, &drop, NULL);
		record_free(&record);
		hand_fill(&drop, 1000, 2, seed);
		join_by_hand_feed_both(0, 1);
	}
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
	check_next(0, 0, 100, (struct record_gap){1, UINT32_MAX - 5, 9});
	assert_int_equal(serve_gaps(10), 32);
	assert_true(join_complete(join));
	record = take();
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.counters.reordered, 0);
	assert_int_equal(record.counters.gaps, 2);
	record_free(&record);
}

/* ---- no capture end ---- */

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
	record = take();
	hand_check_samples(&record, &drop, held);
	check_gap_list(&record, held);
	check_counters(&record, (struct record_counters){.blocks = 490, .gaps = 2});
	assert_false(record.crc_known || record.crc_agrees);
	assert_true(isnan(record.trigger_s) && isnan(record.frame_speed_m_s));
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_NO_CRC);
	record_free(&record);
	assert_int_equal(join_take(join, &record), DT_E_EMPTY);
}

/* ---- what is no block ---- */

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
	record = take();
	check_counters(&record, (struct record_counters){.blocks = 100, .corrupt = 1});
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
	record = take();
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
	assert_int_equal(serve_gaps(64), 100); /* the host came late: all of it can still be had */
	assert_true(join_complete(join));
	record = take();
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
	record = take();
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

static unsigned losses_told[2];

static void count_loss(void *context, enum join_loss what)
{
	assert_ptr_equal(context, join);
	losses_told[what]++;
	if (what == JOIN_LOSS_CAPTURE) {
		struct record record;

		assert_int_equal(join_take(join, &record), 0);
		assert_int_equal(record.first_tick_ms, 5000);
		assert_int_equal(record.counters.blocks, 98);
		record_free(&record);
	}
}

/* A capture that was not taken can be taken when the next one ends, and the blocks of a run before it is
 * gone. */
static void test_losses_are_told(void **state)
{
	const struct frame boot = {.id = 0x701, .length = 5};
	struct record record;

	(void)state;
	join_on_loss(join, count_loss, join);
	hand_fill(&drop, 5000, 50, 41);
	join_by_hand_feed_both(0, 48);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_by_hand_feed_end(), 0); /* a repetition displaces nothing */
	assert_int_equal(losses_told[JOIN_LOSS_CAPTURE], 0);
	hand_fill(&drop, 5200, 50, 42);
	join_by_hand_feed_both(0, 49);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(losses_told[JOIN_LOSS_CAPTURE], 1);
	record = take();
	hand_check_samples(&record, &drop, NULL);
	record_free(&record);
	assert_int_equal(losses_told[JOIN_LOSS_RUN], 0);
	join_feed(join, &boot);
	assert_int_equal(losses_told[JOIN_LOSS_RUN], 1);
	assert_int_equal(join_restarts(join), 1);
}

/* Pieces of a message that never became whole are not filled up by the next run's of the same name. */
static void test_segments_end_with_the_run(void **state)
{
	const struct frame boot = {.id = 0x701, .length = 5};
	struct record record;
	struct frame frame;

	(void)state;
	for (unsigned round = 0; round < 2; round++) {
		hand_fill(&drop, 1000, 20, 50 + round);
		join_feed(join, &boot);
		hand_capture_end(&drop, &frame);
		feed_segments(&frame, 99);
		for (uint32_t tick = 0; tick < 20; tick++)
			for (unsigned sensor = 1; sensor <= 2; sensor++) {
				hand_block(&drop, sensor, tick, true, &frame);
				feed_segments(&frame, round == 0 ? 1 : 99);
			}
	}
	record = take();
	hand_check_samples(&record, &drop, NULL);
	assert_true(record.crc_agrees);
	assert_int_equal(record.counters.corrupt, 40); /* copies that lost a piece, and no splice */
	record_free(&record);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, join_by_hand_begin, join_by_hand_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_skipped_is_as_taken),
	        TEST(test_what_the_join_has),
	        TEST(test_losses_are_told),
	        TEST(test_segments_end_with_the_run),
	        TEST(test_a_lossless_drop),
	        TEST(test_classic_upload),
	        TEST(test_marks_and_marked_samples),
	        TEST(test_random_losses_are_counted_and_recovered),
	        TEST(test_what_stays_missing_is_listed),
	        TEST(test_gaps_in_order_and_in_pieces),
	        TEST(test_forget_asks_for_everything),
	        TEST(test_zeros_are_not_missing),
	        TEST(test_late_blocks),
	        TEST(test_a_capture_end_repeated_is_no_news),
	        TEST(test_the_next_drop),
	        TEST(test_a_capture_outlives_the_ring),
	        TEST(test_a_restart_seen_by_its_ticks),
	        TEST(test_a_restart_seen_by_its_boot_message),
	        TEST(test_a_restart_leaves_the_capture_alone),
	        TEST(test_the_ring_does_not_confuse_ticks),
	        TEST(test_the_same_drop_after_a_restart_is_another),
	        TEST(test_ticks_wrap),
	        TEST(test_without_a_capture_end),
	        TEST(test_other_frames),
	        TEST(test_impossible_windows),
	        TEST(test_a_capture_without_a_block),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
