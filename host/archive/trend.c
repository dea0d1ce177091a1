/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How a series went: what its drops measured, of the product and of their tower, in their order; of channels
 * that have no column in tables of drops, as recordings of others have, what analyze --repeats tells.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/private.h"
#include "host/archive/table.h"

struct trends {
	struct repeats *repeats;
	double angle_deg, height_m;
	char scene_name[ARCHIVE_TEXT_MAX + 1];
	bool undecided;
	unsigned *counted; /* numbers of the drops that count, in order */
	size_t room;
};

static int trends_count(struct trends *t, unsigned number)
{
	size_t room = t->room > 0 ? 2 * t->room : 64;
	unsigned *more;

	if (t->repeats->repeats == t->room) {
		more = realloc(t->counted, room * sizeof(*more));
		if (more == NULL)
			return DT_E_MEMORY;
		t->counted = more;
		t->room = room;
	}
	t->counted[t->repeats->repeats++] = number;
	return 0;
}

static int trends_take(void *context, const struct archive_drop *drop)
{
	struct trends *t = context;

	if (!archive_counts(drop, t->undecided))
		return 0;
	if (trends_count(t, drop->number) != 0)
		return DT_E_MEMORY;
	t->angle_deg = drop->series.angle_deg;
	t->height_m = drop->series.height_m;
	snprintf(t->scene_name, sizeof(t->scene_name), "%s", drop->series.scene_name);
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		if (isfinite(drop->value[i]) &&
		    repeats_value(&t->repeats->row[i], drop->number, drop->value[i]) != 0)
			return DT_E_MEMORY;
	return 0;
}

/* Scatter of each value in all series of this scene, height and angle, this one among them. */
static int trends_pool(struct archive *archive, const struct trends *t)
{
	struct archive_filter filter = archive_filter_none();
	struct archive_table table;
	int result;

	filter.scene_name = t->scene_name;
	filter.angle_deg = t->angle_deg;
	result = archive_table(archive, &filter, t->undecided, &table);
	if (result != 0)
		return result;
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		struct repeats_row *row = &t->repeats->row[i];
		double squares = 0;

		for (size_t c = 0; c < table.count; c++) {
			const struct archive_mean *m = &table.cell[c].value[i];

			if (m->n < 2 || fabs(table.cell[c].height_m - t->height_m) > 1e-9)
				continue;
			squares += m->squares;
			row->degrees += m->n - 1.0;
		}
		row->pooled = row->degrees > 0 ? squares / row->degrees : 0;
	}
	archive_table_free(&table);
	return 0;
}

/* A QUANTITY_TOWER, in the newest result of each drop. */
static int trends_tower(struct archive *archive, const char *series, struct repeats_row *row)
{
	char query[400];
	sqlite3_stmt *s;
	int result;

	snprintf(query, sizeof(query),
	         "SELECT d.number, t.\"%s\" AS value FROM drops d JOIN series g ON g.id = d.series_id"
	         " JOIN of_tower t ON t.result_id = (SELECT max(id) FROM results WHERE drop_id = d.id)"
	         " WHERE g.name = ? AND value IS NOT NULL ORDER BY d.number",
	         row->quantity->key);
	result = sql_query(archive, &s, query, "s", series);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		result = repeats_value(row, (size_t)sqlite3_column_int64(s, 0), sqlite3_column_double(s, 1));
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result;
}

static bool has_column(const char *subject)
{
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		if (strcmp(quantity_columns[i].subject, subject) == 0)
			return true;
	return false;
}

static int by_number(const void *a, const void *b)
{
	unsigned one = *(const unsigned *)a, other = *(const unsigned *)b;

	return (one > other) - (one < other);
}

