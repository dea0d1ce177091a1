/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/sniff.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdarg.h>
#include <stdlib.h>
#include <strings.h>
#include <string.h>

#include "common/base/number.h"
#include "host/record/clock.h"

enum { SAMPLED = 120, HEADER_LINES_MOST = 1000, FOOTER_LINES_MOST = 100, SHOWN = 60, SPEC_MAX = 150 };

/* Of the sampled lines that must be rows; what a second reading must come near to make a doubt. */
static const double ROWS_PART = 0.9, NEAR = 0.05;

static const char separators[SNIFF_SEPARATORS] = {'\t', ';', ',', '|', ' '};

struct candidate {
	struct cells_style style;
	size_t columns, rows;
};

struct work {
	const struct source *source;
	struct source_line line[SAMPLED];
	size_t lines;
	struct cells cells, other;
	size_t counts[CELLS_MAX + 1];
	char *message;
};

/* ---- cells ---- */

enum cell_kind { CELL_EMPTY, CELL_NUMBER, CELL_NO_NUMBER, CELL_CLOCK, CELL_DATE, CELL_TEXT };

static bool is_word(struct piece cell, const char *words[], size_t count)
{
	for (size_t i = 0; i < count; i++)
		if (cell.length == strlen(words[i]) && strncasecmp(cell.text, words[i], cell.length) == 0)
			return true;
	return false;
}

static enum cell_kind kind_of(const struct cells *cells, size_t i)
{
	static const char *none[] = {"nan",  "-nan", "inf", "+inf", "-inf",
	                             "null", "none", "na",  "n/a",  "#n/a"};
	struct piece cell = cells->cell[i];
	double value;
	int64_t ns;
	int digits;

	if (cell.length == 0)
		return CELL_EMPTY;
	if (cells_number(cells, i, &value))
		return CELL_NUMBER;
	if (is_word(cell, none, sizeof(none) / sizeof(none[0])))
		return CELL_NO_NUMBER;
	if (cell.length >= 7 && clock_parse(cell, &ns, &digits))
		return CELL_CLOCK;
	return cell.length >= 8 && clock_is_date(cell) ? CELL_DATE : CELL_TEXT;
}

static bool is_row(const struct cells *cells)
{
	size_t numbers = 0;

	for (size_t i = 0; i < cells->count; i++) {
		enum cell_kind kind = i < CELLS_MAX ? kind_of(cells, i) : CELL_TEXT;

		if (kind == CELL_TEXT)
			return false;
		numbers += kind == CELL_NUMBER || kind == CELL_NO_NUMBER;
	}
	return numbers > 0;
}

static bool is_idle(const struct source_line *line)
{
	size_t at = 0;

	while (at < line->length && (line->text[at] == ' ' || line->text[at] == '\t'))
		at++;
	return at == line->length || line->text[at] == '#';
}

/* ---- separator and decimal sign ---- */

/* Lines of the middle, where neither header nor footer is. */
static void sample_lines(struct work *work)
{
	struct source_line line = {0};
	size_t all = 0, from, most;

	while (source_next_line(work->source, &line))
		all += !is_idle(&line);
	most = all / 3 > SAMPLED ? SAMPLED : all / 3 < 2 ? 2 : all / 3;
	from = all > most ? (all - most + 1) / 2 : 0;
	line = (struct source_line){0};
	for (size_t k = 0; work->lines < most && source_next_line(work->source, &line);)
		if (!is_idle(&line) && k++ >= from)
			work->line[work->lines++] = line;
}

static void split(struct cells_style style, const struct source_line *line, struct cells *cells)
{
	cells_split(style, line->text, line->length, cells);
}

/* How many of the sampled lines are rows of one count of columns. */
static void count_rows(struct work *work, struct candidate *candidate)
{
	memset(work->counts, 0, sizeof(work->counts));
	for (size_t k = 0; k < work->lines; k++) {
		split(candidate->style, &work->line[k], &work->cells);
		if (work->cells.count < CELLS_MAX && is_row(&work->cells))
			work->counts[work->cells.count]++;
	}
	candidate->rows = 0;
	for (size_t n = 1; n < CELLS_MAX; n++)
		if (work->counts[n] > candidate->rows) {
			candidate->rows = work->counts[n];
			candidate->columns = n;
		}
}

