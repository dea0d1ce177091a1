/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * pcapng (draft-ietf-opsawg-pcapng) and pcap: frames of interfaces of link type 227, SocketCAN
 * (tcpdump.org/linktypes/LINKTYPE_CAN_SOCKETCAN.html).
 */
#include <math.h>
#include <string.h>

#include "common/link/transport.h"
#include "host/record/can_formats.h"
#include "host/record/table_data.h"

enum { LINK_CAN = 227, INTERFACES_MAX = 64 };
static const uint32_t BLOCK_SECTION = 0x0A0D0D0A, MAGIC_ORDER = 0x1A2B3C4D, MAGIC_US = 0xA1B2C3D4,
                      MAGIC_NS = 0xA1B23C4D;

struct pcap {
	struct can_text *text;
	const char *bytes;
	size_t size;
	bool big;
	unsigned interfaces, link[INTERFACES_MAX];
	double tick_us[INTERFACES_MAX];
	unsigned other; /* link type of an interface that is none of CAN */
};

static uint32_t u32(const struct pcap *pcap, size_t at)
{
	return (uint32_t)bytes_whole(pcap->bytes + at, 4, pcap->big);
}

static uint16_t u16(const struct pcap *pcap, size_t at)
{
	return (uint16_t)bytes_whole(pcap->bytes + at, 2, pcap->big);
}

static bool is_magic(const char *bytes, uint32_t magic, bool *big)
{
	*big = bytes_whole(bytes, 4, true) == magic;
	return *big || bytes_whole(bytes, 4, false) == magic;
}

/* 0: none, 1: pcap in us, 2: in ns, 3: pcapng. */
static int pcap_kind(const char *head, size_t length, bool *big)
{
	if (length < 24)
		return 0;
	if (bytes_whole(head, 4, true) == BLOCK_SECTION)
		return is_magic(head + 8, MAGIC_ORDER, big) ? 3 : 0;
	return is_magic(head, MAGIC_US, big) ? 1 : is_magic(head, MAGIC_NS, big) ? 2 : 0;
}

/* The identifier is always big endian. */
static bool packet_frame(const char *packet, size_t size, struct frame *frame)
{
	uint32_t id;
	size_t length;

	if (size < 8)
		return false;
	id = (uint32_t)bytes_whole(packet, 4, true);
	length = (unsigned char)packet[4];
	if (length > FRAME_DATA_MAX || size < 8 + length)
		return false;
	frame->id = id & ((id & 0x80000000u) != 0 ? 0x1FFFFFFF : 0x7FF);
	frame->flags = (id & 0x80000000u) != 0 ? FRAME_EXTENDED : 0;
	frame->length = (uint8_t)length;
	if ((id & 0x20000000u) != 0) {
		frame->flags = FRAME_ERROR;
		frame->id = id & 0x1FFFFFFF;
	} else if ((packet[5] & 4) != 0 || length > 8) {
		frame->flags |= (uint8_t)(FRAME_FD | ((packet[5] & 1) != 0 ? FRAME_BRS : 0) |
		                          ((packet[5] & 2) != 0 ? FRAME_ESI : 0));
	} else if ((id & 0x40000000u) != 0) {
		frame->flags |= FRAME_REMOTE;
	}
	if ((frame->flags & FRAME_REMOTE) == 0)
		memcpy(frame->data, packet + 8, length);
	return true;
}

static void put_packet(struct pcap *pcap, unsigned interface, double time_us, size_t at, size_t size)
{
	struct frame frame = {0};

	if (pcap->link[interface] != LINK_CAN)
		return;
	frame.time_us = time_us < 9e15 ? llround(time_us) : 0;
	if (packet_frame(pcap->bytes + at, size, &frame) && link_frame_valid(&frame))
		can_text_put(pcap->text, &frame, interface);
	else
		can_text_corrupt(pcap->text, at);
}

