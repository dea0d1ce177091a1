/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/sniff_private.h"

#include "host/record/clock.h"

/* Of the sampled lines that must be rows; what a second reading must come near to make a doubt. */
static const double ROWS_PART = 0.9, NEAR = 0.05;

static const char separators[SNIFF_SEPARATORS] = {'\t', ';', ',', '|', ' '};

/* ---- cells ---- */

static bool is_word(struct piece cell, const char *words[], size_t count)
{
	for (size_t i = 0; i < count; i++)
		if (cell.length == strlen(words[i]) && strncasecmp(cell.text, words[i], cell.length) == 0)
			return true;
	return false;
}

enum cell_kind sniff_kind(const struct cells *cells, size_t i)
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
	if (cell.length >= 6 && clock_parse(cell, &ns, &digits))
		return CELL_CLOCK;
	return cell.length >= 8 && clock_is_date(cell) ? CELL_DATE : CELL_TEXT;
}

bool sniff_is_row(const struct sniff_work *work, const struct cells *cells)
{
	size_t numbers = 0;

	for (size_t i = 0; i < cells->count; i++) {
		enum cell_kind kind = i < CELLS_MAX ? sniff_kind(cells, i) : CELL_TEXT;

		if (i < CELLS_MAX && work->words[i])
			continue;
		if (kind == CELL_TEXT)
			return false;
		numbers += kind == CELL_NUMBER || kind == CELL_NO_NUMBER;
	}
	return numbers > 0;
}

bool sniff_is_idle(const struct source_line *line)
{
	size_t at = 0;

	while (at < line->length && (line->text[at] == ' ' || line->text[at] == '\t'))
		at++;
	return at == line->length || line->text[at] == '#';
}

/* ---- separator and decimal sign ---- */

void sniff_sample(struct sniff_work *work)
{
	struct source_line line = {0};
	size_t all = 0, from, most;

	while (source_next_line(work->source, &line))
		all += !sniff_is_idle(&line);
	most = all / 3 > SNIFF_SAMPLED ? SNIFF_SAMPLED : all / 3 < 2 ? 2 : all / 3;
	from = all > most ? (all - most + 1) / 2 : 0;
	line = (struct source_line){0};
	for (size_t k = 0; work->lines < most && source_next_line(work->source, &line);)
		if (!sniff_is_idle(&line) && k++ >= from)
			work->line[work->lines++] = line;
}

void sniff_split(struct cells_style style, const struct source_line *line, struct cells *cells)
{
	cells_split(style, line->text, line->length, cells);
}

/* How many of the sampled lines are rows of one count of columns. */
static void count_rows(struct sniff_work *work, struct sniff_candidate *candidate)
{
	memset(work->counts, 0, sizeof(work->counts));
	for (size_t k = 0; k < work->lines; k++) {
		sniff_split(candidate->style, &work->line[k], &work->cells);
		if (work->cells.count < CELLS_MAX && sniff_is_row(work, &work->cells))
			work->counts[work->cells.count]++;
	}
	candidate->rows = 0;
	for (size_t n = 1; n < CELLS_MAX; n++)
		if (work->counts[n] > candidate->rows) {
			candidate->rows = work->counts[n];
			candidate->columns = n;
		}
}

