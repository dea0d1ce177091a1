/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/lvm.h"

#include <math.h>
#include <string.h>

#include "host/record/header.h"

enum { HEADER_LINES_MAX = 1000 };

/* A rate the user gives may be off the header's by this part. */
static const double RATE_PART = 0.01;

static bool starts(const struct source_line *line, const char *text)
{
	size_t length = strlen(text);

	return line->length >= length && memcmp(line->text, text, length) == 0;
}

static bool is_key(const struct cells *cells, const char *key)
{
	return cells->cell[0].length == strlen(key) &&
	       memcmp(cells->cell[0].text, key, cells->cell[0].length) == 0;
}

bool lvm_is(const struct source *source)
{
	static const char lvm[] = "LabVIEW Measurement";

	return source->size >= sizeof(lvm) - 1 && memcmp(source->bytes, lvm, sizeof(lvm) - 1) == 0;
}

bool lvm_is_segment(const struct source_line *line)
{
	return starts(line, "***End_of_Header***") || starts(line, "Channels\t") || starts(line, "Channels,");
}

/* ---- reading ---- */

static void take_style(struct lvm *lvm, const struct source_line *line)
{
	if (starts(line, "Separator") && line->length > 10)
		lvm->style.separator = line->text[10] == 'C' ? ',' : '\t';
	else if (starts(line, "Decimal_Separator") && line->length > 18)
		lvm->style.decimal = line->text[18] == ',' ? ',' : '.';
}

/* Number of a cell; false for one that says nothing. */
static int lvm_take_number(const struct cells *cells, size_t i, double *value, const struct source_line *line,
                           const char *file, char *message)
{
	if (cells->cell[i].length == 0 || cells_number(cells, i, value))
		return 0;
	return source_refuse(message, DT_E_FORMAT, file, line->number, "%.*s \"%.*s\", expected a number",
	                     (int)cells->cell[0].length, cells->cell[0].text,
	                     (int)(cells->cell[i].length < 60 ? cells->cell[i].length : 60),
	                     cells->cell[i].text);
}

static int take_column(struct lvm *lvm, const struct cells *cells, size_t i, const struct source_line *line,
                       const char *file, char *message)
{
	struct lvm_column *column = &lvm->column[i];
	double value = NAN;
	int error = 0;

	if (is_key(cells, "Y_Unit_Label"))
		column->unit = cells->cell[i];
	else if (is_key(cells, "X_Dimension"))
		column->dimension = cells->cell[i];
	else if (is_key(cells, "Date"))
		column->date = cells->cell[i];
	else if (is_key(cells, "Time"))
		column->time = cells->cell[i];
	else
		error = lvm_take_number(cells, i, &value, line, file, message);
	if (error || isnan(value))
		return error;
	if (is_key(cells, "Delta_X") && value > 0)
		column->delta_s = value;
	else if (is_key(cells, "X0"))
		column->start_s = value;
	else if (is_key(cells, "Samples") && value >= 0 && value < 1e15) {
		column->samples = (size_t)value;
		column->has_samples = true;
	}
	return 0;
}

/* A line of the second header that has a value for each column. */
static int lvm_take_line(struct lvm *lvm, const struct source_line *line, const char *file, char *message)
{
	static const char *const keys[] = {"Delta_X",     "X0",   "Samples", "Y_Unit_Label",
	                                   "X_Dimension", "Date", "Time",    "X_Unit_Label"};
	struct cells cells;
	size_t key = 0, most;
	int error = 0;

	cells_split(lvm->style, line->text, line->length, &cells);
	while (key < sizeof(keys) / sizeof(keys[0]) && !is_key(&cells, keys[key]))
		key++;
	if (key == sizeof(keys) / sizeof(keys[0]))
		return 0;
	most = cells.count < COLUMNS_MAX ? cells.count : COLUMNS_MAX;
	if (is_key(&cells, "X_Unit_Label")) {
		const struct unit *unit =
		        most > 1 ? unit_find(cells.cell[1].text, cells.cell[1].length) : NULL;

		if (unit && unit->kind == UNIT_TIME)
			lvm->x_divisor = unit->divisor;
		return 0;
	}
	for (size_t i = 1; i < most && !error; i++)
		error = take_column(lvm, &cells, i, line, file, message);
	lvm->delta_line = key == 0 ? line->number : lvm->delta_line;
	lvm->samples_line = key == 2 ? line->number : lvm->samples_line;
	lvm->unit_line = key == 3 ? line->number : lvm->unit_line;
	lvm->dimension_line = key == 4 ? line->number : lvm->dimension_line;
	lvm->stamp_line = key == 6 ? line->number : lvm->stamp_line;
	lvm->columns = most > lvm->columns ? most : lvm->columns;
	return error;
}

