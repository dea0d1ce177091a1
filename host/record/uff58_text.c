/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/uff58_text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "host/record/table_data.h"

/* ---- columns ---- */

void uff58_take(const struct source_line *line, size_t first, size_t width, char *field, size_t size)
{
	size_t end = first + width < line->length ? first + width : line->length;
	size_t length;

	while (first < end && line->text[first] == ' ')
		first++;
	while (end > first && line->text[end - 1] == ' ')
		end--;
	length = end > first ? end - first : 0;
	if (length >= size)
		length = size - 1;
	memcpy(field, line->text + (length ? first : 0), length);
	field[length] = '\0';
}

static bool uff58_text_take_number(const struct source_line *line, size_t first, size_t width, double *value)
{
	char field[32];

	uff58_take(line, first, width, field, sizeof(field));
	for (char *p = field; *p; p++)
		if (*p == 'D' || *p == 'd') /* Fortran's double precision */
			*p = 'E';
	return number_parse(field, strlen(field), '.', value);
}

/* A field left blank is 0, as in Fortran. */
static bool uff58_text_take_whole(const struct source_line *line, size_t first, size_t width, int *value)
{
	double number = 0;
	char field[32];

	uff58_take(line, first, width, field, sizeof(field));
	if (field[0] && !number_parse(field, strlen(field), '.', &number))
		return false;
	if (fabs(number) > 2147483647.0 || number != trunc(number))
		return false;
	*value = (int)number;
	return true;
}

bool uff58_is_delimiter(const struct source_line *line)
{
	char field[8];

	uff58_take(line, 0, line->length, field, sizeof(field));
	return strcmp(field, "-1") == 0;
}

int uff58_next_line(struct uff58_text *text, const char *what)
{
	if (source_next_line(text->source, &text->line))
		return 0;
	return UFF58_REFUSE(text, DT_E_FORMAT, "the file ends, expected %s", what);
}

int uff58_skip_dataset(struct uff58_text *text)
{
	while (source_next_line(text->source, &text->line))
		if (uff58_is_delimiter(&text->line))
			return 0;
	return UFF58_REFUSE(text, DT_E_FORMAT, "the file ends inside a dataset, expected a line with -1");
}

/* ---- the head ---- */

/* Format(2(I5,I10),2(1X,10A1,I10,I4)) */
static int read_record_6(struct uff58_text *text, struct uff58_head *head)
{
	int error = uff58_next_line(text, "record 6");

	if (error)
		return error;
	if (!uff58_text_take_whole(&text->line, 0, 5, &head->function) ||
	    !uff58_text_take_whole(&text->line, 41, 10, &head->node) ||
	    !uff58_text_take_whole(&text->line, 51, 4, &head->direction))
		return UFF58_REFUSE(text, DT_E_FORMAT,
		                    "record 6, expected whole numbers in columns 1-5, 42-51 and 52-55");
	return 0;
}

/* Format(3I10,3E13.5) */
static int read_record_7(struct uff58_text *text, struct uff58_head *head)
{
	int error = uff58_next_line(text, "record 7"), count = 0, spacing = 0;

	if (error)
		return error;
	if (!uff58_text_take_whole(&text->line, 0, 10, &head->precision) ||
	    !uff58_text_take_whole(&text->line, 10, 10, &count) ||
	    !uff58_text_take_whole(&text->line, 20, 10, &spacing) ||
	    !uff58_text_take_number(&text->line, 30, 13, &head->start) ||
	    !uff58_text_take_number(&text->line, 43, 13, &head->step) || count < 0)
		return UFF58_REFUSE(
		        text, DT_E_FORMAT,
		        "record 7, expected three whole numbers in 10 columns each and two numbers in "
		        "13 columns each");
	head->count = (size_t)count;
	head->even = spacing == 1;
	return 0;
}

/* Records 8 to 11, of which abscissa and ordinate say what was measured: Format(I10,3I5,2(1X,20A1)) */
static int read_axes(struct uff58_text *text, struct uff58_head *head)
{
	for (int record = 8; record <= 11; record++) {
		int error = uff58_next_line(text, "records 8 to 11");

		if (error)
			return error;
		if (record == 8)
			uff58_take(&text->line, 47, 20, head->time_unit, sizeof(head->time_unit));
		if (record != 9)
			continue;
		if (!uff58_text_take_whole(&text->line, 0, 10, &head->quantity))
			return UFF58_REFUSE(text, DT_E_FORMAT,
			                    "record 9, expected a whole number in columns 1-10");
		uff58_take(&text->line, 47, 20, head->unit, sizeof(head->unit));
	}
	return 0;
}

int uff58_read_head(struct uff58_text *text, struct uff58_head *head)
{
	int error = 0;

	head->line = text->line.number + 1;
	for (int i = 0; i < UFF58_ID_LINES && !error; i++) {
		error = uff58_next_line(text, "five lines of identification");
		if (!error)
			uff58_take(&text->line, 0, UFF58_ID_CHARS, head->id[i], sizeof(head->id[i]));
	}
	if (!error)
		error = read_record_6(text, head);
	if (!error)
		error = read_record_7(text, head);
	return error ? error : read_axes(text, head);
}

