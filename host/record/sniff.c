/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/sniff_private.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "host/record/clock.h"

enum { FOOTER_LINES_MOST = 100 };

/* ---- above and below the rows ---- */

static bool is_of_ours(const struct source *source)
{
	static const char *const marks[] = {"droptower csv", "droptower_csv",
	                                    "channel rate_hz=", "***End_of_Header***"};
	size_t length = source->size < 8192 ? source->size : 8192;
	const char *tail = source->bytes + (source->size > 160 ? source->size - 160 : 0);

	for (size_t i = 0; i < sizeof(marks) / sizeof(marks[0]); i++)
		if (memmem(source->bytes, length, marks[i], strlen(marks[i])) != NULL)
			return true;
	return memmem(tail, (size_t)(source->bytes + source->size - tail), "# sha256 ", 9) != NULL;
}

/* Lines with words behind the last row are a footer; others are rows that something is wrong with, and so is
 * one that begins with a number and has no end: "0.1,1.5e". */
static void find_footer(struct sniff_work *work, struct sniff *sniff)
{
	const char *bytes = work->source->bytes;
	size_t end = work->source->size;

	sniff->end = end;
	while (end > sniff->first && sniff->footer_lines < FOOTER_LINES_MOST) {
		size_t stop = end - (bytes[end - 1] == '\n');
		const char *before = stop > 0 ? memrchr(bytes, '\n', stop) : NULL;
		struct source_line line = {.text = before ? before + 1 : bytes};

		line.length = (size_t)(bytes + stop - line.text);
		while (line.length > 0 && line.text[line.length - 1] == '\r')
			line.length--;
		end = (size_t)(line.text - bytes);
		if (sniff_is_idle(&line))
			continue;
		sniff_split(sniff->style, &line, &work->cells);
		if (sniff_is_row(work, &work->cells) ||
		    !piece_has_letter((struct piece){line.text, line.length}) ||
		    (sniff->footer_lines == 0 && bytes[work->source->size - 1] != '\n' &&
		     sniff_kind(&work->cells, 0) == CELL_NUMBER))
			return;
		sniff->footer_lines++;
		sniff->end = end;
	}
}

struct head {
	struct cells names, units;
	struct piece names_line;
};

/* A line that tells units: half of the cells or more a unit, and none a text. "Clock" is a name. */
static bool tells_units(const struct cells *cells)
{
	size_t known = 0;

	for (size_t i = 0; i < cells->count && i < CELLS_MAX; i++) {
		struct piece cell = cells->cell[i];

		known += cell.length > 0 && unit_find(cell.text, cell.length) != NULL &&
		         !piece_has(cell, "clock");
		if (cell.length > 12)
			return false;
	}
	return known > 0 && 2 * known >= cells->count;
}

static void take_head(struct sniff_work *work, struct head *head, size_t columns, struct source_line line)
{
	const char *all = line.text;
	size_t length = line.length;
	struct cells *cells = &work->other;
	bool fits;

	if (!piece_has_letter((struct piece){line.text, line.length})) /* "|---|---|" */
		return;
	while (line.length > 0 && strchr("#% ", line.text[0])) {
		line.text++;
		line.length--;
	}
	fits = cells_names((struct cells_style){0}, line.text, line.length, columns, cells);
	if (!fits && columns > 1 &&
	    cells_names((struct cells_style){0}, line.text, line.length, columns - 1, cells) &&
	    line.length > 0) {
		cells->cell[columns - 1] = (struct piece){line.text, 0};
		cells->count = columns;
		fits = true;
	}
	if (!fits)
		return;
	if (tells_units(cells)) {
		head->units = *cells;
		return;
	}
	for (size_t i = 0; i < cells->count; i++)
		if (sniff_kind(cells, i) == CELL_TEXT) {
			head->names = *cells;
			head->names_line = (struct piece){all, length};
			head->units.count = 0;
			return;
		}
}

/* Whether a line that tells a rate says that not every sample was kept. */
static bool is_thinned(struct piece line)
{
	return piece_has(line, "every") || piece_has(line, "decimat") || piece_has(line, "averag") ||
	       piece_has(line, "downsampl");
}

