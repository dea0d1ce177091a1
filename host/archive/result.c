/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A result as JSON, to the columns that tables need.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cjson/cJSON.h>

#include "host/archive/proof.h"

const char *archive_value_name(enum archive_value value)
{
	static const char *const names[] = {
#define NAME(name, text, unit) text,
	        ARCHIVE_VALUES(NAME)
#undef NAME
	};

	return names[value];
}

const char *archive_value_unit(enum archive_value value)
{
	static const char *const units[] = {
#define UNIT(name, text, unit) unit,
	        ARCHIVE_VALUES(UNIT)
#undef UNIT
	};

	return units[value];
}

int archive_json_parse(const char *json, cJSON **root)
{
	errno = 0; /* the library does not tell one from the other */
	*root = cJSON_Parse(json);
	return *root != NULL ? 0 : errno == ENOMEM ? DT_E_MEMORY : DT_E_FORMAT;
}

struct numbers {
	double value[ARCHIVE_VALUE_COUNT], sigma[ARCHIVE_VALUE_COUNT];
	int64_t not_ok;
	char flags[ARCHIVE_TEXT_MAX];
};

static const char *text_of(const cJSON *object, const char *key)
{
	const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));

	return text != NULL ? text : "";
}

/* Takes object's value and uncertainty; its status too, when status is an object. */
static void take(struct numbers *n, enum archive_value which, const cJSON *object, const char *value,
                 const char *sigma, const cJSON *status)
{
	n->value[which] = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(object, value));
	n->sigma[which] = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(object, sigma));
	if (strcmp(text_of(status, "status"), "ok") != 0)
		n->not_ok |= (int64_t)1 << which;
}

static void take_peaks(struct numbers *n, const cJSON *root)
{
	static const struct {
		const char *channel;
		enum archive_value value;
	} peaks[] = {{"S1X", ARCHIVE_S1_X}, {"S1Y", ARCHIVE_S1_Y}, {"S1Z", ARCHIVE_S1_Z},
	             {"S2X", ARCHIVE_S2_X}, {"S2Y", ARCHIVE_S2_Y}, {"S2Z", ARCHIVE_S2_Z}};
	const cJSON *item;

	cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(root, "channels"))
	{
		const cJSON *peak = cJSON_GetObjectItemCaseSensitive(item, "peak");

		for (size_t i = 0; i < sizeof(peaks) / sizeof(peaks[0]); i++)
			if (strcmp(text_of(item, "name"), peaks[i].channel) == 0)
				take(n, peaks[i].value, peak, "value_g", "sigma_g", peak);
	}
	cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(root, "resultants"))
	{
		const char *sensor = text_of(item, "sensor");

		if (strcmp(sensor, "S1") == 0 || strcmp(sensor, "S2") == 0)
			take(n, sensor[1] == '1' ? ARCHIVE_S1_R : ARCHIVE_S2_R, item, "peak_g", "sigma_g",
			     item);
	}
}

static void take_rest(struct numbers *n, const cJSON *root)
{
	const cJSON *lag = cJSON_GetObjectItemCaseSensitive(root, "lag");
	const cJSON *driven = cJSON_GetObjectItemCaseSensitive(lag, "driven");
	const cJSON *plate = cJSON_GetObjectItemCaseSensitive(root, "plate");

	take(n, ARCHIVE_LAG, lag, "largest_peak_s", "sigma_s", lag);
	take(n, ARCHIVE_LAG_FIRST, lag, "first_peak_s", "sigma_s", lag);
	take(n, ARCHIVE_LAG_DRIVEN, driven, "lag_s", "sigma_s", driven);
	take(n, ARCHIVE_FREQUENCY, plate, "frequency_hz", "sigma_hz", plate);
	take(n, ARCHIVE_THREE_CYCLE, plate, "three_cycle_frequency_hz", "sigma_hz", plate);
	take(n, ARCHIVE_DAMPING, plate, "damping_ratio", "sigma_damping", plate);
}

static void take_flags(struct numbers *n, const cJSON *root)
{
	size_t at = 0;
	const cJSON *flag;

	cJSON_ArrayForEach(flag, cJSON_GetObjectItemCaseSensitive(root, "flags")) if (cJSON_IsString(flag))
	{
		int length = snprintf(n->flags + at, sizeof(n->flags) - at, "%s%s", at > 0 ? " " : "",
		                      flag->valuestring);

		if (length < 0 || (size_t)length >= sizeof(n->flags) - at)
			return;
		at += (size_t)length;
	}
}

/* ---- rows ---- */

#define COLUMNS(name, text, unit) ", " text "_" unit ", " text "_sigma_" unit
#define MARKS(name, text, unit) ", ?, ?"

