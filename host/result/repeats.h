/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_REPEATS_H
#define DT_HOST_RESULT_REPEATS_H
/*
 * Repeats of one thing, in their order: of each value of each channel mean, standard deviation, a straight
 * line with its uncertainty, the place where it changes, if it does, the value that stands out, and a control
 * chart. Only values whose status is ok count; how many there were without is told.
 *
 * Trend: least squares over the number of the repeat; its standard uncertainty from the residuals, n - 2
 * degrees of freedom. "Moves" where a trend as large came by chance in 0.27 % of cases (Student's t).
 * Change: the largest t of two means over all places that leave two values and more on each side; told where
 * one as large comes by chance in 1 % of series, from eight values on, and where a step leaves less behind
 * than the line does.
 * Stands out: the value farthest from the mean, beyond the 1 % limit of Grubbs, of four and more that differ,
 * by their own scatter, or by that of others of their kind where these are known. It is marked, never taken
 * out: that needs a cause.
 * Chart: single values within the mean +- 2.66 of the mean step between neighbours, steps within 3.267 of it:
 * three standard deviations, where one value in 370 lies beyond by chance.
 */
#include "host/base/table.h"
#include "host/result/quantity.h"

struct repeats_row {
	char channel[32];
	const struct quantity *quantity;
	const char *title; /* where people read it; NULL: channel and key */
	size_t count, room, left_out;
	double *value, *number; /* [count]: and which repeat each is of, from 1 */
	double pooled, degrees; /* variance of all of its kind, its own among it, and of how many degrees of
	                           freedom; 0: of no others */

	/* by repeats_row_close */
	double mean, sd;             /* NAN below 1 and 2 values */
	double trend, sigma_trend;   /* of the value a repeat; NAN below 3 */
	double change, sigma_change; /* first to last by the line, of the value at the first */
	double step_t;               /* the largest t of two means; NAN below 8 */
	unsigned change_at;          /* repeat from which on it is another; 0: none */
	unsigned stands_out; /* repeat that is no other's kin, by Grubbs; 0: none. It counts all the same */
	double low, high, step; /* limits of values and of steps; NAN below 3 */
	unsigned beyond, steps; /* how many are beyond them */
	bool moves;
};

struct repeats {
	struct repeats_row *row;
	size_t rows, repeats;
	const char *one; /* "drop"; NULL: "repeat" */
};

/* A row more, without values; NULL: out of memory. */
struct repeats_row *repeats_row_new(struct repeats *repeats, const char *channel,
                                    const struct quantity *quantity);

/* A value more of one row. 0 or DT_E_MEMORY. */
DT_MUST_USE int repeats_value(struct repeats_row *row, size_t number, double value);
void repeats_row_close(struct repeats_row *row);
void repeats_row_free(struct repeats_row *row);

/* The t that the largest of n values' steps has by chance once in a hundred series, n 8 and more. */
double repeats_step_limit(size_t n);

/* The largest distance from the mean of n values, three and more, in standard deviations of so many degrees
 * of freedom, that comes by chance once in 1 / alpha (Grubbs, two-sided). The values' own scatter is part of
 * that standard deviation: degrees is n - 1 where it is all of it, and more where other series are in it. */
double repeats_grubbs(size_t n, double degrees, double alpha);

/* The rows: what they are of, mean, SD, the chart's limits and how many are beyond, first to last, and what
 * that says: "rises", "another from drop 7 on", "; drop 3 stands out". JSON has the values, too. 0 or
 * DT_E_MEMORY. */
DT_MUST_USE int repeats_table(const struct repeats *repeats, enum table_format format, FILE *out);

/* One sentence on what the words and limits mean. */
#define REPEATS_NOTE                                                                                       \
	"Limits: mean +- 2.66 of the mean step between neighbours; of 100 series of 10 two have a value\n" \
	"beyond by chance, of 51 twelve. A trend is told at 0.27 %, another mean and what stands out\n"    \
	"(Grubbs) at 1 %. Marked, and in the means all the same: to leave one out needs a cause and a name."

/* What is worth a row, of each channel: the i-th from 0, NULL behind the last. */
const struct quantity *repeats_wanted(size_t i, enum quantity_place *place);

/* Another repeat. 0 or DT_E_MEMORY. */
DT_MUST_USE int repeats_add(struct repeats *repeats, struct result *result);
void repeats_close(struct repeats *repeats);
void repeats_free(struct repeats *repeats);

#endif
