/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Vector's binary log: a file header, then objects, each padded by as many bytes as its size is beyond a
 * multiple of four. Objects of type 10 are containers: what they hold, whole or packed by zlib, is one stream
 * of objects, which their ends cut anywhere. Frames of CAN (types 1, 86) and CAN FD (100, 101) are taken; a
 * request to send is none, nor is what the frame on the bus says once more. Times are in 10 us or 1 ns from
 * the beginning of the measurement; an object that tells another unit is corrupt. Layout:
 * github.com/Technica-Engineering/vector_blf.
 */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "common/link/transport.h"
#include "host/record/can_formats.h"
#include "host/record/table_data.h"

enum {
	FILE_HEAD = 32,   /* of it what is looked at */
	OBJECT_HEAD = 16, /* "LOBJ", size of header, version of header, size, type */
	HEADER = 32,      /* versions 1 and 2 up to their time */
	CONTAINER = 10,
	PADDING_MOST = 8,
	STREAM_ROOM = 1 << 18,
	DEFLATE_MOST = 1032, /* times as many bytes */
};

struct blf {
	struct can_text *text;
	char *held; /* of the stream: what is not taken yet */
	size_t used, room;
	bool lost;          /* a part of the stream; what is next may begin anywhere */
	size_t others;      /* objects that are no frames */
	unsigned last_type; /* of them */
};

static uint32_t whole(const char *at, size_t size)
{
	return (uint32_t)bytes_whole(at, size, false);
}

/* ---- frames ---- */

/* Flags of types 1, 86 and 100: direction in the low four bits (0 received, 1 sent, 2 asked to send), remote
 * in the highest. */
static bool classic_flags(unsigned flags, struct frame *frame)
{
	frame->flags |= (flags & 0x80) != 0 ? FRAME_REMOTE : 0;
	return (flags & 0xF) <= 1;
}

static void fd_flags(bool fd, bool brs, bool esi, struct frame *frame)
{
	if (fd)
		frame->flags |= (uint8_t)(FRAME_FD | (brs ? FRAME_BRS : 0) | (esi ? FRAME_ESI : 0));
}

static bool take_id(uint32_t id, struct frame *frame)
{
	frame->id = id & 0x7FFFFFFF;
	frame->flags |= id >> 31 != 0 ? FRAME_EXTENDED : 0;
	return frame->id <= 0x1FFFFFFF;
}

/* bytes: how many of data count. */
static bool take_data(const char *data, size_t room, unsigned dlc, unsigned bytes, struct frame *frame)
{
	unsigned told;

	if (dlc > 15)
		return false;
	told = link_length_of_code(dlc);
	if ((frame->flags & FRAME_FD) == 0 && told > 8)
		told = 8;
	frame->length = (uint8_t)told;
	if ((frame->flags & FRAME_REMOTE) != 0)
		return true;
	if (bytes != told || bytes > room)
		return false;
	memcpy(frame->data, data, bytes);
	return true;
}

enum taken { FRAME_NONE, FRAME_TAKEN, FRAME_WRONG };

static enum taken take_frame(unsigned type, const char *at, size_t size, struct frame *frame,
                             unsigned *channel)
{
	enum { FD64_HEAD = 40 };
	bool right;

	if (size < (type == 101 ? (size_t)FD64_HEAD : type == 100 ? 84 : 16))
		return FRAME_WRONG;
	if (type == 101) {
		uint32_t flags = whole(at + 12, 4);

		if ((flags & 0x80) != 0 || (unsigned char)at[34] > 1)
			return FRAME_NONE;
		*channel = (unsigned char)at[0];
		frame->flags |= (flags & 0x10) != 0 ? FRAME_REMOTE : 0;
		fd_flags((flags & 0x1000) != 0, (flags & 0x2000) != 0, (flags & 0x4000) != 0, frame);
		right = take_id(whole(at + 4, 4), frame) &&
		        take_data(at + FD64_HEAD, size - FD64_HEAD, (unsigned char)at[1],
		                  (unsigned char)at[2], frame);
		return right ? FRAME_TAKEN : FRAME_WRONG;
	}
	if (!classic_flags((unsigned char)at[2], frame))
		return FRAME_NONE;
	*channel = whole(at, 2);
	if (type == 100) {
		fd_flags((at[13] & 1) != 0, (at[13] & 2) != 0, (at[13] & 4) != 0, frame);
		right = take_id(whole(at + 4, 4), frame) &&
		        take_data(at + 20, 64, (unsigned char)at[3], (unsigned char)at[14], frame);
	} else {
		unsigned dlc = (unsigned char)at[3];

		right = take_id(whole(at + 4, 4), frame) &&
		        take_data(at + 8, 8, dlc, dlc < 8 ? dlc : 8, frame);
	}
	return right ? FRAME_TAKEN : FRAME_WRONG;
}

/* False where its unit is not known. */
static bool take_time(const char *object, struct frame *frame)
{
	uint64_t time = bytes_whole(object + 24, 8, false);
	uint32_t unit = whole(object + 16, 4);

	if (time > (uint64_t)INT64_MAX / 10 || (unit != 1 && unit != 2))
		return false;
	frame->time_us = (int64_t)(unit == 1 ? time * 10 : (time + 500) / 1000);
	return true;
}

static void take_object(struct blf *blf, const char *object, size_t size, unsigned long long at)
{
	unsigned type = whole(object + 12, 4), version = whole(object + 6, 2), header = whole(object + 4, 2),
	         channel = 0;
	struct frame frame = {0};
	enum taken taken = FRAME_WRONG;

	if (type != 1 && type != 86 && type != 100 && type != 101) {
		blf->others++;
		blf->last_type = type;
		return;
	}
	if ((version == 1 || version == 2) && header >= HEADER && header <= size && take_time(object, &frame))
		taken = take_frame(type, object + header, size - header, &frame, &channel);
	if (taken == FRAME_NONE)
		blf->others++;
	else if (taken == FRAME_TAKEN && link_frame_valid(&frame))
		can_text_put(blf->text, &frame, channel);
	else
		can_text_corrupt(blf->text, at);
}

