/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LCM_CODEC_H
#define DT_HOST_RECORD_LCM_CODEC_H
/*
 * Between our own forms and the LCM messages of common/lcm: a wire block and a block message, a record and
 * a drop message, a status frame and a state message. Publishing and receiving is the caller's.
 *
 * Any context, no state. DT_E_LENGTH or DT_E_UNKNOWN: the frame is not the one asked for; DT_E_CORRUPT: its
 * CRC-8 disagrees; DT_E_RANGE: a field of the message does not fit the wire; DT_E_FORMAT: bytes that are
 * no such message.
 */
#include <droptower_block.h>
#include <droptower_drop.h>
#include <droptower_state.h>

#include "common/frame.h"
#include "host/record/record.h"

#define LCM_CODEC_BLOCK "DT_BLOCK"
#define LCM_CODEC_DROP "DT_DROP"

/* A live or resent block; utime is the frame's time. */
DT_MUST_USE int lcm_codec_block(const struct frame *frame, droptower_block *block);

/* And back, sealed. */
DT_MUST_USE int lcm_codec_frame(const droptower_block *block, struct frame *frame);

/* A status frame. What the state message says of its time, the drop and commands is left alone. */
DT_MUST_USE int lcm_codec_state(const struct frame *frame, droptower_state *state);

/* The drop of a record, its arrays to be freed with lcm_codec_free_drop. DT_E_ARGUMENT: the record is not
 * a drop. */
DT_MUST_USE int lcm_codec_drop(const struct record *record, int64_t utime, droptower_drop *drop);
void lcm_codec_free_drop(droptower_drop *drop);

/* And back; *record is initialised by the call. crc_agrees is not believed but computed. */
DT_MUST_USE int lcm_codec_record(const droptower_drop *drop, struct record *record);

/* The same without channels, samples and gaps, for who only wants to know of the drop. */
DT_MUST_USE int lcm_codec_outline(const droptower_drop *drop, struct record *record);

/* The generated decoders believe the counts in a message, and that there is memory; these check both. A
 * decoded drop is freed with lcm_codec_free_drop. One that is cut has lost its end: the ticks that are not
 * whole are gaps of it; DT_E_FORMAT where none is. */
DT_MUST_USE int lcm_codec_decode_block(const void *bytes, size_t size, droptower_block *block);
DT_MUST_USE int lcm_codec_decode_drop(const void *bytes, size_t size, bool cut, droptower_drop *drop);

#endif
