/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/hdf5.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/process.h"
#include "host/record/seal.h"
#include "common/base/text.h"
#include "host/record/write.h"

static const char HELPER[] = "droptower-hdf5";

static int path_of_helper(char path[PATH_MAX])
{
	ssize_t length = readlink("/proc/self/exe", path, PATH_MAX - sizeof(HELPER));
	char *end;

	if (length <= 0)
		return -1;
	path[length] = '\0';
	end = strrchr(path, '/');
	memcpy(end ? end + 1 : path, HELPER, sizeof(HELPER));
	return access(path, X_OK);
}

/* The helper's one line of complaint. */
static int hdf5_complain(char *message, const char *file, int err, int status)
{
	char text[256] = "";
	ssize_t length = pread(err, text, sizeof(text) - 1, 0);

	text[length > 0 ? length : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	if (status < 128 && text[0])
		return source_refuse(message, DT_E_FORMAT, file, 0, "%s", text);
	return source_refuse(message, DT_E_FORMAT, file, 0, "%s died of it, expected HDF5 of ours", HELPER);
}

static int run_helper(const char *verb, const struct process_streams *streams, const char *file,
                      char *message)
{
	char path[PATH_MAX];
	const char *words[] = {path, verb, NULL};
	int status;

	if (path_of_helper(path) != 0)
		return source_refuse(
		        message, DT_E_UNKNOWN, file, 0,
		        "this build cannot do HDF5: install libhdf5-dev and pkg-config and run make "
		        "again");
	status = process_filter(words, streams);
	if (status < 0)
		return source_refuse(message, DT_E_SYSTEM, file, 0, "%s: %s", HELPER, strerror(-status));
	return status == 0 ? 0 : hdf5_complain(message, file, streams->fd[2], status);
}

/* The helper works on files in memory. */
static int open_streams(struct process_streams *streams, const void *bytes, size_t size, const char *file,
                        char *message)
{
	int error = process_streams_open(streams, bytes, size);

	return error == 0 ? 0 : source_refuse(message, DT_E_SYSTEM, file, 0, "%s", strerror(error));
}

static int copy_all(int fd, FILE *out)
{
	size_t size = 0;
	char *bytes = process_read(fd, &size);
	bool whole = bytes != NULL && fwrite(bytes, 1, size, out) == size && fflush(out) == 0;

	free(bytes);
	return whole ? 0 : DT_E_SYSTEM;
}

bool hdf5_is(const struct source *source)
{
	static const char signature[] = "\x89HDF\r\n\x1a\n";

	return source->size >= sizeof(signature) - 1 &&
	       memcmp(source->bytes, signature, sizeof(signature) - 1) == 0;
}

/* What the helper made of it, as a source of its own that goes by the name of the file. */
static int read_csv_of(struct record *record, int fd, const char *file, char *message)
{
	struct source csv;
	char path[32];
	int error, sealed;

	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	error = source_load(&csv, path, "a recording", message);
	if (error)
		return error;
	csv.file = file;
	sealed = seal_check(&csv, message);
	error = sealed < 0 ? sealed : read_csv(record, &csv, message);
	if (!error)
		record->file_sealed = sealed > 0;
	source_free(&csv);
	return error;
}

int read_hdf5(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct process_streams streams;
	int error = open_streams(&streams, source->bytes, source->size, source->file, message);

	if (error != 0)
		return error;
	error = run_helper("read", &streams, source->file, message);
	if (error == 0)
		error = read_csv_of(record, streams.fd[1], source->file, message);
	if (error == 0)
		strcpy(record->format, "hdf5");
	process_streams_close(&streams);
	return error;
}

int write_hdf5(const struct record *record, FILE *out, const char *file, char message[READ_MESSAGE_MAX])
{
	struct process_streams streams;
	struct text text;
	int error = text_open(&text);

	if (error == 0)
		error = text_close(&text, write_csv(record, text.out));
	if (error != 0)
		return source_refuse(message, error, file, 0, "%s", error_text(error));
	error = open_streams(&streams, text.bytes, text.size, file, message);
	free(text.bytes);
	if (error != 0)
		return error;
	error = run_helper("write", &streams, file, message);
	if (error == 0 && copy_all(streams.fd[1], out) != 0)
		error = source_refuse(message, DT_E_SYSTEM, file, 0, "%s", strerror(errno));
	process_streams_close(&streams);
	return error;
}