static void pcap_records(struct pcap *pcap, double ns)
{
	size_t at = 24;

	pcap->link[0] = u32(pcap, 20) & 0xFFFF;
	pcap->other = pcap->link[0];
	while (at + 16 <= pcap->size) {
		size_t size = u32(pcap, at + 8);

		if (size > pcap->size - at - 16)
			break;
		put_packet(pcap, 0, u32(pcap, at) * 1e6 + u32(pcap, at + 4) * ns, at + 16, size);
		at += 16 + size;
	}
	if (at != pcap->size)
		can_text_corrupt(pcap->text, at);
}

/* Option 9: a power of ten, or with the highest bit of two, that a second is divided by; 10^-6 without. */
static double resolution_us(const struct pcap *pcap, size_t at, size_t end)
{
	while (at + 4 <= end) {
		unsigned code = u16(pcap, at), size = u16(pcap, at + 2);

		if (code == 9 && size >= 1 && at + 5 <= end) {
			unsigned char power = (unsigned char)pcap->bytes[at + 4];

			return 1e6 / ((power & 0x80) != 0 ? ldexp(1, power & 0x7F) : pow(10, power));
		}
		if (code == 0)
			break;
		at += 4 + (size + 3u) / 4 * 4;
	}
	return 1;
}

static void take_interface(struct pcap *pcap, size_t at, size_t size)
{
	if (size < 20) {
		can_text_corrupt(pcap->text, at);
		size = 0; /* it counts: packets name interfaces by number */
	}
	if (pcap->interfaces == INTERFACES_MAX)
		return;
	pcap->link[pcap->interfaces] = size > 0 ? u16(pcap, at + 8) : 0;
	pcap->tick_us[pcap->interfaces] = size > 0 ? resolution_us(pcap, at + 16, at + size - 4) : 1;
	if (pcap->link[pcap->interfaces] != LINK_CAN)
		pcap->other = pcap->link[pcap->interfaces];
	pcap->interfaces++;
}

static void enhanced_packet(struct pcap *pcap, size_t at, size_t size)
{
	unsigned interface = size >= 32 ? u32(pcap, at + 8) : INTERFACES_MAX;
	size_t captured = size >= 32 ? u32(pcap, at + 20) : 0;

	if (interface >= pcap->interfaces || captured > size - 32) {
		can_text_corrupt(pcap->text, at);
		return;
	}
	put_packet(pcap, interface,
	           (u32(pcap, at + 12) * 4294967296.0 + u32(pcap, at + 16)) * pcap->tick_us[interface],
	           at + 28, captured);
}

static void pcapng_blocks(struct pcap *pcap)
{
	enum { INTERFACE = 1, ENHANCED_PACKET = 6 };
	size_t at = 0;

	while (at + 12 <= pcap->size) {
		uint32_t type = (uint32_t)bytes_whole(pcap->bytes + at, 4, true);
		size_t size;

		if (type == BLOCK_SECTION) { /* a new order, and interfaces from 0 on */
			if (!is_magic(pcap->bytes + at + 8, MAGIC_ORDER, &pcap->big))
				break;
			pcap->interfaces = 0;
		}
		type = u32(pcap, at);
		size = u32(pcap, at + 4);
		if (size < 12 || size % 4 != 0 || size > pcap->size - at)
			break;
		if (type == INTERFACE)
			take_interface(pcap, at, size);
		else if (type == ENHANCED_PACKET)
			enhanced_packet(pcap, at, size);
		at += size;
	}
	if (at != pcap->size)
		can_text_corrupt(pcap->text, at);
}

bool can_pcap_is(const char *head, size_t length)
{
	bool big;

	return pcap_kind(head, length, &big) != 0;
}

int can_pcap(struct can_text *text, char message[READ_MESSAGE_MAX])
{
	struct pcap pcap = {.text = text, .bytes = text->source->bytes, .size = text->source->size};
	int kind = pcap_kind(pcap.bytes, pcap.size, &pcap.big);

	if (kind == 3)
		pcapng_blocks(&pcap);
	else
		pcap_records(&pcap, kind == 1 ? 1 : 1e-3);
	if (text->frames > 0)
		return 0;
	return source_refuse(message, DT_E_EMPTY, text->source->file, 0,
	                     "a capture without a CAN frame, of link type %u, expected %d (SocketCAN)",
	                     pcap.other != LINK_CAN ? pcap.other : 0, LINK_CAN);
}
