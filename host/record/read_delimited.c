/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Text with columns, as other people's programs write it, among them LabVIEW measurement files (.lvm).
 *
 * Separators are runs of blanks and tabs, single commas, single semicolons, in any mix; a comma between
 * two digits is a decimal one where a semicolon or tab separates and no point is there. A LabVIEW file
 * says in its header which one it uses. ("Specification for the LabVIEW Measurement File", National
 * Instruments)
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/columns.h"
#include "host/record/number.h"
#include "host/record/source.h"

enum {
	HEADER_LINES_MAX = 1000,
	CELLS_MAX = COLUMNS_MAX + 1, /* one more than any row may have shows that it is too long */
};

/* The time column may place a sample this part of a step off an even grid before it counts as uneven; more
 * where it is rounded and the step is known from a header. */
static const double UNEVEN_STEPS = 0.1, UNEVEN_STEPS_ROUNDED = 0.75;

/* What the step in a LabVIEW header may be off from its time column, besides one step for rounding. */
static const double DELTA_TOLERANCE = 0.01;

struct piece {
	const char *text;
	size_t length;
};

struct row {
	struct piece cell[CELLS_MAX];
	size_t count; /* cells, also those that found no room */
	char decimal;
};

struct reading {
	const struct source *source;
	struct source_line line;
	char *message;
	struct columns columns;
	struct record *record;

	bool is_lvm;
	char separator; /* of an .lvm; 0 = any */
	char decimal;
	double delta_s; /* of an .lvm; 0 = not said */

	double *time_s;
	size_t rows;
	size_t bad[COLUMNS_MAX]; /* by column */
	struct row row;
};

#define REFUSE(reading, code, ...) \
	source_refuse((reading)->message, code, (reading)->source->file, (reading)->line.number, __VA_ARGS__)

/* ---- a line to cells ---- */

static bool is_blank(char c)
{
	return c == ' ' || c == '\t';
}

static bool is_digit(char c)
{
	return c >= '0' && c <= '9';
}

static char decimal_of(const char *text, size_t length)
{
	bool separated = memchr(text, ';', length) || memchr(text, '\t', length);

	if (!separated || memchr(text, '.', length))
		return '.';
	for (size_t i = 1; i + 1 < length; i++)
		if (text[i] == ',' && is_digit(text[i - 1]) && is_digit(text[i + 1]))
			return ',';
	return '.';
}

static size_t skip_blanks(const char *text, size_t length, size_t at)
{
	while (at < length && is_blank(text[at]))
		at++;
	return at;
}

/* The end of the cell that begins at `at`. */
static size_t cell_end(const struct reading *reading, const struct row *row, const char *text, size_t length,
                       size_t at)
{
	for (; at < length; at++) {
		char c = text[at];

		if (reading->separator ? c == reading->separator
		                       : is_blank(c) || c == ';' || (c == ',' && row->decimal != ','))
			break;
	}
	return at;
}

/* A cell without the blanks and quotes around it. */
static struct piece trim(struct piece cell)
{
	while (cell.length > 0 && is_blank(cell.text[cell.length - 1]))
		cell.length--;
	if (cell.length >= 2 && cell.text[0] == '"' && cell.text[cell.length - 1] == '"')
		cell = (struct piece){cell.text + 1, cell.length - 2};
	return cell;
}

static void split(const struct reading *reading, const char *text, size_t length, struct row *row)
{
	bool more = true; /* a separator announced another cell */
	size_t at = 0;

	row->count = 0;
	row->decimal = reading->is_lvm ? reading->decimal : decimal_of(text, length);
	while (at < length || more) {
		size_t start, end;

		if (reading->separator != '\t')
			at = skip_blanks(text, length, at);
		start = end = at;
		if (start < length && text[start] == '"') {
			const char *quote = memchr(text + start + 1, '"', length - start - 1);

			if (quote)
				end = (size_t)(quote - text) + 1;
		}
		end = cell_end(reading, row, text, length, end);
		if (row->count < CELLS_MAX)
			row->cell[row->count] = trim((struct piece){text + start, end - start});
		row->count++;
		if (reading->separator != '\t')
			end = skip_blanks(text, length, end);
		more = end < length && (reading->separator ? text[end] == reading->separator
		                                           : text[end] == ';' || text[end] == ',');
		at = end + more;
	}
}

/* Steps to the next line that is neither blank nor a comment, and splits it. */
static bool next_row(struct reading *reading)
{
	struct source_line *line = &reading->line;

	while (source_next_line(reading->source, line)) {
		size_t start = skip_blanks(line->text, line->length, 0);

		if (start == line->length || line->text[start] == '#')
			continue;
		split(reading, line->text, line->length, &reading->row);
		return true;
	}
	return false;
}

static bool cell_number(const struct row *row, size_t i, double *value)
{
	return i < row->count && number_parse(row->cell[i].text, row->cell[i].length, row->decimal, value);
}

/* ---- the header ---- */

static bool line_starts(const struct source_line *line, const char *text)
{
	size_t length = strlen(text);

	return line->length >= length && memcmp(line->text, text, length) == 0;
}

