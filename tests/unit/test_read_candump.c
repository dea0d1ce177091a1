/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/record/read.h"
#include "host/record/write.h"
#include "tests/unit/drop_by_hand.h"

static struct hand_drop drop;

/* ---- a log in the making ---- */

static char *log_text;
static size_t log_size, log_room;
static uint64_t log_lines;

static int begin(void **state)
{
	(void)state;
	log_size = 0;
	log_lines = 0;
	log_room = 1 << 20;
	log_text = malloc(log_room);
	return log_text ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	free(log_text);
	return 0;
}

static void add(const char *text)
{
	size_t length = strlen(text);

	while (log_size + length > log_room) {
		log_room *= 2;
		log_text = realloc(log_text, log_room);
		assert_non_null(log_text);
	}
	memcpy(log_text + log_size, text, length);
	log_size += length;
	log_lines++;
}

static void add_frame(const struct frame *frame)
{
	char line[256];

	hand_candump(frame, 1436509052000000 + (int64_t)log_lines * 500, line);
	add(line);
}

static void add_blocks(uint32_t first, uint32_t last)
{
	struct frame frame;

	for (uint32_t tick = first; tick <= last; tick++) {
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			hand_block(&drop, sensor, tick, false, &frame);
			add_frame(&frame);
		}
	}
}

static void add_resent(unsigned sensor, uint32_t tick)
{
	struct frame frame;

	hand_block(&drop, sensor, tick, true, &frame);
	add_frame(&frame);
}

static void add_end(void)
{
	struct frame frame;

	hand_capture_end(&drop, &frame);
	add_frame(&frame);
}

/* Reads the first size bytes of the log. */
static int read_part(size_t size, struct record *record, char *message)
{
	char *file = hand_file(".log", log_text, size);
	int error = read_record(record, file, NULL, message);

	if (error == 0) {
		assert_string_equal(record->file, file);
		assert_string_equal(record->format, "candump");
	} else {
		assert_memory_equal(message, file, strlen(file));
		memmove(message, message + strlen(file), strlen(message) + 1 - strlen(file));
		assert_null(strchr(message, '\n'));
	}
	hand_unlink(file);
	return error;
}

static struct record read_log(void)
{
	char message[READ_MESSAGE_MAX] = "";
	struct record record;

	if (read_part(log_size, &record, message))
		fail_msg("%s", message);
	return record;
}

/* ---- the tests ---- */

static void test_a_whole_drop(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 7000, 500, 1);
	add("# written by hand\n\n");
	add_blocks(0, 200);
	add("(1436509052.249713) can0 701#0511223344\n");
	add("(1436509052.249713) can0 20000004#0000000000000000\n"); /* an error report */
	add_blocks(201, 499);
	add_end();
	record = read_log();
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.drop_id, 3);
	assert_int_equal(record.first_tick_ms, 7000);
	assert_int_equal(record.last_tick_ms, 7499);
	assert_true(record.trigger_s == 0.100123 && record.frame_speed_m_s == 3.912);
	assert_true(record.crc_agrees);
	assert_int_equal(record.counters.blocks, 1000);
	assert_int_equal(record.counters.corrupt, 0);
	assert_int_equal(record.flags, 0);
	record_free(&record);
}

static void test_resent_blocks_are_joined(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 7000, 50, 2);
	add_blocks(0, 9);
	add_blocks(20, 49);
	add_end();
	for (uint32_t tick = 10; tick < 20; tick++) {
		add_resent(1, tick);
		add_resent(2, tick);
	}
	add_end(); /* comes every 100 ms until it is accepted */
	hand_fill(&drop, 7050, 3, 3);
	add_blocks(0, 2); /* the stream goes on; outside the window */
	hand_fill(&drop, 7000, 50, 2);
	record = read_log();
	hand_check_samples(&record, &drop, NULL);
	assert_true(record.crc_agrees);
	assert_int_equal(record.counters.gaps, 2);
	assert_int_equal(record.counters.resent, 20);
	assert_int_equal(record.counters.repeated, 0);
	record_free(&record);
}

static struct record read_number(unsigned number)
{
	char *file = hand_file(".log", log_text, log_size), message[READ_MESSAGE_MAX] = "";
	struct record record;

	if (read_nth(&record, file, NULL, number, message))
		fail_msg("%s", message);
	hand_unlink(file);
	return record;
}

static void test_several_drops(void **state)
{
	char message[READ_MESSAGE_MAX] = "";
	struct record record;

	(void)state;
	hand_fill(&drop, 9000, 60, 5);
	drop.drop_id = 4;
	add_blocks(0, 58); /* one tick is lost for good */
	add_end();
	hand_fill(&drop, 12000, 50, 4);
	drop.drop_id = 5;
	add_blocks(0, 49);
	add_end();
	assert_int_equal(read_part(log_size, &record, message), DT_E_ARGUMENT);
	assert_memory_equal(message, ": 2 drops, expected one", 23);
	record = read_number(1);
	assert_int_equal(record.drop_id, 4);
	assert_int_equal(record.log_number, 1);
	assert_int_equal(record.flags, RECORD_FLAG_LOST | RECORD_FLAG_INCOMPLETE);
	assert_int_equal(record.gap_count, 2);
	record_free(&record);
	record = read_number(2);
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.drop_id, 5);
	assert_int_equal(record.log_number, 2);
	assert_int_equal(record.flags, 0);
	record_free(&record);

	/* a capture end without a single block does not hide the drop before it */
	log_size = 0;
	hand_fill(&drop, 7000, 50, 4);
	add_blocks(0, 49);
	add_end();
	hand_fill(&drop, 90000, 60, 5);
	add_end();
	hand_fill(&drop, 7000, 50, 4);
	record = read_log();
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.flags, 0);
	assert_int_equal(record.log_number, 1);
	record_free(&record);
}

