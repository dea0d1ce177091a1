/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/base/html.h"

static const void *table_at(const struct table_column *c, const void *object)
{
	return (const char *)object + c->offset;
}

static bool is_words(const struct table_column *c)
{
	return c->kind == TABLE_WORDS || c->kind == TABLE_CHARS;
}

static bool is_yes(const struct table_column *c)
{
	return c->kind == TABLE_YES || c->kind == TABLE_KNOWN;
}

/* NULL when not known. */
static const char *words_of(const struct table_column *c, const void *object)
{
	const char *chars = table_at(c, object);

	return c->kind == TABLE_CHARS ? chars : *(const char *const *)(const void *)chars;
}

static struct table_value table_value_of(const struct table_column *c, const void *object)
{
	struct table_value v = {(double)NAN, (double)NAN, false};

	switch (c->kind) {
	case TABLE_NUMBER:
		v.value = *(const double *)table_at(c, object);
		break;
	case TABLE_VALUE:
		v = *(const struct table_value *)table_at(c, object);
		break;
	case TABLE_WHOLE:
		v.value = *(const unsigned *)table_at(c, object);
		break;
	case TABLE_LARGE:
		v.value = (double)*(const int64_t *)table_at(c, object);
		break;
	default:
		break;
	}
	return v;
}

/* ---- JSON ---- */

static void put_one(struct builder *b, cJSON *to, const struct table_column *c, const void *object)
{
	const char *words = is_words(c) ? words_of(c, object) : NULL;
	struct table_value v = table_value_of(c, object);

	if (c->kind == TABLE_ITEM) {
		if (*(cJSON *const *)table_at(c, object) != NULL)
			put_item(b, to, c->key, *(cJSON *const *)table_at(c, object));
		return;
	}
	if (words != NULL)
		put_text(b, to, c->key, words);
	else if (is_yes(c) && (c->kind == TABLE_YES || *(const bool *)table_at(c, object)))
		put_bool(b, to, c->key, *(const bool *)table_at(c, object));
	else
		put_number(b, to, c->key, v.value);
	if (c->sigma != NULL)
		put_number(b, to, c->sigma, v.sigma);
}

/* Columns from c on that share its group; known: whether one of them is. */
static size_t group_size(const struct table_column *c, const struct table_column *end, const void *object,
                         bool *known)
{
	const struct table_column *in = c;

	*known = false;
	for (; in < end && in->group != NULL && strcmp(in->group, c->group) == 0; in++)
		*known |= in->kind != TABLE_NUMBER || isfinite(table_value_of(in, object).value);
	return (size_t)(in - c);
}

int table_object(const struct table_column *c, size_t count, const void *object, FILE *out)
{
	const struct table_column *end = c + count;
	cJSON *row = cJSON_CreateObject();
	struct builder b = {.failed = row == NULL};

	while (c < end) {
		bool known;
		size_t n = c->group != NULL ? group_size(c, end, object, &known) : 1;
		cJSON *to = c->group != NULL && known ? put_object(&b, row, c->group) : row;

		if (c->group != NULL && !known)
			put_item(&b, row, c->group, cJSON_CreateNull());
		else
			for (size_t i = 0; i < n; i++)
				if (c[i].key != NULL)
					put_one(&b, to, &c[i], object);
		c += n;
	}
	return put_part(&b, row, out);
}

static void put_row(struct table *t, const void *object)
{
	int result;

	fputs(t->rows > 0 ? "," : "", t->out);
	result = table_object(t->columns, t->count, object, t->out);
	if (t->error == 0)
		t->error = result;
}

/* ---- CSV, text, HTML: cells in a row ---- */

/* What of a column is a cell: its value; of CSV also its uncertainty. */
static bool has(const struct table *t, const struct table_column *c, bool sigma)
{
	if (t->format == TABLE_CSV)
		return c->kind != TABLE_ITEM && c->key != NULL && (c->csv == NULL || c->csv[0] != '\0') &&
		       (!sigma || c->sigma != NULL);
	return !sigma && c->title != NULL;
}

static double table_scale_of(const struct table *t, const struct table_column *c)
{
	return t->format == TABLE_CSV || t->of == TABLE_COUNTS || !(fabs(c->scale) > 0.0) ? 1.0 : c->scale;
}

/* Quoted where it must be (RFC 4180); words that a spreadsheet would compute are words by an apostrophe. */
static void csv_words(FILE *out, const char *words)
{
	const char *quote = strpbrk(words, ",;\"\n\r") != NULL ? "\"" : "";

	fputs(quote, out);
	if (words[0] != '\0' && strchr("=+-@\t\r", words[0]) != NULL)
		fputc('\'', out);
	for (size_t length; *words != '\0'; words += length) {
		length = strcspn(words + 1, "\"") + 1; /* a quote that begins them comes twice */
		if (*words == '"')
			fputc('"', out);
		fwrite(words, 1, length, out);
	}
	fputs(quote, out);
}

static void put_words(const struct table *t, const struct table_column *c, const char *words)
{
	if (t->format == TABLE_CSV)
		csv_words(t->out, words);
	else if (t->format == TABLE_HTML)
		(c->own ? html_own : html_text)(t->out, words);
	else
		fprintf(t->out, "%*.*s", c->width, c->digits > 0 && is_words(c) ? c->digits : -1, words);
}

