/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "host/estimate/gram.h"
#include "tests/unit/near.h"

enum { SIZES = 3, ROWS_MAX = 9 };

/* Small whole numbers: every sum is exact, whatever its order. */
static double number(unsigned row, unsigned column)
{
	return (double)((7 * row + 5 * column * column + 3) % 11) - 5;
}

/* Products of columns, one by one. */
static double product(unsigned rows, unsigned a, unsigned b)
{
	double sum = 0;

	for (unsigned k = 0; k < rows; k++)
		sum += number(k, a) * number(k, b);
	return sum;
}

static void compare(unsigned size, unsigned rows)
{
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, squares = 100;
	struct gram gram;

	normal[size - 1][0] = 1;
	right[0] = -2;
	gram_start(&gram, size);
	for (unsigned k = 0; k < rows; k++) {
		double row[GRAM_MAX];

		for (unsigned i = 0; i <= size; i++)
			row[i] = number(k, i);
		gram_add(&gram, row);
	}
	assert_int_equal(gram_finish(&gram, normal, right, &squares), rows);
	for (unsigned i = 0; i < size; i++) {
		for (unsigned j = 0; j < size; j++)
			assert_near(normal[i][j],
			            (j <= i ? product(rows, i, j) : 0) + (i == size - 1 && j == 0), 0);
		assert_near(right[i], product(rows, i, size) - (i == 0 ? 2 : 0), 0);
	}
	assert_near(squares, 100 + product(rows, size, size), 0);
}

/* Added to what was there; also where rows do not fill the lanes, and where there are none. */
static void sums(void **state)
{
	static const unsigned size[SIZES] = {1, 5, CHOLESKY_MAX};

	(void)state;
	for (unsigned i = 0; i < SIZES; i++)
		for (unsigned rows = 0; rows <= ROWS_MAX; rows++)
			compare(size[i], rows);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(sums)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
