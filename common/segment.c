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

/* The identifier's part and the length of its messages; NULL if its messages are never cut. */
static struct segment_part *find(struct segment_join *join, uint32_t id, uint8_t *length)
{
	*length = WIRE_LENGTH_block;
	switch (id) {
	case WIRE_ID_RESENT_S1:
		return &join->block[0];
	case WIRE_ID_RESENT_S2:
		return &join->block[1];
	case WIRE_ID_CAPTURE_END:
		*length = WIRE_LENGTH_capture_end;
		return &join->end;
	default:
		return NULL;
	}
}

/* The one before has come again. */
static bool repeated(const struct segment_part *part, unsigned position, const uint8_t *payload,
                     unsigned length)
{
	return position + 1 == part->next &&
	       memcmp(part->message.data + PAYLOAD * position, payload, bytes_in(length, position)) == 0;
}

static void give_up(struct segment_join *join, struct segment_part *part)
{
	if (!part->lost)
		join->incomplete++;
	part->lost = true;
	part->next = 0;
}

/* True when it completes the message. */
static bool append(struct segment_join *join, struct segment_part *part, const struct wire_segment *piece,
                   unsigned length)
{
	unsigned position = piece->sequence & POSITION, count = segment_count(length);
	bool last = (piece->sequence & LAST) != 0;

	if (repeated(part, position, piece->payload, length))
		return false;
	if (position == 0) {
		if (part->next > 0 && part->next < count)
			give_up(join, part);
		part->lost = false;
		part->next = 0;
	}
	if (position != part->next || position >= count || last != (position + 1 == count)) {
		give_up(join, part);
		return false;
	}
	memcpy(part->message.data + PAYLOAD * position, piece->payload, bytes_in(length, position));
	part->next++;
	return last;
}

const struct frame *segment_feed(struct segment_join *join, const struct frame *frame)
{
	struct segment_part *part;
	struct wire_segment piece;
	uint8_t length;

	part = find(join, frame->id, &length);
	if (part == NULL || (frame->flags & FRAME_FD) || wire_unpack_segment(frame, &piece) != 0)
		return frame;
	if (!append(join, part, &piece, length))
		return NULL;
	part->message.time_us = frame->time_us;
	part->message.id = frame->id;
	part->message.flags = FRAME_FD | FRAME_BRS;
	part->message.length = length;
	return &part->message;
}
