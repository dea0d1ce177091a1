/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TOLD_H
#define DT_HOST_RECORD_TOLD_H
/*
 * What the tower tells behind a capture end: what the drop measured of its tower, and the parameters that it
 * was made with, one a frame. Of the drop whose capture end came last; without one nothing is kept.
 *
 * No memory, any context.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "host/record/record.h"

struct told {
	bool begun;
	uint16_t drop_id;
	bool measured_known;
	struct wire_measured measured;
	uint32_t held; /* bit i: parameter[i] */
	uint32_t parameter[WIRE_PARAMETERS];
};

/* A capture end came: what follows is of this drop. */
void told_begin(struct told *told, uint16_t drop_id);

/* A frame `measured` or `parameter`. 0, DT_E_LENGTH, DT_E_CORRUPT for one that does not agree with its
 * checksum, is of another drop or says a parameter otherwise than before (the last counts), DT_E_UNKNOWN for
 * a parameter that there is not. */
DT_MUST_USE int told_feed(struct told *told, const struct frame *frame);

/* All of it has come, and is what the capture end says. */
bool told_whole(const struct told *told, const struct wire_capture_end *end);

/* The whole set has come, and it is not the one that the drop was made with. */
bool told_is_altered(const struct told *told, const struct wire_capture_end *end);

/* Into the record of that drop, before drop_close; an altered set counts as a corrupt frame more. */
void told_fill(const struct told *told, const struct wire_capture_end *end, struct record *record);

#endif
