/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/indexed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "host/archive/quantities.h"
#include "host/result/said.h"

/* What a column holds, for a message. */
static const char *shown(const char *text)
{
	return text[0] != '\0' ? text : "nothing";
}

/* ---- a sidecar's lines ---- */

/* Of who is told: a file from before the chain proves nothing against the index. */
static void tell_line(struct proof *proof, bool sealed, const char *key, const char *index, const char *file)
{
	if (sealed)
		proof_fault(proof, PROOF_INDEX, false,
		            "index.sqlite: altered: %s: %s = %.200s, expected %.200s", proof->name, key,
		            shown(index), shown(file));
	else
		proof_fault(proof, PROOF_SIDECAR, false, "%s: altered: %s = %.200s, expected %.200s",
		            proof->file, key, shown(file), shown(index));
}

/* Lines that there are several of are held one by one. */
static void hold_each(struct proof *proof, bool sealed, const char *key, const struct sidecar *index,
                      const struct sidecar *file)
{
	const char *at = index->line, *of = file->line, *a, *b;

	do {
		a = sidecar_next(index, key, &at);
		b = sidecar_next(file, key, &of);
		if (strcmp(a, b) != 0)
			tell_line(proof, sealed, key, a, b);
	} while (a[0] != '\0' && b[0] != '\0');
}

/* A result in the index that no sidecar knows. */
static void hold_more_results(struct proof *proof, const struct sidecar *index, const struct sidecar *file)
{
	struct sidecar_result own, told;
	const char *at = index->line, *of, *line, *other;

	while (*(line = sidecar_next(index, "result", &at)) != '\0') {
		bool known = false;

		of = file->line;
		while (sidecar_result(line, &own) && *(other = sidecar_next(file, "result", &of)) != '\0')
			known |= sidecar_result(other, &told) && strcmp(own.version, told.version) == 0;
		if (!known)
			tell_line(proof, true, "result", line, "");
	}
}

static void hold_lines(struct proof *proof, bool sealed, const struct sidecar *index,
                       const struct sidecar *file)
{
	static const char *const others[] = {"format", "result", "event", "entry", "previous"};

	if (strcmp(index->scene, file->scene) != 0)
		tell_line(proof, sealed, "scene", "another", "the one of the sidecar");
	for (const char *line = file->line; line < file->end; line += strlen(line) + 1) {
		char key[24];
		size_t i = 0;

		snprintf(key, sizeof(key), "%.*s", (int)strcspn(line, " "), line);
		while (i < sizeof(others) / sizeof(others[0]) && strcmp(others[i], key) != 0)
			i++;
		if (key[0] != '\0' && i == sizeof(others) / sizeof(others[0]) &&
		    strcmp(sidecar_value(index, key), sidecar_value(file, key)) != 0)
			tell_line(proof, sealed, key, sidecar_value(index, key), sidecar_value(file, key));
	}
	hold_each(proof, sealed, "event", index, file);
	if (sealed)
		hold_more_results(proof, index, file);
}

/* What stands in text, against what the sidecar says. */
static int hold_text(struct proof *proof, bool sealed, char *text, const struct sidecar *told)
{
	struct sidecar index = {.file = proof->file};
	int result = sidecar_split(proof->archive, &index, text);

	if (result == 0)
		hold_lines(proof, sealed, &index, told);
	return result;
}

/* ---- a drop ---- */

int indexed_hold_drop(struct proof *proof, const struct chain_entry *entry, const struct sidecar *told)
{
	struct chain_place place = {.number = proof->entry};
	const struct chain_entry *own = chain_place(&proof->chain, proof->file, proof->entry, &place);
	char hash[DIGEST_CHARS];
	struct text text;
	int result = sidecar_text_of_drop(proof->archive, proof->drop, &place, &text);

	if (result != 0)
		return result;
	digest_of(text.bytes, text.size, hash);
	/* behind the chain's last word of it, only one that was never acknowledged may be */
	proof->indexed = own != NULL && strcmp(hash, own->hash) == 0 &&
	                 (own == entry || (entry != NULL && entry->number > proof->noted));
	if (!proof->indexed && proof->begun) {
		if (strcmp(sidecar_value(told, "state"), "recording") != 0)
			tell_line(proof, true, "state", "recording", sidecar_value(told, "state"));
	} else if (!proof->indexed && told != NULL) {
		result = hold_text(proof, entry != NULL, text.bytes, told);
	}
	free(text.bytes);
	return result;
}

