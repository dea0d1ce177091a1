/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_CHAIN_H
#define DT_HOST_ARCHIVE_CHAIN_H
/*
 * The chain of an archive: FOLDER/raw/chain, one line for each version of each sidecar, never written over.
 *
 *     17 2026-11-23T20:02:34Z raw/2026/box/0003.ini 5123 SHA-256-of-the-sidecar HEAD
 *
 * HEAD is the SHA-256 of the previous line's HEAD, a blank and this line up to its HEAD, so that it stands
 * for all that came before. A sidecar holds the SHA-256 of its log and of its results. Written within the
 * transaction that writes the sidecar: one writer at a time.
 */
#include "host/base/durable.h"
#include "host/record/digest.h"
#include "host/archive/private.h"

#define CHAIN_FILE "raw/chain"

/* Instead of a hash, of a sidecar that was taken away. */
#define CHAIN_REMOVED "removed"

struct chain_entry {
	int64_t number; /* from 1 */
	int64_t bytes;
	const char *path, *hash, *head;
	bool sound; /* its head is what follows from the line before and from what it says */
};

struct chain {
	char *text;
	size_t size; /* of the file */
	struct chain_entry *entry;
	size_t count;
	size_t *by_path; /* places in entry, by path, then in their order */
	int64_t broken;  /* the first entry that is not sound; 0: none */
};

/* An archive that has none gives an empty one. To be freed by chain_free after 0. */
DT_MUST_USE int chain_load(struct archive *archive, struct chain *chain);
void chain_free(struct chain *chain);

/* The last entry of path; NULL when there is none. */
const struct chain_entry *chain_find(const struct chain *chain, const char *path);

/* The entry that has this hash, the last of them; NULL. */
const struct chain_entry *chain_find_hash(const struct chain *chain, const char *hash);

/* Puts the sidecar of the chain's last entry in its place, if a writer ended between entering it and that. To
 * be called by who holds the lock. */
DT_MUST_USE int chain_finish(struct archive *archive, const struct chain_entry *last);

/* Where the next entry goes. */
struct chain_place {
	int64_t number, at;
	char head[DIGEST_CHARS]; /* before it */
};

/* Finds it, after chain_finish of the entry before it. */
DT_MUST_USE int chain_next(struct archive *archive, struct chain_place *place);

/* The place of entry NUMBER of path, which a sidecar entered there tells; NULL when path has no such entry.
 */
const struct chain_entry *chain_place(const struct chain *chain, const char *path, int64_t number,
                                      struct chain_place *place);

/* Enters path; the index notes the new head. */
DT_MUST_USE int chain_enter(struct archive *archive, const struct chain_place *place, const char *path,
                            int64_t bytes, const char *hash);

/* Whether the chain holds the entry whose head the index notes: 1, or 0 with one line in message. */
DT_MUST_USE int chain_reaches(struct archive *archive, const struct chain *chain);

/* Whether all entries behind NOTED are of one sidecar, as a writer leaves them that dies before it commits;
 * its path, NULL when there are none. */
bool chain_is_of_one(const struct chain *chain, int64_t noted, const char **path);

/* The same of what the index notes: 1, or 0 with one line in message. */
DT_MUST_USE int chain_is_reached(struct archive *archive, const struct chain *chain);

/* The sidecar of which a writer left an entry so: 1; 0: of none. Within a transaction. */
DT_MUST_USE int chain_left(struct archive *archive, char file[ARCHIVE_PATH_MAX]);

/* The index notes the chain's last entry as its head. */
DT_MUST_USE int chain_note(struct archive *archive, int64_t number, const char *head);

#endif
