/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_APP_H
#define DT_FIRMWARE_APP_H
/*
 * The whole firmware behind the calls of a port. All state is one static struct app in app.c, its members the
 * modules. A port calls app_init once, then app_on_* from interrupts of two priorities, and app_poll from its
 * main loop as often as it can, at least once a millisecond.
 *
 * The sample interrupts come first and are short, whatever else goes on: app_on_turn where a millisecond
 * begins, then app_on_x and app_on_yz. They never interrupt each other. The control interrupt, one of lower
 * priority, is requested by each turn: app_on_gate and app_on_keeper for what was captured before, then
 * app_on_tick; it should be over before the next millisecond. Where gates and keeper have an interrupt of
 * their own, it has control's priority. The first turn after app_init begins tick 0. Codes are 1/32 g.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/acquire.h"
#include "firmware/capture.h"
#include "firmware/health.h"
#include "firmware/hosts.h"
#include "firmware/input.h"
#include "firmware/measure.h"
#include "firmware/parameter.h"
#include "firmware/port.h"
#include "firmware/sequence.h"
#include "firmware/stream.h"

struct app {
	struct parameters parameters;
	volatile uint32_t counters[WIRE_COUNTERS]; /* each is written in one context, or under port_lock */
	volatile uint32_t tick_ms;                 /* now; written by control ... */
	uint32_t tick_us;                          /* ... and when it began */
	uint32_t wire_hash;                        /* our own: takes too long to be worked out each time */
	struct input input;
	struct hosts hosts;
	struct acquire acquire;
	struct sequence sequence;
	struct health health;
	struct capture capture;
	struct stream stream;
	/* main only */
	struct parameters set; /* that the last ARM confirmed */
	struct measure measure;
	struct wire_measured measured; /* by the last capture */
	uint16_t measured_marks, trigger_latency_us;
	uint32_t seen_ms;        /* last tick that main has seen */
	uint32_t capture_end_ms; /* when the capture end was last sent */
	uint8_t fault_reported;
	uint8_t next_counter, sync_counter;
	bool started, bus_ready;
	enum port_bus bus; /* as last seen */
};

/* Interrupts off. */
void app_init(enum port_reset cause);

/* Sample interrupts. ready false = the converter did not deliver. */
void app_on_turn(void);
void app_on_x(int16_t s1x, int16_t s2x, bool ready);
void app_on_yz(int16_t s1y, int16_t s1z, int16_t s2y, int16_t s2z, bool ready);

/* Control. gate 0 upper, 1 lower. A tick without a turn since the one before does nothing. */
void app_on_tick(void);
void app_on_gate(unsigned gate, uint32_t time_us);

/* Control: the keeper current fell, the product is free. */
void app_on_keeper(uint32_t time_us);

/* Main. */
void app_poll(void);

#endif
