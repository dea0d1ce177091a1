/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The whole firmware from outside: checks, commands, what disarms and aborts, and whatever comes.
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

static void nmt(unsigned command, unsigned node)
{
	struct frame frame;

	wire_pack_nmt(&frame, WIRE_ID_NMT,
	              &(struct wire_nmt){.command = (uint8_t)command, .node = (uint8_t)node});
	fake_receive(&frame);
	app_poll();
}

static void boots_to_ready(void **state)
{
	struct wire_heartbeat beat;

	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	firmware_run_ms();
	assert_int_equal(wire_unpack_heartbeat(firmware_last(WIRE_ID_HEARTBEAT_TOWER), &beat), 0);
	assert_int_equal(beat.nmt_state, 0);
	assert_int_equal(beat.wire_hash, wire_hash());
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(firmware_status().state, WIRE_STATE_BOOT);
	firmware_forget_frames();
	firmware_run(1000);
	assert_int_equal(firmware_status().state, WIRE_STATE_READY);
	assert_int_equal(firmware_status().checks, 0);
}

/* Which sensor, which fault: in the status, and in the reply to the ARM that is refused for it. */
static void a_cable_is_told_as_open_or_short(void **state)
{
	struct wire_reply reply;

	(void)state;
	firmware_to_ready();
	fake.inputs &= (uint16_t)~WIRE_IO_IEPE_S1;
	firmware_run(2);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(firmware_status().checks, WIRE_CHECK_SHORT_S1);
	fake.bias_high = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2;
	assert_int_equal(firmware_status().checks, WIRE_CHECK_OPEN_S1);
	reply = firmware_order(WIRE_OP_ARM, FIRMWARE_TOKEN, 0);
	assert_int_equal(reply.result, DT_E_CHECKS);
	assert_int_equal(reply.checks, WIRE_CHECK_OPEN_S1);
	fake.inputs = FAKE_ALL_GOOD;
	firmware_run(2);
	assert_int_equal(firmware_status().checks, 0);
}

/* Control that is asked for without a millisecond, or three milliseconds late. */
static void ticks_are_milliseconds(void **state)
{
	struct wire_block block;

	(void)state;
	firmware_to_ready();
	firmware_run(1);
	app_on_tick();
	app_on_tick();
	firmware_forget_frames();
	firmware_run(2);
	assert_int_equal(wire_unpack_block(firmware_last(WIRE_ID_BLOCK_S1), &block), 0);
	assert_int_equal(block.tick_ms, by_hand.next_ms - 2); /* the last is open */
	for (unsigned ms = 0; ms < 2; ms++)
		app_on_turn();
	by_hand.next_ms += 2;
	firmware_run(2);
	assert_int_equal(wire_unpack_block(firmware_last(WIRE_ID_BLOCK_S1), &block), 0);
	assert_int_equal(block.tick_ms, by_hand.next_ms - 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_samples_overrun), 2 * 54);
}

static void beats_are_regular(void **state)
{
	struct wire_heartbeat beat;
	struct wire_sync sync;
	struct wire_time time;

	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	firmware_run(100);
	firmware_forget_frames();
	firmware_run(900); /* ticks 100 to 999 */
	assert_int_equal(fake_count(WIRE_ID_HEARTBEAT_TOWER), 9);
	assert_int_equal(fake_count(WIRE_ID_STATUS), 9);
	assert_int_equal(fake_count(WIRE_ID_COUNTER), 9);
	assert_int_equal(fake_count(WIRE_ID_SYNC), 0);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 900);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S2), 900);
	for (unsigned i = 0; i < fake.sent_count; i++)
		if (fake.sent[i].id == WIRE_ID_HEARTBEAT_TOWER) {
			assert_int_equal(wire_unpack_heartbeat(&fake.sent[i], &beat), 0);
			assert_int_not_equal(beat.nmt_state, 0); /* boot-up is said once */
		}
	firmware_run_ms(); /* tick 1000 */
	assert_int_equal(wire_unpack_sync(firmware_last(WIRE_ID_SYNC), &sync), 0);
	assert_int_equal(sync.counter, 2);
	assert_int_equal(wire_unpack_time(firmware_last(WIRE_ID_TIME), &time), 0);
	assert_int_equal(time.ms, 1000);
	assert_int_equal(time.days, 0);
	assert_int_equal(fake.kicks, 1001);
}