int lvm_read(struct lvm *lvm, const struct source *source, struct source_line *line,
             char message[READ_MESSAGE_MAX])
{
	unsigned ends = 0;
	int error = 0;

	*lvm = (struct lvm){.style = {'\t', '.'}, .x_divisor = 1};
	while (ends < 2 && !error) {
		if (!source_next_line(source, line) || line->number > HEADER_LINES_MAX)
			return source_refuse(message, DT_E_FORMAT, source->file, line->number,
			                     "%u headers of a LabVIEW file end above, expected 2", ends);
		ends += starts(line, "***End_of_Header***");
		lvm->multi |= starts(line, "X_Columns") && line->length > 10 && line->text[10] == 'M';
		lvm->has_x |= starts(line, "X_Columns") && line->length > 10 && line->text[10] != 'N';
		if (ends == 0)
			take_style(lvm, line);
		else
			error = lvm_take_line(lvm, line, source->file, message);
	}
	for (size_t i = 0; i < COLUMNS_MAX; i++) {
		lvm->column[i].delta_s /= lvm->x_divisor;
		lvm->column[i].start_s /= lvm->x_divisor;
	}
	return error;
}

/* ---- against what the user says ---- */

/* The channel of a single time column is the first of those with most samples. */
static size_t channel_of_time(const struct lvm *lvm, size_t time_column)
{
	size_t first = time_column + 1;

	for (size_t i = first; i < lvm->columns && !lvm->multi; i++)
		if (lvm->column[i].samples > lvm->column[first].samples)
			first = i;
	return first;
}

double lvm_time_step(const struct lvm *lvm, size_t time_column)
{
	size_t channel = channel_of_time(lvm, time_column);

	return channel < COLUMNS_MAX ? lvm->column[channel].delta_s : 0;
}

static bool same(struct piece a, struct piece b)
{
	return a.length == b.length && (a.length == 0 || memcmp(a.text, b.text, a.length) == 0);
}

/* Times of channels count from one instant only where their stamps are one. */
static int check_stamp(const struct lvm *lvm, size_t first, size_t i, const char *file, char *message)
{
	const struct lvm_column *a = &lvm->column[first], *b = &lvm->column[i];

	if (same(a->date, b->date) && same(a->time, b->time))
		return 0;
	return source_refuse(
	        message, DT_E_FORMAT, file, lvm->stamp_line,
	        "columns %zu and %zu began at different times, %.*s %.*s and %.*s %.*s, expected "
	        "--columns to name those of one beginning",
	        first + 1, i + 1, (int)a->date.length, a->date.text ? a->date.text : "", (int)a->time.length,
	        a->time.text ? a->time.text : "", (int)b->date.length, b->date.text ? b->date.text : "",
	        (int)b->time.length, b->time.text ? b->time.text : "");
}

static int lvm_check_channel(const struct lvm *lvm, const struct columns *columns, size_t i, const char *file,
                             char *message)
{
	const struct lvm_column *column = &lvm->column[i];
	const struct unit *unit =
	        column->unit.length ? unit_find(column->unit.text, column->unit.length) : NULL;

	/* accelerometers labelled "s" occur: that is no unit of theirs */
	if (unit && unit->kind != UNIT_TIME) {
		int error = header_check_unit(columns, i, column->unit, unit, file, lvm->unit_line, message);

		if (error)
			return error;
	}
	if (column->dimension.length > 0 && !same(column->dimension, (struct piece){"Time", 4}))
		return source_refuse(message, DT_E_FORMAT, file, lvm->dimension_line,
		                     "column %zu is over \"%.*s\", expected over Time", i + 1,
		                     (int)(column->dimension.length < 60 ? column->dimension.length : 60),
		                     column->dimension.text);
	if (column->delta_s > 0 && columns->rate_hz > 0 &&
	    fabs(columns->rate_hz * column->delta_s - 1) > RATE_PART)
		return source_refuse(message, DT_E_FORMAT, file, lvm->delta_line,
		                     "column %zu has Delta_X = %.9g s (%.9g Hz), but --columns says %.9g Hz, "
		                     "expected one rate",
		                     i + 1, column->delta_s, 1 / column->delta_s, columns->rate_hz);
	return 0;
}

int lvm_check(const struct lvm *lvm, const struct columns *columns, const char *file,
              char message[READ_MESSAGE_MAX])
{
	size_t first = columns->count;
	int error = 0;

	for (size_t i = 0; i < columns->count && !error; i++) {
		if (columns->column[i].kind != COLUMN_CHANNEL)
			continue;
		first = first == columns->count ? i : first;
		error = lvm_check_channel(lvm, columns, i, file, message);
		if (!error)
			error = check_stamp(lvm, first, i, file, message);
	}
	return error;
}
