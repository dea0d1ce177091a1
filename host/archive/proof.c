/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/indexed.h"
#include "host/archive/photo.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

int proof_open(struct archive *archive, struct proof *proof)
{
	const char *path;
	int result;

	*proof = (struct proof){.archive = archive, .copy = -1};
	result = chain_load(archive, &proof->chain);
	if (result != 0 || archive->index == NULL) /* before it is made again */
		return result;
	result = sql_number(archive, &proof->noted, "SELECT entries FROM chain", "");
	if (result != 0 && result != DT_E_EMPTY) {
		chain_free(&proof->chain);
		return result;
	}
	if (!chain_is_of_one(&proof->chain, proof->noted, &path)) /* an earlier index was put back */
		proof->noted = INT64_MAX;
	return 0;
}

void proof_close(struct proof *proof)
{
	indexed_close(proof);
	chain_free(&proof->chain);
}

void proof_fault(struct proof *proof, enum proof_part part, bool missing, const char *format, ...)
{
	char text[ARCHIVE_MESSAGE_MAX];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	for (char *tab = text; (tab = strchr(tab, '\t')) != NULL;) /* of a line of a sidecar */
		*tab = ' ';
	if (proof->wrong != NULL)
		proof->wrong(proof->context, text);
	proof->told++;
	if (proof->fault[0] == '\0')
		memcpy(proof->fault, text, sizeof(text));
	proof->log_or_sidecar |= part != PROOF_RESULT && part != PROOF_PHOTO;
	proof->index |= part == PROOF_INDEX;
	proof->missing |= missing;
	proof->altered |= !missing;
}

/* ---- a file ---- */

/* The first text that a statement finds for two values, into to; "" when there is none. */
static void find_text(struct archive *archive, const char *statement, const char *value, int64_t drop,
                      char to[ARCHIVE_NAME_MAX + 16])
{
	sqlite3_stmt *s;

	to[0] = '\0';
	if (sql_query(archive, &s, statement, "si", value, drop) != 0)
		return;
	if (sql_step(archive, s) > 0)
		snprintf(to, ARCHIVE_NAME_MAX + 16, "%s", sql_text(s, 0));
	sqlite3_finalize(s);
}

/* What else of this archive has these bytes; "" nothing. */
static void elsewhere(struct proof *proof, enum proof_part part, const char *path, const char *hash,
                      char text[ARCHIVE_NAME_MAX + 128])
{
	const struct chain_entry *entry = chain_find_hash(&proof->chain, hash);
	char name[ARCHIVE_NAME_MAX + 16], *json;

	text[0] = '\0';
	find_text(proof->archive,
	          "SELECT s.name || '/' || d.number FROM drops d JOIN series s ON s.id = d.series_id"
	          " WHERE d.sha256 = ? AND d.id <> ?",
	          hash, proof->drop, name);
	if (name[0] != '\0')
		snprintf(text, ARCHIVE_NAME_MAX + 128, "the log of %s", name);
	else if (entry != NULL)
		snprintf(text, ARCHIVE_NAME_MAX + 128, "%s as of entry %lld", entry->path,
		         (long long)entry->number);
	if (part != PROOF_RESULT || text[0] != '\0' || (json = durable_read(path, NULL)) == NULL)
		return;
	find_text(proof->archive,
	          "SELECT s.name || '/' || d.number || ' by ' || v.name FROM texts t"
	          " JOIN results r ON r.id = t.result_id JOIN versions v ON v.id = r.version_id"
	          " JOIN drops d ON d.id = r.drop_id JOIN series s ON s.id = d.series_id"
	          " WHERE t.json = ?1 AND d.id <> ?2"
	          " AND d.series_id = (SELECT series_id FROM drops WHERE id = ?2)",
	          json, proof->drop, name);
	free(json);
	if (name[0] != '\0')
		snprintf(text, ARCHIVE_NAME_MAX + 128, "the result of %s", name);
}

