/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_VERIFY_H
#define DT_HOST_COMMAND_VERIFY_H
/*
 * What `droptower verify` does with the report of a series.
 */
#include <stdbool.h>

/* Whether a file begins as HTML or PDF do. */
bool verify_is_report(const char *file);

/* Its own SHA-256, then what it prints against the archive: the one it stands in or beside, or folder when
 * that is not NULL. Prints what is wrong; returns a COMMAND_* exit code. */
int verify_report(const char *file, const char *folder);

#endif