static void put_value(const struct table *t, const struct table_column *c, double value, double sigma)
{
	int digits = t->of == TABLE_COUNTS ? 0 : c->digits + (t->of == TABLE_SDS);
	char text[NUMBER_CHARS] = "";

	if (t->format == TABLE_CSV && isfinite(value))
		number_format(text, value, 6);
	if (t->format == TABLE_CSV)
		fputs(text, t->out);
	else if (t->format == TABLE_HTML)
		html_with_sigma(t->out, digits, value, sigma);
	else if (isnan(value))
		fprintf(t->out, "%*s", c->width, "-");
	else
		fprintf(t->out, digits < 0 ? "%*.*g" : "%*.*f", c->width, abs(digits), value);
}

/* A cell's text; object NULL: of the head. */
static void table_put_cell(const struct table *t, const struct table_column *c, const void *object,
                           bool sigma)
{
	struct table_value v = table_value_of(c, object);
	double scale = table_scale_of(t, c);
	const char *mark = c->kind == TABLE_VALUE && t->format == TABLE_TEXT ? " " : "";

	if (is_words(c))
		put_words(t, c, words_of(c, object) != NULL ? words_of(c, object) : "");
	else if (is_yes(c))
		put_words(t, c, *(const bool *)table_at(c, object) ? "yes" : "");
	else
		put_value(t, c, (sigma ? v.sigma : v.value) * scale, v.sigma * scale);
	if (t->format != TABLE_CSV)
		fputs(v.marked && isfinite(v.value) ? "*" : mark, t->out);
}

static void table_put_head(const struct table *t, const struct table_column *c, bool sigma)
{
	bool unit = c->unit != NULL && c->unit[0] != '\0';
	char title[96];

	if (t->format == TABLE_CSV)
		snprintf(title, sizeof(title), "%s%s%s", c->group != NULL ? c->group : "",
		         c->group != NULL ? "_" : "",
		         sigma            ? c->sigma
		         : c->csv != NULL ? c->csv
		                          : c->key);
	else
		snprintf(title, sizeof(title), "%s%s%s", c->title,
		         !unit                     ? ""
		         : t->format == TABLE_HTML ? ", "
		                                   : " ",
		         unit ? c->unit : "");
	put_words(t, &(struct table_column){.width = c->width}, title);
	if (t->format == TABLE_TEXT && c->kind == TABLE_VALUE)
		fputc(' ', t->out);
}

static void put_line(const struct table *t, const void *object)
{
	const char *gap = "";

	if (t->format == TABLE_HTML)
		fprintf(t->out, "<tr%s>", object != NULL && t->row_class != NULL ? t->row_class : "");
	for (size_t i = 0; i < 2 * t->count; i++) {
		const struct table_column *c = &t->columns[i / 2];
		bool sigma = i % 2 != 0;
		const char *tag = object != NULL || c->title == NULL || c->title[0] == '\0' ? "td" : "th";

		if (!has(t, c, sigma))
			continue;
		if (t->format == TABLE_HTML)
			fprintf(t->out, "<%s%s>", tag, is_words(c) && c->width < 0 ? " class=\"text\"" : "");
		else
			fputs(t->format == TABLE_TEXT && c->gap != NULL ? c->gap : gap, t->out);
		gap = t->format == TABLE_CSV ? "," : " ";
		if (object != NULL)
			table_put_cell(t, c, object, sigma);
		else
			table_put_head(t, c, sigma);
		if (t->format == TABLE_HTML)
			fprintf(t->out, "</%s>", tag);
	}
	fputs(t->format == TABLE_HTML ? "</tr>" : "\n", t->out);
}

/* ---- */

void table_begin(struct table *table, const struct table_column *columns, size_t count)
{
	table->columns = columns;
	table->count = count;
	table->rows = 0;
	if (table->format == TABLE_JSON)
		fputc('[', table->out);
	if (table->format == TABLE_HTML)
		fputs("<div class=\"scroll\" tabindex=\"0\"><table><thead>", table->out);
	if (table->format == TABLE_CSV || table->format == TABLE_HTML)
		put_line(table, NULL);
	if (table->format == TABLE_HTML)
		fputs("</thead><tbody>\n", table->out);
}

bool table_is_full(struct table *table)
{
	table->more = table->limit != 0 && table->rows == table->limit;
	return table->more;
}

void table_row(struct table *table, const void *object)
{
	if (table_is_full(table))
		return;
	if (table->format == TABLE_TEXT && table->rows == 0 && !table->bare)
		put_line(table, NULL);
	if (table->format == TABLE_JSON)
		put_row(table, object);
	else
		put_line(table, object);
	if (table->format == TABLE_HTML)
		fputc('\n', table->out);
	table->rows++;
}

int table_end(struct table *table)
{
	if (table->format == TABLE_JSON)
		fputc(']', table->out);
	else if (table->format == TABLE_HTML)
		fputs("</tbody></table></div>\n", table->out);
	return table->error;
}
