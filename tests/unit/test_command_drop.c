/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The whole firmware from outside: drops, their blocks, resends and capture ends.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/crc.h"
#include "firmware/app.h"
#include "tests/unit/fake_port.h"
#include "tests/unit/firmware_by_hand.h"

static struct frame seen[FAKE_SENT_MAX];

static void live_blocks_in_every_tick(void **state)
{
	struct wire_block block;

	(void)state;
	firmware_to_ready();
	firmware_forget_frames();
	firmware_run(50);
	for (unsigned i = 0, n = 0; i < fake.sent_count; i++)
		if (fake.sent[i].id == WIRE_ID_BLOCK_S2) {
			assert_int_equal(wire_check_block(&fake.sent[i]), 0);
			assert_int_equal(wire_unpack_block(&fake.sent[i], &block), 0);
			assert_int_equal(block.tick_ms, by_hand.next_ms - 51 + n++);
			assert_int_equal(block.status, WIRE_STATE_READY);
			assert_int_equal(block.io, FAKE_ALL_GOOD | WIRE_IO_MAGNET_HOLD);
			assert_int_equal(block.drop_id, 0);
			assert_in_range(block.y[9], 4, 5);
		}
}

/* CRC-32 of the sample bytes of the live blocks from first to last. */
static uint32_t crc_of_blocks(const struct frame *frames, unsigned count, uint32_t first_ms, uint32_t last_ms)
{
	struct wire_block block;
	uint32_t crc = CRC32_INIT;
	unsigned blocks = 0;

	for (unsigned i = 0; i < count; i++) {
		if (frames[i].length != 64)
			continue;
		assert_int_equal(wire_unpack_block(&frames[i], &block), 0);
		if (block.tick_ms >= first_ms && block.tick_ms <= last_ms) {
			crc = crc32(crc, frames[i].data + 10, 54);
			blocks++;
		}
	}
	assert_int_equal(blocks, 2 * (last_ms - first_ms + 1));
	return crc;
}

static void whole_drop(void **state)
{
	struct wire_capture_end end;
	struct wire_reply reply;
	uint32_t hit_ms;
	unsigned count;

	(void)state;
	firmware_to_separated();
	firmware_forget_frames();
	firmware_run(300); /* with the window longer than the 600 ms after which no impact is a fault */
	hit_ms = by_hand.next_ms;
	by_hand.s2x = -2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(399);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	firmware_run(1); /* closes the last tick of the window */
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 1);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.drop_id, 1);
	assert_int_equal(end.first_tick_ms, hit_ms - 100);
	assert_int_equal(end.last_tick_ms, hit_ms + 399);
	assert_int_equal(end.trigger_us, 100000);
	assert_int_equal(end.marks, 0);
	assert_int_equal(end.camera_frame, end.first_tick_ms - by_hand.release_ms);
	assert_in_range(end.frame_speed_mm_s, 2842, 2844);
	count = fake.sent_count;
	memcpy(seen, fake.sent, count * sizeof(seen[0]));
	assert_int_equal(end.crc32, crc_of_blocks(seen, count, end.first_tick_ms, end.last_tick_ms));
	firmware_forget_frames();
	firmware_run(500);
	assert_in_range(fake_count(WIRE_ID_CAPTURE_END), 4, 5); /* again and again */
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 500);    /* live goes on */
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, 0, end.crc32 + 1).result, DT_E_CORRUPT);
	reply = firmware_order(WIRE_OP_ACCEPT, 0, end.crc32);
	assert_int_equal(reply.result, 0);
	assert_int_equal(reply.state, WIRE_STATE_UPLOADED);
	firmware_forget_frames();
	firmware_run(300);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void second_drop_has_its_own_window(void **state)
{
	struct wire_capture_end end;
	uint32_t hit_ms;

	(void)state;
	firmware_to_captured();
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 0, 0).result, 0);
	fake.inputs = FAKE_ALL_GOOD;
	firmware_run(400);
	firmware_fall(2);
	firmware_separate();
	firmware_run(30);
	hit_ms = by_hand.next_ms;
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_forget_frames();
	firmware_run(410);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.drop_id, 2);
	assert_int_equal(end.first_tick_ms, hit_ms - 100);
	assert_int_equal(end.marks, 0);
}

static void resends_on_request(void **state)
{
	struct wire_capture_end end;
	unsigned count, found = 0;

	(void)state;
	firmware_to_separated();
	firmware_forget_frames();
	firmware_run(100);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(401);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	count = fake.sent_count;
	memcpy(seen, fake.sent, count * sizeof(seen[0]));
	firmware_forget_frames();
	firmware_ask(1, end.first_tick_ms, 500);
	firmware_ask(2, end.first_tick_ms, 500);
	firmware_run(510);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S1), 500);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S2), 500);
	for (unsigned i = 0; i < fake.sent_count; i++) {
		uint32_t id = fake.sent[i].id;

		if (id != WIRE_ID_RESENT_S1 && id != WIRE_ID_RESENT_S2)
			continue;
		for (unsigned j = 0; j < count; j++)
			if (seen[j].id == id - 0x200 &&
			    memcmp(seen[j].data + 2, fake.sent[i].data + 2, 4) == 0) {
				assert_memory_equal(seen[j].data, fake.sent[i].data, 64);
				found++;
			}
	}
	assert_int_equal(found, 1000);
	firmware_forget_frames();
	firmware_ask(2, 0, 0);
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 1);
}

