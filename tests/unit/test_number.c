/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The shortest form of a number against printf and strtod asked for one digit more each time.
 */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/base/number.h"
#include "tests/unit/synth.h"

static void check(double value, int least)
{
	char text[NUMBER_CHARS], expected[NUMBER_CHARS];

	for (int digits = least; digits <= 17; digits++) {
		snprintf(expected, sizeof(expected), "%.*g", digits, value);
		if (strtod(expected, NULL) == value)
			break;
	}
	memset(text, '#', sizeof(text));
	number_format(text, value, least);
	if (strcmp(text, expected) != 0)
		fail_msg("%a from %d digits: %s, expected %s", value, least, text, expected);
}

static void check_around(double value)
{
	static const int least[] = {1, 6, 15, 16, 17};

	for (size_t i = 0; i < sizeof(least) / sizeof(least[0]); i++) {
		check(value, least[i]);
		check(-value, least[i]);
		check(nextafter(value, INFINITY), least[i]);
		check(nextafter(value, 0), least[i]);
	}
}

static void edges(void **state)
{
	static const double value[] = {
	        0,         1,        9.5,   0.1,  0.3,  1e-4,   9.9999e-5, 99999.95,       123456,
	        999999.5,  1e15,     1e16,  1e17, 1e22, 5e-324, 1e-308,    2.2250739e-308, 1.7e308,
	        0x1p-1022, 0x1p1023, 0x1p53};

	(void)state;
	for (size_t i = 0; i < sizeof(value) / sizeof(value[0]); i++)
		check_around(value[i]);
	for (int power = -1070; power < 1023; power += 3)
		check_around(ldexp(1, power));
	for (int power = -320; power < 309; power++)
		check_around(pow(10, power));
}

/* Any bits; few digits, whose neighbours are the hard ones; halves of the last place asked for. */
static void any(void **state)
{
	struct synth_random random = {1};

	(void)state;
	for (int i = 0; i < 20000; i++) {
		double value = ldexp(synth_uniform(&random), (int)(2000 * synth_uniform(&random)) - 1000);

		check(value, 15);
		check(value, 6);
		check((double)(int64_t)(1e6 * synth_uniform(&random)) / 64, 6);
		check((double)(int64_t)(1e6 * synth_uniform(&random)) / 1e3, 15);
		check(synth_uniform(&random) * 1e3, 15);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(edges),
	        cmocka_unit_test(any),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
