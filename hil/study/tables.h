/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_TABLES_H
#define DT_HIL_STUDY_TABLES_H
/*
 * Tables 1 to 4 and what else the study put in figures, beside what came out here.
 */
#include "hil/study/sheet.h"
#include "hil/study/study.h"

/* percent */
#define STUDY_LIMIT_R 8.0
#define STUDY_LIMIT_XY 15.0

void study_tables(const struct study *study, struct sheet *sheet);

/* Index of the angle at which features are told and histories drawn. */
size_t study_reference(const struct study *study, size_t geometry);

#endif
