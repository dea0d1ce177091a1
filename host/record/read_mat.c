/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * MAT files of versions 4, 5 and 7.3 through droptower-mat (host/mat), which tells what they hold, and writes
 * version 5.
 */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/helper.h"
#include "host/record/mat.h"
#include "host/record/tree.h"

enum { HEAD_4 = 20, NAME_MOST = 64 };

static bool is_name(const char *name, size_t length)
{
	if (length < 2 || name[length - 1] != '\0' || !isalpha((unsigned char)name[0]))
		return false;
	for (size_t i = 0; i + 1 < length; i++)
		if (!isalnum((unsigned char)name[i]) && name[i] != '_')
			return false;
	return true;
}

/* Bytes of the matrix at the beginning; 0 where there is none. */
static uint64_t mat4_bytes(const char *bytes, size_t size)
{
	static const unsigned char widths[] = {8, 4, 4, 2, 2, 1};
	uint64_t head[5], digits;
	bool big;

	if (size < HEAD_4)
		return 0;
	big = bytes_whole(bytes, 4, false) > 9999;
	for (size_t i = 0; i < 5; i++)
		head[i] = bytes_whole(bytes + 4 * i, 4, big);
	digits = head[0];
	if (digits / 1000 != (big ? 1 : 0) || digits / 100 % 10 != 0 || digits / 10 % 10 >= sizeof(widths) ||
	    digits % 10 > 2 || head[1] > INT32_MAX || head[2] > INT32_MAX || head[3] > 1 ||
	    head[4] > NAME_MOST)
		return 0;
	if (size - HEAD_4 < head[4] || !is_name(bytes + HEAD_4, (size_t)head[4]))
		return 0;
	return HEAD_4 + head[4] + head[1] * head[2] * widths[digits / 10 % 10] * (1 + head[3]);
}

long mat4_count(const char *bytes, size_t size)
{
	long count = 0;

	for (size_t at = 0; at < size; count++) {
		uint64_t matrix = mat4_bytes(bytes + at, size - at);

		if (matrix == 0 || matrix > size - at)
			return matrix == 0 && count == 0 ? 0 : -1;
		at += (size_t)matrix;
	}
	return count;
}

bool mat_is(const struct source *source)
{
	static const char *const heads[] = {"MATLAB 5.0 ", "MATLAB 7.3 "};
	enum { ORDER = 126, HEAD = 128 }; /* behind the text of the head: the order of bytes */

	for (size_t i = 0; i < 2; i++)
		if (source->size >= HEAD && memcmp(source->bytes, heads[i], strlen(heads[i])) == 0 &&
		    (memcmp(source->bytes + ORDER, "MI", 2) == 0 ||
		     memcmp(source->bytes + ORDER, "IM", 2) == 0))
			return true;
	return mat4_count(source->bytes, source->size) != 0;
}

static const struct helper helper = {"droptower-mat", "MAT files", "libmatio-dev and pkg-config"};

int read_mat(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct process_streams streams;
	int error = helper_read(&helper, source, &streams, message);

	if (error)
		return error;
	error = read_tree_of(table, "mat", streams.fd[1], source, message);
	process_streams_close(&streams);
	return error;
}

int write_mat(const struct record *record, FILE *out, const char *file, char message[READ_MESSAGE_MAX])
{
	return helper_write(&helper, record, out, file, message);
}
