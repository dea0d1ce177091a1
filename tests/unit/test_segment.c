/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Messages in pieces: the bytes of the pieces by hand, there and back, and what happens when pieces are lost,
 * doubled, swapped, of other messages or nonsense.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/segment.h"
#include "tests/unit/fake_port.h"

enum { BLOCK_SEGMENTS = 10, END_SEGMENTS = 5 };

static struct segment_join join;

static int begin(void **state)
{
	(void)state;
	memset(&join, 0, sizeof(join));
	return 0;
}

static struct frame message(uint32_t id, uint8_t length, unsigned seed)
{
	struct frame frame = {.id = id, .length = length, .flags = FRAME_FD | FRAME_BRS};

	for (unsigned i = 0; i < length; i++)
		frame.data[i] = (uint8_t)(seed * 31 + i * 7 + 1);
	return frame;
}

static const struct frame *feed(const struct frame *whole, unsigned i)
{
	struct frame segment = {.time_us = 1000 + i};

	segment_cut(whole, i, &segment);
	return segment_feed(&join, &segment);
}

static void check_whole(const struct frame *got, const struct frame *sent)
{
	assert_non_null(got);
	assert_int_equal(got->id, sent->id);
	assert_int_equal(got->length, sent->length);
	assert_int_equal(got->flags, sent->flags);
	assert_memory_equal(got->data, sent->data, sent->length);
}

static void cut_by_hand(void **state)
{
	static const uint8_t last_of_block[8] = {0x89, 64, 0, 0, 0, 0, 0, 0};
	static const uint8_t last_of_end[8] = {0x83, 22, 23, 24, 0, 0, 0, 0};
	static const uint8_t second[8] = {0x01, 8, 9, 10, 11, 12, 13, 14};
	struct frame block = {.id = 0x381, .length = 64}, end = {.id = 0x681, .length = 24}, segment;

	(void)state;
	for (unsigned i = 0; i < 64; i++)
		block.data[i] = end.data[i] = (uint8_t)(i + 1);
	assert_int_equal(segment_count(64), 10);
	assert_int_equal(segment_count(24), 4);
	assert_int_equal(segment_count(7), 1);
	assert_int_equal(segment_count(8), 2);
	segment_cut(&block, 1, &segment);
	assert_int_equal(segment.id, 0x381);
	assert_int_equal(segment.flags, 0);
	assert_int_equal(segment.length, 8);
	assert_memory_equal(segment.data, second, 8);
	segment_cut(&block, 9, &segment);
	assert_memory_equal(segment.data, last_of_block, 8);
	segment_cut(&end, 3, &segment);
	assert_memory_equal(segment.data, last_of_end, 8);
}

static void identifiers_interleave(void **state)
{
	struct frame s1 = message(0x381, 64, 1), s2 = message(0x481, 64, 2), end = message(0x681, 32, 3);

	(void)state;
	for (unsigned i = 0; i < BLOCK_SEGMENTS; i++) {
		const struct frame *got = feed(&s1, i);

		assert_int_equal(got != NULL, i == 9);
		if (got != NULL) {
			check_whole(got, &s1);
			assert_int_equal(got->time_us, 1009);
		}
		if (i < END_SEGMENTS)
			got = feed(&end, i);
		if (i == END_SEGMENTS - 1)
			check_whole(got, &end);
		got = feed(&s2, i);
		assert_int_equal(got != NULL, i == 9);
		if (got != NULL)
			check_whole(got, &s2);
	}
	assert_int_equal(join.incomplete, 0);
}

static void what_is_no_segment_comes_back(void **state)
{
	static const struct frame frames[] = {
	        {.id = 0x682, .length = 8},
	        {.id = 0x381, .length = 64, .flags = FRAME_FD | FRAME_BRS},
	        {.id = 0x381, .length = 8, .flags = FRAME_FD},
	        {.id = 0x481, .length = 7},
	        {.id = 0x681, .length = 8, .flags = FRAME_REMOTE},
	        {.id = 0x681, .length = 8, .flags = FRAME_EXTENDED},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]); i++)
		assert_ptr_equal(segment_feed(&join, &frames[i]), &frames[i]);
	assert_int_equal(join.incomplete, 0);
}

