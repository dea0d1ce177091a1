/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_SLCAN_TEXT_H
#define DT_COMMON_LINK_SLCAN_TEXT_H
/*
 * SLCAN text to frames and back. A frame is one line that ends with a carriage return:
 *
 *     t 7FF L data      classic, 11 bits       r 7FF L          remote
 *     T 1FFFFFFF L data classic, 29 bits       R 1FFFFFFF L
 *     d D               CAN FD                 b B              CAN FD with bit-rate switching
 *
 * L is one hex digit, the data length code: 9 to F are 12, 16, 20, 24, 32, 48, 64 bytes and stand in FD
 * lines only. SLCAN has no letter for the ESI flag, it is not carried. (Lawicel CAN232 manual; FD letters as
 * the CANable 2 firmware.)
 * Any context; the state is the caller's.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/frame.h"

/* The longest line: letter, 8 digits, length, 128 digits, carriage return, and 4 digits of time stamp. */
#define SLCAN_LINE_MAX 144

/* Writes the line, without a NUL; its length, or 0 for a frame SLCAN cannot carry (an error report). */
DT_MUST_USE size_t slcan_encode(char line[SLCAN_LINE_MAX], const struct frame *frame);

/* Zeroed before the first byte. */
struct slcan_decoder {
	char line[SLCAN_LINE_MAX];
	unsigned length;
	bool overflow;
};

/* Takes the next byte: 1 = it ended a frame, now in *frame (time_us 0), 0 = more is needed or an adapter's
 * answer passed by, DT_E_FORMAT = it ended something that is no frame. After an error decoding goes on with
 * the next line. A time stamp of 4 hex digits after the data is dropped: an adapter's clock of 60 s is no
 * help to us. */
DT_MUST_USE int slcan_decode(struct slcan_decoder *decoder, char byte, struct frame *frame);

#endif
