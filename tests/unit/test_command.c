/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The whole firmware from outside: checks, commands, and what disarms and aborts.
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
	firmware_run(2000);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE); /* until somebody has looked */
	assert_int_equal(firmware_status().checks, WIRE_CHECK_ACKNOWLEDGE);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).checks, WIRE_CHECK_SETTLE);
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
	firmware_run(3);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(firmware_status().checks, WIRE_CHECK_SHORT_S1);
	fake.bias_high = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2;
	assert_int_equal(firmware_status().checks, WIRE_CHECK_OPEN_S1);
	reply = firmware_arm();
	assert_int_equal(reply.result, DT_E_CHECKS);
	assert_int_equal(reply.checks, WIRE_CHECK_OPEN_S1);
	fake.inputs = FAKE_ALL_GOOD;
	firmware_run(3);
	assert_int_equal(firmware_status().checks, WIRE_CHECK_SETTLE); /* a cable is no guard */
	firmware_run(1000);
	assert_int_equal(firmware_status().state, WIRE_STATE_READY);
}

/* X stops giving 7 samples a millisecond while the tower is ready: no ARM any more. */
static void lost_clocks_are_a_check(void **state)
{
	(void)state;
	firmware_to_ready();
	for (unsigned ms = 0; ms < 200; ms++) {
		fake_time(by_hand.next_ms++ * 1000);
		app_on_turn();
		app_on_tick();
		for (int16_t k = 0; k < 10; k++) {
			if (k < 6)
				app_on_x(1, 2, true);
			app_on_yz(1, 2, 3, 4, true);
		}
		app_poll();
	}
	assert_int_equal(firmware_arm().result, DT_E_CHECKS);
	assert_true(firmware_arm().checks & WIRE_CHECK_CLOCKS);
	assert_int_equal(firmware_arm().state, WIRE_STATE_SAFE);
	fake.brown_out_unset = true;
	firmware_run(200);
	assert_true(firmware_arm().checks & WIRE_CHECK_BROWN_OUT_LEVEL);
}

/* A contact that bounces for two readings is none that opened. */
static void bounces_disarm_nobody(void **state)
{
	static const uint16_t inputs[] = {WIRE_IO_DOOR_CLOSED,  WIRE_IO_ESTOP_CLEAR, WIRE_IO_LATCH_CLOSED,
	                                  WIRE_IO_PRODUCT_HELD, WIRE_IO_GATE_UPPER,  WIRE_IO_FRAME_DOWN};

	(void)state;
	firmware_to_armed();
	for (size_t i = 0; i < sizeof(inputs) / sizeof(inputs[0]); i++) {
		fake.inputs ^= inputs[i];
		firmware_run(2);
		fake.inputs ^= inputs[i];
		firmware_run(3);
	}
	assert_int_equal(firmware_status().state, WIRE_STATE_ARMED);
	fake.inputs ^= WIRE_IO_DOOR_CLOSED;
	firmware_run(3);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_DOOR);
}

/* Two parameters in one millisecond are work for main, not for control. */
static void many_parameters_in_one_poll(void **state)
{
	struct wire_sdo sdo = {.specifier = 0x23, .index = 0x2002};
	struct frame frame;

	(void)state;
	firmware_to_ready();
	for (unsigned i = 0; i < 40; i++) {
		sdo.value = 750000 + i;
		wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, &sdo);
		fake_receive(&frame);
	}
	firmware_forget_frames();
	firmware_run(1);
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 40);
	assert_int_equal(firmware_counter(WIRE_COUNTER_ticks_late), 0);
	assert_int_equal(firmware_sdo(0x40, 0x2002, 0, 0).value, 750039);
}

/* A set that somebody else has changed since the host read it. */
static void a_foreign_parameter_refuses_the_arm(void **state)
{
	(void)state;
	firmware_to_armed();
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0).result, 0);
	firmware_run(3);
	assert_int_equal(firmware_sdo(0x23, 0x2002, 0, 790000).specifier, 0x60);
	assert_int_equal(
	        firmware_order(WIRE_OP_ARM, wire_answer(0, FIRMWARE_SESSION, by_hand.parameters)).result,
	        DT_E_PARAMETERS);
	assert_int_equal(firmware_sdo(0x23, 0x2002, 0, 780000).specifier, 0x60);
	assert_int_equal(
	        firmware_order(WIRE_OP_ARM, wire_answer(0, FIRMWARE_SESSION, by_hand.parameters)).result, 0);
}

