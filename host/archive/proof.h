/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PROOF_H
#define DT_HOST_ARCHIVE_PROOF_H
/*
 * Whether log, sidecar and results of a drop are what was recorded: the sidecar by the chain, log and results
 * by the sidecar, the index by both. A drop that the chain does not know is held against the index alone.
 */
#include "host/archive/sidecar.h"

struct proof {
	struct archive *archive;
	struct chain chain;
	int64_t noted; /* the last entry that the index knows of: what comes behind was not acknowledged */
	void (*wrong)(void *context, const char *text); /* NULL: nobody is told */
	void *context;
	unsigned told; /* over all drops */
	/* of the drop looked at last */
	int64_t drop;
	char name[ARCHIVE_NAME_MAX + 16], raw[ARCHIVE_NAME_MAX + 64], file[ARCHIVE_NAME_MAX + 64];
	char hash[DIGEST_CHARS]; /* of the log, says the index */
	int64_t bytes, entry;    /* the same */
	int copy;                /* gets the bytes of the log; -1: nobody does */
	bool log_or_sidecar;     /* is wrong, rather than a result or a photo */
	bool missing, altered, sealed;
	bool begun;   /* it is not recorded, says the index */
	bool index;   /* its row is wrong, which a change would write into its sidecar */
	bool indexed; /* its row is what the chain has of it, now or as of an entry that was overtaken */
	bool today;   /* the result at hand was made by today's table of quantities */
	sqlite3_stmt *place[QUANTITY_PLACES], *columns, *flags; /* of indexed.c, kept for the next drop */
	bool unread; /* a file is there and could not be read: it may be what was recorded */
	char fault[ARCHIVE_MESSAGE_MAX]; /* the first; "": none */
};

DT_MUST_USE int proof_open(struct archive *archive, struct proof *proof);
void proof_close(struct proof *proof);

/* The drop of that row; the index is marked as far as it can be written. */
DT_MUST_USE int proof_of_drop(struct proof *proof, int64_t drop);

/* All drops of a series, or of all when it is NULL; number 0: each of them. */
DT_MUST_USE int proof_of_all(struct proof *proof, const char *series, unsigned number);

/* Every other sidecar of the chain, or of a series; drops: and whether the index has the drops that the chain
 * has. */
DT_MUST_USE int proof_of_rest(struct proof *proof, const char *series, bool drops);

/* What was entered, when it is there: in its place, or still beside it. To be freed; NULL. */
char *proof_text(const struct proof *proof, const struct chain_entry *entry);

/* What is wrong with the files of SERIES/NUMBER; "" when nothing is, or it is not recorded. DT_E_CORRUPT: its
 * row is, which a change would write into its sidecar. */
DT_MUST_USE int proof_look(struct archive *archive, const char *drop, char fault[ARCHIVE_MESSAGE_MAX]);

/* A change writes the sidecar again, so that what was wrong before goes into its history. */
DT_MUST_USE int proof_log(struct archive *archive, int64_t drop, const char *fault);

/* One line on the file at hand. */
enum proof_part { PROOF_LOG, PROOF_SIDECAR, PROOF_RESULT, PROOF_PHOTO, PROOF_INDEX, PROOF_CHAIN };
__attribute__((format(printf, 4, 5))) void proof_fault(struct proof *proof, enum proof_part part,
                                                       bool missing, const char *format, ...);

/* Holds file (in the folder) against its hash and says what it is instead; copy as above. */
bool proof_of_file(struct proof *proof, enum proof_part part, const char *file, int64_t bytes,
                   const char *hash, int copy);

#endif
