/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_DIGEST_H
#define DT_HOST_RECORD_DIGEST_H
/*
 * SHA-256 (FIPS 180-4) in hexadecimal digits.
 */
#include <nettle/sha2.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

enum { DIGEST_CHARS = 65 };

/* Of what context was fed; context is begun anew. */
void digest_end(struct sha256_ctx *context, char text[DIGEST_CHARS]);

void digest_of(const void *bytes, size_t size, char text[DIGEST_CHARS]);

/* Of a file, and its size. copy: a descriptor that gets the same bytes, or -1. 0, or DT_E_SYSTEM with errno
 * set. */
DT_MUST_USE int digest_file(const char *path, char text[DIGEST_CHARS], int64_t *bytes, int copy);

#endif
