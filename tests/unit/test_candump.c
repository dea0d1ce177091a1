/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * candump text: lines written by hand, what a grammar written as a regular expression accepts, and that
 * every frame comes back from its line.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <regex.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/candump.h"

#define SEED 20240607u
#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

static const uint8_t fd_lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static uint32_t seed = SEED;

static uint32_t draw(uint32_t below)
{
	seed = seed * 1664525u + 1013904223u;
	return (uint32_t)(((uint64_t)seed * below) >> 32);
}

static void check_equal(const struct frame *a, const struct frame *b)
{
	assert_true(a->time_us == b->time_us);
	assert_int_equal(a->id, b->id);
	assert_int_equal(a->flags, b->flags);
	assert_int_equal(a->length, b->length);
	if ((a->flags & FRAME_REMOTE) == 0)
		assert_memory_equal(a->data, b->data, a->length);
}

static const struct {
	const char *line;
	struct frame frame;
} vectors[] = {
        {"(1436509052.249713) vcan0 044#2A366C2BBA\n",
         {1436509052249713, 0x44, 0, 5, {0x2A, 0x36, 0x6C, 0x2B, 0xBA}}},
        {"(0000000000.000001) can0 7FF#\n", {1, 0x7FF, 0, 0, {0}}},
        {"(0000000012.500000) can0 1FFFFFFF#00FF\n", {12500000, 0x1FFFFFFF, FRAME_EXTENDED, 2, {0, 0xFF}}},
        {"(0000000012.500000) can0 00000123#7E\n", {12500000, 0x123, FRAME_EXTENDED, 1, {0x7E}}},
        {"(0000000012.500000) can0 20000080#0000000000000000\n", {12500000, 0x80, FRAME_ERROR, 8, {0}}},
        {"(0000000012.500000) can0 123#R\n", {12500000, 0x123, FRAME_REMOTE, 0, {0}}},
        {"(0000000012.500000) can0 123#R8\n", {12500000, 0x123, FRAME_REMOTE, 8, {0}}},
        {"(0000000012.500000) can0 12345678#R3\n",
         {12500000, 0x12345678, FRAME_REMOTE | FRAME_EXTENDED, 3, {0}}},
        {"(0000000012.500000) can0 181##0\n", {12500000, 0x181, FRAME_FD, 0, {0}}},
        {"(0000000012.500000) can0 181##111\n", {12500000, 0x181, FRAME_FD | FRAME_BRS, 1, {0x11}}},
        {"(0000000012.500000) can0 181##2AB\n", {12500000, 0x181, FRAME_FD | FRAME_ESI, 1, {0xAB}}},
        {"(0000000012.500000) can0 12345678##30102030405060708090A0B0C\n",
         {12500000,
          0x12345678,
          FRAME_FD | FRAME_BRS | FRAME_ESI | FRAME_EXTENDED,
          12,
          {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}}},
};

static void test_vectors_both_ways(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		struct frame frame;
		char line[CANDUMP_LINE_MAX], name[16] = "";
		unsigned column = 0;
		const char *space = strchr(vectors[i].line, ' ') + 1;

		memcpy(name, space, (size_t)(strchr(space, ' ') - space));
		memset(&frame, 0xA5, sizeof(frame));
		assert_int_equal(candump_parse(vectors[i].line, strlen(vectors[i].line), &frame, &column), 1);
		check_equal(&frame, &vectors[i].frame);
		assert_int_equal(candump_format(line, &vectors[i].frame, name), strlen(vectors[i].line));
		assert_string_equal(line, vectors[i].line);
	}
}

