/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Text with columns, as other people's programs write it, among them LabVIEW measurement files (.lvm).
 */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/assume.h"
#include "host/record/clock.h"
#include "host/record/encoding.h"
#include "host/record/header.h"
#include "host/record/lvm.h"
#include "host/record/profile.h"
#include "host/record/row.h"
#include "host/record/sniff.h"
#include "host/record/timebase.h"

enum {
	HEADER_LINES_MAX = 1000,
	PLAIN_PLACES = 32,
};

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

static int refuse_memory(const struct reading *reading)
{
	return source_no_memory(reading->message, reading->source->file);
}

static bool read_delimited_is_blank(const struct source_line *line)
{
	for (size_t i = 0; i < line->length; i++)
		if (line->text[i] != ' ' && line->text[i] != '\t')
			return false;
	return true;
}

static bool is_comment(const struct source_line *line)
{
	size_t at = 0;

	while (line->text[at] == ' ' || line->text[at] == '\t')
		at++;
	return line->text[at] == '#';
}

/* Steps to the next line that is neither blank nor a comment, and splits it. */
static bool next_row(struct reading *reading)
{
	struct source_line *line = &reading->line;

	while (source_next_line(reading->source, line)) {
		if (read_delimited_is_blank(line))
			continue;
		if (is_comment(line)) {
			if (reading->rows == 0)
				header_offer(&reading->header, reading->style, &reading->columns, line);
			continue;
		}
		cells_split(reading->style, line->text, line->length, &reading->row);
		return true;
	}
	return false;
}

/* ---- the header ---- */

/* Whether a cell is a number, or was meant to be one: what is wrong with it is told when it is taken. */
static bool is_numeric(const struct reading *reading, size_t i)
{
	double value;
	int64_t ns;
	int digits;

	if (reading->columns.column[i].is_clock)
		return clock_parse(reading->row.cell[i], &ns, &digits);
	return cells_number(&reading->row, i, &value) || cells_oddity(&reading->row, i) != CELLS_PLAIN;
}

/* Whether a row is one of numbers: has them where the columns want one, or has nothing else. */
static bool is_data(const struct reading *reading)
{
	const struct cells *row = &reading->row;
	bool any = false;

	for (size_t i = 0; i < reading->columns.count && row->count == reading->columns.count; i++) {
		enum column_kind kind = reading->columns.column[i].kind;

		if (kind == COLUMN_TIME || (kind == COLUMN_CHANNEL && !reading->columns.has_time))
			return is_numeric(reading, i);
	}
	for (size_t i = 0; i < row->count && i < COLUMNS_MAX; i++) {
		if (is_numeric(reading, i))
			any = true;
		else if (row->cell[i].length > 0)
			return false;
	}
	return any;
}

/* Leaves the first row of numbers in reading->row. */
static int find_data(struct reading *reading)
{
	const char *rows = reading->source->bytes +
	                   (reading->sniff != NULL && !reading->is_lvm ? reading->sniff->first : 0);
	uint64_t first = 0;

	/* behind the headers of a LabVIEW file stands one line of names, and nothing else */
	if (reading->is_lvm && next_row(reading)) {
		header_offer(&reading->header, reading->style, &reading->columns, &reading->line);
		if (next_row(reading))
			return 0;
	}
	while (next_row(reading) && reading->line.number <= HEADER_LINES_MAX) {
		if (first == 0)
			first = reading->line.number;
		if (reading->line.text >= rows && is_data(reading))
			return 0;
		header_offer(&reading->header, reading->style, &reading->columns, &reading->line);
	}
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, first,
	                     "no row of numbers from here on, expected %zu columns", reading->columns.count);
}

/* ---- the rows ---- */

