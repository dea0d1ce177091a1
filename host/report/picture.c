/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/picture.h"

#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

/* gnuplot's three streams as files in memory: no pipe can fill up while the other end waits. */
struct streams {
	int fd[3];
};

static void close_streams(struct streams *streams)
{
	for (int i = 0; i < 3; i++)
		if (streams->fd[i] >= 0)
			close(streams->fd[i]);
}

static int write_all(int fd, const char *text, size_t length)
{
	while (length > 0) {
		ssize_t n = write(fd, text, length);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return DT_E_SYSTEM;
		text += n;
		length -= (size_t)n;
	}
	return lseek(fd, 0, SEEK_SET) == 0 ? 0 : DT_E_SYSTEM;
}

static int open_streams(struct streams *streams, const char *script, size_t length)
{
	for (int i = 0; i < 3; i++)
		streams->fd[i] = memfd_create("gnuplot", MFD_CLOEXEC);
	if (streams->fd[0] >= 0 && streams->fd[1] >= 0 && streams->fd[2] >= 0 &&
	    write_all(streams->fd[0], script, length) == 0)
		return 0;
	close_streams(streams);
	return DT_E_SYSTEM;
}

/* Returns gnuplot's exit status, or a negative errno when it could not be started. */
static int run(const struct streams *streams)
{
	char name[] = "gnuplot", defaults[] = "--default-settings";
	char *argv[] = {name, defaults, NULL};
	posix_spawn_file_actions_t actions;
	int status = 0, error = posix_spawn_file_actions_init(&actions);
	pid_t pid, done;

	if (error)
		return -error;
	for (int i = 0; i < 3 && !error; i++)
		error = posix_spawn_file_actions_adddup2(&actions, streams->fd[i], i);
	if (!error)
		error = posix_spawnp(&pid, name, &actions, NULL, argv, environ);
	posix_spawn_file_actions_destroy(&actions);
	if (error)
		return -error;
	do
		done = waitpid(pid, &status, 0);
	while (done < 0 && errno == EINTR);
	if (done < 0)
		return -errno;
	return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

static char *read_all(int fd)
{
	off_t end = lseek(fd, 0, SEEK_END);
	char *text = end < 0 ? NULL : malloc((size_t)end + 1);
	size_t have = 0;

	while (text && have < (size_t)end) {
		ssize_t n = pread(fd, text + have, (size_t)end - have, (off_t)have);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			break;
		have += (size_t)n;
	}
	if (text)
		text[have] = '\0';
	return text;
}

/* gnuplot's complaint: the first line of its error stream that says something. */
static void complain(int fd, char *message, size_t size)
{
	char *text = read_all(fd);
	const char *line = text ? text + strspn(text, " \t\r\n^") : "";

	snprintf(message, size, "gnuplot failed: %.*s", (int)strcspn(line, "\n"), line);
	free(text);
}

static int collect(const struct streams *streams, int status, char **svg, char *message, size_t size)
{
	char *text;

	if (status < 0) {
		snprintf(message, size, "gnuplot cannot be run (%s): install the package gnuplot-nox",
		         strerror(-status));
		return DT_E_SYSTEM;
	}
	text = read_all(streams->fd[1]);
	if (!text) {
		snprintf(message, size, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	if (status > 0 || !strstr(text, "</svg>")) {
		complain(streams->fd[2], message, size);
		free(text);
		return DT_E_SYSTEM;
	}
	*svg = text;
	return 0;
}

int picture_draw(const char *script, size_t length, char **svg, char *message, size_t size)
{
	struct streams streams;
	int result;

	if (open_streams(&streams, script, length)) {
		snprintf(message, size, "no file in memory for gnuplot: %s", strerror(errno));
		return DT_E_SYSTEM;
	}
	result = collect(&streams, run(&streams), svg, message, size);
	close_streams(&streams);
	return result;
}