/* ---- a result ---- */

static bool is_near(double a, double b)
{
	return a == b || fabs(a - b) <= 1e-15 * (fabs(a) + fabs(b));
}

static void tell_value(struct proof *proof, const char *column, const char *subject, const char *index,
                       const char *json)
{
	proof_fault(proof, PROOF_RESULT, false, "index.sqlite: altered: %s: %s%s%s = %.100s, expected %.100s",
	            proof->name, column, subject[0] != '\0' ? " of " : "", subject, shown(index),
	            shown(json));
}

/* A column that is a number or nothing. */
static void hold_number(struct proof *proof, sqlite3_stmt *s, int at, double said, const char *column,
                        const char *subject)
{
	char expected[32] = "";
	int type = sqlite3_column_type(s, at);
	bool is_number = type == SQLITE_FLOAT || type == SQLITE_INTEGER;

	if (isfinite(said))
		snprintf(expected, sizeof(expected), "%.10g", said);
	if (isfinite(said) ? !is_number || !is_near(sqlite3_column_double(s, at), said)
	                   : sql_text(s, at)[0] != '\0')
		tell_value(proof, column, subject, sql_text(s, at), expected);
}

/* An older table of quantities may have had no column for what an older JSON says. */
static void hold_value(struct proof *proof, sqlite3_stmt *s, int at, const struct quantity_home *home,
                       const struct quantity *q, const cJSON *said, const char *subject)
{
	char text[QUANTITY_TEXT_MAX], column[80];

	if (cJSON_GetObjectItemCaseSensitive(said, q->key) == NULL ||
	    (!proof->today && sqlite3_column_type(s, at) == SQLITE_NULL))
		return;
	snprintf(column, sizeof(column), "%s.%s", home->table, q->key);
	if (!said_words(said, q->key, text))
		hold_number(proof, s, at, said_number(said, q->key), column, subject);
	else if (strcmp(text, sql_text(s, at)) != 0)
		tell_value(proof, column, subject, sql_text(s, at), text);
}

/* How many objects the JSON has at a place, each subject once. */
static int count_said(const cJSON *json, const struct quantity_home *home)
{
	struct said said;
	int count = 0;

	for (int i = 0; said_at(json, home, i, &said); i++)
		count += said.object != NULL && said_of(json, home, said.subject) == said.object;
	return count;
}

/* Whether a row must have come from an object: the JSON of an older program may not speak of the place. */
static bool is_of_nobody(const cJSON *json, const struct quantity_home *home, const char *subject)
{
	struct said said;

	for (int i = 0; said_at(json, home, i, &said); i++)
		if (strcmp(said.subject, subject) == 0)
			return said.null;
	return true;
}

static int hold_place(struct proof *proof, int64_t row, const cJSON *json, enum quantity_place place)
{
	const struct quantity_home *home = &quantity_homes[place];
	sqlite3_stmt *s = proof->place[place];
	int result = 0, rows = 0;

	if (s == NULL)
		result = quantities_select(proof->archive, home, &s);
	if (result != 0)
		return result;
	proof->place[place] = s;
	sqlite3_bind_int64(s, 1, row);
	while ((result = sql_step(proof->archive, s)) > 0) {
		const cJSON *said = said_of(json, home, sql_text(s, 0));
		const struct quantity *q = NULL;

		rows += said != NULL;
		if (said == NULL && is_of_nobody(json, home, sql_text(s, 0)))
			tell_value(proof, home->table, sql_text(s, 0), "a row", "");
		for (int at = 1; said != NULL && (q = quantities_next(home->object, q)) != NULL; at++)
			hold_value(proof, s, at, home, q, said, sql_text(s, 0));
	}
	sqlite3_reset(s);
	if (result == 0 && rows < count_said(json, home) && proof->today)
		tell_value(proof, home->table, "", "a row less", "one for each object of the result");
	return result;
}

