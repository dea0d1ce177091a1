/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_SNIFF_PRIVATE_H
#define DT_HOST_RECORD_SNIFF_PRIVATE_H
/* What the parts of sniff.h share: rows, names, and the words above the rows. */
#include <string.h>
#include <strings.h>

#include "host/record/sniff.h"

enum { SNIFF_SAMPLED = 120, SNIFF_SHOWN = 60, SNIFF_HEADER_LINES_MOST = 1000 };

/* ---- sniff_rows.c: cells, separator and decimal sign ---- */

struct sniff_candidate {
	struct cells_style style;
	size_t columns, rows;
};

struct sniff_work {
	const struct source *source;
	struct source_line line[SNIFF_SAMPLED];
	size_t lines;
	struct cells cells, other;
	size_t counts[CELLS_MAX + 1];
	bool words[CELLS_MAX]; /* columns of words: a status, a name */
	char *message;
};

enum cell_kind { CELL_EMPTY, CELL_NUMBER, CELL_NO_NUMBER, CELL_CLOCK, CELL_DATE, CELL_TEXT };

enum cell_kind sniff_kind(const struct cells *cells, size_t i);

/* Numbers, but where the table has words. */
bool sniff_is_row(const struct sniff_work *work, const struct cells *cells);

/* A line of blanks, or a remark. */
bool sniff_is_idle(const struct source_line *line);

void sniff_split(struct cells_style style, const struct source_line *line, struct cells *cells);

/* Lines of the middle, where neither header nor footer is. */
void sniff_sample(struct sniff_work *work);

/* 0, or DT_E_FORMAT with a message: no table, or two readings. */
DT_MUST_USE int sniff_find_style(struct sniff_work *work, struct sniff_candidate *best);
const char *sniff_separator_name(char separator);

/* ---- sniff_names.c: names, units, the time column ---- */

struct sniff_times {
	bool can[COLUMNS_MAX];
	bool grows[COLUMNS_MAX]; /* and is not one number all through */
	const struct unit *unit[COLUMNS_MAX];
	size_t count, first, second;
};

/* A name without its unit. */
struct piece sniff_stem(struct piece name);

/* 0, or DT_E_FORMAT with a message. */
DT_MUST_USE int sniff_settle_names(struct sniff *sniff, const struct piece *units, struct sniff_times *times,
                                   bool has_rate, const char *file, char *message);

/* ---- sniff_keys.c: words above the rows ---- */

/* A rate or an interval of a line like "Sample rate: 51200 Hz" or "dt = 1e-5 s"; 0 where there is none, NAN
 * where it may be one of two. */
double sniff_rate(const struct source_line *line, struct cells_style style);

/* A line like "Scale factor: 2", of a number other than 1. */
bool sniff_tells_scale(const struct source_line *line, struct cells_style style);

/* ---- */

static inline bool sniff_begins(struct piece name, const char *word)
{
	size_t length = strlen(word);

	return name.length >= length && strncasecmp(name.text, word, length) == 0;
}

static inline bool sniff_is_letter(char c)
{
	return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

#endif
