/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/unpack.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
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

static int refuse_status(const struct source *packed, const char *program, int status, int err, char *message)
{
	char text[200] = "";
	ssize_t length = pread(err, text, sizeof(text) - 1, 0);

	text[length > 0 ? length : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	if (status == 127)
		return source_refuse(message, DT_E_UNKNOWN, packed->file, 0,
		                     "compressed by %s, which is not installed here", program);
	return source_refuse(message, DT_E_FORMAT, packed->file, 0,
	                     "compressed file damaged or cut, nothing of it is used: %s (exit %d)", text,
	                     status);
}

/* Reads what the program gives while it works. */
static int unpack_run(struct source *unpacked, const struct source *packed, const char *program,
                      const struct process_streams *streams, char *message)
{
	const char *const words[] = {program, "-dc", NULL};
	struct process process = {.words = words, .fd = {streams->fd[0], 0, streams->fd[2]}};
	char path[32];
	pid_t pid;
	int ends[2], error, status;

	if (pipe2(ends, O_CLOEXEC) != 0)
		return source_refuse(message, DT_E_SYSTEM, packed->file, 0, "%s", strerror(errno));
	process.fd[1] = ends[1];
	error = process_start(&process, &pid);
	close(ends[1]);
	if (error != 0) {
		close(ends[0]);
		return error == ENOENT ? refuse_status(packed, program, 127, streams->fd[2], message)
		                       : source_refuse(message, DT_E_SYSTEM, packed->file, 0, "%s: %s",
		                                       program, strerror(error));
	}
	snprintf(path, sizeof(path), "/proc/self/fd/%d", ends[0]);
	error = source_load(unpacked, path, packed->expected, message);
	close(ends[0]);
	status = process_wait(pid);
	if (status == 0 && error == 0)
		return 0;
	if (error == 0)
		source_free(unpacked);
	if (status != 0 && error != DT_E_RANGE && error != DT_E_MEMORY)
		return refuse_status(packed, program, status, streams->fd[2], message);
	return source_refuse(message, error, packed->file, 0, "%s",
	                     error == DT_E_RANGE ? "unpacks to more than 2 GiB, or to nothing"
	                                         : error_text(error));
}

int unpack(struct source *source, char message[READ_MESSAGE_MAX])
{
	const char *program = unpack_program(source->bytes, source->size);
	struct process_streams streams;
	struct source unpacked = {0};
	int error;

	if (program == NULL)
		return 0;
	error = process_streams_open(&streams, source->bytes, source->size);
	if (error != 0)
		return source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s", strerror(error));
	error = unpack_run(&unpacked, source, program, &streams, message);
	process_streams_close(&streams);
	if (error != 0)
		return error;
	unpacked.file = source->file;
	source_free(source);
	*source = unpacked;
	return 0;
}
