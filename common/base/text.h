/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_TEXT_H
#define DT_COMMON_BASE_TEXT_H
/*
 * Text made in memory, and the one way to close what was written: nothing that lacks a byte passes for whole.
 * open_memstream(3) cannot say that it ran out of memory on the way; this can.
 */
#include <stdio.h>

#include "common/error.h"

/* Stands where it is until it is closed: its stream points to it. */
struct text {
	FILE *out;
	char *bytes; /* with a NUL behind; malloc'ed */
	size_t size; /* without it */
	size_t room;
};

/* 0, or DT_E_MEMORY with out and bytes NULL. */
DT_MUST_USE int text_open(struct text *text);

/* Closes out. Returns result, or DT_E_MEMORY when something was lost on the way; on an error bytes are freed
 * and NULL, else they are the caller's. */
DT_MUST_USE int text_close(struct text *text, int result);

/* Closes a file that was written: 0, or DT_E_SYSTEM with errno of what failed first, as far as it is known.
 */
DT_MUST_USE int stream_close(FILE *out);

#endif
