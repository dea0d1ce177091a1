/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/blocks.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zstd.h>

enum { FILLER_BYTES = 64, SCAN_BYTES = BLOCKS_BYTES + 4096 };

/* A stretch of the file and what it is of the log. */
struct block {
	uint64_t place, at; /* in the file; in the log */
	uint32_t packed, size;
	bool damaged;
};

struct blocks {
	int descriptor;
	struct block *block;
	size_t count, room;
	uint64_t file_size, size;
	size_t index; /* block that is the index; count: none */
	size_t held;  /* block whose bytes are in bytes; count: none */
	char *bytes, *packed;
	size_t bytes_room, packed_room;
};

static uint32_t little(const char *bytes)
{
	const unsigned char *p = (const unsigned char *)bytes;

	return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

bool blocks_is(const char *head, size_t length)
{
	return length >= BLOCKS_SKIP_BYTES + strlen(BLOCKS_WORD) && little(head) == BLOCKS_MARK &&
	       memcmp(head + BLOCKS_SKIP_BYTES, BLOCKS_WORD, strlen(BLOCKS_WORD)) == 0;
}

/* All of it, or false with errno. */
static bool blocks_get(const struct blocks *blocks, uint64_t place, char *into, size_t want)
{
	while (want > 0) {
		ssize_t count = pread(blocks->descriptor, into, want, (off_t)place);

		if (count < 0 && errno == EINTR)
			continue;
		if (count == 0)
			errno = ENODATA;
		if (count <= 0)
			return false;
		place += (size_t)count;
		into += count;
		want -= (size_t)count;
	}
	return true;
}

static bool blocks_add(struct blocks *blocks, uint64_t place, size_t packed, size_t size, bool damaged)
{
	if (blocks->count == blocks->room) {
		size_t room = 2 * blocks->room + 64;
		struct block *block = realloc(blocks->block, room * sizeof(*block));

		if (block == NULL)
			return false;
		blocks->block = block;
		blocks->room = room;
	}
	blocks->block[blocks->count++] = (struct block){.place = place,
	                                                .at = blocks->size,
	                                                .packed = (uint32_t)packed,
	                                                .size = (uint32_t)size,
	                                                .damaged = damaged};
	blocks->size += size;
	return true;
}

static bool make_room(char **bytes, size_t *room, size_t want)
{
	char *more;

	if (*room >= want)
		return true;
	more = realloc(*bytes, want);
	if (more == NULL)
		return false;
	*bytes = more;
	*room = want;
	return true;
}

/* ---- which blocks there are ---- */

/* By the table at the end: false where it is none or its blocks do not fill the file up to it; *failed with
 * errno where that could not be found out. */
static bool read_table(struct blocks *blocks, bool *failed)
{
	char footer[BLOCKS_FOOTER_BYTES], entry[BLOCKS_ENTRY_BYTES];
	uint64_t place = 0, table, bytes;
	char *entries;
	size_t count;

	*failed = !blocks_get(blocks, blocks->file_size - BLOCKS_FOOTER_BYTES, footer, sizeof(footer));
	if (*failed || little(footer + 5) != BLOCKS_END || footer[4] != 0)
		return false;
	count = little(footer);
	bytes = (uint64_t)count * BLOCKS_ENTRY_BYTES;
	if (count == 0 || bytes + BLOCKS_FOOTER_BYTES + BLOCKS_SKIP_BYTES > blocks->file_size)
		return false;
	table = blocks->file_size - BLOCKS_FOOTER_BYTES - bytes;
	entries = malloc((size_t)bytes);
	*failed = entries == NULL || !blocks_get(blocks, table, entries, (size_t)bytes);
	for (size_t i = 0; i < count && !*failed && place <= table; i++) {
		memcpy(entry, entries + i * BLOCKS_ENTRY_BYTES, sizeof(entry));
		if (little(entry + 4) > BLOCKS_MOST)
			break;
		*failed = !blocks_add(blocks, place, little(entry), little(entry + 4), false);
		place += little(entry);
	}
	free(entries);
	return !*failed && blocks->count == count && place == table - BLOCKS_SKIP_BYTES;
}

/* The bytes of the frame at the beginning of these, with so many left in the file, and what it holds of the
 * log; 0: none. */
static size_t frame_at(const char *bytes, size_t held, uint64_t left, size_t *size)
{
	unsigned long long content;
	size_t packed;

	*size = 0;
	if (held >= BLOCKS_SKIP_BYTES && (little(bytes) & 0xFFFFFFF0u) == (BLOCKS_MARK & 0xFFFFFFF0u)) {
		packed = BLOCKS_SKIP_BYTES + (size_t)little(bytes + 4);
		return packed <= left ? packed : 0;
	}
	content = ZSTD_getFrameContentSize(bytes, held);
	if (held < 4 || little(bytes) != ZSTD_MAGICNUMBER || content == 0 || content > BLOCKS_BYTES)
		return 0;
	packed = ZSTD_findFrameCompressedSize(bytes, held);
	*size = (size_t)content;
	return ZSTD_isError(packed) ? 0 : packed;
}

/* Where the next frame may begin, behind the first byte of these. */
static size_t next_magic(const char *bytes, size_t held)
{
	static const char magic[] = {'\x28', '\xb5', '\x2f', '\xfd'};
	const char *found = held > 1 ? memmem(bytes + 1, held - 1, magic, sizeof(magic)) : NULL;

	return found != NULL          ? (size_t)(found - bytes)
	       : held > sizeof(magic) ? held - sizeof(magic) + 1
	                              : held;
}

/* From frame to frame: what is none between two is a damaged block, and so is the end without its table. */
static bool scan(struct blocks *blocks)
{
	uint64_t place = 0, bad = UINT64_MAX;

	blocks->count = 0;
	blocks->size = 0;
	if (!make_room(&blocks->bytes, &blocks->bytes_room, SCAN_BYTES))
		return false;
	while (place < blocks->file_size) {
		size_t held = SCAN_BYTES, size, packed;

		if (held > blocks->file_size - place)
			held = (size_t)(blocks->file_size - place);
		if (!blocks_get(blocks, place, blocks->bytes, held))
			return false;
		packed = frame_at(blocks->bytes, held, blocks->file_size - place, &size);
		if (packed == 0 && bad == UINT64_MAX)
			bad = place;
		if (packed == 0) {
			place += next_magic(blocks->bytes, held);
			continue;
		}
		if (bad != UINT64_MAX && !blocks_add(blocks, bad, 0, FILLER_BYTES, true))
			return false;
		bad = UINT64_MAX;
		if (!blocks_add(blocks, place, packed, size, false))
			return false;
		place += packed;
	}
	return blocks_add(blocks, bad != UINT64_MAX ? bad : place, 0, FILLER_BYTES, true);
}

static size_t find_index(const struct blocks *blocks)
{
	char head[BLOCKS_SKIP_BYTES];

	for (size_t i = blocks->count; i > 0; i--) {
		const struct block *block = &blocks->block[i - 1];

		if (block->size == 0 && block->packed > sizeof(head) &&
		    blocks_get(blocks, block->place, head, sizeof(head)) && little(head) == BLOCKS_INDEX)
			return i - 1;
	}
	return blocks->count;
}

struct blocks *blocks_open(int descriptor, uint64_t file_size)
{
	struct blocks *blocks = calloc(1, sizeof(*blocks));
	bool failed;

	if (blocks == NULL)
		return NULL;
	blocks->descriptor = descriptor;
	blocks->file_size = file_size;
	if (!read_table(blocks, &failed) && (failed || !scan(blocks))) {
		blocks_close(blocks);
		return NULL;
	}
	blocks->index = find_index(blocks);
	blocks->held = blocks->count;
	return blocks;
}

void blocks_close(struct blocks *blocks)
{
	if (blocks == NULL)
		return;
	free(blocks->block);
	free(blocks->bytes);
	free(blocks->packed);
	free(blocks);
}

/* ---- what stands in them ---- */

uint64_t blocks_size(const struct blocks *blocks)
{
	return blocks->size;
}

/* Lines that are no frame, in its place, of which the first begins as one, so that it is known as a log
 * still. */
static void fill(struct blocks *blocks, const struct block *block, size_t number)
{
	char line[FILLER_BYTES];
	int length = snprintf(line, sizeof(line), "\n(0 block %zu at %llu damaged\n", number,
	                      (unsigned long long)block->place);

	memset(blocks->bytes, '\n', block->size);
	memcpy(blocks->bytes, line, (size_t)length < block->size ? (size_t)length : block->size);
}

/* Makes its bytes the ones that are held. */
static bool hold(struct blocks *blocks, size_t number)
{
	struct block *block = &blocks->block[number];
	size_t size = 0;

	if (blocks->held == number)
		return true;
	blocks->held = blocks->count;
	if (!make_room(&blocks->bytes, &blocks->bytes_room, block->size) ||
	    !make_room(&blocks->packed, &blocks->packed_room, block->packed + 1u))
		return false;
	if (!block->damaged) {
		if (!blocks_get(blocks, block->place, blocks->packed, block->packed))
			return false;
		size = ZSTD_decompress(blocks->bytes, block->size, blocks->packed, block->packed);
		block->damaged = ZSTD_isError(size) || size != block->size;
	}
	if (block->damaged)
		fill(blocks, block, number);
	blocks->held = number;
	return true;
}

/* The block that this byte of the log is in. */
static size_t block_at(const struct blocks *blocks, uint64_t at)
{
	size_t low = 0, high = blocks->count;

	while (high - low > 1) {
		size_t middle = low + (high - low) / 2;

		if (blocks->block[middle].at <= at)
			low = middle;
		else
			high = middle;
	}
	return low;
}

ssize_t blocks_read(struct blocks *blocks, uint64_t at, char *into, size_t want)
{
	size_t number;
	uint64_t skip;

	if (at >= blocks->size || want == 0)
		return 0;
	number = block_at(blocks, at);
	if (!hold(blocks, number))
		return -1;
	skip = at - blocks->block[number].at;
	if (want > blocks->block[number].size - skip)
		want = (size_t)(blocks->block[number].size - skip);
	memcpy(into, blocks->bytes + skip, want);
	return (ssize_t)want;
}

unsigned blocks_damage(const struct blocks *blocks, uint64_t from, uint64_t to,
                       char message[BLOCKS_MESSAGE_MAX])
{
	unsigned count = 0;
	size_t used = 0;

	for (size_t i = 0; i < blocks->count; i++) {
		const struct block *block = &blocks->block[i];

		if (!block->damaged || block->at >= to || block->at + block->size <= from)
			continue;
		if (count++ == 0)
			used = (size_t)snprintf(message, BLOCKS_MESSAGE_MAX,
			                        "block %zu at byte %llu is damaged", i,
			                        (unsigned long long)block->place);
	}
	if (count > 1)
		snprintf(message + used, BLOCKS_MESSAGE_MAX - used, ", and %u more", count - 1);
	return count;
}

char *blocks_index(struct blocks *blocks, size_t *size)
{
	const struct block *block = &blocks->block[blocks->index];
	char *text;

	if (blocks->index == blocks->count)
		return NULL;
	*size = block->packed - BLOCKS_SKIP_BYTES;
	text = malloc(*size);
	if (text != NULL && !blocks_get(blocks, block->place + BLOCKS_SKIP_BYTES, text, *size)) {
		free(text);
		text = NULL;
	}
	return text;
}