static void one_lost_loses_its_message_only(void **state)
{
	struct frame first = message(0x381, 64, 1), second = message(0x381, 64, 2);

	(void)state;
	for (unsigned lost = 0; lost < BLOCK_SEGMENTS; lost++) {
		begin(NULL);
		for (unsigned i = 0; i < BLOCK_SEGMENTS; i++)
			if (i != lost)
				assert_null(feed(&first, i));
		for (unsigned i = 0; i < BLOCK_SEGMENTS - 1; i++)
			assert_null(feed(&second, i));
		check_whole(feed(&second, 9), &second);
		assert_int_equal(join.incomplete, 1);
	}
}

static void doubled_is_once(void **state)
{
	struct frame block = message(0x481, 64, 1);

	(void)state;
	for (unsigned round = 0; round < 2; round++)
		for (unsigned i = 0; i < BLOCK_SEGMENTS; i++) {
			assert_int_equal(feed(&block, i) != NULL, i == 9);
			assert_null(feed(&block, i));
		}
	assert_int_equal(join.incomplete, 0);
}

static void swapped_is_lost(void **state)
{
	struct frame block = message(0x481, 64, 1);

	(void)state;
	assert_null(feed(&block, 0));
	assert_null(feed(&block, 2));
	for (unsigned i = 1; i < BLOCK_SEGMENTS; i++)
		assert_null(feed(&block, i));
	assert_int_equal(join.incomplete, 2); /* one broken off, one without its beginning */
}

/* Feeds what the bits of `lost` leave of a copy; true when it completes the message. */
static bool feed_without(const struct frame *whole, unsigned count, unsigned lost)
{
	bool complete = false;

	for (unsigned i = 0; i < count; i++) {
		const struct frame *got = lost >> i & 1 ? NULL : feed(whole, i);

		if (got != NULL)
			check_whole(got, whole);
		complete |= got != NULL;
	}
	return complete;
}

static void the_second_copy_fills_what_is_missing(void **state)
{
	struct frame block = message(0x381, 64, 1), end = message(0x681, 32, 2);

	(void)state;
	for (unsigned first = 1; first < BLOCK_SEGMENTS; first++)
		for (unsigned second = 1; second < BLOCK_SEGMENTS; second++) {
			begin(NULL);
			assert_false(feed_without(&block, BLOCK_SEGMENTS, 1u << first));
			assert_int_equal(feed_without(&block, BLOCK_SEGMENTS, 1u << second), first != second);
			assert_int_equal(feed_without(&block, BLOCK_SEGMENTS, 0), true);
		}
	assert_false(feed_without(&end, END_SEGMENTS, 0x4));
	assert_true(feed_without(&end, END_SEGMENTS, 0xA));
}

/* The first segment is the message's name. */
static void a_copy_without_its_first_is_of_no_use(void **state)
{
	struct frame block = message(0x381, 64, 1), next = message(0x381, 64, 2);

	(void)state;
	assert_false(feed_without(&block, BLOCK_SEGMENTS, 0x10));
	assert_false(feed_without(&block, BLOCK_SEGMENTS, 0x01));
	assert_int_equal(join.incomplete, 2);
	assert_false(
	        feed_without(&next, BLOCK_SEGMENTS, 0x3E0)); /* the end lost, and the next one's beginning */
	assert_false(feed_without(&block, BLOCK_SEGMENTS, 0x007));
	assert_true(feed_without(&next, BLOCK_SEGMENTS, 0x01E));
	assert_true(feed_without(&block, BLOCK_SEGMENTS, 0x3E0));
	assert_int_equal(join.incomplete, 5);
}

