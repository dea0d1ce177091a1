/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/helper.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/text.h"
#include "host/record/source.h"
#include "host/record/write.h"

static int path_of_helper(const char *program, char path[PATH_MAX])
{
	size_t most = PATH_MAX - strlen(program) - 1;
	ssize_t length = readlink("/proc/self/exe", path, most);
	char *end;

	if (length <= 0)
		return -1;
	path[length] = '\0';
	end = strrchr(path, '/');
	strcpy(end ? end + 1 : path, program);
	return access(path, X_OK);
}

/* The helper's one line of complaint. */
static int helper_complain(const struct helper *helper, char *message, const char *file, int err, int status)
{
	char text[256] = "";
	ssize_t length = pread(err, text, sizeof(text) - 1, 0);

	text[length > 0 ? length : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	if (status < 128 && text[0])
		return source_refuse(message, DT_E_FORMAT, file, 0, "%s", text);
	return source_refuse(message, DT_E_FORMAT, file, 0, "%s died of it, expected a sound file of %s",
	                     helper->program, helper->format);
}

/* Closes the streams where it fails. */
static int helper_run(const struct helper *helper, const char *verb, const char *file,
                      const struct process_streams *streams, char *message)
{
	char path[PATH_MAX];
	const char *words[] = {path, verb, NULL};
	int error, status;

	if (path_of_helper(helper->program, path) != 0)
		error = source_refuse(message, DT_E_UNKNOWN, file, 0,
		                      "this build cannot do %s: install %s and run make again",
		                      helper->format, helper->packages);
	else if ((status = process_filter(words, streams)) == 0)
		return 0;
	else
		error = status < 0 ? source_refuse(message, DT_E_SYSTEM, file, 0, "%s: %s", helper->program,
		                                   strerror(-status))
		                   : helper_complain(helper, message, file, streams->fd[2], status);
	process_streams_close(streams);
	return error;
}

int helper_read(const struct helper *helper, const struct source *source, struct process_streams *streams,
                char message[READ_MESSAGE_MAX])
{
	char path[SOURCE_PATH_MAX];
	int error = 0;

	/* in memory where the disk has no room */
	if (source->mapped == NULL ||
	    process_streams_open_file(streams, source_path(path, source->descriptor)) != 0)
		error = process_streams_open(streams, source->bytes, source->size);
	if (error != 0)
		return source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s", strerror(error));
	return helper_run(helper, "read", source->file, streams, message);
}

static int copy_all(int fd, FILE *out)
{
	size_t size = 0;
	char *bytes = process_read(fd, &size);
	bool whole = bytes != NULL && fwrite(bytes, 1, size, out) == size && fflush(out) == 0;

	free(bytes);
	return whole ? 0 : DT_E_SYSTEM;
}

int helper_write(const struct helper *helper, const struct record *record, FILE *out, const char *file,
                 char message[READ_MESSAGE_MAX])
{
	struct process_streams streams;
	struct text text;
	int error = text_open(&text);

	if (error == 0)
		error = text_close(&text, write_csv(record, text.out));
	if (error != 0)
		return source_refuse(message, error, file, 0, "%s", error_text(error));
	error = process_streams_open(&streams, text.bytes, text.size);
	free(text.bytes);
	if (error != 0)
		return source_refuse(message, DT_E_SYSTEM, file, 0, "%s", strerror(error));
	error = helper_run(helper, "write", file, &streams, message);
	if (error != 0)
		return error;
	if (copy_all(streams.fd[1], out) != 0)
		error = source_refuse(message, DT_E_SYSTEM, file, 0, "%s", strerror(errno));
	process_streams_close(&streams);
	return error;
}

static int write_of_csv(const struct source *source, int (*write)(const struct record *record))
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	int result;

	if (read_csv(&record, source, message) != 0) {
		fprintf(stderr, "%s\n", message);
		return -1;
	}
	result = write(&record);
	record_free(&record);
	return result;
}

int helper_serve(int argc, char **argv, const char *program, int (*read)(const struct source *source),
                 int (*write)(const struct record *record))
{
	char message[READ_MESSAGE_MAX];
	struct source source;
	int result;

	if (argc != 2 || (strcmp(argv[1], "read") != 0 && strcmp(argv[1], "write") != 0)) {
		fprintf(stderr, "usage: %s read|write <IN >OUT\n", program);
		return 2;
	}
	if (source_load(&source, "/dev/stdin", "a recording", message) != 0) {
		fprintf(stderr, "%s\n", message);
		return 3;
	}
	result = strcmp(argv[1], "read") == 0 ? read(&source) : write_of_csv(&source, write);
	source_free(&source);
	return result == 0 ? 0 : 3;
}
