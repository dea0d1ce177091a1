/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/row.h"

#include <string.h>

static bool row_is_blank(char c)
{
	return c == ' ' || c == '\t';
}

void row_learn(struct row_shape *shape, struct cells_style style, const struct cells *cells,
               const struct columns *columns)
{
	const struct piece first = cells->cell[0];
	const char *behind = first.text + first.length;

	*shape = (struct row_shape){.separator = style.separator, .decimal = cells->decimal};
	if (cells->count != columns->count || (style.separator == 0 && cells->decimal == ','))
		return;
	/* a line of blanks, commas and semicolons goes by the first that is there */
	if (style.separator == 0 && cells->count > 1)
		shape->separator = row_is_blank(*behind) ? ' ' : *behind;
	if (cells->count > 1 && (*behind == '"' || (*behind != shape->separator && !row_is_blank(*behind))))
		return;
	shape->tabs = shape->separator == ' ';
	for (size_t i = 0; i < columns->count; i++) {
		if (columns->column[i].is_clock)
			return;
		shape->wanted[i] = columns->column[i].kind != COLUMN_SKIP;
	}
	shape->count = columns->count;
}

static const char *skip(const struct row_shape *shape, const char *at, const char *end)
{
	if (shape->separator == '\t')
		return at;
	while (at < end && (*at == ' ' || (shape->tabs && *at == '\t')))
		at++;
	return at;
}

/* Over a cell that nobody wants; NULL where it is not plain where it ends. */
static const char *row_word(const struct row_shape *shape, const char *at, const char *end)
{
	while (at<end && * at> ' ' && *at != '"' && *at != ',' && *at != ';')
		at++;
	return at < end && (*at == shape->separator || *at == '\r' || *at == '\n') ? at : NULL;
}

/* Behind the cell that begins at `at`; NULL where it is not as wanted. */
static const char *row_cell(const struct row_shape *shape, size_t i, const char *at, const char *end,
                            struct row *row)
{
	row->cell[i].text = at;
	if (shape->wanted[i]) {
		const size_t length = number_scan(at, end, shape->decimal, &row->number[i]);

		at = length > 0 ? at + length : NULL;
	} else {
		at = row_word(shape, at, end);
	}
	if (at != NULL)
		row->cell[i].length = (size_t)(at - row->cell[i].text);
	return at;
}

bool row_read(const struct row_shape *shape, const char *text, const char *end, struct row *row)
{
	const char *at = skip(shape, text, end);

	if (shape->count == 0)
		return false;
	for (size_t i = 0; i < shape->count; i++) {
		const char *behind;

		at = row_cell(shape, i, at, end, row);
		if (at == NULL)
			return false;
		behind = skip(shape, at, end);
		if (i + 1 < shape->count && !shape->tabs) {
			if (behind == end || *behind != shape->separator)
				return false;
			behind = skip(shape, behind + 1, end);
		} else if (i + 1 < shape->count && behind == at) {
			return false;
		}
		at = behind;
	}
	row->end = at;
	if (at < end && *at == '\r')
		at++;
	row->next = at + 1;
	return at < end && *at == '\n';
}
