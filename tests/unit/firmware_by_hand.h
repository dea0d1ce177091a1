/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_FIRMWARE_BY_HAND_H
#define DT_TESTS_UNIT_FIRMWARE_BY_HAND_H
/*
 * The whole firmware on the fake port, run tick by tick: what the tests of it from outside share. A function
 * that does not find what it is after fails the test.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/wire.h"
#include "firmware/port.h"

enum { FIRMWARE_SESSION = 0x51E7A0D3, FIRMWARE_DROPOUT_US = 8000 };

struct firmware_by_hand {
	uint32_t next_ms; /* the tick that comes next */
	uint32_t release_ms;
	bool host_alive;
	uint32_t session; /* of the host that beats, and commands */
	uint32_t host_hash;
	uint32_t nonce;      /* of the last challenge */
	uint32_t answer;     /* to the one before, in the last ARM */
	uint32_t parameters; /* CRC-32 of the set as read before the last ARM */
	uint32_t dropout_us; /* of the magnet; 0: the keeper says nothing */
	uint32_t down_ms;    /* tick at which the frame is down, and when the keeper falls; 0 never */
	uint32_t keeper_us;
	int16_t s2x; /* what S2 X reads, 0: noise only */
	int16_t s2y_offset;
};
extern struct firmware_by_hand by_hand;

void firmware_power_on(enum port_reset cause);

/* One millisecond, or some; main runs after each sample instant of Y. */
void firmware_run_ms(void);
void firmware_run(unsigned ms);

/* The last frame with this identifier. */
const struct frame *firmware_last(uint32_t id);
void firmware_forget_frames(void);

/* Run on until the firmware says it; a counter comes once every two seconds. */
struct wire_status firmware_status(void);
uint32_t firmware_counter(unsigned index);

/* A command, or a parameter, and what the firmware answers. */
struct wire_reply firmware_order(unsigned op, uint32_t argument);
struct wire_sdo firmware_sdo(unsigned specifier, unsigned index, unsigned subindex, uint32_t value);

/* ARM as a host does it, with the set it reads, asked for and answered; that answer again; and RELEASE, which
 * answers what came back, after the warning. */
struct wire_reply firmware_arm(void);
struct wire_reply firmware_arm_again(void);
struct wire_reply firmware_release(unsigned drop_id);
void firmware_wait_for_warning(void);

/* CLEAR, then all checks green for a second. */
void firmware_acknowledge(void);

/* For blocks again. */
void firmware_ask(unsigned sensor, uint32_t first_ms, unsigned count);

/* From power on to a state; fall is from READY to FALLING, separate from there to SEPARATED. */
void firmware_to_ready(void);
void firmware_to_armed(void);
void firmware_to_falling(void);
void firmware_to_separated(void);
void firmware_to_captured(void);
void firmware_fall(unsigned drop_id);
void firmware_separate(void);

#endif
