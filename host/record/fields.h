/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_FIELDS_H
#define DT_HOST_RECORD_FIELDS_H
/*
 * What a record knows of a drop beside its samples, as a list of named values, for the formats that keep
 * them by name. Gaps and flags are not in it: record_finish and drop_close find them again from the samples.
 *
 * A name once written to a file keeps its meaning.
 */
#include "host/record/record.h"

enum fields_kind {
	FIELDS_REAL,
	FIELDS_I16,
	FIELDS_U16,
	FIELDS_U32,
	FIELDS_U64,
	FIELDS_TIME, /* int64_t, seconds since 1970; as text 2026-11-27T23:18:58+00:00 */
	FIELDS_TEXT, /* one line without commas and double quotes */
};

enum { FIELDS_TEXT_MAX = 64 }; /* a value as text, its NUL included */

struct fields_entry {
	const char *name;
	enum fields_kind kind;
	size_t offset; /* in struct record */
	bool of_drop;  /* only a drop has it */
};

/* The i-th from 0; NULL behind the last. */
const struct fields_entry *fields_entry(size_t i);

/* NULL if there is none of that name. */
const struct fields_entry *fields_find(const char *name);

/* Whether this record has it: the value is known, and the record a drop where it must be. */
bool fields_known(const struct record *record, const struct fields_entry *entry);

/* As files have it. */
void fields_format(const struct record *record, const struct fields_entry *entry, char text[FIELDS_TEXT_MAX]);

/* The other way, as fields_set. DT_E_RANGE: not of its kind, or does not fit. */
DT_MUST_USE int fields_parse(struct record *record, const struct fields_entry *entry, const char *text);

/* Words of a user's as a text of the record: what it cannot hold is replaced, what is too long is cut. */
void fields_take_words(char text[FIELDS_TEXT_MAX], const char *words);

double fields_real(const struct record *record, const struct fields_entry *entry);
int64_t fields_whole(const struct record *record, const struct fields_entry *entry);

/* Sets it; with drop_id the record becomes a drop, with crc32 one whose capture end came, with what it
 * measured one that measured; a parameter is held. DT_E_RANGE if value is not finite, not whole or does not
 * fit. */
DT_MUST_USE int fields_set(struct record *record, const struct fields_entry *entry, double value);

#endif
