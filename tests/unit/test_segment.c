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

enum { BLOCK_SEGMENTS = 10, END_SEGMENTS = 4 };

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
	struct frame s1 = message(0x381, 64, 1), s2 = message(0x481, 64, 2), end = message(0x681, 24, 3);

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
	assert_int_equal(join.incomplete, 1);
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
		frame.data[0] &= fake_random(&seed) % 2 ? 0x83 : 0x0F;
		got = segment_feed(&join, &frame);
		if (got == NULL)
			continue;
		whole++;
		assert_int_equal(got->length, got->id == 0x381 ? 64 : 24);
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
	        cmocka_unit_test_setup(wrong_lengths_are_refused, begin),
	        cmocka_unit_test_setup(anything_may_come, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
