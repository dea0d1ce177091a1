/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Looking into an archive.
 */
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "common/base/date.h"
#include "host/record/digest.h"
#include "host/archive/quantities.h"

struct archive_filter archive_filter_none(void)
{
	return (struct archive_filter){.angle_deg = NAN};
}

bool archive_parse_dates(const char *text, struct archive_dates *dates, struct archive_filter *filter)
{
	const char *dots = strstr(text, "..");
	size_t length = dots != NULL ? (size_t)(dots - text) : strlen(text);

	/* one character more than the longest of them, so that what is too long is none */
	snprintf(dates->from, sizeof(dates->from), "%.*s", length < 17 ? (int)length : 17, text);
	snprintf(dates->to, sizeof(dates->to), "%.17s", dots != NULL ? dots + 2 : dates->from);
	filter->from = dates->from;
	filter->to = dates->to;
	return date_is_period(dates->from) && date_is_period(dates->to);
}

/* ---- a statement with the conditions that were asked for ---- */

enum { QUERY_MAX = 8192, VALUES_MAX = 20, WORDS_MAX = 8, WORD_MAX = 60 };

struct query {
	char text[QUERY_MAX];
	const char *value[VALUES_MAX]; /* all are bound as text; numbers are compared as numbers */
	char number[3][32];
	char pattern[WORDS_MAX][2 * WORD_MAX + 3];
	int count;
};

static void look_add(struct query *q, const char *text, const char *value)
{
	size_t at = strlen(q->text);

	snprintf(q->text + at, sizeof(q->text) - at, "%s", text);
	if (value != NULL)
		q->value[q->count++] = value;
}

static void look_add_number(struct query *q, char to[32], const char *text, double value)
{
	snprintf(to, 32, "%.17g", value);
	look_add(q, text, to);
}

/* Whatever begins with `to` is not later than it: '~' is behind every character of a time. */
static void add_dates(struct query *q, const struct archive_filter *filter)
{
	if (filter->from != NULL)
		look_add(q, " AND d.time >= ?", filter->from);
	if (filter->to != NULL)
		look_add(q, " AND d.time < ? || '~'", filter->to);
}

/* For LIKE: word anywhere, its own wildcards as they are. */
static void put_pattern(char to[2 * WORD_MAX + 3], const char *word, size_t length)
{
	*to++ = '%';
	for (size_t i = 0; i < length; i++) {
		if (strchr("%_\\", word[i]) != NULL)
			*to++ = '\\';
		*to++ = word[i];
	}
	memcpy(to, "%", 2);
}

/* A series without drops has only its names. */
#define WORDS_OF_DROP                                                                                   \
	"s.name || ' ' || c.name || ' ' || s.scene_name || COALESCE(' ' || d.operator || ' ' || d.note" \
	" || ' ' || d.reason || ' ' || d.decision || ' ' || COALESCE((SELECT flags FROM results"        \
	" WHERE id = (SELECT MAX(id) FROM results WHERE drop_id = d.id)), ''), '')"

static int add_words(struct archive *archive, struct query *q, const char *text)
{
	static const char blanks[] = " \t\n";
	size_t length;

	if (text == NULL)
		return 0;
	for (int i = 0; *(text += strspn(text, blanks)) != '\0'; i++, text += length) {
		length = strcspn(text, blanks);
		if (i == WORDS_MAX || length > WORD_MAX)
			return archive_refuse(archive, DT_E_ARGUMENT,
			                      "text: expected at most %d words of at most %d characters",
			                      WORDS_MAX, WORD_MAX);
		put_pattern(q->pattern[i], text, length);
		look_add(q, " AND " WORDS_OF_DROP " LIKE ? ESCAPE '\\'", q->pattern[i]);
	}
	return 0;
}

