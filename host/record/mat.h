/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_MAT_H
#define DT_HOST_RECORD_MAT_H
/*
 * MAT files beside what tree.h says of them.
 */
#include <stddef.h>
#include <stdio.h>

#include "host/record/read.h"

/* Version 4 has no mark of its own: a head of five whole numbers and a name before each matrix (MATLAB,
 * "MAT-File Format", Level 4). The matrices that make up all of the bytes; 0 where they do not begin as such
 * a file, -1 where it is cut.
 */
long mat4_count(const char *bytes, size_t size);

/* Version 5, through the helper. As every writer, file being named in message only. */
DT_MUST_USE int write_mat(const struct record *record, FILE *out, const char *file,
                          char message[READ_MESSAGE_MAX]);

#endif
