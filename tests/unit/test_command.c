/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The whole firmware from outside: frames in, frames and outputs out, on a port that the test plays.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/crc.h"
#include "common/segment.h"
#include "firmware/app.h"
#include "tests/unit/fake_port.h"

enum { TOKEN = 0x1234 };

static uint32_t next_ms; /* the tick that comes next */
static uint32_t release_ms;
static bool host_alive;
static uint32_t host_hash;
static int16_t s2x; /* what S2 X reads, 0: noise only */
static int16_t s2y_offset;
static struct frame seen[FAKE_SENT_MAX];

static const struct frame *last(uint32_t id)
{
	const struct frame *frame = fake_last(id);

	if (frame == NULL)
		fail_msg("no frame 0x%03x was sent", id);
	return frame;
}

static void host_beat(void)
{
	struct frame frame;

	wire_pack_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST,
	                    &(struct wire_heartbeat){.nmt_state = 5, .wire_hash = host_hash});
	fake_receive(&frame);
}

static void forget_frames(void)
{
	fake.sent_count = 0;
}

/* One millisecond; main runs after each sample instant of Y. */
static void run_ms(void)
{
	fake_time(next_ms * 1000);
	if (host_alive && next_ms % 100 == 10)
		host_beat();
	app_on_turn();
	app_on_tick();
	for (int k = 0; k < 10; k++) {
		int16_t noise = (int16_t)(next_ms + (uint32_t)k) & 1;

		if (k < 7)
			app_on_x(noise, s2x ? s2x : noise, true);
		app_on_yz(noise, noise, (int16_t)(4 + noise + s2y_offset), noise, true);
		fake_time(next_ms * 1000 + 100 * (unsigned)k);
		app_poll();
	}
	next_ms++;
}

static void run(unsigned ms)
{
	while (ms-- > 0)
		run_ms();
}

static void power_on(enum port_reset cause)
{
	fake_init();
	next_ms = 0;
	host_alive = true;
	host_hash = wire_hash();
	s2x = 0;
	s2y_offset = 0;
	app_init(cause);
}

static struct wire_status status(void)
{
	struct wire_status m = {0};

	forget_frames();
	for (unsigned i = 0; i < 200 && fake_count(WIRE_ID_STATUS) == 0; i++)
		run_ms();
	assert_int_equal(wire_unpack_status(last(WIRE_ID_STATUS), &m), 0);
	return m;
}

static uint32_t counter(unsigned index)
{
	struct wire_counter m = {0};

	for (unsigned i = 0; i <= WIRE_COUNTERS; i++) {
		forget_frames();
		run(100);
		assert_int_equal(fake_count(WIRE_ID_COUNTER), 1);
		assert_int_equal(wire_unpack_counter(last(WIRE_ID_COUNTER), &m), 0);
		if (m.index == index)
			return m.value;
	}
	fail_msg("counter %u is never sent", index);
	return 0;
}

static struct wire_reply order(unsigned op, uint16_t token, uint32_t argument)
{
	static uint8_t sequence;
	struct wire_command command = {
	        .op = (uint8_t)op, .sequence = ++sequence, .token = token, .argument = argument};
	struct wire_reply reply = {0};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	fake_receive(&frame);
	forget_frames();
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	assert_int_equal(wire_unpack_reply(last(WIRE_ID_REPLY), &reply), 0);
	assert_int_equal(reply.op, op);
	assert_int_equal(reply.sequence, sequence);
	return reply;
}

static void nmt(unsigned command, unsigned node)
{
	struct frame frame;

	wire_pack_nmt(&frame, WIRE_ID_NMT,
	              &(struct wire_nmt){.command = (uint8_t)command, .node = (uint8_t)node});
	fake_receive(&frame);
	app_poll();
}

static struct wire_sdo sdo(unsigned specifier, unsigned index, unsigned subindex, uint32_t value)
{
	struct wire_sdo m = {.specifier = (uint8_t)specifier,
	                     .index = (uint16_t)index,
	                     .subindex = (uint8_t)subindex,
	                     .value = value};
	struct frame frame;

	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, &m);
	fake_receive(&frame);
	forget_frames();
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 1);
	assert_int_equal(wire_unpack_sdo(last(WIRE_ID_SDO_REPLY), &m), 0);
	assert_int_equal(m.index, index);
	return m;
}

static void to_ready(void)
{
	power_on(PORT_RESET_POWER_ON);
	run(250);
	assert_int_equal(status().state, WIRE_STATE_READY);
}

static void to_armed(void)
{
	to_ready();
	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).result, 0);
}

static void fall(unsigned drop_id)
{
	struct wire_reply reply;

	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).result, 0);
	reply = order(WIRE_OP_RELEASE, TOKEN, 0);
	assert_int_equal(reply.result, 0);
	assert_int_equal(reply.state, WIRE_STATE_FALLING);
	assert_int_equal(reply.drop_id, drop_id);
	release_ms = next_ms - 1;
	run(12);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
}

