/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/join_by_hand.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

struct hand_drop drop;
struct join *join;

int join_by_hand_begin(void **state)
{
	(void)state;
	join = join_create();
	return join ? 0 : -1;
}

int join_by_hand_end(void **state)
{
	(void)state;
	join_destroy(join);
	return 0;
}

void join_by_hand_feed(unsigned sensor, uint32_t tick, bool resent)
{
	struct frame frame;

	hand_block(&drop, sensor, tick, resent, &frame);
	assert_int_equal(join_feed(join, &frame), 0);
}

void join_by_hand_feed_both(uint32_t first, uint32_t last)
{
	for (uint32_t tick = first; tick <= last; tick++) {
		join_by_hand_feed(1, tick, false);
		join_by_hand_feed(2, tick, false);
	}
}

int join_by_hand_feed_end(void)
{
	struct frame frame;

	hand_capture_end(&drop, &frame);
	return join_feed(join, &frame);
}

struct record join_by_hand_take(void)
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

void join_by_hand_check_counters(const struct record *record, struct record_counters expected)
{
	assert_int_equal(record->counters.blocks, expected.blocks);
	assert_int_equal(record->counters.repeated, expected.repeated);
	assert_int_equal(record->counters.reordered, expected.reordered);
	assert_int_equal(record->counters.corrupt, expected.corrupt);
	assert_int_equal(record->counters.gaps, expected.gaps);
	assert_int_equal(record->counters.resent, expected.resent);
	assert_int_equal(record->counters.conflicting, expected.conflicting);
}

void join_by_hand_check_gap_list(const struct record *record, bool held[2][HAND_TICKS_MAX])
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

uint64_t join_by_hand_serve_gaps(uint32_t limit)
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

void join_by_hand_check_next(unsigned sensor, uint32_t tick_ms, uint32_t limit, struct record_gap expected)
{
	struct record_gap gap = {0};

	assert_true(join_next_gap(join, sensor, tick_ms, limit, &gap));
	assert_int_equal(gap.sensor, expected.sensor);
	assert_int_equal(gap.first_tick_ms, expected.first_tick_ms);
	assert_int_equal(gap.last_tick_ms, expected.last_tick_ms);
}

int join_by_hand_feed_segments(const struct frame *whole, unsigned lost)
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