static void sync_counter_goes_from_1_to_240(void **state)
{
	struct wire_sync sync = {0};

	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	for (unsigned second = 0; second < 242; second++) {
		/* one poll a second is enough to see it, and counts as late */
		for (unsigned ms = 0; ms < 1000; ms++) {
			app_on_turn();
			app_on_tick();
		}
		firmware_forget_frames();
		app_poll();
		assert_int_equal(wire_unpack_sync(firmware_last(WIRE_ID_SYNC), &sync), 0);
		assert_int_equal(sync.counter, second % 240 + 1);
	}
	by_hand.next_ms = 242000;
	assert_int_equal(firmware_counter(WIRE_COUNTER_ticks_late), 242 * 999);
}

static void commands_are_refused_with_a_reason(void **state)
{
	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	by_hand.host_alive = false;
	firmware_run(250);
	assert_int_equal(firmware_order(WIRE_OP_ARM, FIRMWARE_TOKEN, 0).result, DT_E_CHECKS);
	assert_int_equal(firmware_order(WIRE_OP_ARM, FIRMWARE_TOKEN, 0).checks, WIRE_CHECK_HOST);
	by_hand.host_alive = true;
	by_hand.host_hash ^= 1;
	firmware_run(200);
	assert_int_equal(firmware_order(WIRE_OP_ARM, FIRMWARE_TOKEN, 0).result, DT_E_HASH);
	by_hand.host_hash ^= 1;
	firmware_run(200);
	assert_int_equal(firmware_order(WIRE_OP_ARM, 0, 0).result, DT_E_TOKEN);
	assert_int_equal(firmware_order(WIRE_OP_RELEASE, FIRMWARE_TOKEN, 0).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, 0, 0).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0, 0).result, DT_E_STATE);
	assert_int_equal(firmware_order(99, 0, 0).result, DT_E_UNKNOWN);
	assert_int_equal(firmware_order(WIRE_OP_ARM, FIRMWARE_TOKEN, 0).result, 0);
	assert_int_equal(firmware_order(WIRE_OP_RELEASE, FIRMWARE_TOKEN ^ 1, 0).result, DT_E_TOKEN);
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0, 0).result, 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 9);
}

static void lost_host_disarms(void **state)
{
	struct wire_emcy emcy;

	(void)state;
	firmware_to_armed();
	by_hand.host_alive = false;
	firmware_forget_frames();
	firmware_run(650);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_HOST_LOST);
	firmware_to_armed();
	by_hand.host_alive = false;
	firmware_forget_frames();
	firmware_run(650);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_int_equal(wire_unpack_emcy(firmware_last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x8130);
	assert_int_equal(emcy.error_register, 0x11);
	assert_int_equal(emcy.fault, WIRE_FAULT_HOST_LOST);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0, 0).result, DT_E_CHECKS);
	by_hand.host_alive = true;
	firmware_run(150);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0, 0).result, 0);
	firmware_run(5);
	assert_int_equal(wire_unpack_emcy(firmware_last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0);
	assert_int_equal(emcy.error_register, 0);
}

static void host_lost_in_motion_is_only_counted(void **state)
{
	(void)state;
	firmware_to_falling();
	by_hand.host_alive = false;
	firmware_run(200);
	app_on_gate(0, fake.now_us);
	firmware_run(176);
	app_on_gate(1, fake.now_us);
	firmware_run(300);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_NONE);
	assert_int_equal(firmware_counter(WIRE_COUNTER_host_heartbeats_lost), 1);
}

