/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/hdf5.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "host/record/seal.h"
#include "host/record/text.h"
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

static void become_helper(const char *path, const char *verb, int in, int out, int err)
{
	char name[sizeof(HELPER)], word[16];
	char *argv[] = {name, word, NULL};

	memcpy(name, HELPER, sizeof(HELPER));
	snprintf(word, sizeof(word), "%s", verb);
	if (dup2(in, STDIN_FILENO) >= 0 && dup2(out, STDOUT_FILENO) >= 0 && dup2(err, STDERR_FILENO) >= 0)
		execv(path, argv);
	_exit(127);
}

/* The helper's one line of complaint. */
static int complain(char *message, const char *file, int err, int status)
{
	char text[256] = "";
	ssize_t length = pread(err, text, sizeof(text) - 1, 0);

	text[length > 0 ? length : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	if (WIFEXITED(status) && text[0])
		return source_refuse(message, DT_E_FORMAT, file, 0, "%s", text);
	return source_refuse(message, DT_E_FORMAT, file, 0, "%s died of it, expected HDF5 of ours", HELPER);
}

static int run_helper(const char *verb, int in, int out, int err, const char *file, char *message)
{
	char path[PATH_MAX];
	int status = 0;
	pid_t pid;

	if (path_of_helper(path) != 0)
		return source_refuse(
		        message, DT_E_UNKNOWN, file, 0,
		        "this build cannot do HDF5: install libhdf5-dev and pkg-config and run make "
		        "again");
	pid = fork();
	if (pid == 0)
		become_helper(path, verb, in, out, err);
	while (pid > 0 && waitpid(pid, &status, 0) < 0 && errno == EINTR)
		continue;
	if (pid < 0)
		return source_refuse(message, DT_E_SYSTEM, file, 0, "%s: %s", HELPER, strerror(errno));
	return status == 0 ? 0 : complain(message, file, err, status);
}

/* In memory, all three: the helper can neither wait for us nor we for it. */
struct pipes {
	int in, out, err;
};

static int pipes_open(struct pipes *pipes)
{
	pipes->in = memfd_create("in", MFD_CLOEXEC);
	pipes->out = memfd_create("out", MFD_CLOEXEC);
	pipes->err = memfd_create("err", MFD_CLOEXEC);
	return pipes->in >= 0 && pipes->out >= 0 && pipes->err >= 0 ? 0 : DT_E_SYSTEM;
}

static void pipes_close(struct pipes *pipes)
{
	for (int i = 0; i < 3; i++) {
		int fd = i == 0 ? pipes->in : i == 1 ? pipes->out : pipes->err;

		if (fd >= 0)
			close(fd);
	}
}

static int put_all(int fd, const char *bytes, size_t size)
{
	for (size_t done = 0; done < size;) {
		ssize_t count = write(fd, bytes + done, size - done);

		if (count < 0 && errno != EINTR)
			return DT_E_SYSTEM;
		done += count > 0 ? (size_t)count : 0;
	}
	return lseek(fd, 0, SEEK_SET) == 0 ? 0 : DT_E_SYSTEM;
}

static int copy_all(int fd, FILE *out)
{
	char bytes[1 << 16];
	ssize_t count;
	off_t at = 0;

	while ((count = pread(fd, bytes, sizeof(bytes), at)) > 0) {
		if (fwrite(bytes, 1, (size_t)count, out) != (size_t)count)
			return DT_E_SYSTEM;
		at += count;
	}
	return count < 0 || fflush(out) != 0 ? DT_E_SYSTEM : 0;
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
	struct pipes pipes;
	int error = pipes_open(&pipes);

	if (!error)
		error = put_all(pipes.in, source->bytes, source->size);
	if (error)
		error = source_refuse(message, error, source->file, 0, "%s", strerror(errno));
	else
		error = run_helper("read", pipes.in, pipes.out, pipes.err, source->file, message);
	if (!error)
		error = read_csv_of(record, pipes.out, source->file, message);
	if (!error)
		strcpy(record->format, "hdf5");
	pipes_close(&pipes);
	return error;
}

static int put_csv(const struct record *record, int fd)
{
	struct text text;
	int error = text_open(&text);

	if (!error)
		error = text_close(&text, write_csv(record, text.out));
	if (!error)
		error = put_all(fd, text.bytes, text.size);
	free(text.bytes);
	return error;
}

int write_hdf5(const struct record *record, FILE *out, const char *file, char message[READ_MESSAGE_MAX])
{
	struct pipes pipes;
	int error = pipes_open(&pipes);

	if (!error)
		error = put_csv(record, pipes.in);
	if (error)
		error = source_refuse(message, error, file, 0, "%s", error_text(error));
	else
		error = run_helper("write", pipes.in, pipes.out, pipes.err, file, message);
	if (!error && copy_all(pipes.out, out) != 0)
		error = source_refuse(message, DT_E_SYSTEM, file, 0, "%s", strerror(errno));
	pipes_close(&pipes);
	return error;
}
