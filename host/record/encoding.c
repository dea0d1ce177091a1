/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/encoding.h"

#include <string.h>

#include "common/base/wide.h"
#include "host/base/mapped.h"

enum {
	LOOKED_AT = 4096,
	REPLACEMENT = 0xFFFD,
	PART = 1 << 20, /* bytes of a pass, then mapped_seen is told */
};

/* Part of the odd or even bytes that are zero in UTF-16 of Latin letters and digits. */
static const double ZEROS = 0.3;

static size_t put_utf8(char *to, uint32_t c)
{
	if (c < 0x80) {
		to[0] = (char)c;
		return 1;
	}
	if (c < 0x800) {
		to[0] = (char)(0xC0 | c >> 6);
		to[1] = (char)(0x80 | (c & 0x3F));
		return 2;
	}
	if (c < 0x10000) {
		to[0] = (char)(0xE0 | c >> 12);
		to[1] = (char)(0x80 | (c >> 6 & 0x3F));
		to[2] = (char)(0x80 | (c & 0x3F));
		return 3;
	}
	to[0] = (char)(0xF0 | c >> 18);
	to[1] = (char)(0x80 | (c >> 12 & 0x3F));
	to[2] = (char)(0x80 | (c >> 6 & 0x3F));
	to[3] = (char)(0x80 | (c & 0x3F));
	return 4;
}

static uint32_t unit_at(const unsigned char *bytes, size_t at, bool big)
{
	return big ? (uint32_t)bytes[at] << 8 | bytes[at + 1] : (uint32_t)bytes[at + 1] << 8 | bytes[at];
}

static size_t from_utf16(const unsigned char *bytes, size_t size, bool big, char *to)
{
	size_t used = 0;

	for (size_t at = 0; at + 1 < size; at += 2) {
		uint32_t c = unit_at(bytes, at, big);
		uint32_t low = at + 3 < size ? unit_at(bytes, at + 2, big) : 0;

		if (c == 0xFEFF && at == 0)
			continue;
		if (c >= 0xD800 && c < 0xDC00 && low >= 0xDC00 && low < 0xE000) {
			c = 0x10000 + ((c - 0xD800) << 10) + (low - 0xDC00);
			at += 2;
		} else if (c >= 0xD800 && c < 0xE000) {
			c = REPLACEMENT;
		}
		used += put_utf8(to + used, c);
		if (at % PART < 2)
			mapped_seen(2 * PART);
	}
	return used;
}

static size_t from_cp1252(const unsigned char *bytes, size_t size, char *to)
{
	size_t used = 0;

	for (size_t at = 0; at < size; at++) { /* what is between stands in no unit */
		used += put_utf8(to + used, bytes[at] >= 0x80 && bytes[at] < 0xA0 ? '?' : bytes[at]);
		if (at % PART == 0)
			mapped_seen(2 * PART);
	}
	return used;
}

/* Where the next byte beyond ASCII may be. */
static size_t skip_ascii(const unsigned char *bytes, size_t size, size_t at)
{
	uint64_t eight;

	for (; size - at >= sizeof(eight); at += sizeof(eight)) {
		memcpy(&eight, bytes + at, sizeof(eight));
		if ((eight & UINT64_C(0x8080808080808080)) != 0)
			break;
		if (at % PART < sizeof(eight))
			mapped_seen(PART);
	}
	return at;
}

static bool is_utf8(const unsigned char *bytes, size_t size)
{
	for (size_t at = skip_ascii(bytes, size, 0); at < size; at = skip_ascii(bytes, size, at + 1)) {
		unsigned char c = bytes[at];
		size_t more = c < 0x80 ? 0 : c >> 5 == 6 ? 1 : c >> 4 == 14 ? 2 : c >> 3 == 30 ? 3 : 4;

		if (more == 4 || at + more >= size + (more == 0))
			return false;
		for (size_t k = 1; k <= more; k++)
			if (bytes[at + k] >> 6 != 2)
				return false;
		at += more;
	}
	return true;
}

/* 'l', 'b', or 0 where it is no UTF-16. */
static char utf16_order(const unsigned char *bytes, size_t size)
{
	size_t looked = size < LOOKED_AT ? size : LOOKED_AT, odd = 0, even = 0;

	if (size >= 2 && bytes[0] == 0xFF && bytes[1] == 0xFE)
		return 'l';
	if (size >= 2 && bytes[0] == 0xFE && bytes[1] == 0xFF)
		return 'b';
	for (size_t at = 0; at < looked; at++)
		*(at % 2 ? &odd : &even) += bytes[at] == 0;
	if ((double)odd > ZEROS * (double)looked && even == 0)
		return 'l';
	return (double)even > ZEROS * (double)looked && odd == 0 ? 'b' : '\0';
}

