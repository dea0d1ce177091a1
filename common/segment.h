/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_SEGMENT_H
#define DT_COMMON_SEGMENT_H
/*
 * Messages longer than 8 bytes on classic CAN: cut into wire.def's segments, one byte of sequence and seven
 * of the message, under the message's own identifier, and put together again. Only the messages that the
 * tower sends after a drop travel so: resent blocks and the capture end. Different identifiers may
 * interleave.
 *
 * Freestanding; any context; the state belongs to the caller, all zeros is empty.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/wire.h"

/* Frames that a message of length bytes makes. */
unsigned segment_count(unsigned length);

/* Segment i of the message, 0 to segment_count - 1, as a classic frame. */
void segment_cut(const struct frame *message, unsigned i, struct frame *segment);

/* What has come of one identifier. */
struct segment_part {
	struct frame message; /* flags, length as of a whole frame once it is one */
	uint8_t next;         /* position that must come */
	bool lost;            /* one was missing; waits for the next message to begin */
};

struct segment_join {
	struct segment_part block[WIRE_SENSORS], end;
	uint32_t incomplete; /* messages given up: a segment lost, out of order, or of the wrong length */
};

/* The message that the frame is or completes, or NULL while more segments must come. A frame that is no
 * segment comes back itself. What is returned is good until the next call. A segment that comes twice counts
 * once. */
const struct frame *segment_feed(struct segment_join *join, const struct frame *frame);

#endif
