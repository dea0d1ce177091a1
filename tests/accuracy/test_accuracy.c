/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The short set: one test for each group of scenes, at 1 g of noise, limits widened by three standard
 * deviations of the Monte Carlo itself. `make accuracy` is the long one.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <gsl/gsl_errno.h>

#include "tests/accuracy/cells.h"
#include "tests/unit/near.h"

enum { DROPS = 300 };

#define SLACK 3

static struct cells cells;

static int setup(void **state)
{
	const struct cells_options options = {.drops = DROPS};

	(void)state;
	gsl_set_error_handler_off();
	cells_run(&options, &cells);
	return 0;
}

static int teardown(void **state)
{
	(void)state;
	cells_free(&cells);
	return 0;
}

static void judge(void **state)
{
	unsigned judged,
	        failed = cells_judge(&cells, *(const enum group *)*state, SLACK, CELLS_FAILURES, &judged);

	assert_true(judged > 0);
	assert_int_equal(failed, 0);
}

int main(void)
{
	static enum group groups[GROUPS];
	struct CMUnitTest tests[GROUPS];

	for (int i = 0; i < GROUPS; i++) {
		groups[i] = (enum group)i;
		tests[i] = (struct CMUnitTest){group_name(groups[i]), judge, NULL, NULL, &groups[i]};
	}
	return cmocka_run_group_tests_name("accuracy", tests, setup, teardown);
}
