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
	assert_int_equal(wire_check_capture_end(firmware_last(WIRE_ID_CAPTURE_END)), 0);
	assert_int_equal(end.parameters_crc32, by_hand.parameters);
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
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32 + 1).result, DT_E_CORRUPT);
	reply = firmware_order(WIRE_OP_ACCEPT, end.crc32);
	assert_int_equal(reply.result, 0);
	assert_int_equal(reply.state, WIRE_STATE_UPLOADED);
	firmware_forget_frames();
	firmware_run(300);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

/* Behind the capture end: what was measured, and the set that ARM confirmed, in this order. */
static void what_follows_the_capture_end(void **state)
{
	struct wire_capture_end end;
	struct wire_measured measured;
	struct wire_parameter parameter;
	uint32_t value[WIRE_PARAMETERS];
	unsigned at = 0;

	(void)state;
	firmware_to_ready();
	assert_int_equal(firmware_sdo(0x23, 0x2012, 0, 9000).specifier, 0x60);
	firmware_fall(1);
	by_hand.dropout_us = 8700;
	firmware_separate();
	firmware_run(30);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_forget_frames();
	firmware_run(401);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	firmware_run(250);
	assert_int_equal(firmware_sdo(0x23, 0x2012, 0, 4000).specifier, 0x60); /* of the next drop */
	firmware_forget_frames();
	firmware_ask(1, 0, 0); /* all of it again, also now */
	app_poll();
	while (at < fake.sent_count && fake.sent[at].id != WIRE_ID_CAPTURE_END)
		at++;
	assert_int_equal(fake.sent_count - at, 2 + WIRE_PARAMETERS);
	assert_int_equal(wire_check_capture_end(&fake.sent[at]), 0);
	assert_int_equal(wire_unpack_capture_end(&fake.sent[at++], &end), 0);
	assert_int_equal(wire_check_measured(&fake.sent[at]), 0);
	assert_int_equal(wire_unpack_measured(&fake.sent[at++], &measured), 0);
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		assert_int_equal(wire_unpack_parameter(&fake.sent[at++], &parameter), 0);
		assert_int_equal(parameter.drop_id, 1);
		assert_int_equal(parameter.index, 0x2000 + i);
		value[i] = parameter.value;
	}
	assert_int_equal(value[WIRE_PARAMETER_dropout_limit_us], 9000);
	assert_int_equal(end.parameters_crc32, wire_parameters_crc32(value));
	assert_int_equal(end.marks,
	                 WIRE_MARK_SEPARATED_LATE | WIRE_MARK_DROPOUT_CHANGED); /* 0.7 ms at 3.9 m/s */
	assert_int_equal(measured.drop_id, 1);
	assert_int_equal(measured.dropout_us, 8700);
	assert_int_equal(measured.dropout_used_us, 8000);
	/* sqrt(2 x 0.78 / 9.81) + 0.7 ms: 782.741 mm at 3.919 m/s; half a us at either gate */
	assert_in_range(measured.separation_um, 782720, 782765);
	assert_in_range(measured.separation_mm_s, 3917, 3921);
	assert_in_range(measured.acceleration_mm_s2, 9808, 9812);
	assert_in_range(measured.latch_delay_us, 11990, 12010); /* firmware_fall waits 12 ms */
	assert_int_equal(measured.clock_ppm, 0);
	assert_in_range(measured.trigger_latency_us, 1000, 1200); /* the tick has to end first */
}

/* The next drop's edge is planned with what this one has measured. */
static void the_edge_is_planned_with_what_was_learned(void **state)
{
	struct wire_capture_end end;
	uint32_t lower_us;

	(void)state;
	firmware_to_ready();
	by_hand.dropout_us = 9500;
	for (unsigned drop = 1; drop <= 3; drop++) {
		firmware_fall(drop);
		lower_us = fake.now_us + 377773;
		firmware_separate();
		/* 0.78 m is 21.004 ms behind 0.7 m */
		assert_in_range(fake.off_us[1] - lower_us, drop == 2 ? 11503 : 13003,
		                drop == 2 ? 11505 : 13005);
		firmware_run(30);
		by_hand.s2x = 2000;
		firmware_run(1);
		by_hand.s2x = 0;
		firmware_run(405);
		assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
		assert_int_equal(end.marks, drop == 2 ? WIRE_MARK_CALIBRATED
		                                      : WIRE_MARK_SEPARATED_LATE | WIRE_MARK_DROPOUT_CHANGED);
		assert_int_equal(firmware_order(WIRE_OP_DISCARD, drop).result, 0);
		fake.inputs = FAKE_ALL_GOOD;
		firmware_forget_frames();
		firmware_run(300);
		/* written as it was, refused, or another one written: still learned */
		assert_int_equal(firmware_sdo(0x23, 0x2004, 0, 8000).specifier, 0x60);
		assert_int_equal(firmware_sdo(0x23, 0x2004, 0, 50001).specifier, 0x80);
		assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 961).specifier, 0x60);
		if (drop == 2) { /* calibrated anew: forgotten */
			assert_int_equal(firmware_sdo(0x23, 0x2004, 0, 8001).specifier, 0x60);
			assert_int_equal(firmware_sdo(0x23, 0x2004, 0, 8000).specifier, 0x60);
		}
		firmware_acknowledge();
		firmware_forget_frames();
	}
}