static bool same_cells(struct work *work, const struct candidate *a, const struct candidate *b)
{
	if (a->columns != b->columns)
		return false;
	for (size_t k = 0; k < work->lines; k++) {
		split(a->style, &work->line[k], &work->cells);
		split(b->style, &work->line[k], &work->other);
		if (work->cells.count != work->other.count)
			return false;
		for (size_t i = 0; i < work->cells.count; i++) {
			double x = 0, y = 0;
			bool is = cells_number(&work->cells, i, &x),
			     other = cells_number(&work->other, i, &y);

			if (is != other || x < y || x > y)
				return false;
		}
	}
	return true;
}

/* Fields of the last line above the rows that has text in it. */
static size_t header_fields(struct work *work, const struct candidate *candidate)
{
	struct source_line line = {0};
	size_t fields = 0;

	while (source_next_line(work->source, &line) && line.number < HEADER_LINES_MOST) {
		split(candidate->style, &line, &work->cells);
		if (work->cells.count == candidate->columns && is_row(&work->cells))
			break;
		if (line.length > 0)
			fields = work->cells.count;
	}
	return fields;
}

static const char *separator_name(char separator)
{
	return separator == '\t'  ? "tab"
	       : separator == ' ' ? "blanks"
	       : separator == ';' ? "semicolon"
	       : separator == ',' ? "comma"
	                          : "bar";
}

static int refuse_styles(struct work *work, const struct candidate *a, const struct candidate *b)
{
	return source_refuse(
	        work->message, DT_E_FORMAT, work->source->file, work->line[0].number,
	        "two readings: %zu columns between %ss with decimal '%c', or %zu between %ss with "
	        "decimal '%c', and no line of names tells which; expected --columns",
	        a->columns, separator_name(a->style.separator), a->style.decimal, b->columns,
	        separator_name(b->style.separator), b->style.decimal);
}

static int refuse_no_table(struct work *work)
{
	for (size_t k = 0; k < work->lines; k++)
		for (size_t s = 0; s < SNIFF_SEPARATORS; s++) {
			split((struct cells_style){separators[s], '.'}, &work->line[k], &work->cells);
			for (size_t i = 0; i < work->cells.count && i < CELLS_MAX; i++) {
				enum cells_oddity oddity = cells_oddity(&work->cells, i);
				struct piece cell = work->cells.cell[i];

				if (oddity != CELLS_PLAIN && work->cells.count < CELLS_MAX &&
				    cell.length < SHOWN)
					return source_refuse(work->message, DT_E_FORMAT, work->source->file,
					                     work->line[k].number,
					                     "\"%.*s\" has a %s, expected plain numbers",
					                     (int)cell.length, cell.text,
					                     oddity == CELLS_UNIT ? "unit behind its number"
					                                          : "thousands separator");
			}
		}
	return source_refuse(
	        work->message, DT_E_FORMAT, work->source->file, work->lines > 0 ? work->line[0].number : 0,
	        "not a log of a drop tower, and no table of numbers: nine in ten lines of its middle "
	        "should be rows of numbers; for other text expected --columns \"time:ms,name:g,-\"");
}

static int find_style(struct work *work, struct candidate *best)
{
	struct candidate candidate[2 * SNIFF_SEPARATORS];
	size_t count = 0;
	bool named = false;

	for (size_t k = 0; k < 2 * SNIFF_SEPARATORS; k++) {
		struct candidate now = {.style = {separators[k / 2], k % 2 ? ',' : '.'}};
		bool known = false;

		count_rows(work, &now);
		if (now.rows < 2 || (double)now.rows < ROWS_PART * (double)work->lines - (work->lines < 10))
			continue;
		for (size_t i = 0; i < count; i++)
			known |= same_cells(work, &candidate[i], &now);
		if (!known)
			candidate[count++] = now;
	}
	if (count == 0)
		return refuse_no_table(work);
	*best = candidate[0];
	named = header_fields(work, best) == best->columns && best->columns > 1;
	for (size_t i = 1; i < count; i++) {
		bool other = header_fields(work, &candidate[i]) == candidate[i].columns;

		if (named && (!other || candidate[i].columns == 1))
			continue;
		if (named == other && (double)candidate[i].rows > (1 - NEAR) * (double)best->rows)
			return refuse_styles(work, best, &candidate[i]);
		if (other || candidate[i].rows > best->rows) {
			*best = candidate[i];
			named = other;
		}
	}
	return 0;
}

