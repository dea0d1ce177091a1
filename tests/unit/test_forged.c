/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What was recorded, forged, reordered or delayed moves nothing. Whole drops are done and everything that
 * their hosts said is kept. A million frames made of that are then given to a tower that is ready, or armed
 * by another host, or armed again by the same: none may move latch, dampers, camera or magnet, or start the
 * warning. Two controls show that the check can fail: the right answers do arm and release, and so does a
 * recording where the nonces come again.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/app.h"
#include "tests/unit/fake_port.h"
#include "tests/unit/firmware_by_hand.h"

enum {
	DROPS = 100,
	TAPE = 8192,
	FRAMES = 1000000,
	PER_MS = 48, /* of 80 that a millisecond's polls take; the host's own come beside them */
	SEED = 20261123,
	MOVES = WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_CAMERA | WIRE_IO_MAGNET_HOLD,
};

static struct frame tape[TAPE];
static unsigned taped;
static uint32_t seed;

static void record(const struct frame *frame)
{
	assert_true(taped < TAPE);
	tape[taped++] = *frame;
}

/* A drop from power on to ACCEPT, by a host and with a nonce of its own. */
static void record_drop(unsigned number)
{
	struct wire_capture_end end;

	firmware_power_on(PORT_RESET_POWER_ON);
	by_hand.session = 0x10000000u * (number % 2) + 0x1000u + number;
	fake.random = 0x9E3779B9u * (number + 1);
	fake.tape = record;
	firmware_run(250);
	firmware_acknowledge();
	firmware_fall(1);
	firmware_separate();
	firmware_run(30);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(450);
	assert_int_equal(wire_unpack_capture_end(firmware_last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32).result, 0);
	fake.tape = NULL;
}

/* The target: its host, what it has been told, and the answers of its earlier arms. */
static struct {
	uint32_t nonce, drop_id, set;
	struct frame stale[8]; /* releases that were right once ... */
	struct frame stale_arm[8];
	unsigned stale_count;
	unsigned given, moved, warned, arms, replayed;
	unsigned armed_ms, other_ms;
	bool deaf;     /* recorded hosts are not heard: nobody but the target's arms */
	unsigned next; /* in the tape */
} target;

static struct frame order_frame(uint8_t op, uint32_t argument)
{
	struct wire_command command = {.op = op,
	                               .sequence = (uint8_t)target.given,
	                               .host = (uint16_t)by_hand.session,
	                               .argument = argument};
	struct frame frame = {0};

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	return frame;
}

static struct frame release_frame(uint32_t nonce, uint16_t drop_id)
{
	return order_frame(WIRE_OP_RELEASE, wire_answer(nonce, drop_id, target.set));
}

/* The one frame that may release. */
static bool right(const struct frame *frame)
{
	struct frame good = release_frame(by_hand.nonce, 1);

	return frame->id == good.id && frame->data[0] == good.data[0] &&
	       memcmp(frame->data + 2, good.data + 2, 6) == 0;
}

static struct frame forge(void)
{
	uint32_t r = fake_random(&seed), kind = r % 8;
	struct frame frame = release_frame(by_hand.nonce, 1);

	if (kind < 2) { /* as it was recorded, one after the other */
		target.replayed++;
		return tape[target.next++ % taped];
	}
	if (kind == 2) /* in any order */
		return tape[(r >> 3) % taped];
	if (kind == 3 && r >> 31) /* ... and arms, that of now too, which changes nothing once more */
		return target.stale_arm[(r >> 3) % (target.arms < 8 ? target.arms : 8)];
	if (kind == 3 && target.stale_count > 0) /* late */
		return target.stale[(r >> 3) % target.stale_count];
	if (kind == 4) { /* one or two bits beside the right one */
		frame.data[2 + (r >> 3) % 6] ^= (uint8_t)(1u << (r >> 8) % 8);
		if (r >> 31)
			frame.data[2 + (r >> 11) % 6] ^= (uint8_t)(1u << (r >> 16) % 8);
	} else if (kind == 5) { /* the right host, any key */
		for (unsigned i = 4; i < 8; i++)
			frame.data[i] = (uint8_t)fake_random(&seed);
	} else if (kind == 6) { /* of other drops, nonces and hosts */
		frame = release_frame(by_hand.nonce + (r >> 3) % 3 - 1, (uint16_t)((r >> 5) % 4));
		frame.data[2] ^= (uint8_t)(r >> 7 & 1);
	} else { /* anything but ABORT, that is never refused */
		for (unsigned i = 0; i < 8; i++)
			frame.data[i] = (uint8_t)fake_random(&seed);
		if (frame.data[0] == WIRE_OP_ABORT)
			frame.data[0] = WIRE_OP_ARM;
	}
	return frame;
}

static void give(void)
{
	struct frame frame = forge();

	while (right(&frame) || (target.deaf && frame.id == WIRE_ID_HEARTBEAT_HOST))
		frame = forge();
	fake_receive(&frame);
	target.given++;
}

