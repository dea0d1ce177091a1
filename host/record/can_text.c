/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/can_text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "common/link/candump.h"
#include "common/link/transport.h"
#include "host/record/table_data.h"

enum { HEAD_BYTES = 512 };

struct can_text {
	const struct source *source;
	FILE *out;
	size_t frames;
};

static void put_frame(struct can_text *text, const struct frame *frame, unsigned channel)
{
	char line[CANDUMP_LINE_MAX], name[16];

	snprintf(name, sizeof(name), "can%u", channel % 1000);
	fwrite(line, 1, candump_format(line, frame, name), text->out);
	text->frames++;
}

/* A line that is none. */
static void put_corrupt(struct can_text *text, unsigned long long at)
{
	fprintf(text->out, "(no frame at %llu\n", at);
}

/* ---- ASC ---- */

enum { WORDS_MAX = 16 + FRAME_DATA_MAX };

struct asc {
	struct can_text *text;
	bool decimal, relative;
	double time_s;
	const char *word[WORDS_MAX];
	size_t length[WORDS_MAX], words;
};

static bool asc_is(const char *head, size_t length)
{
	return length > 5 && strncasecmp(head, "date ", 5) == 0 && memmem(head, length, "base ", 5) != NULL;
}

static void split(struct asc *asc, const struct source_line *line)
{
	asc->words = 0;
	for (size_t at = 0; at < line->length && asc->words < WORDS_MAX; at++) {
		size_t begin = at;

		while (at < line->length && line->text[at] != ' ' && line->text[at] != '\t')
			at++;
		if (at == begin)
			continue;
		asc->word[asc->words] = line->text + begin;
		asc->length[asc->words++] = at - begin;
	}
}

static bool word_is(const struct asc *asc, size_t i, const char *word)
{
	return i < asc->words && asc->length[i] == strlen(word) &&
	       strncasecmp(asc->word[i], word, asc->length[i]) == 0;
}

/* A whole number; false where it is none, or too large. */
static bool asc_whole(const struct asc *asc, size_t i, unsigned base, unsigned long max, unsigned long *value)
{
	unsigned long sum = 0;

	if (i >= asc->words || asc->length[i] == 0)
		return false;
	for (size_t k = 0; k < asc->length[i]; k++) {
		static const char digits[] = "0123456789abcdef";
		const char *digit = memchr(digits, asc->word[i][k] | 0x20, base);

		if (digit == NULL)
			return false;
		sum = sum * base + (unsigned long)(digit - digits);
		if (sum > max)
			return false;
	}
	*value = sum;
	return true;
}

static bool asc_id(struct asc *asc, size_t i, struct frame *frame)
{
	unsigned long id;
	bool extended;

	if (i >= asc->words)
		return false;
	extended = asc->length[i] > 1 && (asc->word[i][asc->length[i] - 1] | 0x20) == 'x';
	asc->length[i] -= extended;
	if (!asc_whole(asc, i, asc->decimal ? 10 : 16, extended ? 0x1FFFFFFF : 0x7FF, &id))
		return false;
	frame->id = (uint32_t)id;
	frame->flags |= extended ? FRAME_EXTENDED : 0;
	return true;
}

static bool asc_data(const struct asc *asc, size_t from, unsigned long count, struct frame *frame)
{
	for (unsigned long k = 0; k < count; k++) {
		unsigned long byte;

		if (!asc_whole(asc, from + k, asc->decimal ? 10 : 16, 255, &byte))
			return false;
		frame->data[k] = (uint8_t)byte;
	}
	frame->length = (uint8_t)count;
	return true;
}

/* time channel id Rx d 8 01 02 ... */
static bool asc_classic(struct asc *asc, struct frame *frame)
{
	unsigned long length = 0;

	if (!asc_id(asc, 2, frame))
		return false;
	if (word_is(asc, 4, "r")) {
		frame->flags |= FRAME_REMOTE;
		frame->length = asc_whole(asc, 5, 16, 8, &length) ? (uint8_t)length : 0;
		return true;
	}
	return asc_whole(asc, 5, 16, 15, &length) && asc_data(asc, 6, length < 8 ? length : 8, frame);
}

