/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_FILE_H
#define DT_HOST_CHART_FILE_H
/*
 * The files of a chart. A file is whole or not there: text is made in memory, written beside, renamed.
 */
#include "host/chart/chart.h"
#include "common/base/text.h"

/* A text is freed with file_drop. */
DT_MUST_USE int file_begin(struct text *text, char *message);
void file_drop(struct text *text);

/* folder/kind-name.extension. The first takes the text as it is, the second has gnuplot draw it. */
DT_MUST_USE int file_write(struct text *text, const char *folder, const char *kind, const char *name,
                           const char *extension, char *message);
DT_MUST_USE int file_draw(struct text *script, const char *folder, const char *kind, const char *name,
                          char *message);

#endif
