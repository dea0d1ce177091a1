/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_MAT_H
#define DT_HOST_RECORD_MAT_H
/*
 * MAT files of version 4, which have no mark of their own: a head of five whole numbers and a name before
 * each matrix (MATLAB, "MAT-File Format", Level 4).
 */
#include <stddef.h>

/* The matrices that make up all of the bytes; 0 where they do not begin as such a file, -1 where it is cut.
 */
long mat4_count(const char *bytes, size_t size);

#endif
