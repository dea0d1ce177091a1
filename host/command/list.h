/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_LIST_H
#define DT_HOST_COMMAND_LIST_H
/*
 * What a log holds, without analysing it: a row for each drop, and what else happened to the tower.
 */
#include <stdbool.h>

/* As a table, or as one JSON object a line. A COMMAND_* code; errors were printed. */
int list_drops(const char *file, bool json);

#endif
