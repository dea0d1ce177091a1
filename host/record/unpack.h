/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_UNPACK_H
#define DT_HOST_RECORD_UNPACK_H
/*
 * Compressed files of every format: the program of the packer (gzip, zstd, xz, lz4, bzip2) unpacks into
 * memory and checks its own checksum. What it complains of, a cut file among that, is refused as a whole.
 */
#include "host/record/source.h"

/* The program that unpacks what begins with these bytes; NULL where none does. */
const char *unpack_program(const char *head, size_t length);

/* Puts what was packed in place of the bytes. Nothing is freed on an error. */
DT_MUST_USE int unpack(struct source *source, char message[READ_MESSAGE_MAX]);

#endif
