/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_MEASURE_H
#define DT_FIRMWARE_MEASURE_H
/*
 * What a drop measures of its tower, and the drop-out of the magnet that is learned from it. The magnet edge
 * of a drop is planned with the learned drop-out: the first one measured is taken whole, each later one moves
 * it by a quarter of the difference, and one that differs by more than dropout_change_us from what was
 * known, the first one from dropout_us, is taken whole and marks the drop. It stays within dropout_limit_us
 * of the parameter dropout_us and is forgotten at a reset.
 *
 * Context: main.
 */
#include <stdint.h>

#include "common/wire.h"
#include "firmware/fall.h"
#include "firmware/parameter.h"

enum {
	MEASURE_NONE = 0xFFFF, /* not measured */
};

struct measure {
	const struct parameters *parameters;
	uint32_t learned_us;
	bool learned;
};

void measure_init(struct measure *measure, const struct parameters *parameters);

/* dropout_us has changed. */
void measure_forget(struct measure *measure);

/* For the next drop's magnet edge. */
uint32_t measure_dropout_us(const struct measure *measure);

/* After a drop, with the parameters it was made with: fills what the times tell, learns, and returns
 * WIRE_MARK_* of the drop. drop_id, clock_ppm, trigger_latency_us and crc32 are the caller's and left alone.
 */
uint16_t measure_drop(struct measure *measure, const struct fall_plan *plan, const struct fall_times *times,
                      struct wire_measured *measured);

/* As a field of `measured`: beyond 16 bits, or negative, is not measured. */
uint16_t measure_us(int32_t time_us);

#endif