static int read_delimited_allocate(struct reading *reading)
{
	const struct columns *columns = &reading->columns;
	const char *at = reading->source->bytes + reading->line.next;
	const char *end = reading->source->bytes + reading->source->size, *counted = at;
	size_t rows = 2; /* this one, and one without a line end */
	bool whole = true;

	while ((at = memchr(at, '\n', (size_t)(end - at))) != NULL) {
		rows++;
		at++;
		if (rows % RECORD_PART == 0) {
			mapped_seen((size_t)(at - counted));
			counted = at;
		}
	}
	for (size_t i = 0; i < columns->count && whole; i++)
		if (columns->column[i].kind == COLUMN_CHANNEL)
			whole = record_add_channel(reading->record, columns->column[i].name, 0, rows) != NULL;
	if (columns->has_time) {
		reading->time_s = mapped_array(rows, sizeof(*reading->time_s));
		reading->row_line = mapped_array(rows, sizeof(*reading->row_line));
		whole = whole && reading->time_s && reading->row_line;
	}
	return whole ? 0 : refuse_memory(reading);
}

/* What is no number and looks like one is refused: it may be the peak. */
static int check_oddity(struct reading *reading, size_t i)
{
	enum cells_oddity oddity = cells_oddity(&reading->row, i);
	struct piece cell = reading->row.cell[i < CELLS_MAX ? i : 0];
	int length = (int)(cell.length < 60 ? cell.length : 60);

	if (oddity == CELLS_THOUSANDS)
		return REFUSE(reading, DT_E_FORMAT,
		              "\"%.*s\" in column %zu has a thousands separator, expected numbers without",
		              length, cell.text, i + 1);
	if (oddity == CELLS_UNIT)
		return REFUSE(
		        reading, DT_E_FORMAT,
		        "\"%.*s\" in column %zu has a unit behind its number, expected the number alone",
		        length, cell.text, i + 1);
	return 0;
}

static size_t unsigned_length(struct piece cell)
{
	return cell.length - (cell.length > 0 && (cell.text[0] == '-' || cell.text[0] == '+'));
}

/* Notes of a number what tells a decimal comma from a thousands separator, and one that the file's end has
 * cut. */
static void note_number(struct reading *reading, size_t i, struct piece cell, char decimal)
{
	reading->before[i] = cell;
	reading->decimal_before[i] = decimal;
	if ((reading->style.decimal && reading->sniff == NULL) || reading->is_lvm || decimal != ',' ||
	    cell.length == 0)
		return;
	if (cells_could_be_thousands(cell))
		reading->comma_doubt = reading->comma_doubt ? reading->comma_doubt : reading->line.number;
	else
		reading->comma_sure |= memchr(cell.text, ',', cell.length) != NULL;
}

/* Whether the last cell of a line without an end is no number, or one without digits that the row before has.
 * A whole number loses its last digits first. */
static bool read_delimited_is_cut(const struct reading *reading, size_t i)
{
	size_t tail;
	double value;

	if (!reading->unterminated || i + 1 != reading->row.count)
		return false;
	if (!cells_number(&reading->row, i, &value))
		return true;
	tail = cells_tail(reading->row.cell[i], reading->row.decimal);
	return reading->rows > 0 &&
	       (tail < cells_tail(reading->before[i], reading->decimal_before[i]) ||
	        (tail == 0 && unsigned_length(reading->row.cell[i]) < unsigned_length(reading->before[i])));
}

static int take_clock(struct reading *reading, size_t i)
{
	int64_t ns;
	int digits;

	if (i >= reading->row.count || !clock_parse(reading->row.cell[i], &ns, &digits))
		return REFUSE(reading, DT_E_FORMAT, "no time of day in column %zu, expected h:m:s", i + 1);
	if (reading->rows == 0)
		reading->clock_ns = ns;
	reading->digit = fmax(reading->rows == 0 ? 0 : reading->digit, pow(10, -digits));
	reading->time_s[reading->rows] = (double)(ns - reading->clock_ns) * 1e-9;
	reading->row_line[reading->rows] = reading->line.number;
	return 0;
}

