/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fts.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/archive/proof.h"

#define REBUILT "index.sqlite.rebuilt"

struct rebuild {
	struct archive archive;
	struct proof proof;
	bool fewer;     /* drops than before will do */
	int64_t before; /* drops known until now */
	void (*wrong)(void *context, const char *text);
	void *context;
};

/* What the chain has of a sidecar. */
static int note_entry(struct rebuild *rebuild, const char *file, int64_t drop)
{
	const struct chain_entry *entry = chain_find(&rebuild->proof.chain, file);

	if (drop == 0 || entry == NULL)
		return 0;
	return sql_run(&rebuild->archive, "UPDATE drops SET entry = ? WHERE id = ?", "ii", entry->number,
	               drop);
}

/* One sidecar; what is wrong with it is told and left out. */
static int rebuild_take(struct rebuild *rebuild, const char *file)
{
	struct archive *archive = &rebuild->archive;
	char text[ARCHIVE_MESSAGE_MAX + 256];
	int taken, result = sql_script(archive, "SAVEPOINT one");
	int64_t drop;

	if (result != 0)
		return result;
	taken = sidecar_read(archive, file, &drop);
	if (taken == DT_E_MEMORY) /* says nothing of the file, and so nothing of what the index would lack */
		return taken;
	if (taken != 0) {
		bool named = strncmp(archive->message, file, strlen(file)) == 0;

		snprintf(text, sizeof(text), "%.200s%s%s", named ? "" : file, named ? "" : ": ",
		         archive->message);
		rebuild->wrong(rebuild->context, text);
	}
	if (taken < 0)
		result = sql_script(archive, "ROLLBACK TO one");
	else
		result = note_entry(rebuild, file, drop);
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

/* A linked folder or file is taken as what it leads to, but not what is linked in there again. */
static bool rebuild_follow(struct rebuild *rebuild, FTS *walk, FTSENT *entry)
{
	char text[ARCHIVE_MESSAGE_MAX];

	if (entry->fts_info == FTS_SL && !entry->fts_parent->fts_number) {
		entry->fts_number = 1;
		return fts_set(walk, entry, FTS_FOLLOW) == 0;
	}
	snprintf(text, sizeof(text), "%.500s: %s", entry->fts_path,
	         entry->fts_info == FTS_SL ? "a link within a link, which is not followed"
	                                   : "a link to nowhere");
	rebuild->wrong(rebuild->context, text);
	return true;
}

static int take_entry(struct rebuild *rebuild, FTS *walk, FTSENT *entry)
{
	size_t front = strlen(rebuild->archive.folder) + 1;
	char text[ARCHIVE_MESSAGE_MAX];

	switch (entry->fts_info) {
	case FTS_SL:
	case FTS_SLNONE:
		return rebuild_follow(rebuild, walk, entry) ? 0 : DT_E_SYSTEM;
	case FTS_D:
		entry->fts_number |= entry->fts_parent->fts_number;
		return 0;
	case FTS_F:
		if (ends_in(entry->fts_name, ".ini"))
			return rebuild_take(rebuild, entry->fts_path + front);
		look_for_sidecar(rebuild, entry);
		return 0;
	case FTS_DNR:
	case FTS_ERR:
	case FTS_NS:
		snprintf(text, sizeof(text), "%.500s: %s", entry->fts_path, strerror(entry->fts_errno));
		rebuild->wrong(rebuild->context, text);
		return 0;
	default:
		return 0;
	}
}

static int take_all(struct rebuild *rebuild)
{
	char raw[ARCHIVE_PATH_MAX], *roots[] = {raw, NULL};
	FTS *walk;
	FTSENT *entry;
	int result = 0;

	snprintf(raw, sizeof(raw), "%s/raw", rebuild->archive.folder);
	walk = fts_open(roots, FTS_PHYSICAL | FTS_COMFOLLOW | FTS_NOCHDIR, by_name);
	if (walk == NULL)
		return archive_refuse(&rebuild->archive, DT_E_SYSTEM, "%.400s: %s", raw, strerror(errno));
	while (result == 0 && (entry = fts_read(walk)) != NULL)
		result = take_entry(rebuild, walk, entry);
	fts_close(walk);
	return result;
}

/* ---- no drop is lost on the way ---- */

/* Sidecars of drops that the chain has and that were not taken away. */
static int64_t drops_of_chain(const struct chain *chain)
{
	int64_t count = 0;

	for (size_t i = 0; i < chain->count; i++) {
		const struct chain_entry *entry = &chain->entry[i];

		count += sidecar_is_of_drop(entry->path) && strcmp(entry->hash, CHAIN_REMOVED) != 0 &&
		         entry == chain_find(chain, entry->path);
	}
	return count;
}

/* Drops of the index that is there; 0 when it cannot be believed. */
static int64_t drops_of_index(const char *folder)
{
	char path[ARCHIVE_PATH_MAX];
	sqlite3 *old = NULL;
	sqlite3_stmt *s = NULL;
	int64_t count = 0;
	bool whole = false;

	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
	if (sqlite3_open_v2(path, &old, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, NULL) == SQLITE_OK &&
	    sqlite3_prepare_v2(old, "PRAGMA quick_check(1)", -1, &s, NULL) == SQLITE_OK)
		whole = sqlite3_step(s) == SQLITE_ROW && strcmp(sql_text(s, 0), "ok") == 0;
	sqlite3_finalize(s);
	if (whole && sqlite3_prepare_v2(old, "SELECT COUNT(*) FROM drops", -1, &s, NULL) == SQLITE_OK) {
		if (sqlite3_step(s) == SQLITE_ROW)
			count = sqlite3_column_int64(s, 0);
		sqlite3_finalize(s);
	}
	sqlite3_close(old);
	return count;
}

/* A series that awaits its first drop is something. */
static int rebuild_hold_anything(struct archive *archive)
{
	int64_t rows;
	int result = sql_number(archive, &rows, "SELECT COUNT(*) FROM series", "");

	if (result != 0 || rows > 0)
		return result;
	return archive_refuse(
	        archive, DT_E_EMPTY,
	        "%.300s: nothing in the folder 'raw', expected series and drops: is it mounted? "
	        "--fewer makes an empty index",
	        archive->folder);
}

static int rebuild_hold_count(struct rebuild *rebuild)
{
	struct archive *archive = &rebuild->archive;
	int64_t now = 0;
	int result = sql_number(archive, &now, "SELECT COUNT(*) FROM drops", "");

	if (result == 0 && now == 0 && rebuild->before == 0 && !rebuild->fewer)
		return rebuild_hold_anything(archive);
	if (result != 0 || now >= rebuild->before || rebuild->fewer)
		return result;
	return archive_refuse(archive, DT_E_STATE,
	                      "%.300s: %lld drops in the raw files, expected the %lld known until now: is "
	                      "'raw' mounted? --fewer makes the index of what is there",
	                      archive->folder, (long long)now, (long long)rebuild->before);
}

static void rebuild_path_of(const struct archive *archive, char path[ARCHIVE_PATH_MAX], const char *name,
                            const char *ending)
{
	snprintf(path, ARCHIVE_PATH_MAX, "%s/%.60s%.60s", archive->folder, name, ending);
}

/* Moves FROM's file, its log and what goes with it to TO. Only the file itself must be there. */
static int rebuild_move(struct archive *archive, const char *from, const char *to)
{
	static const char *const endings[] = {"-wal", "-shm", ""};
	char old[ARCHIVE_PATH_MAX], new[ARCHIVE_PATH_MAX];

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		rebuild_path_of(archive, old, from, endings[i]);
		rebuild_path_of(archive, new, to, endings[i]);
		if (durable_replace(old, new) != 0 && errno != ENOENT)
			return archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", new, strerror(errno));
	}
	return 0;
}

