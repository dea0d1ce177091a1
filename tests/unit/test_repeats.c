/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A row of repeats: tabulated limits of Grubbs, of steps and of control charts, how often they are passed by
 * chance, trend, what stands out.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* Of a normal law with one 5 and 8 sigma off: of five own scatter finds 38 and 77 %, of ten 77 and 99.7 %, a
 * scatter known of 40 more far more; and none off, 5 % are marked by either. */
static void power(void **state)
{
	static const double off[] = {0, 5, 8}, own_percent[2][3] = {{5, 38, 77}, {5, 77, 99.7}};
	enum { DRAWS = 4000 };
	struct synth_random random = {3};

	(void)state;
	for (int k = 0; k < 6; k++) {
		size_t count = k < 3 ? 5 : 10;
		double degrees = (double)count - 1;
		int own = 0, pooled = 0;

		for (int n = 0; n < DRAWS; n++) {
			double x[10], mean = 0, most = 0, squares = 0, known = 0;

			for (size_t i = 0; i < count; i++)
				mean += (x[i] = synth_normal(&random) + (i == 2 ? off[k % 3] : 0)) /
				        (double)count;
			for (size_t i = 0; i < count; i++) {
				squares += pow(x[i] - mean, 2);
				most = fmax(most, fabs(x[i] - mean));
			}
			for (int i = 0; i < 40; i++)
				known += pow(synth_normal(&random), 2);
			own += most > repeats_grubbs(count, degrees, 0.05) * sqrt(squares / degrees);
			pooled += most > repeats_grubbs(count, degrees + 40, 0.05) *
			                         sqrt((squares + known) / (degrees + 40));
		}
		assert_near(100.0 * own / DRAWS, own_percent[k / 3][k % 3], k == 5 ? 0.35 : 2.5);
		assert_true(k % 3 == 0 ? fabs(100.0 * pooled / DRAWS - 5) < 1.5 : pooled > 0.95 * DRAWS);
	}
}

/* ---- steps and charts ---- */

static void row_of_chance(struct repeats_row *row, struct synth_random *random, size_t count)
{
	*row = (struct repeats_row){.count = 0};
	for (size_t i = 0; i < count; i++)
		assert_int_equal(repeats_value(row, i + 1, synth_normal(random)), 0);
	repeats_row_close(row);
}

