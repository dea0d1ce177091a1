/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics_double.h>

#include "host/estimate/median.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

enum { MANY = 3000 };

static double number(struct synth_random *random, int kind, size_t i)
{
	switch (kind) {
	case 0:
		return synth_normal(random);
	case 1:
		return floor(5 * synth_uniform(random)); /* hardly two differ */
	case 2:
		return (double)i; /* in order */
	case 3:
		return -(double)(i % 1000);
	case 4:
		return 3; /* all alike */
	default:
		return synth_uniform(random) < 0.5 ? -1e300 : 1e300 * synth_uniform(random);
	}
}

/* Every small length and some large ones, against sorting. */
static void against_sorting(void **state)
{
	static double value[MANY], sorted[MANY];
	struct synth_random random = {1};

	(void)state;
	for (int kind = 0; kind < 6; kind++) {
		for (size_t n = 1; n < MANY; n += n < 70 ? 1 : 331) {
			for (size_t i = 0; i < n; i++)
				value[i] = number(&random, kind, i);
			memcpy(sorted, value, n * sizeof(*value));
			gsl_sort(sorted, 1, n);
			assert_near_part(median_find(value, n),
			                 gsl_stats_median_from_sorted_data(sorted, 1, n), 1e-15);
			gsl_sort(value, 1, n);
			assert_memory_equal(value, sorted,
			                    n * sizeof(*value)); /* another order, no other numbers */
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(against_sorting)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
