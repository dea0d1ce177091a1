/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_QUANTITIES_H
#define DT_HOST_ARCHIVE_QUANTITIES_H
/*
 * What an analysis says, as rows of the index. row: of results. Every function that fails has written
 * archive->message.
 */
#include "host/archive/private.h"
#include "host/result/quantity.h"

/* Makes the tables and columns of quantity.def that the index does not have. */
DT_MUST_USE int quantities_shape(struct archive *archive);

/* Puts an analysis in. */
DT_MUST_USE int quantities_insert(struct archive *archive, int64_t row, struct result *said);

/* The same from the text of a result that was recorded: for a rebuild, and for an index from before there
 * were rows. row 0: of all results. */
DT_MUST_USE int quantities_fill(struct archive *archive, int64_t row);

/* The rows of a place for a result that is to be bound: subject, then the values in the order of
 * quantities_next. To be finalized. */
DT_MUST_USE int quantities_select(struct archive *archive, const struct quantity_home *home,
                                  sqlite3_stmt **s);

/* As quantity_next, of those that are columns. */
const struct quantity *quantities_next(enum quantity_object object, const struct quantity *last);

/* Budgets of the values that are columns of drops. s: NULL at first, kept between calls, to be finalized. */
DT_MUST_USE int quantities_budget(struct archive *archive, sqlite3_stmt **s, int64_t row,
                                  struct budget_item item[QUANTITY_COLUMNS]);

/* A row of the sensors; its texts are the statement's. */
void quantities_sensor(sqlite3_stmt *s, struct sensor_used *used);

/* Back, with paths and methods left empty. A record that has channels, from its log, keeps what it has but
 * its flags. On success and on error the analysis' channels are to be freed. */
DT_MUST_USE int quantities_read(struct archive *archive, int64_t row, struct result *said);

#endif
