/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Results: what an analysis said as rows, the columns that tables of drops need, the JSON as it is.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "host/archive/proof.h"
#include "host/archive/quantities.h"

const char *archive_value_name(enum archive_value value)
{
	return quantity_columns[value].name;
}

/* ---- columns ---- */

struct numbers {
	double value[ARCHIVE_VALUE_COUNT], sigma[ARCHIVE_VALUE_COUNT];
	int64_t not_ok;
};

/* A value of a lag or a plate that is not there is not ok. */
static void result_take(struct numbers *n, int which, struct result *said)
{
	const struct quantity_column *c = &quantity_columns[which];
	const struct quantity *q = quantity_find(quantity_homes[c->place].object, c->key);
	const char *subject;
	const void *object;
	size_t i = 0;

	n->value[which] = n->sigma[which] = (double)NAN;
	while ((object = result_at(said, c->place, i++, &subject)) != NULL &&
	       strcmp(subject, c->subject) != 0)
		;
	if (object != NULL) {
		n->value[which] = quantity_number(q, object);
		n->sigma[which] = quantity_sigma(q, object);
	}
	if (object == NULL ? !quantity_homes[c->place].array[0]
	                   : quantity_object_status(q->object, object) != ESTIMATE_OK)
		n->not_ok |= (int64_t)1 << which;
}

static int update_columns(struct archive *archive, int64_t row, struct result *said)
{
	static const char text[] = "UPDATE results SET not_ok = ?"
#define QUANTITY_COLUMN(NAME, name, unit, ...) ", " name "_" unit " = ?, " name "_sigma_" unit " = ?"
#include "host/result/quantity.def"
	                           " WHERE id = ?";
	struct numbers n = {.not_ok = 0};
	sqlite3_stmt *s;
	int result;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		result_take(&n, i, said);
	result = sql_query(archive, &s, text, "i", n.not_ok);
	if (result != 0)
		return result;
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		if (isfinite(n.value[i]))
			sqlite3_bind_double(s, 2 + 2 * i, n.value[i]);
		if (isfinite(n.sigma[i]))
			sqlite3_bind_double(s, 3 + 2 * i, n.sigma[i]);
	}
	sqlite3_bind_int64(s, 2 + 2 * ARCHIVE_VALUE_COUNT, row);
	result = sql_step(archive, s);
	sqlite3_finalize(s);
	return result;
}

/* ---- rows ---- */

static int insert_flags(struct archive *archive, int64_t row, const char *channel, unsigned flags)
{
	int result = 0;

	for (; flags && result == 0; flags &= flags - 1)
		result = sql_run(archive,
		                 "INSERT OR IGNORE INTO flags (result_id, channel, flag) VALUES (?, ?, ?)",
		                 "iss", row, channel, record_flag_name(flags));
	return result;
}

/* In the order of their bits: of the record with its channels, as JSON has them. */
static int insert_all_flags(struct archive *archive, int64_t row, const struct result *said)
{
	unsigned all = said->record->flags;
	char text[ARCHIVE_TEXT_MAX] = "";
	size_t at = 0;
	int result = 0;

	for (size_t i = 0; i < said->analysis->channel_count && result == 0; i++) {
		all |= said->analysis->channels[i].flags;
		result = insert_flags(archive, row, said->record->channels[i].name,
		                      said->analysis->channels[i].flags);
	}
	if (result == 0)
		result = insert_flags(archive, row, "", all);
	for (; all && at < sizeof(text); all &= all - 1)
		at += (size_t)snprintf(text + at, sizeof(text) - at, "%s%s", at > 0 ? " " : "",
		                       record_flag_name(all));
	return result != 0 ? result
	                   : sql_run(archive, "UPDATE results SET flags = ? WHERE id = ?", "si", text, row);
}

static int version_row(struct archive *archive, const char *version, const char *when, int64_t *row)
{
	int result = sql_run(archive, "INSERT OR IGNORE INTO versions (name, first_used) VALUES (?, ?)", "ss",
	                     version, when);

	return result != 0 ? result
	                   : sql_number(archive, row, "SELECT id FROM versions WHERE name = ?", "s", version);
}

/* The result's row and its text. */
static int insert_text(struct archive *archive, int64_t drop, const char *when, const char *version,
                       const char *quantities, const char *json, int64_t *row)
{
	int64_t of = 0;
	int result = archive_check_name(archive, "version", version);

	if (result == 0)
		result = version_row(archive, version, when, &of);
	if (result == 0)
		result = sql_run(archive, "DELETE FROM results WHERE drop_id = ? AND version_id = ?", "ii",
		                 drop, of);
	if (result == 0)
		result = sql_run(archive,
		                 "INSERT INTO results (drop_id, version_id, time, not_ok, flags, quantities)"
		                 " VALUES (?, ?, ?, 0, '', ?)",
		                 "iiss", drop, of, when, quantities);
	*row = sqlite3_last_insert_rowid(archive->index);
	return result != 0 ? result
	                   : sql_run(archive, "INSERT INTO texts (result_id, json) VALUES (?, ?)", "is", *row,
	                             json);
}