/* What others write and we read. */
static void test_dialects(void **state)
{
	static const struct {
		const char *line;
		struct frame frame;
	} cases[] = {
	        {"(5) can0 123#1122", {5000000, 0x123, 0, 2, {0x11, 0x22}}},
	        {"(5.) can0 123#", {5000000, 0x123, 0, 0, {0}}},
	        {"(5.25) can0 123#", {5250000, 0x123, 0, 0, {0}}},
	        {"(5.123456789) can0 123#", {5123456, 0x123, 0, 0, {0}}},
	        {"(999999999999.999999) can0 123#", {999999999999999999, 0x123, 0, 0, {0}}},
	        {"(5.000000) can0 1ab#aBcD R\n", {5000000, 0x1AB, 0, 2, {0xAB, 0xCD}}},
	        {"(5.000000) slcan12 123#R T\r\n", {5000000, 0x123, FRAME_REMOTE, 0, {0}}},
	        {"(5.000000)  can0\t123#R0  ", {5000000, 0x123, FRAME_REMOTE, 0, {0}}},
	        {"(5.000000) can0 123##511", {5000000, 0x123, FRAME_FD | FRAME_BRS, 1, {0x11}}},
	        {"(5.000000) can0 123##4", {5000000, 0x123, FRAME_FD, 0, {0}}},
	        {"(5.000000) can0 123##7", {5000000, 0x123, FRAME_FD | FRAME_BRS | FRAME_ESI, 0, {0}}},
	};

	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		struct frame frame;
		unsigned column = 0;

		assert_int_equal(candump_parse(cases[i].line, strlen(cases[i].line), &frame, &column), 1);
		check_equal(&frame, &cases[i].frame);
	}
}

static void test_skipped(void **state)
{
	static const char *const lines[] = {"", "\n", " ", "# comment", "date Tue Jan 1", " (1.0) can0 123#"};
	struct frame frame = {.id = 77}, before = frame;
	unsigned column = 99;

	(void)state;
	for (size_t i = 0; i < COUNT(lines); i++)
		assert_int_equal(candump_parse(lines[i], strlen(lines[i]), &frame, &column), 0);
	assert_memory_equal(&frame, &before, sizeof(frame));
	assert_int_equal(column, 99);
}

static void test_refused_with_column(void **state)
{
	static const struct {
		const char *line;
		unsigned column;
	} cases[] = {
	        {"(", 2},
	        {"(x) can0 123#", 2},
	        {"(-5.0) can0 123#", 2},
	        {"(1234567890123.0) can0 123#", 14},
	        {"(5.0000000000) can0 123#", 13},
	        {"(5.0 can0 123#", 5},
	        {"(5.0)can0 123#", 6},
	        {"(5.0) ", 7},
	        {"(5.0) can0", 11},
	        {"(5.0) can0 ", 12},
	        {"(5.0) can0 800#", 12},
	        {"(5.0) can0 12#", 12},
	        {"(5.0) can0 1234#", 12},
	        {"(5.0) can0 123", 12},
	        {"(5.0) can0 40000000#", 12},
	        {"(5.0) can0 80000001#", 12},
	        {"(5.0) can0 123456789#", 12},
	        {"(5.0) can0 123#1", 16},
	        {"(5.0) can0 123#11223", 20},
	        {"(5.0) can0 123#1G", 16},
	        {"(5.0) can0 123#112233445566778899", 34},
	        {"(5.0) can0 123#R9", 18},
	        {"(5.0) can0 123#R11", 18},
	        {"(5.0) can0 123##", 17},
	        {"(5.0) can0 123##8", 18},
	        {"(5.0) can0 123##1112233445566778899", 36},
	        {"(5.0) can0 123###", 17},
	        {"(5.0) can0 20000001##1", 23},
	        {"(5.0) can0 20000001#R", 22},
	        {"(5.0) can0 123#11 X", 19},
	        {"(5.0) can0 123#11R", 18},
	        {"(5.0) can0 123#11\n\n", 19},
	};

	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		struct frame frame = {.id = 77}, before = frame;
		unsigned column = 0;
		int result = candump_parse(cases[i].line, strlen(cases[i].line), &frame, &column);

		if (result != DT_E_FORMAT || column != cases[i].column)
			fail_msg("%s: %d at column %u, expected column %u", cases[i].line, result, column,
			         cases[i].column);
		assert_memory_equal(&frame, &before, sizeof(frame));
	}
}

