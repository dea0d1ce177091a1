/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/join_by_hand.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

struct hand_drop drop;
struct join *join;

int join_by_hand_begin(void **state)
{
	(void)state;
	join = join_create();
	return join ? 0 : -1;
}

int join_by_hand_end(void **state)
{
	(void)state;
	join_destroy(join);
	return 0;
}

void join_by_hand_feed(unsigned sensor, uint32_t tick, bool resent)
{
	struct frame frame;

	hand_block(&drop, sensor, tick, resent, &frame);
	assert_int_equal(join_feed(join, &frame), 0);
}

void join_by_hand_feed_both(uint32_t first, uint32_t last)
{
	for (uint32_t tick = first; tick <= last; tick++) {
		join_by_hand_feed(1, tick, false);
		join_by_hand_feed(2, tick, false);
	}
}

int join_by_hand_feed_end(void)
{
	struct frame frame;

	hand_capture_end(&drop, &frame);
	return join_feed(join, &frame);
}
