/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The exchange by two FIFOs.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "firmware/port/lockstep.h"
#include "firmware/port/posix/posix.h"

static int request_fd, answer_fd;

int lockstep_write(const void *bytes, size_t count)
{
	const uint8_t *p = bytes;

	while (count > 0) {
		ssize_t done = write(request_fd, p, count);

		if (done < 0 && errno == EINTR)
			continue;
		if (done < 0)
			return errno == EPIPE ? LOCKSTEP_GONE : DT_E_SYSTEM;
		p += done;
		count -= (size_t)done;
	}
	return 0;
}

int lockstep_read(void *bytes, size_t size, size_t *count)
{
	ssize_t done;

	do
		done = read(answer_fd, bytes, size);
	while (done < 0 && errno == EINTR);
	if (done <= 0)
		return done == 0 ? LOCKSTEP_GONE : DT_E_SYSTEM;
	*count += (size_t)done;
	return 0;
}

static int open_pipe(const char *prefix, const char *suffix, int flags, int *fd, char *message, size_t size)
{
	char path[4096];

	if (snprintf(path, sizeof(path), "%s.%s", prefix, suffix) >= (int)sizeof(path)) {
		snprintf(message, size, "path too long");
		return DT_E_ARGUMENT;
	}
	*fd = open(path, flags | O_CLOEXEC);
	if (*fd >= 0)
		return 0;
	snprintf(message, size, "%s: %s", suffix, strerror(errno));
	return DT_E_SYSTEM;
}

int pipes_open(const char *bus, char *message, size_t size)
{
	int result = open_pipe(bus, "request", O_WRONLY, &request_fd, message, size);

	return result == 0 ? open_pipe(bus, "answer", O_RDONLY, &answer_fd, message, size) : result;
}
