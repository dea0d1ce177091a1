/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/candump.h"

#include <string.h>

#include "common/base/wide.h"
#include "common/link/transport.h"

#define ERROR_BIT 0x20000000u
#define SECOND_DIGITS_MAX 12 /* so that microseconds fit 63 bits */
#define INTERFACE_MAX 64

enum { FLAG_BRS = 1, FLAG_ESI = 2, FLAG_ALL = 7 };

/* clang-format off */
/* Value of a hex digit plus one; 0 for every other byte. */
static const uint8_t digit_value[256] = {
	['0'] = 1, ['1'] = 2, ['2'] = 3, ['3'] = 4, ['4'] = 5, ['5'] = 6, ['6'] = 7, ['7'] = 8, ['8'] = 9,
	['9'] = 10, ['A'] = 11, ['B'] = 12, ['C'] = 13, ['D'] = 14, ['E'] = 15, ['F'] = 16,
	['a'] = 11, ['b'] = 12, ['c'] = 13, ['d'] = 14, ['e'] = 15, ['f'] = 16,
};
/* clang-format on */

/* What is left of the line. Every step eats what it understood; a step that fails leaves `at` where the
 * line stopped making sense. */
struct text {
	const char *at, *end;
};

static int peek(const struct text *text)
{
	return text->at < text->end ? (unsigned char)*text->at : -1;
}

static bool eat(struct text *text, char c)
{
	if (text->at == text->end || *text->at != c)
		return false;
	text->at++;
	return true;
}

static unsigned eat_blanks(struct text *text)
{
	const char *start = text->at;

	while (text->at < text->end && (*text->at == ' ' || *text->at == '\t'))
		text->at++;
	return (unsigned)(text->at - start);
}

/* -1 if there is no hex digit. */
static int eat_nibble(struct text *text)
{
	int value = text->at < text->end ? digit_value[(unsigned char)*text->at] - 1 : -1;

	if (value >= 0)
		text->at++;
	return value;
}

static bool is_decimal(int c)
{
	return c >= '0' && c <= '9';
}

/* Eight characters, the first the lowest; those of a text with others in place of some are made by shifts, as
 * a processor waits for what was just written piece by piece. */
static uint64_t eight_at(const char *at)
{
	uint64_t c;

	memcpy(&c, at, sizeof(c));
	return c;
}

/* Eight decimal digits at once: false if one of the characters is none. */
static bool read_eight(uint64_t c, uint32_t *value)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
	uint64_t digit = c ^ 0x3030303030303030u;

	if ((((digit + 0x7676767676767676u) | digit) & 0x8080808080808080u) != 0)
		return false;
	digit = (digit * 10 + (digit >> 8)) & 0x00FF00FF00FF00FFu;
	digit = (digit * 100 + (digit >> 16)) & 0x0000FFFF0000FFFFu;
	*value = (uint32_t)(digit * 10000 + (digit >> 32));
	return true;
#else
	(void)c;
	(void)value;
	return false;
#endif
}

/* At most max decimal digits into *value; how many there were. */
static int eat_decimals(struct text *text, int max, int64_t *value)
{
	int digits = 0;

	for (*value = 0; digits < max && is_decimal(peek(text)); digits++)
		*value = *value * 10 + (*text->at++ - '0');
	return digits;
}

/* As candump itself writes it: (1700000000.000000) */
static bool eat_usual_time(struct text *text, int64_t *time_us)
{
	const char *at = text->at;
	uint32_t high, middle, low;

	if (text->end - at < 19 || at[0] != '(' || at[11] != '.' || at[18] != ')')
		return false;
	/* zeros before the first two digits, and before the last six */
	if (!read_eight(eight_at(at + 1) << 48 | 0x303030303030u, &high) ||
	    !read_eight(eight_at(at + 3), &middle) ||
	    !read_eight((eight_at(at + 10) & ~(uint64_t)0xFFFF) | 0x3030u, &low))
		return false;
	*time_us = (high * (int64_t)100000000 + middle) * 1000000 + low;
	text->at += 19;
	return true;
}

static bool eat_time(struct text *text, int64_t *time_us)
{
	int64_t seconds, decimals = 0, below_us;
	int digits = 0;

	if (eat_usual_time(text, time_us))
		return true;

	if (!eat(text, '(') || eat_decimals(text, SECOND_DIGITS_MAX, &seconds) == 0)
		return false;
	if (eat(text, '.')) {
		digits = eat_decimals(text, 6, &decimals);
		(void)eat_decimals(text, 3, &below_us);
	}
	for (; digits < 6; digits++)
		decimals *= 10;
	*time_us = seconds * 1000000 + decimals;
	return eat(text, ')');
}

