/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/option.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"

enum { TEXT_COLUMN_MAX = 24, LINE_CHARS = 100, ROW_OPTION = 256 };

/* ---- told ---- */

static int row_chars(const struct option_row *row)
{
	return 2 + 2 + (int)strlen(row->name) + (row->value != NULL ? 1 + (int)strlen(row->value) : 0);
}

/* Where the texts begin: behind the longest row, but for those that are longer than any column. */
static int text_column(const struct option_table *table)
{
	int column = 0;

	for (int i = 0; i < table->count; i++) {
		int wanted = row_chars(&table->rows[i]) + 2;

		if (wanted > column && wanted <= TEXT_COLUMN_MAX)
			column = wanted;
	}
	return column;
}

static void option_tell_row(const struct option_row *row, int column)
{
	const char *text = row->help;
	int at = printf("  --%s%s%s", row->name, row->value != NULL ? " " : "",
	                row->value != NULL ? row->value : "");

	at += printf("%*s", at < column - 1 ? column - at : 2, "");
	for (bool first = true; *text != '\0'; first = false) {
		int length = (int)strcspn(text, " ");

		if (!first && at + 1 + length > LINE_CHARS) {
			at = printf("\n%*s", column, "") - 1;
			first = true;
		}
		at += printf("%s%.*s", first ? "" : " ", length, text);
		text += length + (text[length] == ' ');
	}
	putchar('\n');
}

void option_help(const struct option_table *table)
{
	int column = text_column(table);

	fputs(table->head, stdout);
	for (int i = 0; i < table->count; i++)
		option_tell_row(&table->rows[i], column);
	if (table->tail != NULL)
		fputs(table->tail, stdout);
}

/* ---- wrong ---- */

int option_vwrong(const char *program, const char *command, const char *format, va_list arguments)
{
	const char *blank = command != NULL ? " " : "";

	fprintf(stderr, "%s: %s%s", program, command != NULL ? command : "", command != NULL ? ": " : "");
	vfprintf(stderr, format, arguments);
	fprintf(stderr, "; try '%s%s%s --help'\n", program, blank, command != NULL ? command : "");
	return OPTIONS_WRONG;
}

int option_wrong(const struct option_table *table, const char *format, ...)
{
	va_list arguments;
	int code;

	va_start(arguments, format);
	code = option_vwrong(table->program, table->command, format, arguments);
	va_end(arguments);
	return code;
}

enum { NEAR_CHARS = 32, NEAR_EDITS = 2 };

/* Letters that were left out, put in, or are others (Levenshtein). */
static size_t edits(const char *a, const char *b)
{
	size_t row[NEAR_CHARS + 1], length = strlen(b);

	if (length > NEAR_CHARS || strlen(a) > NEAR_CHARS)
		return NEAR_CHARS;
	for (size_t k = 0; k <= length; k++)
		row[k] = k;
	for (size_t i = 1; a[i - 1] != '\0'; i++) {
		size_t before = row[0];

		row[0] = i;
		for (size_t k = 1; k <= length; k++) {
			size_t other = before + (a[i - 1] != b[k - 1]),
			       less = row[k - 1] < row[k] ? row[k - 1] : row[k];

			before = row[k];
			row[k] = other < less + 1 ? other : less + 1;
		}
	}
	return row[length];
}

const char *option_nearest(const char *text, const char *const *names)
{
	const char *best = NULL;
	size_t least = NEAR_EDITS + 1;

	for (; *names != NULL; names++) {
		size_t apart = edits(text, *names);

		if (apart < least && apart < strlen(*names)) {
			least = apart;
			best = *names;
		}
	}
	return best;
}

/* What getopt_long(3) did not take, read as word. */
static int refuse_word(const struct option_table *table, const char *word)
{
	if (optopt == 0 || strncmp(word, "--", 2) != 0) {
		const char *names[OPTION_ROWS_MAX + 2] = {"help"}, *meant;
		char name[NEAR_CHARS + 2];

		for (int i = 0; i < table->count; i++)
			names[i + 1] = table->rows[i].name;
		snprintf(name, sizeof(name), "%.*s", (int)strcspn(word, "="), word);
		meant = strncmp(name, "--", 2) == 0 ? option_nearest(name + 2, names) : NULL;
		return meant != NULL ? option_wrong(table, "no option '%s', perhaps --%s", word, meant)
		                     : option_wrong(table, "no option '%s'", word);
	}
	if (strchr(word, '=') != NULL)
		return option_wrong(table, "option '%s' takes no value", word);
	return option_wrong(table, "option '%s' lacks its value", word);
}