/* Whether the JSON has this flag, of a channel or of all. */
static bool has_flag(const cJSON *json, const char *channel, const char *flag)
{
	const cJSON *item, *from = json;

	if (channel[0] != '\0')
		from = said_of(json, &quantity_homes[QUANTITY_AT_SAMPLES], channel);
	cJSON_ArrayForEach(
	        item, cJSON_GetObjectItemCaseSensitive(from, "flags")) if (cJSON_IsString(item) &&
	                                                                   strcmp(item->valuestring, flag) ==
	                                                                           0) return true;
	return false;
}

static int count_flags(const cJSON *json)
{
	const cJSON *channel;
	int count = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(json, "flags"));

	cJSON_ArrayForEach(channel, cJSON_GetObjectItemCaseSensitive(json, "channels")) count +=
	        cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(channel, "flags"));
	return count;
}

static int hold_flags(struct proof *proof, int64_t row, const cJSON *json)
{
	int result = 0, rows = 0;

	if (proof->flags == NULL)
		result = sql_query(proof->archive, &proof->flags,
		                   "SELECT channel, flag FROM flags WHERE result_id = ?", "");
	if (result != 0)
		return result;
	sqlite3_bind_int64(proof->flags, 1, row);
	while ((result = sql_step(proof->archive, proof->flags)) > 0) {
		const char *channel = sql_text(proof->flags, 0), *flag = sql_text(proof->flags, 1);

		rows++;
		if (!has_flag(json, channel, flag))
			tell_value(proof, "flags.flag", channel, flag, "");
	}
	sqlite3_reset(proof->flags);
	if (result == 0 && rows < count_flags(json))
		tell_value(proof, "flags", "", "a row less", "one for each flag of the result");
	return result;
}

/* A value of a drop in tables of drops. Its bit of not_ok. */
static int64_t hold_column(struct proof *proof, sqlite3_stmt *s, const cJSON *json, int which)
{
	const struct quantity_column *c = &quantity_columns[which];
	const struct quantity_home *home = &quantity_homes[c->place];
	const cJSON *said = said_of(json, home, c->subject);
	const char *sigma = quantity_find(home->object, c->key)->sigma;
	char column[80], status[QUANTITY_TEXT_MAX];
	bool not_ok = said == NULL && !home->array[0];

	if (proof->today || sqlite3_column_type(s, 3 + 2 * which) != SQLITE_NULL) {
		snprintf(column, sizeof(column), "results.%s", c->value);
		hold_number(proof, s, 3 + 2 * which, said_number(said, c->key), column, "");
	}
	if (proof->today || sqlite3_column_type(s, 4 + 2 * which) != SQLITE_NULL) {
		snprintf(column, sizeof(column), "results.%s", c->sigma);
		hold_number(proof, s, 4 + 2 * which, sigma[0] ? said_number(said, sigma) : (double)NAN,
		            column, "");
	}
	if (said != NULL && quantity_find(home->object, "status") != NULL)
		not_ok = said_words(said, "status", status) && strcmp(status, "ok") != 0;
	return (int64_t)not_ok << which;
}

static int hold_columns(struct proof *proof, int64_t row, const cJSON *json)
{
	static const char query[] = "SELECT not_ok, flags, quantities"
#define QUANTITY_COLUMN(NAME, name, unit, ...) ", " name "_" unit ", " name "_sigma_" unit
#include "host/result/quantity.def"
	                            " FROM results WHERE id = ?";
	char text[QUANTITY_TEXT_MAX];
	int64_t not_ok = 0;
	sqlite3_stmt *s;
	int result = proof->columns != NULL ? 0 : sql_query(proof->archive, &proof->columns, query, "");

	if (result != 0)
		return result;
	s = proof->columns;
	sqlite3_bind_int64(s, 1, row);
	result = sql_step(proof->archive, s);
	for (int i = 0; i < QUANTITY_COLUMNS && result > 0; i++)
		not_ok |= hold_column(proof, s, json, i);
	if (result > 0 && proof->today && sqlite3_column_int64(s, 0) != not_ok) {
		snprintf(text, sizeof(text), "%lld", (long long)not_ok);
		tell_value(proof, "results.not_ok", "", sql_text(s, 0), text);
	}
	if (result > 0 && said_words(json, "flags", text) && strcmp(text, sql_text(s, 1)) != 0)
		tell_value(proof, "results.flags", "", sql_text(s, 1), text);
	if (result > 0 && said_words(json, "quantities", text) && strcmp(text, sql_text(s, 2)) != 0)
		tell_value(proof, "results.quantities", "", sql_text(s, 2), text);
	sqlite3_reset(s);
	return result < 0 ? result : 0;
}