/* Steps over the lines above the first row. */
static int read_head(struct sniff_work *work, struct sniff *sniff, size_t columns, struct head *head)
{
	struct source_line line = {0};

	for (size_t at = 0; source_next_line(work->source, &line); at = line.next) {
		double rate_hz = sniff_rate(&line, sniff->style);

		if (isnan(rate_hz))
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "\"%.*s\": a rate with a comma or point for thousands or for a "
			                     "decimal sign, expected --columns with name:unit@RATE_HZ",
			                     (int)(line.length < 60 ? line.length : 60), line.text);
		if (rate_hz > 0 && is_thinned((struct piece){line.text, line.length}))
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "\"%.*s\": the rate may be that of the rows or not, expected "
			                     "--columns with name:unit@RATE_HZ",
			                     (int)(line.length < 60 ? line.length : 60), line.text);
		if (sniff_tells_scale(&line, sniff->style))
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "\"%.*s\" may be in the numbers or not, expected --columns that "
			                     "says so, e.g. name:g or name:g*FACTOR",
			                     (int)(line.length < 60 ? line.length : 60), line.text);
		if (rate_hz > 0 && sniff->told_rate_hz > 0 && fabs(rate_hz / sniff->told_rate_hz - 1) > 1e-3)
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "rate %.9g Hz here and %.9g Hz in line %llu, expected one",
			                     rate_hz, sniff->told_rate_hz,
			                     (unsigned long long)sniff->rate_line);
		if (rate_hz > 0) {
			sniff->told_rate_hz = rate_hz;
			sniff->rate_line = line.number;
		}
		sniff_split(sniff->style, &line, &work->cells);
		if (!sniff_is_idle(&line) && work->cells.count == columns &&
		    sniff_is_row(work, &work->cells)) {
			sniff->first = at;
			sniff->header_lines = (size_t)line.number - 1;
			return 0;
		}
		if (line.number > SNIFF_HEADER_LINES_MOST)
			break;
		take_head(work, head, columns, line);
	}
	return source_refuse(work->message, DT_E_FORMAT, work->source->file, 0,
	                     "more than %d lines above the first row of numbers", SNIFF_HEADER_LINES_MOST);
}

/* Which columns could be a time: increasing all through the sampled rows. */
static void find_increasing(struct sniff_work *work, const struct sniff *sniff, struct sniff_times *times)
{
	static const struct piece clock = {"clock", 5};
	double before[COLUMNS_MAX], value;
	size_t rows = 0;

	for (size_t i = 0; i < sniff->columns.count; i++)
		times->can[i] = true;
	for (size_t k = 0; k < work->lines; k++) {
		sniff_split(sniff->style, &work->line[k], &work->cells);
		if (work->cells.count != sniff->columns.count || !sniff_is_row(work, &work->cells))
			continue;
		for (size_t i = 0; i < sniff->columns.count; i++) {
			int64_t ns;
			int digits;

			if (sniff_kind(&work->cells, i) == CELL_CLOCK &&
			    clock_parse(work->cells.cell[i], &ns, &digits)) {
				value = (double)ns;
				times->unit[i] = unit_find(clock.text, clock.length);
			} else if (!cells_number(&work->cells, i, &value)) {
				times->can[i] = false;
				continue;
			}
			times->can[i] &= rows == 0 || value >= before[i];
			times->grows[i] |= rows > 0 && value > before[i];
			before[i] = value;
		}
		rows++;
	}
}

static int sniff_all(struct sniff_work *work, struct sniff *sniff, struct head *head,
                     const struct sniff_candidate *style)
{
	struct sniff_times times = {.count = 0};
	int error;

	sniff->style = style->style;
	sniff->columns.count = style->columns;
	error = read_head(work, sniff, style->columns, head);
	if (error)
		return error;
	find_footer(work, sniff);
	for (size_t i = 0; i < head->names.count; i++)
		sniff->name[i] = head->names.cell[i];
	sniff->names_line = head->names_line;
	find_increasing(work, sniff, &times);
	error = sniff_settle_names(sniff, head->units.count > 0 ? head->units.cell : NULL, &times,
	                           sniff->told_rate_hz > 0, work->source->file, work->message);
	for (size_t i = 0; !error && i < sniff->columns.count; i++)
		if (work->words[i] && sniff->columns.column[i].kind == COLUMN_CHANNEL)
			error = source_refuse(
			        work->message, DT_E_FORMAT, work->source->file, 0,
			        "column %zu, \"%s\", has a unit of acceleration and holds words, "
			        "expected numbers",
			        i + 1, sniff->columns.column[i].name);
	if (!error && !sniff->columns.has_time)
		sniff->columns.rate_hz = sniff->told_rate_hz;
	return error;
}