int option_choose(const struct option_table *table, const char *name, const char *text,
                  const char *const *names, int count)
{
	char expected[400] = "";
	size_t length = 0;

	for (int i = 0; i < count; i++) {
		if (strcmp(text, names[i]) == 0)
			return i;
		if (length < sizeof(expected))
			length += (size_t)snprintf(expected + length, sizeof(expected) - length, "%s%s",
			                           i == 0           ? ""
			                           : i == count - 1 ? " or "
			                                            : ", ",
			                           names[i]);
	}
	option_wrong(table, "--%s is '%s', expected %s", name, text, expected);
	return -1;
}

/* ---- read ---- */

static int option_take_number(const struct option_table *table, const struct option_row *row,
                              const char *text, void *field)
{
	double value;

	if (!number_read(text, row->min, row->max, &value))
		return option_wrong(table, "--%s is '%s', expected a number from %g to %g", row->name, text,
		                    row->min, row->max);
	*(double *)field = row->kind == OPTION_IS_PERCENT ? value / 100 : value;
	return OPTIONS_READ;
}

static int option_take_whole(const struct option_table *table, const struct option_row *row, const char *text,
                             void *field)
{
	uint64_t max = row->max < (double)UINT64_MAX ? (uint64_t)row->max : UINT64_MAX, value;

	if (!number_whole(text, (uint64_t)row->min, max, &value))
		return option_wrong(table, "--%s is '%s', expected a whole number from %.15g to %.15g",
		                    row->name, text, row->min, row->max);
	if (row->kind == OPTION_IS_UNSIGNED)
		*(unsigned *)field = (unsigned)value;
	else
		*(uint64_t *)field = value;
	return OPTIONS_READ;
}

static int take_word(const struct option_table *table, const struct option_row *row, const char *text,
                     void *field)
{
	struct option_words *words = field;

	if (words->count >= (int)row->max)
		return option_wrong(table, "more than %d --%s", (int)row->max, row->name);
	words->word[words->count++] = text;
	words->word[words->count] = NULL;
	return OPTIONS_READ;
}

static int option_take_row(const struct option_table *table, const struct option_row *row, const char *text,
                           void *into)
{
	void *field = (char *)into + row->at;

	switch (row->kind) {
	case OPTION_IS_FLAG:
		*(bool *)field = true;
		return OPTIONS_READ;
	case OPTION_IS_TEXT:
		*(const char **)field = text;
		return OPTIONS_READ;
	case OPTION_IS_NUMBER:
	case OPTION_IS_PERCENT:
		return option_take_number(table, row, text, field);
	case OPTION_IS_UNSIGNED:
	case OPTION_IS_UINT64:
		return option_take_whole(table, row, text, field);
	case OPTION_IS_WORDS:
		return take_word(table, row, text, field);
	default:
		return row->take(table, row->name, text, field);
	}
}

/* As getopt(3) wants them. */
static void put_letters(const struct option_table *table, char *letters)
{
	for (int i = 0; table->letters != NULL && table->letters[i] != '\0'; i++) {
		if (table->letters[i] == ' ')
			continue;
		*letters++ = table->letters[i];
		if (table->rows[i].value != NULL)
			*letters++ = ':';
	}
	*letters = '\0';
}

static int option_of_letter(const struct option_table *table, int option)
{
	const char *letter =
	        table->letters != NULL && option < ROW_OPTION ? strchr(table->letters, option) : NULL;

	return letter != NULL ? ROW_OPTION + (int)(letter - table->letters) : option;
}

int option_read(const struct option_table *table, void *into, int argc, char **argv)
{
	struct option known[OPTION_ROWS_MAX + 2] = {{0}};
	char letters[2 * OPTION_ROWS_MAX + 2] = "h";
	int option, code = OPTIONS_READ;

	for (int i = 0; i < table->count && i < OPTION_ROWS_MAX; i++)
		known[i] = (struct option){table->rows[i].name,
		                           table->rows[i].value != NULL ? required_argument : no_argument,
		                           NULL, ROW_OPTION + i};
	known[table->count] = (struct option){"help", no_argument, NULL, 'h'};
	put_letters(table, letters + 1);
	opterr = 0;
	while (code == OPTIONS_READ && (option = getopt_long(argc, argv, letters, known, NULL)) != -1) {
		if (option == 'h') {
			option_help(table);
			return OPTIONS_TOLD;
		}
		option = option_of_letter(table, option);
		code = option < ROW_OPTION
		               ? refuse_word(table, argv[optind - 1])
		               : option_take_row(table, &table->rows[option - ROW_OPTION], optarg, into);
		if (code == OPTIONS_READ && table->note != NULL)
			table->note(into, &table->rows[option - ROW_OPTION], optarg);
	}
	if (code == OPTIONS_READ && !table->words && optind != argc)
		code = option_wrong(table, "'%s' is too much", argv[optind]);
	return code;
}
