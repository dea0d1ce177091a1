/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PRINT_H
#define DT_HOST_ARCHIVE_PRINT_H
/*
 * An archive for people (text), programs (JSON) and spreadsheets (CSV), no HTML. Each prints to out; 0,
 * DT_E_SYSTEM when out did not take it, or what looking into the archive returned. Below a limit of the
 * filter, text and JSON say whether there are more; means are of what is printed.
 */
#include <stdio.h>

#include "host/archive/table.h"
#include "host/base/table.h"

/* One line a series. */
DT_MUST_USE int print_series(struct archive *archive, const struct archive_filter *filter,
                             enum table_format format, FILE *out);

/* One line a drop, with filter->series also the series, its mean, standard deviation and count, and the head
 * of the chain; then the files of its drops are verified first. Of others what was found last is told. */
DT_MUST_USE int print_drops(struct archive *archive, const struct archive_filter *filter, bool undecided,
                            enum table_format format, FILE *out);

/* Means, standard deviations and ratios by scene and angle. reference: the scene that Table 4 of the study
 * divides by; NULL: the one without a plate. */
DT_MUST_USE int print_tables(struct archive *archive, const struct archive_filter *filter, bool undecided,
                             const char *reference, enum table_format format, FILE *out);

#endif
