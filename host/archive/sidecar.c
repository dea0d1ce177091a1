/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/archive/durable.h"
#include "host/archive/private.h"

#define MARK "\n; ---- what the archive knows of it ----\n" SIDECAR_SECTION "\n"

/* ---- writing ---- */

#define SERIES_COLUMNS "s.scene, s.name, c.name, s.angle_deg, s.height_m, s.planned, s.created"
#define SERIES_TABLES " FROM series s JOIN campaigns c ON c.id = s.campaign_id "
enum { SERIES_COLUMN_COUNT = 7 };

static void put_series(FILE *out, sqlite3_stmt *s)
{
	fprintf(out, "%s" MARK "format = 1\nseries = %s\ncampaign = %s\n", sql_text(s, 0), sql_text(s, 1),
	        sql_text(s, 2));
	fprintf(out, "angle_deg = %.15g\nheight_m = %.15g\nplanned = %d\ncreated = %s\n",
	        sqlite3_column_double(s, 3), sqlite3_column_double(s, 4), sqlite3_column_int(s, 5),
	        sql_text(s, 6));
}

static void put_drop(FILE *out, sqlite3_stmt *s)
{
	static const char *const keys[] = {"drop",   "state", "time",  "operator", "note",     "decision",
	                                   "reason", "raw",   "bytes", "sha256",   "simulated"};

	for (int i = 0; i < (int)(sizeof(keys) / sizeof(keys[0])); i++)
		fprintf(out, "%s = %s\n", keys[i], sql_text(s, SERIES_COLUMN_COUNT + i));
}

/* One line "key = a<tab>b..." for each row. */
static int put_rows(struct archive *archive, FILE *out, const char *key, const char *text, int64_t drop)
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, text, "i", drop);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0)
		for (int i = 0, columns = sqlite3_column_count(s); i < columns; i++)
			fprintf(out, "%s%s%s", i == 0 ? key : "\t", sql_text(s, i),
			        i + 1 == columns ? "\n" : "");
	sqlite3_finalize(s);
	return result;
}

static int put_history(struct archive *archive, FILE *out, int64_t drop)
{
	int result = put_rows(archive, out, "result = ",
	                      "SELECT r.time, v.name FROM results r JOIN versions v ON v.id = r.version_id"
	                      " WHERE r.drop_id = ? ORDER BY r.id",
	                      drop);

	return result != 0 ? result
	                   : put_rows(archive, out, "event = ",
	                              "SELECT time, what, operator, text FROM events WHERE drop_id = ?"
	                              " ORDER BY id",
	                              drop);
}

/* The row is there; writes what to says, "raw/..." with any ending. */
static int write_out(struct archive *archive, sqlite3_stmt *s, const char *to, int64_t drop)
{
	char path[ARCHIVE_PATH_MAX], *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);
	int result = 0;

	if (out == NULL)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	put_series(out, s);
	if (drop != 0) {
		put_drop(out, s);
		result = put_history(archive, out, drop);
	}
	if (fclose(out) != 0 && result == 0)
		result = archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	snprintf(path, sizeof(path), "%s/%s", archive->folder, to);
	strcpy(strrchr(path, '.'), ".ini");
	if (result == 0 && (durable_folders(path) != 0 || durable_write(path, text, size) != 0))
		result = archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
	free(text);
	return result;
}

int sidecar_write_drop(struct archive *archive, int64_t drop)
{
	char to[ARCHIVE_NAME_MAX + 64];
	sqlite3_stmt *s;
	int result = sql_query(archive, &s,
	                       "SELECT " SERIES_COLUMNS ", d.number, d.state, d.time, d.operator, d.note,"
	                       " d.decision, d.reason, d.raw, d.bytes, d.sha256, d.simulated" SERIES_TABLES
	                       "JOIN drops d ON d.series_id = s.id WHERE d.id = ?",
	                       "i", drop);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		snprintf(to, sizeof(to), "%s", sql_text(s, SERIES_COLUMN_COUNT + 7));
		result = write_out(archive, s, to, drop);
	}
	sqlite3_finalize(s);
	return result;
}

