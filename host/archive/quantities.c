/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What an analysis says, as rows: a table for each place of quantity.def, a column for each value of it.
 * Made, filled and read by the same lines, so that an archive of before gets the columns of today.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/quantities.h"
#include "host/result/said.h"
#include "common/base/text.h"

const struct quantity *quantities_next(enum quantity_object object, const struct quantity *last)
{
	do
		last = quantity_next(object, last);
	while (last != NULL && last->kind == QUANTITY_NAMES); /* only JSON has them */
	return last;
}

/* Ends the statement in text and prepares it. */
static int quantities_query(struct archive *archive, sqlite3_stmt **s, struct text *text)
{
	int result = text_close(text, 0);

	if (result != 0)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	result = sql_query(archive, s, text->bytes, "");
	free(text->bytes);
	return result;
}

static int quantities_begin(struct archive *archive, struct text *text)
{
	return text_open(text) == 0 ? 0 : archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
}

/* What is written of each value that is kept, with a comma in front. */
static void each(FILE *out, const struct quantity_home *home,
                 void (*put)(FILE *, const struct quantity_home *, const struct quantity *))
{
	const struct quantity *q = NULL;

	while ((q = quantities_next(home->object, q))) {
		fputs(", ", out);
		put(out, home, q);
	}
}

static void put_key(FILE *out, const struct quantity_home *home, const struct quantity *q)
{
	(void)home;
	fprintf(out, "\"%s\"", q->key);
}

static void put_mark(FILE *out, const struct quantity_home *home, const struct quantity *q)
{
	(void)home;
	(void)q;
	fputc('?', out);
}

/* ---- tables ---- */

static int need_column(struct archive *archive, const char *table, const char *column)
{
	char text[200];
	int64_t has = 0;
	int result = sql_number(archive, &has, "SELECT COUNT(*) FROM pragma_table_info(?) WHERE name = ?",
	                        "ss", table, column);

	if (result != 0 || has)
		return result;
	snprintf(text, sizeof(text), "ALTER TABLE %s ADD COLUMN \"%s\"", table, column);
	return sql_script(archive, text);
}

/* A new one with all its columns at once: each that is added later costs a rewrite of the schema. */
static int need_table(struct archive *archive, const struct quantity_home *home)
{
	const struct quantity *q = NULL;
	struct text text;
	int result = quantities_begin(archive, &text);

	if (result != 0)
		return result;
	fprintf(text.out,
	        "CREATE TABLE IF NOT EXISTS %s (result_id INTEGER NOT NULL REFERENCES results(id)"
	        " ON DELETE CASCADE, subject TEXT NOT NULL, ",
	        home->table);
	while ((q = quantities_next(home->object, q)) != NULL)
		fprintf(text.out, "\"%s\", ", q->key);
	fputs("PRIMARY KEY (result_id, subject)) WITHOUT ROWID", text.out);
	if (text_close(&text, 0) != 0)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	result = sql_script(archive, text.bytes);
	while (result == 0 && (q = quantities_next(home->object, q)) != NULL)
		result = need_column(archive, home->table, q->key);
	free(text.bytes);
	return result;
}

int quantities_shape(struct archive *archive)
{
	int result = 0;

	for (int p = 0; p < QUANTITY_PLACES && result == 0; p++)
		result = need_table(archive, &quantity_homes[p]);
	for (int i = 0; i < QUANTITY_COLUMNS && result == 0; i++) {
		result = need_column(archive, "results", quantity_columns[i].value);
		if (result == 0)
			result = need_column(archive, "results", quantity_columns[i].sigma);
	}
	return result;
}

/* ---- from an analysis, or from the JSON of one ---- */

/* An object in memory, or else in JSON. */
static int quantities_bind(struct archive *archive, sqlite3_stmt *s, int at, const struct quantity *q,
                           const void *object, const cJSON *json)
{
	char text[QUANTITY_TEXT_MAX];
	double number;

	if (json != NULL ? said_words(json, q->key, text) : quantity_words(q, object, text))
		return sql_bind_text(archive, s, at, text);
	number = json != NULL ? said_number(json, q->key) : quantity_number(q, object);
	if (isfinite(number))
		sqlite3_bind_double(s, at, number);
	return 0;
}

static int insert_object(struct archive *archive, int64_t row, const struct quantity_home *home,
                         const char *subject, const void *object, const cJSON *json)
{
	const struct quantity *q = NULL;
	struct text text;
	sqlite3_stmt *s;
	int at = 3, result = quantities_begin(archive, &text);

	if (result != 0)
		return result;
	fprintf(text.out, "INSERT OR IGNORE INTO %s (result_id, subject", home->table);
	each(text.out, home, put_key);
	fputs(") VALUES (?, ?", text.out);
	each(text.out, home, put_mark);
	fputs(")", text.out);
	result = quantities_query(archive, &s, &text);
	if (result != 0)
		return result;
	sqlite3_bind_int64(s, 1, row);
	result = sql_bind_text(archive, s, 2, subject);
	while (result == 0 && (q = quantities_next(home->object, q)))
		result = quantities_bind(archive, s, at++, q, object, json);
	if (result == 0)
		result = sql_step(archive, s);
	sqlite3_finalize(s);
	return result;
}

