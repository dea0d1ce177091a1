/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/columns.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/units.h"
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

static struct piece columns_unbracket(struct piece piece)
{
	if (piece.length >= 2 && piece.text[0] == '(' && piece.text[piece.length - 1] == ')')
		return columns_trim((struct piece){piece.text + 1, piece.length - 2});
	return piece;
}

/* A sensitivity as "10.2mV/g": volts or coulombs for a g. */
static bool columns_sensitivity(struct piece text, const struct unit *electric, double *divisor)
{
	struct piece per = columns_unbracket(text), number = columns_cut(&per, '/');
	const struct unit *of, *acceleration = unit_find(per.text, per.length);
	size_t digits = number.length;
	double value;

	while (digits > 0 && number.text[digits - 1] != '.' &&
	       !(number.text[digits - 1] >= '0' && number.text[digits - 1] <= '9'))
		digits--;
	of = unit_find(number.text + digits, number.length - digits);
	if (of == NULL || acceleration == NULL || acceleration->kind != UNIT_ACCELERATION ||
	    !(electric->scale > 0) || !(of->scale > 0) ||
	    (electric->name[1] == 'C') != (of->name[1] == 'C') ||
	    !number_parse(number.text, digits, '.', &value) || !(value > 0))
		return false;
	*divisor = value * of->scale / electric->scale * acceleration->divisor;
	return true;
}

/* "m/s2", "kg*1.02", "mV/(10.2mV/g)". */
static bool columns_take_unit(struct column *column, struct piece text)
{
	struct piece factor = text, unit = columns_trim(columns_cut(&factor, '*')), rest = unit, plain;
	double value = 1;

	if (factor.text != NULL) {
		factor = columns_trim(factor);
		if (!number_parse(factor.text, factor.length, '.', &value) || !(value > 0))
			return false;
	}
	column->unit = unit_find(unit.text, unit.length);
	plain = columns_trim(columns_cut(&rest, '/'));
	if (column->unit == NULL && rest.text != NULL && column->kind == COLUMN_CHANNEL) {
		column->unit = unit_find(plain.text, plain.length);
		return column->unit != NULL && factor.text == NULL &&
		       columns_sensitivity(rest, column->unit, &column->divisor);
	}
	if (column->unit == NULL ||
	    column->unit->kind != (column->kind == COLUMN_TIME ? UNIT_TIME : UNIT_ACCELERATION))
		return false;
	column->is_clock = strcmp(column->unit->name, "clock") == 0;
	column->divisor = column->unit->divisor / value;
	column->has_factor = factor.text != NULL;
	return true;
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
	if (!columns_take_unit(column, unit))
		return columns_refuse(message, entry,
		                      column->kind == COLUMN_TIME
		                              ? "unit s, ms, us, ns or clock"
		                              : "unit g, m/s2, -g or -m/s2, kg for kilo-g, g*FACTOR, "
		                                "mV/(10.2mV/g)");
	column->divisor *= sign;
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

void columns_text(const struct columns *columns, char *text, size_t size)
{
	size_t used = 0;

	text[0] = '\0';
	for (size_t i = 0; i < columns->count && used + 1 < size; i++) {
		const struct column *column = &columns->column[i];
		const char *unit = column->unit == NULL ? "?" : column->unit->name;
		const char *comma = i > 0 ? "," : "";
		int put = column->kind == COLUMN_SKIP
		                  ? snprintf(text + used, size - used, "%s-", comma)
		                  : snprintf(text + used, size - used, "%s%s:%s%s", comma, column->name,
		                             column->divisor < 0 ? "-" : "", unit);

		used += put > 0 ? (size_t)put : 0;
		if (used < size && column->has_factor) {
			put = snprintf(text + used, size - used, "*%.9g",
			               column->unit->divisor / fabs(column->divisor));
			used += put > 0 ? (size_t)put : 0;
		}
		if (used < size && columns->rate_hz > 0 && column->kind == COLUMN_CHANNEL) {
			put = snprintf(text + used, size - used, "@%.9g", columns->rate_hz);
			used += put > 0 ? (size_t)put : 0;
		}
	}
}