static void nmt_stop_aborts(void **state)
{
	struct wire_reply reply;

	(void)state;
	for (unsigned node = 0; node <= 2; node++) {
		firmware_to_armed();
		firmware_forget_frames();
		nmt(2, node);
		assert_int_equal(fake_count(WIRE_ID_REPLY), node < 2);
		if (node < 2) {
			assert_int_equal(wire_unpack_reply(firmware_last(WIRE_ID_REPLY), &reply), 0);
			assert_int_equal(reply.op, WIRE_OP_ABORT);
			assert_int_equal(reply.result, 0);
			assert_int_equal(reply.state, WIRE_STATE_SAFE);
		}
		assert_int_equal(firmware_order(WIRE_OP_RELEASE, FIRMWARE_TOKEN, 0).result,
		                 node < 2 ? DT_E_STATE : 0);
	}
	firmware_to_falling();
	nmt(2, 0);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_ABORTED);
}

static void abort_keeps_the_capture(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_captured();
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0, 0).state, WIRE_STATE_CAPTURED);
	firmware_run(150);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, 0, end.crc32).result, 0);
}

static void aborted_fall_is_captured_and_marked(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_falling();
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0, 0).state, WIRE_STATE_FAULT_MOVING);
	firmware_forget_frames();
	firmware_run(1100);
	assert_true(fake_count(WIRE_ID_CAPTURE_END) > 0);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.marks, WIRE_MARK_NO_IMPACT | WIRE_MARK_FAULT);
	assert_int_equal(end.frame_speed_mm_s, 0);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 0, 0).result, 0);
	firmware_run(250);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0, 0).result, 0);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
}

static void reset_at_rest_only(void **state)
{
	(void)state;
	firmware_to_ready();
	nmt(129, 2);
	nmt(1, 1);
	nmt(128, 0);
	assert_int_equal(fake.resets, 0);
	nmt(129, 1);
	assert_int_equal(fake.resets, 1);
	nmt(130, 0);
	assert_int_equal(fake.resets, 2);
	firmware_to_falling();
	nmt(129, 1);
	assert_int_equal(fake.resets, 0);
	nmt(7, 1);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 1);
}

static void strange_frames_are_counted(void **state)
{
	static const struct {
		struct frame frame;
		bool unknown;
	} frames[] = {
	        {{.id = 0x123, .length = 8}, true},
	        {{.id = 0x201, .length = 8, .flags = FRAME_EXTENDED}, true},
	        {{.id = 0x201, .length = 7}, false},
	        {{.id = 0x201, .length = 8, .flags = FRAME_REMOTE}, false},
	        {{.id = 0x301, .length = 0}, false},
	        {{.id = 0x601, .length = 12, .flags = FRAME_FD}, false},
	        {{.id = 0x77F, .length = 1}, false},
	        {{.id = 0x000, .length = 1}, false},
	};
	uint32_t seed = 7;

	(void)state;
	firmware_to_ready();
	for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]); i++) {
		fake_receive(&frames[i].frame);
		firmware_run_ms();
	}
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_unknown), 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 6);
	for (unsigned i = 0; i < 20000; i++) { /* nothing that comes in harms */
		static const uint16_t ids[] = {0x000, 0x201, 0x301, 0x601, 0x77F};
		struct frame frame = {.id = ids[fake_random(&seed) % 5],
		                      .length = (uint8_t)(fake_random(&seed) % 9)};

		for (unsigned k = 0; k < 8; k++)
			frame.data[k] = (uint8_t)(fake_random(&seed) % (k < 2 ? 8 : 256));
		fake_receive(&frame);
		firmware_run_ms();
		firmware_forget_frames();
	}
}

