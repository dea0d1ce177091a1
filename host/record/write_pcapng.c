/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The frames of a drop as pcapng (draft-ietf-opsawg-pcapng): a section of this machine's byte order, one
 * interface of link type 227 (SocketCAN, whose identifier is big endian), times in us.
 */
#include <string.h>

#include "host/record/write.h"

enum { SECTION = 0x0A0D0D0A, ORDER = 0x1A2B3C4D, INTERFACE = 1, PACKET = 6, CAN_HEAD = 8 };

static int put_block(FILE *out, uint32_t type, const void *body, uint32_t size)
{
	static const char zeros[4];
	uint32_t padding = (4 - size % 4) % 4, whole = size + padding + 12;
	bool right = fwrite(&type, sizeof(type), 1, out) == 1 && fwrite(&whole, sizeof(whole), 1, out) == 1 &&
	             fwrite(body, size, 1, out) == 1 && fwrite(zeros, 1, padding, out) == padding &&
	             fwrite(&whole, sizeof(whole), 1, out) == 1;

	return right ? 0 : DT_E_SYSTEM;
}

static int put_head(FILE *out)
{
	static const struct {
		uint32_t order;
		uint16_t major, minor;
		uint32_t length[2]; /* not told */
	} section = {ORDER, 1, 0, {UINT32_MAX, UINT32_MAX}};
	static const struct {
		uint16_t link, reserved;
		uint32_t longest; /* no limit */
		uint16_t name, bytes;
		char text[4];
		uint16_t end, none;
	} interface = {227, 0, 0, 2, 4, {'c', 'a', 'n', '0'}, 0, 0};
	int error = put_block(out, SECTION, &section, sizeof(section));

	return error ? error : put_block(out, INTERFACE, &interface, sizeof(interface));
}

static int put_packet(void *context, const struct frame *frame)
{
	struct {
		uint32_t interface, high, low, captured, length;
		uint8_t can[CAN_HEAD + FRAME_DATA_MAX];
	} packet = {.high = (uint32_t)((uint64_t)frame->time_us >> 32), .low = (uint32_t)frame->time_us};
	uint32_t id = frame->id | ((frame->flags & FRAME_EXTENDED) != 0 ? 0x80000000u : 0) |
	              ((frame->flags & FRAME_REMOTE) != 0 ? 0x40000000u : 0) |
	              ((frame->flags & FRAME_ERROR) != 0 ? 0x20000000u : 0);

	packet.captured = packet.length = CAN_HEAD + frame->length;
	for (unsigned i = 0; i < 4; i++)
		packet.can[i] = (uint8_t)(id >> (24 - 8 * i));
	packet.can[4] = frame->length;
	if ((frame->flags & FRAME_FD) != 0)
		packet.can[5] = (uint8_t)(4 | ((frame->flags & FRAME_BRS) != 0 ? 1 : 0) |
		                          ((frame->flags & FRAME_ESI) != 0 ? 2 : 0));
	memcpy(packet.can + CAN_HEAD, frame->data, frame->length);
	return put_block(context, PACKET, &packet, 20 + packet.captured);
}

int write_pcapng(const struct record *record, FILE *out)
{
	int error = put_head(out);

	if (!error)
		error = write_frames(record, put_packet, out);
	return error ? error : fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}