/* Told by EMCY as every fault. */
static void a_reset_in_motion_is_told(void **state)
{
	struct wire_emcy emcy;
	uint8_t kept;

	(void)state;
	firmware_to_falling();
	kept = fake.kept;
	fake_init();
	fake.kept = kept;
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	app_init(PORT_RESET_PIN);
	firmware_run(3);
	assert_int_equal(wire_unpack_emcy(firmware_last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x6200);
	assert_int_equal(emcy.fault, WIRE_FAULT_RESET);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
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
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
	assert_int_equal(firmware_arm().result, DT_E_CHECKS);
	assert_int_equal(firmware_arm().checks, WIRE_CHECK_HOST);
	by_hand.host_alive = true;
	by_hand.host_hash ^= 1;
	firmware_run(200);
	assert_int_equal(firmware_arm().result, DT_E_HASH);
	by_hand.host_hash ^= 1;
	firmware_run(1200);
	fake.no_random = true;
	assert_int_equal(firmware_arm().result, DT_E_SYSTEM);
	fake.no_random = false;
	by_hand.session++; /* somebody who does not beat */
	assert_int_equal(firmware_arm().result, DT_E_SESSION);
	by_hand.session--;
	assert_int_equal(firmware_order(WIRE_OP_ARM, wire_answer(0, FIRMWARE_SESSION, 0)).result,
	                 DT_E_PARAMETERS);
	by_hand.session ^= 0x10000; /* the low half fits a host that is here, the key does not */
	assert_int_equal(firmware_arm().result, DT_E_PARAMETERS);
	by_hand.session ^= 0x10000;
	assert_int_equal(firmware_release(1).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, 0).result, DT_E_STATE);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, DT_E_STATE);
	assert_int_equal(firmware_order(99, 0).result, DT_E_UNKNOWN);
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 11);
	assert_int_equal(firmware_arm().result, 0);
	by_hand.session++;
	assert_int_equal(firmware_release(1).result, DT_E_SESSION);
	assert_int_equal(firmware_arm().result, DT_E_STATE);
	by_hand.session--;
	assert_int_equal(firmware_release(2).result, DT_E_TOKEN);
	by_hand.nonce ^= 1;
	assert_int_equal(firmware_release(1).result, DT_E_TOKEN);
	by_hand.nonce ^= 1;
	assert_int_equal(firmware_release(1).result, DT_E_EARLY);
	firmware_run(999);
	assert_int_equal(firmware_release(1).result, DT_E_EARLY);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING);
	firmware_run(1);
	assert_int_equal(firmware_release(1).result, 0);
	assert_int_equal(firmware_release(1).result, DT_E_STATE);
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 18);
}

/* The reply, or the challenge, was lost: the host answers once more, and gets the same nonce. */
static void arm_may_be_repeated(void **state)
{
	struct wire_challenge challenge;
	uint32_t nonce;

	(void)state;
	firmware_to_armed();
	assert_int_equal(wire_unpack_challenge(firmware_last(WIRE_ID_CHALLENGE), &challenge), 0);
	assert_int_equal(challenge.drop_id, 1);
	nonce = by_hand.nonce;
	firmware_run(600);
	assert_int_equal(firmware_arm_again().result, 0);
	assert_int_equal(by_hand.nonce, nonce);
	firmware_forget_frames();
	firmware_ask(1, fake.now_us / 1000 - 100, 50); /* nor the ring: what came before is held */
	firmware_run(60);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S1), 50);
	firmware_run(400); /* no timer began anew */
	assert_int_equal(firmware_release(1).result, 0);
	firmware_to_armed();
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0).result, 0);
	firmware_run(5);
	nonce = by_hand.nonce;
	assert_int_equal(firmware_arm().result, 0);
	assert_int_not_equal(by_hand.nonce, nonce);
	firmware_wait_for_warning();
	by_hand.nonce = nonce; /* of the ARM before */
	assert_int_equal(firmware_release(1).result, DT_E_TOKEN);
}

