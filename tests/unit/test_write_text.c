/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What was written is whole, or an error.
 */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/base/durable.h"
#include "common/base/text.h"
#include "tests/unit/scratch.h"

#if defined(__SANITIZE_ADDRESS__)
#define SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif

static void test_a_text_is_all_of_it(void **state)
{
	struct text text;

	(void)state;
	assert_int_equal(text_open(&text), 0);
	for (int i = 0; i < 100000; i++)
		fprintf(text.out, "%06d\n", i);
	assert_int_equal(text_close(&text, 0), 0);
	assert_int_equal(text.size, 700000);
	assert_int_equal(strlen(text.bytes), 700000);
	for (int i = 0; i < 100000; i += 777)
		assert_int_equal(atoi(text.bytes + 7 * i), i);
	free(text.bytes);
	assert_int_equal(text_open(&text), 0);
	assert_int_equal(text_close(&text, 0), 0);
	assert_int_equal(text.size, 0);
	assert_string_equal(text.bytes, "");
	free(text.bytes);
	assert_int_equal(text_open(&text), 0);
	fputs("never seen", text.out);
	assert_int_equal(text_close(&text, DT_E_RANGE), DT_E_RANGE);
	assert_null(text.bytes);
}

/* In a child, whose address space ends within the text: its exit code. */
static int write_beyond(size_t bytes)
{
	const struct rlimit limit = {64u << 20, 64u << 20};
	static char block[1 << 16];
	struct text text;

	memset(block, 'x', sizeof(block));
	if (setrlimit(RLIMIT_AS, &limit) != 0 || text_open(&text) != 0)
		return 3;
	for (size_t i = 0; i < bytes; i += sizeof(block))
		fwrite(block, 1, sizeof(block), text.out);
	return text_close(&text, 0) == DT_E_MEMORY && text.bytes == NULL && text.size == 0 ? 0 : 1;
}

static void test_a_text_without_memory_is_none(void **state)
{
	int status = 0;
	pid_t pid;

	(void)state;
#ifdef SANITIZED
	skip(); /* the sanitizer's address space has no such end */
#endif
	pid = fork();
	assert_true(pid >= 0);
	if (pid == 0)
		_exit(write_beyond(128u << 20));
	assert_int_equal(waitpid(pid, &status, 0), pid);
	assert_true(WIFEXITED(status));
	assert_int_equal(WEXITSTATUS(status), 0);
}

static void test_a_file_that_lacks_a_byte_is_told(void **state)
{
	FILE *full = fopen("/dev/full", "w"), *null = fopen("/dev/null", "w");

	(void)state;
	assert_non_null(full);
	assert_non_null(null);
	fputs("one byte is enough", full);
	errno = 0;
	assert_int_equal(stream_close(full), DT_E_SYSTEM);
	assert_int_equal(errno, ENOSPC);
	fputs("as many as you like", null);
	assert_int_equal(stream_close(null), 0);
	/* an error of long ago is not forgotten by a flush that has nothing to do */
	full = fopen("/dev/full", "w");
	assert_non_null(full);
	setvbuf(full, NULL, _IONBF, 0);
	fputc('x', full);
	assert_int_equal(stream_close(full), DT_E_SYSTEM);
}

static void test_nothing_is_put_in_the_place_of_something(void **state)
{
	char folder[SCRATCH_MAX], path[SCRATCH_MAX + 16], part[SCRATCH_MAX + 24], *text;
	size_t size;

	(void)state;
	assert_non_null(mkdtemp(scratch_name(folder, "text")));
	snprintf(path, sizeof(path), "%s/0001.ini", folder);
	snprintf(part, sizeof(part), "%s.part", path);
	assert_int_equal(durable_write(path, "kept", 4), 0);
	assert_int_equal(durable_write(path, "", 0), DT_E_SYSTEM);
	assert_int_equal(access(part, F_OK), -1);
	text = durable_read(path, &size);
	assert_non_null(text);
	assert_string_equal(text, "kept");
	free(text);
	assert_int_equal(durable_append(path, 2, "pt\nmore\n", 8), 0);
	text = durable_read(path, &size);
	assert_non_null(text);
	assert_string_equal(text, "kept\nmore\n");
	free(text);
	unlink(path);
	rmdir(folder);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_text_is_all_of_it),
	        cmocka_unit_test(test_a_text_without_memory_is_none),
	        cmocka_unit_test(test_a_file_that_lacks_a_byte_is_told),
	        cmocka_unit_test(test_nothing_is_put_in_the_place_of_something),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
