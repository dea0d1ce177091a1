/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/segment.h"

#include <stddef.h>

#include "common/memory.h"

enum {
	PAYLOAD = 7,
	POSITION = 0x7F,
	LAST = 0x80,
};
_Static_assert(PAYLOAD + 1 == WIRE_LENGTH_segment, "a byte of sequence before the payload");

unsigned segment_count(unsigned length)
{
	return (length + PAYLOAD - 1) / PAYLOAD;
}

/* Bytes of the message in segment i. */
static unsigned bytes_in(unsigned length, unsigned i)
{
	unsigned rest = length - PAYLOAD * i;

	return rest < PAYLOAD ? rest : PAYLOAD;
}

void segment_cut(const struct frame *message, unsigned i, struct frame *segment)
{
	struct wire_segment piece = {.sequence = (uint8_t)i};

	if (i + 1 == segment_count(message->length))
		piece.sequence |= LAST;
	memcpy(piece.payload, message->data + PAYLOAD * i, bytes_in(message->length, i));
	wire_pack_segment(segment, message->id, &piece);
}

/* Where an identifier's messages are put together; copy NULL: they are never cut. */
struct place {
	struct segment_copy *copy;
	struct segment_message *messages;
	unsigned modulus; /* of messages */
	uint8_t length;
};

static struct place find_place(struct segment_join *join, uint32_t id)
{
	switch (id) {
	case WIRE_ID_RESENT_S1:
		return (struct place){&join->block_copy[0], join->block[0], SEGMENT_BLOCKS,
		                      WIRE_LENGTH_block};
	case WIRE_ID_RESENT_S2:
		return (struct place){&join->block_copy[1], join->block[1], SEGMENT_BLOCKS,
		                      WIRE_LENGTH_block};
	case WIRE_ID_CAPTURE_END:
		return (struct place){&join->end_copy, &join->end, 1, WIRE_LENGTH_capture_end};
	case WIRE_ID_MEASURED:
		return (struct place){&join->measured_copy, &join->measured, 1, WIRE_LENGTH_measured};
	default:
		return (struct place){0};
	}
}

/* The one before has come again. */
static bool repeated(const struct segment_copy *copy, unsigned position, const uint8_t *payload,
                     unsigned length)
{
	return position + 1 == copy->next && copy->message != NULL &&
	       memcmp(copy->message->data + PAYLOAD * position, payload, bytes_in(length, position)) == 0;
}

static void give_up(struct segment_join *join, struct segment_copy *copy)
{
	if (!copy->lost)
		join->incomplete++;
	copy->lost = true;
}

/* A copy begins with its first segment, or with one that lies before the position expected: then the first
 * was lost. */
static void begin_copy(struct segment_join *join, const struct place *place, unsigned position,
                       const uint8_t *payload)
{
	struct segment_copy *copy = place->copy;

	if (copy->next > 0 && copy->next < segment_count(place->length))
		give_up(join, copy);
	copy->lost = false;
	copy->next = 0;
	copy->message = NULL;
	if (position > 0)
		return;
	/* A block's tick is little endian at byte 2; modulus 1 needs none. */
	copy->message = &place->messages[(payload[2] | (unsigned)payload[3] << 8) % place->modulus];
}

/* True when it completes the message. What is held and differs, or has another first segment, is another's:
 * the new one is believed. */
static bool keep_payload(struct segment_message *message, unsigned position, const uint8_t *payload,
                         unsigned length)
{
	uint8_t *to = message->data + PAYLOAD * position;
	unsigned bytes = bytes_in(length, position);

	if ((position == 0 || (message->held & 1u << position)) && memcmp(to, payload, bytes) != 0)
		message->held = 0;
	memcpy(to, payload, bytes);
	message->held |= (uint16_t)(1u << position);
	if (message->held + 1u != 1u << segment_count(length))
		return false;
	message->held = 0;
	return true;
}

/* True when it completes the message that copy->message then is. */
static bool append(struct segment_join *join, const struct place *place, const struct wire_segment *piece)
{
	unsigned position = piece->sequence & POSITION, count = segment_count(place->length);
	struct segment_copy *copy = place->copy;

	if (position >= count || (piece->sequence & LAST) != (position + 1 == count ? LAST : 0)) {
		give_up(join, copy);
		return false;
	}
	if (repeated(copy, position, piece->payload, place->length))
		return false;
	if (position == 0 || position < copy->next)
		begin_copy(join, place, position, piece->payload);
	if (position != copy->next)
		give_up(join, copy);
	copy->next = (uint8_t)(position + 1);
	return copy->message != NULL && keep_payload(copy->message, position, piece->payload, place->length);
}

const struct frame *segment_feed(struct segment_join *join, const struct frame *frame)
{
	struct place place = find_place(join, frame->id);
	struct wire_segment piece;

	if (place.copy == NULL || (frame->flags & FRAME_FD) || wire_unpack_segment(frame, &piece) != 0)
		return frame;
	if (!append(join, &place, &piece))
		return NULL;
	join->whole = (struct frame){.time_us = frame->time_us,
	                             .id = frame->id,
	                             .flags = FRAME_FD | FRAME_BRS,
	                             .length = place.length};
	memcpy(join->whole.data, place.copy->message->data, place.length);
	return &join->whole;
}