static void test_a_truncated_log(void **state)
{
	char message[READ_MESSAGE_MAX];
	size_t before_end;
	struct record record;

	(void)state;
	hand_fill(&drop, 7000, 100, 6);
	add_blocks(0, 99);
	before_end = log_size;
	add_end();

	/* in the middle of a block: what is there, marked */
	assert_int_equal(read_part(before_end / 2 + 30, &record, message), 0);
	assert_int_equal(record.flags & ~(unsigned)RECORD_FLAG_LOST, RECORD_FLAG_NO_CRC);
	assert_int_equal(record.first_tick_ms, 7000);
	assert_int_equal(record.last_tick_ms, 7049);
	assert_int_equal(record.counters.corrupt, 1); /* half a line */
	record_free(&record);
	/* in the middle of the capture end */
	assert_int_equal(read_part(before_end + 60, &record, message), 0);
	assert_int_equal(record.flags, RECORD_FLAG_NO_CRC);
	assert_int_equal(record.counters.blocks, 200);
	record_free(&record);
	/* in the middle of the first line */
	assert_int_equal(read_part(40, &record, message), DT_E_FORMAT);
	assert_memory_equal(message, ":1: ", 4);
	assert_non_null(strstr(message, "expected"));
}

static void test_garbage_is_counted(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 7000, 50, 7);
	add_blocks(0, 20);
	add("(1436509052.249713) can0 nothing\n");
	add("(((((\n");
	add("noise that does not look like a frame\n");
	add_blocks(21, 49);
	add_end();
	record = read_log();
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.counters.corrupt, 2);
	assert_int_equal(record.flags, 0);
	record_free(&record);
}

static void test_refusals(void **state)
{
	char message[READ_MESSAGE_MAX];
	struct record record;

	(void)state;
	add("(1.0) can0 123#1122\n");
	add("(1.1) can0 123#1122\n");
	assert_int_equal(read_part(log_size, &record, message), DT_E_EMPTY);
	assert_string_equal(message, ": no block of a drop tower in 2 frames");
	log_size = 0;
	add("# a comment\n(1.0) can0 12\n(1.0\n");
	assert_int_equal(read_part(log_size, &record, message), DT_E_FORMAT);
	assert_memory_equal(message, ":2: ", 4);
}

static void refuse_file(const char *file, const char *columns, int code, const char *why)
{
	char message[READ_MESSAGE_MAX] = "";
	struct record record;

	assert_int_equal(read_record(&record, file, columns, message), code);
	assert_non_null(strstr(message, why));
	assert_null(strchr(message, '\n'));
}

static void test_files_that_cannot_be_read(void **state)
{
	char *empty = hand_file("", "", 0), name[5000];

	(void)state;
	refuse_file("/nonexistent/drop.log", NULL, DT_E_SYSTEM,
	            "/nonexistent/drop.log: No such file or directory");
	refuse_file("/", NULL, DT_E_SYSTEM, "/: Is a directory");
	refuse_file(empty, NULL, DT_E_EMPTY, ": empty");
	memset(name, 'a', sizeof(name));
	name[sizeof(name) - 1] = '\0';
	refuse_file(name, NULL, DT_E_ARGUMENT, "a: name of 4999 bytes, expected");
	name[4000] = '\0';
	refuse_file(name, NULL, DT_E_SYSTEM, "a: File name too long");
	hand_unlink(empty);
	empty = hand_file("", "(1.0) can0 123#1122\n", 20);
	refuse_file(empty, "time:ms,a:g", DT_E_ARGUMENT, "--columns");
	hand_unlink(empty);
}

/* What we write is what we read. */
static void test_written_again(void **state)
{
	char message[READ_MESSAGE_MAX];
	char *file = hand_file(".log", "", 0);
	struct record record, again;

	(void)state;
	hand_fill(&drop, UINT32_MAX - 20, 60, 8);
	drop.sample[1][30][3] = -32768;
	drop.sample[0][31][9] = 20000;
	drop.marks = 1u << 3 | 1u << 4;
	add_blocks(0, 30);
	add_blocks(33, 59);
	add_end();
	record = read_log();
	assert_int_equal(write_record(&record, file, message), 0);
	assert_int_equal(read_record(&again, file, NULL, message), 0);
	hand_check_equal(&record, &again);
	record_free(&record);
	record_free(&again);
	hand_unlink(file);
}

static void test_damage(void **state)
{
	(void)state;
	hand_fill(&drop, 7000, 40, 9);
	add_blocks(0, 19);
	add_end();
	add_blocks(20, 39);
	add_end();
	hand_fuzz(log_text, log_size, NULL, 41, 300);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(test_a_whole_drop),
	        TEST(test_resent_blocks_are_joined),
	        TEST(test_several_drops),
	        TEST(test_a_truncated_log),
	        TEST(test_garbage_is_counted),
	        TEST(test_refusals),
	        TEST(test_files_that_cannot_be_read),
	        TEST(test_written_again),
	        TEST(test_damage),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
