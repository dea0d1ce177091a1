/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * SLCAN: lines written by hand, what comes of noise, and an adapter played on the far end of a
 * pseudo-terminal.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/link/link.h"
#include "common/link/slcan_text.h"
#include "tests/unit/interrupted.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))
#define WAIT_MS 10000

static const struct {
	const char *line;
	struct frame frame;
} vectors[] = {
        {"t1230\r", {0, 0x123, 0, 0, {0}}},
        {"t7FF81122334455667788\r", {0, 0x7FF, 0, 8, {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88}}},
        {"T1FFFFFFF2AB0C\r", {0, 0x1FFFFFFF, FRAME_EXTENDED, 2, {0xAB, 0x0C}}},
        {"r1234\r", {0, 0x123, FRAME_REMOTE, 4, {0}}},
        {"R000001230\r", {0, 0x123, FRAME_REMOTE | FRAME_EXTENDED, 0, {0}}},
        {"d181155\r", {0, 0x181, FRAME_FD, 1, {0x55}}},
        {"D000001810\r", {0, 0x181, FRAME_FD | FRAME_EXTENDED, 0, {0}}},
        {"b1819000102030405060708090A0B\r",
         {0, 0x181, FRAME_FD | FRAME_BRS, 12, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}}},
        {"B12345678A000102030405060708090A0B0C0D0E0F\r",
         {0,
          0x12345678,
          FRAME_FD | FRAME_BRS | FRAME_EXTENDED,
          16,
          {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}}},
};

/* Decodes length bytes; the last result that was not 0, how many there were in *count. */
static int decode(struct slcan_decoder *decoder, const char *text, size_t length, struct frame *frame,
                  int *count)
{
	int last = 0;

	*count = 0;
	for (size_t i = 0; i < length; i++) {
		int result = slcan_decode(decoder, text[i], frame);

		if (result == 0)
			continue;
		last = result;
		(*count)++;
	}
	return last;
}

static void check_equal(const struct frame *a, const struct frame *b)
{
	assert_int_equal(a->id, b->id);
	assert_int_equal(a->flags, b->flags);
	assert_int_equal(a->length, b->length);
	if ((a->flags & FRAME_REMOTE) == 0)
		assert_memory_equal(a->data, b->data, a->length);
}

static void test_vectors_both_ways(void **state)
{
	struct slcan_decoder decoder = {0};

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		char line[SLCAN_LINE_MAX];
		size_t length = slcan_encode(line, &vectors[i].frame);
		struct frame frame;
		int count;

		assert_int_equal(length, strlen(vectors[i].line));
		assert_memory_equal(line, vectors[i].line, length);
		assert_int_equal(decode(&decoder, line, length, &frame, &count), 1);
		assert_int_equal(count, 1);
		check_equal(&frame, &vectors[i].frame);
	}
}

static void test_length_codes(void **state)
{
	static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
	struct slcan_decoder decoder = {0};

	(void)state;
	for (size_t code = 0; code < 16; code++) {
		struct frame frame = {.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = lengths[code]},
		             back;
		char line[SLCAN_LINE_MAX];
		size_t length;
		int count;

		memset(frame.data, 0xC3, sizeof(frame.data));
		length = slcan_encode(line, &frame);
		assert_int_equal(length, 6 + 2 * lengths[code]);
		assert_int_equal(line[4], "0123456789ABCDEF"[code]);
		assert_int_equal(decode(&decoder, line, length, &back, &count), 1);
		check_equal(&back, &frame);
		line[0] = 't'; /* classic has no codes above 8 */
		assert_int_equal(decode(&decoder, line, length, &back, &count), code <= 8 ? 1 : DT_E_FORMAT);
	}
}

static void test_not_carried(void **state)
{
	struct frame report = {.id = 0x80, .flags = FRAME_ERROR, .length = 8};
	struct frame passive = {.id = 0x181, .flags = FRAME_FD | FRAME_ESI, .length = 0};
	char line[SLCAN_LINE_MAX];

	(void)state;
	assert_int_equal(slcan_encode(line, &report), 0);
	assert_int_equal(slcan_encode(line, &passive), 6);
	assert_memory_equal(line, "d1810\r", 6);
}