/* ---- objects ---- */

/* Where the next object begins, behind what pads the one before; size where there is none yet. */
static size_t find_object(const char *bytes, size_t size, size_t at, bool *lost)
{
	const char *found = size > at ? memmem(bytes + at, size - at, "LOBJ", 4) : NULL;

	if (found != NULL) {
		*lost |= (size_t)(found - bytes) - at > PADDING_MOST;
		return (size_t)(found - bytes);
	}
	*lost |= size - at > PADDING_MOST;
	return size - at > 3 ? size - 3 : at; /* a part of the next "LOBJ" may be there */
}

/* Takes what is whole of the stream, and keeps the rest. */
static void take_stream(struct blf *blf, unsigned long long place)
{
	size_t at = 0;

	for (;;) {
		bool lost = false;
		size_t size;

		at = find_object(blf->held, blf->used, at, &lost);
		if (lost && !blf->lost)
			can_text_corrupt(blf->text, place);
		blf->lost = blf->lost && (at == blf->used || blf->used - at < 4);
		if (blf->used - at < OBJECT_HEAD)
			break;
		size = whole(blf->held + at + 8, 4);
		if (size < OBJECT_HEAD) {
			can_text_corrupt(blf->text, place);
			at += 4;
			blf->lost = true;
			continue;
		}
		if (size > blf->used - at)
			break;
		take_object(blf, blf->held + at, size, place);
		at += size;
	}
	memmove(blf->held, blf->held + at, blf->used - at);
	blf->used -= at;
}

static bool stream_room(struct blf *blf, size_t more)
{
	size_t room = blf->room > 0 ? blf->room : STREAM_ROOM;
	char *held;

	while (room - blf->used < more)
		room *= 2;
	if (room == blf->room)
		return true;
	held = realloc(blf->held, room);
	if (held == NULL)
		return false;
	blf->held = held;
	blf->room = room;
	return true;
}

/* What it holds goes to the end of the stream; what cannot be unpacked is lost, and what the stream held with
 * it. DT_E_MEMORY. */
static int take_container(struct blf *blf, const char *object, size_t size, unsigned long long place)
{
	enum { HEAD = 32, NONE = 0, ZLIB = 2 };
	unsigned method = size >= HEAD ? whole(object + OBJECT_HEAD, 2) : UINT_MAX;
	size_t packed = size >= HEAD ? size - HEAD : 0, told = size >= HEAD ? whole(object + 24, 4) : 0;
	uLongf unpacked = told;
	bool right = (method == ZLIB && told / DEFLATE_MOST <= packed) || (method == NONE && told <= packed);

	if (right && !stream_room(blf, told + 1))
		return DT_E_MEMORY;
	if (right && method == NONE)
		memcpy(blf->held + blf->used, object + HEAD, told);
	else if (right)
		right = uncompress((Bytef *)blf->held + blf->used, &unpacked, (const Bytef *)object + HEAD,
		                   (uLong)packed) == Z_OK &&
		        unpacked == told;
	if (!right) {
		can_text_corrupt(blf->text, place);
		blf->used = 0;
		blf->lost = true;
		return 0;
	}
	blf->used += told;
	take_stream(blf, place);
	return 0;
}

/* The objects of the file. */
static int take_file(struct blf *blf, const char *bytes, size_t size, size_t at)
{
	bool lost = false;
	int error = 0;

	while (!error && at < size) {
		size_t object = find_object(bytes, size, at, &lost), length;

		if (size - object < OBJECT_HEAD) {
			lost |= size - at > 3;
			break;
		}
		length = whole(bytes + object + 8, 4);
		if (length < OBJECT_HEAD || length > size - object) {
			lost = true; /* cut, or damaged: the next that is whole */
			at = object + 4;
			continue;
		}
		if (whole(bytes + object + 12, 4) == CONTAINER)
			error = take_container(blf, bytes + object, length, object);
		else
			take_object(blf, bytes + object, length, object);
		at = object + length;
	}
	if (lost || blf->used > 3)
		can_text_corrupt(blf->text, size);
	return error;
}

bool can_blf_is(const char *head, size_t length)
{
	return length >= FILE_HEAD && memcmp(head, "LOGG", 4) == 0 && source_is_binary(head, length);
}

int can_blf(struct can_text *text, char message[READ_MESSAGE_MAX])
{
	const struct source *source = text->source;
	struct blf blf = {.text = text};
	uint64_t told = bytes_whole(source->bytes + 16, 8, false);
	size_t head = whole(source->bytes + 4, 4);
	int error;

	if (head < FILE_HEAD || head > source->size)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "a CAN log of Vector (BLF) whose head is %zu bytes: cut or damaged",
		                     head);
	error = take_file(&blf, source->bytes, source->size, head);
	free(blf.held);
	if (error)
		return source_no_memory(message, source->file);
	if (told > source->size)
		can_text_corrupt(text, source->size);
	if (text->frames > 0)
		return 0;
	if (blf.others > 0)
		return source_refuse(
		        message, DT_E_EMPTY, source->file, 0,
		        "a CAN log of Vector (BLF) without a CAN frame: %zu objects of other kinds, "
		        "of type %u the last",
		        blf.others, blf.last_type);
	return source_refuse(message, DT_E_EMPTY, source->file, 0,
	                     "a CAN log of Vector (BLF) without a CAN frame%s",
	                     text->corrupt > 0 ? ", cut or damaged" : "");
}