/* ---- names and units ---- */

static bool begins(struct piece name, const char *word)
{
	size_t length = strlen(word);

	return name.length >= length && strncasecmp(name.text, word, length) == 0;
}

static bool is_letter(char c)
{
	return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

bool sniff_is_time(struct piece name)
{
	static const char *const words[] = {"time", "zeit", "temps",     "tiempo",  "tempo",
	                                    "tid",  "tijd", "timestamp", "elapsed", "x_value"};

	if (name.length == 1)
		return name.text[0] == 't';
	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		size_t length = strlen(words[i]);

		if (begins(name, words[i]) && (name.length == length || !is_letter(name.text[length])))
			return true;
	}
	return name.length > 1 && name.text[0] == 't' && !is_letter(name.text[1]);
}

bool sniff_is_acceleration(struct piece name)
{
	return piece_has(name, "acc") || piece_has(name, "beschl") || piece_has(name, "shock") ||
	       piece_has(name, "vib") || piece_has(name, "impact") ||
	       (begins(name, "a") && (name.length == 1 || !is_letter(name.text[1]) ||
	                              (name.length == 2 && strchr("xyzXYZ", name.text[1]))));
}

static bool is_mass_name(struct piece name)
{
	return piece_has(name, "mass") || piece_has(name, "weight") || piece_has(name, "gewicht") ||
	       piece_has(name, "load") || piece_has(name, "tare") || piece_has(name, "poids") ||
	       piece_has(name, "masse");
}

/* A name without the unit in brackets, or the word that is one, behind it. */
static struct piece stem_of(struct piece name)
{
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
	if (is_mass_name(name) || (strcmp(unit->name, "g") != 0 && !sniff_is_acceleration(name)))
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

	if (name.length > 0 && !unit_alone(name)) {
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
	struct piece stem = stem_of(sniff->name[i]);

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
		struct piece stem = stem_of(sniff->name[i]);
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

struct times {
	bool can[COLUMNS_MAX];
	const struct unit *unit[COLUMNS_MAX];
	size_t count, first, second;
};

static void offer_time(struct times *times, size_t i, const struct unit *unit)
{
	times->unit[i] = unit;
	if (times->count == 0)
		times->first = i;
	else
		times->second = i;
	times->count++;
}

static int settle_time(struct sniff *sniff, const struct times *times, const char *file, char *message)
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

static int refuse_no_channel(struct sniff *sniff, const struct times *times, bool has_rate, const char *file,
                             char *message)
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

static int settle_names(struct sniff *sniff, const struct piece *units, struct times *times, bool has_rate,
                        const char *file, char *message)
{
	struct columns *columns = &sniff->columns;
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
			        i + 1, (int)(sniff->name[i].length < SHOWN ? sniff->name[i].length : SHOWN),
			        sniff->name[i].text);
		if (unit != NULL && unit->kind == UNIT_ACCELERATION)
			take_channel(sniff, i, unit);
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
	return columns->has_time || has_rate ? 0 : refuse_no_time(sniff, file, message);
}

int sniff_names(struct sniff *sniff, size_t count, const struct piece *units, bool has_rate, const char *file,
                char message[READ_MESSAGE_MAX])
{
	struct times times = {.count = 0};

	sniff->columns.count = count;
	for (size_t i = 0; i < count; i++)
		times.can[i] = !has_rate;
	return settle_names(sniff, units, &times, has_rate, file, message);
}

/* ---- above and below the rows ---- */

/* A line of a head without the marks before its words. */
static struct piece head_words(const struct source_line *line)
{
	struct piece text = {line->text, line->length};