static void add_conditions(struct query *q, const struct archive_filter *filter)
{
	look_add(q, " WHERE 1", NULL);
	if (filter->series != NULL)
		look_add(q, " AND s.name = ?", filter->series);
	if (filter->campaign != NULL)
		look_add(q, " AND c.name = ?", filter->campaign);
	if (filter->scene_name != NULL)
		look_add(q, " AND s.scene_name = ?", filter->scene_name);
	if (!isnan(filter->angle_deg))
		look_add_number(q, q->number[0], " AND ABS(s.angle_deg - CAST(? AS REAL)) < 1e-9",
		                filter->angle_deg);
	if (filter->number != 0)
		look_add_number(q, q->number[1], " AND d.number = CAST(? AS INTEGER)", filter->number);
}

static void add_order(struct query *q, const struct archive_filter *filter, const char *newest,
                      const char *names)
{
	look_add(q, " ORDER BY ", NULL);
	look_add(q, filter->limit != 0 ? newest : names, NULL);
	if (filter->limit != 0)
		look_add_number(q, q->number[2], " LIMIT CAST(? AS INTEGER)", filter->limit);
}

static int look_start(struct archive *archive, const struct query *q, sqlite3_stmt **s)
{
	int result = sql_query(archive, s, q->text, "");

	if (result != 0)
		return result;
	for (int i = 0; result == 0 && i < q->count; i++)
		result = sql_bind_text(archive, *s, i + 1, q->value[i]);
	if (result != 0)
		sqlite3_finalize(*s);
	return result;
}

/* ---- series ---- */

#define SERIES_COLUMNS \
	"s.name, c.name, s.scene_name, s.angle_deg, s.height_m, s.plate_mass_kg, s.planned, s.created"
enum { SERIES_COLUMN_COUNT = 8 };

static struct archive_series series_of(sqlite3_stmt *s)
{
	return (struct archive_series){
	        .name = sql_text(s, 0),
	        .campaign = sql_text(s, 1),
	        .scene_name = sql_text(s, 2),
	        .scene = "",
	        .angle_deg = sqlite3_column_double(s, 3),
	        .height_m = sqlite3_column_double(s, 4),
	        .plate_mass_kg = sqlite3_column_double(s, 5),
	        .planned = (unsigned)sqlite3_column_int(s, 6),
	        .created = sql_text(s, 7),
	        .last = "",
	};
}

int archive_each_series(struct archive *archive, const struct archive_filter *filter,
                        int (*each)(void *context, const struct archive_series *series), void *context)
{
	struct query q = {.count = 0};
	sqlite3_stmt *s;
	int result = 0;

	look_add(&q,
	         "SELECT " SERIES_COLUMNS ", s.scene, SUM(d.state <> 'recording'),"
	         " SUM(d.decision = 'accepted' AND d.proof = ''), SUM(d.decision = 'rejected' AND d.proof = "
	         "''),"
	         " SUM(d.state = 'recording'), SUM(d.proof <> ''), MAX(d.time)"
	         " FROM series s JOIN campaigns c ON c.id = s.campaign_id LEFT JOIN drops d ON d.series_id = "
	         "s.id",
	         NULL);
	add_conditions(&q, filter);
	if (filter->from != NULL || filter->to != NULL || filter->text != NULL) {
		look_add(&q,
		         " AND s.id IN (SELECT s.id FROM series s JOIN campaigns c ON c.id = s.campaign_id"
		         " LEFT JOIN drops d ON d.series_id = s.id WHERE 1",
		         NULL);
		add_dates(&q, filter);
		result = add_words(archive, &q, filter->text);
		look_add(&q, ")", NULL);
	}
	look_add(&q, " GROUP BY s.id", NULL);
	add_order(&q, filter, "COALESCE(MAX(d.time), s.created) DESC, s.name",
	          "c.name, s.scene_name, s.height_m, s.angle_deg, s.name");
	if (result == 0)
		result = look_start(archive, &q, &s);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		struct archive_series series = series_of(s);

		series.scene = sql_text(s, SERIES_COLUMN_COUNT);
		series.recorded = (unsigned)sqlite3_column_int(s, SERIES_COLUMN_COUNT + 1);
		series.accepted = (unsigned)sqlite3_column_int(s, SERIES_COLUMN_COUNT + 2);
		series.rejected = (unsigned)sqlite3_column_int(s, SERIES_COLUMN_COUNT + 3);
		series.partial = (unsigned)sqlite3_column_int(s, SERIES_COLUMN_COUNT + 4);
		series.faulty = (unsigned)sqlite3_column_int(s, SERIES_COLUMN_COUNT + 5);
		series.last = sql_text(s, SERIES_COLUMN_COUNT + 6);
		result = each(context, &series);
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result;
}

