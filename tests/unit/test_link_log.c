/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Logs as links: what is written comes back, and no file whatever stops the reading before its end.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/link/link.h"
#include "tests/unit/scratch.h"

#define LINE "(1700000000.000001) can0 123#1122\n"

static char path[64], url[80], message[256];

static int set_up(void **state)
{
	int file;

	(void)state;
	file = mkstemp(scratch_name(path, "log"));
	if (file < 0 || close(file) != 0)
		return -1;
	(void)snprintf(url, sizeof(url), "log:%s", path);
	return 0;
}

static int tear_down(void **state)
{
	(void)state;
	return unlink(path);
}

static struct link *open_log(enum link_mode mode)
{
	struct link *link = link_open(url, mode, message, sizeof(message));

	if (link == NULL)
		fail_msg("%s", message);
	return link;
}

static void put_file(const void *bytes, size_t length)
{
	FILE *file = fopen(path, "ae");

	assert_non_null(file);
	assert_int_equal(fwrite(bytes, 1, length, file), length);
	assert_int_equal(fclose(file), 0);
}

static void put_text(const char *text)
{
	put_file(text, strlen(text));
}

static void put_repeated(char c, size_t count)
{
	char *bytes = malloc(count);

	assert_non_null(bytes);
	memset(bytes, c, count);
	put_file(bytes, count);
	free(bytes);
}

/* Reads the whole file: so many frames, so many malformed lines, the last frame in that line. */
static void expect_contents(uint64_t frames, uint64_t malformed)
{
	struct link *link = open_log(LINK_READ);
	struct frame frame;
	uint64_t count = 0;
	int result;

	while ((result = link_receive(link, &frame, -1)) == 1)
		count++;
	assert_int_equal(result, DT_E_CLOSED);
	assert_int_equal(link_receive(link, &frame, 0), DT_E_CLOSED);
	assert_int_equal(count, frames);
	assert_int_equal(link_counters(link)->received, frames);
	assert_int_equal(link_counters(link)->malformed, malformed);
	assert_int_equal(link_close(link), 0);
}

static struct frame numbered(uint32_t n)
{
	struct frame frame = {.time_us = 1700000000000000 + 500 * (int64_t)n,
	                      .id = 0x181,
	                      .flags = FRAME_FD | FRAME_BRS,
	                      .length = 64};

	for (unsigned i = 0; i < frame.length; i++)
		frame.data[i] = (uint8_t)(n >> (i % 4 * 8));
	return frame;
}

static void test_round_trip(void **state)
{
	struct link *link = open_log(LINK_WRITE);
	struct frame frame;

	(void)state;
	for (uint32_t n = 0; n < 5000; n++) {
		frame = numbered(n);
		assert_int_equal(link_send(link, &frame), 0);
	}
	assert_int_equal(link_counters(link)->sent, 5000);
	assert_int_equal(link_close(link), 0);
	link = open_log(LINK_READ);
	for (uint32_t n = 0; n < 5000; n++) {
		struct frame expected = numbered(n);

		memset(&frame, 0x55, sizeof(frame));
		assert_int_equal(link_receive(link, &frame, 0), 1);
		assert_true(frame.time_us == expected.time_us);
		assert_int_equal(frame.id, expected.id);
		assert_int_equal(frame.flags, expected.flags);
		assert_int_equal(frame.length, 64);
		assert_memory_equal(frame.data, expected.data, 64);
	}
	assert_int_equal(link_receive(link, &frame, 0), DT_E_CLOSED);
	assert_int_equal(link_close(link), 0);
}

