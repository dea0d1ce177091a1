/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TOLD_H
#define DT_HOST_RECORD_TOLD_H
/*
 * What the tower tells behind a capture end: what the drop measured of its tower, and the parameters that it
 * was made with, one a frame. The last drop told of is kept; a frame of another begins anew.
 *
 * No memory, any context.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "host/record/record.h"

struct told {
	uint16_t drop_id;
	bool measured_known;
	struct wire_measured measured;
	uint32_t parameters_held; /* bit i: parameter[i] */
	uint32_t parameter[WIRE_PARAMETERS];
};

/* A frame `measured` or `parameter`. 0, DT_E_LENGTH or DT_E_CORRUPT. */
DT_MUST_USE int told_feed(struct told *told, const struct frame *frame);

/* All of it has come for the drop. */
bool told_whole(const struct told *told, uint16_t drop_id);

/* Into the record of the drop whose capture end it was. A set that is not the one that ARM confirmed is none.
 */
void told_fill(const struct told *told, const struct wire_capture_end *end, struct record *record);

#endif