static void remove_rebuilt(const struct archive *archive)
{
	static const char *const endings[] = {"", "-wal", "-shm"};
	char path[ARCHIVE_PATH_MAX];

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		rebuild_path_of(archive, path, REBUILT, endings[i]);
		unlink(path);
	}
}

/* Within one transaction. */
static int fill_index(struct rebuild *rebuild)
{
	struct archive *archive = &rebuild->archive;
	const struct chain *chain = &rebuild->proof.chain;
	int result = chain->count > 0 ? chain_finish(archive, &chain->entry[chain->count - 1]) : 0;

	if (result == 0)
		result = take_all(rebuild);
	if (result == 0)
		result = proof_of_all(&rebuild->proof, NULL, 0);
	if (result == 0)
		result = proof_of_rest(&rebuild->proof, NULL, false);
	if (result == 0 && chain->broken != 0)
		proof_fault(&rebuild->proof, PROOF_CHAIN, false, CHAIN_FILE ": broken at entry %lld",
		            (long long)chain->broken);
	if (result == 0 && chain->count > 0)
		result = chain_note(archive, chain->entry[chain->count - 1].number,
		                    chain->entry[chain->count - 1].head);
	return result != 0 ? result : rebuild_hold_count(rebuild);
}

static int rebuild_fill(struct rebuild *rebuild)
{
	struct archive *archive = &rebuild->archive;
	int result = proof_open(archive, &rebuild->proof);
	int64_t of_index;

	if (result != 0)
		return result;
	rebuild->proof.wrong = rebuild->wrong;
	rebuild->proof.context = rebuild->context;
	of_index = index_look(archive) == 0 ? drops_of_index(archive->folder) : 0;
	rebuild->before = drops_of_chain(&rebuild->proof.chain);
	if (of_index > rebuild->before)
		rebuild->before = of_index;
	result = index_open(archive, REBUILT, ARCHIVE_CREATE);
	if (result == 0)
		result = archive_start(archive);
	if (result == 0)
		result = archive_end(archive, fill_index(rebuild));
	proof_close(&rebuild->proof);
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

	rebuild_path_of(archive, raw, "raw", "");
	if (access(raw, F_OK) != 0)
		return archive_refuse(archive, DT_E_EMPTY,
		                      "%.400s: no archive there, expected a folder raw in it",
		                      archive->folder);
	result = archive_lock(archive, true);
	if (result != 0)
		return result;
	remove_rebuilt(archive);
	result = rebuild_fill(rebuild);
	snprintf(aside, sizeof(aside), "index.sqlite.before-%lld", (long long)time(NULL));
	if (result == 0)
		result = rebuild_move(archive, "index.sqlite", aside);
	if (result == 0)
		result = rebuild_move(archive, REBUILT, "index.sqlite");
	if (result != 0)
		remove_rebuilt(archive);
	return result;
}

int archive_rebuild(const char *folder, bool fewer, void (*wrong)(void *context, const char *text),
                    void *context, char message[ARCHIVE_MESSAGE_MAX])
{
	struct rebuild rebuild = {
	        .archive = {.lock = -1}, .fewer = fewer, .wrong = wrong, .context = context};
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
