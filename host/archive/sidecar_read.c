/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Sidecars read: what they say goes into the index, or is held against the files.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/base/durable.h"
#include "host/archive/sidecar.h"
#include "common/base/number.h"

const char *sidecar_next(const struct sidecar *sidecar, const char *key, const char **at)
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

const char *sidecar_value(const struct sidecar *sidecar, const char *key)
{
	const char *at = sidecar->line;

	return sidecar_next(sidecar, key, &at);
}

static double sidecar_read_number(const struct sidecar *sidecar, const char *key)
{
	double read = NAN;

	number_read(sidecar_value(sidecar, key), -HUGE_VAL, HUGE_VAL, &read);
	return read;
}

int sidecar_split(struct archive *archive, struct sidecar *sidecar, char *text)
{
	char *mark = strstr(text, SIDECAR_MARK), *section = strstr(text, SIDECAR_SECTION);

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
	if (sidecar_read_number(sidecar, "format") == 1)
		return 0;
	return archive_refuse(archive, DT_E_FORMAT, "%.400s: format = %.20s, expected 1", sidecar->file,
	                      sidecar_value(sidecar, "format"));
}

/* The series' row, made when this is the first that tells of it. */
static int sidecar_read_take_series(struct archive *archive, const struct sidecar *sidecar, int64_t *series)
{
	const char *name = sidecar_value(sidecar, "series"), *campaign = sidecar_value(sidecar, "campaign");
	struct scene scene;
	int result = archive_check_names(archive, name, campaign);

	if (result != 0)
		return result;
	result = sql_number(archive, series, "SELECT id FROM series WHERE name = ?", "s", name);
	if (result != DT_E_EMPTY)
		return result;
	result = scene_of_text(archive, name, sidecar->scene, sidecar_read_number(sidecar, "angle_deg"),
	                       &scene);
	if (result == 0)
		result = series_insert(archive, name, campaign, sidecar->scene, &scene,
		                       strtol(sidecar_value(sidecar, "planned"), NULL, 10),
		                       sidecar_value(sidecar, "created"), series);
	return result;
}