static void to_falling(void)
{
	to_ready();
	fall(1);
}

/* The gates as in free fall; the magnet goes off at 390.8 ms. */
static void separate(void)
{
	uint32_t start_us = fake.now_us;

	run(202);
	app_on_gate(0, start_us + 201928);
	run(176);
	app_on_gate(1, start_us + 377773);
	run(14);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
}

static void to_separated(void)
{
	to_falling();
	separate();
}

static void to_captured(void)
{
	to_separated();
	run(30);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(405);
	assert_int_equal(status().state, WIRE_STATE_CAPTURED);
}

static void boots_to_ready(void **state)
{
	struct wire_heartbeat beat;

	(void)state;
	power_on(PORT_RESET_POWER_ON);
	run_ms();
	assert_int_equal(wire_unpack_heartbeat(last(WIRE_ID_HEARTBEAT_TOWER), &beat), 0);
	assert_int_equal(beat.nmt_state, 0);
	assert_int_equal(beat.wire_hash, wire_hash());
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(status().state, WIRE_STATE_BOOT);
	forget_frames();
	run(1000);
	assert_int_equal(status().state, WIRE_STATE_READY);
	assert_int_equal(status().checks, 0);
}

/* Which sensor, which fault: in the status, and in the reply to the ARM that is refused for it. */
static void a_cable_is_told_as_open_or_short(void **state)
{
	struct wire_reply reply;

	(void)state;
	to_ready();
	fake.inputs &= (uint16_t)~WIRE_IO_IEPE_S1;
	run(2);
	assert_int_equal(status().state, WIRE_STATE_SAFE);
	assert_int_equal(status().checks, WIRE_CHECK_SHORT_S1);
	fake.bias_high = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2;
	assert_int_equal(status().checks, WIRE_CHECK_OPEN_S1);
	reply = order(WIRE_OP_ARM, TOKEN, 0);
	assert_int_equal(reply.result, DT_E_CHECKS);
	assert_int_equal(reply.checks, WIRE_CHECK_OPEN_S1);
	fake.inputs = FAKE_ALL_GOOD;
	run(2);
	assert_int_equal(status().checks, 0);
}

/* Control that is asked for without a millisecond, or three milliseconds late. */
static void ticks_are_milliseconds(void **state)
{
	struct wire_block block;

	(void)state;
	to_ready();
	run(1);
	app_on_tick();
	app_on_tick();
	forget_frames();
	run(2);
	assert_int_equal(wire_unpack_block(last(WIRE_ID_BLOCK_S1), &block), 0);
	assert_int_equal(block.tick_ms, next_ms - 2); /* the last is open */
	for (unsigned ms = 0; ms < 2; ms++)
		app_on_turn();
	next_ms += 2;
	run(2);
	assert_int_equal(wire_unpack_block(last(WIRE_ID_BLOCK_S1), &block), 0);
	assert_int_equal(block.tick_ms, next_ms - 2);
	assert_int_equal(counter(WIRE_COUNTER_samples_overrun), 2 * 54);
}

static void beats_are_regular(void **state)
{
	struct wire_heartbeat beat;
	struct wire_sync sync;
	struct wire_time time;

	(void)state;
	power_on(PORT_RESET_POWER_ON);
	run(100);
	forget_frames();
	run(900); /* ticks 100 to 999 */
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
	run_ms(); /* tick 1000 */
	assert_int_equal(wire_unpack_sync(last(WIRE_ID_SYNC), &sync), 0);
	assert_int_equal(sync.counter, 2);
	assert_int_equal(wire_unpack_time(last(WIRE_ID_TIME), &time), 0);
	assert_int_equal(time.ms, 1000);
	assert_int_equal(time.days, 0);
	assert_int_equal(fake.kicks, 1001);
}

static void sync_counter_goes_from_1_to_240(void **state)
{
	struct wire_sync sync = {0};

	(void)state;
	power_on(PORT_RESET_POWER_ON);
	for (unsigned second = 0; second < 242; second++) {
		/* one poll a second is enough to see it, and counts as late */
		for (unsigned ms = 0; ms < 1000; ms++) {
			app_on_turn();
			app_on_tick();
		}
		forget_frames();
		app_poll();
		assert_int_equal(wire_unpack_sync(last(WIRE_ID_SYNC), &sync), 0);
		assert_int_equal(sync.counter, second % 240 + 1);
	}
	next_ms = 242000;
	assert_int_equal(counter(WIRE_COUNTER_ticks_late), 242 * 999);
}