	while (text.length > 0 && strchr("#\"; \t%/", text.text[0])) {
		text.text++;
		text.length--;
	}
	return text;
}

/* The number at *at of a line, and *at behind it. NAN: it may be one of two, as 20,000; 0: there is none. */
static double told_number(const struct piece *text, struct cells_style style, size_t *at)
{
	size_t from = *at, end = from, digits = 0;
	double value = 0;
	char sign = '.';

	while (end < text->length && strchr("0123456789.+-eE", text->text[end]))
		end++;
	if (end < text->length && text->text[end] == ',') {
		while (end + 1 + digits < text->length &&
		       isdigit((unsigned char)text->text[end + 1 + digits]))
			digits++;
		if (digits == 3 && style.decimal != ',')
			return NAN;
		if (digits > 0 && style.separator != ',') {
			sign = ',';
			end += 1 + digits;
		}
	}
	*at = end;
	if (sign == '.' && style.decimal == ',' && memchr(text->text + from, '.', end - from) != NULL)
		return NAN; /* where a comma is the decimal sign a point may stand for thousands */
	return number_parse(text->text + from, end - from, sign, &value) && value > 0 ? value : 0;
}

/* A blank of the word is a blank, a stroke, an underscore or nothing in the text. How much of it is the word;
 * 0: it does not begin with it. */
static size_t begins_with(struct piece text, const char *word)
{
	size_t at = 0;

	for (; *word != '\0'; word++) {
		if (*word == ' ') {
			at += at < text.length && strchr(" _-", text.text[at]) != NULL;
			continue;
		}
		if (at == text.length || tolower((unsigned char)text.text[at]) != *word)
			return 0;
		at++;
	}
	return at < text.length && is_letter(text.text[at]) ? 0 : at;
}

enum sniff_key sniff_key(struct piece text, size_t *length)
{
	static const struct {
		enum sniff_key key;
		const char *word;
	} words[] = {{SNIFF_RATE, "sample rate"},
	             {SNIFF_RATE, "sampling rate"},
	             {SNIFF_RATE, "sample frequency"},
	             {SNIFF_RATE, "sampling frequency"},
	             {SNIFF_RATE, "abtastrate"},
	             {SNIFF_RATE, "scan rate"},
	             {SNIFF_RATE, "fs"},
	             {SNIFF_STEP, "sample interval"},
	             {SNIFF_STEP, "sampling interval"},
	             {SNIFF_STEP, "sampling period"},
	             {SNIFF_STEP, "time step"},
	             {SNIFF_STEP, "delta t"},
	             {SNIFF_STEP, "dt"},
	             {SNIFF_STEP, "interval"},
	             {SNIFF_STEP, "abtastintervall"}};

	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		*length = begins_with(text, words[i].word);
		if (*length > 0)
			return words[i].key;
	}
	return SNIFF_NO_KEY;
}

/* A rate or an interval of a line like "Sample rate: 51200 Hz" or "dt = 1e-5 s"; 0 where there is none, NAN
 * where it may be one of two. */
static double rate_of(const struct source_line *line, struct cells_style style)
{
	struct piece text = head_words(line);
	const struct unit *unit;
	enum sniff_key key;
	double value;
	size_t at, end;

	key = sniff_key(text, &at);
	if (key == SNIFF_NO_KEY)
		return 0;
	for (at = 0; at < text.length && !(text.text[at] >= '0' && text.text[at] <= '9');)
		at++;
	end = at;
	value = told_number(&text, style, &end);
	if (!(value > 0))
		return value;
	while (end < text.length && strchr(" \t,;\"", text.text[end]))
		end++;
	at = end;
	while (end < text.length && !strchr(" \t,;\"", text.text[end]))
		end++;
	unit = unit_find(text.text + at, end - at);
	if (unit == NULL) /* in the key: "Sample rate (kHz);51.2" */
		unit = unit_of_name(text.text, at, UNIT_TIME);
	if (key == SNIFF_STEP)
		return unit != NULL && unit->kind == UNIT_TIME && unit->divisor >= 1 ? unit->divisor / value
		                                                                     : 0;
	if (unit == NULL)
		return 0;
	return value * unit_hertz(unit);
}

