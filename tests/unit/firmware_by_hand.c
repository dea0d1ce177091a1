/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/firmware_by_hand.h"

#include <setjmp.h>
#include <stdarg.h>
#include <cmocka.h>

#include "firmware/app.h"
#include "tests/unit/fake_port.h"

struct firmware_by_hand by_hand;

const struct frame *firmware_last(uint32_t id)
{
	const struct frame *frame = fake_last(id);

	if (frame == NULL)
		fail_msg("no frame 0x%03x was sent", id);
	return frame;
}

static void host_beat(void)
{
	struct frame frame;

	wire_pack_host_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST,
	                         &(struct wire_host_heartbeat){.nmt_state = 5,
	                                                       .session = by_hand.session,
	                                                       .wire_hash_low = (uint16_t)by_hand.host_hash});
	fake_receive(&frame);
}

void firmware_forget_frames(void)
{
	fake.sent_count = 0;
}

/* What the tower does by itself. */
static void world(void)
{
	if (by_hand.down_ms != 0 && by_hand.next_ms == by_hand.down_ms)
		fake.inputs |= WIRE_IO_FRAME_DOWN;
	if (by_hand.keeper_us != 0 && (int32_t)(by_hand.next_ms * 1000 - by_hand.keeper_us) >= 0) {
		app_on_keeper(by_hand.keeper_us);
		fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
		by_hand.keeper_us = 0;
	}
}

/* One millisecond; main runs after each sample instant of Y. */
void firmware_run_ms(void)
{
	fake_time(by_hand.next_ms * 1000);
	if (by_hand.host_alive && by_hand.next_ms % 100 == 10)
		host_beat();
	world();
	app_on_turn();
	app_on_tick();
	for (int k = 0; k < 10; k++) {
		int16_t noise = (int16_t)(by_hand.next_ms + (uint32_t)k) & 1;

		if (k < 7)
			app_on_x(noise, by_hand.s2x ? by_hand.s2x : noise, true);
		app_on_yz(noise, noise, (int16_t)(4 + noise + by_hand.s2y_offset), noise, true);
		fake_time(by_hand.next_ms * 1000 + 100 * (unsigned)k);
		app_poll();
	}
	by_hand.next_ms++;
}

void firmware_run(unsigned ms)
{
	while (ms-- > 0)
		firmware_run_ms();
}

void firmware_power_on(enum port_reset cause)
{
	fake_init();
	by_hand = (struct firmware_by_hand){.host_alive = true,
	                                    .host_hash = wire_hash(),
	                                    .session = FIRMWARE_SESSION,
	                                    .dropout_us = FIRMWARE_DROPOUT_US};
	app_init(cause);
}

struct wire_status firmware_status(void)
{
	struct wire_status m = {0};

	firmware_forget_frames();
	for (unsigned i = 0; i < 200 && fake_count(WIRE_ID_STATUS) == 0; i++)
		firmware_run_ms();
	assert_int_equal(wire_unpack_status(firmware_last(WIRE_ID_STATUS), &m), 0);
	return m;
}

uint32_t firmware_counter(unsigned index)
{
	struct wire_counter m = {0};

	for (unsigned i = 0; i <= WIRE_COUNTERS; i++) {
		firmware_forget_frames();
		firmware_run(100);
		assert_int_equal(fake_count(WIRE_ID_COUNTER), 1);
		assert_int_equal(wire_unpack_counter(firmware_last(WIRE_ID_COUNTER), &m), 0);
		if (m.index == index)
			return m.value;
	}
	fail_msg("counter %u is never sent", index);
	return 0;
}

struct wire_reply firmware_order(unsigned op, uint32_t argument)
{
	static uint8_t sequence;
	struct wire_command command = {.op = (uint8_t)op,
	                               .sequence = ++sequence,
	                               .host = (uint16_t)by_hand.session,
	                               .argument = argument};
	struct wire_reply reply = {0};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	fake_receive(&frame);
	firmware_forget_frames();
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_REPLY), 1);
	assert_int_equal(wire_unpack_reply(firmware_last(WIRE_ID_REPLY), &reply), 0);
	assert_int_equal(reply.op, op);
	assert_int_equal(reply.sequence, sequence);
	return reply;
}

struct wire_sdo firmware_sdo(unsigned specifier, unsigned index, unsigned subindex, uint32_t value)
{
	struct wire_sdo m = {.specifier = (uint8_t)specifier,
	                     .index = (uint16_t)index,
	                     .subindex = (uint8_t)subindex,
	                     .value = value};
	struct frame frame;

	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, &m);
	fake_receive(&frame);
	firmware_forget_frames();
	app_poll();
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 1);
	assert_int_equal(wire_unpack_sdo(firmware_last(WIRE_ID_SDO_REPLY), &m), 0);
	assert_int_equal(m.index, index);
	return m;
}