/* Interrupted by others, also by one that has the same place 512 ticks later. */
static void messages_are_kept_apart(void **state)
{
	struct frame blocks[20], late;

	(void)state;
	for (unsigned i = 0; i < 20; i++) {
		blocks[i] = message(0x481, 64, 1);
		blocks[i].data[2] = (uint8_t)(250 + i); /* ticks across a carry */
		blocks[i].data[3] = i < 6 ? 3 : 4;
		assert_false(feed_without(&blocks[i], BLOCK_SEGMENTS, 1u << (1 + i % 9)));
	}
	for (unsigned i = 20; i-- > 0;)
		assert_true(feed_without(&blocks[i], BLOCK_SEGMENTS, 0x3FE & ~(1u << (1 + i % 9))));
	assert_false(feed_without(&blocks[0], BLOCK_SEGMENTS, 0x02));
	late = blocks[0];
	late.data[3] += 2;
	assert_false(feed_without(&late, BLOCK_SEGMENTS, 0x04));
	assert_true(feed_without(&late, BLOCK_SEGMENTS, 0x3F8));
	assert_false(feed_without(&blocks[0], BLOCK_SEGMENTS, 0x3FC)); /* what it had was given up */
}

/* As after a restart of the tower with the same drop and tick. */
static void what_differs_from_before_is_believed(void **state)
{
	struct frame before = message(0x381, 64, 1), after = before;

	(void)state;
	after.data[30] ^= 1;
	after.data[63] ^= 1;
	assert_false(feed_without(&before, BLOCK_SEGMENTS, 0x200));
	assert_false(feed_without(&after, BLOCK_SEGMENTS, 0x000)); /* up to the fourth they were alike */
	assert_true(feed_without(&after, BLOCK_SEGMENTS, 0x3F0));
	assert_false(feed_without(&after, BLOCK_SEGMENTS, 0x200));
	after.data[6] ^= 1; /* the last byte of the name: nothing of the one before counts */
	after.data[20] ^= 1;
	assert_true(feed_without(&after, BLOCK_SEGMENTS, 0x000));
}

/* What is left when the first segment of what is held is believed no more. */
static void a_rest_without_its_first_is_not_taken_over(void **state)
{
	struct frame before = message(0x381, 64, 1), after = before, later = before;

	(void)state;
	after.data[30] ^= 1;
	later.data[3] += 2; /* 512 ticks */
	assert_false(feed_without(&before, BLOCK_SEGMENTS, 0x200));
	assert_false(feed_without(&after, BLOCK_SEGMENTS, 0x000));
	assert_false(feed_without(&later, BLOCK_SEGMENTS, 0x3F0));
	assert_true(feed_without(&later, BLOCK_SEGMENTS, 0x00E));
}

/* A second segment that looks like the first one of a message that is held. */
static void a_name_is_in_the_first_only(void **state)
{
	struct frame held = message(0x381, 64, 1), other = message(0x381, 64, 2);

	(void)state;
	memcpy(other.data + 9, held.data + 2, 2);
	assert_false(feed_without(&held, BLOCK_SEGMENTS, 0x010));
	assert_false(feed_without(&other, BLOCK_SEGMENTS, 0x001));
	assert_true(feed_without(&held, BLOCK_SEGMENTS, 0x3EE));
}

/* A segment with a wrong mark is none. */
static void a_wrong_mark_is_not_kept(void **state)
{
	struct frame block = message(0x381, 64, 1), segment;

	(void)state;
	for (unsigned i = 0; i < BLOCK_SEGMENTS; i++) {
		segment_cut(&block, i, &segment);
		if (i == 4)
			segment.data[0] |= 0x80;
		assert_null(segment_feed(&join, &segment));
	}
	assert_true(feed_without(&block, BLOCK_SEGMENTS, 0x3EE));
	assert_int_equal(join.incomplete, 2);
}

