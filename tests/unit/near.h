/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_NEAR_H
#define DT_TESTS_UNIT_NEAR_H
/*
 * Comparing doubles: cmocka's own assertion takes floats. Include cmocka.h first. Prints both values when
 * they differ by more than the tolerance, which is absolute; a NaN is never near.
 */
#include <math.h>

#define assert_near(value, expected, tolerance) \
	near_check((value), (expected), (tolerance), #value, __FILE__, __LINE__)

#define assert_near_part(value, expected, part) \
	near_check((value), (expected), fabs(expected) * (part), #value, __FILE__, __LINE__)

static inline void near_check(double value, double expected, double tolerance, const char *what,
                              const char *file, int line)
{
	if (fabs(value - expected) <= tolerance)
		return;
	print_error("%s = %.12g, expected %.12g +- %.3g\n", what, value, expected, tolerance);
	_fail(file, line);
}

#endif
