/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Frames out: order and counts when the bus takes nothing for a while, and resends from the ring.
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
	stream_init(&stream, counters);
	return 0;
}

static struct acquire_tick make(uint32_t tick_ms)
{
	struct acquire_tick tick = {.tick_ms = tick_ms, .drop_id = 9, .io = 0x1042, .status = {2, 0x22}};

	for (unsigned s = 0; s < 2; s++)
		for (unsigned k = 0; k < 10; k++)
			tick.sensor[s].y[k] = (int16_t)(tick_ms * 20 + 10 * s + k);
	return tick;
}

static void put(uint32_t tick_ms)
{
	struct acquire_tick tick = make(tick_ms);

	capture_put(&capture, &tick);
}

static void stream_both(const struct acquire_tick *tick)
{
	for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++) {
		struct frame block;

		acquire_pack(tick, sensor, sensor == 0 ? WIRE_ID_BLOCK_S1 : WIRE_ID_BLOCK_S2, &block);
		stream_block(&stream, &block);
	}
}

static struct frame numbered(uint32_t number)
{
	return (struct frame){.id = WIRE_ID_STATUS, .length = 8, .data = {(uint8_t)number}};
}

static void sends_at_once_when_it_can(void **state)
{
	struct acquire_tick tick = make(5);

	(void)state;
	stream_both(&tick);
	assert_int_equal(fake.sent_count, 2);
	assert_int_equal(fake.sent[0].id, 0x181);
	assert_int_equal(fake.sent[1].id, 0x281);
	assert_int_equal(fake.sent[1].data[6], 0x22);
	assert_int_equal(counters[WIRE_COUNTER_frames_sent], 2);
	assert_int_equal(counters[WIRE_COUNTER_frames_deferred], 0);
}

static void defers_in_order_and_counts_what_is_dropped(void **state)
{
	(void)state;
	fake.can_full = true;
	for (uint32_t i = 0; i < STREAM_QUEUE + 3; i++) {
		struct frame frame = numbered(i);

		stream_send(&stream, &frame);
	}
	assert_int_equal(counters[WIRE_COUNTER_frames_deferred], STREAM_QUEUE);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 3);
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, 0);
	fake.can_full = false;
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, STREAM_QUEUE);
	for (unsigned i = 0; i < STREAM_QUEUE; i++)
		assert_int_equal(fake.sent[i].data[0], i);
	assert_int_equal(counters[WIRE_COUNTER_frames_sent], STREAM_QUEUE);
}

static void new_frames_do_not_overtake(void **state)
{
	struct frame first = numbered(1), second = numbered(2);

	(void)state;
	fake.can_full = true;
	stream_send(&stream, &first);
	stream_flush(&stream); /* takes it out of the queue and holds it */
	fake.can_full = false;
	stream_send(&stream, &second);
	assert_int_equal(fake.sent_count, 0);
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, 2);
	assert_int_equal(fake.sent[0].data[0], 1);
	assert_int_equal(fake.sent[1].data[0], 2);
}

static void blocks_leave_room_for_the_rest(void **state)
{
	(void)state;
	fake.can_full = true;
	for (uint32_t t = 0; t < STREAM_QUEUE; t++) {
		struct acquire_tick tick = make(t);

		stream_both(&tick);
	}
	assert_int_equal(counters[WIRE_COUNTER_frames_deferred], STREAM_QUEUE - STREAM_RESERVED);
	for (uint32_t i = 0; i < STREAM_RESERVED; i++) {
		struct frame frame = numbered(i);

		stream_send(&stream, &frame);
	}
	assert_int_equal(counters[WIRE_COUNTER_frames_deferred], STREAM_QUEUE);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped],
	                 2 * STREAM_QUEUE - (STREAM_QUEUE - STREAM_RESERVED));
}

static void request(unsigned sensor, uint32_t first_ms, unsigned count)
{
	stream_request(&stream, &capture,
	               &(struct wire_resend){.sensor = (uint8_t)sensor,
	                                     .count = (uint16_t)count,
	                                     .first_tick_ms = first_ms});
}

