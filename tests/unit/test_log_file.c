/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/record/log_file.h"
#include "tests/unit/drop_by_hand.h"

enum { BYTES = 5 << 20 };

static char *bytes;

/* Lines of 0 to 300 bytes, some of up to 69 000, one of 200 000, one of 3 000 000; what is in a byte tells
 * where it is. */
static int begin(void **state)
{
	uint32_t random = 7;

	(void)state;
	bytes = malloc(BYTES);
	if (bytes == NULL)
		return -1;
	for (size_t i = 0; i < BYTES; i++)
		bytes[i] = (char)(32 + (i * 2654435761u >> 13) % 90);
	for (size_t at = 0; at < BYTES; at += random >> 8) {
		bytes[at] = '\n';
		random = random * 1664525u + 1013904223u;
		random = (random & ~0xFFFFFFu) | (random & 0xFFFFFFu) % (300u << 8);
		random = ((random & 0xFFFFFFu) | 256u);
		if (at > BYTES / 8 && at < BYTES / 8 + 400)
			random = 200000u << 8;
		if (at > BYTES / 4 && at < BYTES / 4 + 400)
			random = 3000000u << 8;
		if (at > BYTES / 7 * 6)
			random *= 230;
	}
	return 0;
}

static int end(void **state)
{
	(void)state;
	free(bytes);
	return 0;
}

/* The same in blocks. */
static char *blocks_file(void)
{
	char *file = hand_file("", "", 0);
	FILE *out = fopen(file, "we");
	struct blocks_writer *writer;
	int result;

	assert_non_null(out);
	assert_int_equal(blocks_begin(&writer, out), 0);
	result = blocks_put(writer, bytes, 100);
	result = result ? result : blocks_put(writer, bytes + 100, BYTES - 100);
	assert_int_equal(blocks_end(writer, result, "an index\n", 9), 0);
	assert_int_equal(fclose(out), 0);
	return file;
}

static struct log_file open_log(const char *file)
{
	char message[READ_MESSAGE_MAX] = "";
	struct log_file log;

	if (log_file_open(&log, file, "a recording", message) != 0)
		fail_msg("%s", message);
	return log;
}

static void check_bytes_by_their_place(char *file)
{
	char message[READ_MESSAGE_MAX];
	struct log_file log = open_log(file);
	uint32_t random = 1;

	print_message("# seed 1\n");
	assert_int_equal(log.size, BYTES);
	for (unsigned i = 0; i < 3000; i++) {
		size_t at, want, held;
		const char *got;

		random = random * 1664525u + 1013904223u;
		at = i % 3 ? (size_t)i * (BYTES / 3000) : random % (BYTES + 100);
		want = i % 7 == 0 ? random % (2u << 20) : random % 1000;
		got = log_file_get(&log, at, want, &held);
		if (at < BYTES)
			assert_true(held >= (want < BYTES - at ? want : BYTES - at));
		assert_true(held <= (at < BYTES ? BYTES - at : 0));
		if (held > 0)
			assert_memory_equal(got, bytes + at, held);
	}
	assert_true(log.room <= 4u << 20); /* what was asked for, not what is there */
	assert_int_equal(log_file_error(&log, message), 0);
	log_file_close(&log);
	hand_unlink(file);
}

static void test_bytes_by_their_place(void **state)
{
	(void)state;
	check_bytes_by_their_place(hand_file("", bytes, BYTES));
	check_bytes_by_their_place(blocks_file());
}

static void check_lines(char *file)
{
	struct log_file log = open_log(file);
	struct log_line line = {0};
	size_t at = 0, longest = 0;
	uint64_t number = 0;

	while (log_file_next_line(&log, log.size, &line)) {
		const char *found = memchr(bytes + at, '\n', BYTES - at);
		size_t length = (size_t)((found != NULL ? found : bytes + BYTES) - (bytes + at));

		assert_int_equal(line.at, at);
		assert_int_equal(line.number, ++number);
		assert_int_equal(line.length, length < LOG_LINE_MAX ? length : LOG_LINE_MAX);
		assert_memory_equal(line.text, bytes + at, line.length);
		at += length + (found != NULL);
		assert_int_equal(line.next, at);
		longest = length > longest ? length : longest;
	}
	assert_int_equal(at, BYTES);
	assert_true(longest > 2000000);
	assert_true(log.room <= 1u << 17);
	log_file_close(&log);
	hand_unlink(file);
}

