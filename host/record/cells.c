/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/cells.h"

#include <ctype.h>
#include <math.h>
#include <string.h>
#include <strings.h>

#include "common/base/number.h"

static bool cells_is_blank(char c)
{
	return c == ' ' || c == '\t';
}

static bool is_digit(char c)
{
	return c >= '0' && c <= '9';
}

bool piece_has(struct piece piece, const char *word)
{
	size_t length = strlen(word);

	for (size_t at = 0; at + length <= piece.length; at++)
		if (strncasecmp(piece.text + at, word, length) == 0)
			return true;
	return false;
}

bool piece_has_letter(struct piece piece)
{
	for (size_t i = 0; i < piece.length; i++)
		if (isalpha((unsigned char)piece.text[i]) || (unsigned char)piece.text[i] >= 0x80)
			return true;
	return false;
}

/* ---- a line to cells ---- */

static char decimal_of(const char *text, size_t length)
{
	bool separated = memchr(text, ';', length) || memchr(text, '\t', length) || memchr(text, '|', length);

	if (!separated || memchr(text, '.', length))
		return '.';
	for (size_t i = 1; i + 1 < length; i++)
		if (text[i] == ',' && is_digit(text[i - 1]) && is_digit(text[i + 1]))
			return ',';
	return '.';
}

static size_t skip_blanks(const char *text, size_t length, size_t at)
{
	while (at < length && cells_is_blank(text[at]))
		at++;
	return at;
}

/* The end of the cell that begins at `at`. */
static size_t cell_end(char separator, char decimal, const char *text, size_t length, size_t at)
{
	for (; at < length; at++) {
		char c = text[at];

		if (separator == ' ' ? cells_is_blank(c)
		    : separator      ? c == separator
		                : cells_is_blank(c) || c == ';' || c == '|' || (c == ',' && decimal != ','))
			break;
	}
	return at;
}

/* A cell without the blanks and quotes around it. */
static struct piece cells_trim(struct piece cell)
{
	while (cell.length > 0 && cells_is_blank(cell.text[0])) {
		cell.text++;
		cell.length--;
	}
	while (cell.length > 0 && cells_is_blank(cell.text[cell.length - 1]))
		cell.length--;
	if (cell.length >= 2 && cell.text[0] == '"' && cell.text[cell.length - 1] == '"')
		cell = (struct piece){cell.text + 1, cell.length - 2};
	return cell;
}

/* A table with bars at both edges has no cells outside them. Returns where the line begins. */
static size_t skip_bars(struct cells_style style, const char *text, size_t *length)
{
	size_t at = skip_blanks(text, *length, 0), end = *length;

	while (end > at && cells_is_blank(text[end - 1]))
		end--;
	if ((style.separator && style.separator != '|') || end < at + 2 || text[at] != '|' ||
	    text[end - 1] != '|')
		return 0;
	*length = end - 1;
	return at + 1;
}

void cells_split(struct cells_style style, const char *text, size_t length, struct cells *cells)
{
	bool more = true; /* a separator announced another cell */
	size_t at = skip_bars(style, text, &length);

	cells->count = 0;
	cells->decimal = style.decimal ? style.decimal : decimal_of(text, length);
	while (at < length || more) {
		size_t start, end;

		if (style.separator != '\t')
			at = skip_blanks(text, length, at);
		start = end = at;
		if (start < length && text[start] == '"') {
			const char *quote = memchr(text + start + 1, '"', length - start - 1);

			if (quote)
				end = (size_t)(quote - text) + 1;
		}
		end = cell_end(style.separator, cells->decimal, text, length, end);
		if (cells->count < CELLS_MAX)
			cells->cell[cells->count] = cells_trim((struct piece){text + start, end - start});
		cells->count++;
		if (style.separator != '\t')
			end = skip_blanks(text, length, end);
		more = end < length &&
		       (style.separator ? text[end] == style.separator : strchr(";,|", text[end]) != NULL);
		at = end + more;
	}
}

/* ---- numbers ---- */

/* Where the exponent of a number begins; its length if it has none. */
static size_t exponent_at(struct piece cell)
{
	size_t at = 0;

	while (at < cell.length && !strchr("eEdD", cell.text[at]))
		at++;
	return at;
}

/* "1.25D+02" as Fortran writes it: always with a sign. */
static bool is_fortran_number(struct piece cell, char decimal, double *value)
{
	const size_t at = exponent_at(cell);
	char text[64];

	if (at + 2 >= cell.length || cell.length > sizeof(text) || !strchr("+-", cell.text[at + 1]))
		return false;
	memcpy(text, cell.text, cell.length);
	text[at] = 'e';
	return number_parse(text, cell.length, decimal, value);
}

bool cells_number(const struct cells *cells, size_t i, double *value)
{
	return i < cells->count && i < CELLS_MAX &&
	       (number_parse(cells->cell[i].text, cells->cell[i].length, cells->decimal, value) ||
	        is_fortran_number(cells->cell[i], cells->decimal, value));
}