static void test_fd_lengths(void **state)
{
	(void)state;
	for (unsigned length = 0; length <= 66; length++) {
		char line[256] = "(5.0) can0 123##1";
		size_t end = strlen(line);
		struct frame frame;
		unsigned column;
		bool known = memchr(fd_lengths, (int)length, sizeof(fd_lengths)) != NULL;

		memset(line + end, '5', (size_t)2 * length);
		assert_int_equal(candump_parse(line, end + (size_t)2 * length, &frame, &column),
		                 known ? 1 : DT_E_FORMAT);
		if (known)
			assert_int_equal(frame.length, length);
	}
}

static struct frame random_frame(void)
{
	static const uint8_t kinds[] = {0, FRAME_REMOTE, FRAME_ERROR, FRAME_FD};
	struct frame frame = {.flags = kinds[draw(4)]};

	frame.time_us = (int64_t)((uint64_t)draw(1u << 30) << 29 | draw(1u << 29)) + 1;
	if ((frame.flags & FRAME_ERROR) == 0 && draw(2) != 0)
		frame.flags |= FRAME_EXTENDED;
	if ((frame.flags & FRAME_FD) != 0) {
		frame.flags = (uint8_t)(frame.flags | (draw(2) != 0 ? FRAME_BRS : 0) |
		                        (draw(2) != 0 ? FRAME_ESI : 0));
		frame.length = fd_lengths[draw(16)];
	} else {
		frame.length = (uint8_t)draw(9);
	}
	frame.id = draw((frame.flags & (FRAME_EXTENDED | FRAME_ERROR)) != 0 ? 1u << 29 : 1u << 11);
	for (unsigned i = 0; i < frame.length && (frame.flags & FRAME_REMOTE) == 0; i++)
		frame.data[i] = (uint8_t)draw(256);
	return frame;
}

static void test_round_trip(void **state)
{
	(void)state;
	print_message("seed %u\n", seed);
	for (unsigned i = 0; i < 50000; i++) {
		struct frame frame = random_frame(), back;
		char line[CANDUMP_LINE_MAX];
		size_t length = candump_format(line, &frame, "can0");
		unsigned column;

		assert_int_equal(length, strlen(line));
		assert_int_equal(candump_parse(line, length, &back, &column), 1);
		check_equal(&back, &frame);
	}
}

static void test_longest_line_fits(void **state)
{
	struct frame frame = {
	        INT64_MAX, 0x1FFFFFFF, FRAME_FD | FRAME_EXTENDED | FRAME_BRS | FRAME_ESI, 64, {0}};
	char line[CANDUMP_LINE_MAX], name[200];

	(void)state;
	memset(name, 'x', sizeof(name) - 1);
	name[sizeof(name) - 1] = '\0';
	assert_in_range(candump_format(line, &frame, name), 200, CANDUMP_LINE_MAX - 1);
}

#define HEX "[0-9A-Fa-f]"
#define PAIR "(" HEX HEX ")"

/* The same language said another way. */
static const char grammar[] =
        "^\\([0-9]{1,12}(\\.[0-9]{0,9})?\\)[ \t]+[^\x01-\x20\x7f]+[ \t]+"
        "((([0-7]" HEX HEX "|[01]" HEX "{7})#(" PAIR "{0,8}|R[0-8]?|#[0-7](" PAIR "{0,8}|" PAIR "{12}|" PAIR
        "{16}|" PAIR "{20}|" PAIR "{24}|" PAIR "{32}|" PAIR "{48}|" PAIR "{64})))|[23]" HEX "{7}#" PAIR
        "{0,8})([ \t]+([RT][ \t]*)?)?\r?\n?$";

static size_t mutate(char *line, size_t length)
{
	static const char alphabet[] = "0123456789ABCDEFabcdefR#(). \t\n\rTg\x7f\xff\x01";
	size_t at = draw((uint32_t)length);

	switch (draw(4)) {
	case 0:
		line[at] = alphabet[draw(sizeof(alphabet) - 1)];
		return length;
	case 1:
		memmove(line + at, line + at + 1, length - at - 1);
		return length - 1;
	case 2:
		memmove(line + at + 1, line + at, length - at);
		line[at] = alphabet[draw(sizeof(alphabet) - 1)];
		return length + 1;
	default:
		return at + 1;
	}
}