int sniff_text(struct sniff *sniff, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct sniff_work *work = calloc(1, sizeof(*work));
	struct head *head = calloc(1, sizeof(*head));
	struct sniff_candidate style = {.columns = 0};
	int error = 0;

	*sniff = (struct sniff){.end = source->size};
	if (is_of_ours(source))
		error = source_refuse(
		        message, DT_E_FORMAT, source->file, 0,
		        "has marks of a CSV of ours or a LabVIEW file, but does not begin as one: "
		        "damaged, or cut out of another");
	else if (work == NULL || head == NULL)
		error = source_no_memory(message, source->file);
	if (!error) {
		work->source = source;
		work->message = message;
		sniff_sample(work);
		error = sniff_find_style(work, &style);
	}
	if (!error && style.columns > COLUMNS_MAX)
		error = source_refuse(message, DT_E_FORMAT, source->file, 0,
		                      "%zu columns, expected %d at most", style.columns, COLUMNS_MAX);
	if (!error)
		error = sniff_all(work, sniff, head, &style);
	free(work);
	free(head);
	return error;
}

char sniff_separator(const struct source *source, size_t columns)
{
	struct sniff_work *work = calloc(1, sizeof(*work));
	struct sniff_candidate style = {.columns = 0};
	char unwanted[READ_MESSAGE_MAX], separator = '\0';

	if (work == NULL)
		return '\0';
	work->source = source;
	work->message = unwanted;
	sniff_sample(work);
	if (sniff_find_style(work, &style) == 0 && style.columns == columns)
		separator = style.style.separator;
	free(work);
	return separator;
}

/* ---- what was understood ---- */

__attribute__((format(printf, 4, 5))) static void tell(char *text, size_t size, size_t *used,
                                                       const char *format, ...)
{
	va_list list;
	int put;

	if (*used + 1 >= size)
		return;
	va_start(list, format);
	put = vsnprintf(text + *used, size - *used, format, list);
	va_end(list);
	*used += put > 0 ? (size_t)put : 0;
}

void sniff_tell(const struct sniff *sniff, const char *encoding, char *text, size_t size)
{
	const struct columns *columns = &sniff->columns;
	size_t used = 0, left = 0;
	const char *between = "";

	text[0] = '\0';
	if (encoding != NULL)
		tell(text, size, &used, "text %s, %s%s, %zu header line%s; ", encoding,
		     sniff_separator_name(sniff->style.separator),
		     sniff->style.decimal == ',' ? ", decimal comma" : "", sniff->header_lines,
		     sniff->header_lines == 1 ? "" : "s");
	for (size_t i = 0; i < columns->count; i++)
		if (columns->column[i].kind == COLUMN_SKIP)
			left++;
		else {
			tell(text, size, &used, "%s%s:%s", between, columns->column[i].name,
			     i < COLUMNS_MAX && columns->column[i].kind == COLUMN_TIME &&
			                     sniff->time_unit_open
			             ? "?"
			             : columns->column[i].unit->name);
			between = ", ";
		}
	if (columns->rate_hz > 0)
		tell(text, size, &used, " at %.9g Hz as told", columns->rate_hz);
	between = left == 0 ? "" : "; left out ";
	for (size_t i = 0; i < columns->count; i++)
		if (columns->column[i].kind == COLUMN_SKIP) {
			struct piece stem = sniff_stem(sniff->name[i]);

			if (stem.length > 0)
				tell(text, size, &used, "%s%.*s", between,
				     (int)(stem.length < 31 ? stem.length : 31), stem.text);
			else
				tell(text, size, &used, "%scolumn %zu", between, i + 1);
			between = ", ";
		}
	if (sniff->footer_lines > 0)
		tell(text, size, &used, "; %zu footer line%s", sniff->footer_lines,
		     sniff->footer_lines == 1 ? "" : "s");
}