/* Bytes of a sign that may part groups of three digits; 0 for another. */
static size_t group_sign(const char *text, size_t length)
{
	static const char *const signs[] = {
	        ",", ".", "'", " ", "_", "\302\240", "\342\200\257", "\342\200\211", "\342\200\231"};

	for (size_t i = 0; i < sizeof(signs) / sizeof(signs[0]); i++) {
		size_t bytes = strlen(signs[i]);

		if (length >= bytes && memcmp(text, signs[i], bytes) == 0)
			return bytes;
	}
	return 0;
}

/* Whether the cell is a number once signs before three digits are left out. */
static bool has_thousands(struct piece cell)
{
	char plain[64];
	size_t used = 0;
	double value;
	bool any = false;

	for (size_t at = 0; at < cell.length && used < sizeof(plain);) {
		size_t sign = group_sign(cell.text + at, cell.length - at), digits = 0;

		while (sign && at + sign + digits < cell.length && is_digit(cell.text[at + sign + digits]))
			digits++;
		if (sign && digits == 3 && at > 0 && is_digit(cell.text[at - 1])) {
			any = true;
			at += sign;
		} else {
			plain[used++] = cell.text[at] == ',' ? '.' : cell.text[at];
			at++;
		}
	}
	return any && used < sizeof(plain) && number_parse(plain, used, '.', &value);
}

static bool has_unit(struct piece cell, char decimal)
{
	size_t length = cell.length;
	double value;

	while (length > 0 && !is_digit(cell.text[length - 1]) && cell.text[length - 1] != '.')
		length--;
	if (length < cell.length && number_parse(cell.text, length, decimal, &value))
		return true;
	/* "9.81 m/s2" */
	length = 0;
	while (length < cell.length && !cells_is_blank(cell.text[length]))
		length++;
	return length < cell.length && number_parse(cell.text, length, decimal, &value);
}

enum cells_oddity cells_oddity(const struct cells *cells, size_t i)
{
	struct piece cell;

	if (i >= cells->count || i >= CELLS_MAX || cells->cell[i].length == 0)
		return CELLS_PLAIN;
	cell = cells->cell[i];
	if (has_thousands(cell))
		return CELLS_THOUSANDS;
	return has_unit(cell, cells->decimal) ? CELLS_UNIT : CELLS_PLAIN;
}

bool cells_could_be_thousands(struct piece cell)
{
	const char *comma = memchr(cell.text, ',', cell.length);
	size_t sign = cell.length > 0 && (cell.text[0] == '-' || cell.text[0] == '+');
	size_t before = comma ? (size_t)(comma - cell.text) - sign : 0;

	if (before < 1 || before > 3 || cell.text[sign] == '0' || cell.length != sign + before + 4)
		return false;
	for (size_t i = 0; i < 3; i++)
		if (!is_digit(comma[1 + i]))
			return false;
	return true;
}

double cells_last_digit(const struct cells *cells, size_t i, int *digits)
{
	const struct piece cell = cells->cell[i];
	const size_t end = exponent_at(cell);
	bool point = false;
	int places = 0;
	double exponent = 0;

	*digits = 0;
	if (end < cell.length)
		(void)number_parse(cell.text + end + 1, cell.length - end - 1, '.', &exponent);
	for (size_t k = 0; k < end; k++) {
		char c = cell.text[k];

		if (is_digit(c)) {
			places += point;
			*digits += *digits > 0 || c != '0';
		} else {
			point |= c == cells->decimal;
		}
	}
	return pow(10, exponent - places);
}

size_t cells_tail(struct piece cell, char decimal)
{
	const size_t end = exponent_at(cell);
	const char *sign = end > 0 ? memchr(cell.text, decimal, end) : NULL;

	return cell.length - (sign ? (size_t)(sign - cell.text) : end);
}

/* ---- names ---- */

static bool is_bracket(struct piece cell)
{
	return cell.length > 0 && (cell.text[0] == '(' || cell.text[0] == '[');
}

/* By blanks alone. */
static void split_words(const char *text, size_t length, struct cells *cells)
{
	size_t at = skip_blanks(text, length, 0);

	cells->count = 0;
	while (at < length) {
		size_t end = at;
		struct piece cell;

		while (end < length && !cells_is_blank(text[end]))
			end++;
		cell = (struct piece){text + at, end - at};
		if (cells->count > 0 && cells->count <= CELLS_MAX && is_bracket(cell)) {
			struct piece *before = &cells->cell[cells->count - 1];

			before->length = (size_t)(text + end - before->text);
		} else {
			if (cells->count < CELLS_MAX)
				cells->cell[cells->count] = cell;
			cells->count++;
		}
		at = skip_blanks(text, length, end);
	}
}

static bool gives(struct cells *cells, size_t count)
{
	if (cells->count == count + 1 && count < CELLS_MAX && cells->cell[count].length == 0)
		cells->count--;
	return cells->count == count;
}

bool cells_names(struct cells_style style, const char *text, size_t length, size_t count, struct cells *cells)
{
	static const char separators[] = {'\t', ';', ',', '|'};

	if (style.separator) {
		cells_split(style, text, length, cells);
		return gives(cells, count);
	}
	for (size_t i = 0; i < sizeof(separators); i++) {
		cells_split((struct cells_style){separators[i], '.'}, text, length, cells);
		if (gives(cells, count))
			return true;
	}
	split_words(text, length, cells);
	return gives(cells, count);
}