int sidecar_write_series(struct archive *archive, int64_t series)
{
	char to[ARCHIVE_NAME_MAX + 64];
	sqlite3_stmt *s;
	int result =
	        sql_query(archive, &s, "SELECT " SERIES_COLUMNS SERIES_TABLES "WHERE s.id = ?", "i", series);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		snprintf(to, sizeof(to), "raw/%.4s/%s/series.ini", sql_text(s, 6), sql_text(s, 1));
		result = write_out(archive, s, to, 0);
	}
	sqlite3_finalize(s);
	return result;
}

/* ---- reading ---- */

struct sidecar {
	const char *file, *scene;
	char *line, *end; /* lines of the archive's section, each with a NUL behind */
};

/* The value of the first line from *at on that has this key, "" when there is none; *at moves behind it. */
static const char *next_value(const struct sidecar *sidecar, const char *key, const char **at)
{
	size_t length = strlen(key);

	while (*at < sidecar->end) {
		const char *line = *at;

		*at += strlen(line) + 1;
		if (strncmp(line, key, length) == 0 && strncmp(line + length, " =", 2) == 0)
			return line + length + 2 + (line[length + 2] == ' ');
	}
	return "";
}

static const char *value(const struct sidecar *sidecar, const char *key)
{
	const char *at = sidecar->line;

	return next_value(sidecar, key, &at);
}

static double number(const struct sidecar *sidecar, const char *key)
{
	const char *text = value(sidecar, key);
	char *end;
	double read = strtod(text, &end);

	return end == text || *end != '\0' ? (double)NAN : read;
}

/* Splits text in place. */
static int split(struct archive *archive, struct sidecar *sidecar, char *text)
{
	char *mark = strstr(text, MARK), *section = strstr(text, SIDECAR_SECTION);

	if (section == NULL)
		return archive_refuse(archive, DT_E_FORMAT, "%.400s: no section " SIDECAR_SECTION,
		                      sidecar->file);
	sidecar->scene = "";
	if (mark != NULL) {
		*mark = '\0';
		sidecar->scene = text;
	}
	sidecar->line = section + strlen(SIDECAR_SECTION);
	sidecar->end = sidecar->line + strlen(sidecar->line);
	for (char *c = sidecar->line; c < sidecar->end; c++)
		if (*c == '\n')
			*c = '\0';
	if (number(sidecar, "format") == 1)
		return 0;
	return archive_refuse(archive, DT_E_FORMAT, "%.400s: format = %.20s, expected 1", sidecar->file,
	                      value(sidecar, "format"));
}

/* The series' row, made when this is the first that tells of it. */
static int take_series(struct archive *archive, const struct sidecar *sidecar, int64_t *series)
{
	const char *name = value(sidecar, "series"), *campaign = value(sidecar, "campaign");
	struct scene scene;
	int result = archive_check_names(archive, name, campaign);

	if (result != 0)
		return result;
	result = sql_number(archive, series, "SELECT id FROM series WHERE name = ?", "s", name);
	if (result != DT_E_EMPTY)
		return result;
	result = scene_of_text(archive, name, sidecar->scene, number(sidecar, "angle_deg"), &scene);
	if (result == 0)
		result = series_insert(archive, name, campaign, sidecar->scene, &scene,
		                       strtol(value(sidecar, "planned"), NULL, 10), value(sidecar, "created"),
		                       series);
	return result;
}

static int take_events(struct archive *archive, const struct sidecar *sidecar, int64_t drop)
{
	const char *at = sidecar->line, *text;
	int result = 0;

	while (result == 0 && *(text = next_value(sidecar, "event", &at)) != '\0') {
		char *copy = strdup(text), *rest = copy;
		const char *part[4] = {"", "", "", ""};

		for (int i = 0; i < 4 && rest != NULL; i++)
			part[i] = i < 3 ? strsep(&rest, "\t") : rest;
		result = sql_run(archive,
		                 "INSERT INTO events (drop_id, time, what, operator, text)"
		                 " VALUES (?, ?, ?, ?, ?)",
		                 "issss", drop, part[0], part[1], part[2], part[3]);
		free(copy);
	}
	return result;
}

