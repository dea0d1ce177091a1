/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A row of repeats: tabulated limits of Grubbs, how often they are passed by chance, trend, what stands out.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include "host/result/repeats.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

static void row_of(struct repeats_row *row, const double *value, size_t count)
{
	*row = (struct repeats_row){.count = 0};
	for (size_t i = 0; i < count; i++)
		assert_int_equal(repeats_value(row, i + 1, value[i]), 0);
	repeats_row_close(row);
}

static void grubbs(void **state)
{
	static const struct {
		size_t n;
		double limit;
	} known[] = {{3, 1.154}, {4, 1.481}, {5, 1.715},  {6, 1.887},
	             {7, 2.020}, {8, 2.127}, {10, 2.290}, {20, 2.708}};

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]);
	     i++) /* the last digit is cut, not rounded, at 3 */
		assert_near(repeats_grubbs(known[i].n, (double)known[i].n - 1, 0.05), known[i].limit,
		            0.00051);
	/* no value of n is further from their mean than this: 1.789 of five */
	assert_near(4 / sqrt(5), 1.789, 0.0005);
	assert_true(repeats_grubbs(5, 4, 1e-9) < 4 / sqrt(5));
	/* scatter that is known well: the normal law's alpha / 2n */
	assert_near(repeats_grubbs(5, 1e7, 0.05), 2.5758 * sqrt(0.8), 1e-3);
	/* beside two that are equal the worst of five is sqrt(0.8 * 5) of that scatter away: it is still
	 * found */
	assert_true(repeats_grubbs(5, 5, 0.05) < 2);
}

/* Five of a normal law with one 5 and 8 sigma off: own scatter finds 38 and 77 %, a scatter known of 40 more
 * far more; and none off, 5 % are marked by either. */
static void power(void **state)
{
	static const double off[] = {0, 5, 8}, own_percent[] = {5, 38, 77};
	struct synth_random random = {3};

	(void)state;
	for (int k = 0; k < 3; k++) {
		int own = 0, pooled = 0, draws = 4000;

		for (int n = 0; n < draws; n++) {
			double x[5], mean = 0, most = 0, squares = 0, known = 0;

			for (int i = 0; i < 5; i++)
				mean += (x[i] = synth_normal(&random) + (i == 2 ? off[k] : 0)) / 5;
			for (int i = 0; i < 5; i++) {
				squares += pow(x[i] - mean, 2);
				most = fmax(most, fabs(x[i] - mean));
			}
			for (int i = 0; i < 40; i++)
				known += pow(synth_normal(&random), 2);
			own += most > repeats_grubbs(5, 4, 0.05) * sqrt(squares / 4);
			pooled += most > repeats_grubbs(5, 44, 0.05) * sqrt((squares + known) / 44);
		}
		assert_near(100.0 * own / draws, own_percent[k], 2.5);
		assert_true(k == 0 ? fabs(100.0 * pooled / draws - 5) < 1.5 : pooled > 0.95 * draws);
	}
}

static void told(void **state)
{
	static const double level[] = {10.1, 9.9, 10.05, 9.95, 10, 14, 10.02, 9.97, 10.04},
	                    counted[] = {8, 8, 8, 8.001, 8}, rising[] = {1, 2.01, 2.99, 4.02, 5, 5.98};
	char words[REPEATS_WORDS_MAX];
	struct repeats_row row;

	(void)state;
	row_of(&row, level, 9);
	assert_int_equal(row.stands_out, 6);
	assert_int_equal(row.count, 9); /* it is marked, not taken out */
	assert_near(row.mean, 94.03 / 9, 1e-9);
	repeats_words(&row, words);
	assert_string_equal(words, "no trend; repeat 6 stands out");
	repeats_row_free(&row);
	row_of(&row, counted, 5);
	assert_int_equal(row.stands_out, 0);
	repeats_row_free(&row);
	row_of(&row, rising, 6);
	assert_int_equal(row.stands_out, 0);
	assert_true(row.moves);
	assert_near(row.from, 1.0071429, 1e-6); /* by least squares on paper: slope 17.45 / 17.5 */
	assert_near(row.to, 5.9928571, 1e-6);
	repeats_words(&row, words);
	assert_string_equal(words, "rises");
	repeats_row_free(&row);
	row_of(&row, rising, 2);
	assert_near(row.to, 2.01, 1e-12);
	assert_true(isnan(row.trend));
	repeats_row_free(&row);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(grubbs), cmocka_unit_test(power),
	                                   cmocka_unit_test(told)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
