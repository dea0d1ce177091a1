/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fts.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/archive/durable.h"
#include "host/archive/private.h"

#define REBUILT "index.sqlite.rebuilt"

/* ---- verify ---- */

/* What is wrong with the file of a row of raw, bytes, sha256; "" when nothing is. Whether it is gone. */
static bool examine(const struct archive *archive, sqlite3_stmt *s, char text[ARCHIVE_MESSAGE_MAX])
{
	char path[ARCHIVE_PATH_MAX], hash[DURABLE_HASH_CHARS];
	const char *raw = sql_text(s, 1);
	int64_t bytes = 0;

	text[0] = '\0';
	snprintf(path, sizeof(path), "%s/%s", archive->folder, raw);
	if (durable_hash(path, hash, &bytes) != 0) {
		snprintf(text, ARCHIVE_MESSAGE_MAX, "%.400s: %s", raw, strerror(errno));
		return errno == ENOENT;
	}
	if (strcmp(hash, sql_text(s, 3)) != 0)
		snprintf(text, ARCHIVE_MESSAGE_MAX,
		         "%.400s: %lld bytes that are not the %lld recorded (SHA-256 does not agree)", raw,
		         (long long)bytes, (long long)sqlite3_column_int64(s, 2));
	return false;
}

int archive_verify(struct archive *archive, void (*wrong)(void *context, const char *text), void *context)
{
	char text[ARCHIVE_MESSAGE_MAX];
	sqlite3_stmt *s;
	int count = 0, result = sql_query(archive, &s,
	                                  "SELECT id, raw, bytes, sha256, state FROM drops"
	                                  " WHERE state <> 'recording' ORDER BY raw",
	                                  "");

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		const char *state = examine(archive, s, text) ? "missing" : "recorded";

		if (text[0] != '\0') {
			wrong(context, text);
			count++;
		}
		if (strcmp(state, sql_text(s, 4)) == 0)
			continue;
		result = sql_run(archive, "UPDATE drops SET state = ? WHERE id = ?", "si", state,
		                 sqlite3_column_int64(s, 0));
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	return result != 0 ? result : count;
}

/* ---- rebuild ---- */

struct rebuild {
	struct archive archive;
	void (*wrong)(void *context, const char *text);
	void *context;
};

/* One sidecar; what is wrong with it is told and left out. */
static int take(struct rebuild *rebuild, const char *file)
{
	struct archive *archive = &rebuild->archive;
	char text[ARCHIVE_MESSAGE_MAX + 256];
	int taken, result = sql_script(archive, "SAVEPOINT one");

	if (result != 0)
		return result;
	taken = sidecar_read(archive, file);
	if (taken != 0) {
		snprintf(text, sizeof(text), "%.200s: %s", file, archive->message);
		rebuild->wrong(rebuild->context, text);
	}
	if (taken < 0)
		result = sql_script(archive, "ROLLBACK TO one");
	return result != 0 ? result : sql_script(archive, "RELEASE one");
}

static int by_name(const FTSENT **a, const FTSENT **b)
{
	return strcmp((*a)->fts_name, (*b)->fts_name);
}

static bool ends_in(const char *name, const char *ending)
{
	size_t length = strlen(name), tail = strlen(ending);

	return length > tail && strcmp(name + length - tail, ending) == 0;
}

/* A log that no sidecar speaks of. */
static void look_for_sidecar(struct rebuild *rebuild, const FTSENT *entry)
{
	char path[ARCHIVE_PATH_MAX], text[ARCHIVE_MESSAGE_MAX];

	if (entry->fts_statp->st_size == 0 || !archive_is_log(entry->fts_name))
		return;
	snprintf(path, sizeof(path), "%.4200s", entry->fts_path);
	strcpy(strrchr(path, '.'), ".ini");
	if (access(path, F_OK) == 0)
		return;
	snprintf(text, sizeof(text), "%.500s: no .ini beside it; 'droptower series add' takes it in",
	         entry->fts_path);
	rebuild->wrong(rebuild->context, text);
}

