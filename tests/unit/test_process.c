/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A child process: what it is given, what comes back, and what is said when it cannot be started.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/base/process.h"

/* sh -c script with input on its standard input; its two outputs are freed by the caller. */
static int run_shell(const char *script, const char *input, char *output[2])
{
	const char *const words[] = {"sh", "-c", script, NULL};
	struct process_streams streams;
	size_t size;
	int status;

	assert_int_equal(process_streams_open(&streams, input, strlen(input)), 0);
	status = process_filter(words, &streams);
	for (int i = 0; i < 2; i++)
		assert_non_null(output[i] = process_read(streams.fd[i + 1], &size));
	process_streams_close(&streams);
	return status;
}

/* What cannot be read is nothing, and not an empty text. */
static void a_stream_that_cannot_be_read(void **state)
{
	size_t size;
	int fd = memfd_create("unread", 0), closed;
	char path[64];

	(void)state;
	assert_int_equal(write(fd, "abc", 3), 3);
	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	closed = open(path, O_WRONLY | O_CLOEXEC);
	assert_true(closed >= 0);
	errno = 0;
	assert_null(process_read(closed, &size));
	assert_int_equal(errno, EBADF);
	close(closed);
	close(fd);
}

static void streams_are_the_childs(void **state)
{
	char *output[2];

	(void)state;
	assert_int_equal(run_shell("cat; echo why >&2; exit 3", "what\n", output), 3);
	assert_string_equal(output[0], "what\n");
	assert_string_equal(output[1], "why\n");
	free(output[0]);
	free(output[1]);
	assert_int_equal(run_shell("kill -KILL $$", "", output), 128 + SIGKILL);
	free(output[0]);
	free(output[1]);
}

static void a_program_that_is_none_has_an_errno(void **state)
{
	const char *const words[] = {"/nowhere/program", NULL};
	struct process_streams streams;
	pid_t pid = -7;

	(void)state;
	assert_int_equal(process_streams_open(&streams, "", 0), 0);
	assert_int_equal(process_filter(words, &streams), -ENOENT);
	process_streams_close(&streams);
	assert_int_equal(process_start(&(struct process){.words = words}, &pid), ENOENT);
}

/* Reads nothing, in its own group, in its folder, with its environment, and SIGTERM ends it. */
static void alone_it_has_nothing_of_ours(void **state)
{
	const char *const words[] = {
	        "/bin/sh", "-c",
	        "cat; [ $PWD = / ] && [ \"$A\" = b ] && [ -z \"$HOME\" ] || exit 9; kill -TERM $$", NULL};
	const char *const environment[] = {"A=b", "PATH=/usr/bin:/bin", NULL};
	struct process process = {.words = words, .environment = environment, .folder = "/", .alone = true};
	sigset_t terminate, before;
	pid_t pid;

	(void)state;
	process.fd[0] = PROCESS_NOTHING;
	sigemptyset(&terminate);
	sigaddset(&terminate, SIGTERM);
	sigprocmask(SIG_BLOCK, &terminate, &before);
	assert_int_equal(process_start(&process, &pid), 0);
	assert_int_equal(getpgid(pid), pid);
	assert_int_equal(process_wait(pid), 128 + SIGTERM);
	sigprocmask(SIG_SETMASK, &before, NULL);
	assert_int_equal(process_wait(pid), -ECHILD);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(streams_are_the_childs),
	        cmocka_unit_test(a_stream_that_cannot_be_read),
	        cmocka_unit_test(a_program_that_is_none_has_an_errno),
	        cmocka_unit_test(alone_it_has_nothing_of_ours),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
