/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/unpack.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "common/base/process.h"

static const struct {
	size_t at;
	const char *magic;
	size_t length;
	const char *program;
} packers[] = {
        {0, "\x1f\x8b", 2, "gzip"},         {0, "\x28\xb5\x2f\xfd", 4, "zstd"},
        {0, "\x5d\x2a\x4d\x18", 4, "zstd"}, /* blocks.h */
        {0, "\xfd\x37zXZ\0", 6, "xz"},      {0, "\x04\x22\x4d\x18", 4, "lz4"},
        {4, "1AY&SY", 6, "bzip2"}, /* behind BZh and a digit: a text may begin so */
};

const char *unpack_program(const char *head, size_t length)
{
	for (size_t i = 0; i < sizeof(packers) / sizeof(packers[0]); i++)
		if (length > packers[i].at + packers[i].length &&
		    memcmp(head + packers[i].at, packers[i].magic, packers[i].length) == 0)
			return packers[i].program;
	return NULL;
}

static int refuse_status(const struct source *packed, int status, int err, char *message)
{
	char text[200] = "";
	ssize_t length = pread(err, text, sizeof(text) - 1, 0);

	text[length > 0 ? length : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	return source_refuse(
	        message, DT_E_FORMAT, packed->file, 0,
	        "compressed file damaged or cut, or no room for it, nothing of it is used: %s (exit %d)",
	        text, status);
}

/* Both ends on the disk, if the packed file is mapped: neither fits into memory for certain. In memory where
 * that has no room. */
static int open_streams(struct process_streams *streams, const struct source *packed)
{
	char path[SOURCE_PATH_MAX];
	int error, scratch;

	if (packed->mapped != NULL &&
	    process_streams_open_file(streams, source_path(path, packed->descriptor)) == 0)
		return 0;
	error = process_streams_open(streams, packed->bytes, packed->size);
	scratch = error == 0 ? process_scratch() : -1;
	if (scratch >= 0) {
		close(streams->fd[1]);
		streams->fd[1] = scratch;
	}
	return error;
}

int unpack(struct source *source, char message[READ_MESSAGE_MAX])
{
	const char *program = unpack_program(source->bytes, source->size);
	const char *const words[] = {program, "-dc", NULL};
	struct process_streams streams;
	int error, status;

	if (program == NULL)
		return 0;
	error = open_streams(&streams, source);
	if (error != 0)
		return source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s", strerror(error));
	status = process_filter(words, &streams);
	if (status == -ENOENT)
		error = source_refuse(message, DT_E_UNKNOWN, source->file, 0,
		                      "compressed by %s, which is not installed here", program);
	else if (status < 0)
		error = source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s: %s", program,
		                      strerror(-status));
	else if (status > 0)
		error = refuse_status(source, status, streams.fd[2], message);
	else
		error = source_remake(source, streams.fd[1], message);
	process_streams_close(&streams);
	return error;
}
