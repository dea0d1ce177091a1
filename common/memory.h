/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef DT_COMMON_MEMORY_H
#define DT_COMMON_MEMORY_H
/*
 * The three functions of <string.h> that freestanding code of ours uses: a Cortex-M port brings its own,
 * Linux has them in libc.
 */
#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memset(void *to, int byte, size_t count);
int memcmp(const void *a, const void *b, size_t count);

#endif