static void read_lvm_line(struct reading *reading)
{
	const struct source_line *line = &reading->line;
	double delta;

	if (line_starts(line, "Separator") && line->length > 10)
		reading->separator = line->text[10] == 'C' ? ',' : '\t';
	else if (line_starts(line, "Decimal_Separator") && line->length > 18)
		reading->decimal = line->text[18] == ',' ? ',' : '.';
	else if (!line_starts(line, "Delta_X"))
		return;
	split(reading, line->text, line->length, &reading->row);
	if (line->text[0] == 'D' && cell_number(&reading->row, 1, &delta) && delta > 0)
		reading->delta_s = delta;
}

/* Two headers, each with its end: one of the file, one of the measurement. */
static int read_lvm_header(struct reading *reading)
{
	unsigned ends = 0;

	reading->separator = '\t';
	while (ends < 2) {
		if (!source_next_line(reading->source, &reading->line) ||
		    reading->line.number > HEADER_LINES_MAX)
			return REFUSE(reading, DT_E_FORMAT,
			              "%u headers of a LabVIEW file end above, expected 2", ends);
		ends += line_starts(&reading->line, "***End_of_Header***");
		read_lvm_line(reading);
	}
	return 0;
}

/* Whether a row is one of numbers: has them where the columns want one, or has nothing else. */
static bool is_data(const struct reading *reading)
{
	const struct row *row = &reading->row;
	bool any = false;
	double value;

	for (size_t i = 0; i < reading->columns.count && row->count == reading->columns.count; i++) {
		enum column_kind kind = reading->columns.column[i].kind;

		if (kind == COLUMN_TIME || (kind == COLUMN_CHANNEL && !reading->columns.has_time))
			return cell_number(row, i, &value);
	}
	for (size_t i = 0; i < row->count && i < CELLS_MAX; i++) {
		if (cell_number(row, i, &value))
			any = true;
		else if (row->cell[i].length > 0)
			return false;
	}
	return any;
}

/* Leaves the first row of numbers in reading->row. */
static int find_data(struct reading *reading)
{
	uint64_t first = 0;

	/* behind the headers of a LabVIEW file stands one line of names, and nothing else */
	if (reading->is_lvm && next_row(reading) && next_row(reading))
		return 0;
	while (next_row(reading) && reading->line.number <= HEADER_LINES_MAX) {
		if (first == 0)
			first = reading->line.number;
		if (is_data(reading))
			return 0;
	}
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, first,
	                     "no row of numbers from here on, expected %zu columns", reading->columns.count);
}

/* ---- the rows ---- */

static int allocate(struct reading *reading)
{
	const struct columns *columns = &reading->columns;
	const char *at = reading->source->bytes + reading->line.next;
	const char *end = reading->source->bytes + reading->source->size;
	size_t rows = 2; /* this one, and one without a line end */
	bool whole = true;

	while ((at = memchr(at, '\n', (size_t)(end - at))) != NULL) {
		rows++;
		at++;
	}
	for (size_t i = 0; i < columns->count && whole; i++)
		if (columns->column[i].kind == COLUMN_CHANNEL)
			whole = record_add_channel(reading->record, columns->column[i].name, 0, rows) != NULL;
	if (columns->has_time)
		reading->time_s = calloc(rows, sizeof(*reading->time_s));
	if (!whole || (columns->has_time && !reading->time_s))
		return source_refuse(reading->message, DT_E_MEMORY, reading->source->file, 0, "%s",
		                     error_text(DT_E_MEMORY));
	return 0;
}

static int take_time(struct reading *reading, size_t i)
{
	const struct row *row = &reading->row;
	double *time_s = reading->time_s + reading->rows;
	double value;

	if (!cell_number(row, i, &value))
		return REFUSE(reading, DT_E_FORMAT, "no number in the time column");
	*time_s = value / reading->columns.column[i].divisor;
	if (reading->rows == 0 || time_s[0] > time_s[-1])
		return 0;
	/* rounding may have made two times of a LabVIEW file equal; its header has the step */
	if (reading->delta_s > 0 && time_s[0] >= time_s[-1])
		return 0;
	return REFUSE(reading, DT_E_FORMAT, "time %.9g s after %.9g s, expected it to increase", time_s[0],
	              time_s[-1]);
}

static void take_sample(struct reading *reading, size_t i, struct channel *channel)
{
	double value;

	if (cell_number(&reading->row, i, &value)) {
		channel->value_g[reading->rows] = value / reading->columns.column[i].divisor;
		channel->sample[reading->rows] = 0;
	} else {
		channel->sample[reading->rows] = SAMPLE_BAD;
		reading->bad[i]++;
	}
}

static int take_row(struct reading *reading)
{
	const struct columns *columns = &reading->columns;
	struct channel *channel = reading->record->channels;
	int error = 0;

	/* a LabVIEW row ends where its last channel that still has samples does */
	if (reading->row.count > columns->count || (reading->row.count < columns->count && !reading->is_lvm))
		return REFUSE(reading, DT_E_FORMAT, "%zu columns, expected %zu", reading->row.count,
		              columns->count);
	for (size_t i = 0; i < columns->count && !error; i++) {
		if (columns->column[i].kind == COLUMN_TIME)
			error = take_time(reading, i);
		if (columns->column[i].kind == COLUMN_CHANNEL)
			take_sample(reading, i, channel++);
	}
	reading->rows++;
	return error;
}

