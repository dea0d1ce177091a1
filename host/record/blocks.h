/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_BLOCKS_H
#define DT_HOST_RECORD_BLOCKS_H
/*
 * A log in blocks: zstd frames of up to BLOCKS_BYTES of it, each with the checksum of what it holds, so that
 * any part is read without the rest and a damaged block costs what stood in it. It begins with a mark, in a
 * skippable frame, and ends with what log_index.h says of the log, in another, and with the table of zstd's
 * seekable format (version 0.1.0 of facebook/zstd/contrib/seekable_format), in a third: `zstd -d` makes the
 * plain log of it.
 *
 * Blocks end with a line of candump text, or before an event of LCM. In place of a damaged block stand as
 * many bytes, a line that is none and empty lines, so that all else keeps its place; it counts as one corrupt
 * frame. Without its table (the end cut off, a recorder that was killed) a file is gone through block by
 * block.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "common/error.h"

enum {
	BLOCKS_BYTES = 1 << 18,  /* of the log in a block, as written */
	BLOCKS_MOST = 1 << 24,   /* as read */
	BLOCKS_HEAD_BYTES = 64,  /* to know one by */
	BLOCKS_MESSAGE_MAX = 160 /* of blocks_damage */
};

struct blocks;

/* Whether a file that begins so is one; with BLOCKS_HEAD_BYTES, or all of it where it is shorter. */
bool blocks_is(const char *head, size_t length);

/* NULL with errno. The descriptor stays the caller's. */
struct blocks *blocks_open(int descriptor, uint64_t file_size);
void blocks_close(struct blocks *blocks); /* NULL is allowed */

/* Bytes of the log. */
uint64_t blocks_size(const struct blocks *blocks);

/* Up to want bytes from at on: how many, 0 at the end, or -1 with errno. */
ssize_t blocks_read(struct blocks *blocks, uint64_t at, char *into, size_t want);

/* How many damaged blocks have been met so far within [from, to) of the log; message says which is the first:
 * "block 17 at byte 123456 is damaged, and 2 more". */
unsigned blocks_damage(const struct blocks *blocks, uint64_t from, uint64_t to,
                       char message[BLOCKS_MESSAGE_MAX]);

/* The text of the index that is in it, to be freed, or NULL. */
char *blocks_index(struct blocks *blocks, size_t *size);

/* ---- writing ---- */

struct blocks_writer;

/* DT_E_MEMORY, DT_E_SYSTEM. blocks_end in any case after success of blocks_begin; index may be NULL. */
DT_MUST_USE int blocks_begin(struct blocks_writer **writer, FILE *out);
DT_MUST_USE int blocks_put(struct blocks_writer *writer, const char *bytes, size_t size);
DT_MUST_USE int blocks_end(struct blocks_writer *writer, int result, const char *index, size_t index_size);

/* ---- what both sides know of the file ---- */

enum {
	BLOCKS_MARK = 0x184D2A5D, /* skippable frames */
	BLOCKS_INDEX = 0x184D2A5C,
	BLOCKS_TABLE = 0x184D2A5E, /* of the seekable format, as is */
	BLOCKS_SKIP_BYTES = 8,     /* magic and size of a skippable frame */
	BLOCKS_ENTRY_BYTES = 8,    /* of the table: sizes packed and not, little endian */
	BLOCKS_FOOTER_BYTES = 9,   /* entries, flags, BLOCKS_END */
};
#define BLOCKS_END UINT32_C(0x8F92EAB1)
#define BLOCKS_WORD "droptower blocks"

#endif