static void note_time(struct reading *reading, size_t i, double value, double digit, int digits)
{
	reading->digit = reading->rows == 0 ? digit : fmin(reading->digit, digit);
	reading->digits = digits > reading->digits ? digits : reading->digits;
	reading->largest = fmax(reading->largest, fabs(value));
	reading->time_s[reading->rows] = value / reading->columns.column[i].divisor;
	reading->row_line[reading->rows] = reading->line.number;
}

static int read_delimited_take_time(struct reading *reading, size_t i)
{
	double value, digit;
	int digits;

	if (reading->columns.column[i].is_clock)
		return take_clock(reading, i);
	if (!cells_number(&reading->row, i, &value)) {
		int error = check_oddity(reading, i);

		return error ? error : REFUSE(reading, DT_E_FORMAT, "no number in the time column");
	}
	if (read_delimited_is_cut(reading, i))
		return REFUSE(reading, DT_E_FORMAT, "the file ends within a time, expected a line end");
	digit = cells_last_digit(&reading->row, i, &digits);
	note_time(reading, i, value, digit, digits);
	note_number(reading, i, reading->row.cell[i], reading->row.decimal);
	return 0;
}

static int read_delimited_take_sample(struct reading *reading, size_t i, struct channel *channel)
{
	size_t k = reading->rows;
	bool empty = i >= reading->row.count || reading->row.cell[i].length == 0,
	     cut = read_delimited_is_cut(reading, i);
	double value;

	channel->sample[k] = SAMPLE_BAD;
	if (!empty)
		reading->used[i] = k + 1;
	if (!cut && cells_number(&reading->row, i, &value)) {
		channel->value_g[k] = value / reading->columns.column[i].divisor;
		channel->sample[k] = 0;
		note_number(reading, i, reading->row.cell[i], reading->row.decimal);
		return 0;
	}
	reading->bad[i]++;
	return cut ? 0 : check_oddity(reading, i);
}

static int take_row(struct reading *reading)
{
	const struct columns *columns = &reading->columns;
	struct channel *channel = reading->record->channels;
	int error = 0;

	if (reading->is_lvm && lvm_is_segment(&reading->line))
		return REFUSE(reading, DT_E_FORMAT,
		              "another segment begins, expected one: cut the file here");
	/* a LabVIEW row ends where its last channel that still has samples does */
	if (reading->row.count > columns->count || (reading->row.count < columns->count && !reading->is_lvm))
		return REFUSE(reading, DT_E_FORMAT, "%zu columns, expected %zu", reading->row.count,
		              columns->count);
	reading->unterminated =
	        reading->line.text + reading->line.length == reading->source->bytes + reading->source->size;
	for (size_t i = 0; i < columns->count && !error; i++) {
		if (columns->column[i].kind == COLUMN_TIME)
			error = read_delimited_take_time(reading, i);
		if (columns->column[i].kind == COLUMN_CHANNEL)
			error = read_delimited_take_sample(reading, i, channel++);
	}
	reading->rows++;
	return error;
}

/* ---- rows that are as the one before, which most are ---- */

/* What the time column of plain rows has been written like. */
struct plain_time {
	double digit[PLAIN_PLACES]; /* what a digit in the place behind the decimal sign counts; 0: not looked
	                               up */
	int digits;
	uint64_t more; /* the least number of more digits than these */
};

static void take_plain_time(struct reading *reading, size_t i, const struct number_scan *number,
                            struct plain_time *plain)
{
	const int place = -number->exponent;
	double digit = place >= 0 && place < PLAIN_PLACES ? plain->digit[place] : 0;

	if (digit == 0) {
		digit = pow(10, number->exponent);
		if (place >= 0 && place < PLAIN_PLACES)
			plain->digit[place] = digit;
	}
	while (number->digits >= plain->more && plain->digits < NUMBER_SCAN_DIGITS) {
		plain->digits++;
		plain->more = plain->digits < NUMBER_SCAN_DIGITS ? plain->more * 10 : UINT64_MAX;
	}
	note_time(reading, i, number->value, digit, plain->digits);
}