int indexed_hold_result(struct proof *proof, int64_t row, const char *text)
{
	cJSON *json = cJSON_Parse(text);
	char version[QUANTITY_TEXT_MAX];
	int result;

	if (json == NULL)
		return 0; /* none of ours: no rows came of it */
	proof->today = said_words(json, "quantities", version) && strcmp(version, quantity_version()) == 0;
	result = hold_columns(proof, row, json);
	if (result == 0)
		result = hold_flags(proof, row, json);
	for (int p = 0; p < QUANTITY_PLACES && result == 0; p++)
		result = hold_place(proof, row, json, (enum quantity_place)p);
	cJSON_Delete(json);
	return result;
}

void indexed_close(struct proof *proof)
{
	for (int p = 0; p < QUANTITY_PLACES; p++)
		sqlite3_finalize(proof->place[p]);
	sqlite3_finalize(proof->columns);
	sqlite3_finalize(proof->flags);
}

/* ---- series ---- */

/* What a series' row has of its scene besides the text. */
static int hold_scene(struct proof *proof, int64_t series)
{
	struct scene scene;
	sqlite3_stmt *s;
	int result =
	        sql_query(proof->archive, &s,
	                  "SELECT name, scene, angle_deg, scene_name, plate_mass_kg FROM series WHERE id = ?",
	                  "i", series);

	if (result != 0)
		return result;
	result = sql_step(proof->archive, s);
	if (result > 0 && scene_of_text(proof->archive, sql_text(s, 0), sql_text(s, 1),
	                                sqlite3_column_double(s, 2), &scene) == 0) {
		if (strcmp(scene.name, sql_text(s, 3)) != 0)
			tell_line(proof, true, "scene_name", sql_text(s, 3), scene.name);
		hold_number(proof, s, 4, scene.mount_plate_mass_kg, "plate_mass_kg", "");
	}
	sqlite3_finalize(s);
	return result < 0 ? result : 0;
}

static int hold_series(struct proof *proof, const struct sidecar *told)
{
	struct chain_place place = {.number = 0};
	struct text text;
	int64_t row;
	int result = sql_number(proof->archive, &row, "SELECT id FROM series WHERE name = ?", "s",
	                        sidecar_value(told, "series"));

	if (result == DT_E_EMPTY) {
		proof_fault(proof, PROOF_INDEX, true, "index.sqlite: missing: the series of %s", told->file);
		return 0;
	}
	if (result == 0)
		result = sidecar_text_of_series(proof->archive, row, &place, &text);
	if (result != 0)
		return result;
	result = hold_text(proof, true, text.bytes, told);
	free(text.bytes);
	return result != 0 ? result : hold_scene(proof, row);
}

int indexed_hold_other(struct proof *proof, const struct sidecar *told)
{
	snprintf(proof->file, sizeof(proof->file), "%s", told->file);
	snprintf(proof->name, sizeof(proof->name), "%s", sidecar_value(told, "series"));
	/* calibrations were noted before sensors had files */
	return sidecar_value(told, "calibration")[0] != '\0' ? 0 : hold_series(proof, told);
}

int indexed_hold_more(struct proof *proof)
{
	struct archive *archive = proof->archive;
	char path[ARCHIVE_PATH_MAX];
	sqlite3_stmt *s;
	int result = sql_query(
	        archive, &s,
	        "SELECT 'raw/' || substr(created, 1, 4) || '/' || name || '/series.ini' FROM series", "");

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		snprintf(path, sizeof(path), "%s/%.200s", archive->folder, sql_text(s, 0));
		if (chain_find(&proof->chain, sql_text(s, 0)) == NULL && access(path, F_OK) != 0)
			proof_fault(
			        proof, PROOF_INDEX, false,
			        "index.sqlite: altered: it has what %.200s should tell, which is not there",
			        sql_text(s, 0));
	}
	sqlite3_finalize(s);
	return result;
}
