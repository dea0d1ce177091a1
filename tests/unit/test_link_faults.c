/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every system call of the links failed once: counted first, then failed one by one, with an error that
 * passes and with one that does not. Whatever comes back, nothing crashes, hangs, leaks a descriptor or
 * leaves a socket behind, and what was refused is said in one line. The linker puts this between the links
 * and the C library (tests/fault/fault.mk).
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "common/link/link.h"
#include "tests/unit/scratch.h"

static struct {
	unsigned calls, fail_at; /* 0: none */
	int error;
} fault;

static bool fails(void)
{
	fault.calls++;
	if (fault.calls != fault.fail_at)
		return false;
	errno = fault.error;
	return true;
}

/* A call that gives -1, or NULL, when it fails. */
#define WRAP(result, bad, name, parameters, arguments)            \
	result __real_##name parameters;                          \
	result __wrap_##name parameters;                          \
	result __wrap_##name parameters                           \
	{                                                         \
		return fails() ? (bad) : __real_##name arguments; \
	}

WRAP(void *, NULL, calloc, (size_t count, size_t size), (count, size))
WRAP(void *, NULL, malloc, (size_t size), (size))
WRAP(char *, NULL, strdup, (const char *text), (text))
WRAP(FILE *, NULL, fopen, (const char *path, const char *mode), (path, mode))
WRAP(int, -1, poll, (struct pollfd * fds, nfds_t count, int ms), (fds, count, ms))
WRAP(int, -1, epoll_create1, (int flags), (flags))
WRAP(int, -1, epoll_ctl, (int p, int op, int fd, struct epoll_event *event), (p, op, fd, event))
WRAP(int, -1, epoll_wait, (int p, struct epoll_event *events, int count, int ms), (p, events, count, ms))
WRAP(int, -1, eventfd, (unsigned value, int flags), (value, flags))
WRAP(int, -1, fstat, (int fd, struct stat *status), (fd, status))
WRAP(int, -1, stat, (const char *path, struct stat *status), (path, status))
WRAP(int, -1, lstat, (const char *path, struct stat *status), (path, status))
WRAP(int, -1, flock, (int fd, int operation), (fd, operation))
WRAP(int, -1, dup, (int fd), (fd))
WRAP(int, -1, socket, (int domain, int type, int protocol), (domain, type, protocol))
WRAP(int, -1, bind, (int fd, const struct sockaddr *address, socklen_t length), (fd, address, length))
WRAP(int, -1, listen, (int fd, int backlog), (fd, backlog))
WRAP(int, -1, connect, (int fd, const struct sockaddr *address, socklen_t length), (fd, address, length))
WRAP(int, -1, accept4, (int fd, struct sockaddr *address, socklen_t *length, int flags),
     (fd, address, length, flags))
WRAP(ssize_t, -1, send, (int fd, const void *bytes, size_t count, int flags), (fd, bytes, count, flags))
WRAP(ssize_t, -1, recv, (int fd, void *bytes, size_t count, int flags), (fd, bytes, count, flags))
WRAP(ssize_t, -1, read, (int fd, void *bytes, size_t count), (fd, bytes, count))
WRAP(ssize_t, -1, write, (int fd, const void *bytes, size_t count), (fd, bytes, count))
WRAP(int, -1, tcgetattr, (int fd, struct termios *line), (fd, line))
WRAP(int, -1, tcsetattr, (int fd, int when, const struct termios *line), (fd, when, line))
WRAP(int, -1, tcflush, (int fd, int which), (fd, which))

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...)
{
	return fails() ? -1 : __real_open(path, flags, 0600);
}

static unsigned descriptors(void)
{
	DIR *folder = opendir("/proc/self/fd");
	unsigned count = 0;

	assert_non_null(folder);
	while (readdir(folder) != NULL)
		count++;
	closedir(folder);
	return count;
}

static const struct frame frames[] = {
        {.time_us = 1, .id = 0x123, .length = 2, .data = {1, 2}},
        {.time_us = 2, .id = 0x381, .length = 12, .flags = FRAME_FD, .data = {3}},
};