/* ---- the data ---- */

/* Fields of the data records, one after the other. */
struct cells {
	size_t per_line, next; /* numbers in a line, and the one to be read */
	size_t column;
};

static int next_cell(struct uff58_text *text, struct cells *cells, size_t width, double *value)
{
	char field[32];

	if (cells->next == cells->per_line) {
		int error = uff58_next_line(text, "data");

		if (error)
			return error;
		cells->next = cells->column = 0;
	}
	uff58_take(&text->line, cells->column, width, field, sizeof(field));
	if (field[0] == '\0' || uff58_is_delimiter(&text->line))
		return UFF58_REFUSE(text, DT_E_FORMAT,
		                    "fewer numbers than announced, expected one in columns %zu-%zu",
		                    cells->column + 1, cells->column + width);
	if (!uff58_text_take_number(&text->line, cells->column, width, value))
		*value = NAN;
	cells->column += width;
	cells->next++;
	return 0;
}

int uff58_read_data(struct uff58_text *text, const struct uff58_head *head, double *value, double *time_s)
{
	size_t width = head->precision == UFF58_DOUBLE ? 20 : 13;
	size_t pairs_per_line = head->precision == UFF58_DOUBLE ? 2 : 3;
	size_t per_line = time_s ? 2 * pairs_per_line : head->precision == UFF58_DOUBLE ? UFF58_DOUBLES : 6;
	struct cells cells = {.per_line = per_line, .next = per_line};
	int error = 0;

	for (size_t k = 0; k < head->count && !error; k++) {
		if (time_s)
			error = next_cell(text, &cells, 13, &time_s[k]);
		if (!error)
			error = next_cell(text, &cells, width, &value[k]);
		if (!error && time_s && !(isfinite(time_s[k]) && (k == 0 || time_s[k] > time_s[k - 1])))
			error = UFF58_REFUSE(text, DT_E_FORMAT,
			                     "time %g after %g, expected times that increase", time_s[k],
			                     k ? time_s[k - 1] : 0.0);
	}
	return error;
}

/* Format (I6,1A1,I6,I6,I12,I12,I6,I6,I12,I12): "    58b     1     2          11       20000 ..." */
int uff58_read_binary(struct uff58_text *text, struct uff58_binary *binary)
{
	int order, format, lines, bytes;

	if (!uff58_text_take_whole(&text->line, 7, 6, &order) ||
	    !uff58_text_take_whole(&text->line, 13, 6, &format) ||
	    !uff58_text_take_whole(&text->line, 19, 12, &lines) ||
	    !uff58_text_take_whole(&text->line, 31, 12, &bytes))
		return UFF58_REFUSE(text, DT_E_FORMAT,
		                    "58b without byte order, format, lines and bytes in their columns");
	if ((order != 1 && order != 2) || format != 2 || lines != 11 || bytes < 0)
		return UFF58_REFUSE(
		        text, DT_E_FORMAT,
		        "58b with byte order %d, format %d, %d lines, expected 1 or 2, 2 (IEEE), 11", order,
		        format, lines);
	*binary = (struct uff58_binary){.big = order == 2, .bytes = (size_t)bytes};
	return 0;
}

int uff58_read_bytes(struct uff58_text *text, const struct uff58_head *head,
                     const struct uff58_binary *binary, double *value)
{
	enum bytes_kind kind = head->precision == UFF58_DOUBLE ? BYTES_F64 : BYTES_F32;
	size_t size = bytes_size(kind), room = text->source->size - text->line.next;

	if (!head->even)
		return UFF58_REFUSE(text, DT_E_FORMAT,
		                    "\"%.32s\" is binary with uneven times, expected even ones", head->id[0]);
	if (binary->bytes != head->count * size || binary->bytes > room)
		return UFF58_REFUSE(
		        text, DT_E_FORMAT,
		        "\"%.32s\" has %zu samples of %zu bytes, 58b says %zu bytes and %zu are there",
		        head->id[0], head->count, size, binary->bytes, room);
	for (size_t k = 0; k < head->count; k++) {
		value[k] = bytes_value(text->source->bytes + text->line.next + k * size, kind, binary->big);
		record_seen(k, size + sizeof(*value));
	}
	return 0;
}

void uff58_skip_bytes(struct uff58_text *text, size_t data, const struct uff58_binary *binary)
{
	size_t room = text->source->size - data;

	text->line.next = data + (binary->bytes < room ? binary->bytes : room);
}

bool uff58_is(const struct source *source)
{
	struct source_line line = {0};
	int number;

	return source_next_line(source, &line) && uff58_is_delimiter(&line) && line.length >= 6 &&
	       line.text[4] == '-' && source_next_line(source, &line) && line.length >= 6 &&
	       line.text[5] != ' ' && uff58_text_take_whole(&line, 0, 6, &number);
}