static void resent_block_is_the_live_one(void **state)
{
	struct acquire_tick tick = make(100);
	struct frame live[2];

	(void)state;
	capture_put(&capture, &tick);
	stream_both(&tick);
	memcpy(live, fake.sent, sizeof(live));
	fake.sent_count = 0;
	request(2, 100, 1);
	request(1, 100, 1);
	stream_resend(&stream, &capture);
	assert_int_equal(fake.sent_count, 2);
	assert_int_equal(fake.sent[0].id, 0x481);
	assert_int_equal(fake.sent[1].id, 0x381);
	assert_memory_equal(fake.sent[0].data, live[1].data, 64);
	assert_memory_equal(fake.sent[1].data, live[0].data, 64);
	assert_int_equal(counters[WIRE_COUNTER_blocks_resent], 2);
}

static void a_few_per_tick_in_order(void **state)
{
	(void)state;
	for (uint32_t t = 0; t < 20; t++)
		put(t);
	request(1, 5, 5);
	for (unsigned n = 1; n <= 4; n++) {
		stream_resend(&stream, &capture);
		assert_int_equal(fake.sent_count, n < 3 ? 2 * n : 5);
	}
	for (unsigned i = 0; i < 5; i++)
		assert_int_equal(fake.sent[i].data[2], 5 + i);
	fake.can_full = true; /* live blocks go first */
	request(1, 5, 5);
	stream_send(&stream, &(struct frame){.id = WIRE_ID_STATUS, .length = 8});
	stream_resend(&stream, &capture);
	assert_int_equal(counters[WIRE_COUNTER_blocks_resent], 5);
}

static void ticks_out_of_the_ring_are_counted(void **state)
{
	(void)state;
	request(1, 0, 10); /* empty ring */
	assert_int_equal(counters[WIRE_COUNTER_resends_out_of_range], 10);
	for (uint32_t t = 0; t < 1000; t++)
		put(t); /* 488 to 999 held */
	counters[WIRE_COUNTER_resends_out_of_range] = 0;
	request(1, 486, 3); /* 486 487 gone */
	request(1, 998, 5); /* 1000 1001 1002 to come */
	request(1, 100, 50);
	request(1, 5000, 7);
	assert_int_equal(counters[WIRE_COUNTER_resends_out_of_range], 2 + 3 + 50 + 7);
	request(2, 0, 65535);
	assert_int_equal(counters[WIRE_COUNTER_resends_out_of_range], 62 + 65535 - 512);
	for (unsigned i = 0; i < 600; i++)
		stream_resend(&stream, &capture);
	assert_int_equal(fake_count(0x381), 3);
	assert_int_equal(fake_count(0x481), 512);
	assert_int_equal(fake.sent[0].data[2] | fake.sent[0].data[3] << 8, 488);
	request(1, 488, 1); /* still there, but gone when its turn comes */
	put(1000);
	counters[WIRE_COUNTER_resends_out_of_range] = 0;
	stream_resend(&stream, &capture);
	assert_int_equal(counters[WIRE_COUNTER_resends_out_of_range], 1);
}

static void full_list_is_counted(void **state)
{
	(void)state;
	put(1);
	for (unsigned i = 0; i < STREAM_REQUESTS + 2; i++)
		request(1, 1, 1);
	assert_int_equal(counters[WIRE_COUNTER_resends_overflowed], 2);
}

/* ---- classic CAN ---- */

static void classic_sends_segments_and_nothing_live(void **state)
{
	struct acquire_tick tick = make(5);
	struct frame end = {.id = 0x681, .length = 24, .flags = FRAME_FD | FRAME_BRS};

	(void)state;
	for (unsigned i = 0; i < 24; i++)
		end.data[i] = (uint8_t)(0x40 + i);
	stream_set_classic(&stream, true);
	stream_both(&tick);
	assert_int_equal(fake.sent_count, 0);
	stream_send(&stream, &(struct frame){.id = 0x682, .length = 8});
	assert_int_equal(fake.sent_count, 1);
	stream_send(&stream, &end);
	assert_int_equal(fake.sent_count, 5);
	for (unsigned i = 0; i < 4; i++) {
		const struct frame *segment = &fake.sent[1 + i];

		assert_int_equal(segment->id, 0x681);
		assert_int_equal(segment->length, 8);
		assert_int_equal(segment->flags, 0);
		assert_int_equal(segment->data[0], i == 3 ? 0x83 : i);
		for (unsigned k = 0; k < 7; k++)
			assert_int_equal(segment->data[1 + k], 7 * i + k < 24 ? 0x40 + 7 * i + k : 0);
	}
	assert_int_equal(counters[WIRE_COUNTER_frames_sent], 5);
	stream_set_classic(&stream, false);
	stream_both(&tick);
	assert_int_equal(fake.sent_count, 7);
	assert_int_equal(fake.sent[6].flags, FRAME_FD | FRAME_BRS);
}