/* Opens, sends, receives and closes as far as it goes; the message is one line if there is no link. */
static void use_one(const char *url, enum link_mode mode)
{
	char message[256] = "";
	struct link *link = link_open(url, mode, message, sizeof(message));
	struct frame frame;

	if (link == NULL) {
		assert_true(message[0] != '\0' && strchr(message, '\n') == NULL);
		return;
	}
	for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]) && mode != LINK_READ; i++)
		(void)!link_send(link, &frames[i]);
	for (unsigned i = 0; i < 4 && mode != LINK_WRITE; i++)
		(void)!link_receive(link, &frame, i == 0 ? 2 : 0);
	assert_non_null(link_url(link));
	(void)link_close(link);
}

/* The first of two serves the second, and goes first. */
static void use_two(const char *url, enum link_mode mode)
{
	char message[256] = "";
	struct link *server = link_open(url, mode, message, sizeof(message));
	struct link *client = link_open(url, mode, message, sizeof(message));
	struct frame frame;

	for (unsigned i = 0; i < 3; i++) {
		if (client != NULL)
			(void)!link_send(client, &frames[0]);
		if (server != NULL)
			(void)!link_receive(server, &frame, 2);
		if (server != NULL)
			(void)!link_send(server, &frames[1]);
		if (client != NULL)
			(void)!link_receive(client, &frame, 2);
	}
	(void)link_close(server);
	if (client != NULL)
		(void)!link_receive(client, &frame, 2);
	(void)link_close(client);
}

static void fail_each(void (*use)(const char *, enum link_mode), const char *url, enum link_mode mode,
                      const char *left_behind)
{
	static const int errors[] = {EINTR, EAGAIN, EIO};
	unsigned calls, before = descriptors();

	fault.calls = fault.fail_at = 0;
	use(url, mode);
	calls = fault.calls;
	assert_true(calls >= 2);
	for (size_t e = 0; e < sizeof(errors) / sizeof(errors[0]); e++)
		for (unsigned i = 1; i <= calls; i++) {
			fault.calls = 0;
			fault.fail_at = i;
			fault.error = errors[e];
			use(url, mode);
			fault.fail_at = 0;
			if (left_behind != NULL)
				unlink(left_behind);
			if (descriptors() != before)
				fail_msg("%s: call %u failed with %s: %u descriptors, before %u", url, i,
				         strerror(errors[e]), descriptors(), before);
		}
}

static char folder[SCRATCH_MAX], path[96], url[128];

static int make_folder(void **state)
{
	(void)state;
	return mkdtemp(scratch_name(folder, "faults")) == NULL ? -1 : 0;
}

static int remove_folder(void **state)
{
	(void)state;
	unlink(path);
	return rmdir(folder);
}

static void a_bus(void **state)
{
	(void)state;
	snprintf(path, sizeof(path), "%s/bus", folder);
	snprintf(url, sizeof(url), "unix:%s", path);
	fail_each(use_one, url, LINK_READ_WRITE, path);
	fail_each(use_one, url, LINK_WRITE, path);
	fail_each(use_two, url, LINK_READ_WRITE, path);
}

static void a_log(void **state)
{
	(void)state;
	snprintf(path, sizeof(path), "%s/log", folder);
	snprintf(url, sizeof(url), "log:%s", path);
	fail_each(use_one, url, LINK_WRITE, NULL);
	fail_each(use_one, url, LINK_READ, NULL);
}

static void a_serial_line(void **state)
{
	int adapter = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);

	(void)state;
	assert_true(adapter >= 0 && grantpt(adapter) == 0 && unlockpt(adapter) == 0);
	snprintf(path, sizeof(path), "%s/none", folder);
	snprintf(url, sizeof(url), "slcan:%s@115200", ptsname(adapter));
	fail_each(use_one, url, LINK_READ_WRITE, NULL);
	close(adapter);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup_teardown(a_bus, make_folder, remove_folder),
	        cmocka_unit_test_setup_teardown(a_log, make_folder, remove_folder),
	        cmocka_unit_test_setup_teardown(a_serial_line, make_folder, remove_folder),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
