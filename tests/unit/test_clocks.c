/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Two towers on a bus are told by their clocks; one that loses, repeats or restarts is not taken for two.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdlib.h>

#include "host/session/clocks.h"

/* Seconds until two clocks so far apart are told, of TIMEs of which one in a hundred x percent is lost; 0:
 * never. */
static unsigned told_after(uint64_t one_ms, uint64_t other_ms, int percent_lost)
{
	struct clocks clocks = {0};

	for (unsigned s = 1; s < 3600; s++) {
		one_ms += 1000;
		other_ms += 1000;
		if (rand() % 100 >= percent_lost)
			clocks_hear(&clocks, (uint32_t)(one_ms % 86400000), (uint16_t)(one_ms / 86400000));
		if (rand() % 100 >= percent_lost)
			clocks_hear(&clocks, (uint32_t)(other_ms % 86400000),
			            (uint16_t)(other_ms / 86400000));
		if (clocks.two)
			return s;
	}
	return 0;
}

static void test_two_clocks(void **state)
{
	(void)state;
	srand(13);
	assert_in_range(told_after(5000, 60000, 0), 3, 5);
	assert_in_range(told_after(60000, 5000, 0), 3, 5);
	assert_in_range(told_after(1000, 5000, 0), 3, 5);
	assert_in_range(told_after(86399000, 5000, 0), 3, 5); /* one of them over midnight */
	for (int i = 0; i < 200; i++)
		assert_in_range(told_after(5000, 60000, 20), 3, 120);
}

static void test_one_clock(void **state)
{
	(void)state;
	srand(14);
	for (int run = 0; run < 200; run++) {
		struct clocks clocks = {0};
		uint64_t time_ms = (uint64_t)(rand() % 1000) * 1000, before_ms = time_ms;

		for (int s = 0; s < 5000; s++) {
			time_ms = rand() % 50 == 0 ? 1000 : time_ms + 1000; /* it starts again */
			if (rand() % 5 == 0)
				continue; /* lost */
			clocks_hear(&clocks, (uint32_t)(time_ms % 86400000), (uint16_t)(time_ms / 86400000));
			if (rand() % 5 == 0) /* twice */
				clocks_hear(&clocks, (uint32_t)(time_ms % 86400000),
				            (uint16_t)(time_ms / 86400000));
			if (rand() % 5 == 0 && before_ms < time_ms && time_ms - before_ms < 3000)
				clocks_hear(&clocks, (uint32_t)(before_ms % 86400000), /* held back */
				            (uint16_t)(before_ms / 86400000));
			before_ms = time_ms;
			assert_false(clocks.two);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_two_clocks),
	        cmocka_unit_test(test_one_clock),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