static int take_events(struct archive *archive, const struct sidecar *sidecar, int64_t drop)
{
	const char *at = sidecar->line, *text;
	int result = 0;

	while (result == 0 && *(text = sidecar_next(sidecar, "event", &at)) != '\0') {
		char *copy = strdup(text), *rest = copy;
		const char *part[4] = {"", "", "", ""};

		if (copy == NULL)
			return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
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

bool sidecar_result(const char *text, struct sidecar_result *result)
{
	char *end;
	int at = 0;

	*result = (struct sidecar_result){.bytes = -1};
	if (sscanf(text, "%23[^\t]\t%60[^\t]%n", result->time, result->version, &at) != 2 || at == 0)
		return false;
	text += at;
	if (*text == '\0') /* of a program before there were hashes */
		return true;
	result->bytes = strtoll(text + 1, &end, 10);
	snprintf(result->hash, sizeof(result->hash), "%s", *end == '\t' ? end + 1 : "");
	return result->bytes > 0 && strlen(result->hash) == DIGEST_CHARS - 1;
}

void sidecar_json_path(const struct archive *archive, const char *file, const char *version,
                       char path[ARCHIVE_PATH_MAX])
{
	int stem = (int)(strrchr(file, '.') - file);

	snprintf(path, ARCHIVE_PATH_MAX, "%s/%.*s.%.60s.json", archive->folder, stem, file, version);
}

/* FOLDER/raw/.../NNNN.VERSION.json */
/* Whether a result's bytes are what the sidecar says; of one from before there were hashes nothing is said.
 */
static bool is_recorded(const struct sidecar_result *r, const char *json, size_t size)
{
	char hash[DIGEST_CHARS];

	if (r->bytes < 0)
		return true;
	digest_of(json, size, hash);
	return strcmp(hash, r->hash) == 0;
}

/* A file that cannot be opened or read for want of memory or descriptors is not for that reason a bad one. */
static bool is_of_the_machine(int error)
{
	return error == ENOMEM || error == EMFILE || error == ENFILE;
}

/* 1 when it is not there, or not what was recorded: to be verified, and made again. */
static int sidecar_read_take_result(struct archive *archive, const struct sidecar *sidecar, int64_t drop,
                                    const char *text)
{
	char path[ARCHIVE_PATH_MAX], *json;
	struct sidecar_result r;
	size_t size;
	int result;

	if (!sidecar_result(text, &r))
		return archive_refuse(archive, DT_E_FORMAT,
		                      "%.300s: result = %.80s, expected time, version, bytes, SHA-256",
		                      sidecar->file, text);
	result = archive_check_name(archive, "version", r.version); /* it becomes part of a path */
	if (result != 0)
		return result;
	sidecar_json_path(archive, sidecar->file, r.version, path);
	json = durable_read(path, &size);
	if (json == NULL && is_of_the_machine(errno))
		return archive_refuse(archive, DT_E_MEMORY, "%.500s: %s", path, strerror(errno));
	if (json == NULL && (r.bytes < 0 || errno != ENOENT))
		return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
	if (json != NULL && is_recorded(&r, json, size))
		result = result_restore(archive, drop, r.time, r.version, json);
	else
		result = 1;
	free(json);
	return result;
}

/* 1 when one of them could not be used. */
static int sidecar_read_take_results(struct archive *archive, const struct sidecar *sidecar, int64_t drop)
{
	const char *at = sidecar->line, *text;
	bool lost = false;
	int result = 0;

	while (result == 0 && *(text = sidecar_next(sidecar, "result", &at)) != '\0') {
		result = sidecar_read_take_result(archive, sidecar, drop, text);
		if (result == DT_E_SYSTEM || result == DT_E_FORMAT || result == DT_E_ARGUMENT) {
			lost = true;
			result = 0;
		}
		if (result > 0)
			result = 0;
	}
	return result != 0 ? result : lost;
}

/* raw/YEAR/SERIES/NUMBER.ini speaks of the log beside it and of nothing else. */
static bool is_in_place(const struct sidecar *sidecar, const char *series, long number)
{
	const char *raw = sidecar_value(sidecar, "raw");
	int stem = (int)(strrchr(sidecar->file, '.') - sidecar->file);
	char tail[ARCHIVE_NAME_MAX + 32];
	int length = snprintf(tail, sizeof(tail), "/%s/%04ld", series, number);

	return number >= 1 && length < stem &&
	       strncmp(sidecar->file + stem - length, tail, (size_t)length) == 0 &&
	       strncmp(raw, sidecar->file, (size_t)stem) == 0 && strchr(raw + stem, '/') == NULL &&
	       strrchr(raw, '.') == raw + stem && archive_is_log(raw);
}

bool sidecar_is_of_drop(const char *path)
{
	const char *name = strrchr(path, '/');

	return name != NULL && strspn(name + 1, "0123456789") >= 4 &&
	       strcmp(name + 1 + strspn(name + 1, "0123456789"), ".ini") == 0;
}

/* Its columns are checked by the table itself. */
static int sidecar_read_take_drop(struct archive *archive, const struct sidecar *sidecar, int64_t *drop)
{
	const char *raw = sidecar_value(sidecar, "raw"), *name = sidecar_value(sidecar, "series");
	long number = strtol(sidecar_value(sidecar, "drop"), NULL, 10);
	int64_t series;
	int result = sidecar_read_take_series(archive, sidecar, &series);

	if (result != 0)
		return result;
	if (!is_in_place(sidecar, name, number))
		return archive_refuse(
		        archive, DT_E_FORMAT,
		        "%.200s: drop %ld of %.60s with raw = %.100s, expected the one whose log "
		        "stands beside it",
		        sidecar->file, number, name, raw);
	result = sql_run(archive,
	                 "INSERT INTO drops (series_id, number, state, decision, reason, operator, note, raw,"
	                 " bytes, sha256, time, simulated)"
	                 " VALUES (?, ?, ?, ?, ?, ?, ?, ?, CAST(NULLIF(?, '') AS INTEGER), ?, ?, ?)",
	                 "iisssssssssi", series, (int64_t)number, sidecar_value(sidecar, "state"),
	                 sidecar_value(sidecar, "decision"), sidecar_value(sidecar, "reason"),
	                 sidecar_value(sidecar, "operator"), sidecar_value(sidecar, "note"), raw,
	                 sidecar_value(sidecar, "bytes"), sidecar_value(sidecar, "sha256"),
	                 sidecar_value(sidecar, "time"),
	                 (int64_t)(strcmp(sidecar_value(sidecar, "simulated"), "1") == 0));
	*drop = sqlite3_last_insert_rowid(archive->index);
	return result != 0 ? result : take_events(archive, sidecar, *drop);
}

static int sidecar_read_take(struct archive *archive, const struct sidecar *sidecar, int64_t *drop)
{
	int64_t row;
	int result;

	if (sidecar_value(sidecar, "calibration")[0] != '\0')
		return 0; /* a note of before sensors had files: it stays in the chain */
	if (sidecar_value(sidecar, "drop")[0] == '\0' && sidecar_is_of_drop(sidecar->file))
		return archive_refuse(archive, DT_E_FORMAT, "no line 'drop = ', expected its number");
	if (sidecar_value(sidecar, "drop")[0] == '\0')
		return sidecar_read_take_series(archive, sidecar, &row);
	result = sidecar_read_take_drop(archive, sidecar, drop);
	return result != 0 ? result : sidecar_read_take_results(archive, sidecar, *drop);
}

int sidecar_read(struct archive *archive, const char *file, int64_t *drop)
{
	struct sidecar sidecar = {.file = file};
	char path[ARCHIVE_PATH_MAX], *text;
	int result;

	*drop = 0;
	snprintf(path, sizeof(path), "%s/%.200s", archive->folder, file);
	text = durable_read(path, NULL);
	if (text == NULL)
		return archive_refuse(archive, is_of_the_machine(errno) ? DT_E_MEMORY : DT_E_SYSTEM, "%s",
		                      strerror(errno));
	result = sidecar_split(archive, &sidecar, text);
	if (result == 0)
		result = sidecar_read_take(archive, &sidecar, drop);
	free(text);
	return result;
}
