/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/local_bus.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/unit/scratch.h"

char bus_folder[64], bus_path[96], bus_url[128], bus_message[256];

int local_bus_set_up(void **state)
{
	(void)state;
	if (mkdtemp(scratch_name(bus_folder, "unix")) == NULL)
		return -1;
	(void)snprintf(bus_path, sizeof(bus_path), "%s/bus", bus_folder);
	(void)snprintf(bus_url, sizeof(bus_url), "unix:%s", bus_path);
	return 0;
}

int local_bus_tear_down(void **state)
{
	(void)state;
	(void)unlink(bus_path);
	return rmdir(bus_folder);
}

struct link *local_bus_join(enum link_mode mode)
{
	struct link *link = link_open(bus_url, mode, bus_message, sizeof(bus_message));

	if (link == NULL)
		fail_msg("%s", bus_message);
	return link;
}

struct frame local_bus_numbered(uint32_t n)
{
	static const struct frame kinds[] = {
	        {.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = 64},
	        {.id = 0x7FF, .flags = 0, .length = 8},
	        {.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED | FRAME_FD | FRAME_ESI, .length = 12},
	        {.id = 0x80, .flags = FRAME_ERROR, .length = 8},
	};
	struct frame frame = kinds[n % 4];

	for (unsigned i = 0; i < frame.length; i++)
		frame.data[i] = (uint8_t)(i < 4 ? n >> (8 * i) : n + i);
	return frame;
}

int local_bus_same(const struct frame *a, const struct frame *b)
{
	return a->id == b->id && a->flags == b->flags && a->length == b->length &&
	       memcmp(a->data, b->data, a->length) == 0;
}

void local_bus_expect(struct link *link, const struct frame *expected)
{
	struct frame frame = {0};

	assert_int_equal(link_receive(link, &frame, WAIT_MS), 1);
	assert_true(local_bus_same(&frame, expected));
	assert_true(frame.time_us > 1600000000000000);
}

void local_bus_expect_nothing(struct link *link)
{
	struct frame frame;

	assert_int_equal(link_receive(link, &frame, 0), 0);
}

void local_bus_serve(struct link *link)
{
	struct frame frame;

	assert_int_equal(link_receive(link, &frame, 0), 0);
}