/* The numbers that channels want, and the row's end. */
static void take_plain_row(struct reading *reading, const struct row *row, struct plain_time *plain)
{
	const struct columns *columns = &reading->columns;
	struct channel *channel = reading->record->channels;
	const size_t k = reading->rows;
	struct source_line *line = &reading->line;

	line->text = reading->source->bytes + line->next;
	line->length = (size_t)(row->end - line->text);
	line->next = (size_t)(row->next - reading->source->bytes);
	line->number++;
	mapped_seen(3 * line->length); /* of the text and of what is kept of it */
	for (size_t i = 0; i < columns->count; i++) {
		if (columns->column[i].kind == COLUMN_TIME) {
			take_plain_time(reading, i, &row->number[i], plain);
		} else if (columns->column[i].kind == COLUMN_CHANNEL) {
			channel->value_g[k] = row->number[i].value / columns->column[i].divisor;
			channel->sample[k] = 0;
			channel++;
			reading->used[i] = k + 1;
		}
	}
	reading->rows++;
}

static void note_row(struct reading *reading, const struct row *row)
{
	for (size_t i = 0; i < reading->columns.count; i++)
		if (reading->columns.column[i].kind != COLUMN_SKIP)
			note_number(reading, i, row->cell[i], reading->row.decimal);
}

/* As many as follow on each other; what is left to next_row begins with another. */
static void take_plain_rows(struct reading *reading)
{
	const struct source *source = reading->source;
	const char *end = source->bytes + source->size;
	struct plain_time plain = {.more = 1};
	struct row row[2]; /* the last and one that may be none */
	unsigned taken = 0;

	while (row_read(&reading->shape, source->bytes + reading->line.next, end, &row[taken % 2])) {
		take_plain_row(reading, &row[taken % 2], &plain);
		if (reading->row.decimal == ',')
			note_row(reading, &row[taken % 2]);
		taken++;
	}
	if (taken > 0)
		note_row(reading, &row[(taken - 1) % 2]);
}

static int check_commas(const struct reading *reading)
{
	if (reading->comma_sure || reading->comma_doubt == 0)
		return 0;
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, reading->comma_doubt,
	                     "a comma before three digits may part thousands or decimals, and no number of "
	                     "the file tells which, expected decimal points");
}

static int take_rows(struct reading *reading)
{
	int error;

	do {
		if (reading->rows == 0)
			row_learn(&reading->shape, reading->style, &reading->row, &reading->columns);
		error = take_row(reading);
		if (!error)
			take_plain_rows(reading);
	} while (!error && next_row(reading));
	if (!error)
		error = check_commas(reading);
	if (error)
		return error;
	if (reading->rows < 2)
		return REFUSE(reading, DT_E_FORMAT, "one row of numbers, expected more");
	return 0;
}

/* ---- the time base ---- */

/* What the last digit of the time column is worth, s. One with an exponent has it in other places than
 * another. */
static double digit_s(const struct reading *reading, double divisor)
{
	double places = reading->largest > 0 ? floor(log10(reading->largest)) + 1 : 0;
	double digit = fmax(reading->digit, pow(10, places - reading->digits));

	return fmax(digit, reading->largest * DBL_EPSILON) / divisor;
}

/* Finds the unit that a time column does not tell. */
static int assume_time(struct reading *reading)
{
	double step = (reading->time_s[reading->rows - 1] - reading->time_s[0]) / (double)(reading->rows - 1);
	struct assumed assumed;
	int error =
	        assume_unit(&assumed, reading->record, step, false, reading->source->file, reading->message);

	if (error)
		return error;
	reading->assumed = assumed.unit;
	for (size_t k = 0; k < reading->rows; k++)
		reading->time_s[k] /= assumed.divisor;
	for (size_t i = 0; i < reading->columns.count; i++)
		if (reading->columns.column[i].kind == COLUMN_TIME)
			reading->columns.column[i].divisor = assumed.divisor;
	return 0;
}