static void live_blocks_in_every_tick(void **state)
{
	struct wire_block block;

	(void)state;
	to_ready();
	forget_frames();
	run(50);
	for (unsigned i = 0, n = 0; i < fake.sent_count; i++)
		if (fake.sent[i].id == WIRE_ID_BLOCK_S2) {
			assert_int_equal(wire_check_block(&fake.sent[i]), 0);
			assert_int_equal(wire_unpack_block(&fake.sent[i], &block), 0);
			assert_int_equal(block.tick_ms, next_ms - 51 + n++);
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
	to_separated();
	forget_frames();
	run(300); /* with the window longer than the 600 ms after which no impact is a fault */
	hit_ms = next_ms;
	s2x = -2000;
	run(1);
	s2x = 0;
	run(399);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	run(1); /* closes the last tick of the window */
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 1);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.drop_id, 1);
	assert_int_equal(end.first_tick_ms, hit_ms - 100);
	assert_int_equal(end.last_tick_ms, hit_ms + 399);
	assert_int_equal(end.trigger_us, 100000);
	assert_int_equal(end.marks, 0);
	assert_int_equal(end.camera_frame, end.first_tick_ms - release_ms);
	assert_in_range(end.frame_speed_mm_s, 2842, 2844);
	count = fake.sent_count;
	memcpy(seen, fake.sent, count * sizeof(seen[0]));
	assert_int_equal(end.crc32, crc_of_blocks(seen, count, end.first_tick_ms, end.last_tick_ms));
	forget_frames();
	run(500);
	assert_in_range(fake_count(WIRE_ID_CAPTURE_END), 4, 5); /* again and again */
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 500);    /* live goes on */
	assert_int_equal(order(WIRE_OP_ACCEPT, 0, end.crc32 + 1).result, DT_E_CORRUPT);
	reply = order(WIRE_OP_ACCEPT, 0, end.crc32);
	assert_int_equal(reply.result, 0);
	assert_int_equal(reply.state, WIRE_STATE_UPLOADED);
	forget_frames();
	run(300);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(status().state, WIRE_STATE_SAFE);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
}

static void second_drop_has_its_own_window(void **state)
{
	struct wire_capture_end end;
	uint32_t hit_ms;

	(void)state;
	to_captured();
	assert_int_equal(order(WIRE_OP_DISCARD, 0, 0).result, 0);
	fake.inputs = FAKE_ALL_GOOD;
	run(400);
	fall(2);
	separate();
	run(30);
	hit_ms = next_ms;
	s2x = 2000;
	run(1);
	s2x = 0;
	forget_frames();
	run(410);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.drop_id, 2);
	assert_int_equal(end.first_tick_ms, hit_ms - 100);
	assert_int_equal(end.marks, 0);
}

static void ask(unsigned sensor, uint32_t first_ms, unsigned count)
{
	struct frame frame;

	wire_pack_resend(&frame, WIRE_ID_RESEND,
	                 &(struct wire_resend){.sensor = (uint8_t)sensor,
	                                       .count = (uint16_t)count,
	                                       .first_tick_ms = first_ms});
	fake_receive(&frame);
}

static void resends_on_request(void **state)
{
	struct wire_capture_end end;
	unsigned count, found = 0;

	(void)state;
	to_separated();
	forget_frames();
	run(100);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(401);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	count = fake.sent_count;
	memcpy(seen, fake.sent, count * sizeof(seen[0]));
	forget_frames();
	ask(1, end.first_tick_ms, 500);
	ask(2, end.first_tick_ms, 500);
	run(510);
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
	forget_frames();
	ask(2, 0, 0);
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 1);
}

static void resend_requests_are_checked(void **state)
{
	(void)state;
	to_ready();
	ask(0, 100, 1);
	ask(3, 100, 1);
	ask(1, 0, 0); /* no capture */
	ask(1, next_ms + 100, 5);
	run(1);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 2);
	assert_int_equal(counter(WIRE_COUNTER_resends_out_of_range), 6);
}

static void commands_are_refused_with_a_reason(void **state)
{
	(void)state;
	power_on(PORT_RESET_POWER_ON);
	host_alive = false;
	run(250);
	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).result, DT_E_CHECKS);
	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).checks, WIRE_CHECK_HOST);
	host_alive = true;
	host_hash ^= 1;
	run(200);
	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).result, DT_E_HASH);
	host_hash ^= 1;
	run(200);
	assert_int_equal(order(WIRE_OP_ARM, 0, 0).result, DT_E_TOKEN);
	assert_int_equal(order(WIRE_OP_RELEASE, TOKEN, 0).result, DT_E_STATE);
	assert_int_equal(order(WIRE_OP_ACCEPT, 0, 0).result, DT_E_STATE);
	assert_int_equal(order(WIRE_OP_CLEAR, 0, 0).result, DT_E_STATE);
	assert_int_equal(order(99, 0, 0).result, DT_E_UNKNOWN);
	assert_int_equal(order(WIRE_OP_ARM, TOKEN, 0).result, 0);
	assert_int_equal(order(WIRE_OP_RELEASE, TOKEN ^ 1, 0).result, DT_E_TOKEN);
	assert_int_equal(order(WIRE_OP_ABORT, 0, 0).result, 0);
	assert_int_equal(counter(WIRE_COUNTER_commands_refused), 9);
}

