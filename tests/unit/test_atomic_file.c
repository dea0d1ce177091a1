/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Result files: whole or not there, and nothing but regular files is ever replaced.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/base/atomic_file.h"
#include "tests/unit/scratch.h"

static char folder[SCRATCH_MAX];

static int setup(void **state)
{
	(void)state;
	return mkdtemp(scratch_name(folder, "whole")) && chdir(folder) == 0 ? 0 : -1;
}

static int teardown(void **state)
{
	(void)state;
	return chdir("/") == 0 && rmdir(folder) == 0 ? 0
	                                             : -1; /* every test clears up, and no more is there */
}

static void put(const char *file, const char *text)
{
	FILE *out = fopen(file, "w");

	assert_non_null(out);
	fputs(text, out);
	assert_int_equal(fclose(out), 0);
}

static void check_file(const char *file, const char *text)
{
	char there[64] = "";
	FILE *in = fopen(file, "r");

	assert_non_null(in);
	there[fread(there, 1, sizeof(there) - 1, in)] = '\0';
	fclose(in);
	assert_string_equal(there, text);
}

/* Writes "new" as a writer that returns result. */
static int write_new(const char *file, int result, char *message, size_t size)
{
	struct atomic_file atomic;

	assert_int_equal(atomic_file_open(&atomic, file, message, size), 0);
	fputs("new", atomic.out);
	return atomic_file_close(&atomic, result, message, size);
}

static void test_new_and_replaced(void **state)
{
	char message[100] = "untouched";

	(void)state;
	assert_int_equal(write_new("a", 0, message, sizeof(message)), 0);
	check_file("a", "new");
	put("a", "a longer old text");
	assert_int_equal(write_new("a", 0, message, sizeof(message)), 0);
	check_file("a", "new");
	assert_string_equal(message, "untouched");
	unlink("a");
}

static void test_a_failed_writer_leaves_what_was_there(void **state)
{
	char message[100];

	(void)state;
	put("a", "old");
	assert_int_equal(write_new("a", DT_E_MEMORY, message, sizeof(message)), DT_E_MEMORY);
	check_file("a", "old");
	unlink("a");
	assert_int_equal(write_new("a", DT_E_MEMORY, message, sizeof(message)), DT_E_MEMORY);
	assert_memory_equal(message, "a: cannot be written: ", 22);
	assert_int_equal(access("a", F_OK), -1);
}

static void test_a_link_stays(void **state)
{
	char message[100];
	struct stat there;

	(void)state;
	put("target", "old");
	assert_int_equal(symlink("target", "link"), 0);
	assert_int_equal(write_new("link", 0, message, sizeof(message)), 0);
	assert_int_equal(lstat("link", &there), 0);
	assert_true(S_ISLNK(there.st_mode));
	check_file("target", "new");
	unlink("link");
	unlink("target");
}

static void test_a_pipe_is_written_to(void **state)
{
	char message[100], text[8] = "";
	struct stat there;
	int reader;

	(void)state;
	assert_int_equal(mkfifo("pipe", 0600), 0);
	reader = open("pipe", O_RDONLY | O_NONBLOCK);
	assert_true(reader >= 0);
	assert_int_equal(write_new("pipe", 0, message, sizeof(message)), 0);
	assert_int_equal(read(reader, text, sizeof(text)), 3);
	assert_string_equal(text, "new");
	close(reader);
	assert_int_equal(stat("pipe", &there), 0);
	assert_true(S_ISFIFO(there.st_mode));
	unlink("pipe");
}

static void test_a_full_device_says_so(void **state)
{
	char message[100];

	(void)state;
	if (access("/dev/full", W_OK) != 0)
		skip();
	assert_int_equal(symlink("/dev/full", "full"), 0); /* were it replaced, then only here */
	assert_int_equal(write_new("full", 0, message, sizeof(message)), DT_E_SYSTEM);
	assert_string_equal(message, "full: cannot be written: No space left on device");
	unlink("full");
}

static void test_nowhere(void **state)
{
	struct atomic_file atomic;
	char message[400], name[600];

	(void)state;
	assert_int_equal(atomic_file_open(&atomic, "no/such", message, sizeof(message)), DT_E_SYSTEM);
	assert_string_equal(message, "no/such: cannot be written: No such file or directory");
	memset(name, 'n', sizeof(name));
	name[sizeof(name) - 1] = '\0';
	assert_int_equal(atomic_file_open(&atomic, name, message, sizeof(message)), DT_E_SYSTEM);
	assert_non_null(strstr(message, ": cannot be written: File name too long"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_new_and_replaced),
	        cmocka_unit_test(test_a_failed_writer_leaves_what_was_there),
	        cmocka_unit_test(test_a_link_stays),
	        cmocka_unit_test(test_a_pipe_is_written_to),
	        cmocka_unit_test(test_a_full_device_says_so),
	        cmocka_unit_test(test_nowhere),
	};

	return cmocka_run_group_tests(tests, setup, teardown);
}