/* What the file tells besides its time column must be so. */
static int check_told_rate(const struct reading *reading, const struct timebase *timebase)
{
	double told_hz = reading->sniff != NULL ? reading->sniff->told_rate_hz : 0;

	if (!(told_hz > 0) || fabs(told_hz * timebase->step_s - 1) < 0.01)
		return 0;
	return source_refuse(
	        reading->message, DT_E_FORMAT, reading->source->file, reading->sniff->rate_line,
	        "tells a rate of %.9g Hz, but the time column steps by %.9g s (%.9g Hz), expected "
	        "one: --columns with time:s, or name:g@%.9g and - for the time",
	        told_hz, timebase->step_s, 1 / timebase->step_s, told_hz);
}

static int find_timebase(struct reading *reading, struct timebase *timebase)
{
	struct timebase_fault fault;
	size_t i = 0;
	double step_s;
	int error;

	if (!reading->columns.has_time)
		return 0;
	while (reading->columns.column[i].kind != COLUMN_TIME)
		i++;
	if (reading->sniff != NULL && reading->sniff->time_unit_open) {
		error = assume_time(reading);
		if (error)
			return error;
	}
	step_s = reading->is_lvm ? lvm_time_step(&reading->lvm, i) : 0;
	error = timebase_find(reading->time_s, reading->rows,
	                      digit_s(reading, reading->columns.column[i].divisor), step_s, timebase, &fault);
	if (error == DT_E_MEMORY)
		return refuse_memory(reading);
	return error ? source_refuse(reading->message, error, reading->source->file,
	                             reading->row_line[fault.row], "%s", fault.why)
	             : check_told_rate(reading, timebase);
}

/* A channel of a LabVIEW file has its own step, beginning and count of samples. */
static int finish_lvm(struct reading *reading, size_t i, struct channel *channel)
{
	const struct lvm_column *own = &reading->lvm.column[i];

	if (own->has_samples && reading->used[i] != own->samples)
		return source_refuse(reading->message, DT_E_FORMAT, reading->source->file,
		                     reading->lvm.samples_line,
		                     "column %zu, %s, has %zu samples, expected Samples = %zu", i + 1,
		                     channel->name, reading->used[i], own->samples);
	reading->bad[i] -= reading->rows - reading->used[i];
	channel->count = reading->used[i];
	channel->start_s = own->start_s;
	if (own->delta_s > 0)
		channel->rate_hz = 1 / own->delta_s;
	if (channel->rate_hz > 0)
		return 0;
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, reading->lvm.delta_line,
	                     "column %zu, %s, has no Delta_X, expected one as others have", i + 1,
	                     channel->name);
}

static int read_delimited_finish_channel(struct reading *reading, size_t i, const struct timebase *timebase,
                                         struct channel *channel)
{
	int error = 0;

	channel->rate_hz = reading->columns.rate_hz > 0 ? reading->columns.rate_hz
	                   : reading->columns.has_time  ? 1 / timebase->step_s
	                                                : 0;
	channel->count = reading->rows;
	channel->flags = timebase->uneven ? RECORD_FLAG_UNEVEN : 0;
	channel->flags |= reading->unterminated ? RECORD_FLAG_NO_LINE_END : 0;
	channel->flags |= reading->assumed != NULL ? RECORD_FLAG_ASSUMED : 0;
	channel->flags |= header_has_twins(&reading->header, &reading->columns) ||
	                                  (reading->sniff != NULL && reading->sniff->twins)
	                          ? RECORD_FLAG_SAME_NAMES
	                          : 0;
	if (reading->is_lvm)
		error = finish_lvm(reading, i, channel);
	if (!error && (channel->count == 0 || reading->bad[i] > channel->count / 2))
		return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, 0,
		                     "%s has no number in %zu of %zu rows, expected at least half",
		                     channel->name, reading->bad[i], channel->count);
	if (!error && timebase_spread(timebase, channel) != 0)
		error = refuse_memory(reading);
	return error;
}