static void test_writing_appends_and_stamps(void **state)
{
	struct link *link;
	struct frame frame = {.id = 1}, got, negative = {.time_us = -1};
	int64_t before_us = (int64_t)time(NULL) * 1000000;

	(void)state;
	put_text(LINE);
	link = open_log(LINK_WRITE);
	assert_int_equal(link_send(link, &frame), 0);
	assert_int_equal(link_send(link, &negative), DT_E_ARGUMENT);
	assert_int_equal(link_receive(link, &got, 0), DT_E_STATE);
	expect_contents(1, 0);
	assert_int_equal(link_flush(link), 0); /* what was sent is there for others before the end */
	expect_contents(2, 0);
	assert_int_equal(link_close(link), 0);
	expect_contents(2, 0);
	link = open_log(LINK_READ);
	assert_int_equal(link_receive(link, &got, 0), 1);
	assert_int_equal(got.id, 0x123);
	assert_int_equal(link_receive(link, &got, 0), 1);
	assert_int_equal(got.id, 1);
	assert_true(got.time_us >= before_us);
	assert_int_equal(link_send(link, &frame), DT_E_STATE);
	assert_int_equal(link_close(link), 0);
}

static void test_time_zero_is_not_unknown(void **state)
{
	struct link *link;
	struct frame frame;

	(void)state;
	put_text("(0000000000.000000) can0 123#\n");
	link = open_log(LINK_READ);
	assert_int_equal(link_receive(link, &frame, 0), 1);
	assert_true(frame.time_us == 1);
	assert_int_equal(link_close(link), 0);
}

static void test_truncated(void **state)
{
	(void)state;
	put_text(LINE LINE "(1700000000.000001) can0 123#1122");
	expect_contents(3, 0); /* whole, but for its newline */
	assert_int_equal(truncate(path, 2 * (off_t)strlen(LINE) + 32), 0);
	expect_contents(2, 1);
	assert_int_equal(truncate(path, 2 * (off_t)strlen(LINE) + 10), 0);
	expect_contents(2, 1);
	assert_int_equal(truncate(path, 0), 0);
	expect_contents(0, 0);
}

static void test_remarks_are_no_loss(void **state)
{
	(void)state;
	put_text("# a log\n\n" LINE "\r\n  \t\n" LINE "   # more");
	expect_contents(2, 0);
}

static void test_garbage(void **state)
{
	static const char noise[] = "\0\xff\x80(\0\n(1700000000.00\0001) can0 123#\n" LINE "\n)(\n(\n";

	(void)state;
	put_file(noise, sizeof(noise) - 1);
	put_text("hello\n(1.0) can0 999#\n" LINE);
	expect_contents(2, 6);
}

static void test_very_long_lines(void **state)
{
	(void)state;
	put_text(LINE);
	put_repeated('(', 300000);
	put_text("\n" LINE);
	put_repeated('\0', 65536 - 3 * strlen(LINE)); /* the next newline at and about the buffer's end */
	put_text("\n" LINE);
	put_repeated(' ', 65536);
	put_text("\n" LINE);
	expect_contents(4, 3);
	put_repeated('x', 200000); /* and no newline */
	expect_contents(4, 4);
}

/* Random bytes with a good line now and then: all good lines are found. */
static void test_noise_around_lines(void **state)
{
	uint32_t seed = 7;
	uint64_t good = 0, lines = 0;
	FILE *file = fopen(path, "we");

	(void)state;
	print_message("seed %u\n", seed);
	for (unsigned i = 0; i < 2000; i++) {
		seed = seed * 1664525u + 1013904223u;
		if (seed >> 31 != 0) {
			assert_true(fputs(LINE, file) >= 0);
			good++;
			lines++;
			continue;
		}
		(void)fputc('!', file);
		for (uint32_t n = seed >> 22 & 0xFF; n > 0; n--) {
			seed = seed * 1664525u + 1013904223u;
			(void)fputc((int)(seed >> 24) == '\n' ? '.' : (int)(seed >> 24), file);
		}
		(void)fputc('\n', file);
		lines++;
	}
	assert_true(fputs(LINE, file) >= 0);
	assert_int_equal(fclose(file), 0);
	expect_contents(good + 1, lines - good);
}

static void expect_refused(const char *what, enum link_mode mode, const char *reason)
{
	(void)snprintf(message, sizeof(message), "-");
	assert_null(link_open(what, mode, message, sizeof(message)));
	if (strstr(message, reason) == NULL || strncmp(message, what, strlen(what)) != 0 ||
	    strchr(message, '\n') != NULL)
		fail_msg("\"%s\" lacks \"%s\"", message, reason);
}