static int take_all(struct rebuild *rebuild)
{
	char raw[ARCHIVE_PATH_MAX], *roots[] = {raw, NULL};
	size_t front = strlen(rebuild->archive.folder) + 1;
	FTS *walk;
	FTSENT *entry;
	int result = 0;

	snprintf(raw, sizeof(raw), "%s/raw", rebuild->archive.folder);
	walk = fts_open(roots, FTS_PHYSICAL | FTS_NOCHDIR, by_name);
	if (walk == NULL)
		return archive_refuse(&rebuild->archive, DT_E_SYSTEM, "%.400s: %s", raw, strerror(errno));
	while (result == 0 && (entry = fts_read(walk)) != NULL) {
		if (entry->fts_info == FTS_F && ends_in(entry->fts_name, ".ini"))
			result = take(rebuild, entry->fts_path + front);
		else if (entry->fts_info == FTS_F)
			look_for_sidecar(rebuild, entry);
	}
	fts_close(walk);
	return result;
}

static void path_of(const struct archive *archive, char path[ARCHIVE_PATH_MAX], const char *name,
                    const char *ending)
{
	snprintf(path, ARCHIVE_PATH_MAX, "%s/%.60s%.60s", archive->folder, name, ending);
}

/* Moves FROM's file, its log and what goes with it to TO. Only the file itself must be there. */
static int move(struct archive *archive, const char *from, const char *to)
{
	static const char *const endings[] = {"-wal", "-shm", ""};
	char old[ARCHIVE_PATH_MAX], new[ARCHIVE_PATH_MAX];

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		path_of(archive, old, from, endings[i]);
		path_of(archive, new, to, endings[i]);
		if (rename(old, new) != 0 && errno != ENOENT)
			return archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", new, strerror(errno));
	}
	if (durable_sync_folder(new) != 0)
		return archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", new, strerror(errno));
	return 0;
}

static void remove_rebuilt(const struct archive *archive)
{
	static const char *const endings[] = {"", "-wal", "-shm"};
	char path[ARCHIVE_PATH_MAX];

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		path_of(archive, path, REBUILT, endings[i]);
		unlink(path);
	}
}

static int fill(struct rebuild *rebuild)
{
	struct archive *archive = &rebuild->archive;
	int result = index_open(archive, REBUILT, ARCHIVE_CREATE);

	if (result == 0)
		result = archive_start(archive);
	if (result == 0)
		result = archive_end(archive, take_all(rebuild));
	if (sqlite3_close(archive->index) != SQLITE_OK && result == 0) /* the log goes into the file */
		result = archive_refuse(archive, DT_E_SYSTEM, "%.400s: the new index cannot be closed",
		                        archive->folder);
	archive->index = NULL;
	return result;
}

static int rebuild_in(struct rebuild *rebuild)
{
	struct archive *archive = &rebuild->archive;
	char raw[ARCHIVE_PATH_MAX], aside[64];
	int result = 0;

	path_of(archive, raw, "raw", "");
	if (access(raw, F_OK) != 0)
		return archive_refuse(archive, DT_E_EMPTY,
		                      "%.400s: no archive there, expected a folder raw in it",
		                      archive->folder);
	result = archive_lock(archive, true);
	if (result != 0)
		return result;
	remove_rebuilt(archive);
	result = fill(rebuild);
	snprintf(aside, sizeof(aside), "index.sqlite.before-%lld", (long long)time(NULL));
	if (result == 0)
		result = move(archive, "index.sqlite", aside);
	if (result == 0)
		result = move(archive, REBUILT, "index.sqlite");
	if (result != 0)
		remove_rebuilt(archive);
	return result;
}

int archive_rebuild(const char *folder, void (*wrong)(void *context, const char *text), void *context,
                    char message[ARCHIVE_MESSAGE_MAX])
{
	struct rebuild rebuild = {.archive = {.lock = -1}, .wrong = wrong, .context = context};
	size_t length = strlen(folder);
	int result;

	while (length > 1 && folder[length - 1] == '/')
		length--;
	rebuild.archive.folder = strndup(folder, length);
	if (rebuild.archive.folder == NULL || length > 4000)
		result = archive_refuse(&rebuild.archive, DT_E_ARGUMENT, "the archive's name is too long");
	else
		result = rebuild_in(&rebuild);
	memcpy(message, rebuild.archive.message, ARCHIVE_MESSAGE_MAX);
	if (rebuild.archive.lock >= 0)
		close(rebuild.archive.lock);
	free(rebuild.archive.folder);
	return result;
}