static void tell_reading(struct reading *reading)
{
	char *text = reading->record->read_as;
	size_t size = sizeof(reading->record->read_as), used;

	if (reading->profile != NULL) {
		used = (size_t)snprintf(text, size, "profile %.100s says: ", reading->profile->path);
		columns_text(&reading->columns, text + used, size - used);
	}
	if (reading->sniff == NULL)
		return;
	sniff_tell(reading->sniff, reading->is_lvm ? NULL : reading->encoding, text, size);
	used = strlen(text);
	snprintf(text + used, size - used, "; %.9g Hz", reading->record->channels[0].rate_hz);
	used = strlen(text);
	if (reading->assumed != NULL)
		snprintf(text + used, size - used, "; assumed: time in %s", reading->assumed);
}

static int read_delimited_finish(struct reading *reading)
{
	struct record *record = reading->record;
	struct channel *channel = record->channels;
	struct timebase timebase = {.places = reading->rows};
	int error = find_timebase(reading, &timebase);

	for (size_t i = 0; i < reading->columns.count && !error; i++)
		if (reading->columns.column[i].kind == COLUMN_CHANNEL)
			error = read_delimited_finish_channel(reading, i, &timebase, channel++);
	timebase_free(&timebase);
	if (error)
		return error;
	record_begin_at_zero(record);
	strcpy(record->format, reading->is_lvm ? "lvm" : "delimited");
	tell_reading(reading);
	record_finish(record);
	return 0;
}

/* ---- the file ---- */

static bool any_delta(const struct reading *reading)
{
	for (size_t i = 0; i < reading->lvm.columns; i++)
		if (reading->lvm.column[i].delta_s > 0)
			return true;
	return false;
}

static bool is_x_value(struct piece name)
{
	return name.length == 7 && memcmp(name.text, "X_Value", 7) == 0;
}

/* A value of the headers that stands below a time column is another channel's. */
static int check_x_columns(struct reading *reading, const struct source_line *names)
{
	const struct sniff *sniff = reading->sniff;

	for (size_t i = 0; i < sniff->columns.count; i++)
		if (is_x_value(sniff->name[i]) && sniff->columns.column[i].kind == COLUMN_CHANNEL)
			return source_refuse(
			        reading->message, DT_E_FORMAT, reading->source->file, names->number,
			        "column %zu is X_Value, but Y_Unit_Label in line %llu gives it "
			        "\"%.*s\", expected each value of the headers below its channel",
			        i + 1, (unsigned long long)reading->lvm.unit_line,
			        (int)reading->lvm.column[i].unit.length, reading->lvm.column[i].unit.text);
	return 0;
}

/* The step is the header's, and the first time column has to agree with it. */
static void take_x_column(struct reading *reading)
{
	struct column *column = &reading->columns.column[0];

	if (!reading->lvm.has_x || reading->columns.has_time || column->kind != COLUMN_SKIP ||
	    !is_x_value(reading->sniff->name[0]))
		return;
	column->kind = COLUMN_TIME;
	column->unit = unit_find("s", 1);
	column->divisor = reading->lvm.x_divisor;
	reading->columns.has_time = true;
}

/* Channels of a LabVIEW file are columns labelled with a unit of acceleration; each has a step of its own. */
static int sniff_lvm(struct reading *reading)
{
	struct sniff *sniff = reading->sniff;
	struct source_line line = reading->line;
	struct piece units[COLUMNS_MAX] = {{0}};
	size_t count = 0;
	int error;

	if (source_next_line(reading->source, &line))
		cells_split(reading->style, line.text, line.length, &reading->row);
	for (size_t i = 0; i < reading->row.count && i < COLUMNS_MAX; i++) {
		sniff->name[i] = reading->row.cell[i];
		units[i] = i < reading->lvm.columns ? reading->lvm.column[i].unit : (struct piece){0};
		count = i + 1;
	}
	/* LabVIEW itself adds a column of comments, which has no cells */
	if (count > 1 && sniff->name[count - 1].length == 7 &&
	    memcmp(sniff->name[count - 1].text, "Comment", 7) == 0)
		count--;
	error = sniff_names(sniff, count, units, any_delta(reading), reading->source->file, reading->message);
	return error ? error : check_x_columns(reading, &line);
}