static int by_size(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* The largest t of normal series: 5 % and 1 % of them are beyond these, by two million series each elsewhere
 * (30 10^6 / n of the longer), and so many steps are told as are beyond the second. */
static void step_limits(void **state)
{
	static const struct {
		size_t n;
		double five, one;
	} known[] = {{8, 3.623, 5.206}, {10, 3.458, 4.726}, {20, 3.194, 4.004}, {51, 3.121, 3.742}};
	enum { DRAWS = 12000 };
	struct synth_random random = {5};
	double *t = malloc(DRAWS * sizeof(*t));

	(void)state;
	assert_non_null(t);
	for (size_t k = 0; k < sizeof(known) / sizeof(known[0]); k++) {
		unsigned told = 0, beyond = 0;

		assert_near(repeats_step_limit(known[k].n), known[k].one, 0.006);
		for (int i = 0; i < DRAWS; i++) {
			struct repeats_row row;

			row_of_chance(&row, &random, known[k].n);
			t[i] = row.step_t;
			told += row.change_at > 0;
			beyond += row.beyond > 0;
			repeats_row_free(&row);
		}
		qsort(t, DRAWS, sizeof(*t), by_size);
		print_message("seed 5, n %zu: 5 %% beyond %.2f, step told in %.2f %%, a value beyond the "
		              "chart in %.1f %%\n",
		              known[k].n, t[DRAWS * 95 / 100], 100.0 * told / DRAWS, 100.0 * beyond / DRAWS);
		assert_near(t[DRAWS * 95 / 100], known[k].five, 0.05);
		assert_near(100.0 * told / DRAWS, 1, 0.3); /* a line that fits better takes some */
	}
	free(t);
	assert_near(repeats_step_limit(30), 3.839, 0.02);
	assert_near(repeats_step_limit(200), 3.714, 0.02);
}

/* mean +- 2.66 MR, 3.267 MR: by hand; and one in 370 by chance, of values one sigma off one in 44. */
static void chart(void **state)
{
	static const double x[] = {10, 12, 11, 14, 13, 12, 30, 11};
	enum { DRAWS = 100000 };
	struct synth_random random = {11};
	unsigned off = 0;
	struct repeats_row row;

	(void)state;
	row_of(&row, x, 8); /* mean 14.125, steps 2 1 3 1 1 18 19: 45 / 7 */
	assert_near(row.low, 14.125 - 2.66 * 45 / 7, 0.01);
	assert_near(row.high, 14.125 + 2.66 * 45 / 7, 0.01);
	assert_near(row.step, 3.267 * 45 / 7, 0.005);
	assert_int_equal(row.beyond, 0);
	assert_int_equal(row.steps, 0);
	repeats_row_free(&row);
	row_of_chance(&row, &random, DRAWS);
	assert_near(row.high - row.mean, 3, 0.02);
	assert_near(row.step, 3.267 * 2 / sqrt(3.14159265), 0.025);
	for (size_t i = 0; i < DRAWS; i++)
		off += row.value[i] + 1 > row.high || row.value[i] + 1 < row.low;
	assert_near((double)DRAWS / row.beyond, 370, 370 * 4 / sqrt(270));
	assert_near((double)DRAWS / off, 44, 44 * 4 / sqrt(2270));
	assert_near(100.0 * row.steps / DRAWS, 0.91, 0.15); /* P(|x - y| > 3.267 2 / sqrt(pi)) */
	repeats_row_free(&row);
}

/* A step of 3 sigma in the midst of ten and near the end of twenty; a count's last digit is none. */
static void steps(void **state)
{
	static const double counted[] = {8, 8, 8, 8, 8, 8.001, 8.001, 8.001};
	struct synth_random random = {17};
	int midst = 0, late = 0, draws = 500;
	struct repeats_row row;

	(void)state;
	for (int k = 0; k < draws; k++) {
		double x[20], y[20];

		for (int i = 0; i < 20; i++) {
			x[i] = synth_normal(&random) + (i >= 5 ? 3 : 0);
			y[i] = synth_normal(&random) + (i >= 16 ? 3 : 0);
		}
		row_of(&row, x, 10);
		midst += row.change_at >= 5 && row.change_at <= 7;
		repeats_row_free(&row);
		row_of(&row, y, 20);
		late += row.change_at >= 16 && row.change_at <= 18;
		repeats_row_free(&row);
	}
	print_message("seed 17: found in %d and %d of %d\n", midst, late, draws);
	assert_true(midst > 0.2 * draws && late > 0.7 * draws);
	row_of(&row, counted, 8);
	assert_int_equal(row.change_at, 0);
	repeats_row_free(&row);
}

static void say(const struct repeats_row *row, const char *words)
{
	struct repeats repeats = {.row = malloc(sizeof(*row)), .rows = 1, .one = "drop"};
	size_t size;
	char *text = NULL;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(repeats.row);
	assert_non_null(out);
	*repeats.row = *row;
	repeats.row->quantity = quantity_find(QUANTITY_PEAK, "value_g");
	assert_int_equal(repeats_table(&repeats, TABLE_TEXT, out), 0);
	assert_int_equal(fclose(out), 0);
	if (strstr(text, words) == NULL)
		fail_msg("no '%s' in\n%s", words, text);
	free(text);
	free(repeats.row);
}

static void told(void **state)
{
	static const double level[] = {10.1, 9.9, 10.05, 9.95, 10, 14, 10.02, 9.97, 10.04},
	                    counted[] = {8, 8, 8, 8.001, 8}, rising[] = {1, 2.01, 2.99, 4.02, 5, 5.98};
	struct repeats_row row;

	(void)state;
	row_of(&row, level, 9);
	assert_int_equal(row.stands_out, 6);
	assert_int_equal(row.count, 9); /* it is marked, not taken out */
	assert_near(row.mean, 94.03 / 9, 1e-9);
	say(&row, "  no trend; drop 6 stands out\n");
	repeats_row_free(&row);
	row_of(&row, counted, 5);
	assert_int_equal(row.stands_out, 0);
	repeats_row_free(&row);
	row_of(&row, rising, 6);
	assert_int_equal(row.stands_out, 0);
	assert_true(row.moves);
	assert_near(row.trend, 17.45 / 17.5, 1e-6); /* by least squares on paper, from 1.0071429 */
	assert_near(row.change, 5 * 17.45 / 17.5 / 1.0071429, 1e-6);
	say(&row, "  rises\n");
	repeats_row_free(&row);
	row_of(&row, rising, 2);
	assert_true(isnan(row.trend));
	repeats_row_free(&row);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(grubbs),      cmocka_unit_test(power),
	                                   cmocka_unit_test(step_limits), cmocka_unit_test(chart),
	                                   cmocka_unit_test(steps),       cmocka_unit_test(told)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
