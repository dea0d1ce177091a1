/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "common/base/text.h"
#include "host/record/blocks.h"

/* Of a candump line the heads repeat and the samples do not: matches shorter than seven bytes cost a third of
 * the reading speed and make the file larger. */
enum { LEVEL = 3, MATCH_LEAST = 7 };

struct blocks_writer {
	FILE *out;
	ZSTD_CCtx *context;
	struct text table;
	uint32_t entries;
	size_t held; /* of bytes */
	char bytes[BLOCKS_BYTES];
	char packed[BLOCKS_BYTES + (BLOCKS_BYTES >> 8) + 1024];
};

static int put_bytes(FILE *out, const void *bytes, size_t size)
{
	return fwrite(bytes, 1, size, out) == size ? 0 : DT_E_SYSTEM;
}

static int put_little(FILE *out, uint32_t value)
{
	const unsigned char bytes[] = {(unsigned char)value, (unsigned char)(value >> 8),
	                               (unsigned char)(value >> 16), (unsigned char)(value >> 24)};

	return put_bytes(out, bytes, sizeof(bytes));
}

static int add_entry(struct blocks_writer *writer, size_t packed, size_t size)
{
	writer->entries++;
	return put_little(writer->table.out, (uint32_t)packed) |
	       put_little(writer->table.out, (uint32_t)size);
}

static int put_skippable(struct blocks_writer *writer, uint32_t magic, const char *bytes, size_t size)
{
	int error = put_little(writer->out, magic);

	if (!error)
		error = put_little(writer->out, (uint32_t)size);
	return error ? error : put_bytes(writer->out, bytes, size);
}

int blocks_begin(struct blocks_writer **writer, FILE *out)
{
	struct blocks_writer *w = calloc(1, sizeof(*w));
	int error = DT_E_MEMORY;

	if (w != NULL)
		error = text_open(&w->table);
	if (error) {
		free(w);
		return error;
	}
	w->out = out;
	w->context = ZSTD_createCCtx();
	if (w->context == NULL ||
	    ZSTD_isError(ZSTD_CCtx_setParameter(w->context, ZSTD_c_compressionLevel, LEVEL)) ||
	    ZSTD_isError(ZSTD_CCtx_setParameter(w->context, ZSTD_c_strategy, ZSTD_dfast)) ||
	    ZSTD_isError(ZSTD_CCtx_setParameter(w->context, ZSTD_c_minMatch, MATCH_LEAST)) ||
	    ZSTD_isError(ZSTD_CCtx_setParameter(w->context, ZSTD_c_checksumFlag, 1)))
		error = DT_E_MEMORY;
	if (!error)
		error = put_skippable(w, BLOCKS_MARK, BLOCKS_WORD, strlen(BLOCKS_WORD));
	if (!error)
		error = add_entry(w, BLOCKS_SKIP_BYTES + strlen(BLOCKS_WORD), 0);
	if (error)
		return blocks_end(w, error, NULL, 0);
	*writer = w;
	return 0;
}

/* Up to the last event of LCM that begins in them, or the last line that ends there: what a reader can do
 * without the block behind. */
static size_t whole_part(const char *bytes, size_t size)
{
	static const char sync[] = {'\xED', '\xA1', '\xDA', '\x01'};
	const char *line = memrchr(bytes, '\n', size);

	for (size_t i = size - sizeof(sync); memcmp(bytes, sync, sizeof(sync)) == 0 && i > 0; i--)
		if (memcmp(bytes + i, sync, sizeof(sync)) == 0)
			return i;
	return line != NULL ? (size_t)(line - bytes) + 1 : size;
}

static int put_block(struct blocks_writer *writer, size_t size)
{
	size_t packed =
	        ZSTD_compress2(writer->context, writer->packed, sizeof(writer->packed), writer->bytes, size);
	int error;

	if (ZSTD_isError(packed))
		return DT_E_MEMORY;
	error = put_bytes(writer->out, writer->packed, packed);
	if (!error)
		error = add_entry(writer, packed, size);
	writer->held -= size;
	memmove(writer->bytes, writer->bytes + size, writer->held);
	return error;
}

int blocks_put(struct blocks_writer *writer, const char *bytes, size_t size)
{
	int error = 0;

	while (size > 0 && !error) {
		size_t part = BLOCKS_BYTES - writer->held;

		if (part > size)
			part = size;
		memcpy(writer->bytes + writer->held, bytes, part);
		writer->held += part;
		bytes += part;
		size -= part;
		if (writer->held == BLOCKS_BYTES)
			error = put_block(writer, whole_part(writer->bytes, BLOCKS_BYTES));
	}
	return error;
}

static int put_table(struct blocks_writer *writer)
{
	const size_t size = writer->table.size + BLOCKS_FOOTER_BYTES;
	int error = put_little(writer->out, BLOCKS_TABLE) | put_little(writer->out, (uint32_t)size) |
	            put_bytes(writer->out, writer->table.bytes, writer->table.size) |
	            put_little(writer->out, writer->entries) | put_bytes(writer->out, "", 1) |
	            put_little(writer->out, BLOCKS_END);

	return error ? DT_E_SYSTEM : 0;
}

int blocks_end(struct blocks_writer *writer, int result, const char *index, size_t index_size)
{
	if (!result && writer->held > 0)
		result = put_block(writer, writer->held);
	if (!result && index != NULL)
		result = put_skippable(writer, BLOCKS_INDEX, index, index_size);
	if (!result && index != NULL)
		result = add_entry(writer, BLOCKS_SKIP_BYTES + index_size, 0);
	result = text_close(&writer->table, result);
	if (!result)
		result = put_table(writer);
	free(writer->table.bytes);
	ZSTD_freeCCtx(writer->context);
	free(writer);
	return result;
}
