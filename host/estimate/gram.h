/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_GRAM_H
#define DT_HOST_ESTIMATE_GRAM_H
/*
 * Normal equations summed row by row: derivatives by the unknowns, then the residual as one more column, so
 * that J^T J, J^T r and r^T r are all products of columns. No memory but the caller's.
 */
#include <stddef.h>

#include "host/estimate/cholesky.h"
#include "host/estimate/simd2.h"

enum {
	GRAM_MAX = CHOLESKY_MAX + 1,
	GRAM_COMMON = 6, /* columns of nearly every fit, summed up for every one */
};

struct gram {
	unsigned columns;                       /* unknowns and the residual */
	size_t taken;                           /* rows */
	PAIR sum[GRAM_MAX][(GRAM_MAX + 1) / 2]; /* of column i with columns 0 and 1, 2 and 3, ... up to i */
};

void gram_start(struct gram *gram, unsigned unknowns);

_Static_assert(GRAM_MAX == 12, "columns are written out");

/* Flat: i is a constant wherever it counts, and the compiler drops what is not asked for. */
static inline void gram_add_column(struct gram *gram, const double *row, unsigned i)
{
	PAIR *sum = gram->sum[i];
	const double value = row[i];

	sum[0] += value * pair_load(row);
	if (i > 1)
		sum[1] += value * pair_load(row + 2);
	if (i > 3)
		sum[2] += value * pair_load(row + 4);
	if (i > 5)
		sum[3] += value * pair_load(row + 6);
	if (i > 7)
		sum[4] += value * pair_load(row + 8);
	if (i > 9)
		sum[5] += value * pair_load(row + 10);
}

void gram_add_any(struct gram *gram, const double *row);

/* row: an even number of doubles, GRAM_COMMON at least; those beyond the columns have any value. Laid out
 * flat, since the compiler makes short work of loops whose length it knows. */
static inline void gram_add(struct gram *gram, const double *row)
{
	if (gram->columns > GRAM_COMMON) {
		gram_add_any(gram, row);
		return;
	}
	gram->taken++;
	gram_add_column(gram, row, 0);
	gram_add_column(gram, row, 1);
	gram_add_column(gram, row, 2);
	gram_add_column(gram, row, 3);
	gram_add_column(gram, row, 4);
	gram_add_column(gram, row, 5);
}

/* Adds it all to what lm_problem's normal hands out. Returns how many rows there were. */
size_t gram_finish(const struct gram *gram, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares);

#endif