/* ---- drops ---- */

bool archive_is_recording(const struct archive *archive, const char *raw)
{
	char path[ARCHIVE_PATH_MAX];
	bool held;
	int fd;

	snprintf(path, sizeof(path), "%s/%.200s", archive->folder, raw);
	fd = open(path, O_RDONLY | O_CLOEXEC);
	if (fd < 0)
		return false;
	held = flock(fd, LOCK_SH | LOCK_NB) != 0;
	close(fd);
	return held;
}

static double number_or_nan(sqlite3_stmt *s, int column)
{
	return sqlite3_column_type(s, column) == SQLITE_NULL ? (double)NAN : sqlite3_column_double(s, column);
}

static const char drop_columns[] =
        "SELECT " SERIES_COLUMNS
        ", d.number, CASE d.proof WHEN '' THEN d.state ELSE d.proof END, d.decision, d.reason, d.operator, "
        "d.note, d.raw, d.sha256,"
        " d.time, d.bytes, d.simulated, v.name, r.not_ok, r.flags, d.entry, d.fault, d.id, r.quantities, "
        "(SELECT decision FROM of_verdict WHERE result_id = r.id), r.id"
#define QUANTITY_COLUMN(NAME, name, unit, ...) ", r." name "_" unit ", r." name "_sigma_" unit
#include "host/result/quantity.def"
        ;

/* The same columns, of which means need only these: half the time for ten thousand drops. */
static const char drop_numbers[] =
        "SELECT " SERIES_COLUMNS
        ", d.number, d.proof, d.decision, NULL, NULL, NULL, NULL, substr(d.sha256, 1, 1)"
        ", NULL, NULL, NULL, NULL, r.not_ok, NULL, NULL, NULL, d.id, NULL, NULL, r.id"
#define QUANTITY_COLUMN(NAME, name, unit, ...) ", r." name "_" unit ", NULL"
#include "host/result/quantity.def"
        ;

static int drop_of(struct archive *archive, sqlite3_stmt *s, sqlite3_stmt **budgets,
                   struct archive_drop *drop)
{
	enum { N = SERIES_COLUMN_COUNT, RESULT = N + 19, VALUES = N + 20 };

	*drop = (struct archive_drop){
	        .series = series_of(s),
	        .number = (unsigned)sqlite3_column_int(s, N),
	        .state = sql_text(s, N + 1),
	        .decision = sql_text(s, N + 2),
	        .reason = sql_text(s, N + 3),
	        .operator_name = sql_text(s, N + 4),
	        .note = sql_text(s, N + 5),
	        .raw = sql_text(s, N + 6),
	        .sha256 = sql_text(s, N + 7),
	        .time = sql_text(s, N + 8),
	        .bytes = sqlite3_column_int64(s, N + 9),
	        .simulated = sqlite3_column_int(s, N + 10) != 0,
	        .version = (const char *)sqlite3_column_text(s, N + 11),
	        .not_ok = (unsigned)sqlite3_column_int(s, N + 12),
	        .flags = sql_text(s, N + 13),
	        .sealed = sqlite3_column_int64(s, N + 14) != 0,
	        .fault = sql_text(s, N + 15),
	        .quantities = sql_text(s, N + 17),
	        .verdict = sql_text(s, N + 18),
	};
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		drop->value[i] = number_or_nan(s, VALUES + 2 * i);
		drop->sigma[i] = number_or_nan(s, VALUES + 2 * i + 1);
	}
	for (size_t i = 0; i < archive->marks; i++)
		if (archive->mark[i].drop == sqlite3_column_int64(s, N + 16)) {
			drop->state = archive->mark[i].missing ? "missing" : "altered";
			drop->fault = archive->mark[i].fault;
		}
	if (strcmp(drop->state, "recording") == 0 && !archive_is_recording(archive, drop->raw))
		drop->state = "interrupted";
	return quantities_budget(archive, budgets, sqlite3_column_int64(s, RESULT), drop->budget);
}

