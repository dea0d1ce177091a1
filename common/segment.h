/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_SEGMENT_H
#define DT_COMMON_SEGMENT_H
/*
 * Messages longer than 8 bytes on classic CAN: cut into wire.def's segments, one byte of sequence and seven
 * of the message, under the message's own identifier, and put together again. Only the messages that the
 * tower sends after a drop travel so: resent blocks, the capture end and what was measured. Different
 * identifiers may interleave.
 *
 * What came of a message that lost segments is kept: when it is sent again, the second copy fills what is
 * missing. The first segment names the message (drop, tick), so that the others of a copy without it are of
 * no use. A splice of two messages needs the end of one and the beginning of the next lost, and longer than
 * that; it is found by the block's CRC-8, at the latest by the capture's CRC-32.
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

enum { SEGMENT_BLOCKS = 512 }; /* the longest capture, in ticks; a power of two */

/* What is held of one message. */
struct segment_message {
	uint16_t held; /* a bit for each segment */
	uint8_t data[FRAME_DATA_MAX];
};

/* The copy that comes under one identifier. */
struct segment_copy {
	struct segment_message *message; /* NULL: its first segment was lost */
	uint8_t next;                    /* position that must come */
	bool lost;                       /* one was missing */
};

struct segment_join {
	struct segment_copy block_copy[WIRE_SENSORS], end_copy, measured_copy;
	struct segment_message block[WIRE_SENSORS][SEGMENT_BLOCKS]; /* at their tick modulo that */
	struct segment_message end, measured;
	struct frame whole;
	uint32_t incomplete; /* copies with a segment lost, out of order, or of the wrong length */
};

/* The message that the frame is or completes, or NULL while more segments must come. A frame that is no
 * segment comes back itself. What is returned is good until the next call. A segment that comes twice counts
 * once. */
const struct frame *segment_feed(struct segment_join *join, const struct frame *frame);

#endif
