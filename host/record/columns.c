/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/columns.h"

#include <string.h>

#include "host/record/cells.h"
#include "common/base/number.h"
#include "host/record/source.h"

static int columns_refuse(char *message, struct piece entry, const char *expected)
{
	return source_refuse(message, DT_E_ARGUMENT, "--columns", 0, "\"%.*s\", expected %s",
	                     (int)(entry.length < 80 ? entry.length : 80), entry.text, expected);
}

/* Cuts *rest at the first separator: what is before it is returned, *rest is what is behind, or NULL. */
static struct piece columns_cut(struct piece *rest, char separator)
{
	struct piece piece = *rest;
	const char *end = memchr(rest->text, separator, rest->length);

	if (!end) {
		*rest = (struct piece){0};
		return piece;
	}
	piece.length = (size_t)(end - piece.text);
	rest->text = end + 1;
	rest->length -= piece.length + 1;
	return piece;
}

static bool columns_is_blank(char c)
{
	return c == ' ' || c == '\t';
}

/* Without the blanks around it. */
static struct piece columns_trim(struct piece piece)
{
	while (piece.length > 0 && columns_is_blank(piece.text[piece.length - 1]))
		piece.length--;
	while (piece.length > 0 && columns_is_blank(piece.text[0])) {
		piece.text++;
		piece.length--;
	}
	return piece;
}

/* A kg is a mass, unless it stands in a file of accelerations. */
static const struct unit *unit_of(enum column_kind kind, struct piece text)
{
	const struct unit *unit = unit_find(text.text, text.length);

	if (!unit || unit->kind != (kind == COLUMN_TIME ? UNIT_TIME : UNIT_ACCELERATION) || unit->divisor < 1)
		return NULL;
	return unit;
}

static bool columns_can_name(struct piece name)
{
	for (size_t i = 0; i < name.length; i++)
		if ((unsigned char)name.text[i] < ' ')
			return false;
	return name.length > 0 && name.length < sizeof(((struct column *)NULL)->name);
}

static bool columns_has_name(const struct columns *columns, const char *name)
{
	for (size_t i = 0; i < columns->count; i++)
		if (columns->column[i].kind == COLUMN_CHANNEL && strcmp(columns->column[i].name, name) == 0)
			return true;
	return false;
}

static int parse_rate(struct columns *columns, struct piece entry, struct piece rate, char *message)
{
	double rate_hz;

	if (!number_parse(rate.text, rate.length, '.', &rate_hz) || rate_hz <= 0)
		return columns_refuse(message, entry, "a rate in Hz behind @");
	if (columns->rate_hz != 0 && columns->rate_hz != rate_hz)
		return columns_refuse(message, entry, "one rate for all columns, they share their rows");
	columns->rate_hz = rate_hz;
	return 0;
}

static int parse_entry(struct columns *columns, struct piece entry, char *message)
{
	struct column *column = &columns->column[columns->count];
	struct piece rate = entry, unit = columns_cut(&rate, '@'),
	             name = columns_trim(columns_cut(&unit, ':'));
	double sign = 1;

	*column = (struct column){.kind = COLUMN_SKIP};
	if (entry.length == 1 && entry.text[0] == '-')
		return 0;
	if (!columns_can_name(name) || !unit.text)
		return columns_refuse(message, entry,
		                      "name:unit with a name of 1 to 31 characters, or - to skip a column");
	memcpy(column->name, name.text, name.length);
	column->kind = COLUMN_CHANNEL;
	unit = columns_trim(unit);
	if (strcmp(column->name, "time") == 0 && !columns->has_time)
		column->kind = COLUMN_TIME;
	if (column->kind == COLUMN_CHANNEL && unit.length > 0 && unit.text[0] == '-') {
		sign = -1;
		unit = columns_trim((struct piece){unit.text + 1, unit.length - 1});
	}
	column->unit = unit_of(column->kind, unit);
	if (!column->unit)
		return columns_refuse(message, entry,
		                      column->kind == COLUMN_TIME ? "unit s, ms or us"
		                                                  : "unit g, m/s2, -g or -m/s2");
	column->divisor = sign * column->unit->divisor;
	if (columns_has_name(columns, column->name))
		return columns_refuse(message, entry, "every name once");
	columns->has_time |= column->kind == COLUMN_TIME;
	columns->channels += column->kind == COLUMN_CHANNEL;
	return rate.text ? parse_rate(columns, entry, columns_trim(rate), message) : 0;
}

int columns_parse(struct columns *columns, const char *text, char message[READ_MESSAGE_MAX])
{
	struct piece all = {text, strlen(text)}, rest = all;
	struct columns parsed = {.count = 0};

	while (rest.text) {
		struct piece entry = columns_trim(columns_cut(&rest, ','));
		int error;

		if (parsed.count == COLUMNS_MAX)
			return columns_refuse(message, entry, "no more than 256 columns");
		error = parse_entry(&parsed, entry, message);
		if (error)
			return error;
		parsed.count++;
	}
	if (parsed.channels == 0)
		return columns_refuse(message, all, "at least one channel, name:g or name:m/s2");
	if (parsed.has_time && parsed.rate_hz != 0)
		return columns_refuse(message, all, "a time column or a rate, not both");
	*columns = parsed;
	return 0;
}
