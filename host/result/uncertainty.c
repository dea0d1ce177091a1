/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/uncertainty.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct uncertainty_row {
	struct budget_item item;
	char value[32], expanded[32];
	const char *unit;
};

#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct uncertainty_row, member, __VA_ARGS__)
static const struct table_column columns[] = {
        COLUMN(CHARS, item.what, .title = "uncertainty of", .width = -32),
        COLUMN(CHARS, value, .title = "value", .width = 11),
        COLUMN(CHARS, expanded, .title = "U", .width = 9),
        COLUMN(NUMBER, item.k, .title = "k", .width = 5, .digits = 2),
        COLUMN(WORDS, unit, .title = "", .width = -5),
        COLUMN(CHARS, item.largest, .title = "largest parts of u^2", .gap = "  "),
};

/* U to two digits, the value to its last place (GUM 7.2.6). */
static void rounded(struct uncertainty_row *row, double scale)
{
	double value = row->item.value * scale, expanded = row->item.expanded * scale, place;
	char text[32];
	int last;

	snprintf(text, sizeof(text), "%.1e", expanded);
	last = atoi(strchr(text, 'e') + 1) - 1;
	place = last > 0 ? pow(10.0, last) : 1.0;
	last = last < 0 ? -last : 0;
	value = last > 0 ? value : round(value / place) * place;
	expanded = last > 0 ? expanded : round(expanded / place) * place;
	snprintf(row->value, sizeof(row->value), "%.*f", last, value);
	snprintf(row->expanded, sizeof(row->expanded), "%.*f", last, expanded);
}

int uncertainty_table(const struct budget_item *item, size_t count, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};

	table_begin(&table, columns, TABLE_COUNT(columns));
	for (size_t i = 0; i < count; i++) {
		struct uncertainty_row row = {.item = item[i], .unit = item[i].unit};
		bool seconds = strcmp(row.unit, "s") == 0;

		row.unit = seconds ? "ms" : row.unit;
		rounded(&row, seconds ? 1e3 : 1.0);
		table_row(&table, &row);
	}
	return table_end(&table);
}