static void test_refused(void **state)
{
	(void)state;
	expect_refused("log:/nonexistent.log", LINK_READ, "No such file");
	expect_refused("log:/nonexistent/a.log", LINK_WRITE, "No such file");
	expect_refused("log:/tmp", LINK_READ, "directory");
	expect_refused("log:/tmp", LINK_WRITE, "directory");
	expect_refused(url, LINK_READ_WRITE, "not both");
}

static void test_full_disk_is_reported(void **state)
{
	struct link *link;
	struct frame frame = numbered(1);
	int error = 0;

	(void)state;
	if (access("/dev/full", W_OK) != 0)
		skip();
	link = link_open("log:/dev/full", LINK_WRITE, message, sizeof(message));
	assert_non_null(link);
	assert_int_equal(link_send(link, &frame), 0); /* still in the buffer */
	assert_int_equal(link_flush(link), DT_E_SYSTEM);
	assert_int_equal(link_close(link), DT_E_SYSTEM);
	link = link_open("log:/dev/full", LINK_WRITE, message, sizeof(message));
	for (int i = 0; i < 1000 && error == 0; i++)
		error = link_send(link, &frame);
	assert_int_equal(error, DT_E_SYSTEM);
	assert_int_equal(link_counters(link)->send_lost, 1);
	assert_int_equal(link_close(link), DT_E_SYSTEM);
}

/* Copies standard input to standard output, after a mark that it waited for a frame that did not come. */
static void copy_in_child(int input, int output)
{
	struct link *from, *to;
	struct frame frame;
	int result;

	(void)dup2(input, STDIN_FILENO);
	(void)dup2(output, STDOUT_FILENO);
	from = link_open("log:-", LINK_READ, message, sizeof(message));
	to = link_open("log:-", LINK_WRITE, message, sizeof(message));
	if (from == NULL || to == NULL)
		_exit(1);
	if (link_receive(from, &frame, 20) != 0) /* nothing there yet */
		_exit(2);
	if (write(output, "?", 1) != 1)
		_exit(3);
	while ((result = link_receive(from, &frame, 10000)) == 1)
		if (link_send(to, &frame) != 0)
			_exit(4);
	_exit(result == DT_E_CLOSED && link_close(from) == 0 && link_close(to) == 0 ? 0 : 5);
}

static void test_standard_streams(void **state)
{
	int in[2], out[2], status = -1;
	char got[256];
	static const char lines[] = LINE LINE;
	ssize_t n, length = 0;
	pid_t child;

	(void)state;
	assert_int_equal(pipe2(in, O_CLOEXEC), 0);
	assert_int_equal(pipe2(out, O_CLOEXEC), 0);
	child = fork();
	assert_true(child >= 0);
	if (child == 0) {
		(void)close(in[1]);
		copy_in_child(in[0], out[1]);
	}
	(void)close(in[0]);
	(void)close(out[1]);
	assert_true(read(out[0], got, 1) == 1); /* it has waited in vain */
	assert_true(write(in[1], lines, 40) == 40);
	assert_true(write(in[1], lines + 40, sizeof(lines) - 41) == (ssize_t)sizeof(lines) - 41);
	(void)close(in[1]);
	while ((n = read(out[0], got + length, sizeof(got) - (size_t)length)) > 0)
		length += n;
	(void)close(out[0]);
	assert_true(waitpid(child, &status, 0) == child);
	assert_true(WIFEXITED(status));
	assert_int_equal(WEXITSTATUS(status), 0);
	assert_int_equal(length, 2 * strlen(LINE));
	assert_memory_equal(got, LINE LINE, (size_t)length);
}

#define LOG_TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        LOG_TEST(test_round_trip),
	        LOG_TEST(test_writing_appends_and_stamps),
	        LOG_TEST(test_time_zero_is_not_unknown),
	        LOG_TEST(test_truncated),
	        LOG_TEST(test_remarks_are_no_loss),
	        LOG_TEST(test_garbage),
	        LOG_TEST(test_very_long_lines),
	        LOG_TEST(test_noise_around_lines),
	        LOG_TEST(test_refused),
	        LOG_TEST(test_full_disk_is_reported),
	        LOG_TEST(test_standard_streams),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
