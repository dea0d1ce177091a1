/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_FAKE_PORT_H
#define DT_TESTS_UNIT_FAKE_PORT_H
/*
 * firmware/port.h without hardware: the test sets time and inputs, looks at outputs and frames.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/wire.h"
#include "firmware/port.h"

enum {
	FAKE_SENT_MAX = 16384,
	FAKE_RECEIVED_MAX = 64,
	FAKE_ALL_GOOD = WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD | WIRE_IO_DAMPERS_ENGAGED |
	                WIRE_IO_DOOR_CLOSED | WIRE_IO_ESTOP_CLEAR | WIRE_IO_SUPPLY_GOOD | WIRE_IO_IEPE_S1 |
	                WIRE_IO_IEPE_S2,
};

struct fake_port {
	uint32_t now_us;
	uint16_t inputs, outputs;
	uint16_t bias_high;
	uint16_t planned;    /* outputs with an edge to come */
	uint32_t off_us[16]; /* when it comes, or came; by bit */
	struct frame sent[FAKE_SENT_MAX];
	unsigned sent_count;
	bool can_full;
	enum port_bus bus;
	uint32_t can_room;    /* frames the controller takes; as many as come at first */
	bool no_fd;           /* port_can_setup refuses FD */
	bool no_setup;        /* and everything else */
	bool classic;         /* as set up */
	uint32_t data_kbit_s; /* 0: never set up */
	unsigned setups;
	uint32_t bus_errors;
	struct frame received[FAKE_RECEIVED_MAX];
	unsigned received_count, received_next;
	unsigned kicks, resets;
	int locks;               /* now held: 0 or 1 */
	uint8_t kept;            /* over a reset */
	uint32_t random;         /* the next port_random; it counts on */
	bool no_random;          /* the generator does not deliver */
	bool brown_out_unset;    /* the option bytes are not set */
	void (*interrupt)(void); /* called where main may be interrupted, but not while locked */
	void (*tape)(const struct frame *frame); /* sees what the firmware is given */
};

extern struct fake_port fake;

void fake_init(void);

/* Goes to a time and makes the edges on the way. */
void fake_time(uint32_t now_us);

/* A frame for the firmware. */
void fake_receive(const struct frame *frame);

/* Frames sent with this identifier; the last of them, or NULL. */
unsigned fake_count(uint32_t id);
const struct frame *fake_last(uint32_t id);

/* xorshift, for repeatable random walks. */
uint32_t fake_random(uint32_t *seed);

#endif
