/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One table of options: read, told and refused from the same rows.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/base/option.h"

struct given {
	bool flag;
	const char *text;
	double number, share;
	unsigned count;
	uint64_t seed;
	struct option_words words;
	int choice;
};

static int take_choice(const struct option_table *table, const char *name, const char *text, void *field)
{
	static const char *const names[] = {"one", "two", "three"};
	int chosen = option_choose(table, name, text, names, 3);

	*(int *)field = chosen;
	return chosen < 0 ? OPTIONS_WRONG : OPTIONS_READ;
}

static const struct option_row rows[] = {
        OPTION_FLAG("flag", struct given, flag, "sets it"),
        OPTION_TEXT("text", "WORD", struct given, text, "a word"),
        OPTION_NUMBER("number", "X", struct given, number, -1, 2.5, "a number"),
        OPTION_PERCENT("share", struct given, share, "a hundredth"),
        OPTION_UNSIGNED("count", "N", struct given, count, 1, 9, "so many"),
        OPTION_UINT64("seed", "N", struct given, seed, 0, 0x1p64, "any"),
        OPTION_WORDS("word", "WORD", struct given, words, 2, "may be repeated"),
        OPTION_TAKEN("choice", "NAME", struct given, choice, take_choice,
                     "a text that is so long that it has to be broken somewhere before it reaches the edge "
                     "of the paper on the right"),
};

static const struct option_table table = {
        .program = "program", .command = "verb", .head = "head\n", OPTION_ROWS(rows), .tail = "tail\n"};

/* Reads words (NULL-terminated); what goes to stdout or stderr comes to stand in said. */
static int read_words(struct given *given, char said[2000], const char *const *words)
{
	char *argv[16] = {(char *)(uintptr_t) "verb"};
	FILE *before[2] = {stdout, stderr}, *out = fmemopen(memset(said, 0, 2000), 1999, "w");
	int argc = 1, code;

	for (; words[argc - 1] != NULL; argc++)
		argv[argc] = (char *)(uintptr_t)words[argc - 1];
	optind = 0;
	stdout = stderr = out;
	code = option_read(&table, given, argc, argv);
	fflush(out);
	stdout = before[0];
	stderr = before[1];
	fclose(out);
	return code;
}

#define READ(given, said, ...) read_words(given, said, (const char *const[]){__VA_ARGS__, NULL})

static void every_kind_reaches_its_field(void **state)
{
	struct given given = {.share = 7};
	char said[2000];

	(void)state;
	assert_int_equal(READ(&given, said, "--flag", "--text=w", "--number", "-0.5", "--count", "9",
	                      "--seed", "18446744073709551615", "--word", "a", "--word=b", "--choice", "two"),
	                 OPTIONS_READ);
	assert_string_equal(said, "");
	assert_true(given.flag);
	assert_string_equal(given.text, "w");
	assert_true(given.number == -0.5);
	assert_true(given.share == 7); /* not given: stays */
	assert_int_equal(given.count, 9);
	assert_true(given.seed == UINT64_MAX);
	assert_int_equal(given.words.count, 2);
	assert_string_equal(given.words.word[1], "b");
	assert_null(given.words.word[2]);
	assert_int_equal(given.choice, 1);
	assert_int_equal(READ(&given, said, "--share", "12.5"), OPTIONS_READ);
	assert_true(given.share == 0.125);
}

