/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_TABLE_H
#define DT_HOST_BASE_TABLE_H
/*
 * A table for people (text, HTML), programs (JSON) and spreadsheets (CSV). Its columns are declared once;
 * each row is an object in memory that the columns point into. The head of the text comes with its first row,
 * so that a table without rows prints nothing; JSON is an array of objects.
 *
 *     table_begin, table_row for each object, table_end; errors of the stream are the caller's to see.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/base/put.h"

enum table_format { TABLE_TEXT, TABLE_JSON, TABLE_CSV, TABLE_HTML };

enum table_kind {
	TABLE_WORDS,  /* const char *; NULL: not known */
	TABLE_CHARS,  /* char[] */
	TABLE_NUMBER, /* double; NAN: not known */
	TABLE_VALUE,  /* struct table_value */
	TABLE_WHOLE,  /* unsigned */
	TABLE_LARGE,  /* int64_t */
	TABLE_YES,    /* bool */
	TABLE_KNOWN,  /* bool; false: not known */
	TABLE_ITEM,   /* cJSON *, given away with the row: of JSON alone; NULL: no key */
};

struct table_value {
	double value, sigma;
	bool marked; /* a star behind it, where people read it */
};

struct table_column {
	enum table_kind kind;
	size_t offset;     /* in the object */
	const char *key;   /* in JSON and CSV; NULL: in neither */
	const char *csv;   /* in CSV, where it differs there; "": not there */
	const char *group; /* JSON: the object that holds key, null when its numbers are all not known. CSV:
	                      in front of key */
	const char *sigma; /* of a TABLE_VALUE: key of its uncertainty */
	const char *title; /* in text and HTML; NULL: in neither */
	const char *unit;  /* behind the title; NULL: none */
	const char *gap;   /* in text, before the column; NULL: a blank */
	int width;         /* in text; negative: to the left */
	bool own;          /* words of the user's, in no language of ours */
	int digits;   /* behind the point; negative: significant ones. Of words: most characters, 0: all */
	double scale; /* of numbers in text and HTML; 0: 1 */
};

/* What the rows to come tell of the columns' values. */
enum table_of { TABLE_VALUES, TABLE_SDS /* a digit more */, TABLE_COUNTS /* no digits, no scale */ };

enum { TABLE_DIGITS_G = -6 }; /* digits of printf's %g */

/* The columns must last as long as the table. limit: rows, 0: any; more: another row was there. */
struct table {
	FILE *out;
	enum table_format format;
	const struct table_column *columns;
	size_t count, rows, limit;
	bool more;
	enum table_of of;
	bool bare;             /* text: no head */
	const char *row_class; /* HTML: attributes of the rows to come; NULL: none */
	int error;             /* DT_E_* of the first row that failed */
};

void table_begin(struct table *table, const struct table_column *columns, size_t count);

/* Whether a row more would be too many; then more is set. */
bool table_is_full(struct table *table);

/* Nothing when the table is full. */
void table_row(struct table *table, const void *object);

/* 0 or DT_E_MEMORY. */
int table_end(struct table *table);

/* One object as JSON, without a table around it: 0 or DT_E_MEMORY. */
int table_object(const struct table_column *columns, size_t count, const void *object, FILE *out);

/* A column of a member of a struct; more: its other fields, as .key = "height_m", .title = "height". */
#define TABLE_COLUMN(KIND, type, member, ...)                                       \
	{                                                                           \
		.kind = TABLE_##KIND, .offset = offsetof(type, member), __VA_ARGS__ \
	}

#define TABLE_COUNT(columns) (sizeof(columns) / sizeof((columns)[0]))

#endif
