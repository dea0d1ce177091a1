/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/sniff_private.h"

#include <stdio.h>

enum { SPEC_MAX = 150 };

/* ---- names and units ---- */

bool sniff_is_time(struct piece name)
{
	static const char *const words[] = {"time", "zeit", "temps",     "tiempo",  "tempo",
	                                    "tid",  "tijd", "timestamp", "elapsed", "x_value"};

	if (name.length == 1)
		return name.text[0] == 't';
	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		size_t length = strlen(words[i]);

		if (sniff_begins(name, words[i]) &&
		    (name.length == length || !sniff_is_letter(name.text[length])))
			return true;
	}
	return name.length > 1 && name.text[0] == 't' && !sniff_is_letter(name.text[1]);
}

bool sniff_is_acceleration(struct piece name)
{
	return piece_has(name, "acc") || piece_has(name, "beschl") || piece_has(name, "shock") ||
	       piece_has(name, "vib") || piece_has(name, "impact") ||
	       (sniff_begins(name, "a") && (name.length == 1 || !sniff_is_letter(name.text[1]) ||
	                                    (name.length == 2 && strchr("xyzXYZ", name.text[1]))));
}

/* Of a mass, or of a magnetic field, which is in gauss. */
static bool is_of_other(struct piece name)
{
	const bool field =
	        sniff_begins(name, "mag") &&
	        (name.length == 3 || !sniff_is_letter(name.text[3]) ||
	         (strchr("xyzXYZ", name.text[3]) && (name.length == 4 || !sniff_is_letter(name.text[4]))));

	return field || piece_has(name, "magnet") || piece_has(name, "compass") || piece_has(name, "mass") ||
	       piece_has(name, "weight") || piece_has(name, "gewicht") || piece_has(name, "load") ||
	       piece_has(name, "tare") || piece_has(name, "poids") || piece_has(name, "masse");
}

/* The unit of a label like "t/ms" or "a/(m/s2)", a quantity over its unit (ISO 80000-1), and its stem; NULL
 * for another, so that "mV/g" and "counts/s" are none. */
static const struct unit *unit_quotient(struct piece name, struct piece *stem)
{
	size_t at = 0;
	const struct unit *unit;

	while (at < name.length && name.text[at] != '/')
		at++;
	if (at == 0 || at + 1 >= name.length)
		return NULL;
	*stem = (struct piece){name.text, at};
	unit = unit_in_bracket(name.text + at + 1, name.length - at - 1);
	if (unit == NULL)
		unit = unit_find(name.text + at + 1, name.length - at - 1);
	if (unit == NULL)
		return NULL;
	return (unit->kind == UNIT_TIME && sniff_is_time(*stem)) ||
	                       (unit->kind == UNIT_ACCELERATION && sniff_is_acceleration(*stem))
	               ? unit
	               : NULL;
}

/* A name without the unit in brackets, or the word that is one, behind it. */
struct piece sniff_stem(struct piece name)
{
	struct piece stem;

	if (unit_quotient(name, &stem) != NULL)
		return stem;
	for (size_t at = name.length; at-- > 1;)
		if (name.text[at] == '(' || name.text[at] == '[') {
			const struct unit *unit = unit_in_bracket(name.text + at, name.length - at);

			if (unit != NULL)
				name.length = at;
			break;
		}
	for (size_t at = name.length; at-- > 1;)
		if (strchr(" \t,_", name.text[at]) != NULL) {
			const struct unit *unit = unit_find(name.text + at + 1, name.length - at - 1);

			if (unit != NULL && unit->kind <= UNIT_ACCELERATION)
				name.length = at;
			break;
		}
	while (name.length > 0 && strchr(" \t-,:", name.text[name.length - 1]))
		name.length--;
	if (name.length > 3 && memcmp(name.text + name.length - 3, " in", 3) == 0) /* "acceleration in g" */
		name.length -= 3;
	return name;
}

/* A unit of grams is one of g where nothing speaks of a mass; a bare letter in a name is one where it is
 * small, or the name is an acceleration's. */
static const struct unit *trusted(const struct unit *unit, struct piece name, struct piece told)
{
	bool gram = unit->kind == UNIT_ACCELERATION &&
	            (strcmp(unit->name, "g") == 0 || strcmp(unit->name, "mg") == 0 ||
	             strcmp(unit->name, "ug") == 0 || strcmp(unit->name, "kilo-g") == 0);
	bool capital = name.length > 0 && told.length == 0 && name.text[name.length - 1] == 'G';

	if (unit->kind == UNIT_TIME && unit->divisor < 1 && !sniff_is_time(name)) /* a minimum, a height */
		return NULL;
	if (!gram)
		return unit;
	if (is_of_other(name) || (strcmp(unit->name, "g") != 0 && !sniff_is_acceleration(name)))
		return NULL;
	return capital && !sniff_is_acceleration(name) ? NULL : unit;
}

static bool unit_alone(struct piece name)
{
	return unit_find(name.text, name.length) != NULL;
}