/* Accepts exactly what the grammar accepts, and what it accepts is written back to the same frame. */
static void check_against_grammar(const regex_t *regex, const char *text, size_t length)
{
	/* a copy of its own, so that reading past the end is found */
	char *line = malloc(length + 1);
	struct frame frame, back;
	char formatted[CANDUMP_LINE_MAX];
	unsigned column = 0;
	int result;
	bool expected;

	memcpy(line, text, length);
	line[length] = '\0';
	expected = regexec(regex, line, 0, NULL, 0) == 0;
	line = realloc(line, length > 0 ? length : 1);
	result = candump_parse(line, length, &frame, &column);
	if ((result == 1) != expected)
		fail_msg("\"%.*s\": %d, the grammar says %d", (int)length, line, result, expected);
	if (result == DT_E_FORMAT)
		assert_in_range(column, 1, length + 1);
	if (result == 1) {
		size_t n = candump_format(formatted, &frame, "can0");

		assert_int_equal(candump_parse(formatted, n, &back, &column), 1);
		check_equal(&back, &frame);
	}
	free(line);
}

static void test_mutations_against_grammar(void **state)
{
	regex_t regex;
	unsigned accepted = 0;

	(void)state;
	print_message("seed %u\n", seed);
	assert_int_equal(regcomp(&regex, grammar, REG_EXTENDED | REG_NOSUB), 0);
	for (unsigned i = 0; i < 20000; i++) {
		struct frame frame = random_frame();
		char line[CANDUMP_LINE_MAX + 8];
		size_t length;

		if (frame.length > 12 && draw(8) != 0)
			continue;
		length = candump_format(line, &frame, "can0");
		for (uint32_t n = draw(4); n > 0 && length > 0; n--)
			length = mutate(line, length);
		check_against_grammar(&regex, line, length);
		accepted++;
	}
	assert_in_range(accepted, 5000, 20000);
	regfree(&regex);
}

/* A frame of 64 bytes with any byte in the place of any digit: a digit counts, all others end the data before
 * it. */
static void test_every_byte_in_every_place(void **state)
{
	static const char head[] = "(1.000000) can0 123##1";
	enum { FROM = sizeof(head) - 1 };
	char line[FROM + 128];

	(void)state;
	memcpy(line, head, FROM);
	for (size_t at = 0; at < 128; at++)
		for (int byte = 0; byte < 256; byte++) {
			static const char digits[] = "0123456789abcdef";
			const char *digit =
			        byte != '\0' ? strchr(digits, byte >= 'A' && byte <= 'F' ? byte + 32 : byte)
			                     : NULL;
			struct frame frame;
			unsigned column = 0;

			memset(line + FROM, '5', 128);
			line[FROM + at] = (char)byte;
			if (digit == NULL) {
				assert_int_not_equal(candump_parse(line, sizeof(line), &frame, &column), 1);
				continue;
			}
			assert_int_equal(candump_parse(line, sizeof(line), &frame, &column), 1);
			assert_int_equal(frame.length, 64);
			for (size_t k = 0; k < 64; k++)
				assert_int_equal(frame.data[k], k != at / 2 ? 0x55
				                                : at % 2    ? 0x50 | (digit - digits)
				                                            : (digit - digits) << 4 | 5);
		}
}

static void test_noise(void **state)
{
	(void)state;
	print_message("seed %u\n", seed);
	for (unsigned i = 0; i < 100000; i++) {
		size_t length = draw(80);
		char *line = malloc(length + 1);
		struct frame frame;
		unsigned column;

		for (size_t k = 0; k < length; k++)
			line[k] = (char)draw(256);
		if (length > 0 && draw(2) != 0)
			line[0] = '(';
		assert_int_not_equal(candump_parse(line, length, &frame, &column), 1);
		free(line);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_vectors_both_ways),
	        cmocka_unit_test(test_dialects),
	        cmocka_unit_test(test_skipped),
	        cmocka_unit_test(test_refused_with_column),
	        cmocka_unit_test(test_fd_lengths),
	        cmocka_unit_test(test_every_byte_in_every_place),
	        cmocka_unit_test(test_round_trip),
	        cmocka_unit_test(test_longest_line_fits),
	        cmocka_unit_test(test_mutations_against_grammar),
	        cmocka_unit_test(test_noise),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
