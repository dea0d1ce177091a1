/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_ROW_H
#define DT_HOST_RECORD_ROW_H
/*
 * A line of delimited text that is nothing but numbers where numbers are wanted, read in one pass. What it
 * takes it takes as cells_split and cells_number do; every other line is theirs.
 *
 * Cells are borrowed from the text. Any context, no state.
 */
#include "common/base/number.h"
#include "host/record/cells.h"
#include "host/record/columns.h"

struct row_shape {
	size_t count; /* columns; 0: no line has this shape */
	char separator, decimal;
	bool tabs; /* a blank is any of a run of blanks and tabs */
	bool wanted[COLUMNS_MAX];
};

struct row {
	const char *end; /* the line's, its '\r' not in it */
	const char *next;
	struct piece cell[COLUMNS_MAX];
	struct number_scan number[COLUMNS_MAX];
};

/* That of a line that was split into cells by the style. */
void row_learn(struct row_shape *shape, struct cells_style style, const struct cells *cells,
               const struct columns *columns);

/* False where the line at `text` is of another shape, has an unusual number, or no end before `end`. */
bool row_read(const struct row_shape *shape, const char *text, const char *end, struct row *row);

#endif
