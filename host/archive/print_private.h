/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PRINT_PRIVATE_H
#define DT_HOST_ARCHIVE_PRINT_PRIVATE_H
/*
 * What the printers share.
 */
#include "host/archive/print.h"

/* What is being printed, as the context of the archive_each_* calls. */
struct print {
	struct table table;
	struct archive *archive;
	bool undecided, with_events, has_series;
	bool marked;               /* a value has a star */
	unsigned faulty;           /* drops whose files are altered or missing */
	bool faulty_accepted;      /* one of them was accepted */
	struct archive_cell total; /* of the drops that count */
};

/* The filter of a list: one more than its limit is asked for, so that more can be told. */
struct archive_filter print_begin(struct print *p, const struct archive_filter *filter);

/* The table of the means' expanded uncertainties, and what they are of; nothing without one. */
void print_uncertainties(const struct archive_cell *cell, FILE *out);

/* Says in a line of text that there are more. */
void print_more(const struct print *p);

/* result, or what became of the table and of its stream. */
int print_done(int result, const struct table *table);

/* Of a series; its last, the text of the scene, is not in a list. */
enum { PRINT_SERIES_COLUMNS = 15 };
extern const struct table_column print_series_columns[PRINT_SERIES_COLUMNS];

/* Mean, SD, counts and uncertainty of a value; name: its group. */
#define PRINT_MEAN(type, member, name, unit)                                                                 \
	TABLE_COLUMN(NUMBER, type, member.mean, .key = "mean_" unit, .group = (name)),                       \
	        TABLE_COLUMN(NUMBER, type, member.sd, .key = "sd_" unit, .group = (name)),                   \
	        TABLE_COLUMN(WHOLE, type, member.n, .key = "n", .group = (name)),                            \
	        TABLE_COLUMN(WHOLE, type, member.not_ok, .key = "not_ok", .csv = "", .group = (name)),       \
	        TABLE_COLUMN(NUMBER, type, member.whole.expanded, .key = "expanded_" unit, .group = (name)), \
	        TABLE_COLUMN(NUMBER, type, member.whole.k, .key = "k", .group = (name)),                     \
	        TABLE_COLUMN(CHARS, type, member.whole.largest, .key = "largest", .csv = "",                 \
	                     .group = (name))

/* Text columns of the values that have a head in quantity.def, an array of all of them at offset in the row;
 * TABLE_VALUE or TABLE_NUMBER. Returns how many. */
size_t print_narrow(struct table_column column[ARCHIVE_VALUE_COUNT], enum table_kind kind, size_t offset);

#endif