static void lost_host_disarms(void **state)
{
	struct wire_emcy emcy;

	(void)state;
	to_armed();
	host_alive = false;
	forget_frames();
	run(650);
	assert_int_equal(status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(status().fault, WIRE_FAULT_HOST_LOST);
	to_armed();
	host_alive = false;
	forget_frames();
	run(650);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_int_equal(wire_unpack_emcy(last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x8130);
	assert_int_equal(emcy.error_register, 0x11);
	assert_int_equal(emcy.fault, WIRE_FAULT_HOST_LOST);
	assert_int_equal(order(WIRE_OP_CLEAR, 0, 0).result, DT_E_CHECKS);
	host_alive = true;
	run(150);
	assert_int_equal(order(WIRE_OP_CLEAR, 0, 0).result, 0);
	run(5);
	assert_int_equal(wire_unpack_emcy(last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0);
	assert_int_equal(emcy.error_register, 0);
}

static void host_lost_in_motion_is_only_counted(void **state)
{
	(void)state;
	to_falling();
	host_alive = false;
	run(200);
	app_on_gate(0, fake.now_us);
	run(176);
	app_on_gate(1, fake.now_us);
	run(300);
	assert_int_equal(status().fault, WIRE_FAULT_NONE);
	assert_int_equal(counter(WIRE_COUNTER_host_heartbeats_lost), 1);
}

static void nmt_stop_aborts(void **state)
{
	struct wire_reply reply;

	(void)state;
	for (unsigned node = 0; node <= 2; node++) {
		to_armed();
		forget_frames();
		nmt(2, node);
		assert_int_equal(fake_count(WIRE_ID_REPLY), node < 2);
		if (node < 2) {
			assert_int_equal(wire_unpack_reply(last(WIRE_ID_REPLY), &reply), 0);
			assert_int_equal(reply.op, WIRE_OP_ABORT);
			assert_int_equal(reply.result, 0);
			assert_int_equal(reply.state, WIRE_STATE_SAFE);
		}
		assert_int_equal(order(WIRE_OP_RELEASE, TOKEN, 0).result, node < 2 ? DT_E_STATE : 0);
	}
	to_falling();
	nmt(2, 0);
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(status().fault, WIRE_FAULT_ABORTED);
}

static void abort_keeps_the_capture(void **state)
{
	struct wire_capture_end end;

	(void)state;
	to_captured();
	assert_int_equal(order(WIRE_OP_ABORT, 0, 0).state, WIRE_STATE_CAPTURED);
	run(150);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(order(WIRE_OP_ACCEPT, 0, end.crc32).result, 0);
}

static void aborted_fall_is_captured_and_marked(void **state)
{
	struct wire_capture_end end;

	(void)state;
	to_falling();
	assert_int_equal(order(WIRE_OP_ABORT, 0, 0).state, WIRE_STATE_FAULT_MOVING);
	forget_frames();
	run(1100);
	assert_true(fake_count(WIRE_ID_CAPTURE_END) > 0);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.marks, WIRE_MARK_NO_IMPACT | WIRE_MARK_FAULT);
	assert_int_equal(end.frame_speed_mm_s, 0);
	assert_int_equal(order(WIRE_OP_DISCARD, 0, 0).result, 0);
	run(250);
	assert_int_equal(status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(order(WIRE_OP_CLEAR, 0, 0).result, 0);
	assert_int_equal(status().state, WIRE_STATE_SAFE);
}

static void reset_at_rest_only(void **state)
{
	(void)state;
	to_ready();
	nmt(129, 2);
	nmt(1, 1);
	nmt(128, 0);
	assert_int_equal(fake.resets, 0);
	nmt(129, 1);
	assert_int_equal(fake.resets, 1);
	nmt(130, 0);
	assert_int_equal(fake.resets, 2);
	to_falling();
	nmt(129, 1);
	assert_int_equal(fake.resets, 0);
	nmt(7, 1);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 1);
}

static void parameters_by_sdo(void **state)
{
	static const struct {
		unsigned specifier, index, subindex;
		uint32_t value, answer;
		unsigned answer_specifier;
	} cases[] = {
	        {0x40, 0x2007, 0, 0, 960, 0x43},
	        {0x23, 0x2007, 0, 320, 0, 0x60},
	        {0x40, 0x2007, 0, 0, 320, 0x43},
	        {0x23, 0x2007, 0, 159, 0x06090032, 0x80},
	        {0x23, 0x2007, 0, 16001, 0x06090031, 0x80},
	        {0x23, 0x2007, 0, 160, 0, 0x60},
	        {0x23, 0x2007, 0, 16000, 0, 0x60},
	        {0x23, 0x2007, 0, 320, 0, 0x60},
	        {0x40, 0x2007, 0, 0, 320, 0x43},
	        {0x40, 0x1FFF, 0, 0, 0x06020000, 0x80},
	        {0x23, 0x2010, 0, 1, 0x06020000, 0x80},
	        {0x23, 0x200E, 0, 2, 0x06090031, 0x80},
	        {0x40, 0x200F, 0, 0, 5000, 0x43},
	        {0x23, 0x200F, 0, 1999, 0x06090032, 0x80},
	        {0x23, 0x200F, 0, 8001, 0x06090031, 0x80},
	        {0x23, 0x200F, 0, 4000, 0x06090030, 0x80}, /* none of 2, 5, 8 Mbit/s */
	        {0x23, 0x200F, 0, 2000, 0, 0x60},
	        {0x23, 0x200F, 0, 8000, 0, 0x60},
	        {0x40, 0x200F, 0, 0, 8000, 0x43},
	        {0x40, 0x2007, 1, 0, 0x06090011, 0x80},
	        {0x2F, 0x2007, 0, 1, 0x05040001, 0x80},
	        {0x23, 0x2000, 0, 690001, 0x06040043, 0x80}, /* gates 10 mm apart */
	        {0x23, 0x2000, 0, 690000, 0, 0x60},
	        {0x23, 0x2002, 0, 700000, 0x06040043, 0x80}, /* separation below the lower gate */
	        {0x23, 0x2002, 0, 800001, 0x06040043, 0x80}, /* and not below the dampers */
	        {0x23, 0x2002, 0, 800000, 0, 0x60},
	        {0x23, 0x2005, 0, 113, 0x06040043, 0x80}, /* with 400 after the trigger more than 512 */
	        {0x23, 0x2005, 0, 112, 0, 0x60},
	};

	(void)state;
	to_ready();
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct wire_sdo m =
		        sdo(cases[i].specifier, cases[i].index, cases[i].subindex, cases[i].value);

		if (m.specifier != cases[i].answer_specifier || m.value != cases[i].answer)
			fail_msg("case %zu: %#x %#x, expected %#x %#x", i, m.specifier, m.value,
			         cases[i].answer_specifier, cases[i].answer);
	}
}

static void abort_of_a_transfer_needs_no_answer(void **state)
{
	struct frame frame;

	(void)state;
	to_ready();
	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, &(struct wire_sdo){.specifier = 0x80, .index = 0x2007});
	fake_receive(&frame);
	forget_frames();
	run(2);
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 0);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 0);
}

