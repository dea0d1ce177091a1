/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_REPEATS_H
#define DT_HOST_RESULT_REPEATS_H
/*
 * Repeats of one thing, in their order: of each value of each channel mean, standard deviation, a straight
 * line with its uncertainty, and the place where it changes, if it does. Only values whose status is ok
 * count; how many there were without is told.
 *
 * Trend: least squares over the number of the repeat; its standard uncertainty from the residuals, n - 2
 * degrees of freedom. "Moves" where a trend as large came by chance in 0.27 % of cases (Student's t). Change:
 * the largest cumulative sum against the scatter between neighbours, which no slow trend widens; told beyond
 * the 1 % limit of Kolmogorov (1.63), from eight values on, and where a step leaves less behind than the line
 * does. Stands out: the value farthest from the mean, beyond the 1 % limit of Grubbs, of four and more that
 * differ. It is marked, never taken out: that needs a cause.
 */
#include "host/result/quantity.h"

struct repeats_row {
	char channel[32];
	const struct quantity *quantity;
	size_t count, room, left_out;
	double *value, *number; /* [count]: and which repeat each is of, from 1 */

	/* by repeats_close */
	double mean, sd;             /* NAN below 1 and 2 values */
	double trend, sigma_trend;   /* of the value a repeat; NAN below 3 */
	double from, to;             /* the line at the first and the last; NAN below 2 */
	double change, sigma_change; /* first to last by the line, of the value at the first */
	unsigned change_at;          /* repeat from which on it is another; 0: none */
	unsigned stands_out; /* repeat that is no other's kin, by Grubbs; 0: none. It counts all the same */
	bool moves;
};

struct repeats {
	struct repeats_row *row;
	size_t rows, repeats;
};

/* A value more of one row. 0 or DT_E_MEMORY. */
DT_MUST_USE int repeats_value(struct repeats_row *row, size_t number, double value);
void repeats_row_close(struct repeats_row *row);
void repeats_row_free(struct repeats_row *row);

/* "rises", "another from repeat 7 on", "; repeat 3 stands out". */
enum { REPEATS_WORDS_MAX = 96 };
void repeats_words(const struct repeats_row *row, char words[REPEATS_WORDS_MAX]);

/* Index of the value that is farthest from the mean, and how far; 0 of equal ones. */
size_t repeats_farthest(const struct repeats_row *row, double *distance);

/* The largest distance from the mean of n values, three and more, in standard deviations of so many degrees
 * of freedom, that comes by chance once in 1 / alpha (Grubbs, two-sided). The values' own scatter is part of
 * that standard deviation: degrees is n - 1 where it is all of it, and more where other series are in it. */
double repeats_grubbs(size_t n, double degrees, double alpha);

/* Another repeat. 0 or DT_E_MEMORY. */
DT_MUST_USE int repeats_add(struct repeats *repeats, struct result *result);
void repeats_close(struct repeats *repeats);
void repeats_free(struct repeats *repeats);

#endif
