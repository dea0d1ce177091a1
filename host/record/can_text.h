/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_CAN_TEXT_H
#define DT_HOST_RECORD_CAN_TEXT_H
/*
 * CAN logs of other programs as candump text, in a file on the disk, before anything else looks at them: all
 * that is done with candump text is done with them.
 *
 *     ASC      Vector's text (can_asc.c), logs of CANoe, python-can and log2asc
 *     pcapng   and pcap, of SocketCAN (can_pcap.c)
 *     BLF      Vector's binary log (can_blf.c)
 *
 * A line of a frame, a block or an object that does not make sense becomes a line that is none, and counts as
 * corrupt.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/record/source.h"

/* Whether a file with this head is one of them; 512 bytes or more will do. */
bool can_text_is(const char *head, size_t length);

/* Puts candump text in place of the bytes, if it is one of them. 0, or an error told in message: the source
 * is as it was, then. */
DT_MUST_USE int can_text(struct source *source, char message[READ_MESSAGE_MAX]);

#endif
