/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Text with columns, as other people's programs write it, among them LabVIEW measurement files (.lvm).
 */
#include "host/record/delimited.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/assume.h"
#include "host/record/clock.h"
#include "host/record/timebase.h"

enum { HEADER_LINES_MAX = 1000, SHOWN = 60 };

static int refuse_memory(const struct reading *reading)
{
	return source_no_memory(reading->message, reading->source->file);
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
	struct source_line first = {.number = 0}, second = {.number = 0};

	/* behind the headers of a LabVIEW file stands one line of names, and nothing else */
	if (reading->is_lvm && delimited_next_row(reading)) {
		header_offer(&reading->header, reading->style, &reading->columns, &reading->line);
		if (delimited_next_row(reading))
			return 0;
	}
	while (delimited_next_row(reading) && reading->line.number <= HEADER_LINES_MAX) {
		if (first.number == 0)
			first = reading->line;
		else if (second.number == 0)
			second = reading->line;
		if (reading->line.text >= rows && is_data(reading))
			return 0;
		header_offer(&reading->header, reading->style, &reading->columns, &reading->line);
	}
	if (second.number == 0)
		second = first;
	return source_refuse(reading->message, DT_E_FORMAT, reading->source->file, first.number,
	                     "no row of numbers from here on, expected %zu columns, found \"%.*s\"",
	                     reading->columns.count, (int)(second.length < SHOWN ? second.length : SHOWN),
	                     second.length > 0 ? second.text : "");
}

static int read_delimited_allocate(struct reading *reading)
{
	const struct columns *columns = &reading->columns;
	/* this one, and one without a line end */
	const size_t rows = reading->source->lines - (size_t)reading->line.number + 2;
	bool whole = true;

	for (size_t i = 0; i < columns->count && whole; i++)
		if (columns->column[i].kind == COLUMN_CHANNEL)
			whole = record_add_room(reading->record, columns->column[i].name, 0, rows) != NULL;
	if (columns->has_time) {
		reading->time_s = mapped_array(rows, sizeof(*reading->time_s));
		reading->row_line = mapped_array(rows, sizeof(*reading->row_line));
		whole = whole && reading->time_s && reading->row_line;
	}
	return whole ? 0 : refuse_memory(reading);
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

/* A clock has blanks in it: between date and time of day, before PM. */
static bool has_clock(const struct columns *columns)
{
	size_t i = 0;

	while (i < columns->count && !columns->column[i].is_clock)
		i++;
	return i < columns->count;
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
	if (reading->sniff == NULL && reading->style.separator == '\0' && has_clock(&reading->columns))
		reading->style.separator = sniff_separator(source, reading->columns.count);
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
		error = delimited_take_rows(reading);
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
