/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/print_private.h"

#include <string.h>

#include "host/result/uncertainty.h"

int print_done(int result, const struct table *table)
{
	if (result == 0)
		result = table->error;
	return result != 0 || (fflush(table->out) == 0 && !ferror(table->out)) ? result : DT_E_SYSTEM;
}

size_t print_narrow(struct table_column column[ARCHIVE_VALUE_COUNT], enum table_kind kind, size_t offset)
{
	size_t count = 0, size = kind == TABLE_VALUE ? sizeof(struct table_value) : sizeof(double);

	for (size_t i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		const struct quantity_column *c = &quantity_columns[i];

		if (c->head[0] == '\0')
			continue;
		column[count++] = (struct table_column){.kind = kind,
		                                        .offset = offset + i * size,
		                                        .title = c->head,
		                                        .unit = strcmp(c->shown, "g") != 0 ? c->shown : "",
		                                        .gap = "",
		                                        .width = kind == TABLE_VALUE ? 8 : 9,
		                                        .digits = c->digits,
		                                        .scale = quantity_column_scale(c)};
	}
	return count;
}

struct archive_filter print_begin(struct print *p, const struct archive_filter *filter)
{
	struct archive_filter wider = *filter;

	p->table.limit = filter->limit;
	if (filter->limit != 0)
		wider.limit++;
	return wider;
}

void print_more(const struct print *p)
{
	if (p->table.more)
		fprintf(p->table.out, "there are more: these are the newest %zu\n", p->table.rows);
}

void print_uncertainties(const struct archive_cell *cell, FILE *out)
{
	struct budget_item item[ARCHIVE_VALUE_COUNT];
	size_t count = archive_cell_uncertainties(cell, item);

	if (count == 0)
		return;
	fputc('\n', out);
	(void)uncertainty_table(item, count, TABLE_TEXT, out);
	fputs("U = k u of the mean covers 95.45 %. Scatter falls with the number of drops; all other parts "
	      "are the "
	      "same in each,\nand cancel in differences between drops, SD and trends.\n",
	      out);
}

/* ---- series ---- */

struct series_row {
	struct archive_series series;
	char faulty[48];
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct series_row, series.member, __VA_ARGS__)

const struct table_column print_series_columns[PRINT_SERIES_COLUMNS] = {
        COLUMN(WORDS, name, .key = "name", .csv = "series", .title = "series", .width = -20),
        COLUMN(WORDS, campaign, .key = "campaign", .title = "campaign", .width = -11),
        COLUMN(WORDS, scene_name, .key = "scene", .title = "scene", .width = -16),
        COLUMN(NUMBER, angle_deg, .key = "angle_deg", .title = "deg", .width = 5, .digits = TABLE_DIGITS_G),
        COLUMN(NUMBER, height_m, .key = "height_m"),
        COLUMN(WHOLE, planned, .key = "planned", .title = "planned", .width = 7),
        COLUMN(WHOLE, recorded, .key = "recorded", .title = "recorded", .width = 8),
        COLUMN(WHOLE, accepted, .key = "accepted", .title = "accepted", .width = 8),
        COLUMN(WHOLE, rejected, .key = "rejected", .title = "rejected", .width = 8),
        COLUMN(WHOLE, partial, .key = "partial", .title = "partial", .width = 7),
        COLUMN(WORDS, created, .key = "created"),
        COLUMN(WORDS, last, .key = "last", .title = "last drop", .gap = "  ", .digits = 10),
        COLUMN(WHOLE, faulty, .key = "faulty"),
        TABLE_COLUMN(CHARS, struct series_row, faulty, .title = "", .gap = ""),
        COLUMN(WORDS, scene, .key = "scene_text", .csv = ""),
};
#undef COLUMN

static int print_put_series(void *context, const struct archive_series *series)
{
	struct print *p = context;
	struct series_row row = {.series = *series};

	if (series->faulty > 0)
		snprintf(row.faulty, sizeof(row.faulty), "  %u altered or missing", series->faulty);
	table_row(&p->table, &row);
	return 0;
}

int print_series(struct archive *archive, const struct archive_filter *filter, enum table_format format,
                 FILE *out)
{
	struct print p = {.table = {.out = out, .format = format}, .archive = archive};
	struct archive_filter asked = print_begin(&p, filter);
	int result;

	fputs(format == TABLE_JSON ? "{\"series\":" : "", out);
	table_begin(&p.table, print_series_columns, PRINT_SERIES_COLUMNS - 1);
	result = archive_each_series(archive, &asked, print_put_series, &p);
	table_end(&p.table);
	if (format == TABLE_JSON)
		fprintf(out, ",\"more\":%s}\n", p.table.more ? "true" : "false");
	if (format == TABLE_TEXT && p.table.rows == 0 && result == 0)
		fputs("no series\n", out);
	if (format == TABLE_TEXT)
		print_more(&p);
	return print_done(result, &p.table);
}
