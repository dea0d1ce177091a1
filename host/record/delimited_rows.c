/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Rows of text with columns: one by one with all that may be wrong with them, and those that are as the one
 * before.
 */
#include "host/record/delimited.h"

#include <math.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/clock.h"

enum { PLAIN_PLACES = 32 };

static bool is_blank(const struct source_line *line)
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

bool delimited_next_row(struct reading *reading)
{
	struct source_line *line = &reading->line;

	while (source_next_line(reading->source, line)) {
		if (is_blank(line))
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
static bool is_cut(const struct reading *reading, size_t i)
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

static int take_time(struct reading *reading, size_t i)
{
	double value, digit;
	int digits;

	if (reading->columns.column[i].is_clock)
		return take_clock(reading, i);
	if (!cells_number(&reading->row, i, &value)) {
		int error = check_oddity(reading, i);

		return error ? error : REFUSE(reading, DT_E_FORMAT, "no number in the time column");
	}
	if (is_cut(reading, i))
		return REFUSE(reading, DT_E_FORMAT, "the file ends within a time, expected a line end");
	digit = cells_last_digit(&reading->row, i, &digits);
	note_time(reading, i, value, digit, digits);
	note_number(reading, i, reading->row.cell[i], reading->row.decimal);
	return 0;
}

static int take_sample(struct reading *reading, size_t i, struct channel *channel)
{
	size_t k = reading->rows;
	bool empty = i >= reading->row.count || reading->row.cell[i].length == 0, cut = is_cut(reading, i);
	double value;

	channel->value_g[k] = NAN;
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
			error = take_time(reading, i);
		if (columns->column[i].kind == COLUMN_CHANNEL)
			error = take_sample(reading, i, channel++);
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

/* As many as follow on each other; what is left to delimited_next_row begins with another. */
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

int delimited_take_rows(struct reading *reading)
{
	int error;

	do {
		if (reading->rows == 0)
			row_learn(&reading->shape, reading->style, &reading->row, &reading->columns);
		error = take_row(reading);
		if (!error)
			take_plain_rows(reading);
	} while (!error && delimited_next_row(reading));
	if (!error)
		error = check_commas(reading);
	if (error)
		return error;
	if (reading->rows < 2)
		return REFUSE(reading, DT_E_FORMAT, "one row of numbers, expected more");
	return 0;
}
