/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the page shows of the stream, from frames that are made by hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire.h"
#include "host/console/live.h"
#include "tests/unit/drop_by_hand.h"

enum {
	NONE = -32768,
	PATIENCE = 20, /* ticks that a block may be late */
	START_US = 5000000,
};

static struct live *live;
static struct hand_drop drop;
static int64_t now_us;

static int set_up(void **state)
{
	(void)state;
	live = live_create();
	now_us = START_US;
	hand_fill(&drop, 1000, HAND_TICKS_MAX, 0x11FE);
	return live == NULL;
}

static int tear_down(void **state)
{
	(void)state;
	live_destroy(live);
	return 0;
}

/* The drop's block i of a sensor, as if it were tick tick_ms; what live_feed says. */
static bool feed_as(unsigned sensor, uint32_t i, uint32_t tick_ms)
{
	struct frame frame;

	drop.first_tick_ms = tick_ms - i;
	hand_block(&drop, sensor, i, false, &frame);
	return live_feed(live, &frame, now_us);
}

static void feed(unsigned sensor, uint32_t i)
{
	assert_false(feed_as(sensor, i, 1000 + i));
}

static bool feed_heartbeat(uint8_t nmt_state)
{
	struct frame frame;

	wire_pack_heartbeat(&frame, WIRE_ID_HEARTBEAT_TOWER,
	                    &(struct wire_heartbeat){.nmt_state = nmt_state});
	return live_feed(live, &frame, now_us);
}

static void feed_both(uint32_t from, uint32_t to)
{
	for (uint32_t i = from; i < to; i++) {
		feed(1, i);
		feed(2, i);
	}
}

static struct live_view look(void)
{
	struct live_view view;

	live_look(live, now_us, &view);
	return view;
}

static void expected(unsigned sensor, uint32_t i, struct live_tick *tick)
{
	static const unsigned from[] = {0, 7, 17, 27};

	for (unsigned axis = 0; axis < 3; axis++) {
		const int16_t *sample = drop.sample[sensor - 1][i];
		unsigned channel = 3 * (sensor - 1) + axis;

		tick->low[channel] = tick->high[channel] = sample[from[axis]];
		for (unsigned k = from[axis]; k < from[axis + 1]; k++) {
			if (sample[k] < tick->low[channel])
				tick->low[channel] = sample[k];
			if (sample[k] > tick->high[channel])
				tick->high[channel] = sample[k];
		}
	}
}

static void envelope_of_each_millisecond(void **state)
{
	struct live_tick out[8], want;
	uint64_t next = 0, first = 99;

	(void)state;
	feed_both(0, 5);
	assert_int_equal(live_read(live, &next, &first, out, 8), 5);
	assert_int_equal(next - first, 5);
	for (uint32_t i = 0; i < 5; i++) {
		expected(1, i, &want);
		expected(2, i, &want);
		assert_memory_equal(&out[i], &want, sizeof(want));
	}
	assert_int_equal(look().blocks, 10);
	assert_int_equal(look().missing, 0);
}

static void samples_not_taken_are_no_extremes(void **state)
{
	struct live_tick out;
	uint64_t next = 0, first;

	(void)state;
	for (unsigned k = 0; k < 27; k++)
		drop.sample[0][0][k] = (int16_t)(k < 7 ? 100 + (int)k : NONE);
	drop.sample[0][0][3] = NONE;
	feed_both(0, 1);
	assert_int_equal(live_read(live, &next, &first, &out, 1), 1);
	assert_int_equal(out.low[0], 100);
	assert_int_equal(out.high[0], 106);
	assert_int_equal(out.low[1], NONE);
	assert_int_equal(out.high[2], NONE);
}

