/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_DELIMITED_H
#define DT_HOST_RECORD_DELIMITED_H
/*
 * Of read_delimited alone: text with columns while it is read, and its rows.
 */
#include "host/record/columns.h"
#include "host/record/encoding.h"
#include "host/record/header.h"
#include "host/record/lvm.h"
#include "host/record/profile.h"
#include "host/record/row.h"
#include "host/record/sniff.h"

struct reading {
	const struct source *source;
	struct source rows_only; /* without a footer */
	struct source_line line;
	char *message;
	struct columns columns;
	struct record *record;

	const char *encoding;
	struct profile *profile; /* NULL: none */
	struct sniff *sniff;     /* NULL: the user names the columns */
	const char *assumed;     /* unit of time; NULL: it is told */
	int64_t clock_ns;        /* of the first row */

	bool is_lvm;
	struct lvm lvm;
	struct cells_style style;
	struct header header;

	double *time_s;
	uint64_t *row_line;
	size_t rows;
	size_t bad[COLUMNS_MAX];  /* by column */
	size_t used[COLUMNS_MAX]; /* rows up to the last that is not empty */
	struct cells row;
	struct row_shape shape;           /* of the first row, when it is a plain one */
	struct piece before[COLUMNS_MAX]; /* of each column, the last that was a number */
	char decimal_before[COLUMNS_MAX];

	/* of the time column, in its own unit: the finest place of all rows, most digits, the largest number
	 */
	double digit, largest;
	int digits;

	/* decimal commas: whether any can be nothing else, and the first line with one that could */
	bool comma_sure;
	uint64_t comma_doubt;
	bool unterminated;
};

#define REFUSE(reading, code, ...) \
	source_refuse((reading)->message, code, (reading)->source->file, (reading)->line.number, __VA_ARGS__)

/* Steps to the next line that is neither blank nor a comment, and splits it. */
bool delimited_next_row(struct reading *reading);

/* The row at hand and all behind it, into the channels and the times that are there. 0 or DT_E_FORMAT, with a
 * message. */
DT_MUST_USE int delimited_take_rows(struct reading *reading);

#endif