/* Answers pass by, faults are told once a line, and the next line is good again. */
static void test_streams(void **state)
{
	static const struct {
		const char *text;
		int frames, faults;
	} cases[] = {
	        {"\r\r\a\az\rZ\r\n\r", 0, 0},
	        {"\rt1230\r\rz\rt1230\rZ\r", 2, 0},
	        {"t1230\r\nt1230\r\n", 2, 0},
	        {"t12301F3A\rb18111155FFFF\r", 1, 1},
	        {"t1230ABCD\rr1231ABCD\rd181155ABCD\r", 3, 0},
	        {"t1230ABC\rt1230ABCDE\rt1230\r", 1, 2},
	        {"30\rt1230\r", 1, 1},
	        {"xxt1230\rt1230\r", 1, 1},
	        {"t800 0\rt8000\rT200000000\rt12G0\rt1239\rt12\rt\rt12311G\rq1230\rd1239\rt1230\r", 1, 10},
	        {"t1231\at1230\r", 1, 1},
	        {"V1013\rt1230\r", 1, 1},
	};

	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		struct slcan_decoder decoder = {0};
		int frames = 0, faults = 0;
		struct frame frame;

		for (const char *p = cases[i].text; *p != '\0'; p++) {
			int result = slcan_decode(&decoder, *p, &frame);

			frames += result == 1;
			faults += result == DT_E_FORMAT;
		}
		if (frames != cases[i].frames || faults != cases[i].faults)
			fail_msg("case %zu: %d frames and %d faults", i, frames, faults);
	}
}

static void test_endless_line(void **state)
{
	struct slcan_decoder decoder = {0};
	struct frame frame = {.id = 5};
	int count;

	(void)state;
	for (unsigned i = 0; i < 100000; i++)
		assert_int_equal(slcan_decode(&decoder, i == 0 ? 't' : '1', &frame), 0);
	assert_int_equal(slcan_decode(&decoder, '\r', &frame), DT_E_FORMAT);
	assert_int_equal(frame.id, 5);
	assert_int_equal(decode(&decoder, "t1230\r", 6, &frame, &count), 1);
}

static void test_noise(void **state)
{
	static const char alphabet[] = "tTrRdDbBzZ0123456789ABCDEFabcdef\r\r\r\a\n\xff";
	struct slcan_decoder decoder = {0};
	uint32_t seed = 99;
	unsigned accepted = 0;

	(void)state;
	print_message("seed %u\n", seed);
	for (unsigned i = 0; i < 1000000; i++) {
		struct frame frame, back;
		char line[SLCAN_LINE_MAX];
		size_t length;
		int count;
		struct slcan_decoder second = {0};

		seed = seed * 1664525u + 1013904223u;
		if (slcan_decode(&decoder, alphabet[(seed >> 16) % (sizeof(alphabet) - 1)], &frame) != 1)
			continue;
		accepted++;
		assert_true(frame.id <= ((frame.flags & FRAME_EXTENDED) != 0 ? 0x1FFFFFFFu : 0x7FFu));
		length = slcan_encode(line, &frame);
		assert_int_equal(decode(&second, line, length, &back, &count), 1);
		check_equal(&back, &frame);
	}
	assert_true(accepted > 10);
}

/* ---- over a pseudo-terminal ------------------------------------------------------------------------- */

static int adapter = -1;
static char url[128], message[256];
static struct link *line;

/* Exactly length bytes, and a NUL; false if they do not come. */
static bool read_adapter(char *text, size_t length)
{
	struct pollfd entry = {.fd = adapter, .events = POLLIN};
	size_t got = 0;

	while (got < length && poll(&entry, 1, WAIT_MS) == 1) {
		ssize_t n = read(adapter, text + got, length - got);

		if (n <= 0)
			break;
		got += (size_t)n;
	}
	text[got] = '\0';
	return got == length;
}

static bool is_silent(void)
{
	struct pollfd entry = {.fd = adapter, .events = POLLIN};

	return poll(&entry, 1, 0) == 0;
}

static void say(const char *text)
{
	assert_true(write(adapter, text, strlen(text)) == (ssize_t)strlen(text));
}

static int plug_in(void **state)
{
	char text[64];

	(void)state;
	adapter = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
	if (adapter < 0 || grantpt(adapter) != 0 || unlockpt(adapter) != 0)
		return -1;
	(void)snprintf(url, sizeof(url), "slcan:%s@115200", ptsname(adapter));
	line = link_open(url, LINK_READ_WRITE, message, sizeof(message));
	return line == NULL || !read_adapter(text, 10) || strcmp(text, "C\rS8\rY5\rO\r") != 0;
}

static int unplug(void **state)
{
	char text[64];
	int error = line != NULL ? link_close(line) : 0;

	(void)state;
	line = NULL;
	if (adapter >= 0 && (!read_adapter(text, 2) || strcmp(text, "C\r") != 0))
		error = -1;
	if (adapter >= 0)
		(void)close(adapter);
	adapter = -1;
	return error;
}

static void test_line_out(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		char text[256];

		assert_int_equal(link_send(line, &vectors[i].frame), 0);
		assert_true(read_adapter(text, strlen(vectors[i].line)));
		assert_string_equal(text, vectors[i].line);
	}
	assert_int_equal(link_send(line, &(struct frame){.flags = FRAME_ERROR, .length = 8}), DT_E_ARGUMENT);
	assert_int_equal(link_counters(line)->sent, COUNT(vectors));
}