static void tell_kind(struct proof *proof, enum proof_part part, const char *file, const char *path,
                      int64_t found_bytes, const char *found, int64_t bytes, const char *hash)
{
	char other[ARCHIVE_NAME_MAX + 128] = "";

	if (found_bytes > 0)
		elsewhere(proof, part, path, found, other);
	if (found_bytes == 0)
		proof_fault(proof, part, false, "%.200s: emptied: expected %lld bytes", file,
		            (long long)bytes);
	else if (other[0] != '\0')
		proof_fault(proof, part, false, "%.200s: exchanged: it is %s, expected SHA-256 %s", file,
		            other, hash);
	else if (found_bytes < bytes)
		proof_fault(proof, part, false, "%.200s: cut: %lld bytes, expected %lld", file,
		            (long long)found_bytes, (long long)bytes);
	else
		proof_fault(proof, part, false, "%.200s: altered: its SHA-256 is %s, expected %s", file,
		            found, hash);
}

/* Says nothing of what the file is: who asked gets no answer, and the index keeps what it knew. */
static void tell_unread(struct proof *proof, enum proof_part part, const char *file, const char *why)
{
	proof_fault(proof, part, false, "%.200s: cannot be read: %s", file, why);
	proof->unread = true;
	if (proof->archive->unread[0] == '\0')
		snprintf(proof->archive->unread, sizeof(proof->archive->unread), "%.200s: cannot be read: %s",
		         file, why);
}

bool proof_of_file(struct proof *proof, enum proof_part part, const char *file, int64_t bytes,
                   const char *hash, int copy)
{
	char path[ARCHIVE_PATH_MAX], found[DIGEST_CHARS];
	int64_t found_bytes = 0;

	snprintf(path, sizeof(path), "%s/%.200s", proof->archive->folder, file);
	if (digest_file(path, found, &found_bytes, copy) != 0) {
		if (errno == ENOENT || errno == ENOTDIR)
			proof_fault(proof, part, true, "%.200s: missing", file);
		else
			tell_unread(proof, part, file, strerror(errno));
		return false;
	}
	if (strcmp(found, hash) == 0)
		return true;
	tell_kind(proof, part, file, path, found_bytes, found, bytes, hash);
	return false;
}

/* ---- the sidecar ---- */

/* The text of a file that has this hash; NULL. */
static char *text_with(const char *path, const char *hash)
{
	char found[DIGEST_CHARS], *text;
	size_t size;

	text = durable_read(path, &size);
	if (text == NULL)
		return NULL;
	digest_of(text, size, found);
	if (strcmp(found, hash) == 0)
		return text;
	free(text);
	return NULL;
}

char *proof_text(const struct proof *proof, const struct chain_entry *entry)
{
	char path[ARCHIVE_PATH_MAX], part[ARCHIVE_PATH_MAX + 8], *text;

	snprintf(path, sizeof(path), "%s/%.200s", proof->archive->folder, entry->path);
	snprintf(part, sizeof(part), "%s.part", path);
	text = text_with(path, entry->hash);
	return text != NULL ? text : text_with(part, entry->hash);
}

/* Somebody else may have written since the chain was read. */
static const struct chain_entry *entry_now(struct proof *proof, const struct chain_entry *entry)
{
	char path[ARCHIVE_PATH_MAX];
	struct chain fresh;
	struct stat now;

	snprintf(path, sizeof(path), "%s/" CHAIN_FILE, proof->archive->folder);
	if (stat(path, &now) != 0 || (size_t)now.st_size == proof->chain.size ||
	    chain_load(proof->archive, &fresh) != 0)
		return entry;
	chain_free(&proof->chain);
	proof->chain = fresh;
	return chain_find(&proof->chain, proof->file);
}

/* NULL when it is not what was entered, which is told. */
static char *sealed_text(struct proof *proof, const struct chain_entry *entry)
{
	char *text;

	if (strcmp(entry->hash, CHAIN_REMOVED) == 0) {
		proof_fault(proof, PROOF_CHAIN, false, CHAIN_FILE ": entry %lld took %s away",
		            (long long)entry->number, proof->file);
		return NULL;
	}
	text = proof_text(proof, entry);
	if (text == NULL) {
		entry = entry_now(proof, entry);
		text = proof_text(proof, entry);
	}
	if (text == NULL && proof_of_file(proof, PROOF_SIDECAR, proof->file, entry->bytes, entry->hash, -1))
		tell_unread(proof, PROOF_SIDECAR, proof->file, "a second look finds it whole");
	if (!entry->sound)
		proof_fault(proof, PROOF_CHAIN, false, CHAIN_FILE ": broken at entry %lld, of %s",
		            (long long)entry->number, proof->file);
	if (entry->number < proof->entry)
		proof_fault(proof, PROOF_CHAIN, false, CHAIN_FILE ": cut: no entry %lld, of %s",
		            (long long)proof->entry, proof->file);
	return text;
}