/* A file of other names is of another origin than the profile. */
static int check_profile(const struct reading *reading)
{
	const struct profile *profile = reading->profile;
	const struct cells *cells = &reading->header.names;
	char names[PROFILE_NAMES_MAX] = "";

	if (profile->names[0] == '\0')
		return 0;
	profile_names(cells->cell, cells->count < CELLS_MAX ? cells->count : CELLS_MAX, names);
	if (strcmp(names, profile->names) == 0)
		return 0;
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, reading->header.names_line,
	                     "names \"%.100s\", but profile %.100s is of files with \"%.100s\"", names,
	                     profile->path, profile->names);
}

static int read_headers(struct reading *reading)
{
	const struct source *source = reading->source;
	int error = 0;

	reading->is_lvm = lvm_is(source);
	if (reading->is_lvm) {
		error = lvm_read(&reading->lvm, source, &reading->line, reading->message);
		reading->style = reading->lvm.style;
	}
	if (!error && reading->sniff != NULL)
		error = reading->is_lvm ? sniff_lvm(reading)
		                        : sniff_text(reading->sniff, source, reading->message);
	if (!error && reading->sniff != NULL) {
		reading->columns = reading->sniff->columns;
		if (reading->is_lvm) {
			take_x_column(reading);
		} else {
			reading->style = reading->sniff->style;
			reading->rows_only = *source;
			reading->rows_only.size = reading->sniff->end;
			reading->source = &reading->rows_only;
		}
	}
	if (!error && !reading->columns.has_time && reading->columns.rate_hz == 0 && !any_delta(reading))
		error = source_refuse(
		        reading->message, DT_E_ARGUMENT, source->file, 0,
		        "neither a time column nor a rate, expected time:ms or name:unit@RATE_HZ");
	if (!error)
		error = find_data(reading);
	if (!error)
		error = header_check(&reading->header, &reading->columns, source->file, reading->message);
	if (!error && reading->profile != NULL)
		error = check_profile(reading);
	return error || !reading->is_lvm
	               ? error
	               : lvm_check(&reading->lvm, &reading->columns, source->file, reading->message);
}

static int read_delimited_all(struct reading *reading)
{
	int error = read_headers(reading);

	if (!error)
		error = read_delimited_allocate(reading);
	if (!error)
		error = take_rows(reading);
	return error ? error : read_delimited_finish(reading);
}

static int read_delimited_by(struct reading *reading, const char *columns)
{
	int error = profile_of(&reading->profile, reading->source->file, columns, reading->message);

	if (!error && reading->profile != NULL) {
		columns = reading->profile->columns;
		reading->style = reading->profile->style;
	}
	if (!error && columns != NULL)
		error = columns_parse(&reading->columns, columns, reading->message);
	if (!error && columns == NULL) {
		reading->sniff = calloc(1, sizeof(*reading->sniff));
		error = reading->sniff == NULL ? refuse_memory(reading) : 0;
	}
	if (!error)
		error = read_delimited_all(reading);
	free(reading->sniff);
	free(reading->profile);
	return error;
}

int read_delimited(struct record *record, struct source *source, const char *columns,
                   char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading *reading;
	const char *encoding;
	int error = encoding_settle(source, &encoding, message);

	if (error)
		return error;
	reading = calloc(1, sizeof(*reading));
	if (!reading)
		return source_no_memory(message, source->file);
	reading->source = source;
	reading->message = message;
	reading->record = &filled;
	reading->encoding = encoding;
	record_init(&filled);
	error = read_delimited_by(reading, columns);
	mapped_free(reading->time_s);
	mapped_free(reading->row_line);
	free(reading);
	if (error)
		record_free(&filled);
	else
		*record = filled;
	return error;
}
