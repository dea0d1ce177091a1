/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Ground motion of PEER (.AT2): title lines, one with UNITS OF an acceleration, one with NPTS and DT in one
 * of four spellings, then numbers, as many as that says.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/record/cells.h"
#include "host/record/table_data.h"

enum { AT2_HEAD_LINES = 12 };

struct at2 {
	size_t points;
	double step_s;
	const struct unit *unit; /* NULL: of no acceleration */
	struct source_line line; /* of NPTS: numbers follow */
};

/* What a line says behind UNITS OF, a blank or a comma ends it. */
static const struct unit *at2_unit(const struct source_line *line)
{
	static const char before[] = "UNITS OF ";
	const char *word = memmem(line->text, line->length, before, sizeof(before) - 1);
	const struct unit *unit = NULL;
	size_t length = 0, left;

	if (word != NULL) {
		word += sizeof(before) - 1;
		left = line->length - (size_t)(word - line->text);
		while (length < left && !strchr(" \t,;\r", word[length]))
			length++;
		length -= length > 0 && word[length - 1] == '.';
		unit = unit_find(word, length);
	}
	return unit != NULL && unit->kind == UNIT_ACCELERATION ? unit : NULL;
}

/* The two numbers of a line in order, and the unit of time that is told, else seconds. Returns the numbers.
 */
static size_t at2_numbers(const struct source_line *line, double value[2], const struct unit **time_unit)
{
	size_t found = 0;

	*time_unit = unit_find("s", 1);
	for (size_t at = 0; at < line->length;) {
		const struct unit *unit;
		size_t end = at;

		while (end < line->length && !strchr(" \t\r,=.", line->text[end]))
			end++;
		unit = unit_find(line->text + at, end - at);
		while (end < line->length && !strchr(" \t\r,=", line->text[end]))
			end++;
		if (unit != NULL && unit->kind == UNIT_TIME)
			*time_unit = unit;
		else if (found < 2)
			found += end > at && number_parse(line->text + at, end - at, '.', &value[found]);
		at = end + 1;
	}
	return found;
}

static bool at2_head(const struct source *source, struct at2 *at2)
{
	struct source_line line = {0};
	double value[2] = {0, 0};

	while (line.number < AT2_HEAD_LINES && source_next_line(source, &line)) {
		struct piece text = {line.text, line.length};
		const struct unit *time_unit;

		at2->unit = at2->unit != NULL ? at2->unit : at2_unit(&line);
		if (!piece_has(text, "NPTS") || !piece_has(text, "DT"))
			continue;
		at2->line = line;
		if (at2_numbers(&line, value, &time_unit) == 2 && value[0] >= 2 && value[0] < 1e9 &&
		    value[1] > 0) {
			at2->points = (size_t)value[0];
			at2->step_s = value[1] / time_unit->divisor;
		}
		return true;
	}
	return false;
}

bool at2_is(const struct source *source)
{
	struct at2 at2 = {.points = 0};

	return at2_head(source, &at2);
}

int read_at2(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct at2 at2 = {.points = 0};
	struct source_line line;
	struct table_column *column;
	struct cells cells;
	size_t used = 0;

	(void)at2_head(source, &at2);
	table->format = "at2";
	line = at2.line;
	if (at2.points == 0 || at2.points > source->size)
		return source_refuse(
		        message, DT_E_FORMAT, source->file, line.number,
		        "NPTS and DT without a count and a step, expected \"NPTS= 4000, DT= .005 SEC\"");
	if (at2.unit == NULL)
		return source_refuse(
		        message, DT_E_FORMAT, source->file, 0,
		        "ground motion without UNITS OF an acceleration, expected UNITS OF G or another");
	column = table_data_add(table, at2.points);
	if (column == NULL)
		return source_no_memory(message, source->file);
	snprintf(column->name, sizeof(column->name), "acceleration");
	snprintf(column->unit, sizeof(column->unit), "%s", at2.unit->name);
	column->rate_hz = 1 / at2.step_s;
	while (source_next_line(source, &line)) {
		cells_split((struct cells_style){' ', '.'}, line.text, line.length, &cells);
		for (size_t i = 0; i < cells.count; i++, used++) {
			if (i < CELLS_MAX && used < at2.points &&
			    cells_number(&cells, i, &column->value[used]))
				continue;
			if (cells.count == 1 && cells.cell[0].length == 0) {
				used--;
				continue;
			}
			return source_refuse(
			        message, DT_E_FORMAT, source->file, line.number,
			        "\"%.*s\" as number %zu, expected %zu numbers",
			        i < CELLS_MAX && cells.cell[i].length < 40 ? (int)cells.cell[i].length : 0,
			        cells.cell[i < CELLS_MAX ? i : 0].text, used + 1, at2.points);
		}
	}
	if (used == at2.points)
		return 0;
	return source_refuse(message, DT_E_FORMAT, source->file, 0,
	                     "%zu numbers, expected NPTS = %zu: the file is cut", used, at2.points);
}