static int insert(struct archive *archive, int64_t drop, const char *when, const char *version,
                  struct result *said, const char *json)
{
	int64_t row;
	int result = insert_text(archive, drop, when, version, quantity_version(), json, &row);

	if (result == 0)
		result = quantities_insert(archive, row, said);
	if (result == 0)
		result = update_columns(archive, row, said);
	return result != 0 ? result : insert_all_flags(archive, row, said);
}

/* ---- what was recorded, from its JSON ---- */

static int restore_rows(struct archive *archive, int64_t row)
{
	struct record record;
	struct analysis analysis = {.channels = NULL};
	struct estimate_options options = {.tolerance = 0.0};
	struct result said;
	int result = quantities_fill(archive, row);

	if (result == 0)
		result = sql_run(archive,
		                 "INSERT OR IGNORE INTO flags SELECT t.result_id, '', f.value FROM texts t,"
		                 " json_each(t.json, '$.flags') f WHERE t.result_id = ?",
		                 "i", row);
	if (result == 0)
		result = sql_run(archive,
		                 "INSERT OR IGNORE INTO flags SELECT t.result_id,"
		                 " coalesce(json_extract(c.value, '$.name'), ''), f.value FROM texts t,"
		                 " json_each(t.json, '$.channels') c, json_each(c.value, '$.flags') f"
		                 " WHERE t.result_id = ?",
		                 "i", row);
	if (result != 0)
		return result;
	record_init(&record);
	said = result_of(&record, &analysis, &options);
	result = quantities_read(archive, row, &said);
	if (result == 0)
		result = update_columns(archive, row, &said);
	if (result == 0)
		result = insert_all_flags(archive, row, &said);
	free(analysis.channels);
	record_free(&record);
	return result;
}

int result_restore(struct archive *archive, int64_t drop, const char *when, const char *version,
                   const char *json)
{
	int64_t row, ours = 0;
	int result = archive_check_name(archive, "version", version);

	if (result == 0)
		result = sql_number(
		        archive, &ours,
		        "SELECT CASE WHEN json_valid(?1) THEN json_type(?1, '$.channels') = 'array' END", "s",
		        json);
	if (result == 0 && !ours)
		result = archive_refuse(archive, DT_E_FORMAT,
		                        "a result by %s is damaged, expected the JSON of an analysis",
		                        version);
	if (result == 0)
		result = insert_text(archive, drop, when, version, "", json, &row);
	if (result == 0)
		result = sql_run(
		        archive,
		        "UPDATE results SET quantities = coalesce(json_extract(?, '$.quantities'), '')"
		        " WHERE id = ?",
		        "si", json, row);
	return result != 0 ? result : restore_rows(archive, row);
}

/* ---- beside the log ---- */

static int write_json(struct archive *archive, const char *raw, const char *version, const char *json)
{
	char path[ARCHIVE_PATH_MAX];

	sidecar_json_path(archive, raw, version, path);
	if (durable_write(path, json, strlen(json)) == 0)
		return 0;
	return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
}

int event_insert(struct archive *archive, int64_t drop, const char *what, const char *operator_name,
                 const char *text)
{
	char now[ARCHIVE_TIME_CHARS];

	archive_time(now, time(NULL));
	return sql_run(archive,
	               "INSERT INTO events (drop_id, time, what, operator, text) VALUES (?, ?, ?, ?, ?)",
	               "issss", drop, now, what, operator_name, text);
}

int archive_result(struct archive *archive, const char *drop, const char *version, struct result *said,
                   const char *json)
{
	char now[ARCHIVE_TIME_CHARS], fault[ARCHIVE_MESSAGE_MAX];
	struct archive_place place;
	int result = proof_look(archive, drop, fault);

	if (result == 0)
		result = archive_change(archive);
	if (result != 0)
		return result;
	archive_time(now, time(NULL));
	result = archive_locate(archive, drop, &place);
	if (result == 0)
		result = insert(archive, place.drop, now, version, said, json);
	if (result == 0)
		result = proof_log(archive, place.drop, fault);
	if (result == 0)
		result = write_json(archive, place.raw, version, json);
	if (result == 0)
		result = sidecar_write_drop(archive, place.drop);
	return archive_end(archive, result);
}
