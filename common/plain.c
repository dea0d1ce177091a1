/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/plain.h"

#include <stdint.h>

/* Length of the character at text, at most left bytes; 0 when it is none. */
static size_t character(const unsigned char *text, size_t left, uint32_t *code)
{
	static const uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
	size_t length = text[0] < 0x80   ? 1
	                : text[0] < 0xC0 ? 0
	                : text[0] < 0xE0 ? 2
	                : text[0] < 0xF0 ? 3
	                : text[0] < 0xF8 ? 4
	                                 : 0;
	uint32_t value = length == 1 ? text[0] : text[0] & (0x7Fu >> length);

	if (length == 0 || length > left)
		return 0;
	for (size_t i = 1; i < length; i++) {
		if ((text[i] & 0xC0u) != 0x80)
			return 0;
		value = value << 6 | (text[i] & 0x3Fu);
	}
	if (length > 1 && (value < least[length] || value > 0x10FFFF || (value >= 0xD800 && value < 0xE000)))
		return 0;
	*code = value;
	return length;
}

static bool shows(uint32_t code)
{
	return !(code < 0x20 || (code >= 0x7F && code < 0xA0) || (code >= 0x2028 && code <= 0x202E) ||
	         (code >= 0x2066 && code <= 0x2069) || code == 0xFEFF);
}

static bool plain_check(const char *text, size_t length, bool plain)
{
	const unsigned char *bytes = (const unsigned char *)text;
	uint32_t code = 0;

	for (size_t at = 0, step; at < length; at += step) {
		step = character(bytes + at, length - at, &code);
		if (step == 0 || (plain && !shows(code)))
			return false;
	}
	return true;
}

bool plain_is_utf8(const char *text, size_t length)
{
	return plain_check(text, length, false);
}

bool plain_is_line(const char *text, size_t length)
{
	return plain_check(text, length, true);
}
