/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/whole.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/text.h"
#include "host/base/durable.h"

static int whole_refuse(char *message, size_t size, const char *file, int result)
{
	enum { NAME_MAX_CHARS = 256 }; /* the explanation must fit behind it */
	const char *why = result == DT_E_SYSTEM && errno != 0 ? strerror(errno) : error_text(result);
	size_t length = strlen(file);

	if (length > NAME_MAX_CHARS)
		file += length - NAME_MAX_CHARS;
	snprintf(message, size, "%s: cannot be written: %s", file, why);
	return result;
}

static void whole_forget(struct whole *whole)
{
	free(whole->place);
	free(whole->beside);
}

/* Finds place and beside. */
static bool find_place(struct whole *whole)
{
	struct stat there;

	whole->place = realpath(whole->file, NULL);
	if (whole->place == NULL)
		whole->place = strdup(whole->file);
	else if (stat(whole->place, &there) == 0 && !S_ISREG(there.st_mode))
		return true;
	return whole->place != NULL &&
	       asprintf(&whole->beside, "%s.%ld.part", whole->place, (long)getpid()) >= 0;
}

int whole_open(struct whole *whole, const char *file, char *message, size_t size)
{
	struct whole opened = {.file = file};
	int fd;

	if (!find_place(&opened)) {
		free(opened.place); /* beside is undefined after asprintf has failed */
		return whole_refuse(message, size, file, DT_E_MEMORY);
	}
	fd = open(opened.beside != NULL ? opened.beside : opened.place,
	          O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | (opened.beside != NULL ? O_NOFOLLOW : 0), 0666);
	opened.out = fd < 0 ? NULL : fdopen(fd, "w");
	if (opened.out == NULL) {
		int result = whole_refuse(message, size, file, DT_E_SYSTEM);

		if (fd >= 0)
			close(fd);
		whole_forget(&opened);
		return result;
	}
	errno = 0;
	*whole = opened;
	return 0;
}

int whole_close(struct whole *whole, int result, char *message, size_t size)
{
	int before = errno; /* of the writer, who may know why */

	if (result == 0 && whole->beside != NULL &&
	    (fflush(whole->out) != 0 || fsync(fileno(whole->out)) != 0)) {
		result = DT_E_SYSTEM;
		before = errno;
	}
	if (stream_close(whole->out) != 0 && result == 0) {
		result = DT_E_SYSTEM;
		before = errno;
	}
	if (result == 0 && whole->beside != NULL) {
		result = durable_replace(whole->beside, whole->place);
		before = errno;
	}
	if (result != 0 && whole->beside != NULL)
		unlink(whole->beside);
	errno = before;
	if (result != 0)
		whole_refuse(message, size, whole->file, result);
	whole_forget(whole);
	return result;
}

int whole_write(const char *file, const void *bytes, size_t length, char *message, size_t size)
{
	struct whole whole;
	int result = whole_open(&whole, file, message, size);

	if (result)
		return result;
	if (fwrite(bytes, 1, length, whole.out) != length)
		result = DT_E_SYSTEM;
	return whole_close(&whole, result, message, size);
}
