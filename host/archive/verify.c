/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Many drops at once, and what is not a drop's: the chain itself, the sidecars of series and calibrations.
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/indexed.h"
#include "host/base/progress.h"

int proof_of_all(struct proof *proof, const char *series, unsigned number)
{
	struct progress progress;
	int64_t done = 0;
	sqlite3_stmt *s;
	int result =
	        sql_query(proof->archive, &s,
	                  "SELECT d.id, COUNT(*) OVER () FROM drops d JOIN series s ON s.id = d.series_id"
	                  " WHERE (?1 IS NULL OR s.name = ?1)"
	                  " AND (?2 = 0 OR d.number = ?2) ORDER BY d.raw",
	                  "si", series, (int64_t)number);

	if (result != 0)
		return result;
	progress_begin(&progress, 2.0);
	while ((result = sql_step(proof->archive, s)) > 0) {
		int64_t all = sqlite3_column_int64(s, 1);

		progress_tell(&progress, (double)done / (double)all,
		              "%lld of %lld drops held against their files", (long long)done, (long long)all);
		result = proof_of_drop(proof, sqlite3_column_int64(s, 0));
		if (result != 0)
			break;
		done++;
	}
	progress_end(&progress);
	sqlite3_finalize(s);
	return result;
}

/* A recorder that died before its drop was in the index: nothing was acknowledged. */
static bool was_begun_only(struct proof *proof, const struct chain_entry *entry)
{
	struct sidecar sidecar = {.file = entry->path};
	char *text = proof_text(proof, entry);
	bool begun = text != NULL && sidecar_split(proof->archive, &sidecar, text) == 0 &&
	             strcmp(sidecar_value(&sidecar, "state"), "recording") == 0;

	free(text);
	return begun;
}

/* A sidecar that the chain has and the index has not. */
static int hold_unknown(struct proof *proof, const struct chain_entry *entry)
{
	int64_t row;
	int result = sidecar_drop(proof->archive, entry->path, &row);

	if (result != DT_E_EMPTY)
		return result;
	if (!was_begun_only(proof, entry))
		proof_fault(proof, PROOF_INDEX, true, "index.sqlite: missing: the drop of %s", entry->path);
	return 0;
}

/* Of a series or a calibration. */
static int hold_sidecar(struct proof *proof, const struct chain_entry *entry)
{
	struct sidecar sidecar = {.file = entry->path};
	char *text = proof_text(proof, entry);
	int result = 0;

	if (text == NULL)
		proof_of_file(proof, PROOF_SIDECAR, entry->path, entry->bytes, entry->hash, -1);
	else if (entry->number <= proof->noted && sidecar_split(proof->archive, &sidecar, text) == 0)
		result = indexed_hold_other(proof, &sidecar);
	free(text);
	return result;
}

/* Whether the drop of this path is of a series; NULL: of any. */
static bool is_of_series(const char *path, const char *series)
{
	const char *name = strrchr(path, '/');
	size_t length = series != NULL ? strlen(series) : 0;

	return series == NULL ||
	       (name != NULL && (size_t)(name - path) > length && name[-(ptrdiff_t)length - 1] == '/' &&
	        strncmp(name - length, series, length) == 0);
}

int proof_of_rest(struct proof *proof, const char *series, bool drops)
{
	const struct chain *chain = &proof->chain;
	int result = 0;

	for (size_t i = 0; i < chain->count && result == 0; i++) {
		const struct chain_entry *entry = &chain->entry[chain->by_path[i]];

		if (entry != chain_find(chain, entry->path) || strcmp(entry->hash, CHAIN_REMOVED) == 0 ||
		    !is_of_series(entry->path, series))
			continue;
		if (!sidecar_is_of_drop(entry->path))
			result = hold_sidecar(proof, entry);
		else if (drops)
			result = hold_unknown(proof, entry);
	}
	return result;
}