/* time CANFD channel Rx id [name] brs esi dlc length 01 02 ... */
static bool asc_fd(struct asc *asc, struct frame *frame)
{
	unsigned long brs, esi, length;
	size_t at = 5;

	if (!asc_id(asc, 4, frame))
		return false;
	at += !(asc_whole(asc, 5, 2, 1, &brs) && asc_whole(asc, 6, 2, 1, &esi)); /* a symbolic name */
	if (!asc_whole(asc, at, 2, 1, &brs) || !asc_whole(asc, at + 1, 2, 1, &esi) ||
	    !asc_whole(asc, at + 3, 10, FRAME_DATA_MAX, &length))
		return false;
	frame->flags |= (uint8_t)(FRAME_FD | (brs ? FRAME_BRS : 0) | (esi ? FRAME_ESI : 0));
	return asc_data(asc, at + 4, length, frame);
}

static void asc_line(struct asc *asc, const struct source_line *line)
{
	struct frame frame = {0};
	unsigned long channel;
	double time_s;
	bool fd, right;

	split(asc, line);
	if (word_is(asc, 0, "base")) {
		asc->decimal = word_is(asc, 1, "dec");
		asc->relative = word_is(asc, 3, "relative");
	}
	if (asc->words < 2 || !number_parse(asc->word[0], asc->length[0], '.', &time_s) || !(time_s >= 0) ||
	    time_s > 1e11)
		return;
	asc->time_s = asc->relative ? asc->time_s + time_s : time_s;
	fd = word_is(asc, 1, "CANFD");
	if (!asc_whole(asc, fd ? 2 : 1, 10, 999, &channel) ||
	    !(word_is(asc, 3, "Rx") || word_is(asc, 3, "Tx")) || (!fd && asc->words < 5))
		return; /* of something else */
	if (!fd && !word_is(asc, 4, "d") && !word_is(asc, 4, "r"))
		return;
	frame.time_us = asc->time_s < 9e12 ? llround(asc->time_s * 1e6) : 0;
	right = fd ? asc_fd(asc, &frame) : asc_classic(asc, &frame);
	if (right && link_frame_valid(&frame))
		put_frame(asc->text, &frame, (unsigned)channel);
	else
		put_corrupt(asc->text, line->number);
}

static int asc_text(struct can_text *text, char *message)
{
	struct asc asc = {.text = text};
	struct source_line line = {0};

	while (source_next_line(text->source, &line))
		asc_line(&asc, &line);
	if (text->frames > 0)
		return 0;
	return source_refuse(message, DT_E_EMPTY, text->source->file, 0,
	                     "a CAN log of Vector (ASC) without a CAN frame");
}

/* ---- pcap, pcapng ---- */

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
		put_frame(pcap->text, &frame, interface);
	else
		put_corrupt(pcap->text, at);
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
		put_corrupt(pcap->text, at);
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
		put_corrupt(pcap->text, at);
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
		put_corrupt(pcap->text, at);
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
		put_corrupt(pcap->text, at);
}

static int pcap_text(struct can_text *text, char *message)
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

/* ---- all of them ---- */

bool can_text_is(const char *head, size_t length)
{
	bool big;

	if (length > HEAD_BYTES)
		length = HEAD_BYTES;
	return asc_is(head, length) || pcap_kind(head, length, &big) != 0;
}

int can_text(struct source *source, char message[READ_MESSAGE_MAX])
{
	struct can_text text = {.source = source};
	struct text made;
	int error;

	if (!can_text_is(source->bytes, source->size))
		return 0;
	if (text_open(&made) != 0)
		return source_no_memory(message, source->file);
	text.out = made.out;
	error = asc_is(source->bytes, source->size < HEAD_BYTES ? source->size : HEAD_BYTES)
	                ? asc_text(&text, message)
	                : pcap_text(&text, message);
	if (text_close(&made, error) != 0)
		return error ? error : source_no_memory(message, source->file);
	free(source->bytes);
	source->bytes = made.bytes;
	source->size = made.size;
	return 0;
}