static uint32_t read_parameters(void)
{
	static const uint16_t indices[WIRE_PARAMETERS] = {
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) index,
#include "common/wire.def"
	};
	uint32_t value[WIRE_PARAMETERS];

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		value[i] = firmware_sdo(0x40, indices[i], 0, 0).value;
	return wire_parameters_crc32(value);
}

struct wire_reply firmware_arm_again(void)
{
	struct wire_reply reply = firmware_order(WIRE_OP_ARM, by_hand.answer);
	struct wire_challenge challenge;

	assert_int_equal(fake_count(WIRE_ID_CHALLENGE), reply.result == 0);
	if (reply.result == 0) {
		assert_true(firmware_last(WIRE_ID_CHALLENGE) < firmware_last(WIRE_ID_REPLY));
		assert_int_equal(wire_unpack_challenge(firmware_last(WIRE_ID_CHALLENGE), &challenge), 0);
		assert_int_equal(challenge.host, (uint16_t)by_hand.session);
		assert_int_equal(challenge.drop_id != 0, reply.state == WIRE_STATE_ARMED);
		by_hand.nonce = challenge.nonce;
	}
	return reply;
}

struct wire_reply firmware_arm(void)
{
	struct wire_reply reply;

	by_hand.parameters = read_parameters();
	by_hand.answer = wire_answer(0, by_hand.session, by_hand.parameters);
	reply = firmware_arm_again();
	if (reply.result != 0)
		return reply;
	assert_int_equal(reply.state, WIRE_STATE_READY);
	by_hand.answer = wire_answer(by_hand.nonce, by_hand.session, by_hand.parameters);
	return firmware_arm_again();
}

struct wire_reply firmware_release(unsigned drop_id)
{
	return firmware_order(WIRE_OP_RELEASE,
	                      wire_answer(by_hand.nonce, (uint16_t)drop_id, by_hand.parameters));
}

void firmware_wait_for_warning(void)
{
	firmware_run(1000);
}

void firmware_acknowledge(void)
{
	assert_int_equal(firmware_order(WIRE_OP_CLEAR, 0).result, 0);
	firmware_run(1005);
}

void firmware_ask(unsigned sensor, uint32_t first_ms, unsigned count)
{
	struct frame frame;

	wire_pack_resend(&frame, WIRE_ID_RESEND,
	                 &(struct wire_resend){.sensor = (uint8_t)sensor,
	                                       .count = (uint16_t)count,
	                                       .first_tick_ms = first_ms});
	fake_receive(&frame);
}

void firmware_to_ready(void)
{
	firmware_power_on(PORT_RESET_POWER_ON);
	firmware_run(250);
	firmware_acknowledge();
	assert_int_equal(firmware_status().state, WIRE_STATE_READY);
}

void firmware_to_armed(void)
{
	firmware_to_ready();
	assert_int_equal(firmware_arm().result, 0);
}

void firmware_fall(unsigned drop_id)
{
	struct wire_reply reply;

	assert_int_equal(firmware_arm().result, 0);
	firmware_wait_for_warning();
	reply = firmware_release(drop_id);
	assert_int_equal(reply.result, 0);
	assert_int_equal(reply.state, WIRE_STATE_FALLING);
	by_hand.release_ms = by_hand.next_ms - 1;
	firmware_run(12);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
}

void firmware_to_falling(void)
{
	firmware_to_ready();
	firmware_fall(1);
}

/* The gates as in free fall; the magnet goes off at 390.8 ms. */
void firmware_separate(void)
{
	uint32_t start_us = fake.now_us;

	firmware_run(202);
	app_on_gate(0, start_us + 201928);
	firmware_run(176);
	app_on_gate(1, start_us + 377773);
	firmware_run(14);
	assert_false(fake.outputs & WIRE_IO_MAGNET_HOLD);
	if (by_hand.dropout_us != 0)
		by_hand.keeper_us = fake.off_us[1] + by_hand.dropout_us;
	else
		fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
	by_hand.down_ms = by_hand.next_ms + 15;
}

void firmware_to_separated(void)
{
	firmware_to_falling();
	firmware_separate();
}

void firmware_to_captured(void)
{
	firmware_to_separated();
	firmware_run(30);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(405);
	assert_int_equal(firmware_status().state, WIRE_STATE_CAPTURED);
}