static uint64_t line_of(const struct source *source, const char *byte)
{
	uint64_t line = 1;

	for (const char *at = source->bytes; at < byte; at++)
		line += *at == '\n';
	return line;
}

/* Thirty-two characters at once, where the processor has registers of that width in them. */
typedef unsigned char letters __attribute__((vector_size(32)));

/* What is among the characters of a text. */
struct looked {
	unsigned char high; /* bits of all of them */
	bool zero;
	size_t lines;
};

/* Blocks of thirty-two, no more than a count in a byte holds; how many characters. */
WIDE static size_t look_wide(struct looked *looked, const char *at, size_t size)
{
	letters c, high = {0}, zero = {0}, ends = {0};
	size_t blocks = size / sizeof(c) < UINT8_MAX ? size / sizeof(c) : UINT8_MAX;

	for (size_t i = 0; i < blocks; i++) {
		memcpy(&c, at + i * sizeof(c), sizeof(c));
		high |= c;
		zero |= (letters)(c == 0);
		ends -= (letters)(c == '\n');
	}
	for (size_t i = 0; i < sizeof(c); i++) {
		looked->high |= high[i];
		looked->zero |= zero[i] != 0;
		looked->lines += ends[i];
	}
	return blocks * sizeof(c);
}

static struct looked look(const char *bytes, size_t size)
{
	struct looked looked = {0};
	size_t at = 0, told = 0;

	while (size - at >= sizeof(letters)) {
		at += look_wide(&looked, bytes + at, size - at);
		if (at - told >= PART) {
			mapped_seen(at - told);
			told = at;
		}
	}
	for (; at < size; at++) {
		looked.high |= (unsigned char)bytes[at];
		looked.zero |= bytes[at] == '\0';
		looked.lines += bytes[at] == '\n';
	}
	return looked;
}

/* Lines that end in a carriage return alone, as spreadsheets of another age write them. */
static bool settle_line_ends(struct source *source)
{
	const size_t size = source->size;
	char *text;

	if (source->lines > 0 || memchr(source->bytes, '\r', size) == NULL)
		return true;
	text = mapped_array(size, 1);
	if (text == NULL)
		return false;
	for (size_t at = 0; at < size; at++) {
		text[at] = source->bytes[at] == '\r' ? '\n' : source->bytes[at];
		if (at % PART == PART - 1)
			mapped_seen(2 * PART);
	}
	source_replace(source, text, size);
	source->lines = look(text, size).lines;
	return true;
}

/* Bytes in UTF-8, or somewhat more. */
static size_t room_for(const struct source *source, char order)
{
	size_t high = 0;

	if (order != '\0')
		return source->size / 2 * 3;
	for (size_t at = 0; at < source->size; at++) {
		high += (unsigned char)source->bytes[at] >= 0x80;
		if (at % PART == 0)
			mapped_seen(PART);
	}
	return source->size + high;
}

/* In UTF-16 or CP1252. */
static bool settle_other(struct source *source, char order)
{
	const unsigned char *bytes = (const unsigned char *)source->bytes;
	char *text = mapped_array(room_for(source, order), 1);
	size_t used;

	if (text == NULL)
		return false;
	used = order != '\0' ? from_utf16(bytes, source->size, order == 'b', text)
	                     : from_cp1252(bytes, source->size, text);
	source_replace(source, text, used);
	source->lines = look(text, used).lines;
	return true;
}

int encoding_settle(struct source *source, const char **name, char message[READ_MESSAGE_MAX])
{
	const unsigned char *bytes = (const unsigned char *)source->bytes;
	const char order = utf16_order(bytes, source->size);
	const struct looked looked = look(source->bytes, source->size);
	bool utf8;

	if (order == '\0' && looked.zero)
		return source_refuse(message, DT_E_FORMAT, source->file,
		                     line_of(source, memchr(bytes, '\0', source->size)),
		                     "a zero byte: binary file of no kind that is known here, expected text");
	if (order != '\0' && source->size % 2 != 0)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "text in UTF-16 of an odd number of bytes: the file is cut");
	source->lines = looked.lines;
	utf8 = order == '\0' && (looked.high < 0x80 || is_utf8(bytes, source->size));
	*name = utf8 ? "utf-8" : order == 'l' ? "utf-16le" : order == 'b' ? "utf-16be" : "cp1252";
	if ((utf8 || settle_other(source, order)) && settle_line_ends(source))
		return 0;
	return source_no_memory(message, source->file);
}