static int ask_for_drops(struct archive *archive, struct query *q, const char *columns,
                         const struct archive_filter *filter)
{
	int result;

	look_add(q, columns, NULL);
	look_add(q,
	         " FROM drops d JOIN series s ON s.id = d.series_id"
	         " JOIN campaigns c ON c.id = s.campaign_id LEFT JOIN results r ON r.id = ",
	         NULL);
	if (filter->version != NULL)
		look_add(q,
		         "(SELECT id FROM results WHERE drop_id = d.id AND version_id ="
		         " (SELECT id FROM versions WHERE name = ?))",
		         filter->version);
	else
		look_add(q, "(SELECT MAX(id) FROM results WHERE drop_id = d.id)", NULL);
	look_add(q, " LEFT JOIN versions v ON v.id = r.version_id", NULL);
	add_conditions(q, filter);
	add_dates(q, filter);
	result = add_words(archive, q, filter->text);
	add_order(q, filter, "d.time DESC, d.id DESC",
	          "c.name, s.scene_name, s.height_m, s.angle_deg, s.name, d.number");
	return result;
}

static int each_drop(struct archive *archive, const char *columns, const struct archive_filter *filter,
                     int (*each)(void *context, const struct archive_drop *drop), void *context)
{
	struct query q = {.count = 0};
	struct archive_drop drop;
	sqlite3_stmt *s, *budgets = NULL;
	int result = ask_for_drops(archive, &q, columns, filter);

	if (result == 0)
		result = look_start(archive, &q, &s);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		result = drop_of(archive, s, &budgets, &drop);
		if (result == 0)
			result = each(context, &drop);
		if (result != 0)
			break;
	}
	sqlite3_finalize(budgets);
	sqlite3_finalize(s);
	return result;
}

int archive_each_drop(struct archive *archive, const struct archive_filter *filter,
                      int (*each)(void *context, const struct archive_drop *drop), void *context)
{
	return each_drop(archive, drop_columns, filter, each, context);
}

int archive_each_numbers(struct archive *archive, const struct archive_filter *filter,
                         int (*each)(void *context, const struct archive_drop *drop), void *context)
{
	return each_drop(archive, drop_numbers, filter, each, context);
}

/* ---- the rest ---- */

int archive_each_event(struct archive *archive, const char *drop,
                       int (*each)(void *context, const struct archive_event *event), void *context)
{
	struct archive_place place;
	sqlite3_stmt *s;
	int result = archive_locate(archive, drop, &place);

	if (result == 0)
		result = sql_query(
		        archive, &s,
		        "SELECT time, what, operator, text FROM events WHERE drop_id = ? ORDER BY id", "i",
		        place.drop);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		struct archive_event event = {sql_text(s, 0), sql_text(s, 1), sql_text(s, 2), sql_text(s, 3)};

		result = each(context, &event);
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result;
}

/* The row of a drop's result. */
static int look_result(struct archive *archive, const char *drop, const char *version, int64_t *row)
{
	struct archive_place place;
	int result = archive_locate(archive, drop, &place);

	if (result == 0)
		result = sql_number(archive, row,
		                    "SELECT r.id FROM results r JOIN versions v ON v.id = r.version_id"
		                    " WHERE r.drop_id = ?1 AND (?2 IS NULL OR v.name = ?2)"
		                    " ORDER BY r.id DESC LIMIT 1",
		                    "is", place.drop, version);
	if (result == DT_E_EMPTY)
		return archive_refuse(archive, result, "%.100s: no result", drop);
	return result;
}