int quantities_insert(struct archive *archive, int64_t row, struct result *said)
{
	int result = 0;

	for (int p = 0; p < QUANTITY_PLACES && result == 0; p++) {
		const char *subject;
		void *object;

		for (size_t i = 0;
		     result == 0 && (object = result_at(said, (enum quantity_place)p, i, &subject)); i++)
			result = insert_object(archive, row, &quantity_homes[p], subject, object, NULL);
	}
	return result;
}

static int fill_row(struct archive *archive, int64_t row, const char *text)
{
	cJSON *json = cJSON_Parse(text);
	int result = json != NULL ? 0 : archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));

	for (int p = 0; p < QUANTITY_PLACES && result == 0; p++) {
		struct said said;

		for (int i = 0; result == 0 && said_at(json, &quantity_homes[p], i, &said); i++)
			if (said.object != NULL)
				result = insert_object(archive, row, &quantity_homes[p], said.subject, NULL,
				                       said.object);
	}
	cJSON_Delete(json);
	return result;
}

int quantities_fill(struct archive *archive, int64_t row)
{
	sqlite3_stmt *s;
	int result = sql_query(
	        archive, &s,
	        "SELECT result_id, json FROM texts WHERE (?1 = 0 OR result_id = ?1) AND json_valid(json)",
	        "i", row);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		result = fill_row(archive, sqlite3_column_int64(s, 0), sql_text(s, 1));
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result;
}

/* ---- back to an analysis ---- */

/* Where a row goes; a channel or resultant that is new is made. NULL: there is no room. */
static void *object_of(struct result *said, enum quantity_place place, const char *subject)
{
	struct analysis *a = said->analysis;
	const char *whose;
	void *object;

	said->record->is_drop |= place == QUANTITY_AT_DROP;
	a->has_lag |= place == QUANTITY_AT_LAG;
	a->has_plate |= place == QUANTITY_AT_PLATE;
	a->has_rebound |= place == QUANTITY_AT_REBOUND;
	a->has_motion |= place == QUANTITY_AT_MOTION;
	for (size_t i = 0; (object = result_at(said, place, i, &whose)); i++)
		if (strcmp(whose, subject) == 0)
			return object;
	if (place != QUANTITY_AT_RESULTANT || a->resultant_count == ESTIMATE_SENSORS_MAX)
		return NULL;
	object = &a->resultants[a->resultant_count++];
	snprintf(((struct estimate_resultant *)object)->sensor, sizeof(a->resultants[0].sensor), "%.7s",
	         subject);
	return object;
}

static void quantities_read_row(sqlite3_stmt *s, const struct quantity_home *home, void *object)
{
	const struct quantity *q = NULL;
	int at = 1;

	while ((q = quantities_next(home->object, q))) {
		char text[QUANTITY_TEXT_MAX];

		if (quantity_words(q, object, text))
			quantity_set_text(q, object, sql_text(s, at));
		else
			quantity_set_number(q, object,
			                    sqlite3_column_type(s, at) == SQLITE_NULL
			                            ? (double)NAN
			                            : sqlite3_column_double(s, at));
		at++;
	}
}

int quantities_select(struct archive *archive, const struct quantity_home *home, sqlite3_stmt **s)
{
	struct text text;
	int result = quantities_begin(archive, &text);

	if (result != 0)
		return result;
	fputs("SELECT subject", text.out);
	each(text.out, home, put_key);
	fprintf(text.out, " FROM %s WHERE result_id = ?", home->table);
	return quantities_query(archive, s, &text);
}

/* Texts that an item has no room for become one of those that there are. */
static void budget_row(sqlite3_stmt *s, struct budget_item *item)
{
	const struct quantity *q = NULL;
	int at = 1;

	quantity_clear(QUANTITY_BUDGET, item);
	quantities_read_row(s, &quantity_homes[QUANTITY_AT_BUDGET], item);
	snprintf(item->what, sizeof(item->what), "%s", sql_text(s, 0));
	if (isnan(item->degrees))
		item->degrees = (double)INFINITY;
	for (; (q = quantities_next(QUANTITY_BUDGET, q)) != NULL; at++) {
		if (strcmp(q->key, "largest") == 0)
			snprintf(item->largest, sizeof(item->largest), "%s", sql_text(s, at));
		if (strcmp(q->key, "rule") == 0)
			item->method = sql_text(s, at)[0] == 'd' ? "distribution" : "linear";
	}
}

int quantities_budget(struct archive *archive, sqlite3_stmt **s, int64_t row,
                      struct budget_item item[QUANTITY_COLUMNS])
{
	const struct quantity_home *home = &quantity_homes[QUANTITY_AT_BUDGET];
	int result = *s != NULL ? 0 : quantities_select(archive, home, s);

