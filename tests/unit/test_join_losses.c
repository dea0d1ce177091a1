/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Blocks that are lost, late, repeated or damaged: what the join counts, lists and asks for again.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/join.h"
#include "tests/unit/join_by_hand.h"

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
		plan.expected.resent = join_by_hand_serve_gaps(1 + (uint32_t)seed % 7);
		assert_int_equal(plan.expected.resent, 1000 - plan.expected.blocks);
		/* the first of two that differ may be the wrong one: then the CRC-32 says so */
		if (!join_complete(join)) {
			join_forget(join);
			plan.expected.resent += join_by_hand_serve_gaps(100);
		}
		assert_true(join_complete(join));
		record = join_by_hand_take();
		hand_check_samples(&record, &drop, NULL);
		plan.expected.blocks = 1000;
		join_by_hand_check_counters(&record, plan.expected);
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
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, plan.held);
	join_by_hand_check_counters(&record, plan.expected);
	join_by_hand_check_gap_list(&record, plan.held);
	assert_int_equal(record.lost_samples, (1000 - plan.expected.blocks) * 27);
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_INCOMPLETE);
	assert_true(record.crc_known && !record.crc_agrees);
	record_free(&record);
	free(plan.frames);
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
	join_by_hand_check_next(0, 0, 100, (struct record_gap){1, 1020, 1044});
	join_by_hand_check_next(1, 500, 10, (struct record_gap){1, 1020, 1029});
	join_by_hand_check_next(1, 1030, 10, (struct record_gap){1, 1030, 1039});
	join_by_hand_check_next(1, 1040, 10, (struct record_gap){1, 1040, 1044});
	join_by_hand_check_next(1, 1045, 10, (struct record_gap){2, 1000, 1000});
	join_by_hand_check_next(2, 1001, 10, (struct record_gap){2, 1099, 1099});
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
	assert_int_equal(join_by_hand_serve_gaps(10), 1);
	assert_false(join_complete(join));
	assert_int_not_equal(join_crc32(join), hand_drop_crc32(&drop));
	join_forget(join);
	assert_int_equal(join_by_hand_serve_gaps(10), 100);
	assert_true(join_complete(join));
	join_forget(join);
	assert_false(join_complete(join));
	assert_int_equal(join_by_hand_serve_gaps(64), 100);
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record,
	                            (struct record_counters){.blocks = 100, .gaps = 1, .resent = 201});
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
	record = join_by_hand_take();
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
	record = join_by_hand_take();
	join_by_hand_check_counters(
	        &record, (struct record_counters){.blocks = 100, .gaps = 1, .repeated = 1, .resent = 1});
	record_free(&record);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, join_by_hand_begin, join_by_hand_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_random_losses_are_counted_and_recovered),
	        TEST(test_what_stays_missing_is_listed),
	        TEST(test_gaps_in_order_and_in_pieces),
	        TEST(test_forget_asks_for_everything),
	        TEST(test_zeros_are_not_missing),
	        TEST(test_late_blocks),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
