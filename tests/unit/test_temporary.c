/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Temporary folders: gone when their program ends, swept when it was killed, left alone while it lives.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/link/temporary.h"
#include "tests/unit/scratch.h"

static char parent[SCRATCH_MAX];

static bool is_there(const char *path)
{
	struct stat status;

	return lstat(path, &status) == 0;
}

static int begin(void **state)
{
	(void)state;
	return mkdtemp(scratch_name(parent, "trial")) != NULL && setenv("TMPDIR", parent, 1) == 0 ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	return rmdir(parent);
}

/* A program with a folder and a file in it, which then waits to be killed. */
static pid_t holder(const char *purpose, char path[TEMPORARY_PATH_MAX])
{
	int pipes[2];
	pid_t pid;

	assert_int_equal(pipe(pipes), 0);
	pid = fork();
	if (pid == 0) {
		struct temporary temporary;
		char file[TEMPORARY_PATH_MAX + 8];

		if (temporary_make(&temporary, purpose) != 0)
			_exit(1);
		snprintf(file, sizeof(file), "%s/deep", temporary.path);
		if (mkdir(file, 0700) != 0 ||
		    write(pipes[1], temporary.path, TEMPORARY_PATH_MAX) != TEMPORARY_PATH_MAX)
			_exit(1);
		pause();
		_exit(0);
	}
	assert_int_equal(read(pipes[0], path, TEMPORARY_PATH_MAX), TEMPORARY_PATH_MAX);
	close(pipes[0]);
	close(pipes[1]);
	return pid;
}

static void kill_it(pid_t pid)
{
	kill(pid, SIGKILL);
	waitpid(pid, NULL, 0);
}

static void test_a_killed_ones_folder_is_swept(void **state)
{
	char dead[TEMPORARY_PATH_MAX], alive[TEMPORARY_PATH_MAX], other[TEMPORARY_PATH_MAX];
	pid_t killed = holder("trial", dead), living = holder("trial", alive), else_ = holder("other", other);
	struct temporary own;

	(void)state;
	kill_it(killed);
	kill_it(else_);
	assert_true(is_there(dead) && is_there(other));
	assert_int_equal(temporary_make(&own, "trial"), 0);
	assert_false(is_there(dead));
	assert_true(is_there(alive)); /* in use */
	assert_true(is_there(other)); /* of another purpose */
	assert_true(is_there(own.path));
	temporary_remove(&own);
	assert_false(is_there(own.path[0] != '\0' ? own.path : dead));
	kill_it(living);
	assert_int_equal(temporary_make(&own, "other"), 0);
	temporary_remove(&own);
	assert_int_equal(temporary_make(&own, "trial"), 0);
	temporary_remove(&own);
	assert_false(is_there(alive) || is_there(other));
}

/* Links of that name, folders without a lock and files are none of ours. */
static void test_what_is_not_ours_stays(void **state)
{
	char path[3][SCRATCH_MAX + 32], kept[SCRATCH_MAX + 32];
	struct temporary own;

	(void)state;
	snprintf(path[0], sizeof(path[0]), "%s/droptower-trial-folder", parent);
	snprintf(path[1], sizeof(path[1]), "%s/droptower-trial-linked", parent);
	snprintf(path[2], sizeof(path[2]), "%s/droptower-trial-aafile", parent);
	snprintf(kept, sizeof(kept), "%s/kept", parent);
	assert_int_equal(mkdir(path[0], 0700), 0);
	assert_int_equal(mkdir(kept, 0700), 0);
	assert_int_equal(symlink(kept, path[1]), 0);
	close(open(path[2], O_CREAT | O_WRONLY, 0600));
	assert_int_equal(temporary_make(&own, "trial"), 0);
	temporary_remove(&own);
	for (int i = 0; i < 3; i++)
		assert_true(is_there(path[i]));
	assert_true(is_there(kept));
	assert_int_equal(rmdir(path[0]) | unlink(path[1]) | unlink(path[2]) | rmdir(kept), 0);
}

/* Who makes one while others sweep has it, however their steps fall between its own. */
static void test_none_is_swept_while_it_is_made(void **state)
{
	enum { MAKERS = 8, TIMES = 400 };
	pid_t pid[MAKERS];

	(void)state;
	for (int i = 0; i < MAKERS; i++) {
		pid[i] = fork();
		if (pid[i] != 0)
			continue;
		for (int k = 0; k < TIMES; k++) {
			struct temporary own;

			if (temporary_make(&own, "trial") != 0)
				_exit(1);
			for (int look = 0; look < 3; look++)
				if (sched_yield() != 0 || !is_there(own.path))
					_exit(2);
			temporary_remove(&own);
		}
		_exit(0);
	}
	for (int i = 0; i < MAKERS; i++) {
		int status = -1;

		assert_int_equal(waitpid(pid[i], &status, 0), pid[i]);
		assert_int_equal(status, 0);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_killed_ones_folder_is_swept),
	        cmocka_unit_test(test_what_is_not_ours_stays),
	        cmocka_unit_test(test_none_is_swept_while_it_is_made),
	};

	return cmocka_run_group_tests(tests, begin, end);
}
