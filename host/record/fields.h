/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_FIELDS_H
#define DT_HOST_RECORD_FIELDS_H
/*
 * What a record knows of a drop beside its samples, as a list of named numbers, for the formats that keep
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
};

struct fields_entry {
	const char *name;
	enum fields_kind kind;
	size_t offset; /* in struct record */
};

/* The i-th from 0; NULL behind the last. */
const struct fields_entry *fields_entry(size_t i);

/* NULL if there is none of that name. */
const struct fields_entry *fields_find(const char *name);

/* Whether this record has it: the record is a drop, and the number is known. */
bool fields_known(const struct record *record, const struct fields_entry *entry);

double fields_real(const struct record *record, const struct fields_entry *entry);
int64_t fields_whole(const struct record *record, const struct fields_entry *entry);

/* Sets it; with drop_id the record becomes a drop, with crc32 one whose capture end came, with what it
 * measured one that measured; a parameter is held. DT_E_RANGE if value is not finite, not whole or does not
 * fit. */
DT_MUST_USE int fields_set(struct record *record, const struct fields_entry *entry, double value);

#endif
