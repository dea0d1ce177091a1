/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_BENCH_ARCHIVE_H
#define DT_TESTS_BENCH_ARCHIVE_H
/*
 * An archive of 10 000 drops in a temporary folder, to be looked into. Each look opens it anew.
 */
#include <stdbool.h>

enum { BENCH_ARCHIVE_DROPS = 10000, BENCH_ARCHIVE_JSON_BYTES = 13000 };

bool bench_archive_make(void);
void bench_archive_remove(void);

void bench_archive_list(void *context);   /* 2 000 series with their counts, as text */
void bench_archive_filter(void *context); /* the drops of one angle and three days */
void bench_archive_text(void *context);   /* those with words that one drop in five has */
void bench_archive_newest(void *context); /* the newest 100 series with a word, as the page asks */
void bench_archive_tables(void *context); /* means and SDs of everything */

#endif