/* The unit of a column by its name and by the line of units; *two where they are not one. */
static const struct unit *sniff_unit(struct piece name, struct piece told, bool *two)
{
	const struct unit *by_name = NULL, *by_told = NULL;
	struct piece stem;

	if (name.length > 0 && !unit_alone(name)) {
		by_name = unit_quotient(name, &stem);
		if (by_name == NULL)
			by_name = unit_of_name(name.text, name.length,
			                       sniff_is_time(name) ? UNIT_TIME : UNIT_ACCELERATION);
		if (by_name == NULL)
			by_name = unit_of_name(name.text, name.length, UNIT_TIME);
		by_name = by_name != NULL ? trusted(by_name, name, told) : NULL;
	}
	if (told.length > 0)
		by_told = unit_find(told.text, told.length);
	by_told = by_told != NULL ? trusted(by_told, name, told) : NULL;
	*two = by_name != NULL && by_told != NULL && !unit_same(by_name, by_told);
	return by_told != NULL ? by_told : by_name;
}

enum { NUMBER_ROOM = 5 }; /* "_123" */

/* Ends a name that may have been cut within a character of several bytes, or before a blank. */
static size_t end_name(char *name, size_t length)
{
	size_t behind = 0, wanted;
	unsigned char first;

	while (behind < length && ((unsigned char)name[length - 1 - behind] & 0xC0) == 0x80)
		behind++;
	first = behind < length ? (unsigned char)name[length - 1 - behind] : 0;
	wanted = first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : first >= 0xC0 ? 1 : 0;
	if (behind != wanted)
		length -= behind + (wanted > 0);
	while (length > 0 && name[length - 1] == ' ')
		length--;
	name[length] = '\0';
	return length;
}

static void take_name(struct columns *columns, size_t i, struct piece name)
{
	struct column *column = &columns->column[i];
	size_t used = 0;

	for (size_t k = 0; k < name.length && used + 1 < sizeof(column->name); k++) {
		char c = name.text[k];

		column->name[used++] = strchr(",:@*\"", c) || (unsigned char)c < ' ' ? '_' : c;
	}
	used = end_name(column->name, used);
	if (used == 0 || strcmp(column->name, "time") == 0)
		snprintf(column->name, sizeof(column->name), "column_%zu", i + 1);
}

static bool is_taken(const struct columns *columns, size_t i)
{
	for (size_t k = 0; k < i; k++)
		if (columns->column[k].kind == COLUMN_CHANNEL &&
		    strcmp(columns->column[k].name, columns->column[i].name) == 0)
			return true;
	return false;
}

static void take_channel(struct sniff *sniff, size_t i, const struct unit *unit)
{
	struct column *column = &sniff->columns.column[i];
	struct piece stem = sniff_stem(sniff->name[i]);

	column->kind = COLUMN_CHANNEL;
	column->unit = unit;
	column->divisor = unit->divisor;
	take_name(&sniff->columns, i, stem);
	if (is_taken(&sniff->columns, i)) {
		sniff->twins = true;
		if (strlen(column->name) + NUMBER_ROOM > sizeof(column->name))
			end_name(column->name, sizeof(column->name) - NUMBER_ROOM);
		snprintf(column->name + strlen(column->name), NUMBER_ROOM, "_%zu", (i + 1) % 1000);
	}
	sniff->columns.channels++;
}

/* The spec that a user could give, with ? where the file does not say. */
static void suggest(const struct sniff *sniff, size_t time, const char *time_unit, bool all,
                    char spec[SPEC_MAX])
{
	size_t used = 0;

	spec[0] = '\0';
	for (size_t i = 0; i < sniff->columns.count && used + 1 < SPEC_MAX; i++) {
		const struct column *column = &sniff->columns.column[i];
		struct piece stem = sniff_stem(sniff->name[i]);
		const char *comma = i > 0 ? "," : "";
		int put;

		if (i == time)
			put = snprintf(spec + used, SPEC_MAX - used, "%stime:%s", comma, time_unit);
		else if (column->kind == COLUMN_CHANNEL || (all && stem.length > 0))
			put = snprintf(spec + used, SPEC_MAX - used, "%s%.*s:%s", comma,
			               (int)(stem.length < 20 ? stem.length : 20), stem.text,
			               column->unit != NULL ? column->unit->name : "g");
		else if (all)
			put = snprintf(spec + used, SPEC_MAX - used, "%sa%zu:g", comma, i + 1);
		else
			put = snprintf(spec + used, SPEC_MAX - used, "%s-", comma);
		used += put > 0 ? (size_t)put : 0;
	}
}

/* ---- the time column ---- */

static void offer_time(struct sniff_times *times, size_t i, const struct unit *unit)
{
	times->unit[i] = unit;
	if (times->count == 0)
		times->first = i;
	else
		times->second = i;
	times->count++;
}

