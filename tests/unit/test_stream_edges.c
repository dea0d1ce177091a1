/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Frames out, at the limits: the whole queue in one go, requests one tick beyond the ring, and how much waits
 * on classic CAN.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/stream.h"
#include "tests/unit/fake_port.h"

static struct stream stream;
static struct capture capture;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];

static int begin(void **state)
{
	(void)state;
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	capture_init(&capture, &parameters);
	memset(&stream, 0xA5, sizeof(stream)); /* whatever memory held */
	stream_init(&stream, counters);
	return 0;
}

static void hold(uint32_t first_ms, uint32_t last_ms)
{
	for (uint32_t t = first_ms; t <= last_ms; t++) {
		struct acquire_tick tick = {.tick_ms = t};

		capture_put(&capture, &tick);
	}
}

static void send(uint32_t number)
{
	struct frame frame = {.id = WIRE_ID_STATUS, .length = 8, .data = {(uint8_t)number}};

	stream_send(&stream, &frame);
}

static void the_whole_queue_in_one_go(void **state)
{
	(void)state;
	fake.can_full = true;
	send(0);
	stream_flush(&stream); /* takes it out of the queue, and it waits */
	for (uint32_t i = 1; i <= STREAM_QUEUE; i++)
		send(i);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 0);
	fake.can_full = false;
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, STREAM_QUEUE + 1);
	for (uint32_t i = 0; i <= STREAM_QUEUE; i++)
		assert_int_equal(fake.sent[i].data[0], i);
}

static void ask(uint32_t first_ms, uint16_t count)
{
	stream_request(&stream, &capture,
	               &(struct wire_resend){.sensor = 1, .first_tick_ms = first_ms, .count = count});
}

/* The request for first..first+count-1 brings these ticks and counts the others. */
static void check_ask(uint32_t first_ms, uint16_t count, uint32_t from_ms, uint32_t blocks)
{
	uint32_t before = counters[WIRE_COUNTER_resends_out_of_range];

	fake.sent_count = 0;
	ask(first_ms, count);
	for (unsigned i = 0; i < 40; i++)
		stream_resend(&stream, &capture);
	assert_int_equal(counters[WIRE_COUNTER_resends_out_of_range] - before, count - blocks);
	assert_int_equal(fake.sent_count, blocks);
	for (uint32_t i = 0; i < blocks; i++) {
		struct wire_block block;

		assert_int_equal(wire_unpack_block(&fake.sent[i], &block), 0);
		assert_int_equal(block.tick_ms, from_ms + i);
	}
}

static void requests_around_the_ring(void **state)
{
	(void)state;
	check_ask(1000, 3, 0, 0); /* an empty ring */
	hold(1000, 1000);
	check_ask(998, 5, 1000, 1);
	check_ask(999, 1, 0, 0);
	check_ask(999, 2, 1000, 1);
	check_ask(1000, 1, 1000, 1);
	check_ask(1000, 2, 1000, 1);
	check_ask(1001, 2, 0, 0);
	hold(1001, 1009);
	check_ask(999, 5, 1000, 4);
	check_ask(990, 10, 0, 0);
	check_ask(990, 11, 1000, 1);
	check_ask(990, 60, 1000, 10);
	check_ask(1009, 3, 1009, 1);
	check_ask(1010, 3, 0, 0);
}

static void the_bus_changes_with_nothing_waiting(void **state)
{
	struct frame block = {.id = WIRE_ID_BLOCK_S1, .length = 64, .flags = FRAME_FD | FRAME_BRS};

	(void)state;
	fake.can_full = true;
	stream_send(&stream, &block);
	stream_flush(&stream);
	fake.can_full = false;
	stream_flush(&stream); /* gone */
	assert_int_equal(fake.sent_count, 1);
	stream_set_classic(&stream, true);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 0);
}

/* A block is 10 segments: another is cut while fewer than 20 wait. */
static void how_much_waits_on_classic_can(void **state)
{
	(void)state;
	stream_set_classic(&stream, true);
	hold(1000, 1009);
	ask(1000, 10);
	fake.can_full = true;
	for (unsigned i = 0; i < 5; i++)
		stream_resend(&stream, &capture);
	assert_int_equal(ring_fill(&stream.queue), 20);
	stream_flush(&stream); /* one waits outside the queue now */
	assert_int_equal(ring_fill(&stream.queue), 19);
	for (unsigned i = 0; i < 5; i++)
		stream_resend(&stream, &capture);
	assert_int_equal(ring_fill(&stream.queue), 29);
}

#define TEST(name) cmocka_unit_test_setup(name, begin)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(the_whole_queue_in_one_go),
	        TEST(requests_around_the_ring),
	        TEST(the_bus_changes_with_nothing_waiting),
	        TEST(how_much_waits_on_classic_can),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
