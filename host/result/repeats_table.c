/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/result/repeats.h"

/* A row as it is told: of people in the unit that they read. */
struct repeats_line {
	struct repeats_row row;
	const char *key, *unit;
	char name[96], mean[32], sd[32], limits[64], change[48], words[96];
	double change_percent, sigma_change_percent, changes_at, stands_out;
	cJSON *numbers, *values;
};

#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct repeats_line, member, __VA_ARGS__)
static const struct table_column columns[] = {
        COLUMN(CHARS, name, .title = "course of", .width = -28),
        COLUMN(CHARS, row.channel, .key = "channel"),
        COLUMN(WORDS, key, .key = "quantity"),
        COLUMN(LARGE, row.count, .key = "count", .title = "n", .width = 4),
        COLUMN(LARGE, row.left_out, .key = "left_out", .title = "out", .width = 4),
        COLUMN(NUMBER, row.mean, .key = "mean"),
        COLUMN(NUMBER, row.sd, .key = "sd"),
        COLUMN(CHARS, mean, .title = "mean", .width = 11),
        COLUMN(CHARS, sd, .title = "SD", .width = 9),
        COLUMN(WORDS, unit, .title = "", .width = -4),
        COLUMN(CHARS, limits, .title = "limits of one", .width = 22),
        COLUMN(NUMBER, row.low, .key = "chart_low"),
        COLUMN(NUMBER, row.high, .key = "chart_high"),
        COLUMN(NUMBER, row.step, .key = "chart_step"),
        COLUMN(WHOLE, row.beyond, .key = "beyond", .title = "beyond", .width = 6),
        COLUMN(WHOLE, row.steps, .key = "steps_beyond"),
        COLUMN(NUMBER, row.trend, .key = "trend_per_repeat"),
        COLUMN(NUMBER, row.sigma_trend, .key = "sigma_trend_per_repeat"),
        COLUMN(NUMBER, change_percent, .key = "change_percent"),
        COLUMN(NUMBER, sigma_change_percent, .key = "sigma_change_percent"),
        COLUMN(CHARS, change, .title = "first to last %", .width = 19),
        COLUMN(YES, row.moves, .key = "moves"),
        COLUMN(NUMBER, row.step_t, .key = "step_t"),
        COLUMN(NUMBER, changes_at, .key = "changes_at"),
        COLUMN(NUMBER, stands_out, .key = "stands_out"),
        COLUMN(CHARS, words, .title = "", .width = -1, .gap = "  "),
        COLUMN(ITEM, numbers, .key = "number"),
        COLUMN(ITEM, values, .key = "value"),
};

static void line_words(struct repeats_line *line, const char *one)
{
	const struct repeats_row *r = &line->row;
	size_t used;

	if (r->change_at > 0)
		snprintf(line->words, sizeof(line->words), "another from %s %u on", one, r->change_at);
	else if (r->moves)
		snprintf(line->words, sizeof(line->words), r->change > 0 ? "rises" : "falls");
	else if (isfinite(r->trend))
		snprintf(line->words, sizeof(line->words), "no trend");
	used = strlen(line->words);
	if (r->stands_out > 0)
		snprintf(line->words + used, sizeof(line->words) - used, "; %s %u stands out", one,
		         r->stands_out);
}

static void line_numbers(struct repeats_line *line)
{
	const struct repeats_row *r = &line->row;
	double scale = quantity_scale(r->quantity);
	int digits = r->quantity->digits;

	if (r->count > 0)
		snprintf(line->mean, sizeof(line->mean), "%.*f", digits, r->mean * scale);
	if (isfinite(r->sd))
		snprintf(line->sd, sizeof(line->sd), "%.*f", digits + 1, r->sd * scale);
	if (isfinite(r->low))
		snprintf(line->limits, sizeof(line->limits), "%.*f .. %.*f", digits + 1, r->low * scale,
		         digits + 1, r->high * scale);
	if (isfinite(r->change))
		snprintf(line->change, sizeof(line->change), "%.2f +- %.2f", line->change_percent,
		         line->sigma_change_percent);
}

static cJSON *list_of(const double *value, size_t count)
{
	cJSON *whole = cJSON_CreateObject(), *list;
	struct builder b = {.failed = whole == NULL};

	put_numbers(&b, whole, "list", value, count);
	list = cJSON_DetachItemFromObject(whole, "list");
	cJSON_Delete(whole);
	return list;
}

static void put_line(struct table *table, const struct repeats_row *row, const char *one)
{
	struct repeats_line line = {.row = *row, .key = row->quantity->key, .unit = row->quantity->shown};

	line.change_percent = 100 * row->change;
	line.sigma_change_percent = 100 * row->sigma_change;
	line.changes_at = row->change_at > 0 ? (double)row->change_at : (double)NAN;
	line.stands_out = row->stands_out > 0 ? (double)row->stands_out : (double)NAN;
	if (row->title != NULL)
		snprintf(line.name, sizeof(line.name), "%s%s",
		         row->quantity->object == QUANTITY_TOWER ? "tower, " : "", row->title);
	else
		snprintf(line.name, sizeof(line.name), "%s %s", row->channel, line.key);
	line_words(&line, one);
	line_numbers(&line);
	if (table->format == TABLE_JSON) {
		line.numbers = list_of(row->number, row->count);
		line.values = list_of(row->value, row->count);
	}
	table_row(table, &line);
}

int repeats_table(const struct repeats *repeats, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};

	table_begin(&table, columns, TABLE_COUNT(columns));
	for (size_t i = 0; i < repeats->rows; i++)
		put_line(&table, &repeats->row[i], repeats->one != NULL ? repeats->one : "repeat");
	return table_end(&table);
}
