/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Commands at the limits: what each of them leaves alone, seen through frames and counters.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "firmware/app.h"
#include "tests/unit/fake_port.h"

enum { TOKEN = 0x1234 };

static uint32_t next_ms; /* the tick that comes next */
static int16_t s2x;
static uint32_t given; /* frames, to the tower */

static void give(struct frame frame)
{
	fake_receive(&frame);
	given++;
}

static void run_ms(void)
{
	struct frame frame;

	fake_time(next_ms * 1000);
	if (next_ms % 100 == 10) {
		wire_pack_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST,
		                    &(struct wire_heartbeat){.nmt_state = 5, .wire_hash = wire_hash()});
		give(frame);
	}
	app_on_turn();
	app_on_tick();
	for (int k = 0; k < 10; k++) {
		if (k < 7)
			app_on_x(1, s2x, true);
		app_on_yz(2, 3, 4, 5, true);
	}
	app_poll();
	next_ms++;
}

static void run(unsigned ms)
{
	while (ms-- > 0)
		run_ms();
}

static void power_on(void)
{
	fake_init();
	next_ms = 0;
	given = 0;
	s2x = 0;
	app_init(PORT_RESET_POWER_ON);
}

static struct wire_status status(void)
{
	struct wire_status m = {0};

	fake.sent_count = 0;
	for (unsigned i = 0; i < 200 && fake_count(WIRE_ID_STATUS) == 0; i++)
		run_ms();
	assert_int_equal(wire_unpack_status(fake_last(WIRE_ID_STATUS), &m), 0);
	return m;
}

/* As it is said; *before: frames given until it was. */
static uint32_t counter_and(unsigned index, uint32_t *before)
{
	struct wire_counter m = {0};

	for (unsigned i = 0; i < 120 * WIRE_COUNTERS; i++) {
		fake.sent_count = 0;
		*before = given;
		run_ms();
		if (fake_count(WIRE_ID_COUNTER) != 1)
			continue;
		assert_int_equal(wire_unpack_counter(fake_last(WIRE_ID_COUNTER), &m), 0);
		if (m.index == index)
			return m.value;
	}
	fail_msg("counter %u is never sent", index);
	return 0;
}

static uint32_t counter(unsigned index)
{
	uint32_t before;

	return counter_and(index, &before);
}

static struct wire_reply order(unsigned op, uint8_t flags)
{
	struct wire_reply reply = {0};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND,
	                  &(struct wire_command){.op = (uint8_t)op, .sequence = 9, .token = TOKEN});
	frame.flags |= flags;
	give(frame);
	fake.sent_count = 0;
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	assert_int_equal(wire_unpack_reply(fake_last(WIRE_ID_REPLY), &reply), 0);
	return reply;
}

static void nmt(uint8_t command)
{
	struct frame frame;

	wire_pack_nmt(&frame, WIRE_ID_NMT, &(struct wire_nmt){.command = command, .node = 1});
	give(frame);
	app_poll();
}

static struct wire_sdo set(uint16_t index, uint32_t value)
{
	struct wire_sdo answer = {0};
	struct frame frame;

	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST,
	              &(struct wire_sdo){.specifier = 0x23, .index = index, .value = value});
	give(frame);
	fake.sent_count = 0;
	app_poll();
	assert_int_equal(wire_unpack_sdo(fake_last(WIRE_ID_SDO_REPLY), &answer), 0);
	return answer;
}

static void to_ready(void)
{
	power_on();
	run(250);
	assert_int_equal(status().state, WIRE_STATE_READY);
}

static void to_falling(void)
{
	to_ready();
	assert_int_equal(order(WIRE_OP_ARM, 0).result, 0);
	assert_int_equal(order(WIRE_OP_RELEASE, 0).result, 0);
	run(12);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
}

static void to_uploaded(void)
{
	uint32_t start_us;

	to_falling();
	start_us = fake.now_us;
	run(202);
	app_on_gate(0, start_us + 201928);
	run(176);
	app_on_gate(1, start_us + 377773);
	run(44);
	s2x = 2000;
	run(1);
	s2x = 0;
	run(510); /* the CRC goes a tick a poll */
	assert_int_equal(status().state, WIRE_STATE_CAPTURED);
	assert_int_equal(order(WIRE_OP_DISCARD, 0).state, WIRE_STATE_UPLOADED);
}

/* ACCEPT and DISCARD empty the ring; an ABORT while that is shown does not empty it again. */
static void abort_leaves_the_ring_alone(void **state)
{
	struct frame frame;

	(void)state;
	to_uploaded();
	run(20);
	assert_int_equal(order(WIRE_OP_ABORT, 0).state, WIRE_STATE_UPLOADED);
	wire_pack_resend(&frame, WIRE_ID_RESEND,
	                 &(struct wire_resend){.sensor = 1, .count = 10, .first_tick_ms = next_ms - 15});
	give(frame);
	fake.sent_count = 0;
	run(10);
	assert_int_equal(fake_count(WIRE_ID_RESENT_S1), 10);
}

static void a_reset_in_motion_is_refused_and_counted(void **state)
{
	(void)state;
	to_falling();
	nmt(129);
	nmt(130);
	assert_int_equal(fake.resets, 0);
	assert_int_equal(counter(WIRE_COUNTER_commands_refused), 2);
	assert_int_equal(counter(WIRE_COUNTER_resends_out_of_range), 0);
	assert_int_equal(counter(WIRE_COUNTER_blocks_resent), 0);
}

/* Each does its own and is no malformed frame. */
static void nmt_does_one_thing(void **state)
{
	(void)state;
	to_ready();
	fake.sent_count = 0;
	nmt(2);
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	assert_int_equal(fake.resets, 0);
	nmt(129);
	assert_int_equal(fake.resets, 1);
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	nmt(1);
	nmt(128);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 0);
	assert_int_equal(counter(WIRE_COUNTER_frames_unknown), 0);
}

static void parameters_in_safe(void **state)
{
	(void)state;
	power_on();
	fake.inputs &= (uint16_t)~WIRE_IO_DOOR_CLOSED;
	run(50);
	assert_int_equal(status().state, WIRE_STATE_BOOT);
	assert_int_equal(set(0x2007, 320).value, 0x08000022);
	run(200);
	assert_int_equal(status().state, WIRE_STATE_SAFE);
	assert_int_equal(set(0x2007, 320).specifier, 0x60);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 0);
}

static void every_frame_is_counted(void **state)
{
	uint32_t before, received;

	(void)state;
	to_ready();
	give((struct frame){.id = 0x555, .length = 3});
	give((struct frame){.id = 0x201, .length = 3});
	give((struct frame){.id = 0x201, .length = 8, .flags = FRAME_EXTENDED});
	assert_int_equal(order(WIRE_OP_CLEAR, FRAME_FD | FRAME_BRS | FRAME_ESI).result, DT_E_STATE);
	received = counter_and(WIRE_COUNTER_frames_received, &before);
	assert_int_equal(received, before);
	assert_int_equal(counter(WIRE_COUNTER_frames_unknown), 2);
	assert_int_equal(counter(WIRE_COUNTER_frames_malformed), 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(abort_leaves_the_ring_alone),
	        cmocka_unit_test(a_reset_in_motion_is_refused_and_counted),
	        cmocka_unit_test(nmt_does_one_thing),
	        cmocka_unit_test(parameters_in_safe),
	        cmocka_unit_test(every_frame_is_counted),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