static void upload_keeps_the_bus_busy_and_no_more(void **state)
{
	unsigned ms = 0;

	(void)state;
	for (uint32_t t = 0; t < 40; t++)
		put(t);
	capture.first_ms = 10;
	capture.last_ms = 29;
	stream_upload(&stream, &capture); /* not on FD */
	stream_resend(&stream, &capture);
	assert_int_equal(fake.sent_count, 0);
	stream_set_classic(&stream, true);
	stream_upload(&stream, &capture);
	fake.can_room = 0;
	for (; counters[WIRE_COUNTER_blocks_resent] < 40 && ms < 1000; ms++) {
		unsigned before = fake.sent_count;

		stream_resend(&stream, &capture);
		for (unsigned poll = 0; poll < 7; poll++) { /* what 1 Mbit/s takes in a ms */
			fake.can_room = 1;
			stream_flush(&stream);
		}
		assert_int_equal(fake.sent_count - before, 7);
		assert_true(ring_fill(&stream.queue) <= STREAM_UPLOAD_WAITING + 10);
	}
	fake.can_room = UINT32_MAX;
	stream_flush(&stream);
	assert_int_equal(fake_count(0x381), 200);
	assert_int_equal(fake_count(0x481), 200);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 0);
	for (unsigned i = 0; i < 400; i++) {
		assert_int_equal(fake.sent[i].flags, 0);
		assert_int_equal(fake.sent[i].data[0], i % 10 == 9 ? 0x89 : i % 10);
		if (i % 10 == 0)
			assert_int_equal(fake.sent[i].data[3], 10 + i / 10 % 20); /* tick_ms */
	}
}

static void change_of_bus_drops_what_does_not_fit(void **state)
{
	struct acquire_tick tick = make(5);
	struct frame status = numbered(1);

	(void)state;
	fake.can_full = true;
	stream_both(&tick);
	stream_flush(&stream); /* one block waits outside of the queue */
	stream_send(&stream, &status);
	stream_both(&tick);
	status = numbered(2);
	stream_send(&stream, &status);
	stream_set_classic(&stream, true);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 4);
	fake.can_full = false;
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, 2);
	assert_int_equal(fake.sent[0].data[0], 1);
	assert_int_equal(fake.sent[1].data[0], 2);
	fake.can_full = true;
	stream_send(&stream, &status);
	stream_flush(&stream);
	stream_set_classic(&stream, false);
	fake.can_full = false;
	stream_flush(&stream);
	assert_int_equal(fake.sent_count, 3);
	assert_int_equal(counters[WIRE_COUNTER_frames_dropped], 4);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(sends_at_once_when_it_can, begin),
	        cmocka_unit_test_setup(defers_in_order_and_counts_what_is_dropped, begin),
	        cmocka_unit_test_setup(new_frames_do_not_overtake, begin),
	        cmocka_unit_test_setup(blocks_leave_room_for_the_rest, begin),
	        cmocka_unit_test_setup(resent_block_is_the_live_one, begin),
	        cmocka_unit_test_setup(a_few_per_tick_in_order, begin),
	        cmocka_unit_test_setup(ticks_out_of_the_ring_are_counted, begin),
	        cmocka_unit_test_setup(full_list_is_counted, begin),
	        cmocka_unit_test_setup(classic_sends_segments_and_nothing_live, begin),
	        cmocka_unit_test_setup(upload_keeps_the_bus_busy_and_no_more, begin),
	        cmocka_unit_test_setup(change_of_bus_drops_what_does_not_fit, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
