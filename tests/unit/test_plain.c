/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What may stand in names and notes: every code point against the lists of the standards, and what is no
 * UTF-8.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <string.h>

#include "common/plain.h"

/* By the table of RFC 3629, section 3. */
static size_t encode(uint32_t code, char bytes[4])
{
	if (code < 0x80) {
		bytes[0] = (char)code;
		return 1;
	}
	if (code < 0x800) {
		bytes[0] = (char)(0xC0 | code >> 6);
		bytes[1] = (char)(0x80 | (code & 0x3F));
		return 2;
	}
	if (code < 0x10000) {
		bytes[0] = (char)(0xE0 | code >> 12);
		bytes[1] = (char)(0x80 | (code >> 6 & 0x3F));
		bytes[2] = (char)(0x80 | (code & 0x3F));
		return 3;
	}
	bytes[0] = (char)(0xF0 | code >> 18);
	bytes[1] = (char)(0x80 | (code >> 12 & 0x3F));
	bytes[2] = (char)(0x80 | (code >> 6 & 0x3F));
	bytes[3] = (char)(0x80 | (code & 0x3F));
	return 4;
}

static bool refused(uint32_t code)
{
	static const uint32_t singles[] = {0x7F, 0x2028, 0x2029, 0xFEFF};

	for (size_t i = 0; i < sizeof(singles) / sizeof(singles[0]); i++)
		if (code == singles[i])
			return true;
	return code <= 0x1F || (0x80 <= code && code <= 0x9F) || (0x202A <= code && code <= 0x202E) ||
	       (0x2066 <= code && code <= 0x2069);
}

static void test_every_code_point(void **state)
{
	(void)state;
	for (uint32_t code = 0; code < 0x120000; code++) {
		char text[6] = {'a'};
		size_t length = encode(code, text + 1);
		bool is = code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);

		text[length + 1] = 'z';
		assert_int_equal(plain_is_utf8(text, length + 2), is);
		assert_int_equal(plain_is_line(text, length + 2), is && !refused(code));
		assert_false(length > 1 && plain_is_utf8(text, length)); /* cut */
	}
}

static void test_what_is_no_utf8(void **state)
{
	static const char *const wrong[] = {"\x80",
	                                    "\xBF",
	                                    "a\xC0\x80",
	                                    "\xC1\xBF",
	                                    "\xE0\x80\x80",
	                                    "\xE0\x9F\xBF",
	                                    "\xF0\x80\x80\x80",
	                                    "\xF5\x80\x80\x80",
	                                    "\xFE",
	                                    "\xFF",
	                                    "\xC3(",
	                                    "\xE2\x82(",
	                                    "\xE9t"};

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_false(plain_is_utf8(wrong[i], strlen(wrong[i])));
		assert_false(plain_is_line(wrong[i], strlen(wrong[i])));
	}
	assert_true(plain_is_line("", 0));
	assert_true(plain_is_line("\xC3\xBC\xC3\x9F \xE6\x9D\xB1 \xF0\x9F\x93\xA6", 13));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_every_code_point),
	        cmocka_unit_test(test_what_is_no_utf8),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