static void test_line_in_split(void **state)
{
	struct frame frame;

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		size_t length = strlen(vectors[i].line);

		for (size_t k = 0; k < length; k++) {
			char piece[2] = {vectors[i].line[k], '\0'};

			assert_int_equal(link_receive(line, &frame, 0), 0);
			say(piece);
		}
		assert_int_equal(link_receive(line, &frame, WAIT_MS), 1);
		check_equal(&frame, &vectors[i].frame);
		assert_true(frame.time_us > 1600000000000000);
	}
	assert_int_equal(link_counters(line)->malformed, 0);
}

static void test_line_in_bursts(void **state)
{
	struct frame frame;

	(void)state;
	assert_int_equal(link_receive(line, &frame, 0), 0);
	say("z\rt1230\rgarbage\rt1240\r\at12");
	for (uint32_t id = 0x123; id <= 0x124; id++) {
		assert_int_equal(link_receive(line, &frame, WAIT_MS), 1);
		assert_int_equal(frame.id, id);
	}
	assert_int_equal(link_receive(line, &frame, 0), 0);
	say("50\r");
	assert_int_equal(link_receive(line, &frame, WAIT_MS), 1);
	assert_int_equal(frame.id, 0x125);
	assert_int_equal(link_counters(line)->malformed, 1);
	assert_int_equal(link_counters(line)->received, 3);
}

/* Nobody takes the bytes: full is told, whole lines come out afterwards, none twice. */
static void test_adapter_that_does_not_read(void **state)
{
	struct frame frame = {.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = 64};
	struct slcan_decoder decoder = {0};
	char text[4096];
	unsigned sent = 0, got = 0;
	int error;

	(void)state;
	while ((error = link_send(line, &frame)) == 0)
		frame.data[0] = (uint8_t)++sent;
	assert_int_equal(error, DT_E_FULL);
	assert_int_equal(link_counters(line)->send_lost, 1);
	for (unsigned i = 0; i < WAIT_MS && got < sent; i++) {
		ssize_t length = 0;

		assert_int_equal(link_receive(line, &frame, 1), 0); /* goes on writing */
		if (!is_silent())
			length = read(adapter, text, sizeof(text));
		for (ssize_t k = 0; k < length; k++) {
			int result = slcan_decode(&decoder, text[k], &frame);

			assert_true(result >= 0);
			if (result == 1)
				assert_int_equal(frame.data[0], (uint8_t)got++);
		}
	}
	assert_int_equal(got, sent);
	assert_int_equal(link_send(line, &vectors[0].frame), 0);
	assert_true(read_adapter(text, strlen(vectors[0].line)));
	assert_string_equal(text, vectors[0].line);
}

static void test_timeout_under_interrupts(void **state)
{
	(void)state;
	interrupted_receive(line);
}

static void test_unplugged(void **state)
{
	struct frame frame = {.id = 1};

	(void)state;
	assert_int_equal(plug_in(NULL), 0);
	(void)close(adapter);
	adapter = -1;
	assert_int_equal(link_receive(line, &frame, WAIT_MS), DT_E_LINK);
	assert_int_equal(link_send(line, &frame), DT_E_LINK);
	assert_int_not_equal(link_close(line), 0);
	line = NULL;
}

static void expect_refused(const char *what, const char *reason)
{
	(void)snprintf(message, sizeof(message), "-");
	assert_null(link_open(what, LINK_READ_WRITE, message, sizeof(message)));
	if (strstr(message, reason) == NULL || strncmp(message, what, strlen(what)) != 0)
		fail_msg("\"%s\" lacks \"%s\"", message, reason);
}

static void test_refused(void **state)
{
	(void)state;
	expect_refused("slcan:/nonexistent", "No such file");
	expect_refused("slcan:/dev/null", "not a serial line");
	expect_refused("slcan:/dev/null@12345", "not a known line speed");
	expect_refused("slcan:/dev/null@", "not a known line speed");
	expect_refused("slcan:/dev/null@115200x", "not a known line speed");
}

#define LINE_TEST(f) cmocka_unit_test_setup_teardown(f, plug_in, unplug)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_vectors_both_ways),
	        cmocka_unit_test(test_length_codes),
	        cmocka_unit_test(test_not_carried),
	        cmocka_unit_test(test_streams),
	        cmocka_unit_test(test_endless_line),
	        cmocka_unit_test(test_noise),
	        LINE_TEST(test_line_out),
	        LINE_TEST(test_line_in_split),
	        LINE_TEST(test_line_in_bursts),
	        LINE_TEST(test_adapter_that_does_not_read),
	        LINE_TEST(test_timeout_under_interrupts),
	        cmocka_unit_test(test_unplugged),
	        cmocka_unit_test(test_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
