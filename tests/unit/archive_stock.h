/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ARCHIVE_STOCK_H
#define DT_TESTS_ARCHIVE_STOCK_H
/*
 * An archive with many drops, put into its index by SQL: series of five, named bulk-1, bulk-2, ..., at 15,
 * 20, 25, 30, 35 degrees in turn. Drop n of a series has S1 X = 290 + 10 n g, S2 X = 2 S1 X, all else 1; the
 * fifth is rejected, the others are accepted. Its raw files are not there.
 */
#include "host/archive/archive.h"

/* The folder must have an archive with a series "first", which bulk copies. json_bytes: of each result.
 * Whether it could be done. */
bool archive_stock_fill(const char *folder, unsigned drops, unsigned json_bytes);

#endif
