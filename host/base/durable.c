/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/durable.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/process.h"

enum { FILE_MAX_BYTES = 1 << 28 };

/* Closes and keeps the errno of what failed before. */
static int shut(int fd, int result)
{
	int before = errno;

	if (close(fd) != 0 && result == 0)
		return DT_E_SYSTEM;
	errno = before;
	return result;
}

static char *durable_folder_of(const char *path)
{
	const char *slash = strrchr(path, '/');

	if (slash == NULL)
		return strdup(".");
	return slash == path ? strdup("/") : strndup(path, (size_t)(slash - path));
}

static int sync_one(const char *path, int flags)
{
	int fd = open(path, flags | O_CLOEXEC);

	if (fd < 0)
		return DT_E_SYSTEM;
	return shut(fd, fsync(fd) == 0 ? 0 : DT_E_SYSTEM);
}

int durable_sync_folder(const char *path)
{
	char *folder = durable_folder_of(path);
	int result = folder != NULL ? sync_one(folder, O_RDONLY | O_DIRECTORY) : DT_E_MEMORY;

	free(folder);
	return result;
}

int durable_sync(const char *path)
{
	int result = sync_one(path, O_RDONLY);

	return result != 0 ? result : durable_sync_folder(path);
}

int durable_folders(const char *path)
{
	char *part = strdup(path);
	int result = part != NULL ? 0 : DT_E_MEMORY;

	for (char *slash = part != NULL ? strchr(part + 1, '/') : NULL; slash != NULL && result == 0;
	     slash = strchr(slash + 1, '/')) {
		*slash = '\0';
		if (mkdir(part, 0777) == 0)
			result = durable_sync_folder(part);
		else if (errno != EEXIST)
			result = DT_E_SYSTEM;
		*slash = '/';
	}
	free(part);
	return result;
}

static int durable_write_all(int fd, const char *bytes, size_t size)
{
	errno = process_write(fd, bytes, size);
	return errno == 0 && fsync(fd) == 0 ? 0 : DT_E_SYSTEM;
}

static char *part_of(const char *path)
{
	char *part;

	return asprintf(&part, "%s.part", path) < 0 ? NULL : part;
}

int durable_stage(const char *path, const void *bytes, size_t size)
{
	char *part = part_of(path);
	int fd, result;

	if (part == NULL)
		return DT_E_MEMORY;
	if (size == 0) { /* nothing of ours is empty: what is there stays */
		free(part);
		errno = ENODATA;
		return DT_E_SYSTEM;
	}
	fd = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
	result = fd < 0 ? DT_E_SYSTEM : shut(fd, durable_write_all(fd, bytes, size));
	if (result != 0 && fd >= 0) {
		int before = errno;

		unlink(part);
		errno = before;
	}
	free(part);
	return result;
}

int durable_replace(const char *from, const char *to)
{
	return rename(from, to) == 0 ? durable_sync_folder(to) : DT_E_SYSTEM;
}

int durable_publish(const char *path)
{
	char *part = part_of(path);
	int result = part == NULL ? DT_E_MEMORY : durable_replace(part, path);

	free(part);
	return result;
}

int durable_write(const char *path, const void *bytes, size_t size)
{
	int result = durable_stage(path, bytes, size);

	return result != 0 ? result : durable_publish(path);
}

int durable_append(const char *path, int64_t at, const void *bytes, size_t size)
{
	int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666), result;

	if (fd < 0)
		return DT_E_SYSTEM;
	result = ftruncate(fd, at) == 0 && lseek(fd, at, SEEK_SET) == at ? durable_write_all(fd, bytes, size)
	                                                                 : DT_E_SYSTEM;
	if (result != 0 && ftruncate(fd, at) != 0)
		result = DT_E_SYSTEM; /* half a line stays: the next one takes its place */
	result = shut(fd, result);
	return result == 0 && at == 0 ? durable_sync_folder(path) : result;
}

char *durable_read(const char *path, size_t *size)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a FIFO would wait for who writes it */
	FILE *in = fd >= 0 ? fdopen(fd, "r") : NULL;
	char *text = NULL;
	struct stat status;
	size_t length = 0;
	int failed;

	if (in == NULL) {
		if (fd >= 0)
			shut(fd, -1);
		return NULL;
	}
	if (fstat(fileno(in), &status) == 0 && S_ISREG(status.st_mode) && status.st_size <= FILE_MAX_BYTES)
		text = malloc((size_t)status.st_size + 1);
	else
		errno = EINVAL;
	if (text != NULL) {
		length = fread(text, 1, (size_t)status.st_size, in);
		text[length] = '\0';
	}
	if (text != NULL && ferror(in)) {
		free(text);
		text = NULL;
	}
	failed = errno;
	fclose(in);
	errno = failed;
	if (size != NULL)
		*size = length;
	return text;
}