static void parameters_are_not_written_while_armed(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	assert_int_equal(sdo(0x40, 0x2007, 0, 0).value, 960);
	to_falling();
	assert_int_equal(sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	to_captured();
	assert_int_equal(sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	power_on(PORT_RESET_WATCHDOG);
	run(10);
	assert_int_equal(sdo(0x23, 0x2007, 0, 320).specifier, 0x60);
}

static void new_parameters_move_the_edges(void **state)
{
	uint32_t start_us;

	(void)state;
	to_ready();
	assert_int_equal(sdo(0x23, 0x2004, 0, 0).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2002, 0, 750000).specifier, 0x60);
	fall(1);
	start_us = fake.now_us;
	app_on_gate(0, start_us + 200000);
	app_on_gate(1, start_us + 375000);
	/* (sqrt .75 - sqrt .7) / (sqrt .7 - sqrt .2) = .0293654 / .3894464 = .0754029, of 175 ms: 13.1955 ms
	 */
	assert_in_range(fake.off_us[1] - start_us, 388194, 388197);
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
	to_ready();
	for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]); i++) {
		fake_receive(&frames[i].frame);
		run_ms();
	}
	assert_int_equal(counter(WIRE_COUNTER_frames_unknown), 2);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 6);
	for (unsigned i = 0; i < 20000; i++) { /* nothing that comes in harms */
		static const uint16_t ids[] = {0x000, 0x201, 0x301, 0x601, 0x77F};
		struct frame frame = {.id = ids[fake_random(&seed) % 5],
		                      .length = (uint8_t)(fake_random(&seed) % 9)};

		for (unsigned k = 0; k < 8; k++)
			frame.data[k] = (uint8_t)(fake_random(&seed) % (k < 2 ? 8 : 256));
		fake_receive(&frame);
		run_ms();
		forget_frames();
	}
}