int archive_each_sensor(struct archive *archive, const char *drop, const char *version,
                        int (*each)(void *context, const struct sensor_used *sensor), void *context)
{
	const struct quantity_home *home = &quantity_homes[QUANTITY_AT_SENSOR];
	struct sensor_used used;
	sqlite3_stmt *s;
	int64_t row = 0;
	int result = look_result(archive, drop, version, &row);

	if (result == 0)
		result = quantities_select(archive, home, &s);
	if (result != 0)
		return result;
	sqlite3_bind_int64(s, 1, row);
	while ((result = sql_step(archive, s)) > 0) {
		quantities_sensor(s, &used);
		result = each(context, &used);
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result;
}

int archive_check(struct archive *archive, const char *serial, const char *time, bool after,
                  struct archive_check *check)
{
	static const char *const when[] = {"d.time < ? ORDER BY d.time DESC", "d.time > ? ORDER BY d.time"};
	char query[480];
	sqlite3_stmt *s;
	int result;

	*check = (struct archive_check){.e_n = (double)NAN};
	snprintf(query, sizeof(query),
	         "SELECT g.name || '/' || d.number, u.e_n FROM of_sensor u JOIN results r ON r.id = "
	         "u.result_id"
	         " JOIN drops d ON d.id = r.drop_id JOIN series g ON g.id = d.series_id"
	         " WHERE u.e_n IS NOT NULL AND u.serial = ? AND d.decision <> 'rejected'"
	         " AND r.id = (SELECT max(id) FROM results WHERE drop_id = d.id) AND %s LIMIT 1",
	         when[after]);
	result = sql_query(archive, &s, query, "ss", serial, time);
	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		snprintf(check->drop, sizeof(check->drop), "%s", sql_text(s, 0));
		check->e_n = sqlite3_column_double(s, 1);
	}
	sqlite3_finalize(s);
	return result < 0 ? result : 0;
}

int archive_analysis(struct archive *archive, const char *drop, const char *version, struct result *said)
{
	int64_t row = 0;
	int result = look_result(archive, drop, version, &row);

	if (result == 0)
		result = quantities_read(archive, row, said);
	if (result == 0 && said->analysis->channel_count == 0)
		result = archive_refuse(archive, DT_E_FORMAT, "%.100s: its result is no analysis", drop);
	return result;
}

int archive_json(struct archive *archive, const char *drop, const char *version, char **json)
{
	struct archive_place place;
	sqlite3_stmt *s;
	int result = archive_locate(archive, drop, &place);

	if (result == 0)
		result = sql_query(archive, &s,
		                   "SELECT t.json FROM results r JOIN versions v ON v.id = r.version_id"
		                   " JOIN texts t ON t.result_id = r.id"
		                   " WHERE r.drop_id = ?1 AND (?2 IS NULL OR v.name = ?2)"
		                   " ORDER BY r.id DESC LIMIT 1",
		                   "is", place.drop, version);
	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		*json = strdup(sql_text(s, 0));
		result = *json != NULL ? 0
		                       : archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	} else if (result == 0) {
		result =
		        archive_refuse(archive, DT_E_EMPTY, "%.100s: no result%s%.60s", drop,
		                       version != NULL ? " by version " : "", version != NULL ? version : "");
	}
	sqlite3_finalize(s);
	return result;
}

int archive_changes(struct archive *archive, int64_t *number)
{
	int result = sql_number(archive, number, "PRAGMA data_version", "");

	if (result == 0)
		*number += archive->marked;
	return result;
}

int archive_first_drop(struct archive *archive, const char *query, const char *text,
                       char drop[ARCHIVE_NAME_MAX + 16])
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, query, "s", text);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0)
		snprintf(drop, ARCHIVE_NAME_MAX + 16, "%s", sql_text(s, 0));
	sqlite3_finalize(s);
	return result;
}

int archive_find(struct archive *archive, const char *file, char drop[ARCHIVE_NAME_MAX + 16])
{
	char hash[DIGEST_CHARS];
	int64_t bytes;

	if (digest_file(file, hash, &bytes, -1) != 0)
		return archive_refuse(archive, DT_E_SYSTEM, "%.500s: cannot be read", file);
	return archive_first_drop(
	        archive,
	        "SELECT s.name || '/' || d.number FROM drops d JOIN series s ON s.id = d.series_id"
	        " WHERE d.sha256 = ? LIMIT 1",
	        hash, drop);
}
