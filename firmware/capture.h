/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_CAPTURE_H
#define DT_FIRMWARE_CAPTURE_H
/*
 * The ring of the last CAPTURE_TICKS milliseconds and the window that a trigger cuts out of it.
 *
 * The ring rolls at all times. In motion from magnet-off on, |S2 X| or |S2 Y| above the parameter
 * trigger_counts, or a tick that carries WIRE_MARK_NO_IMPACT, triggers: the window is pre_trigger_ms before
 * the tick of the trigger and post_trigger_ms from it on. When its last tick has come the ring stands still
 * until capture_release. The CRC-32 is carried along one tick at a time, so that no call takes long.
 *
 * Context: main. Ticks are compared with wrap-around.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/acquire.h"
#include "firmware/parameter.h"

enum {
	CAPTURE_TICKS = 512,            /* a power of two */
	CAPTURE_ZERO_TICKS = 50,        /* at the end of the window, for the offset after the drop */
	CAPTURE_ZERO_AFTER_TICKS = 200, /* post_trigger_ms that leaves time for the ring-down */
};

enum capture_phase {
	CAPTURE_ROLLING,
	CAPTURE_TRIGGERED,
	CAPTURE_FULL,     /* every tick of the window is in the ring, the ring stands still */
	CAPTURE_COMPLETE, /* and the CRC-32 is known */
};

struct capture {
	const struct parameters *parameters;
	enum capture_phase phase;
	uint32_t newest_ms, count;  /* the ring holds count ticks up to newest_ms */
	uint32_t first_ms, last_ms; /* the window */
	uint32_t trigger_us;        /* after first_ms */
	bool forced;                /* by time, not by an impact */
	uint32_t crc_ms;            /* next tick for the CRC */
	uint32_t crc32;
	uint16_t marks; /* WIRE_MARK_* of the window's ticks */
	struct {
		int32_t sum;
		uint16_t count;
	} zero[ACQUIRE_CHANNELS]; /* over the last CAPTURE_ZERO_TICKS */
	struct acquire_tick ring[CAPTURE_TICKS];
};

void capture_init(struct capture *capture, const struct parameters *parameters);

/* Takes the next tick and sets WIRE_STATUS_TRIGGERED in it where it applies. Ticks that were lost on the way
 * get a place in the ring with no sample taken. */
void capture_put(struct capture *capture, struct acquire_tick *tick);

/* One step of the CRC; true on the step that completes the window. */
bool capture_work(struct capture *capture);

/* Time of the first sample of S2 X or Y beyond the level, us after the tick; 1000 if there is none. */
uint32_t capture_impact_us(const struct acquire_samples *s2, uint32_t level);

/* Once complete: the offset of a channel at the end of the window differs by more than limit from the one
 * before. False when the window is too short to tell. */
bool capture_zero_shift(const struct capture *capture, const int16_t before[ACQUIRE_CHANNELS],
                        uint32_t limit);

/* The tick, or NULL if the ring does not hold it; good until the next capture_put. */
const struct acquire_tick *capture_find(const struct capture *capture, uint32_t tick_ms);

/* The window is not needed any more: roll again, from empty. */
void capture_release(struct capture *capture);

#endif