/* From before there was a chain: it is there and says what it should. */
static char *unsealed_text(struct proof *proof)
{
	char path[ARCHIVE_PATH_MAX], *text;
	size_t size = 0;

	snprintf(path, sizeof(path), "%s/%.200s", proof->archive->folder, proof->file);
	text = durable_read(path, &size);
	if (text == NULL && errno == ENOENT)
		proof_fault(proof, PROOF_SIDECAR, true, "%s: missing", proof->file);
	else if (text == NULL)
		tell_unread(proof, PROOF_SIDECAR, proof->file, strerror(errno));
	else if (size == 0)
		proof_fault(proof, PROOF_SIDECAR, false, "%s: emptied", proof->file);
	if (proof->entry != 0)
		proof_fault(proof, PROOF_CHAIN, true, CHAIN_FILE ": missing: no entry %lld, of %s",
		            (long long)proof->entry, proof->file);
	if (size > 0)
		return text;
	free(text);
	return NULL;
}

/* ---- a drop ---- */

/* The log's hash of a sidecar that is what was entered is the one to go by. */
static void believe(struct proof *proof, const struct sidecar *sidecar)
{
	if (!proof->sealed)
		return;
	snprintf(proof->hash, sizeof(proof->hash), "%.64s", sidecar_value(sidecar, "sha256"));
	proof->bytes = strtoll(sidecar_value(sidecar, "bytes"), NULL, 10);
}

/* What the index has of a result, held against what the sidecar and its own text say: 1 with bytes and hash
 * of the text, 0 without any, DT_E_*. */
static int hold_result_of_index(struct proof *proof, const struct sidecar_result *r, int64_t *bytes,
                                char hash[DIGEST_CHARS])
{
	sqlite3_stmt *s;
	int result =
	        sql_query(proof->archive, &s,
	                  "SELECT t.json, r.id, r.time FROM results r JOIN versions v ON v.id = r.version_id"
	                  " JOIN texts t ON t.result_id = r.id WHERE r.drop_id = ? AND v.name = ?",
	                  "is", proof->drop, r->version);

	if (result != 0)
		return result;
	result = sql_step(proof->archive, s);
	if (result > 0) {
		*bytes = (int64_t)strlen(sql_text(s, 0));
		digest_of(sql_text(s, 0), (size_t)*bytes, hash);
		if (!proof->indexed && r->bytes >= 0 &&
		    (strcmp(hash, r->hash) != 0 || strcmp(sql_text(s, 2), r->time) != 0))
			proof_fault(proof, PROOF_RESULT, false,
			            "index.sqlite: altered: the result of %s by %s is not the one recorded",
			            proof->name, r->version);
		result = indexed_hold_result(proof, sqlite3_column_int64(s, 1), sql_text(s, 0));
		result = result != 0 ? result : 1;
	}
	sqlite3_finalize(s);
	return result;
}

static int hold_result(struct proof *proof, const char *text)
{
	char hash[DIGEST_CHARS], path[ARCHIVE_PATH_MAX];
	struct sidecar_result r;
	int64_t bytes = 0;
	int known;

	if (!sidecar_result(text, &r) || archive_check_name(proof->archive, "version", r.version) != 0) {
		proof_fault(proof, PROOF_SIDECAR, false, "%s: damaged: result = %.100s", proof->file, text);
		return 0;
	}
	known = hold_result_of_index(proof, &r, &bytes, hash);
	if (known < 0 || (known == 0 && r.bytes < 0))
		return known;
	sidecar_json_path(proof->archive, proof->file, r.version, path);
	if (proof_of_file(proof, PROOF_RESULT, path + strlen(proof->archive->folder) + 1,
	                  r.bytes >= 0 ? r.bytes : bytes, r.bytes >= 0 ? r.hash : hash, -1) &&
	    known == 0 && !proof->indexed)
		proof_fault(proof, PROOF_RESULT, true, "index.sqlite: missing: the result of %s by %s",
		            proof->name, r.version);
	return 0;
}

