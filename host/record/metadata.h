/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_METADATA_H
#define DT_HOST_RECORD_METADATA_H
/*
 * What a record knows of a drop beside its samples, as a list of named values, for the formats that keep
 * them by name. Gaps and flags are not in it: record_finish and drop_close find them again from the samples.
 *
 * A name once written to a file keeps its meaning.
 */
#include "host/record/record.h"

enum metadata_kind {
	METADATA_REAL,
	METADATA_I16,
	METADATA_U16,
	METADATA_U32,
	METADATA_U64,
	METADATA_TIME, /* int64_t, seconds since 1970; as text 2026-11-27T23:18:58+00:00 */
	METADATA_TEXT, /* one line without commas and double quotes */
};

enum { METADATA_TEXT_MAX = 64 }; /* a value as text, its NUL included */

struct metadata_entry {
	const char *name;
	enum metadata_kind kind;
	size_t offset; /* in struct record */
	bool of_drop;  /* only a drop has it */
};

/* The i-th from 0; NULL behind the last. */
const struct metadata_entry *metadata_entry(size_t i);

/* NULL if there is none of that name. */
const struct metadata_entry *metadata_find(const char *name);

/* Whether this record has it: the value is known, and the record a drop where it must be. */
bool metadata_known(const struct record *record, const struct metadata_entry *entry);

/* As files have it. */
void metadata_format(const struct record *record, const struct metadata_entry *entry,
                     char text[METADATA_TEXT_MAX]);

/* The other way, as metadata_set. DT_E_RANGE: not of its kind, or does not fit. */
DT_MUST_USE int metadata_parse(struct record *record, const struct metadata_entry *entry, const char *text);

/* Words of a user's as a text of the record: what it cannot hold is replaced, what is too long is cut. */
void metadata_take_words(char text[METADATA_TEXT_MAX], const char *words);

double metadata_real(const struct record *record, const struct metadata_entry *entry);
int64_t metadata_whole(const struct record *record, const struct metadata_entry *entry);

/* Sets it; with drop_id the record becomes a drop, with crc32 one whose capture end came, with what it
 * measured one that measured; a parameter is held. DT_E_RANGE if value is not finite, not whole or does not
 * fit. */
DT_MUST_USE int metadata_set(struct record *record, const struct metadata_entry *entry, double value);

#endif
