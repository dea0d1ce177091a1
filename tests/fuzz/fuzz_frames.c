/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Frames as they come: identifier (2 bytes), length (1), data. Each is unpacked as everything that it may be,
 * put together from segments, and joined to a drop, which is taken in the end.
 */
#include <string.h>

#include "common/segment.h"
#include "common/wire.h"
#include "host/record/join.h"
#include "tests/fuzz/fuzz.h"

static const uint8_t *next_frame(const uint8_t *at, const uint8_t *end, struct frame *frame)
{
	static const uint32_t ids[] = {WIRE_ID_BLOCK_S1,  WIRE_ID_BLOCK_S2,    WIRE_ID_RESENT_S1,
	                               WIRE_ID_RESENT_S2, WIRE_ID_CAPTURE_END, WIRE_ID_STATUS,
	                               WIRE_ID_TIME,      WIRE_ID_EMCY};
	unsigned length;

	*frame = (struct frame){.flags = FRAME_FD};
	frame->id = at[0] < 0xF0 ? ids[at[0] % 8] : (uint32_t)at[1] | (at[0] & 7u) << 8;
	length = at[2] % 65u;
	at += 3;
	if (length > end - at)
		length = (unsigned)(end - at);
	memcpy(frame->data, at, length);
	frame->length = (uint8_t)length;
	if (length <= 8 && (frame->id & 1u) == 0)
		frame->flags = 0;
	return at + length;
}

/* A block that would be dropped for its checksum, sealed: what is behind the check must hold as well. */
static void seal(struct frame *frame)
{
	struct wire_block block;

	if (frame->length == WIRE_LENGTH_block && frame->data[9] % 4 != 0 &&
	    wire_unpack_block(frame, &block) == 0)
		wire_pack_block(frame, frame->id, &block);
}

static void unpack_all(const struct frame *frame)
{
	union {
		struct wire_status status;
		struct wire_counter counter;
		struct wire_heartbeat heartbeat;
		struct wire_reply reply;
		struct wire_sdo sdo;
		struct wire_emcy emcy;
		struct wire_time time;
		struct wire_command command;
		struct wire_resend resend;
		struct wire_capture_end end;
	} m;

	(void)!wire_unpack_status(frame, &m.status);
	(void)!wire_unpack_counter(frame, &m.counter);
	(void)!wire_unpack_heartbeat(frame, &m.heartbeat);
	(void)!wire_unpack_reply(frame, &m.reply);
	(void)!wire_unpack_sdo(frame, &m.sdo);
	(void)!wire_unpack_emcy(frame, &m.emcy);
	(void)!wire_unpack_time(frame, &m.time);
	(void)!wire_unpack_command(frame, &m.command);
	(void)!wire_unpack_resend(frame, &m.resend);
	(void)!wire_unpack_capture_end(frame, &m.end);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static struct segment_join segments;
	const uint8_t *at = bytes, *end = bytes + size;
	struct join *join = join_create();
	struct record record;
	struct record_gap gap;

	if (join == NULL)
		return 0;
	memset(&segments, 0, sizeof(segments));
	while (end - at > 3) {
		const struct frame *whole;
		struct frame frame;

		at = next_frame(at, end, &frame);
		seal(&frame);
		unpack_all(&frame);
		whole = segment_feed(&segments, &frame);
		if (whole != NULL)
			(void)join_feed(join, whole);
		(void)join_next_gap(join, 1, 0, 32, &gap);
	}
	if (join_take(join, &record) == 0)
		record_free(&record);
	join_destroy(join);
	return 0;
}
