/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_CELLS_H
#define DT_HOST_RECORD_CELLS_H
/*
 * A line of delimited text as cells. Separators are runs of blanks and tabs, single commas,
 * semicolons and bars, in any mix; bars at both edges of a line are its frame; a comma between two digits is
 * a decimal one where a semicolon or tab separates and no point is there. A style that names its separator
 * and decimal sign knows better.
 *
 * Cells are borrowed from the line. Any context, no state.
 */
#include <stdbool.h>
#include <stddef.h>

enum {
	CELLS_MAX = 257, /* one more than there may be columns shows that a row is too long */
};

/* A stretch of a text. */
struct piece {
	const char *text;
	size_t length;
};

/* Whether the word is anywhere in it, in capitals or not. */
bool piece_has(struct piece piece, const char *word);

/* Whether it says anything: a line of signs alone is drawn. */
bool piece_has_letter(struct piece piece);

struct cells_style {
	char separator; /* 0 = any; ' ' = runs of blanks and tabs */
	char decimal;   /* 0 = as the line looks */
};

struct cells {
	struct piece cell[CELLS_MAX];
	size_t count; /* also of those that found no room */
	char decimal;
};

/* What looks like a number and is none. */
enum cells_oddity {
	CELLS_PLAIN,
	CELLS_THOUSANDS, /* "1,234.5", "1'234" */
	CELLS_UNIT,      /* "12.3 g" */
};

void cells_split(struct cells_style style, const char *text, size_t length, struct cells *cells);

/* False, and *value unchanged, unless all of cell i is one number. */
bool cells_number(const struct cells *cells, size_t i, double *value);

/* Of a cell that is no number. */
enum cells_oddity cells_oddity(const struct cells *cells, size_t i);

/* Whether a number with a decimal comma could as well have a thousands separator: "1,234". */
bool cells_could_be_thousands(struct piece cell);

/* The value of the last digit printed, in the number's own unit: 0.001 for "12.345", 10 for "1.2e2"; *digits
 * is the count of digits behind leading zeros. */
double cells_last_digit(const struct cells *cells, size_t i, int *digits);

/* Digits behind the decimal sign, with the exponent's length: what a number loses first when its end is cut.
 */
size_t cells_tail(struct piece cell, char decimal);

/* Cells of a line of names, cut at the one separator that gives this many; false where none does. Of blanks,
 * a unit in brackets belongs to the name before it. */
bool cells_names(struct cells_style style, const char *text, size_t length, size_t count,
                 struct cells *cells);

#endif
