/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Memory that leaves the process: what is in it comes back, and a file that becomes shorter is told.
 */
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/base/process.h"
#include "host/base/mapped.h"

enum { COUNT = 2 * MAPPED_LEAST / 8, PAGE = 4096, HELD_ARRAYS = MAPPED_STAY / (8 * COUNT) };

static long resident_kb(void)
{
	char line[128];
	FILE *status = fopen("/proc/self/status", "re");
	long kb = -1;

	assert_non_null(status);
	while (kb < 0 && fgets(line, sizeof(line), status) != NULL)
		sscanf(line, "VmRSS: %ld", &kb);
	fclose(status);
	return kb;
}

static void fill(uint64_t *array)
{
	for (size_t k = 0; k < COUNT; k++)
		array[k] = k * k + 1;
}

static void hold(const uint64_t *array)
{
	for (size_t k = 0; k < COUNT; k++)
		assert_int_equal(array[k], k * k + 1);
}

/* The first stay; with what they leave when they are freed others stay. */
static void test_the_first_stay(void **state)
{
	uint64_t *array[HELD_ARRAYS + 1];
	long held_kb;

	(void)state;
	for (int round = 0; round < 2; round++) {
		for (int i = 0; i <= HELD_ARRAYS; i++) {
			array[i] = mapped_array(COUNT, sizeof(*array[i]));
			assert_non_null(array[i]);
			fill(array[i]);
		}
		held_kb = resident_kb();
		mapped_seen(MAPPED_STEP);
		assert_in_range(held_kb - resident_kb(), COUNT * 8 / 1024 / 2, COUNT * 8 / 1024 * 3 / 2);
		for (int i = 0; i <= HELD_ARRAYS; i++) {
			hold(array[i]);
			mapped_free(array[i]);
		}
	}
}

/* Work lies where an array was, and beside the others. */
static void test_gaps_are_filled(void **state)
{
	uint64_t *array[3], *work;

	(void)state;
	for (int i = 0; i < 3; i++) {
		array[i] = mapped_array(COUNT, sizeof(*array[i]));
		assert_non_null(array[i]);
		fill(array[i]);
	}
	mapped_free(array[1]);
	work = mapped_work(COUNT * sizeof(*work));
	assert_ptr_equal(work, array[1]);
	fill(work);
	mapped_free(array[0]);
	array[1] = mapped_array(COUNT + 1, sizeof(*array[1])); /* larger than that gap */
	fill(array[1]);
	assert_true(array[1] > array[2]);
	array[0] = mapped_array(COUNT - 8, sizeof(*array[0]));
	memset(array[0], 0, (COUNT - 8) * sizeof(*array[0]));
	hold(work);
	hold(array[1]);
	hold(array[2]);
	mapped_free(work);
	for (int i = 0; i < 3; i++)
		mapped_free(array[i]);
	work = mapped_work(8);
	*work = 1;
	mapped_free(work);
}

static void test_array_leaves_and_comes_back(void **state)
{
	uint64_t *first = mapped_array(MAPPED_STAY / 8, sizeof(*first)), *array;
	long held_kb;

	(void)state;
	assert_non_null(first);
	array = mapped_array(COUNT, sizeof(*array));
	assert_non_null(array);
	fill(array);
	held_kb = resident_kb();
	mapped_seen(MAPPED_STEP);
	assert_true(resident_kb() < held_kb - (long)(COUNT * sizeof(*array) / 1024) / 2);
	hold(array);
	array = mapped_array_resize(array, COUNT, 2 * COUNT, sizeof(*array));
	assert_non_null(array);
	hold(array);
	array[2 * COUNT - 1] = 1;
	array = mapped_array_resize(array, 2 * COUNT, 5, sizeof(*array));
	assert_int_equal(array[4], 17);
	mapped_free(array);
	mapped_free(first);
	mapped_free(NULL);
}

/* Without a place for the file it is memory, which nothing leaves. */
static void test_no_room(void **state)
{
	uint64_t *array, *first = mapped_array(MAPPED_STAY / 8, sizeof(*first));

	(void)state;
	assert_non_null(first);
	setenv("TMPDIR", "/nowhere", 1);
	array = mapped_array(COUNT, sizeof(*array));
	unsetenv("TMPDIR");
	assert_non_null(array);
	fill(array);
	mapped_seen(MAPPED_STEP);
	hold(array);
	mapped_free(array);
	mapped_free(first);
	assert_null(mapped_array(SIZE_MAX / 4, 8));
}

static void test_file_that_becomes_shorter(void **state)
{
	static char bytes[3 * PAGE];
	int descriptor = process_scratch(), status = 0;
	char *file;
	pid_t child;

	(void)state;
	assert_true(descriptor >= 0);
	memset(bytes, 'x', sizeof(bytes));
	assert_int_equal(process_write(descriptor, bytes, sizeof(bytes)), 0);
	file = mapped_file(descriptor, sizeof(bytes));
	assert_non_null(file);
	assert_memory_equal(file, bytes, sizeof(bytes));
	child = fork();
	assert_true(child >= 0);
	if (child == 0) {
		close(STDERR_FILENO);
		if (ftruncate(descriptor, PAGE) != 0)
			_exit(9);
		_exit(((volatile char *)file)[2 * PAGE] == 'x' ? 8 : 7);
	}
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 3);
	mapped_free(file);
	close(descriptor);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_the_first_stay),
	        cmocka_unit_test(test_gaps_are_filled),
	        cmocka_unit_test(test_array_leaves_and_comes_back),
	        cmocka_unit_test(test_no_room),
	        cmocka_unit_test(test_file_that_becomes_shorter),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