static void a_tick_waits_for_the_late_sensor_so_long(void **state)
{
	struct live_tick out[64];
	uint64_t next = 0, first;

	(void)state;
	feed_both(0, 3);
	feed(1, 3); /* S2 of it never comes, S2 of the next is late */
	feed(1, 4);
	feed_both(5, 3 + PATIENCE);
	assert_int_equal(live_read(live, &next, &first, out, 64), 3);
	assert_int_equal(look().missing, 0);
	feed_both(3 + PATIENCE, 4 + PATIENCE);
	assert_int_equal(live_read(live, &next, &first, out, 64), 1);
	assert_int_not_equal(out[0].low[0], NONE);
	assert_int_equal(out[0].low[3], NONE);
	assert_int_equal(out[0].high[5], NONE);
	assert_int_equal(look().missing, 1);
	feed(2, 3); /* too late */
	assert_int_equal(look().blocks, 2 * (4 + PATIENCE) - 2);
	feed(2, 4); /* not too late: all behind it were only waiting for it */
	assert_int_equal(live_read(live, &next, &first, out, 64), PATIENCE);
	assert_int_not_equal(out[0].low[3], NONE);
	assert_int_equal(look().missing, 1);
	assert_int_equal(look().blocks, 2 * (4 + PATIENCE) - 1);
}

static void a_gap_counts_every_block_in_it(void **state)
{
	struct live_tick out[400];
	uint64_t next = 0, first;
	size_t count;

	(void)state;
	feed_both(0, 2);
	feed_both(2 + 150, 2 + 150 + PATIENCE + 1);
	count = live_read(live, &next, &first, out, 400);
	assert_int_equal(count, 2 + 150 + PATIENCE + 1);
	assert_int_equal(out[2].low[0], NONE);
	assert_int_equal(out[151].high[5], NONE);
	assert_int_not_equal(out[152].high[5], NONE);
	assert_int_equal(look().missing, 2 * 150);
}

static void repeats_and_damage_count_for_nothing(void **state)
{
	struct frame frame;

	(void)state;
	feed_both(0, 2);
	feed(1, 1);
	hand_block(&drop, 1, 2, false, &frame);
	frame.data[20] ^= 1;
	assert_false(live_feed(live, &frame, now_us));
	assert_int_equal(look().blocks, 4);
	assert_int_equal(look().missing, 0);
}

/* Joining between a tick's two blocks loses nothing. */
static void the_first_tick_may_be_half(void **state)
{
	(void)state;
	feed(2, 0);
	feed_both(1, 1 + 2 * PATIENCE);
	assert_int_equal(look().missing, 0);
}

static void a_slow_reader_gets_what_is_left(void **state)
{
	static struct live_tick out[LIVE_TICKS + 10];
	struct live_tick want;
	uint64_t next = 0, first;

	(void)state;
	for (uint32_t tick = 0; tick < LIVE_TICKS + 500; tick++) {
		assert_false(feed_as(1, tick % 1000, 7000 + tick));
		assert_false(feed_as(2, tick % 1000, 7000 + tick));
	}
	assert_int_equal(live_read(live, &next, &first, out, 10), 10);
	assert_int_equal(first, 500);
	expected(1, 500, &want);
	expected(2, 500, &want);
	assert_memory_equal(&out[0], &want, sizeof(want));
	assert_int_equal(live_read(live, &next, &first, out, LIVE_TICKS + 10), LIVE_TICKS - 10);
	assert_int_equal(first, 510);
	assert_int_equal(live_read(live, &next, &first, out, LIVE_TICKS + 10), 0);
	assert_int_equal(look().missing, 0);
}

static void a_tower_that_starts_again_begins_anew(void **state)
{
	struct live_tick out[16];
	uint64_t next = 0, first, before;

	(void)state;
	feed_both(0, 10);
	feed(1, 10);
	(void)live_read(live, &next, &first, out, 16);
	before = next;
	for (uint32_t i = 0; i < 4; i++) {
		assert_int_equal(feed_as(1, i, 5 + i), i == 0); /* it says so once */
		assert_false(feed_as(2, i, 5 + i));
	}
	assert_int_equal(live_read(live, &next, &first, out, 16), 4);
	assert_true(first >= before);
	assert_int_equal(next, first + 4);
	assert_int_equal(look().missing, 0);
	assert_int_equal(look().blocks, 21 + 8);
	live_restart(live);
	assert_int_equal(live_read(live, &next, &first, out, 16), 0);
	feed_both(3, 4);
	assert_int_equal(live_read(live, &next, &first, out, 16), 1);
	assert_int_equal(look().missing, 0);
}