/* 20 % lost, 1000 blocks, whole rounds of what is missing: it takes a few, and every copy is counted. */
static void a_fifth_lost_is_made_up_for(void **state)
{
	uint32_t seed = 20261121, done[32] = {0}, copies = 0, whole = 0, rounds = 0;

	(void)state;
	for (unsigned left = 1000; left > 0; rounds++) {
		assert_true(rounds < 16);
		left = 0;
		for (unsigned tick = 0; tick < 1000; tick++) {
			struct frame block = message(tick < 500 ? 0x381 : 0x481, 64, 1);
			unsigned lost = 0;

			if (done[tick / 32] >> tick % 32 & 1)
				continue;
			block.data[2] = (uint8_t)(tick % 500);
			block.data[3] = (uint8_t)(tick % 500 >> 8);
			for (unsigned i = 0; i < BLOCK_SEGMENTS; i++)
				lost |= (fake_random(&seed) % 5 == 0 ? 1u : 0u) << i;
			copies++;
			whole += lost == 0;
			if (feed_without(&block, BLOCK_SEGMENTS, lost))
				done[tick / 32] |= 1u << tick % 32;
			else
				left++;
		}
	}
	/* 2.83 of each: of n copies k have their first segment, and all with (1 - 0.2^k)^9. */
	assert_in_range(copies, 2740, 2910);
	assert_in_range(join.incomplete, copies - whole - 12, copies - whole);
}

static void wrong_lengths_are_refused(void **state)
{
	struct frame block = message(0x381, 64, 1), segment;

	(void)state;
	segment_cut(&block, 0, &segment);
	segment.data[0] |= 0x80; /* ends after one */
	assert_null(segment_feed(&join, &segment));
	assert_int_equal(join.incomplete, 1);
	for (unsigned i = 0; i < BLOCK_SEGMENTS; i++) {
		segment_cut(&block, i, &segment);
		segment.data[0] &= 0x7F; /* never ends */
		assert_null(segment_feed(&join, &segment));
	}
	assert_int_equal(join.incomplete, 2);
	for (unsigned i = 0; i < BLOCK_SEGMENTS - 1; i++)
		assert_null(feed(&block, i));
	check_whole(feed(&block, 9), &block);
	segment.data[0] = 10; /* goes on after its end */
	assert_null(segment_feed(&join, &segment));
	segment.data[0] = 0xFF;
	assert_null(segment_feed(&join, &segment));
	assert_int_equal(join.incomplete, 3);
}

/* Whatever comes: what is given back whole was sent so, or is the splice that the block's CRC-8 is for. */
static void anything_may_come(void **state)
{
	uint32_t seed = 20261122, whole = 0;

	(void)state;
	for (unsigned i = 0; i < 200000; i++) {
		struct frame frame = {.id = fake_random(&seed) % 2 ? 0x381 : 0x681, .length = 8};
		const struct frame *got;

		for (unsigned k = 0; k < 8; k++)
			frame.data[k] = (uint8_t)fake_random(&seed);
		frame.data[0] &= fake_random(&seed) % 2 ? 0x84 : 0x0F;
		got = segment_feed(&join, &frame);
		if (got == NULL)
			continue;
		whole++;
		assert_int_equal(got->length, got->id == 0x381 ? 64 : 32);
	}
	assert_true(whole > 0);
	assert_true(join.incomplete > 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(cut_by_hand, begin),
	        cmocka_unit_test_setup(identifiers_interleave, begin),
	        cmocka_unit_test_setup(what_is_no_segment_comes_back, begin),
	        cmocka_unit_test_setup(one_lost_loses_its_message_only, begin),
	        cmocka_unit_test_setup(doubled_is_once, begin),
	        cmocka_unit_test_setup(swapped_is_lost, begin),
	        cmocka_unit_test_setup(the_second_copy_fills_what_is_missing, begin),
	        cmocka_unit_test_setup(a_copy_without_its_first_is_of_no_use, begin),
	        cmocka_unit_test_setup(messages_are_kept_apart, begin),
	        cmocka_unit_test_setup(what_differs_from_before_is_believed, begin),
	        cmocka_unit_test_setup(a_rest_without_its_first_is_not_taken_over, begin),
	        cmocka_unit_test_setup(a_name_is_in_the_first_only, begin),
	        cmocka_unit_test_setup(a_wrong_mark_is_not_kept, begin),
	        cmocka_unit_test_setup(a_fifth_lost_is_made_up_for, begin),
	        cmocka_unit_test_setup(wrong_lengths_are_refused, begin),
	        cmocka_unit_test_setup(anything_may_come, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