/* Whoever says DISCARD, and even who means it: the blocks are there until the next drop is armed. */
static void the_window_stays_until_the_next_arm(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_captured();
	firmware_forget_frames();
	firmware_run(101);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 0).result, DT_E_CORRUPT);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	fake.inputs = FAKE_ALL_GOOD;
	firmware_run(300);
	firmware_acknowledge();
	assert_int_equal(firmware_status().state, WIRE_STATE_READY);
	/* to be challenged is not to arm */
	assert_int_equal(
	        firmware_order(WIRE_OP_ARM, wire_answer(0, by_hand.session, by_hand.parameters)).result, 0);
	firmware_forget_frames();
	firmware_ask(2, end.first_tick_ms, 500);
	firmware_run(300);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S2), 500);
	assert_int_equal(firmware_arm().result, 0);
	firmware_forget_frames();
	firmware_ask(2, end.first_tick_ms, 500);
	firmware_ask(1, 0, 0);
	firmware_run(300);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S2), 0);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
}

static void a_jammed_frame_keeps_everybody_out(void **state)
{
	struct wire_capture_end end;
	struct wire_nmt nmt = {.command = 129, .node = 1};
	struct frame frame;

	(void)state;
	firmware_to_separated();
	by_hand.down_ms = 0;
	firmware_run(30);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(405);
	assert_int_equal(firmware_status().state, WIRE_STATE_KEEP_OUT);
	assert_int_equal(fake.outputs, 0);
	firmware_forget_frames();
	firmware_run(500);
	assert_in_range(fake_count(WIRE_ID_CAPTURE_END), 4, 5);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.marks, WIRE_MARK_FRAME_NOT_DOWN);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, DT_E_STATE);
	wire_pack_nmt(&frame, WIRE_ID_NMT, &nmt);
	fake_receive(&frame);
	firmware_forget_frames();
	firmware_ask(1, end.first_tick_ms, 20);
	firmware_run(30);
	assert_int_equal(fake.resets, 0);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S1), 20);
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	firmware_run(5);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32).result, 0);
}

/* Wires that break in the fall, singly and together: the dampers are no longer relieved when the frame comes,
 * 0.8 m below, 403.855 ms after its start; and the tower comes to rest. */
static void broken_wires_brake_in_time(void **state)
{
	(void)state;
	for (unsigned wires = 1; wires < 8; wires++) {
		uint32_t start_us;

		firmware_to_falling();
		start_us = fake.now_us;
		firmware_run(50);
		fake.inputs |= (uint16_t)((wires & 1 ? WIRE_IO_GATE_UPPER : 0) |
		                          (wires & 2 ? WIRE_IO_GATE_LOWER : 0) |
		                          (wires & 4 ? WIRE_IO_FRAME_DOWN : 0));
		firmware_run(152);
		if (!(wires & 1))
			app_on_gate(0, start_us + 201928);
		firmware_run(176);
		if (!(wires & 2))
			app_on_gate(1, start_us + 377773);
		while (fake.now_us < start_us + 403800)
			firmware_run_ms();
		assert_false(fake.outputs & WIRE_IO_DAMPERS_RELIEVE);
		assert_true(fake.outputs & WIRE_IO_MAGNET_HOLD);
		by_hand.down_ms = by_hand.next_ms + 5;
		firmware_forget_frames();
		firmware_run(1500);
		assert_int_equal(firmware_status().state, WIRE_STATE_CAPTURED);
		assert_int_equal(firmware_status().fault, WIRE_FAULT_GATES);
	}
}

static void second_drop_has_its_own_window(void **state)
{
	struct wire_capture_end end;
	uint32_t hit_ms;

	(void)state;
	firmware_to_captured();
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	fake.inputs = FAKE_ALL_GOOD;
	firmware_run(400);
	firmware_acknowledge();
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
	firmware_run(1100);
	firmware_fall(1);
	firmware_run(34); /* the latch takes 12 ms, the fall to 10 mm 45 */
	app_on_gate(0, fake.now_us);
	firmware_run(19);
	app_on_gate(1, fake.now_us);
	by_hand.down_ms = by_hand.next_ms + 25;
	firmware_run(30);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(105);
	end = capture_end();
	assert_in_range(end.camera_frame, -220, -190);
	assert_int_equal(end.camera_frame, (int32_t)(end.first_tick_ms - by_hand.release_ms));
}

/* Main is late just when the firmware decides that the frame never left its latch, and S2 was hit meanwhile.
 */
static void window_of_a_drop_that_was_none_is_thrown_away(void **state)
{
	(void)state;
	firmware_to_armed();
	firmware_wait_for_warning();
	assert_int_equal(firmware_release(1).result, 0);
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
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
	firmware_run(1200);
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
	        cmocka_unit_test(what_follows_the_capture_end),
	        cmocka_unit_test(the_edge_is_planned_with_what_was_learned),
	        cmocka_unit_test(the_window_stays_until_the_next_arm),
	        cmocka_unit_test(a_jammed_frame_keeps_everybody_out),
	        cmocka_unit_test(broken_wires_brake_in_time),
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