static void bus_off_is_counted_and_told(void **state)
{
	struct wire_emcy emcy;

	(void)state;
	to_ready();
	fake.bus_off = true;
	fake.bus_errors = 17;
	run(5);
	fake.bus_off = false;
	forget_frames();
	run(5);
	assert_int_equal(wire_unpack_emcy(last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x8140);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_true(fake_count(WIRE_ID_BLOCK_S1) > 5); /* the waiting ones too */
	assert_int_equal(counter(WIRE_COUNTER_bus_offs), 1);
	assert_int_equal(counter(WIRE_COUNTER_bus_errors), 17);
	assert_true(counter(WIRE_COUNTER_frames_deferred) > 0);
	assert_int_equal(counter(WIRE_COUNTER_frames_dropped), 0);
	to_armed();
	fake.bus_off = true;
	run(2);
	fake.bus_off = false;
	forget_frames();
	run(5);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_int_equal(status().fault, WIRE_FAULT_BUS_OFF);
}

static void late_main_loses_nothing_in_the_capture(void **state)
{
	struct wire_capture_end end;
	uint32_t hit_ms;

	(void)state;
	to_separated();
	run(150);
	hit_ms = next_ms;
	s2x = 2000;
	run(1);
	s2x = 0;
	for (unsigned ms = 0; ms < 40; ms++) { /* main stands still for 40 ms: the queue holds 16 */
		fake_time(next_ms * 1000);
		app_on_turn();
		app_on_tick();
		for (unsigned k = 0; k < 10; k++) {
			if (k < 7)
				app_on_x((int16_t)k, (int16_t)k, true);
			app_on_yz((int16_t)k, (int16_t)k, (int16_t)k, (int16_t)k, true);
		}
		next_ms++;
	}
	forget_frames();
	run(400);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	assert_int_equal(end.last_tick_ms, hit_ms + 399);
	assert_int_equal(end.marks, WIRE_MARK_OVERRUN);
	assert_int_equal(counter(WIRE_COUNTER_samples_overrun), 25 * 54);
	assert_int_equal(counter(WIRE_COUNTER_ticks_late), 40);
}

/* ---- the bus ---- */

static void bus_is_set_up_at_reset(void **state)
{
	(void)state;
	power_on(PORT_RESET_POWER_ON);
	assert_int_equal(fake.setups, 1);
	assert_false(fake.classic);
	assert_int_equal(fake.data_kbit_s, 5000);
}

static void bus_follows_its_parameters(void **state)
{
	(void)state;
	to_ready();
	assert_int_equal(sdo(0x23, 0x200F, 0, 8000).specifier, 0x60);
	assert_int_equal(fake.data_kbit_s, 8000);
	assert_false(fake.classic);
	assert_int_equal(sdo(0x23, 0x200E, 0, 1).specifier, 0x60);
	assert_true(fake.classic);
	assert_int_equal(fake.setups, 3);
	assert_int_equal(sdo(0x23, 0x2007, 0, 320).specifier, 0x60); /* not the bus's */
	assert_int_equal(sdo(0x23, 0x200E, 0, 1).specifier, 0x60);   /* nothing new */
	assert_int_equal(fake.setups, 3);
	fake.no_setup = true;
	assert_int_equal(sdo(0x23, 0x200E, 0, 0).value, 0x06060000);
	assert_int_equal(sdo(0x40, 0x200E, 0, 0).value, 1); /* as it was */
	forget_frames();
	run(10);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 0);
	fake.no_setup = false;
	assert_int_equal(sdo(0x23, 0x200E, 0, 0).specifier, 0x60);
	run(10);
	assert_in_range(fake_count(WIRE_ID_BLOCK_S1), 9, 10);
	to_armed();
	assert_int_equal(sdo(0x23, 0x200E, 0, 1).value, 0x08000022);
	assert_int_equal(fake.setups, 1);
}

/* The port is asked again as long as it refuses everything, but not in motion. */
static void refused_bus_is_asked_for_again(void **state)
{
	(void)state;
	fake_init();
	fake.no_setup = true;
	next_ms = 0;
	app_init(PORT_RESET_POWER_ON);
	fake.can_full = true;
	run(50);
	assert_int_equal(fake.setups, 0);
	fake.no_setup = false;
	run(2);
	assert_int_equal(fake.setups, 1);
	assert_true(fake.classic);
	run(200);
	assert_int_equal(fake.setups, 1);
	fake_init();
	fake.no_setup = true;
	next_ms = 0;
	app_init(PORT_RESET_POWER_ON);
	run(250);
	fall(1);
	fake.no_setup = false;
	run(100);
	assert_int_equal(fake.setups, 0);
	separate();
	run(30);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(405);
	assert_int_equal(fake.setups, 1);
}