static bool same_cells(struct sniff_work *work, const struct sniff_candidate *a,
                       const struct sniff_candidate *b)
{
	if (a->columns != b->columns)
		return false;
	for (size_t k = 0; k < work->lines; k++) {
		sniff_split(a->style, &work->line[k], &work->cells);
		sniff_split(b->style, &work->line[k], &work->other);
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
static size_t header_fields(struct sniff_work *work, const struct sniff_candidate *candidate)
{
	struct source_line line = {0};
	size_t fields = 0;

	while (source_next_line(work->source, &line) && line.number < SNIFF_HEADER_LINES_MOST) {
		sniff_split(candidate->style, &line, &work->cells);
		if (work->cells.count == candidate->columns && sniff_is_row(work, &work->cells))
			break;
		if (line.length > 0)
			fields = work->cells.count;
	}
	return fields;
}

const char *sniff_separator_name(char separator)
{
	return separator == '\t'  ? "tab"
	       : separator == ' ' ? "blanks"
	       : separator == ';' ? "semicolon"
	       : separator == ',' ? "comma"
	                          : "bar";
}

static int refuse_styles(struct sniff_work *work, const struct sniff_candidate *a,
                         const struct sniff_candidate *b)
{
	return source_refuse(
	        work->message, DT_E_FORMAT, work->source->file, work->line[0].number,
	        "two readings: %zu columns between %ss with decimal '%c', or %zu between %ss with "
	        "decimal '%c', and no line of names tells which; expected --columns",
	        a->columns, sniff_separator_name(a->style.separator), a->style.decimal, b->columns,
	        sniff_separator_name(b->style.separator), b->style.decimal);
}

static int refuse_no_table(struct sniff_work *work)
{
	for (size_t k = 0; k < work->lines; k++)
		for (size_t s = 0; s < SNIFF_SEPARATORS; s++) {
			sniff_split((struct cells_style){separators[s], '.'}, &work->line[k], &work->cells);
			for (size_t i = 0; i < work->cells.count && i < CELLS_MAX; i++) {
				enum cells_oddity oddity = cells_oddity(&work->cells, i);
				struct piece cell = work->cells.cell[i];

				if (oddity != CELLS_PLAIN && work->cells.count < CELLS_MAX &&
				    cell.length < SNIFF_SHOWN)
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

/* Columns that hold words, or nothing, in nearly all of the sampled lines; how many others there are. */
static size_t find_words(struct sniff_work *work, struct cells_style style)
{
	size_t words[CELLS_MAX] = {0}, none[CELLS_MAX] = {0}, columns = 0, lines, numbers = 0;

	memset(work->words, 0, sizeof(work->words));
	memset(work->counts, 0, sizeof(work->counts));
	for (size_t k = 0; k < work->lines; k++) {
		sniff_split(style, &work->line[k], &work->cells);
		if (work->cells.count < CELLS_MAX &&
		    ++work->counts[work->cells.count] > work->counts[columns])
			columns = work->cells.count;
	}
	lines = work->counts[columns];
	for (size_t k = 0; k < work->lines; k++) {
		sniff_split(style, &work->line[k], &work->cells);
		for (size_t i = 0; work->cells.count == columns && i < columns; i++) {
			words[i] += sniff_kind(&work->cells, i) == CELL_TEXT &&
			            cells_oddity(&work->cells, i) == CELLS_PLAIN;
			none[i] += work->cells.cell[i].length == 0;
		}
	}
	for (size_t i = 0; i < columns; i++) {
		work->words[i] = words[i] > 0 && (double)(words[i] + none[i]) > ROWS_PART * (double)lines;
		numbers += !work->words[i];
	}
	return numbers;
}

/* A table with columns of words, where there is none without: of the readings the one with most numbers. */
static int find_style_with_words(struct sniff_work *work, struct sniff_candidate *best)
{
	size_t most = 0;

	for (size_t k = 0; k < 2 * SNIFF_SEPARATORS; k++) {
		struct sniff_candidate now = {.style = {separators[k / 2], k % 2 ? ',' : '.'}};
		size_t numbers = find_words(work, now.style);

		count_rows(work, &now);
		if (numbers == 0 || now.rows < 2 || (double)now.rows < ROWS_PART * (double)work->lines ||
		    numbers < most || (numbers == most && same_cells(work, best, &now)))
			continue;
		if (numbers == most)
			return refuse_styles(work, best, &now);
		*best = now;
		most = numbers;
	}
	if (most == 0)
		return refuse_no_table(work);
	find_words(work, best->style);
	return 0;
}

int sniff_find_style(struct sniff_work *work, struct sniff_candidate *best)
{
	struct sniff_candidate candidate[2 * SNIFF_SEPARATORS];
	size_t count = 0;
	bool named = false;

	for (size_t k = 0; k < 2 * SNIFF_SEPARATORS; k++) {
		struct sniff_candidate now = {.style = {separators[k / 2], k % 2 ? ',' : '.'}};
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
		return find_style_with_words(work, best);
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
