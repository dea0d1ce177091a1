/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * SocketCAN as far as it goes without a CAN interface: the bytes of the kernel's structs by hand, and what
 * opening says when it cannot. The sockets themselves are tested where a kernel has them.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/link/link.h"
#include "common/link/socketcan.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* Kernel struct: id with flags in the upper three bits, length, FD flags, two bytes unused, data. */
static const struct {
	struct frame frame;
	uint32_t can_id;
	uint8_t len, flags;
	int size;
} cases[] = {
        {{.id = 0x123, .length = 3, .data = {1, 2, 3}}, 0x123, 3, 0, 16},
        {{.id = 0x7FF, .length = 0}, 0x7FF, 0, 0, 16},
        {{.id = 0x123, .flags = FRAME_EXTENDED, .length = 8, .data = {9}}, 0x80000123, 8, 0, 16},
        {{.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED, .length = 1, .data = {9}}, 0x9FFFFFFF, 1, 0, 16},
        {{.id = 0x123, .flags = FRAME_REMOTE, .length = 5}, 0x40000123, 5, 0, 16},
        {{.id = 0x123, .flags = FRAME_REMOTE | FRAME_EXTENDED, .length = 0}, 0xC0000123, 0, 0, 16},
        {{.id = 0x181, .flags = FRAME_FD, .length = 8, .data = {7}}, 0x181, 8, 0, 72},
        {{.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = 64, .data = {7, 8}}, 0x181, 64, 1, 72},
        {{.id = 0x181, .flags = FRAME_FD | FRAME_ESI, .length = 12, .data = {7, 8}}, 0x181, 12, 2, 72},
        {{.id = 1, .flags = FRAME_FD | FRAME_BRS | FRAME_ESI | FRAME_EXTENDED, .length = 48},
         0x80000001,
         48,
         3,
         72},
};

static void test_to_the_kernel_and_back(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		struct canfd_frame kernel;
		struct frame back;

		memset(&kernel, 0xEE, sizeof(kernel));
		assert_int_equal(socketcan_pack(&kernel, &cases[i].frame), cases[i].size);
		assert_int_equal(kernel.can_id, cases[i].can_id);
		assert_int_equal(kernel.len, cases[i].len);
		assert_int_equal(kernel.flags, cases[i].flags);
		assert_int_equal(kernel.__res0, 0);
		assert_int_equal(kernel.__res1, 0);
		assert_memory_equal(kernel.data, cases[i].frame.data, sizeof(kernel.data));
		memset(&back, 0xEE, sizeof(back));
		assert_int_equal(socketcan_unpack(&back, &kernel, (size_t)cases[i].size), 0);
		assert_memory_equal(&back, &cases[i].frame, sizeof(back));
	}
}

/* The kernel adds the FDF flag to what it delivers; other flags are not ours. */
static void test_kernel_flags(void **state)
{
	struct canfd_frame kernel = {.can_id = 0x181, .len = 1, .flags = 5};
	struct frame frame;

	(void)state;
	assert_int_equal(socketcan_unpack(&frame, &kernel, CANFD_MTU), 0);
	assert_int_equal(frame.flags, FRAME_FD | FRAME_BRS);
	kernel.flags = 0xF6;
	assert_int_equal(socketcan_unpack(&frame, &kernel, CANFD_MTU), 0);
	assert_int_equal(frame.flags, FRAME_FD | FRAME_ESI);
	kernel.flags = 3; /* padding in a classic frame */
	assert_int_equal(socketcan_unpack(&frame, &kernel, CAN_MTU), 0);
	assert_int_equal(frame.flags, 0);
}

static void test_error_reports(void **state)
{
	struct canfd_frame kernel = {.can_id = 0x20000040, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
	struct frame frame, report = {.id = 0x40, .flags = FRAME_ERROR, .length = 8};

	(void)state;
	assert_int_equal(socketcan_unpack(&frame, &kernel, CAN_MTU), 0);
	assert_int_equal(frame.flags, FRAME_ERROR);
	assert_int_equal(frame.id, 0x40);
	assert_int_equal(frame.length, 8);
	assert_memory_equal(frame.data, kernel.data, 8);
	assert_int_equal(socketcan_pack(&kernel, &report), DT_E_ARGUMENT);
	assert_int_equal(kernel.can_id, 0x20000040);
}

static void test_refused_frames(void **state)
{
	struct frame frame = {.id = 77}, before = frame;
	struct canfd_frame kernel = {.can_id = 0x123, .len = 8};

	(void)state;
	assert_int_equal(socketcan_unpack(&frame, &kernel, 0), DT_E_FORMAT);
	assert_int_equal(socketcan_unpack(&frame, &kernel, 15), DT_E_FORMAT);
	assert_int_equal(socketcan_unpack(&frame, &kernel, 71), DT_E_FORMAT);
	kernel.len = 9;
	assert_int_equal(socketcan_unpack(&frame, &kernel, CAN_MTU), DT_E_FORMAT);
	assert_int_equal(socketcan_unpack(&frame, &kernel, CANFD_MTU), DT_E_FORMAT);
	kernel.len = 65;
	assert_int_equal(socketcan_unpack(&frame, &kernel, CANFD_MTU), DT_E_FORMAT);
	kernel = (struct canfd_frame){.can_id = 0x800, .len = 1};
	assert_int_equal(socketcan_unpack(&frame, &kernel, CAN_MTU), DT_E_FORMAT);
	kernel = (struct canfd_frame){.can_id = 0x40000123, .len = 8};
	assert_int_equal(socketcan_unpack(&frame, &kernel, CANFD_MTU), DT_E_FORMAT);
	assert_memory_equal(&frame, &before, sizeof(frame));
}

static bool kernel_has_can(void)
{
	int descriptor = socket(PF_CAN, SOCK_RAW, CAN_RAW);

	if (descriptor >= 0)
		(void)close(descriptor);
	return descriptor >= 0;
}

static void expect_refused(const char *url, const char *reason)
{
	char message[256] = "-";

	assert_null(link_open(url, LINK_READ_WRITE, message, sizeof(message)));
	if (strstr(message, reason) == NULL || strncmp(message, url, strlen(url)) != 0 ||
	    strchr(message, '\n') != NULL)
		fail_msg("\"%s\" lacks \"%s\"", message, reason);
}

static void test_open_says_why_not(void **state)
{
	bool has_can = kernel_has_can();

	(void)state;
	expect_refused("can:", "expected");
	expect_refused("can:averyverylongname", "at most 15");
	expect_refused("can:none99", has_can ? "no such interface, expected one of:" : "no SocketCAN");
	expect_refused("can:lo", has_can ? "not a CAN interface" : "can-raw");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_to_the_kernel_and_back), cmocka_unit_test(test_kernel_flags),
	        cmocka_unit_test(test_error_reports),          cmocka_unit_test(test_refused_frames),
	        cmocka_unit_test(test_open_says_why_not),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