static void resend_requests_are_checked(void **state)
{
	(void)state;
	firmware_to_ready();
	firmware_ask(0, 100, 1);
	firmware_ask(3, 100, 1);
	firmware_ask(1, 0, 0); /* no capture */
	firmware_ask(1, by_hand.next_ms + 100, 5);
	firmware_run(1);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_resends_out_of_range), 6);
}

static void late_main_loses_nothing_in_the_capture(void **state)
{
	struct wire_capture_end end;
	uint32_t hit_ms;

	(void)state;
	firmware_to_separated();
	firmware_run(150);
	hit_ms = by_hand.next_ms;
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	for (unsigned ms = 0; ms < 40; ms++) { /* main stands still for 40 ms: the queue holds 16 */
		fake_time(by_hand.next_ms * 1000);
		app_on_turn();
		app_on_tick();
		for (unsigned k = 0; k < 10; k++) {
			if (k < 7)
				app_on_x((int16_t)k, (int16_t)k, true);
			app_on_yz((int16_t)k, (int16_t)k, (int16_t)k, (int16_t)k, true);
		}
		by_hand.next_ms++;
	}
	firmware_forget_frames();
	firmware_run(400);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.last_tick_ms, hit_ms + 399);
	assert_int_equal(end.marks, WIRE_MARK_OVERRUN);
	assert_int_equal(firmware_counter(WIRE_COUNTER_samples_overrun), 25 * 54);
	assert_int_equal(firmware_counter(WIRE_COUNTER_ticks_late), 40);
}

static struct wire_capture_end capture_end(void)
{
	struct wire_capture_end end = {0};

	firmware_forget_frames();
	firmware_run(150);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	return end;
}

static void zero_shift_is_marked(void **state)
{
	(void)state;
	firmware_to_captured();
	assert_int_equal(capture_end().marks, 0);
	for (int sign = -1; sign <= 1; sign += 2)
		for (int16_t beyond = 0; beyond < 2; beyond++) { /* default 480 counts */
			firmware_to_separated();
			firmware_run(30);
			by_hand.s2x = 2000;
			firmware_run(1);
			by_hand.s2x = 0;
			by_hand.s2y_offset = (int16_t)(sign * (480 + 2 * beyond));
			firmware_run(405);
			assert_int_equal(capture_end().marks, beyond ? WIRE_MARK_ZERO_SHIFT : 0);
		}
}

static void video_frame_of_the_first_tick(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_captured();
	end = capture_end();
	assert_int_equal(end.camera_frame, end.first_tick_ms - by_hand.release_ms);
	assert_true(end.camera_frame > 0);
	/* a low tower with a long pre-trigger: the window begins before the release */
	firmware_to_ready();
	assert_int_equal(firmware_sdo(0x23, 0x2000, 0, 10000).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2001, 0, 20000).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2002, 0, 30000).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2003, 0, 40000).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2006, 0, 100).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2005, 0, 300).specifier, 0x60);
	firmware_run(400);
	firmware_fall(1);
	app_on_gate(0, fake.now_us);
	firmware_run(19);
	app_on_gate(1, fake.now_us);
	firmware_run(30);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(105);
	end = capture_end();
	assert_in_range(end.camera_frame, -250, -230);
	assert_int_equal(end.camera_frame, (int32_t)(end.first_tick_ms - by_hand.release_ms));
}

/* Main is late just when the firmware decides that the frame never left its latch, and S2 was hit meanwhile.
 */
static void window_of_a_drop_that_was_none_is_thrown_away(void **state)
{
	(void)state;
	firmware_to_armed();
	assert_int_equal(firmware_order(WIRE_OP_RELEASE, FIRMWARE_TOKEN, 0).result, 0);
	firmware_run(748); /* FAULT_HELD comes 756 ms after the release */
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	for (int16_t ms = 0; ms < 14; ms++) {
		fake_time(by_hand.next_ms++ * 1000);
		app_on_turn();
		app_on_tick();
		for (int16_t k = 0; k < 10; k++) {
			if (k < 7)
				app_on_x(k, 2000, true);
			app_on_yz(k, k, k, k, true);
		}
	}
	firmware_forget_frames();
	firmware_run(600);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_LATCH);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0, 0).result, 0);
	firmware_run(200);
	firmware_fall(2); /* the next one has its own */
	firmware_separate();
	firmware_run(130);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(405);
	assert_int_equal(capture_end().drop_id, 2);
	assert_int_equal(capture_end().trigger_us, 100000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(live_blocks_in_every_tick),
	        cmocka_unit_test(whole_drop),
	        cmocka_unit_test(second_drop_has_its_own_window),
	        cmocka_unit_test(resends_on_request),
	        cmocka_unit_test(resend_requests_are_checked),
	        cmocka_unit_test(late_main_loses_nothing_in_the_capture),
	        cmocka_unit_test(zero_shift_is_marked),
	        cmocka_unit_test(video_frame_of_the_first_tick),
	        cmocka_unit_test(window_of_a_drop_that_was_none_is_thrown_away),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