static int insert_row(struct archive *archive, int64_t drop, int64_t version, const char *when,
                      const struct numbers *n)
{
	enum { FIRST = 6 };
	static const char text[] =
	        "INSERT INTO results (drop_id, version_id, time, not_ok, flags" ARCHIVE_VALUES(
	                COLUMNS) ") VALUES (?, ?, ?, ?, ?" ARCHIVE_VALUES(MARKS) ")";
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, text, "iisis", drop, version, when, n->not_ok, n->flags);

	if (result != 0)
		return result;
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		if (isfinite(n->value[i]))
			sqlite3_bind_double(s, FIRST + 2 * i, n->value[i]);
		if (isfinite(n->sigma[i]))
			sqlite3_bind_double(s, FIRST + 2 * i + 1, n->sigma[i]);
	}
	result = sql_step(archive, s);
	sqlite3_finalize(s);
	return result;
}

/* The flags of object, or of one of its channels. */
static int insert_flags(struct archive *archive, int64_t row, const char *channel, const cJSON *object)
{
	const cJSON *flag;
	int result = 0;

	cJSON_ArrayForEach(flag, cJSON_GetObjectItemCaseSensitive(object, "flags"))
	{
		if (result == 0 && cJSON_IsString(flag))
			result = sql_run(archive,
			                 "INSERT OR IGNORE INTO flags (result_id, channel, flag)"
			                 " VALUES (?, ?, ?)",
			                 "iss", row, channel, flag->valuestring);
	}
	return result;
}

static int version_row(struct archive *archive, const char *version, const char *when, int64_t *row)
{
	int result = sql_run(archive, "INSERT OR IGNORE INTO versions (name, first_used) VALUES (?, ?)", "ss",
	                     version, when);

	return result != 0 ? result
	                   : sql_number(archive, row, "SELECT id FROM versions WHERE name = ?", "s", version);
}

static int insert(struct archive *archive, int64_t drop, const char *when, const char *version,
                  const char *json, const cJSON *root)
{
	struct numbers numbers = {.not_ok = 0};
	const cJSON *item;
	int64_t of = 0, row;
	int result;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		numbers.value[i] = numbers.sigma[i] = NAN;
	take_peaks(&numbers, root);
	take_rest(&numbers, root);
	take_flags(&numbers, root);
	result = version_row(archive, version, when, &of);
	if (result == 0)
		result = sql_run(archive, "DELETE FROM results WHERE drop_id = ? AND version_id = ?", "ii",
		                 drop, of);
	if (result == 0)
		result = insert_row(archive, drop, of, when, &numbers);
	row = sqlite3_last_insert_rowid(archive->index);
	if (result == 0)
		result = sql_run(archive, "INSERT INTO texts (result_id, json) VALUES (?, ?)", "is", row,
		                 json);
	if (result == 0)
		result = insert_flags(archive, row, "", root);
	cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(root, "channels"))
	{
		if (result == 0)
			result = insert_flags(archive, row, text_of(item, "name"), item);
	}
	return result;
}

int result_insert(struct archive *archive, int64_t drop, const char *when, const char *version,
                  const char *json)
{
	cJSON *root = NULL;
	int result = archive_check_name(archive, "version", version);

	if (result == 0)
		result = archive_json_parse(json, &root);
	if (result == DT_E_MEMORY)
		return archive_refuse(archive, result, "%s", error_text(result));
	if (result == DT_E_FORMAT || (result == 0 && !cJSON_HasObjectItem(root, "channels")))
		result = archive_refuse(archive, DT_E_FORMAT,
		                        "a result by %s is damaged, expected the JSON of an analysis",
		                        version);
	if (result == 0)
		result = insert(archive, drop, when, version, json, root);
	cJSON_Delete(root);
	return result;
}

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

int archive_result(struct archive *archive, const char *drop, const char *version, const char *json)
{
	char now[ARCHIVE_TIME_CHARS], fault[ARCHIVE_MESSAGE_MAX];
	struct archive_place place;
	int result = proof_look(archive, drop, fault);

	if (result == 0)
		result = archive_start(archive);
	if (result != 0)
		return result;
	archive_time(now, time(NULL));
	result = archive_locate(archive, drop, &place);
	if (result == 0)
		result = result_insert(archive, place.drop, now, version, json);
	if (result == 0)
		result = proof_log(archive, place.drop, fault);
	if (result == 0)
		result = write_json(archive, place.raw, version, json);
	if (result == 0)
		result = sidecar_write_drop(archive, place.drop);
	return archive_end(archive, result);
}
