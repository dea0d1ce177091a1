/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_INDEXED_H
#define DT_HOST_ARCHIVE_INDEXED_H
/*
 * The index against the files that its values are from. Of a drop and a series: what the index would write as
 * their sidecar is, byte for byte, what the chain has of them. Of a result: its rows and columns are what its
 * JSON says. What differs is told by drop and column.
 */
#include "host/archive/proof.h"

/* The row of proof->drop. told: what the sidecar says, NULL when it cannot be read; entry: of it in the
 * chain, NULL of one from before there was a chain. */
DT_MUST_USE int indexed_hold_drop(struct proof *proof, const struct chain_entry *entry,
                                  const struct sidecar *told);

/* A result of proof->drop. row: of results; json: its text in the index. */
DT_MUST_USE int indexed_hold_result(struct proof *proof, int64_t row, const char *json);

/* The row that a sidecar of a series is of. */
DT_MUST_USE int indexed_hold_other(struct proof *proof, const struct sidecar *told);

/* Series of the index that no sidecar is of. */
DT_MUST_USE int indexed_hold_more(struct proof *proof);

void indexed_close(struct proof *proof);

#endif
