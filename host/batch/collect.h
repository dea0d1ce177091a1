/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_COLLECT_H
#define DT_HOST_BATCH_COLLECT_H
/*
 * The union of all parts, in the order of content and path: the same bytes for the same recordings and
 * settings, however the work was divided, interrupted and ordered.
 *
 *     results.jsonl   a line for each result, as `analyze --json` has it, with "sha256" behind "file"
 *     drops.csv       a row for each result: what belongs to a record or drop as a whole
 *     channels.csv    a row for each channel of each result
 *     results.sqlite  tables `drops`, `channels` and `messages` with the columns of the CSV files
 *     messages.csv    why a file has no result, and what else was said of one
 *
 * Columns are those of quantity.def, named by their place in JSON: "peak.value_g", "plate.frequency_hz".
 */
#include "host/batch/input.h"

enum collect_form { COLLECT_JSONL = 1, COLLECT_CSV = 2, COLLECT_SQLITE = 4, COLLECT_ALL = 7 };

struct collected {
	unsigned long results, refused, copies; /* copies: files that have the content of another */
};

/* inputs are put into another order. 0, or DT_E_* told in message; a file that could not be written is not
 * there, or is what it was. */
DT_MUST_USE int collect(const struct store *store, struct inputs *inputs, unsigned forms,
                        struct collected *collected, char message[STORE_MESSAGE_MAX]);

#endif