static void random_frame(uint32_t *seed)
{
	static const uint16_t ids[] = {0x000, 0x201, 0x201, 0x201, 0x301, 0x601, 0x601, 0x201};
	struct frame frame = {.id = ids[fake_random(seed) % 8], .length = 8};
	uint32_t r = fake_random(seed);

	if (r % 16 == 0)
		frame.length = (uint8_t)(r >> 8) % 9;
	for (unsigned k = 0; k < 8; k++)
		frame.data[k] = (uint8_t)fake_random(seed);
	if (frame.id == WIRE_ID_COMMAND) { /* ARM and RELEASE with the same token, mostly */
		frame.data[0] = (uint8_t)(1 + r / 16 % 7);
		frame.data[2] = 0x34;
		frame.data[3] = r / 128 % 8 ? 0x12 : 0x13;
	}
	if (frame.id == WIRE_ID_SDO_REQUEST) {
		frame.data[0] = r % 64 == 0 ? 0x23 : 0x40;
		frame.data[1] = (uint8_t)(r / 128 % 17);
		frame.data[2] = 0x20;
		frame.data[3] = 0;
		frame.data[5] = frame.data[6] = frame.data[7] = 0;
	}
	if (frame.id == WIRE_ID_NMT && r % 4)
		frame.length = 2;
	fake_receive(&frame);
}

static void random_world(uint32_t *seed, bool falling)
{
	uint32_t r = fake_random(seed);

	fake.inputs = FAKE_ALL_GOOD;
	if (r % 256 == 0)
		fake.inputs ^= (uint16_t)(1u << (4 + (r >> 8) % 11));
	if (falling)
		fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	if (falling && r >> 16 & 1)
		app_on_gate(r >> 17 & 1, fake.now_us);
	fake.bus_off = (r >> 18) % 512 == 0;
	fake.can_room = (r >> 24) % 16 ? UINT32_MAX : (r >> 28);
	fake.no_setup = (r >> 20) % 16 == 0;
	by_hand.s2x = !falling || (r >> 12) % 64 ? 0 : 2000;
}

static void whole_firmware_stays_safe(void **state)
{
	uint32_t seed = 20261123;
	bool falling = false;
	unsigned falls = 0;

	(void)state;
	firmware_to_ready();
	for (unsigned step = 0; step < 30000; step++) {
		uint16_t before = fake.outputs;

		if (fake_random(&seed) % 8 == 0)
			random_frame(&seed);
		if (fake_random(&seed) % 2)
			random_world(&seed, falling);
		firmware_run_ms();
		if (fake.outputs & ~before & WIRE_IO_LATCH_OPEN) {
			falls++;
			if (!(fake.inputs & WIRE_IO_DOOR_CLOSED) || !(fake.inputs & WIRE_IO_DAMPERS_ENGAGED))
				fail_msg("latch opened with door or dampers red, step %u", step);
		}
		falling = fake.outputs & WIRE_IO_LATCH_OPEN;
		if ((before & ~fake.outputs & WIRE_IO_MAGNET_HOLD) && !(before & WIRE_IO_DAMPERS_RELIEVE))
			fail_msg("magnet let go without a fall, step %u", step);
		firmware_forget_frames();
	}
	assert_true(falls > 10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(boots_to_ready),
	        cmocka_unit_test(a_cable_is_told_as_open_or_short),
	        cmocka_unit_test(ticks_are_milliseconds),
	        cmocka_unit_test(beats_are_regular),
	        cmocka_unit_test(sync_counter_goes_from_1_to_240),
	        cmocka_unit_test(commands_are_refused_with_a_reason),
	        cmocka_unit_test(lost_host_disarms),
	        cmocka_unit_test(host_lost_in_motion_is_only_counted),
	        cmocka_unit_test(nmt_stop_aborts),
	        cmocka_unit_test(abort_keeps_the_capture),
	        cmocka_unit_test(aborted_fall_is_captured_and_marked),
	        cmocka_unit_test(reset_at_rest_only),
	        cmocka_unit_test(strange_frames_are_counted),
	        cmocka_unit_test(whole_firmware_stays_safe),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
