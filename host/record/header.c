/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/header.h"

#include <string.h>

/* As much of a name as a message has room for. */
enum { SHOWN = 60 };

static bool are_units(const struct cells *cells)
{
	bool any = false;

	for (size_t i = 0; i < cells->count && i < CELLS_MAX; i++) {
		if (cells->cell[i].length == 0)
			continue;
		if (!unit_find(cells->cell[i].text, cells->cell[i].length))
			return false;
		any = true;
	}
	return any;
}

static bool header_has_name(const struct cells *cells)
{
	double value;

	for (size_t i = 0; i < cells->count && i < CELLS_MAX; i++)
		if (piece_has_letter(cells->cell[i]) && !cells_number(cells, i, &value))
			return true;
	return false;
}

void header_offer(struct header *header, struct cells_style style, const struct columns *columns,
                  const struct source_line *line)
{
	const char *text = line->text;
	size_t length = line->length;

	while (length > 0 && (*text == '#' || *text == '%' || *text == ' ')) {
		text++;
		length--;
	}
	if (length == 0 || !cells_names(style, text, length, columns->count, &header->work))
		return;
	if (are_units(&header->work)) {
		header->units = header->work;
		header->units_line = line->number;
	} else if (header_has_name(&header->work)) {
		header->names = header->work;
		header->names_line = line->number;
	}
}

static enum unit_kind kind_of(const struct column *column)
{
	return column->kind == COLUMN_TIME ? UNIT_TIME : UNIT_ACCELERATION;
}

int header_check_unit(const struct columns *columns, size_t i, struct piece said, const struct unit *unit,
                      const char *file, uint64_t line, char message[READ_MESSAGE_MAX])
{
	const struct column *column = &columns->column[i];
	bool minutes = unit && unit->kind == UNIT_TIME && unit->divisor < 1; /* or a minimum */

	if (!unit || column->kind == COLUMN_SKIP || unit_same(unit, column->unit) ||
	    (minutes && column->kind == COLUMN_CHANNEL) ||
	    (unit->kind == UNIT_MULTIPLE && column->has_factor))
		return 0;
	if (unit->kind == UNIT_MULTIPLE)
		return source_refuse(
		        message, DT_E_FORMAT, file, line,
		        "column %zu, \"%.*s\", is in a number of units or tells a range, expected a "
		        "factor in --columns, %s:%s*1 or another",
		        i + 1, (int)(said.length < SHOWN ? said.length : SHOWN), said.text, column->name,
		        column->unit->name);
	return source_refuse(message, DT_E_FORMAT, file, line,
	                     "column %zu, \"%.*s\", is in %s, but --columns says %s:%s, expected one unit",
	                     i + 1, (int)(said.length < SHOWN ? said.length : SHOWN), said.text, unit->name,
	                     column->name, column->unit->name);
}

int header_check(const struct header *header, const struct columns *columns, const char *file,
                 char message[READ_MESSAGE_MAX])
{
	int error = 0;

	for (size_t i = 0; i < columns->count && !error; i++) {
		const struct piece *cell = &header->units.cell[i];

		if (header->units.count > 0)
			error = header_check_unit(columns, i, *cell, unit_find(cell->text, cell->length),
			                          file, header->units_line, message);
		cell = &header->names.cell[i];
		if (!error && header->names.count > 0)
			error = header_check_unit(
			        columns, i, *cell,
			        unit_of_name(cell->text, cell->length, kind_of(&columns->column[i])), file,
			        header->names_line, message);
	}
	return error;
}

static bool is_channel(const struct columns *columns, size_t i)
{
	return columns->column[i].kind == COLUMN_CHANNEL;
}

bool header_has_twins(const struct header *header, const struct columns *columns)
{
	const struct piece *cell = header->names.cell;

	for (size_t i = 0; i < header->names.count; i++)
		for (size_t k = 0; k < i && is_channel(columns, i); k++)
			if (is_channel(columns, k) && cell[i].length > 0 &&
			    cell[i].length == cell[k].length &&
			    memcmp(cell[i].text, cell[k].text, cell[i].length) == 0)
				return true;
	return false;
}