static bool eat_interface(struct text *text)
{
	const char *start;

	if (eat_blanks(text) == 0)
		return false;
	start = text->at;
	while (peek(text) > ' ' && peek(text) != 127)
		text->at++;
	return text->at > start && eat_blanks(text) > 0;
}

/* A wrong identifier is reported where it begins. */
static bool eat_id(struct text *text, struct frame *frame)
{
	const char *start = text->at;
	uint32_t id = 0;
	int nibble, digits = 0;

	for (; digits < 8 && (nibble = eat_nibble(text)) >= 0; digits++)
		id = id << 4 | (uint32_t)nibble;
	if (digits == 8)
		frame->flags = (id & ERROR_BIT) != 0 ? FRAME_ERROR : FRAME_EXTENDED;
	frame->id = (frame->flags & FRAME_ERROR) != 0 ? id ^ ERROR_BIT : id;
	if ((digits == 3 || digits == 8) && frame->id <= (digits == 3 ? 0x7FFu : 0x1FFFFFFFu) &&
	    eat(text, '#'))
		return true;
	text->at = start;
	return false;
}

static bool eat_fd_flags(struct text *text, struct frame *frame)
{
	int nibble = eat_nibble(text);

	if (nibble < 0 || nibble > FLAG_ALL)
		return false;
	frame->flags |= FRAME_FD;
	if ((nibble & FLAG_BRS) != 0)
		frame->flags |= FRAME_BRS;
	if ((nibble & FLAG_ESI) != 0)
		frame->flags |= FRAME_ESI;
	return true;
}

/* Thirty-two characters at once. */
typedef uint8_t letters __attribute__((vector_size(32)));
typedef uint16_t pairs __attribute__((vector_size(32)));
typedef uint8_t octets __attribute__((vector_size(16)));

/* Sixteen bytes each from thirty-two hex digits; how many bytes; none if a character is no digit. */
WIDE static unsigned read_many(const char *at, size_t digits, uint8_t bytes[FRAME_DATA_MAX])
{
	const unsigned length = digits < 2 * FRAME_DATA_MAX ? (unsigned)digits / 32 * 16 : FRAME_DATA_MAX;
	letters valid = ~(letters){0};
	uint64_t all[4];

	for (unsigned i = 0; i < length; i += 16) {
		letters c, is_letter;
		pairs pair;
		octets packed;

		memcpy(&c, at + 2 * i, sizeof(c));
		is_letter = (letters)((c | 0x20) - 'a' <= 'f' - 'a');
		valid &= (letters)(c - '0' <= 9) | is_letter;
		pair = (pairs)((c & 0x0F) + (is_letter & 9));
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ /* the first digit of two is the higher one */
		pair = pair << 4 | pair >> 8;
#else
		pair = pair >> 4 | pair;
#endif
		packed = __builtin_convertvector(pair, octets);
		memcpy(bytes + i, &packed, sizeof(packed));
	}
	memcpy(all, &valid, sizeof(all));
	if ((all[0] & all[1] & all[2] & all[3]) == UINT64_MAX)
		return length;
	memset(bytes, 0, length);
	return 0;
}

/* A frame's last or only eight bytes, as if as many zeros followed; false, and nothing written, if a digit is
 * none. */
static bool read_octet(const char *at, uint8_t bytes[8])
{
	char padded[32];
	uint8_t all[FRAME_DATA_MAX];

	memset(padded, '0', sizeof(padded));
	memcpy(padded, at, 16);
	if (read_many(padded, sizeof(padded), all) == 0)
		return false;
	memcpy(bytes, all, 8);
	return true;
}

static void eat_data(struct text *text, struct frame *frame)
{
	unsigned length = read_many(text->at, (size_t)(text->end - text->at), frame->data);

	text->at += 2 * length;
	if (length + 8 <= FRAME_DATA_MAX && text->end - text->at >= 16 &&
	    read_octet(text->at, frame->data + length)) {
		length += 8;
		text->at += 16;
	}
	while (length < FRAME_DATA_MAX && text->end - text->at >= 2) {
		unsigned high = digit_value[(unsigned char)text->at[0]];
		unsigned low = digit_value[(unsigned char)text->at[1]];

		if (high == 0 || low == 0)
			break;
		frame->data[length++] = (uint8_t)((high - 1) << 4 | (low - 1));
		text->at += 2;
	}
	frame->length = (uint8_t)length;
}