static const char *const scale_words[] = {"scale",       "scale factor", "scaling",      "scaling factor",
                                          "factor",      "scale_factor", "multiplier",   "conversion factor",
                                          "faktor",      "skalierung",   "skalenfaktor", "skalierungsfaktor",
                                          "y multiplier"};
enum { SCALE_WORDS = sizeof(scale_words) / sizeof(scale_words[0]) };

bool sniff_is_scale(struct piece key)
{
	for (size_t i = 0; i < SCALE_WORDS; i++)
		if (key.length > 0 && begins_with(key, scale_words[i]) == key.length)
			return true;
	return false;
}

/* A line like "Scale factor: 2", of a number other than 1. */
static bool tells_scale(const struct source_line *line)
{
	struct piece text = head_words(line);
	double value = 1;
	size_t at;

	for (size_t i = 0; i < SCALE_WORDS; i++) {
		if (!begins(text, scale_words[i]))
			continue;
		at = strlen(scale_words[i]);
		while (at < text.length && strchr(" \t:=;,\"", text.text[at]))
			at++;
		value = at < text.length && isdigit((unsigned char)text.text[at])
		                ? told_number(&text, (struct cells_style){0}, &at)
		                : value;
	}
	return !(fabs(value - 1) < 1e-12);
}

static bool is_of_ours(const struct source *source)
{
	static const char *const marks[] = {"droptower csv", "droptower_csv",
	                                    "channel rate_hz=", "***End_of_Header***"};
	size_t length = source->size < 8192 ? source->size : 8192;
	const char *tail = source->bytes + (source->size > 160 ? source->size - 160 : 0);

	for (size_t i = 0; i < sizeof(marks) / sizeof(marks[0]); i++)
		if (memmem(source->bytes, length, marks[i], strlen(marks[i])) != NULL)
			return true;
	return memmem(tail, (size_t)(source->bytes + source->size - tail), "# sha256 ", 9) != NULL;
}

static bool has_letter(const struct source_line *line)
{
	for (size_t i = 0; i < line->length; i++)
		if (is_letter(line->text[i]))
			return true;
	return false;
}

/* Lines with words behind the last row are a footer; others are rows that something is wrong with, and so is
 * one that begins with a number and has no end: "0.1,1.5e". */
static void find_footer(struct work *work, struct sniff *sniff)
{
	const char *bytes = work->source->bytes;
	size_t end = work->source->size;

	sniff->end = end;
	while (end > sniff->first && sniff->footer_lines < FOOTER_LINES_MOST) {
		size_t stop = end - (bytes[end - 1] == '\n');
		const char *before = stop > 0 ? memrchr(bytes, '\n', stop) : NULL;
		struct source_line line = {.text = before ? before + 1 : bytes};

		line.length = (size_t)(bytes + stop - line.text);
		while (line.length > 0 && line.text[line.length - 1] == '\r')
			line.length--;
		end = (size_t)(line.text - bytes);
		if (is_idle(&line))
			continue;
		split(sniff->style, &line, &work->cells);
		if (is_row(&work->cells) || !has_letter(&line) ||
		    (sniff->footer_lines == 0 && bytes[work->source->size - 1] != '\n' &&
		     kind_of(&work->cells, 0) == CELL_NUMBER))
			return;
		sniff->footer_lines++;
		sniff->end = end;
	}
}

struct head {
	struct cells names, units;
	struct piece names_line;
};

/* A line that tells units: the first cell a unit, and no cell a word that stands for something else. */
static bool tells_units(const struct cells *cells)
{
	size_t known = 0;

	for (size_t i = 0; i < cells->count && i < CELLS_MAX; i++) {
		struct piece cell = cells->cell[i];

		known += cell.length > 0 && unit_find(cell.text, cell.length) != NULL;
		if (cell.length > 12)
			return false;
	}
	return known > 0 && 2 * known >= cells->count;
}

