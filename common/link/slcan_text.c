/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/slcan_text.h"

#include <stdint.h>
#include <string.h>

#include "common/link/transport.h"

#define STAMP_DIGITS 4u

static const char hex_digits[16] = "0123456789ABCDEF";

static const struct {
	char letter;
	uint8_t flags;
} letters[] = {
        {'t', 0},
        {'T', FRAME_EXTENDED},
        {'r', FRAME_REMOTE},
        {'R', FRAME_REMOTE | FRAME_EXTENDED},
        {'d', FRAME_FD},
        {'D', FRAME_FD | FRAME_EXTENDED},
        {'b', FRAME_FD | FRAME_BRS},
        {'B', FRAME_FD | FRAME_BRS | FRAME_EXTENDED},
};

#define LETTERS (sizeof(letters) / sizeof(letters[0]))

size_t slcan_encode(char line[SLCAN_LINE_MAX], const struct frame *frame)
{
	unsigned flags = frame->flags & ~(unsigned)FRAME_ESI;
	int id_digits = (flags & FRAME_EXTENDED) != 0 ? 8 : 3;
	char *p = line;

	for (size_t i = 0; i < LETTERS; i++)
		if (letters[i].flags == flags)
			*p++ = letters[i].letter;
	if (p == line)
		return 0;
	while (id_digits-- > 0)
		*p++ = hex_digits[frame->id >> (4 * id_digits) & 15u];
	*p++ = hex_digits[link_code_of_length(frame->length)];
	for (unsigned i = 0; i < frame->length && (flags & FRAME_REMOTE) == 0; i++) {
		*p++ = hex_digits[frame->data[i] >> 4];
		*p++ = hex_digits[frame->data[i] & 15u];
	}
	*p++ = '\r';
	return (size_t)(p - line);
}

static int nibble_of(char c)
{
	if (c >= '0' && c <= '9')
		return c - '0';
	if (c >= 'A' && c <= 'F')
		return c - 'A' + 10;
	if (c >= 'a' && c <= 'f')
		return c - 'a' + 10;
	return -1;
}

static bool all_hex(const char *text, unsigned length)
{
	for (unsigned i = 0; i < length; i++)
		if (nibble_of(text[i]) < 0)
			return false;
	return true;
}

/* text holds hex digits only */
static uint32_t slcan_text_number_of(const char *text, unsigned digits)
{
	uint32_t value = 0;

	for (unsigned i = 0; i < digits; i++)
		value = value << 4 | (uint32_t)nibble_of(text[i]);
	return value;
}

/* One line without its end. */
static bool parse_line(const char *line, unsigned length, struct frame *frame)
{
	struct frame parsed = {0};
	unsigned letter = 0, id_digits, head, data_digits;

	while (letter < LETTERS && letters[letter].letter != line[0])
		letter++;
	if (letter == LETTERS)
		return false;
	parsed.flags = letters[letter].flags;
	id_digits = (parsed.flags & FRAME_EXTENDED) != 0 ? 8 : 3;
	head = 1 + id_digits + 1;
	if (length < head || !all_hex(line + 1, length - 1))
		return false;
	parsed.id = slcan_text_number_of(line + 1, id_digits);
	parsed.length = (uint8_t)link_length_of_code(slcan_text_number_of(line + 1 + id_digits, 1));
	data_digits = (parsed.flags & FRAME_REMOTE) != 0 ? 0 : 2u * parsed.length;
	if (!link_frame_valid(&parsed) ||
	    (length != head + data_digits && length != head + data_digits + STAMP_DIGITS))
		return false;
	for (unsigned i = 0; i < data_digits / 2; i++)
		parsed.data[i] = (uint8_t)slcan_text_number_of(line + head + (size_t)2 * i, 2);
	*frame = parsed;
	return true;
}

/* What adapters say of our own lines: nothing, or z or Z when a frame was taken. */
static bool slcan_text_is_answer(const char *line, unsigned length)
{
	return length == 0 || (length == 1 && (line[0] == 'z' || line[0] == 'Z'));
}

int slcan_decode(struct slcan_decoder *decoder, char byte, struct frame *frame)
{
	unsigned length = decoder->length;
	bool overflow = decoder->overflow;

	if (byte == '\n')
		return 0;
	if (byte != '\r' && byte != '\a') {
		if (length < SLCAN_LINE_MAX)
			decoder->line[decoder->length++] = byte;
		else
			decoder->overflow = true;
		return 0;
	}
	decoder->length = 0;
	decoder->overflow = false;
	if (!overflow && slcan_text_is_answer(decoder->line, length))
		return 0;
	return byte == '\r' && !overflow && parse_line(decoder->line, length, frame) ? 1 : DT_E_FORMAT;
}