/* All frames of one identifier, put together; -1 where what came is no whole message. */
static unsigned collect(uint32_t id, struct frame *messages, unsigned room)
{
	struct segment_join join = {0};
	unsigned count = 0;

	for (unsigned i = 0; i < fake.sent_count; i++) {
		const struct frame *whole = NULL;

		assert_true((fake.sent[i].flags & FRAME_FD) == 0 && fake.sent[i].length <= 8);
		if (fake.sent[i].id == id)
			whole = segment_feed(&join, &fake.sent[i]);
		if (whole != NULL && count < room)
			messages[count++] = *whole;
	}
	assert_int_equal(join.incomplete, 0);
	return count;
}

static void classic_drop(void)
{
	static struct frame s1[64], s2[64], ends[64];
	struct wire_capture_end end;
	uint32_t crc = CRC32_INIT;

	assert_int_equal(sdo(0x23, 0x2005, 0, 10).specifier, 0x60); /* a short window */
	assert_int_equal(sdo(0x23, 0x2006, 0, 40).specifier, 0x60);
	forget_frames();
	fall(1);
	separate();
	run(30);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 0);
	forget_frames();
	s2x = 2000;
	run(1);
	s2x = 0;
	for (unsigned ms = 0; ms < 220; ms++) { /* 1 Mbit/s takes 7.4 such frames a ms */
		fake.can_room = 7;
		run_ms();
	}
	assert_true(collect(WIRE_ID_CAPTURE_END, ends, 64) >= 1);
	assert_int_equal(wire_unpack_capture_end(&ends[0], &end), 0);
	assert_int_equal(end.last_tick_ms - end.first_tick_ms + 1, 50);
	assert_int_equal(collect(WIRE_ID_RESENT_S1, s1, 64), 50);
	assert_int_equal(collect(WIRE_ID_RESENT_S2, s2, 64), 50);
	for (unsigned i = 0; i < 50; i++) {
		assert_int_equal(wire_check_block(&s1[i]), 0);
		crc = crc32(crc, s1[i].data + 10, 54);
		crc = crc32(crc, s2[i].data + 10, 54);
	}
	assert_int_equal(crc, end.crc32);
	fake.can_room = UINT32_MAX;
	run(20);
	forget_frames();
	ask(2, end.first_tick_ms + 7, 1);
	run(3);
	assert_int_equal(collect(WIRE_ID_RESENT_S2, s1, 64), 1);
	assert_memory_equal(s1[0].data, s2[7].data, 64);
	assert_int_equal(order(WIRE_OP_ACCEPT, 0, end.crc32).result, 0);
	run(300);
	assert_int_equal(status().state, WIRE_STATE_SAFE);
	assert_int_equal(counter(WIRE_COUNTER_frames_dropped), 0);
	assert_int_equal(counter(WIRE_COUNTER_blocks_resent), 101);
}

static void classic_bus_uploads_after_the_drop(void **state)
{
	(void)state;
	to_ready();
	assert_int_equal(sdo(0x23, 0x200E, 0, 1).specifier, 0x60);
	classic_drop();
	fake_init(); /* a controller without FD */
	fake.no_fd = true;
	next_ms = 0;
	app_init(PORT_RESET_POWER_ON);
	run(250);
	assert_int_equal(status().state, WIRE_STATE_READY);
	assert_int_equal(sdo(0x40, 0x200E, 0, 0).value, 1);
	assert_int_equal(sdo(0x23, 0x200E, 0, 0).value, 0x06060000);
	classic_drop();
}

/* ---- what a capture end says ---- */

static struct wire_capture_end capture_end(void)
{
	struct wire_capture_end end = {0};

	forget_frames();
	run(150);
	assert_int_equal(wire_unpack_capture_end(last(WIRE_ID_CAPTURE_END), &end), 0);
	return end;
}

static void zero_shift_is_marked(void **state)
{
	(void)state;
	to_captured();
	assert_int_equal(capture_end().marks, 0);
	for (int sign = -1; sign <= 1; sign += 2)
		for (int16_t beyond = 0; beyond < 2; beyond++) { /* default 480 counts */
			to_separated();
			run(30);
			s2x = 2000;
			run(1);
			s2x = 0;
			s2y_offset = (int16_t)(sign * (480 + 2 * beyond));
			run(405);
			assert_int_equal(capture_end().marks, beyond ? WIRE_MARK_ZERO_SHIFT : 0);
		}
}

static void video_frame_of_the_first_tick(void **state)
{
	struct wire_capture_end end;

	(void)state;
	to_captured();
	end = capture_end();
	assert_int_equal(end.camera_frame, end.first_tick_ms - release_ms);
	assert_true(end.camera_frame > 0);
	/* a low tower with a long pre-trigger: the window begins before the release */
	to_ready();
	assert_int_equal(sdo(0x23, 0x2000, 0, 10000).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2001, 0, 20000).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2002, 0, 30000).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2003, 0, 40000).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2006, 0, 100).specifier, 0x60);
	assert_int_equal(sdo(0x23, 0x2005, 0, 300).specifier, 0x60);
	run(400);
	fall(1);
	app_on_gate(0, fake.now_us);
	run(19);
	app_on_gate(1, fake.now_us);
	run(30);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(105);
	end = capture_end();
	assert_in_range(end.camera_frame, -250, -230);
	assert_int_equal(end.camera_frame, (int32_t)(end.first_tick_ms - release_ms));
}

