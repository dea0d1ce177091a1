/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_ATOMIC_FILE_H
#define DT_HOST_BASE_ATOMIC_FILE_H
/*
 * A result file that is whole or not there: written beside its place, brought to the disk and renamed over
 * it, which is on the disk when atomic_file_close returns 0. What is no regular file (a device, a pipe) is
 * never replaced but written to; a link stays, its target is written.
 *
 * atomic_file_open, write to ->out, atomic_file_close in any case.
 */
#include <stdio.h>

#include "common/error.h"

struct atomic_file {
	FILE *out;
	const char *file; /* as given; must outlive the call of atomic_file_close */
	char *place;      /* where it comes to stand */
	char *beside;     /* where it is written; NULL: in place */
};

/* 0, or DT_E_SYSTEM or DT_E_MEMORY with "FILE: why" in message and nothing to close. */
DT_MUST_USE int atomic_file_open(struct atomic_file *atomic, const char *file, char *message, size_t size);

/* Puts the file in its place, or, when what wrote it returned an error, removes what is there of it. Returns
 * result, or DT_E_SYSTEM if only now writing fails; errors with "FILE: why" in message. */
DT_MUST_USE int atomic_file_close(struct atomic_file *atomic, int result, char *message, size_t size);

/* All of a file at once; as atomic_file_close. */
DT_MUST_USE int atomic_file_write(const char *file, const void *bytes, size_t length, char *message,
                                  size_t size);

#endif