/* ARM and RELEASE in one poll, as a log that is replayed gives them. */
static void arm_and_release_take_time(void **state)
{
	struct wire_command command = {.op = WIRE_OP_ARM, .host = (uint16_t)FIRMWARE_SESSION};
	struct frame frame;
	uint32_t challenge;

	(void)state;
	firmware_to_armed();
	firmware_order(WIRE_OP_ABORT, 0);
	firmware_run(5);
	challenge = fake.random; /* that will be drawn */
	assert_int_equal(
	        firmware_order(WIRE_OP_ARM, wire_answer(0, FIRMWARE_SESSION, by_hand.parameters)).result, 0);
	command.argument = wire_answer(challenge, FIRMWARE_SESSION, by_hand.parameters);
	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	fake_receive(&frame);
	command.op = WIRE_OP_RELEASE; /* whoever knows the nonce */
	command.argument = wire_answer(fake.random, 1, by_hand.parameters);
	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	fake_receive(&frame);
	app_poll();
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING);
	firmware_wait_for_warning();
	fake_receive(&frame); /* that it was right is shown by what it does now */
	app_poll();
	assert_true(fake.outputs & WIRE_IO_LATCH_OPEN);
}

/* Somebody else's heartbeat does not keep it armed, and somebody else's ARM does not disarm it. */
static void only_who_armed_keeps_it_armed(void **state)
{
	(void)state;
	firmware_to_armed();
	by_hand.session = 0x12345678; /* from here on another host beats */
	firmware_run(300);
	assert_int_equal(firmware_arm().result, DT_E_STATE);
	assert_int_equal(firmware_arm().state, WIRE_STATE_ARMED);
	firmware_run(300);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_HOST_LOST);
	firmware_acknowledge();
	assert_int_equal(firmware_arm().result, 0); /* now it is his turn */
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
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, DT_E_CHECKS);
	by_hand.host_alive = true;
	firmware_run(150);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
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
		firmware_wait_for_warning();
		assert_int_equal(firmware_release(1).result, node < 2 ? DT_E_STATE : 0);
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
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0).state, WIRE_STATE_CAPTURED);
	firmware_run(150);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32).result, 0);
}

static void aborted_fall_is_captured_and_marked(void **state)
{
	struct wire_capture_end end;

	(void)state;
	firmware_to_falling();
	assert_int_equal(firmware_order(WIRE_OP_ABORT, 0).state, WIRE_STATE_FAULT_MOVING);
	firmware_forget_frames();
	by_hand.down_ms = by_hand.next_ms + 400;
	firmware_run(1100);
	assert_true(fake_count(WIRE_ID_CAPTURE_END) > 0);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.marks, WIRE_MARK_NO_IMPACT | WIRE_MARK_FAULT);
	assert_int_equal(end.frame_speed_mm_s, 0);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	firmware_run(250);
	assert_int_equal(firmware_status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
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
	firmware_to_captured(); /* the only copy of a drop */
	nmt(129, 1);
	nmt(130, 1);
	assert_int_equal(fake.resets, 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_commands_refused), 2);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	nmt(129, 1);
	assert_int_equal(fake.resets, 1);
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
	        {{.id = 0x77F, .length = 7, .data = {5, 0, 0, 0, 0}}, false}, /* session 0 is nobody */
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
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 7);
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

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(boots_to_ready),
	        cmocka_unit_test(a_cable_is_told_as_open_or_short),
	        cmocka_unit_test(lost_clocks_are_a_check),
	        cmocka_unit_test(bounces_disarm_nobody),
	        cmocka_unit_test(many_parameters_in_one_poll),
	        cmocka_unit_test(a_foreign_parameter_refuses_the_arm),
	        cmocka_unit_test(a_reset_in_motion_is_told),
	        cmocka_unit_test(ticks_are_milliseconds),
	        cmocka_unit_test(beats_are_regular),
	        cmocka_unit_test(sync_counter_goes_from_1_to_240),
	        cmocka_unit_test(commands_are_refused_with_a_reason),
	        cmocka_unit_test(arm_may_be_repeated),
	        cmocka_unit_test(arm_and_release_take_time),
	        cmocka_unit_test(only_who_armed_keeps_it_armed),
	        cmocka_unit_test(lost_host_disarms),
	        cmocka_unit_test(host_lost_in_motion_is_only_counted),
	        cmocka_unit_test(nmt_stop_aborts),
	        cmocka_unit_test(abort_keeps_the_capture),
	        cmocka_unit_test(aborted_fall_is_captured_and_marked),
	        cmocka_unit_test(reset_at_rest_only),
	        cmocka_unit_test(strange_frames_are_counted),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
