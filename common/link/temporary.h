/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_TEMPORARY_H
#define DT_COMMON_LINK_TEMPORARY_H
/*
 * A folder for as long as a program runs: $TMPDIR (when it is absolute and short), else /tmp, as
 * droptower-PURPOSE-XXXXXX, for this user alone. Its file `lock` is locked while the program lives, so that
 * what a killed one left is told from what is in use, and goes when the next of its purpose is made: only
 * this user's own folders of that name whose lock nobody holds.
 *
 * The caller owns the struct; one thread at a time per struct. A socket in it fits a path of 108 bytes.
 */
#include "common/error.h"

enum { TEMPORARY_PATH_MAX = 96 };

struct temporary {
	char path[TEMPORARY_PATH_MAX]; /* "" when there is none */
	int lock;
};

/* Sweeps, then makes one. purpose: at most 16 letters. 0, or DT_E_SYSTEM with errno set and path "". */
DT_MUST_USE int temporary_make(struct temporary *temporary, const char *purpose);

/* Removes it with all that is in it. Nothing when there is none. */
void temporary_remove(struct temporary *temporary);

#endif
