/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The front of .ini files: entries in their order with their lines, one line of complaint, and nothing read
 * after it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/scenes/settings.h"
#include "tests/unit/scratch.h"

struct reader {
	struct settings settings;
	char seen[400];
	int entries;
};

static char message[SETTINGS_MESSAGE_MAX];

static int entry(struct settings *settings, const char *section, const char *name, const char *value)
{
	struct reader *reader = (struct reader *)settings;
	size_t used = strlen(reader->seen);

	reader->entries++;
	snprintf(reader->seen + used, sizeof(reader->seen) - used, "%d[%s]%s=%s;", settings->line, section,
	         name, value);
	if (strcmp(name, "bad") == 0)
		return settings_fail(settings, DT_E_RANGE, "%s is %d too much", value, 7);
	return 1;
}

static int read_text(struct reader *reader, const char *text)
{
	static char file[64];
	FILE *out;
	int result;

	out = fdopen(mkstemp(scratch_name(file, "settings")), "w");
	assert_non_null(out);
	fputs(text, out);
	fclose(out);
	message[0] = '\0';
	*reader = (struct reader){.settings = {.file = file, .message = message, .entry = entry}};
	result = settings_read(&reader->settings);
	unlink(file);
	return result;
}

static void entries_come_with_their_lines(void **state)
{
	struct reader reader;

	(void)state;
	assert_int_equal(
	        read_text(&reader, "; nothing\na = 1\n[s]\n\nb = two words ; and a remark\nc=\n[t]\nb = 3"),
	        0);
	assert_string_equal(reader.seen, "2[]a=1;5[s]b=two words;6[s]c=;8[t]b=3;");
	assert_string_equal(message, "");
	assert_int_equal(read_text(&reader, ""), 0);
	assert_int_equal(reader.entries, 0);
}

static void the_first_mistake_ends_it(void **state)
{
	struct reader reader;
	char expected[100];

	(void)state;
	assert_int_equal(read_text(&reader, "a = 1\n\nbad = 2\nbad = 3\nno equals\n"), DT_E_RANGE);
	assert_int_equal(reader.entries, 2);
	snprintf(expected, sizeof(expected), "%s:3: 2 is 7 too much", reader.settings.file);
	assert_string_equal(message, expected);
	assert_int_equal(read_text(&reader, "a = 1\nno equals\nbad = 1\n"),
	                 DT_E_RANGE); /* said by its reader */
	assert_int_equal(read_text(&reader, "a = 1\nno equals\n"), DT_E_FORMAT);
	assert_non_null(strstr(message, ":2: not a [section] or key = value"));
	assert_int_equal(read_text(&reader, "[open\n"), DT_E_FORMAT);
	assert_non_null(strstr(message, ":1: not a [section]"));
}

static void what_cannot_be_opened_is_said(void **state)
{
	struct reader reader = {.settings = {.file = "/nowhere/at/all", .message = message, .entry = entry}};

	(void)state;
	assert_int_equal(settings_read(&reader.settings), DT_E_SYSTEM);
	assert_string_equal(message, "/nowhere/at/all: No such file or directory");
	assert_int_equal(settings_refuse(&reader.settings, DT_E_FORMAT, "%s is missing", "x"), DT_E_FORMAT);
	assert_string_equal(message, "/nowhere/at/all: x is missing");
}

/* inih would take the rest for a line of its own. */
static void a_long_line_is_refused(void **state)
{
	struct reader reader;
	char text[1000];

	(void)state;
	snprintf(text, sizeof(text), "a = 1\nb = %0500d\nc = 3\n", 0);
	assert_int_equal(read_text(&reader, text), DT_E_FORMAT);
	assert_non_null(strstr(message, ":2: a line longer than "));
	assert_int_equal(reader.entries, 1);
}

static void numbers_are_whole_texts(void **state)
{
	static const char *const wrong[] = {"", "x", "1x", "nan", "3.01", "0.99", "1 2", "inf"};
	double number = 7;

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_false(number_read(wrong[i], 1, 3, &number));
		assert_true(number == 7);
	}
	assert_true(number_read("1", 1, 3, &number) && number == 1);
	assert_true(number_read("3e0", 1, 3, &number) && number == 3);
	assert_true(number_read("inf", 1, INFINITY, &number) && isinf(number));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(entries_come_with_their_lines), cmocka_unit_test(the_first_mistake_ends_it),
	        cmocka_unit_test(what_cannot_be_opened_is_said), cmocka_unit_test(a_long_line_is_refused),
	        cmocka_unit_test(numbers_are_whole_texts),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
