/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_OPTION_H
#define DT_COMMON_BASE_OPTION_H
/*
 * The options of a program or a subcommand, a row each: its name, what it takes, where that goes, and what
 * --help says of it. They are read and told from the same rows, and the manual's page and the completion are
 * made from --help.
 *
 *     static const struct option_row rows[] = {
 *             OPTION_FLAG("json", struct arguments, json, "one JSON object on standard output"),
 *             OPTION_NUMBER("q", "Q", struct arguments, q, 0.5, 1e6, "quality factor (10)"),
 *     };
 *     static const struct option_table options = {.program = "droptower", .command = "srs", .head = "usage:
 * ...", OPTION_ROWS(rows)};
 *
 * A field keeps what it was set to when its option is not given.
 */
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { OPTIONS_READ = -1, OPTIONS_TOLD = 0, OPTIONS_WRONG = 2 };
enum { OPTION_WORDS_ROOM = 72, OPTION_ROWS_MAX = 40 };

/* An option that may be repeated: its words, NULL behind the last one. */
struct option_words {
	const char *word[OPTION_WORDS_ROOM + 1];
	int count;
};

enum option_kind {
	OPTION_IS_FLAG,
	OPTION_IS_TEXT,
	OPTION_IS_NUMBER,
	OPTION_IS_PERCENT, /* the field is a share: a hundredth of the number */
	OPTION_IS_UNSIGNED,
	OPTION_IS_UINT64,
	OPTION_IS_WORDS,
	OPTION_IS_TAKEN,
};

struct option_table;

/* Puts text into a field of what is read. OPTIONS_READ, or what option_wrong returns. */
typedef int option_take(const struct option_table *table, const char *name, const char *text, void *field);

struct option_row {
	const char *name, *value; /* value: what --help calls it; NULL: the option takes none */
	enum option_kind kind;
	size_t at;       /* of the field */
	double min, max; /* of a number; of words max: how many */
	option_take *take;
	const char *help; /* --help breaks its lines */
};

/* Told of each row that was read, with its text (NULL of a flag). */
typedef void option_note(void *into, const struct option_row *row, const char *text);

struct option_table {
	const char *program, *command; /* command: NULL in a program without any */
	const char *head;              /* usage and what it does, up to the rows */
	const struct option_row *rows;
	int count;
	bool words;          /* it takes words beside options */
	const char *tail;    /* behind the rows, or NULL */
	option_note *note;   /* or NULL */
	const char *letters; /* of the first rows, a blank for none: -j beside --jobs; or NULL */
};

/* A field's place; another type than the one named does not compile. */
#define OPTION_AT(in, field, type) (offsetof(in, field) + 0 * sizeof(1 ? &((in *)0)->field : (type *)0))

#define OPTION_FLAG(name, in, field, help)                                               \
	{                                                                                \
		name, NULL, OPTION_IS_FLAG, OPTION_AT(in, field, bool), 0, 0, NULL, help \
	}
#define OPTION_TEXT(name, value, in, field, help)                                                 \
	{                                                                                         \
		name, value, OPTION_IS_TEXT, OPTION_AT(in, field, const char *), 0, 0, NULL, help \
	}
#define OPTION_NUMBER(name, value, in, field, min, max, help)                                     \
	{                                                                                         \
		name, value, OPTION_IS_NUMBER, OPTION_AT(in, field, double), min, max, NULL, help \
	}
#define OPTION_PERCENT(name, in, field, help)                                                       \
	{                                                                                           \
		name, "PCT", OPTION_IS_PERCENT, OPTION_AT(in, field, double), 1e-6, 100, NULL, help \
	}
#define OPTION_UNSIGNED(name, value, in, field, min, max, help)                                       \
	{                                                                                             \
		name, value, OPTION_IS_UNSIGNED, OPTION_AT(in, field, unsigned), min, max, NULL, help \
	}
#define OPTION_UINT64(name, value, in, field, min, max, help)                                       \
	{                                                                                           \
		name, value, OPTION_IS_UINT64, OPTION_AT(in, field, uint64_t), min, max, NULL, help \
	}
#define OPTION_WORDS(name, value, in, field, most, help)                                                     \
	{                                                                                                    \
		name, value, OPTION_IS_WORDS, OPTION_AT(in, field, struct option_words), 0, most, NULL, help \
	}
/* take gets a pointer to the field, or, with OPTION_TAKEN_BY, to all of what is read. */
#define OPTION_TAKEN(name, value, in, field, take, help)                            \
	{                                                                           \
		name, value, OPTION_IS_TAKEN, offsetof(in, field), 0, 0, take, help \
	}
#define OPTION_TAKEN_BY(name, value, take, help)                  \
	{                                                         \
		name, value, OPTION_IS_TAKEN, 0, 0, 0, take, help \
	}
#define OPTION_ROWS(array)                            \
	.rows = (array),                              \
	.count = sizeof(array) / sizeof((array)[0]) + \
	         0 * sizeof(char[sizeof(array) / sizeof((array)[0]) <= OPTION_ROWS_MAX ? 1 : -1])

/* Reads the options of argv into what `into` points to; optind is then the first word, which getopt(3) has
 * put behind them. OPTIONS_READ, or what the program ends with: OPTIONS_TOLD after --help, or OPTIONS_WRONG,
 * why it is wrong was printed. */
int option_read(const struct option_table *table, void *into, int argc, char **argv);

/* --help */
void option_help(const struct option_table *table);

/* Wrong usage: one line to stderr that ends with how to get help. OPTIONS_WRONG. */
int option_wrong(const struct option_table *table, const char *format, ...)
        __attribute__((format(printf, 2, 3)));
int option_vwrong(const char *program, const char *command, const char *format, va_list arguments)
        __attribute__((format(printf, 3, 0)));

/* The name that was perhaps meant; NULL when none is near. names ends with NULL. */
const char *option_nearest(const char *text, const char *const *names);

/* One of so many names: its number, or -1 after saying what was expected. */
int option_choose(const struct option_table *table, const char *name, const char *text,
                  const char *const *names, int count);

#endif