static void one_ms(void)
{
	uint16_t before = fake.outputs;

	for (unsigned i = 0; i < PER_MS && target.given < FRAMES; i++)
		give();
	firmware_forget_frames();
	firmware_run_ms();
	target.warned += (fake.outputs & ~before & WIRE_IO_WARNING) != 0;
	if (fake.outputs & WIRE_IO_WARNING)
		target.armed_ms++;
	else
		target.other_ms++;
	if ((fake.outputs & MOVES) != WIRE_IO_MAGNET_HOLD)
		target.moved++;
	if (target.moved != 0)
		fail_msg("outputs %#x after frame %u, seed %u", fake.outputs, target.given, SEED);
}

/* By its own host, whoever else has armed meanwhile. */
static void arm_target(void)
{
	struct wire_reply reply;

	firmware_order(WIRE_OP_ABORT, 0);
	for (unsigned i = 0; i < 20; i++) {
		firmware_forget_frames();
		firmware_run(300);
		if (firmware_status().state == WIRE_STATE_FAULT_HELD)
			assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
		reply = firmware_arm();
		if (reply.result == 0)
			break;
		firmware_order(WIRE_OP_ABORT, 0);
	}
	assert_int_equal(reply.result, 0);
	target.set = by_hand.parameters;
	target.stale_arm[target.arms % 8] = order_frame(WIRE_OP_ARM, by_hand.answer);
	target.stale[target.arms++ % 8] = release_frame(by_hand.nonce, 1);
}

static void to_target(void)
{
	firmware_power_on(PORT_RESET_POWER_ON);
	by_hand.session = 0x0BADCAFE;
	fake.random = 0x600DF00D;
	firmware_run(250);
	firmware_acknowledge();
}

static void a_million_frames_move_nothing(void **state)
{
	(void)state;
	print_message("# seed %u, %u frames of %u drops recorded\n", SEED, taped, DROPS);
	seed = SEED;
	memset(&target, 0, sizeof(target));
	to_target();
	while (target.given < FRAMES) {
		arm_target();
		target.stale_count = target.arms - 1 < 8 ? target.arms - 1 : 8;
		if (target.stale_count == 8) /* not the one that is right now */
			target.stale[(target.arms - 1) % 8] = target.stale[target.arms % 8];
		target.deaf = target.arms % 4 == 0;
		if (target.deaf) { /* to a tower that is ready, too */
			firmware_run(600);
			firmware_order(WIRE_OP_ABORT, 0);
		}
		for (unsigned ms = 0; ms < 2500 && target.given < FRAMES; ms++)
			one_ms();
	}
	print_message("# %u frames, %u of them as recorded, %u arms, %u ms armed, %u ms not, %u warnings, %u "
	              "moves\n",
	              target.given, target.replayed, target.arms, target.armed_ms, target.other_ms,
	              target.warned, target.moved);
	assert_int_equal(target.given, FRAMES);
	assert_int_equal(target.moved, 0);
	assert_int_equal(target.warned, 0);
	assert_true(target.arms >= 8 && target.armed_ms > 10000 && target.other_ms > 2000);
	arm_target(); /* the tower is as willing as ever */
	firmware_wait_for_warning();
	assert_int_equal(firmware_release(1).result, 0);
	assert_true(fake.outputs & WIRE_IO_LATCH_OPEN);
}

/* The whole tape, onto a tower that is ready: with fresh nonces nothing moves, not even the warning; with the
 * nonces of the recording it falls, which shows that nothing else in the recording is wrong. */
static void only_the_nonce_keeps_a_recording_out(void **state)
{
	(void)state;
	for (unsigned again = 0; again < 2; again++) {
		bool fell = false, warned = false;
		unsigned arms = 0;

		to_target();
		for (unsigned i = 0; i < taped; i++) {
			bool arm = tape[i].id == WIRE_ID_COMMAND && tape[i].data[0] == WIRE_OP_ARM;

			if (again && arm && arms++ % 2 == 0)
				fake.random = 0x9E3779B9u; /* of the first drop, challenge and answer */
			fake_receive(&tape[i]);
			firmware_run(tape[i].id == WIRE_ID_HEARTBEAT_HOST ? 100 : 1);
			firmware_forget_frames();
			fell |= (fake.outputs & WIRE_IO_LATCH_OPEN) != 0;
			warned |= (fake.outputs & WIRE_IO_WARNING) != 0;
		}
		assert_int_equal(fell, again);
		assert_int_equal(warned, again);
	}
}

static int record_drops(void **state)
{
	(void)state;
	for (unsigned i = 0; i < DROPS; i++)
		record_drop(i);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(a_million_frames_move_nothing),
	        cmocka_unit_test(only_the_nonce_keeps_a_recording_out),
	};

	return cmocka_run_group_tests(tests, record_drops, NULL);
}