static int hold_chain(struct proof *proof)
{
	int reaches = chain_reaches(proof->archive, &proof->chain);

	if (reaches < 0)
		return reaches;
	if (reaches == 0)
		proof_fault(proof, PROOF_CHAIN, proof->chain.count == 0, "%s",
		            archive_message(proof->archive));
	else
		reaches = chain_is_reached(proof->archive, &proof->chain);
	if (reaches < 0)
		return reaches;
	if (reaches == 0 && proof->told == 0)
		proof_fault(proof, PROOF_INDEX, false, "%s", archive_message(proof->archive));
	if (proof->chain.broken != 0)
		proof_fault(proof, PROOF_CHAIN, false, CHAIN_FILE ": broken at entry %lld",
		            (long long)proof->chain.broken);
	return 0;
}

/* The series' own sidecar, and drops that the index lacks; as a mark of a drop is for who looks without being
 * told. */
static int verify_series(struct proof *proof, const char *series)
{
	struct archive *archive = proof->archive;
	unsigned told = proof->told;
	int result;

	proof->fault[0] = '\0';
	result = proof_of_rest(proof, series, true);
	if (proof->told > told && archive->unread[0] == '\0')
		snprintf(archive->unread, sizeof(archive->unread), "%s", proof->fault);
	return result;
}

int archive_verify_series(struct archive *archive, const char *series,
                          void (*wrong)(void *context, const char *text), void *context)
{
	struct proof proof;
	int result = proof_open(archive, &proof);
	unsigned of_chain;

	if (result != 0)
		return result;
	proof.wrong = wrong;
	proof.context = context;
	result = hold_chain(&proof);
	of_chain = proof.told;
	if (result == 0)
		result = verify_series(&proof, series);
	result = result != 0 ? result : (int)(proof.told - of_chain);
	proof_close(&proof);
	return result;
}

int archive_verify(struct archive *archive, const char *series, unsigned number,
                   void (*wrong)(void *context, const char *text), void *context)
{
	struct proof proof;
	int result = proof_open(archive, &proof), told, of_chain;

	if (result != 0)
		return result;
	proof.wrong = wrong;
	proof.context = context;
	if (number == 0)
		result = hold_chain(&proof);
	of_chain = series != NULL ? (int)proof.told : 0; /* told, and no lack of the series */
	if (result == 0 && series != NULL && number == 0)
		result = verify_series(&proof, series);
	if (result == 0)
		result = proof_of_all(&proof, series, number);
	if (result == 0 && series == NULL)
		result = proof_of_rest(&proof, NULL, true);
	if (result == 0 && series == NULL)
		result = indexed_hold_more(&proof);
	told = (int)proof.told - of_chain;
	proof_close(&proof);
	return result != 0 ? result : told;
}

int archive_seal(struct archive *archive, struct archive_seal *seal)
{
	struct archive_seal found = {.entry = 0};
	sqlite3_stmt *s;
	int result = sql_query(archive, &s,
	                       "SELECT COALESCE((SELECT entries FROM chain), 0), (SELECT head FROM chain),"
	                       " (SELECT COUNT(*) FROM drops WHERE state = 'recorded'),"
	                       " (SELECT COUNT(*) FROM drops WHERE state = 'recorded' AND entry = 0)",
	                       "");

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		found.entry = sqlite3_column_int64(s, 0);
		snprintf(found.head, sizeof(found.head), "%.64s", sql_text(s, 1));
		found.drops = sqlite3_column_int64(s, 2);
		found.not_sealed = sqlite3_column_int64(s, 3);
		*seal = found;
	}
	sqlite3_finalize(s);
	return result < 0 ? result : 0;
}

int archive_reaches(struct archive *archive, int64_t entry, const char *head)
{
	struct chain chain;
	int result = chain_load(archive, &chain), found = 0;

	if (result != 0)
		return result;
	for (size_t i = 0; i < chain.count && !found; i++)
		found = chain.entry[i].number == entry && chain.entry[i].sound &&
		        strcmp(chain.entry[i].head, head) == 0;
	chain_free(&chain);
	return found;
}