	if (result != 0)
		return result;
	sqlite3_bind_int64(*s, 1, row);
	while ((result = sql_step(archive, *s)) > 0)
		for (int i = 0; i < QUANTITY_COLUMNS; i++) {
			char what[QUANTITY_WHAT_MAX];

			quantity_column_what(&quantity_columns[i], what);
			if (strcmp(what, sql_text(*s, 0)) == 0)
				budget_row(*s, &item[i]);
		}
	sqlite3_reset(*s);
	return result;
}

void quantities_sensor(sqlite3_stmt *s, struct sensor_used *used)
{
	const struct quantity *q = NULL;

	memset(used, 0, sizeof(*used));
	quantities_read_row(s, &quantity_homes[QUANTITY_AT_SENSOR], used);
	snprintf(used->name, sizeof(used->name), "%s", sql_text(s, 0));
	for (int at = 1; (q = quantities_next(QUANTITY_SENSOR, q)) != NULL; at++)
		if (q->kind == QUANTITY_NAME)
			*(const char **)(void *)((char *)used + q->offset) = sql_text(s, at);
}

static int read_place(struct archive *archive, int64_t row, enum quantity_place place, struct result *said)
{
	const struct quantity_home *home = &quantity_homes[place];
	sqlite3_stmt *s;
	int result = quantities_select(archive, home, &s);

	if (result != 0)
		return result;
	sqlite3_bind_int64(s, 1, row);
	while ((result = sql_step(archive, s)) > 0) {
		void *object = object_of(said, place, sql_text(s, 0));

		if (object)
			quantities_read_row(s, home, object);
	}
	sqlite3_finalize(s);
	return result;
}

/* Channels as the result had them, for a record that no log has filled. */
static int read_channels(struct archive *archive, int64_t row, struct record *record)
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, "SELECT subject, rate_hz FROM of_samples WHERE result_id = ?",
	                       "i", row);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0)
		if (!(sqlite3_column_double(s, 1) > 0.0) ||
		    !record_add_channel(record, sql_text(s, 0), sqlite3_column_double(s, 1), 0)) {
			result = archive_refuse(archive, DT_E_FORMAT,
			                        "a channel of the result cannot be used");
			break;
		}
	sqlite3_finalize(s);
	return result;
}

static void quantities_clear(struct analysis *a)
{
	for (size_t i = 0; i < a->channel_count; i++) {
		quantity_clear(QUANTITY_BASELINE, &a->channels[i].baseline);
		quantity_clear(QUANTITY_PEAK, &a->channels[i].peak);
		quantity_clear(QUANTITY_PULSE, &a->channels[i].pulse);
		quantity_clear(QUANTITY_CONTACT, &a->channels[i].pulse);
		quantity_clear(QUANTITY_RINGDOWN, &a->channels[i].ringdown);
	}
	quantity_clear(QUANTITY_LAG, &a->lag);
	quantity_clear(QUANTITY_DRIVEN, &a->lag);
	quantity_clear(QUANTITY_RINGDOWN, &a->plate);
	quantity_clear(QUANTITY_REBOUND, &a->rebound);
	quantity_clear(QUANTITY_MOTION, &a->motion);
}

static unsigned flag_of(const char *name)
{
	unsigned flag = 1;

	while (record_flag_name(flag)[0] && strcmp(record_flag_name(flag), name) != 0)
		flag <<= 1;
	return record_flag_name(flag)[0] ? flag : 0;
}

/* The flags of the record and of its channels. */
static int read_flags(struct archive *archive, int64_t row, struct result *said)
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, "SELECT channel, flag FROM flags WHERE result_id = ?", "i", row);

	if (result != 0)
		return result;
	said->record->flags = 0;
	while ((result = sql_step(archive, s)) > 0) {
		unsigned flag = flag_of(sql_text(s, 1));

		if (sql_text(s, 0)[0] == '\0')
			said->record->flags |= flag;
		for (size_t i = 0; i < said->analysis->channel_count; i++)
			if (strcmp(said->record->channels[i].name, sql_text(s, 0)) == 0)
				said->analysis->channels[i].flags |= flag;
	}
	sqlite3_finalize(s);
	return result;
}

int quantities_read(struct archive *archive, int64_t row, struct result *said)
{
	bool from_log = said->record->channel_count > 0;
	struct analysis *a = said->analysis;
	int result = from_log ? 0 : read_channels(archive, row, said->record);

	if (result != 0)
		return result;
	*a = (struct analysis){.channels = calloc(said->record->channel_count + 1, sizeof(*a->channels)),
	                       .channel_count = said->record->channel_count};
	if (a->channels == NULL)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	quantities_clear(a);
	for (int p = 0; p < QUANTITY_PLACES && result == 0; p++)
		if (!from_log ||
		    (p != QUANTITY_AT_RECORD && p != QUANTITY_AT_DROP && p != QUANTITY_AT_SAMPLES))
			result = read_place(archive, row, (enum quantity_place)p, said);
	if (result == 0)
		result = read_flags(archive, row, said);
	return result;
}