static void what_is_wrong_is_said_and_what_was_expected(void **state)
{
	static const struct {
		const char *words[4], *said;
	} cases[] = {
	        {{"--nothing"}, "no option '--nothing'"},
	        {{"-x"}, "no option '-x'"},
	        {{"--nubmer=x"}, "no option '--nubmer=x', perhaps --number"},
	        {{"--text"}, "option '--text' lacks its value"},
	        {{"--flag=1"}, "option '--flag=1' takes no value"},
	        {{"word"}, "'word' is too much"},
	        {{"--number", "2.51"}, "--number is '2.51', expected a number from -1 to 2.5"},
	        {{"--number", "1 "}, "--number is '1 ', expected a number from -1 to 2.5"},
	        {{"--number", "nan"}, "--number is 'nan', expected a number from -1 to 2.5"},
	        {{"--number", ""}, "--number is '', expected a number from -1 to 2.5"},
	        {{"--share", "101"}, "--share is '101', expected a number from 1e-06 to 100"},
	        {{"--count", "0"}, "--count is '0', expected a whole number from 1 to 9"},
	        {{"--count", "10"}, "--count is '10', expected a whole number from 1 to 9"},
	        {{"--count", "2.5"}, "--count is '2.5', expected a whole number from 1 to 9"},
	        {{"--count", "-1"}, "--count is '-1', expected a whole number from 1 to 9"},
	        {{"--seed", "18446744073709551616"},
	         "--seed is '18446744073709551616', expected a whole number from 0 to 1.84467440737096e+19"},
	        {{"--word=a", "--word=b", "--word=c"}, "more than 2 --word"},
	        {{"--choice", "four"}, "--choice is 'four', expected one, two or three"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct given given = {0};
		char said[2000], expected[300];

		assert_int_equal(read_words(&given, said, cases[i].words), OPTIONS_WRONG);
		snprintf(expected, sizeof(expected), "program: verb: %s; try 'program verb --help'\n",
		         cases[i].said);
		assert_string_equal(said, expected);
	}
}

static void help_is_the_rows(void **state)
{
	struct given given = {0};
	char said[2000];

	(void)state;
	assert_int_equal(READ(&given, said, "--flag", "--help", "--nothing"), OPTIONS_TOLD);
	assert_string_equal(said, "head\n"
	                          "  --flag         sets it\n"
	                          "  --text WORD    a word\n"
	                          "  --number X     a number\n"
	                          "  --share PCT    a hundredth\n"
	                          "  --count N      so many\n"
	                          "  --seed N       any\n"
	                          "  --word WORD    may be repeated\n"
	                          "  --choice NAME  a text that is so long that it has to be broken "
	                          "somewhere before it reaches the\n"
	                          "                 edge of the paper on the right\n"
	                          "tail\n");
}

static void a_number_is_the_whole_text(void **state)
{
	double value = 3;
	uint64_t whole = 3;

	(void)state;
	assert_true(number_read("1e3", 0, 1e3, &value) && value == 1000);
	assert_false(number_read("inf", -1e308, 1e308, &value));
	assert_false(number_read("1e3x", 0, 1e9, &value));
	assert_true(value == 1000); /* untouched */
	assert_true(number_whole("007", 0, 7, &whole) && whole == 7);
	assert_false(number_whole("+7", 0, 7, &whole) || number_whole(" 7", 0, 7, &whole) ||
	             number_whole("", 0, 7, &whole) || number_whole("7a", 0, 7, &whole));
}

static void note(void *into, const struct option_row *row, const char *text)
{
	struct given *given = into;

	given->words.word[given->words.count++] = row->name;
	given->words.word[given->words.count++] = text != NULL ? text : "-";
}

static void test_letters_and_notes(void **state)
{
	struct option_table with = table;
	char *argv[] = {(char *)(uintptr_t) "verb",     (char *)(uintptr_t) "-n2", (char *)(uintptr_t) "-f",
	                (char *)(uintptr_t) "--coun=3", (char *)(uintptr_t) "-n",  (char *)(uintptr_t) "1.5"};
	static const char *const noted[] = {"number", "2", "flag", "-", "count", "3", "number", "1.5"};
	struct given given = {.flag = false};

	(void)state;
	with.letters = "f n";
	with.note = note;
	optind = 0;
	assert_int_equal(option_read(&with, &given, 6, argv), OPTIONS_READ);
	assert_true(given.flag);
	assert_true(fabs(given.number - 1.5) < 1e-12);
	assert_int_equal(given.words.count, 8);
	for (int i = 0; i < 8; i++)
		assert_string_equal(given.words.word[i], noted[i]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_letters_and_notes),
	        cmocka_unit_test(every_kind_reaches_its_field),
	        cmocka_unit_test(what_is_wrong_is_said_and_what_was_expected),
	        cmocka_unit_test(help_is_the_rows),
	        cmocka_unit_test(a_number_is_the_whole_text),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