static void eat_remote_length(struct text *text, struct frame *frame)
{
	int nibble = eat_nibble(text);

	frame->flags |= FRAME_REMOTE;
	frame->length = nibble < 0 ? 0 : (uint8_t)nibble;
}

static bool eat_content(struct text *text, struct frame *frame)
{
	if (eat(text, 'R')) {
		eat_remote_length(text, frame);
		return true;
	}
	if (eat(text, '#') && !eat_fd_flags(text, frame))
		return false;
	eat_data(text, frame);
	return true;
}

/* Blanks, a direction, the line's end; nothing else. */
static bool eat_tail(struct text *text)
{
	if (eat_blanks(text) > 0 && (eat(text, 'R') || eat(text, 'T')))
		eat_blanks(text);
	(void)eat(text, '\r');
	(void)eat(text, '\n');
	return text->at == text->end;
}

int candump_parse(const char *line, size_t length, struct frame *frame, unsigned *column)
{
	struct text text = {line, line + length};
	struct frame parsed;

	if (peek(&text) != '(')
		return 0;
	memset(&parsed, 0, sizeof(parsed));
	if (!eat_time(&text, &parsed.time_us) || !eat_interface(&text) || !eat_id(&text, &parsed) ||
	    !eat_content(&text, &parsed) || !link_frame_valid(&parsed) || !eat_tail(&text)) {
		*column = (unsigned)(text.at - line) + 1u;
		return DT_E_FORMAT;
	}
	/* one by one, as they were written; whole, the processor waits until all of them are */
	frame->time_us = parsed.time_us;
	frame->id = parsed.id;
	frame->flags = parsed.flags;
	frame->length = parsed.length;
	memcpy(frame->data, parsed.data, sizeof(frame->data));
	return 1;
}

static const char hex_digits[16] = "0123456789ABCDEF";

static char *put_decimal(char *p, uint64_t value, int digits_min)
{
	char reversed[20];
	int digits = 0;

	for (; value != 0 || digits < digits_min; value /= 10)
		reversed[digits++] = (char)('0' + value % 10);
	while (digits > 0)
		*p++ = reversed[--digits];
	return p;
}

static char *put_id(char *p, const struct frame *frame)
{
	uint32_t id = (frame->flags & FRAME_ERROR) != 0 ? frame->id | ERROR_BIT : frame->id;
	int digits = (frame->flags & (FRAME_EXTENDED | FRAME_ERROR)) != 0 ? 8 : 3;

	while (digits-- > 0)
		*p++ = hex_digits[id >> (4 * digits) & 15u];
	return p;
}

static char *put_content(char *p, const struct frame *frame)
{
	unsigned length = frame->length < FRAME_DATA_MAX ? frame->length : FRAME_DATA_MAX;

	*p++ = '#';
	if ((frame->flags & FRAME_REMOTE) != 0) {
		*p++ = 'R';
		if (length > 0)
			*p++ = hex_digits[length & 15u];
		return p;
	}
	if ((frame->flags & FRAME_FD) != 0) {
		*p++ = '#';
		*p++ = hex_digits[((frame->flags & FRAME_BRS) != 0 ? FLAG_BRS : 0) |
		                  ((frame->flags & FRAME_ESI) != 0 ? FLAG_ESI : 0)];
	}
	for (unsigned i = 0; i < length; i++) {
		*p++ = hex_digits[frame->data[i] >> 4];
		*p++ = hex_digits[frame->data[i] & 15u];
	}
	return p;
}

size_t candump_format(char line[CANDUMP_LINE_MAX], const struct frame *frame, const char *interface)
{
	uint64_t time_us = frame->time_us > 0 ? (uint64_t)frame->time_us : 0;
	size_t name_length = strnlen(interface, INTERFACE_MAX);
	char *p = line;

	*p++ = '(';
	p = put_decimal(p, time_us / 1000000, 10);
	*p++ = '.';
	p = put_decimal(p, time_us % 1000000, 6);
	*p++ = ')';
	*p++ = ' ';
	memcpy(p, interface, name_length);
	p += name_length;
	*p++ = ' ';
	p = put_id(p, frame);
	p = put_content(p, frame);
	*p++ = '\n';
	*p = '\0';
	return (size_t)(p - line);
}