/* FOLDER/raw/.../NNNN.VERSION.json */
static int take_result(struct archive *archive, const struct sidecar *sidecar, int64_t drop, const char *when,
                       const char *version)
{
	char path[ARCHIVE_PATH_MAX + ARCHIVE_NAME_MAX], *json;
	int stem = (int)(strrchr(sidecar->file, '.') - sidecar->file), result;

	snprintf(path, sizeof(path), "%s/%.*s.%.60s.json", archive->folder, stem, sidecar->file, version);
	json = durable_read(path, NULL);
	if (json == NULL)
		return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
	result = result_insert(archive, drop, when, version, json);
	free(json);
	return result;
}

/* 1 when one of them could not be used. */
static int take_results(struct archive *archive, const struct sidecar *sidecar, int64_t drop)
{
	const char *at = sidecar->line, *text;
	bool lost = false;
	int result = 0;

	while (result == 0 && *(text = next_value(sidecar, "result", &at)) != '\0') {
		const char *tab = strchr(text, '\t');
		char when[ARCHIVE_TIME_CHARS] = "";

		if (tab != NULL)
			snprintf(when, sizeof(when), "%.*s", (int)(tab - text), text);
		result = take_result(archive, sidecar, drop, when, tab != NULL ? tab + 1 : text);
		if (result == DT_E_SYSTEM || result == DT_E_FORMAT) {
			lost = true;
			result = 0;
		}
	}
	return result != 0 ? result : lost;
}

static bool log_is_there(const struct archive *archive, const char *raw)
{
	char path[ARCHIVE_PATH_MAX];

	snprintf(path, sizeof(path), "%s/%.100s", archive->folder, raw);
	return access(path, F_OK) == 0;
}

/* Its columns are checked by the table itself. */
static int take_drop(struct archive *archive, const struct sidecar *sidecar, int64_t *drop)
{
	const char *state = value(sidecar, "state"), *raw = value(sidecar, "raw");
	bool recorded = strcmp(state, "recorded") == 0;
	int64_t series;
	int result = take_series(archive, sidecar, &series);

	if (result != 0)
		return result;
	if (strncmp(raw, sidecar->file, (size_t)(strrchr(sidecar->file, '.') - sidecar->file)) != 0)
		return archive_refuse(archive, DT_E_FORMAT,
		                      "%.300s: raw = %.100s, expected the log beside it", sidecar->file, raw);
	if (recorded && !log_is_there(archive, raw))
		state = "missing";
	result = sql_run(archive,
	                 "INSERT INTO drops (series_id, number, state, decision, reason, operator, note, raw,"
	                 " bytes, sha256, time, simulated) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
	                 "iissssssissi", series, (int64_t)strtol(value(sidecar, "drop"), NULL, 10), state,
	                 value(sidecar, "decision"), value(sidecar, "reason"), value(sidecar, "operator"),
	                 value(sidecar, "note"), raw, (int64_t)strtoll(value(sidecar, "bytes"), NULL, 10),
	                 value(sidecar, "sha256"), value(sidecar, "time"),
	                 (int64_t)(strcmp(value(sidecar, "simulated"), "1") == 0));
	*drop = sqlite3_last_insert_rowid(archive->index);
	return result != 0 ? result : take_events(archive, sidecar, *drop);
}

static int take(struct archive *archive, const struct sidecar *sidecar)
{
	int64_t row;
	int result;

	if (value(sidecar, "calibration")[0] != '\0')
		return sql_run(archive,
		               "INSERT OR REPLACE INTO calibrations (sensor, gain, date, note)"
		               " VALUES (?, ?, ?, ?)",
		               "sdss", value(sidecar, "calibration"), number(sidecar, "gain"),
		               value(sidecar, "date"), value(sidecar, "note"));
	if (value(sidecar, "drop")[0] == '\0')
		return take_series(archive, sidecar, &row);
	result = take_drop(archive, sidecar, &row);
	return result != 0 ? result : take_results(archive, sidecar, row);
}

int sidecar_read(struct archive *archive, const char *file)
{
	struct sidecar sidecar = {.file = file};
	char path[ARCHIVE_PATH_MAX], *text;
	int result;

	snprintf(path, sizeof(path), "%s/%.200s", archive->folder, file);
	text = durable_read(path, NULL);
	if (text == NULL)
		return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
	result = split(archive, &sidecar, text);
	if (result == 0)
		result = take(archive, &sidecar);
	free(text);
	return result;
}