/* Values of one kind, by channel and drop; a row for each channel without a column. */
static int trends_channels(const struct trends *t, struct archive *archive, sqlite3_stmt *s,
                           const struct quantity *quantity)
{
	struct repeats *repeats = t->repeats;
	struct repeats_row *row = NULL;
	int result;

	while ((result = sql_step(archive, s)) > 0) {
		const char *subject = sql_text(s, 0);
		unsigned number = (unsigned)sqlite3_column_int64(s, 1);

		if (has_column(subject) ||
		    bsearch(&number, t->counted, repeats->repeats, sizeof(number), by_number) == NULL)
			continue;
		if (row == NULL || strcmp(row->channel, subject) != 0)
			row = repeats_row_new(repeats, subject, quantity);
		if (row == NULL || repeats_value(row, number, sqlite3_column_double(s, 2)) != 0)
			return DT_E_MEMORY;
	}
	return result;
}

static int trends_others(const struct trends *t, struct archive *archive, const char *series)
{
	enum quantity_place place;
	const struct quantity *quantity;
	int result = 0;

	qsort(t->counted, t->repeats->repeats, sizeof(*t->counted), by_number);
	for (size_t i = 0; result == 0 && (quantity = repeats_wanted(i, &place)) != NULL; i++) {
		char query[400];
		sqlite3_stmt *s;

		snprintf(query, sizeof(query),
		         "SELECT t.subject, d.number, t.\"%s\" AS value FROM drops d JOIN series g ON g.id = "
		         "d.series_id"
		         " JOIN %s t ON t.result_id = (SELECT max(id) FROM results WHERE drop_id = d.id)"
		         " WHERE g.name = ? AND value IS NOT NULL AND t.status = 'ok' ORDER BY t.subject, "
		         "d.number",
		         quantity->key, quantity_homes[place].table);
		result = sql_query(archive, &s, query, "s", series);
		if (result != 0)
			return result;
		result = trends_channels(t, archive, s, quantity);
		sqlite3_finalize(s);
	}
	return result;
}

static int trends_rows(struct repeats *repeats)
{
	const struct quantity *q = NULL;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		const struct quantity_column *c = &quantity_columns[i];
		struct repeats_row *row = repeats_row_new(
		        repeats, c->subject, quantity_find(quantity_homes[c->place].object, c->key));

		if (row == NULL)
			return DT_E_MEMORY;
		row->title = c->title;
	}
	while ((q = quantity_next(QUANTITY_TOWER, q)) != NULL) {
		struct repeats_row *row = q->label[0] != '\0' ? repeats_row_new(repeats, "tower", q) : NULL;

		if (row != NULL)
			row->title = q->label;
		else if (q->label[0] != '\0')
			return DT_E_MEMORY;
	}
	return 0;
}

/* Rows of fewer values than three say nothing that a mean does not. */
static void trends_close(struct repeats *repeats, size_t others)
{
	size_t kept = 0;

	for (size_t i = 0; i < repeats->rows; i++) {
		if (i < ARCHIVE_VALUE_COUNT || i >= others)
			repeats->row[i].left_out = repeats->repeats - repeats->row[i].count;
		if (repeats->row[i].count < 3)
			repeats_row_free(&repeats->row[i]);
		else
			repeats->row[kept++] = repeats->row[i];
	}
	repeats->rows = kept;
	repeats_close(repeats);
}

int archive_trends(struct archive *archive, const char *series, bool undecided, struct repeats *repeats)
{
	struct archive_filter filter = archive_filter_none();
	struct trends t = {.repeats = repeats, .undecided = undecided};
	size_t others;
	int result;

	*repeats = (struct repeats){.one = "drop"};
	filter.series = series;
	result = trends_rows(repeats);
	if (result == 0)
		result = archive_each_numbers(archive, &filter, trends_take, &t);
	if (result == 0 && repeats->repeats > 1)
		result = trends_pool(archive, &t);
	for (size_t i = ARCHIVE_VALUE_COUNT; result == 0 && i < repeats->rows; i++)
		result = trends_tower(archive, series, &repeats->row[i]);
	others = repeats->rows;
	if (result == 0 && repeats->repeats > 0)
		result = trends_others(&t, archive, series);
	free(t.counted);
	if (result == 0)
		trends_close(repeats, others);
	else
		repeats_free(repeats);
	return result == DT_E_MEMORY ? archive_refuse(archive, result, "%s", error_text(result)) : result;
}