static int settle_time(struct sniff *sniff, const struct sniff_times *times, const char *file, char *message)
{
	struct column *column = &sniff->columns.column[times->first];
	char one[SPEC_MAX], other[SPEC_MAX];

	if (times->count > 1) {
		suggest(sniff, times->first,
		        times->unit[times->first] ? times->unit[times->first]->name : "ms", false, one);
		suggest(sniff, times->second,
		        times->unit[times->second] ? times->unit[times->second]->name : "ms", false, other);
		return source_refuse(message, DT_E_FORMAT, file, 0,
		                     "%zu columns could be the time, expected --columns \"%s\" or \"%s\"",
		                     times->count, one, other);
	}
	if (times->count == 0)
		return 0;
	*column = (struct column){.kind = COLUMN_TIME, .name = "time", .unit = times->unit[times->first]};
	sniff->time_unit_open = column->unit == NULL;
	if (column->unit == NULL)
		column->unit = unit_find("s", 1);
	column->is_clock = strcmp(column->unit->name, "clock") == 0;
	column->divisor = column->unit->divisor;
	sniff->columns.has_time = true;
	return 0;
}

static int refuse_no_channel(struct sniff *sniff, const struct sniff_times *times, bool has_rate,
                             const char *file, char *message)
{
	char one[SPEC_MAX], other[SPEC_MAX];
	size_t time = times->count > 0 ? times->first : has_rate ? sniff->columns.count : 0;
	const struct unit *unit = times->count > 0 ? times->unit[times->first] : NULL;

	suggest(sniff, time, unit != NULL ? unit->name : "s", true, one);
	suggest(sniff, time, "ms", true, other);
	if (unit != NULL || has_rate)
		return source_refuse(
		        message, DT_E_FORMAT, file, 0,
		        "no column tells a unit of acceleration, expected --columns \"%s\" or with m/s2 "
		        "or another",
		        one);
	return source_refuse(
	        message, DT_E_FORMAT, file, 0,
	        "neither the unit of time nor one of acceleration is told, expected --columns \"%s\" or "
	        "\"%s\"",
	        one, other);
}

static int refuse_no_time(struct sniff *sniff, const char *file, char *message)
{
	char one[SPEC_MAX], other[SPEC_MAX];

	sniff->columns.has_time = false;
	suggest(sniff, 0, "s", false, one);
	suggest(sniff, sniff->columns.count, "s", false, other);
	return source_refuse(
	        message, DT_E_FORMAT, file, 0,
	        "no column is named as time and no rate is told, expected --columns \"%s\", or \"%s@HZ\"",
	        one, other);
}

int sniff_settle_names(struct sniff *sniff, const struct piece *units, struct sniff_times *times,
                       bool has_rate, const char *file, char *message)
{
	struct columns *columns = &sniff->columns;
	size_t frequency = columns->count;
	int error;

	for (size_t i = 0; i < columns->count; i++) {
		bool two;
		const struct unit *unit =
		        sniff_unit(sniff->name[i], units != NULL ? units[i] : (struct piece){0}, &two);

		if (two)
			return source_refuse(
			        message, DT_E_FORMAT, file, 0,
			        "column %zu, \"%.*s\", has another unit in its name than in the line of "
			        "units, expected --columns",
			        i + 1,
			        (int)(sniff->name[i].length < SNIFF_SHOWN ? sniff->name[i].length
			                                                  : SNIFF_SHOWN),
			        sniff->name[i].text);
		if (unit != NULL && unit->kind == UNIT_ACCELERATION)
			take_channel(sniff, i, unit);
		if (unit != NULL && unit_hertz(unit) > 0 && times->can[i] && times->grows[i])
			frequency = i;
		if (sniff_is_time(sniff->name[i]) && !has_rate)
			times->can[i] = true; /* where it goes back is told when it is read */
		if (times->can[i] && ((unit != NULL && unit->kind == UNIT_TIME) || times->unit[i] != NULL ||
		                      (unit == NULL && sniff_is_time(sniff->name[i]))))
			offer_time(times, i, times->unit[i] != NULL ? times->unit[i] : unit);
	}
	if (columns->channels == 0)
		return refuse_no_channel(sniff, times, has_rate, file, message);
	if (!has_rate || times->count == 1) {
		error = settle_time(sniff, times, file, message);
		if (error)
			return error;
	}
	if (!columns->has_time && frequency < columns->count)
		return source_refuse(message, DT_E_FORMAT, file, 0,
		                     "column %zu, \"%.*s\", is a frequency and increases from row to row: a "
		                     "spectrum, expected a recording over time",
		                     frequency + 1,
		                     (int)(sniff->name[frequency].length < SNIFF_SHOWN
		                                   ? sniff->name[frequency].length
		                                   : SNIFF_SHOWN),
		                     sniff->name[frequency].text);
	return columns->has_time || has_rate ? 0 : refuse_no_time(sniff, file, message);
}

int sniff_names(struct sniff *sniff, size_t count, const struct piece *units, bool has_rate, const char *file,
                char message[READ_MESSAGE_MAX])
{
	struct sniff_times times = {.count = 0};

	sniff->columns.count = count;
	for (size_t i = 0; i < count; i++)
		times.can[i] = !has_rate;
	return sniff_settle_names(sniff, units, &times, has_rate, file, message);
}