static void take_head(struct work *work, struct head *head, size_t columns, struct source_line line)
{
	const char *all = line.text;
	size_t length = line.length;
	struct cells *cells = &work->other;
	bool fits;

	while (line.length > 0 && strchr("# ", line.text[0])) {
		line.text++;
		line.length--;
	}
	fits = cells_names((struct cells_style){0}, line.text, line.length, columns, cells);
	if (!fits && columns > 1 &&
	    cells_names((struct cells_style){0}, line.text, line.length, columns - 1, cells) &&
	    line.length > 0) {
		cells->cell[columns - 1] = (struct piece){line.text, 0};
		cells->count = columns;
		fits = true;
	}
	if (!fits)
		return;
	if (tells_units(cells)) {
		head->units = *cells;
		return;
	}
	for (size_t i = 0; i < cells->count; i++)
		if (kind_of(cells, i) == CELL_TEXT) {
			head->names = *cells;
			head->names_line = (struct piece){all, length};
			head->units.count = 0;
			return;
		}
}

/* Steps over the lines above the first row. */
static int read_head(struct work *work, struct sniff *sniff, size_t columns, struct head *head)
{
	struct source_line line = {0};

	for (size_t at = 0; source_next_line(work->source, &line); at = line.next) {
		double rate_hz = rate_of(&line, sniff->style);

		if (isnan(rate_hz))
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "\"%.*s\": a rate with a comma or point for thousands or for a "
			                     "decimal sign, expected --columns with name:unit@RATE_HZ",
			                     (int)(line.length < 60 ? line.length : 60), line.text);
		if (tells_scale(&line))
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "\"%.*s\" may be in the numbers or not, expected --columns that "
			                     "says so, e.g. name:g or name:g*FACTOR",
			                     (int)(line.length < 60 ? line.length : 60), line.text);
		if (rate_hz > 0 && sniff->told_rate_hz > 0 && fabs(rate_hz / sniff->told_rate_hz - 1) > 1e-3)
			return source_refuse(work->message, DT_E_FORMAT, work->source->file, line.number,
			                     "rate %.9g Hz here and %.9g Hz in line %llu, expected one",
			                     rate_hz, sniff->told_rate_hz,
			                     (unsigned long long)sniff->rate_line);
		if (rate_hz > 0) {
			sniff->told_rate_hz = rate_hz;
			sniff->rate_line = line.number;
		}
		split(sniff->style, &line, &work->cells);
		if (!is_idle(&line) && work->cells.count == columns && is_row(&work->cells)) {
			sniff->first = at;
			sniff->header_lines = (size_t)line.number - 1;
			return 0;
		}
		if (line.number > HEADER_LINES_MOST)
			break;
		take_head(work, head, columns, line);
	}
	return source_refuse(work->message, DT_E_FORMAT, work->source->file, 0,
	                     "more than %d lines above the first row of numbers", HEADER_LINES_MOST);
}

/* Which columns could be a time: increasing all through the sampled rows. */
static void find_increasing(struct work *work, const struct sniff *sniff, struct times *times)
{
	static const struct piece clock = {"clock", 5};
	double before[COLUMNS_MAX], value;
	size_t rows = 0;

	for (size_t i = 0; i < sniff->columns.count; i++)
		times->can[i] = true;
	for (size_t k = 0; k < work->lines; k++) {
		split(sniff->style, &work->line[k], &work->cells);
		if (work->cells.count != sniff->columns.count || !is_row(&work->cells))
			continue;
		for (size_t i = 0; i < sniff->columns.count; i++) {
			int64_t ns;
			int digits;

			if (kind_of(&work->cells, i) == CELL_CLOCK &&
			    clock_parse(work->cells.cell[i], &ns, &digits)) {
				value = (double)ns;
				times->unit[i] = unit_find(clock.text, clock.length);
			} else if (!cells_number(&work->cells, i, &value)) {
				times->can[i] = false;
				continue;
			}
			times->can[i] &= rows == 0 || value >= before[i];
			before[i] = value;
		}
		rows++;
	}
}

