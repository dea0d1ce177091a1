/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_SEQUENCE_BY_HAND_H
#define DT_TESTS_UNIT_SEQUENCE_BY_HAND_H
/*
 * The sequence on the fake port, run tick by tick and led into each of its states: what its tests share. A
 * state that is not reached fails the test.
 */
#include <string.h>

#include "common/wire_table.h"
#include "firmware/sequence.h"
#include "tests/unit/fake_port.h"

#define STATE(NAME) WIRE_STATE_##NAME
#define EVENT(NAME) SEQUENCE_##NAME

enum { SESSION = 0x7E115A17, NONCE = 0x1EE7C0DE, SET = 0x0D15EA5E };

static struct sequence sequence;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];
static uint32_t now_ms;
static uint32_t checks;
static uint16_t known; /* inputs */
static struct hosts hosts;
static bool no_nonce;

static inline struct sequence_view look(void)
{
	return (struct sequence_view){
	        .now_us = fake.now_us,
	        .io = port_io(),
	        .known = known,
	        .checks = checks,
	};
}

static inline void tick(void)
{
	struct sequence_view view;

	now_ms++;
	fake_time(now_ms * 1000);
	view = look();
	sequence_tick(&sequence, &view, now_ms);
}

static inline void ticks(unsigned count)
{
	while (count-- > 0)
		tick();
}

static inline int command_by(uint32_t host, unsigned op, uint32_t argument)
{
	struct sequence_order order = {
	        .command = {.op = (uint8_t)op, .host = (uint16_t)host, .argument = argument},
	        .hosts = &hosts,
	        .capture_crc32 = 0xC0FFEE,
	        .parameters_crc32 = SET,
	        .dropout_us = 8000,
	        .nonce = NONCE,
	        .nonce_good = !no_nonce,
	};
	struct sequence_view view = look();

	sequence_plan(&sequence);
	return sequence_command(&sequence, &view, &order);
}

static inline int command(unsigned op, uint32_t argument)
{
	return command_by(SESSION, op, argument);
}

static inline int ask(void)
{
	return command(WIRE_OP_ARM, wire_answer(0, SESSION, SET));
}

static inline int answer(void)
{
	return command(WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET));
}

static inline int arm(void)
{
	int result = ask();

	return result == 0 ? answer() : result;
}

static inline int release(void)
{
	return command(WIRE_OP_RELEASE, wire_answer(NONCE, sequence_next_drop(&sequence), SET));
}

static inline int clear(void)
{
	return command(WIRE_OP_CLEAR, 0);
}

static inline void boot(enum port_reset cause)
{
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	now_ms = 0;
	checks = 0;
	known = UINT16_MAX;
	no_nonce = false;
	hosts_init(&hosts, &parameters, counters);
	hosts_heard(&hosts, 0, SESSION, true);
	sequence_init(&sequence, &parameters, counters, cause);
}

static inline void to_ready(void)
{
	boot(PORT_RESET_POWER_ON);
	ticks(102);
	assert_int_equal(sequence.state, STATE(SAFE));
	assert_int_equal(clear(), 0);
	ticks(1001);
	assert_int_equal(sequence.state, STATE(READY));
}

static inline void to_armed(void)
{
	to_ready();
	assert_int_equal(arm(), 0);
	assert_int_equal(sequence.state, STATE(ARMED));
}

static inline void to_warned(void)
{
	to_armed();
	ticks(1000);
}

static inline void to_falling(void)
{
	to_warned();
	assert_int_equal(release(), 0);
	assert_int_equal(sequence.state, STATE(FALLING));
	assert_false(sequence.acknowledged); /* even if the latch never opens */
	checks |= WIRE_CHECK_LATCH;
	ticks(20);
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	tick();
}

/* The gates pass as in free fall from the release. */
static inline void to_separated(void)
{
	uint32_t start_us;

	to_falling();
	start_us = now_ms * 1000;
	ticks(202);
	sequence_gate(&sequence, 0, start_us + 201928);
	ticks(176);
	sequence_gate(&sequence, 1, start_us + 377773);
	while (sequence.state == STATE(FALLING))
		tick();
	assert_int_equal(sequence.state, STATE(SEPARATED));
}

static inline void to_braked(void)
{
	to_separated();
	while (sequence.state == STATE(SEPARATED))
		tick();
	assert_int_equal(sequence.state, STATE(BRAKED));
}

static inline void to_captured(void)
{
	to_braked();
	sequence_triggered(&sequence);
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	ticks(400);
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(CAPTURED));
}

static inline void to_keep_out(void)
{
	to_braked();
	sequence_triggered(&sequence);
	ticks(400);
	sequence_full(&sequence);
	assert_int_equal(sequence.state, STATE(KEEP_OUT));
}

static inline void to_uploaded(void)
{
	to_captured();
	assert_int_equal(command(WIRE_OP_ACCEPT, 0xC0FFEE), 0);
	assert_int_equal(sequence.state, STATE(UPLOADED));
}

static inline void to_fault_held(void)
{
	to_armed();
	checks = WIRE_CHECK_ESTOP;
	tick();
	checks = 0;
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
}

static inline void to_fault_moving(void)
{
	to_falling();
	sequence_abort(&sequence);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
}

static inline void to_boot(void)
{
	boot(PORT_RESET_POWER_ON);
	ticks(3);
}

static inline void to_safe(void)
{
	boot(PORT_RESET_POWER_ON);
	checks = WIRE_CHECK_HOST;
	ticks(102);
	assert_int_equal(sequence.state, STATE(SAFE));
}

static void (*const reach[WIRE_STATES])(void) = {
        to_boot,   to_safe,     to_ready,    to_armed,      to_falling,      to_separated,
        to_braked, to_captured, to_uploaded, to_fault_held, to_fault_moving, to_keep_out,
};

#endif