static int take_rows(struct reading *reading)
{
	int error;

	do
		error = take_row(reading);
	while (!error && next_row(reading));
	if (error)
		return error;
	if (reading->rows < 2)
		return REFUSE(reading, DT_E_FORMAT, "one row of numbers, expected more");
	for (size_t i = 0; i < reading->columns.count; i++)
		if (reading->bad[i] > reading->rows / 2)
			return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, 0,
			                     "%s has no number in %zu of %zu rows, expected at least half",
			                     reading->columns.column[i].name, reading->bad[i], reading->rows);
	return 0;
}

/* ---- the time base ---- */

/* The header of a LabVIEW file has the step, its time column is rounded; but they must be of one measurement
 * and one unit. */
static int check_delta(const struct reading *reading, double step_s)
{
	double steps = (double)(reading->rows - 1);

	if (!reading->columns.has_time ||
	    fabs(step_s / reading->delta_s - 1) * steps < 1 + DELTA_TOLERANCE * steps)
		return 0;
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, 0,
	                     "time column steps by %.9g s, expected Delta_X = %.9g s", step_s,
	                     reading->delta_s);
}

static int find_rate(const struct reading *reading, double *rate_hz)
{
	double step_s = 0;
	int error = 0;

	if (reading->columns.has_time)
		step_s = (reading->time_s[reading->rows - 1] - reading->time_s[0]) /
		         (double)(reading->rows - 1);
	if (reading->delta_s > 0) {
		error = check_delta(reading, step_s);
		step_s = reading->delta_s;
	}
	*rate_hz = reading->columns.rate_hz > 0 ? reading->columns.rate_hz : 1 / step_s;
	if (!error && (!isfinite(*rate_hz) || *rate_hz <= 0))
		error = source_refuse(reading->message, DT_E_FORMAT, reading->source->file, 0,
		                      "time column without a rate, expected it to increase");
	return error;
}

static bool is_uneven(const struct reading *reading, double rate_hz)
{
	double limit = reading->delta_s > 0 ? UNEVEN_STEPS_ROUNDED : UNEVEN_STEPS;

	for (size_t k = 0; reading->time_s && k < reading->rows; k++)
		if (fabs((reading->time_s[k] - reading->time_s[0]) * rate_hz - (double)k) > limit)
			return true;
	return false;
}

static int finish(struct reading *reading)
{
	struct record *record = reading->record;
	double rate_hz = 0;
	int error = find_rate(reading, &rate_hz);
	bool uneven;

	if (error)
		return error;
	uneven = is_uneven(reading, rate_hz);
	for (size_t i = 0; i < record->channel_count; i++) {
		record->channels[i].rate_hz = rate_hz;
		record->channels[i].count = reading->rows;
		record->channels[i].flags = uneven ? RECORD_FLAG_UNEVEN : 0;
	}
	strcpy(record->format, reading->is_lvm ? "lvm" : "delimited");
	record_finish(record);
	return 0;
}

static int read_all(struct reading *reading)
{
	static const char lvm[] = "LabVIEW Measurement";
	int error = 0;

	reading->is_lvm = reading->source->size >= sizeof(lvm) - 1 &&
	                  memcmp(reading->source->bytes, lvm, sizeof(lvm) - 1) == 0;
	if (reading->is_lvm)
		error = read_lvm_header(reading);
	if (!error && !reading->columns.has_time && reading->columns.rate_hz == 0 && reading->delta_s == 0)
		error = source_refuse(
		        reading->message, DT_E_ARGUMENT, reading->source->file, 0,
		        "neither a time column nor a rate, expected time:ms or name:unit@RATE_HZ");
	if (!error)
		error = find_data(reading);
	if (!error)
		error = allocate(reading);
	if (!error)
		error = take_rows(reading);
	return error ? error : finish(reading);
}

int read_delimited(struct record *record, const struct source *source, const char *columns,
                   char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading reading = {.source = source, .message = message, .record = &filled, .decimal = '.'};
	int error;

	if (source->size >= 2 &&
	    (memcmp(source->bytes, "\xff\xfe", 2) == 0 || memcmp(source->bytes, "\xfe\xff", 2) == 0))
		return source_refuse(
		        message, DT_E_FORMAT, source->file, 0,
		        "text in UTF-16, expected UTF-8: 'iconv -f UTF-16 -t UTF-8' makes it so");
	if (!columns)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "not a log of a drop tower; for other text expected --columns "
		                     "\"time:ms,name:g,-\", one entry per column");
	error = columns_parse(&reading.columns, columns, message);
	if (error)
		return error;
	record_init(&filled);
	error = read_all(&reading);
	free(reading.time_s);
	if (error)
		record_free(&filled);
	else
		*record = filled;
	return error;
}