/* The file that an event of a photo names. */
static void hold_photo(struct proof *proof, const char *event)
{
	static const char mark[] = "\tphoto\t";
	const char *what = strstr(event, mark),
	           *text = what != NULL ? strchr(what + sizeof(mark) - 1, '\t') : NULL;
	struct photo photo;

	if (text == NULL || memchr(event, '\t', strlen(event)) != what)
		return;
	if (photo_parse(text + 1, &photo))
		proof_of_file(proof, PROOF_PHOTO, photo.file, photo.bytes, photo.hash, -1);
	else
		proof_fault(proof, PROOF_SIDECAR, false, "%s: damaged: event = %.100s", proof->file, event);
}

/* What no line names: the order of results, the number of the entry. */
static void hold_entry(struct proof *proof, const struct chain_entry *entry)
{
	if (!proof->indexed && entry != NULL && entry->sound)
		proof_fault(proof, PROOF_INDEX, false,
		            "index.sqlite: altered: %s: entry = %lld, expected what " CHAIN_FILE
		            " has as entry %lld",
		            proof->name, (long long)proof->entry, (long long)entry->number);
}

/* Takes text. */
static int proof_hold_text(struct proof *proof, const struct chain_entry *entry, char *text)
{
	struct sidecar sidecar = {.file = proof->file};
	unsigned told = proof->told;
	const char *at, *line;
	int result = 0;

	if (sidecar_split(proof->archive, &sidecar, text) != 0) {
		proof_fault(proof, PROOF_SIDECAR, false, "%s", archive_message(proof->archive));
	} else {
		result = indexed_hold_drop(proof, entry, &sidecar);
		believe(proof, &sidecar);
		at = sidecar.line;
		while (result == 0 && *(line = sidecar_next(&sidecar, "result", &at)) != '\0')
			result = hold_result(proof, line);
		at = sidecar.line;
		while (result == 0 && *(line = sidecar_next(&sidecar, "event", &at)) != '\0')
			hold_photo(proof, line);
		if (result == 0 && proof->told == told)
			hold_entry(proof, entry);
	}
	free(text);
	return result;
}

static int proof_read_row(struct proof *proof, int64_t drop)
{
	sqlite3_stmt *s;
	int result = sql_query(
	        proof->archive, &s,
	        "SELECT s.name || '/' || d.number, d.raw, d.sha256, d.bytes, d.entry,"
	        " d.state = 'recording' FROM drops d JOIN series s ON s.id = d.series_id WHERE d.id = ?",
	        "i", drop);

	if (result != 0)
		return result;
	result = sql_step(proof->archive, s);
	proof->drop = drop;
	snprintf(proof->name, sizeof(proof->name), "%s", sql_text(s, 0));
	snprintf(proof->raw, sizeof(proof->raw), "%s", sql_text(s, 1));
	snprintf(proof->hash, sizeof(proof->hash), "%s", sql_text(s, 2));
	proof->bytes = sqlite3_column_int64(s, 3);
	proof->entry = sqlite3_column_int64(s, 4);
	proof->begun = sqlite3_column_int(s, 5) != 0;
	sqlite3_finalize(s);
	if (result == 0)
		return archive_refuse(proof->archive, DT_E_UNKNOWN, "no such drop");
	if (result > 0)
		sidecar_name(proof->raw, proof->file);
	return result < 0 ? result : 0;
}

/* A folder that cannot be written is verified, too: its marks live as long as it is open. */
static int remember(struct proof *proof)
{
	struct archive *archive = proof->archive;
	struct archive_mark *mark, *more;
	size_t at = 0;

	while (at < archive->marks && archive->mark[at].drop != proof->drop)
		at++;
	if (at == archive->marks) {
		more = realloc(archive->mark, (archive->marks + 1) * sizeof(*more));
		if (more == NULL)
			return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
		archive->mark = more;
		more[archive->marks++].fault[0] = '\0';
	}
	mark = &archive->mark[at];
	archive->marked += strcmp(mark->fault, proof->fault) != 0;
	*mark = (struct archive_mark){.drop = proof->drop, .missing = !proof->altered};
	memcpy(mark->fault, proof->fault, sizeof(mark->fault));
	return 0;
}

