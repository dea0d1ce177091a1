/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * More than one drop in a stream, and towers that start again.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "host/record/join.h"
#include "tests/unit/join_by_hand.h"

static void test_a_capture_end_repeated_is_no_news(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 50, 6);
	join_by_hand_feed_both(0, 49);
	assert_int_equal(join_by_hand_feed_end(), 1);
	assert_int_equal(join_by_hand_feed_end(), 0);
	record = join_by_hand_take();
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
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 100});
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
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 100});
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
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 80});
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

/* Of a tick whose bytes are all 1 a ring that was not emptied to zeros has a block. */
static void test_a_restart_empties_the_ring(void **state)
{
	enum { GONE = 20 };
	static const uint8_t boot[5] = {0};
	struct frame heartbeat = {.id = 0x701, .length = 5};
	struct record record;

	(void)state;
	memcpy(heartbeat.data, boot, sizeof(boot));
	hand_fill(&drop, 1000, 50, 9);
	join_by_hand_feed_both(0, 49);
	join_feed(join, &heartbeat);
	hand_fill(&drop, 0x01010101 - GONE, 50, 10);
	join_by_hand_feed_both(0, GONE - 1);
	join_by_hand_feed_both(GONE + 1, 49);
	assert_int_equal(join_by_hand_feed_end(), 1);
	record = join_by_hand_take();
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 98, .gaps = 2});
	record_free(&record);
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
	record = join_by_hand_take();
	assert_int_equal(record.gap_count, 2);
	join_by_hand_check_counters(&record, (struct record_counters){.blocks = 102, .gaps = 2});
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
	assert_int_equal(join_by_hand_serve_gaps(64), 20);
	assert_true(join_complete(join));
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	join_by_hand_check_counters(&record,
	                            (struct record_counters){.blocks = 100, .gaps = 2, .resent = 20});
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
		record = join_by_hand_take();
		hand_check_samples(&record, &drop, NULL);
		record_free(&record);
		hand_fill(&drop, 1000, 2, seed);
		join_by_hand_feed_both(0, 1);
	}
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
	record = join_by_hand_take();
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
		join_by_hand_feed_segments(&frame, 99);
		for (uint32_t tick = 0; tick < 20; tick++)
			for (unsigned sensor = 1; sensor <= 2; sensor++) {
				hand_block(&drop, sensor, tick, true, &frame);
				join_by_hand_feed_segments(&frame, round == 0 ? 1 : 99);
			}
	}
	record = join_by_hand_take();
	hand_check_samples(&record, &drop, NULL);
	assert_true(record.crc_agrees);
	assert_int_equal(record.counters.corrupt, 40); /* copies that lost a piece, and no splice */
	record_free(&record);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, join_by_hand_begin, join_by_hand_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_losses_are_told),
	        TEST(test_segments_end_with_the_run),
	        TEST(test_a_capture_end_repeated_is_no_news),
	        TEST(test_the_next_drop),
	        TEST(test_a_capture_outlives_the_ring),
	        TEST(test_a_restart_seen_by_its_ticks),
	        TEST(test_a_restart_seen_by_its_boot_message),
	        TEST(test_a_restart_empties_the_ring),
	        TEST(test_a_restart_leaves_the_capture_alone),
	        TEST(test_the_ring_does_not_confuse_ticks),
	        TEST(test_the_same_drop_after_a_restart_is_another),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
