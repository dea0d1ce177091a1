/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_SNIFF_H
#define DT_HOST_RECORD_SNIFF_H
/*
 * What delimited text says of itself, so that nobody need name its columns: separator and decimal sign from
 * rows of its middle, names and units from the lines above, the time column or the rate, lines behind the
 * last row.
 *
 * A channel is a column whose unit is an acceleration; all other columns are left out, and told. What could
 * be read in two ways is refused with both, and with the --columns that settles it. One thing is assumed, and
 * flagged: the unit of a time column that names none, where only one gives a shock a velocity change that a
 * shock can have (SNIFF_ASSUMED; who reads the rows finds out).
 *
 * Lines are borrowed from the source.
 */
#include "host/record/cells.h"
#include "host/record/columns.h"
#include "host/record/source.h"

enum { SNIFF_SEPARATORS = 5 };

struct sniff {
	struct cells_style style;
	struct columns columns;
	struct piece name[COLUMNS_MAX]; /* as the file has it; length 0: none */
	struct piece names_line;
	size_t header_lines, footer_lines;
	size_t first, end;   /* bytes: where the first row begins, the last row ends */
	bool time_unit_open; /* the time column names none: columns says s */
	bool twins;          /* two channels of one name in the file */
	double told_rate_hz; /* beside a time column; 0 if not told */
	uint64_t rate_line;
};

/* 0, or DT_E_FORMAT or DT_E_ARGUMENT with a message. */
DT_MUST_USE int sniff_text(struct sniff *sniff, const struct source *source, char message[READ_MESSAGE_MAX]);

/* The separator of rows of so many columns; 0 where they do not tell one. */
char sniff_separator(const struct source *source, size_t columns);

/* Columns from names and units alone, of a table that is no text: time and channels found as in text. units
 * may be NULL, so may a unit's text. has_rate: the table tells its rate, so that a time column is not looked
 * for. */
DT_MUST_USE int sniff_names(struct sniff *sniff, size_t count, const struct piece *units, bool has_rate,
                            const char *file, char message[READ_MESSAGE_MAX]);

/* Names of a time column, of an acceleration. */
bool sniff_is_time(struct piece name);
bool sniff_is_acceleration(struct piece name);

/* What stands for a rate, an interval or a factor of the numbers, in a line above the rows or as the name of
 * a number beside them: "Sample rate (Hz)", "dt_ms". *length: how much of it says so. */
enum sniff_key { SNIFF_NO_KEY, SNIFF_RATE, SNIFF_STEP };
enum sniff_key sniff_key(struct piece text, size_t *length);
bool sniff_is_scale(struct piece key);

/* "tab, decimal comma, 2 header lines; time:ms, Accel:g; left out SG1 SG2; ..." */
void sniff_tell(const struct sniff *sniff, const char *encoding, char *text, size_t size);

#endif