static int sniff_all(struct work *work, struct sniff *sniff, struct head *head, const struct candidate *style)
{
	struct times times = {.count = 0};
	int error;

	sniff->style = style->style;
	sniff->columns.count = style->columns;
	error = read_head(work, sniff, style->columns, head);
	if (error)
		return error;
	find_footer(work, sniff);
	for (size_t i = 0; i < head->names.count; i++)
		sniff->name[i] = head->names.cell[i];
	sniff->names_line = head->names_line;
	find_increasing(work, sniff, &times);
	error = settle_names(sniff, head->units.count > 0 ? head->units.cell : NULL, &times,
	                     sniff->told_rate_hz > 0, work->source->file, work->message);
	if (!error && !sniff->columns.has_time)
		sniff->columns.rate_hz = sniff->told_rate_hz;
	return error;
}

int sniff_text(struct sniff *sniff, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct work *work = calloc(1, sizeof(*work));
	struct head *head = calloc(1, sizeof(*head));
	struct candidate style = {.columns = 0};
	int error = 0;

	*sniff = (struct sniff){.end = source->size};
	if (is_of_ours(source))
		error = source_refuse(
		        message, DT_E_FORMAT, source->file, 0,
		        "has marks of a CSV of ours or a LabVIEW file, but does not begin as one: "
		        "damaged, or cut out of another");
	else if (work == NULL || head == NULL)
		error = source_no_memory(message, source->file);
	if (!error) {
		work->source = source;
		work->message = message;
		sample_lines(work);
		error = find_style(work, &style);
	}
	if (!error && style.columns > COLUMNS_MAX)
		error = source_refuse(message, DT_E_FORMAT, source->file, 0,
		                      "%zu columns, expected %d at most", style.columns, COLUMNS_MAX);
	if (!error)
		error = sniff_all(work, sniff, head, &style);
	free(work);
	free(head);
	return error;
}

/* ---- what was understood ---- */

__attribute__((format(printf, 4, 5))) static void tell(char *text, size_t size, size_t *used,
                                                       const char *format, ...)
{
	va_list list;
	int put;

	if (*used + 1 >= size)
		return;
	va_start(list, format);
	put = vsnprintf(text + *used, size - *used, format, list);
	va_end(list);
	*used += put > 0 ? (size_t)put : 0;
}

void sniff_tell(const struct sniff *sniff, const char *encoding, char *text, size_t size)
{
	const struct columns *columns = &sniff->columns;
	size_t used = 0, left = 0;
	const char *between = "";

	text[0] = '\0';
	if (encoding != NULL)
		tell(text, size, &used, "text %s, %s%s, %zu header line%s; ", encoding,
		     separator_name(sniff->style.separator),
		     sniff->style.decimal == ',' ? ", decimal comma" : "", sniff->header_lines,
		     sniff->header_lines == 1 ? "" : "s");
	for (size_t i = 0; i < columns->count; i++)
		if (columns->column[i].kind == COLUMN_SKIP)
			left++;
		else {
			tell(text, size, &used, "%s%s:%s", between, columns->column[i].name,
			     i < COLUMNS_MAX && columns->column[i].kind == COLUMN_TIME &&
			                     sniff->time_unit_open
			             ? "?"
			             : columns->column[i].unit->name);
			between = ", ";
		}
	if (columns->rate_hz > 0)
		tell(text, size, &used, " at %.9g Hz as told", columns->rate_hz);
	between = left == 0 ? "" : "; left out ";
	for (size_t i = 0; i < columns->count; i++)
		if (columns->column[i].kind == COLUMN_SKIP) {
			struct piece stem = stem_of(sniff->name[i]);

			if (stem.length > 0)
				tell(text, size, &used, "%s%.*s", between,
				     (int)(stem.length < 31 ? stem.length : 31), stem.text);
			else
				tell(text, size, &used, "%scolumn %zu", between, i + 1);
			between = ", ";
		}
	if (sniff->footer_lines > 0)
		tell(text, size, &used, "; %zu footer line%s", sniff->footer_lines,
		     sniff->footer_lines == 1 ? "" : "s");
}
