/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Segments at the limits: every length, and a message broken off after its first piece.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/segment.h"

static void pieces_of_every_length(void **state)
{
	(void)state;
	for (uint8_t length = 1; length <= 64; length++) {
		struct frame whole = {.id = 0x381, .length = length}, piece;
		unsigned count = (length + 6u) / 7u;

		for (unsigned i = 0; i < 64; i++)
			whole.data[i] = (uint8_t)(i + 1);
		assert_int_equal(segment_count(length), count);
		for (unsigned i = 0; i < count; i++) {
			segment_cut(&whole, i, &piece);
			assert_int_equal(piece.id, 0x381);
			assert_int_equal(piece.length, 8);
			assert_int_equal(piece.flags, 0);
			assert_int_equal(piece.data[0], i | (i + 1 == count ? 0x80u : 0));
			for (unsigned k = 0; k < 7; k++)
				assert_int_equal(piece.data[1 + k], 7 * i + k < length ? 7 * i + k + 1 : 0);
		}
	}
}

static struct segment_join join;

static const struct frame *feed(unsigned position, uint8_t value)
{
	struct frame piece = {.id = 0x681, .length = 8, .data = {(uint8_t)position}};

	memset(piece.data + 1, value, 7);
	return segment_feed(&join, &piece);
}

static void broken_off_after_the_first(void **state)
{
	(void)state;
	memset(&join, 0, sizeof(join));
	assert_null(feed(0, 1));
	assert_null(feed(0, 2)); /* of the next message */
	assert_int_equal(join.incomplete, 1);
	assert_null(feed(1, 2));
	assert_null(feed(2, 2));
	assert_null(feed(3, 2));
	assert_non_null(feed(4 | 0x80, 2));
	assert_int_equal(join.incomplete, 1);
}

/* The same position with other bytes is no repetition. */
static void the_same_position_with_other_bytes(void **state)
{
	(void)state;
	memset(&join, 0, sizeof(join));
	assert_null(feed(0, 1));
	assert_null(feed(1, 1));
	assert_null(feed(1, 1)); /* again */
	assert_int_equal(join.incomplete, 0);
	assert_null(feed(1, 2));
	assert_int_equal(join.incomplete, 2); /* one broken off, another that began earlier */
	assert_null(feed(2, 1));
	assert_null(feed(3 | 0x80, 1));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(pieces_of_every_length),
	        cmocka_unit_test(broken_off_after_the_first),
	        cmocka_unit_test(the_same_position_with_other_bytes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
