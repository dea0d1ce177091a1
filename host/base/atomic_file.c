/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/atomic_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/text.h"
#include "host/base/durable.h"

static int atomic_file_refuse(char *message, size_t size, const char *file, int result)
{
	enum { NAME_MAX_CHARS = 256 }; /* the explanation must fit behind it */
	const char *why = result == DT_E_SYSTEM && errno != 0 ? strerror(errno) : error_text(result);
	size_t length = strlen(file);

	if (length > NAME_MAX_CHARS)
		file += length - NAME_MAX_CHARS;
	snprintf(message, size, "%s: cannot be written: %s", file, why);
	return result;
}

static void atomic_file_forget(struct atomic_file *atomic)
{
	free(atomic->place);
	free(atomic->beside);
}

/* Finds place and beside. */
static bool find_place(struct atomic_file *atomic)
{
	struct stat there;

	atomic->place = realpath(atomic->file, NULL);
	if (atomic->place == NULL)
		atomic->place = strdup(atomic->file);
	else if (stat(atomic->place, &there) == 0 && !S_ISREG(there.st_mode))
		return true;
	return atomic->place != NULL &&
	       asprintf(&atomic->beside, "%s.%ld.part", atomic->place, (long)getpid()) >= 0;
}

int atomic_file_open(struct atomic_file *atomic, const char *file, char *message, size_t size)
{
	struct atomic_file opened = {.file = file};
	int fd;

	if (!find_place(&opened)) {
		free(opened.place); /* beside is undefined after asprintf has failed */
		return atomic_file_refuse(message, size, file, DT_E_MEMORY);
	}
	fd = open(opened.beside != NULL ? opened.beside : opened.place,
	          O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | (opened.beside != NULL ? O_NOFOLLOW : 0), 0666);
	opened.out = fd < 0 ? NULL : fdopen(fd, "w");
	if (opened.out == NULL) {
		int result = atomic_file_refuse(message, size, file, DT_E_SYSTEM);

		if (fd >= 0)
			close(fd);
		atomic_file_forget(&opened);
		return result;
	}
	errno = 0;
	*atomic = opened;
	return 0;
}

int atomic_file_close(struct atomic_file *atomic, int result, char *message, size_t size)
{
	int before = errno; /* of the writer, who may know why */

	if (result == 0 && atomic->beside != NULL &&
	    (fflush(atomic->out) != 0 || fsync(fileno(atomic->out)) != 0)) {
		result = DT_E_SYSTEM;
		before = errno;
	}
	if (stream_close(atomic->out) != 0 && result == 0) {
		result = DT_E_SYSTEM;
		before = errno;
	}
	if (result == 0 && atomic->beside != NULL) {
		result = durable_replace(atomic->beside, atomic->place);
		before = errno;
	}
	if (result != 0 && atomic->beside != NULL)
		unlink(atomic->beside);
	errno = before;
	if (result != 0)
		atomic_file_refuse(message, size, atomic->file, result);
	atomic_file_forget(atomic);
	return result;
}

int atomic_file_write(const char *file, const void *bytes, size_t length, char *message, size_t size)
{
	struct atomic_file atomic;
	int result = atomic_file_open(&atomic, file, message, size);

	if (result)
		return result;
	if (fwrite(bytes, 1, length, atomic.out) != length)
		result = DT_E_SYSTEM;
	return atomic_file_close(&atomic, result, message, size);
}
