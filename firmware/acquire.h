/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_ACQUIRE_H
#define DT_FIRMWARE_ACQUIRE_H
/*
 * Samples into ticks. Each millisecond both sensors give 7 X and 10 Y and Z; a sample that did not come
 * keeps its place as WIRE_SAMPLE_NOT_TAKEN and is counted. Finished ticks wait in a short queue for main.
 *
 * Context: acquire_turn, acquire_x and acquire_yz are the sample interrupts'; acquire_close and acquire_open
 * the control interrupt's, which they interrupt: the samples of a millisecond gather on one page while
 * control has the page before. acquire_init runs before interrupts, acquire_take and acquire_pack in main.
 * Counts are 1/32 g. Clipping is judged in main, against the parameter range_counts: a command that comes
 * with the millisecond does not wait for that.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/ring.h"
#include "common/wire.h"
#include "firmware/parameter.h"

enum {
	ACQUIRE_CHANNELS = 6,      /* S1 X Y Z, S2 X Y Z */
	ACQUIRE_QUEUE = 16,        /* ticks that main may be behind before one is lost */
	ACQUIRE_CLOCK_TICKS = 100, /* the sample clocks are judged over this many */
	ACQUIRE_CLOCK_LEAST = 1000 * WIRE_YZ_PER_TICK,
	ACQUIRE_CLOCK_MOST = 4000000000,
	ACQUIRE_NO_PPM = 0x7FFF,
	ACQUIRE_SAMPLES_PER_TICK = 2 * (WIRE_X_PER_TICK + 2 * WIRE_YZ_PER_TICK),
};

struct acquire_samples {
	int16_t x[WIRE_X_PER_TICK], y[WIRE_YZ_PER_TICK], z[WIRE_YZ_PER_TICK];
};

/* Everything the two blocks of one millisecond are made from. */
struct acquire_tick {
	uint32_t tick_ms;
	uint16_t drop_id;
	uint16_t io;    /* at the tick */
	uint16_t marks; /* WIRE_MARK_* that this tick gives the drop */
	uint8_t status[WIRE_SENSORS];
	struct acquire_samples sensor[WIRE_SENSORS];
};

/* What is known when a tick begins. */
struct acquire_head {
	uint32_t tick_ms;
	uint16_t drop_id, io, marks;
	uint8_t state; /* WIRE_STATE_* */
};

/* The samples of a millisecond as they come. */
struct acquire_page {
	struct acquire_tick tick;   /* its head is known when it ends */
	uint16_t x_count, yz_count; /* instants that came; those beyond a tick's have no place */
};

struct acquire {
	const struct parameters *parameters;
	volatile uint32_t *counters; /* overrun: control's, and main's under port_lock; clipping: main's */
	/* sample interrupts */
	struct acquire_page page[2];
	uint8_t filling;         /* which of them; the other is control's while it waits there */
	volatile uint32_t turns; /* milliseconds that have begun */
	_Atomic bool waiting;    /* set by the turn, taken back by control */
	/* control */
	uint32_t turns_seen;
	struct acquire_head head; /* of the tick whose samples come */
	bool open;
	uint8_t clock_ticks;
	uint16_t clock_x, clock_yz;
	bool clocks_good;           /* over the last ACQUIRE_CLOCK_TICKS X:YZ was 7:10 exactly */
	uint32_t total_x, total_yz; /* instants since acquire_clock_ppm */
	struct ring queue;
	struct acquire_tick storage[ACQUIRE_QUEUE];
};

void acquire_init(struct acquire *acquire, const struct parameters *parameters, volatile uint32_t *counters);

/* A millisecond begins. If control still has not taken the one before the last, the last is lost. */
void acquire_turn(struct acquire *acquire);

/* Control, after each turn: ends the tick that is open, if any, and queues it. Returns the milliseconds that
 * have begun since the call before: 1, or more when control was late; the samples of the others are counted
 * as not taken. */
uint32_t acquire_close(struct acquire *acquire);

/* Control: the tick of the millisecond that has begun. A sensor without its bias marks it. */
void acquire_open(struct acquire *acquire, const struct acquire_head *head);

/* The next sample instant has come; ready false = the converter did not deliver, the codes are nothing. */
void acquire_x(struct acquire *acquire, const int16_t code[WIRE_SENSORS], bool ready);
void acquire_yz(struct acquire *acquire, const int16_t y[WIRE_SENSORS], const int16_t z[WIRE_SENSORS],
                bool ready);

/* Main, between port_lock and port_unlock: X against 7/10 of YZ since the call before, in 1e-6, within the 16
 * bits of the wire; ACQUIRE_NO_PPM for less than a second, and for more than some days. */
int16_t acquire_clock_ppm(struct acquire *acquire);

/* Main: the oldest finished tick, its samples judged, or DT_E_EMPTY. */
DT_MUST_USE int acquire_take(struct acquire *acquire, struct acquire_tick *tick);

/* Main: the samples of one channel, *count of them. */
const int16_t *acquire_channel(const struct acquire_tick *tick, unsigned channel, unsigned *count);

/* Main: the sealed block of sensor 0 (S1) or 1 (S2). */
void acquire_pack(const struct acquire_tick *tick, unsigned sensor, uint32_t id, struct frame *frame);

#endif