static int proof_mark(struct proof *proof)
{
	char before[ARCHIVE_MESSAGE_MAX];

	if (proof->unread)
		return remember(proof);
	memcpy(before, proof->archive->message, sizeof(before));
	if (sql_run(proof->archive,
	            "UPDATE drops SET proof = ?1, fault = ?2 WHERE id = ?3 AND (proof <> ?1 OR fault <> ?2)",
	            "ssi",
	            proof->altered   ? "altered"
	            : proof->missing ? "missing"
	                             : "",
	            proof->fault, proof->drop) == 0) {
		proof->archive->marked += sqlite3_changes(proof->archive->index) > 0;
		return 0;
	}
	memcpy(proof->archive->message, before, sizeof(before));
	return proof->fault[0] != '\0' ? remember(proof) : 0;
}

/* A drop that is being recorded, or was interrupted, has nothing to be held against but its row. */
static int hold_begun(struct proof *proof, const struct chain_entry *entry)
{
	struct sidecar sidecar = {.file = proof->file};
	char *text = entry != NULL ? proof_text(proof, entry) : NULL;
	int result = 0;

	if (text != NULL && sidecar_split(proof->archive, &sidecar, text) == 0)
		result = indexed_hold_drop(proof, entry, &sidecar);
	free(text);
	return result;
}

static int hold_recorded(struct proof *proof, const struct chain_entry *entry)
{
	char *text = entry != NULL ? sealed_text(proof, entry) : unsealed_text(proof);
	bool whole = text != NULL;
	int result = 0;

	entry = chain_find(&proof->chain, proof->file); /* which sealed_text may have read again */
	if (whole)
		result = proof_hold_text(proof, entry, text);
	else if (entry != NULL)
		result = indexed_hold_drop(proof, entry, NULL);
	if (result == 0 && !whole)
		hold_entry(proof, entry);
	return result;
}

/* All that is read of the index is of one moment. */
static int hold_drop(struct proof *proof, int64_t drop)
{
	const struct chain_entry *entry;
	int result = proof_read_row(proof, drop);

	if (result != 0)
		return result;
	proof->log_or_sidecar = proof->missing = proof->altered = proof->unread = false;
	proof->index = proof->indexed = false;
	proof->fault[0] = '\0';
	entry = chain_find(&proof->chain, proof->file);
	proof->sealed = entry != NULL;
	return proof->begun ? hold_begun(proof, entry) : hold_recorded(proof, entry);
}

int proof_of_drop(struct proof *proof, int64_t drop)
{
	int result = sql_script(proof->archive, "SAVEPOINT look");

	if (result != 0)
		return result;
	result = hold_drop(proof, drop);
	if (sql_script(proof->archive, "RELEASE look") != 0 && result == 0)
		result = DT_E_SYSTEM;
	if (result == 0 && !proof->begun)
		proof_of_file(proof, PROOF_LOG, proof->raw, proof->bytes, proof->hash, proof->copy);
	return result != 0 ? result : proof_mark(proof);
}

/* ---- before a change ---- */

int proof_look(struct archive *archive, const char *drop, char fault[ARCHIVE_MESSAGE_MAX])
{
	struct archive_place place;
	struct proof proof;
	int result = archive_locate(archive, drop, &place);

	fault[0] = '\0';
	if (result != 0 || !place.recorded)
		return result;
	result = proof_open(archive, &proof);
	if (result != 0)
		return result;
	result = proof_of_drop(&proof, place.drop);
	if (result == 0 && proof.unread)
		result = archive_refuse(archive, DT_E_SYSTEM, "%.100s: %.500s", drop, archive->unread);
	if (result == 0 && proof.index)
		result = archive_refuse(
		        archive, DT_E_CORRUPT,
		        "%.100s cannot be changed: %.300s; 'droptower series --rebuild' makes the "
		        "index again",
		        drop, proof.fault);
	if (result == 0)
		snprintf(fault, ARCHIVE_MESSAGE_MAX, "%s", proof.fault);
	proof_close(&proof);
	return result;
}

int proof_log(struct archive *archive, int64_t drop, const char *fault)
{
	return fault[0] != '\0' ? event_insert(archive, drop, "fault", "droptower", fault) : 0;
}