static void test_lines(void **state)
{
	(void)state;
	check_lines(hand_file("", bytes, BYTES));
	check_lines(blocks_file());
}

static size_t read_file(const char *file, char **into)
{
	FILE *in = fopen(file, "re");
	size_t size;

	assert_non_null(in);
	*into = malloc(BYTES);
	assert_non_null(*into);
	size = fread(*into, 1, BYTES, in);
	fclose(in);
	return size;
}

/* How much of the log comes as it was from the file with these bytes; the rest is told of. */
static size_t same_bytes(const char *file, const char *packed, size_t size, unsigned *damaged)
{
	FILE *out = fopen(file, "we");
	size_t same = 0, held;
	struct log_file log;
	char message[BLOCKS_MESSAGE_MAX];

	assert_non_null(out);
	assert_int_equal(fwrite(packed, 1, size, out), size);
	fclose(out);
	log = open_log(file);
	for (uint64_t at = 0; at < log.size; at += held) {
		const char *got = log_file_get(&log, at, 1, &held);

		for (size_t i = 0; i < held && at + i < BYTES; i++)
			same += got[i] == bytes[at + i];
	}
	assert_int_equal(log.failed, 0);
	*damaged = log_file_damage(&log, 0, log.size, message);
	log_file_close(&log);
	return same;
}

/* Costs a block, which is told of; the index and the table cost none. */
static void test_a_damaged_block(void **state)
{
	char *file = blocks_file(), *packed;
	size_t size = read_file(file, &packed), entries = BYTES / BLOCKS_BYTES + 4;
	unsigned damaged;

	(void)state;
	assert_int_equal(same_bytes(file, packed, size, &damaged), BYTES);
	assert_int_equal(damaged, 0);
	for (size_t at = 30; at < size; at += size / 100) {
		packed[at] ^= 16;
		assert_true(same_bytes(file, packed, size, &damaged) >= BYTES - BLOCKS_BYTES);
		assert_true(damaged == 1 || at > size - 20 * entries);
		packed[at] ^= 16;
	}
	/* the end and the table are cut off: all blocks before are there, and what is missing is told */
	for (size_t part = 1; part < 10; part++) {
		size_t left = size * part / 10;

		assert_true(same_bytes(file, packed, left, &damaged) + 2 * BLOCKS_BYTES > BYTES * part / 10);
		assert_int_equal(damaged, 1);
	}
	/* a table that is none */
	packed[size - 1] ^= 16;
	assert_int_equal(same_bytes(file, packed, size, &damaged), BYTES);
	assert_int_equal(damaged, 1);
	free(packed);
	hand_unlink(file);
}

/* A log that becomes shorter while it is read is not taken for one that ends there. */
static void test_a_log_that_is_cut_meanwhile(void **state)
{
	char *file = hand_file("", bytes, BYTES), message[READ_MESSAGE_MAX] = "";
	struct log_file log = open_log(file);
	struct log_line line = {0};

	(void)state;
	assert_true(log_file_next_line(&log, log.size, &line));
	assert_int_equal(truncate(file, 2 << 20), 0);
	while (log_file_next_line(&log, log.size, &line))
		continue;
	assert_true(line.next <= 2 << 20);
	assert_int_equal(log_file_error(&log, message), DT_E_SYSTEM);
	assert_non_null(strstr(message, "cut while it was read"));
	log_file_close(&log);
	hand_unlink(file);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_bytes_by_their_place),
	        TEST(test_lines),
	        TEST(test_a_damaged_block),
	        TEST(test_a_log_that_is_cut_meanwhile),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