/* A block that is late, if at all, and a tower that was not heard for long, are no start. */
static void only_a_tick_far_behind_is_a_start(void **state)
{
	(void)state;
	assert_false(feed_as(1, 0, 5000));
	assert_false(feed_as(1, 0, 4900));
	assert_false(feed_as(1, 0, 5000 + 70000));
	assert_false(feed_as(2, 0, 75000 - 100));
	assert_true(feed_as(2, 0, 75000 - 101));
}

static void a_boot_up_heartbeat_is_a_start(void **state)
{
	(void)state;
	assert_true(feed_heartbeat(0));
	assert_false(feed_heartbeat(5));
	feed_both(0, 10);
	assert_true(feed_heartbeat(0));
	assert_false(feed_as(1, 0, 3)); /* which was said already */
	assert_int_equal(look().missing, 0);
}

/* A block at 1/5 Mbit/s, by hand for ISO 11898-1 (0x181 and 0x281 alike):
 *   nominal  SOF 1, identifier 11, RRS IDE FDF res BRS 5, one stuff bit in the six zeros of the identifier,
 *            ACK 2, EOF 7, intermission 3: 30 us
 *   data     ESI 1, DLC 4, data 512, stuff bits 1 + (511 - 1) / 4 = 128, stuff count and CRC 25 with 7 fixed
 *            stuff bits, CRC delimiter 1: 678 bits, 135.6 us */
static const double block_us = 30 + 678 / 5.0;

static void bus_load_is_that_of_the_worst_bits(void **state)
{
	struct live_view view;

	(void)state;
	for (uint32_t i = 0; i < 1000; i++) {
		feed(1, i);
		feed(2, i);
		now_us += 1000;
	}
	view = look();
	assert_true(fabs(view.frames_s - 2000) < 0.5);
	assert_true(fabs(view.bus_load_percent - 2000 * block_us / 1e4) < 0.001);
	assert_false(view.classic);
	now_us += 500000;
	view = look();
	assert_true(fabs(view.frames_s - 1000) < 0.5);
	now_us += 600000;
	view = look();
	assert_true(view.frames_s < 0.5);
	assert_true(view.bus_load_percent < 1e-9);
}

/* Classic CAN: 64 bytes are ten segments of 8. Each at most, by hand for 0x381: SOF 1, identifier 11 and a
 * stuff bit, RTR IDE r0 3, DLC 4, data and CRC 79 with 1 + (79 - 2) / 4 = 20 stuff bits, end 13: 132 us. */
static void a_tower_on_classic_can_is_known_by_its_silence(void **state)
{
	struct frame block;
	double before;

	(void)state;
	for (unsigned i = 0; i <= 11; i++) {
		assert_false(look().classic);
		assert_false(feed_heartbeat(5));
		now_us += 100000;
	}
	assert_true(look().classic);
	before = look().bus_load_percent;
	hand_block(&drop, 1, 0, true, &block);
	assert_false(live_feed(live, &block, now_us));
	assert_false(feed_heartbeat(5));
	now_us += 100000;
	assert_true(fabs(look().bus_load_percent - before - 10 * 132 / 1e4) < 0.0001);
	now_us += 1000000;
	assert_false(look().classic); /* nothing is heard at all */
}

static void the_heartbeat_grows_old(void **state)
{
	(void)state;
	assert_true(isnan(look().heartbeat_age_s));
	assert_false(feed_heartbeat(5));
	now_us += 130000;
	feed(1, 0);
	assert_true(fabs(look().heartbeat_age_s - 0.13) < 1e-9);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(envelope_of_each_millisecond),
	        TEST(samples_not_taken_are_no_extremes),
	        TEST(a_tick_waits_for_the_late_sensor_so_long),
	        TEST(a_gap_counts_every_block_in_it),
	        TEST(repeats_and_damage_count_for_nothing),
	        TEST(the_first_tick_may_be_half),
	        TEST(a_slow_reader_gets_what_is_left),
	        TEST(a_tower_that_starts_again_begins_anew),
	        TEST(only_a_tick_far_behind_is_a_start),
	        TEST(a_boot_up_heartbeat_is_a_start),
	        TEST(bus_load_is_that_of_the_worst_bits),
	        TEST(a_tower_on_classic_can_is_known_by_its_silence),
	        TEST(the_heartbeat_grows_old),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