/* Main is late just when the firmware decides that the frame never left its latch, and S2 was hit meanwhile.
 */
static void window_of_a_drop_that_was_none_is_thrown_away(void **state)
{
	(void)state;
	to_armed();
	assert_int_equal(order(WIRE_OP_RELEASE, TOKEN, 0).result, 0);
	run(748); /* FAULT_HELD comes 756 ms after the release */
	assert_int_equal(fake.outputs, WIRE_IO_MAGNET_HOLD);
	for (int16_t ms = 0; ms < 14; ms++) {
		fake_time(next_ms++ * 1000);
		app_on_turn();
		app_on_tick();
		for (int16_t k = 0; k < 10; k++) {
			if (k < 7)
				app_on_x(k, 2000, true);
			app_on_yz(k, k, k, k, true);
		}
	}
	forget_frames();
	run(600);
	assert_int_equal(fake_count(WIRE_ID_CAPTURE_END), 0);
	assert_int_equal(status().state, WIRE_STATE_FAULT_HELD);
	assert_int_equal(status().fault, WIRE_FAULT_LATCH);
	assert_int_equal(order(WIRE_OP_CLEAR, 0, 0).result, 0);
	run(200);
	fall(2); /* the next one has its own */
	separate();
	run(130);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(405);
	assert_int_equal(capture_end().drop_id, 2);
	assert_int_equal(capture_end().trigger_us, 100000);
}

/* ---- random frames, inputs, gates and a bus that comes and goes ---- */

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
	s2x = !falling || (r >> 12) % 64 ? 0 : 2000;
}

static void whole_firmware_stays_safe(void **state)
{
	uint32_t seed = 20261123;
	bool falling = false;
	unsigned falls = 0;

	(void)state;
	to_ready();
	for (unsigned step = 0; step < 30000; step++) {
		uint16_t before = fake.outputs;

		if (fake_random(&seed) % 8 == 0)
			random_frame(&seed);
		if (fake_random(&seed) % 2)
			random_world(&seed, falling);
		run_ms();
		if (fake.outputs & ~before & WIRE_IO_LATCH_OPEN) {
			falls++;
			if (!(fake.inputs & WIRE_IO_DOOR_CLOSED) || !(fake.inputs & WIRE_IO_DAMPERS_ENGAGED))
				fail_msg("latch opened with door or dampers red, step %u", step);
		}
		falling = fake.outputs & WIRE_IO_LATCH_OPEN;
		if ((before & ~fake.outputs & WIRE_IO_MAGNET_HOLD) && !(before & WIRE_IO_DAMPERS_RELIEVE))
			fail_msg("magnet let go without a fall, step %u", step);
		forget_frames();
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
	        cmocka_unit_test(live_blocks_in_every_tick),
	        cmocka_unit_test(whole_drop),
	        cmocka_unit_test(second_drop_has_its_own_window),
	        cmocka_unit_test(resends_on_request),
	        cmocka_unit_test(resend_requests_are_checked),
	        cmocka_unit_test(commands_are_refused_with_a_reason),
	        cmocka_unit_test(lost_host_disarms),
	        cmocka_unit_test(host_lost_in_motion_is_only_counted),
	        cmocka_unit_test(nmt_stop_aborts),
	        cmocka_unit_test(abort_keeps_the_capture),
	        cmocka_unit_test(aborted_fall_is_captured_and_marked),
	        cmocka_unit_test(reset_at_rest_only),
	        cmocka_unit_test(parameters_by_sdo),
	        cmocka_unit_test(abort_of_a_transfer_needs_no_answer),
	        cmocka_unit_test(parameters_are_not_written_while_armed),
	        cmocka_unit_test(new_parameters_move_the_edges),
	        cmocka_unit_test(strange_frames_are_counted),
	        cmocka_unit_test(bus_off_is_counted_and_told),
	        cmocka_unit_test(late_main_loses_nothing_in_the_capture),
	        cmocka_unit_test(bus_is_set_up_at_reset),
	        cmocka_unit_test(bus_follows_its_parameters),
	        cmocka_unit_test(refused_bus_is_asked_for_again),
	        cmocka_unit_test(classic_bus_uploads_after_the_drop),
	        cmocka_unit_test(zero_shift_is_marked),
	        cmocka_unit_test(video_frame_of_the_first_tick),
	        cmocka_unit_test(window_of_a_drop_that_was_none_is_thrown_away),
	        cmocka_unit_test(whole_firmware_stays_safe),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
