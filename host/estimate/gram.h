/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_GRAM_H
#define DT_HOST_ESTIMATE_GRAM_H
/*
 * Normal equations summed row by row: derivatives by the unknowns, then the residual as one more column, so
 * that J^T J, J^T r and r^T r are all products of columns. Rows are taken GRAM_LANES at a time, because their
 * products can then be summed side by side. No memory but the caller's.
 */
#include "host/estimate/cholesky.h"

#include <stddef.h>

enum { GRAM_LANES = 4, GRAM_MAX = CHOLESKY_MAX + 1 };

struct gram {
	unsigned columns; /* unknowns and the residual */
	unsigned rows;    /* of column, not yet in sum */
	size_t taken;     /* rows in all */
	/* GRAM_LANES numbers each, as vectors of what the processor has (gcc and clang) */
	double __attribute__((vector_size(GRAM_LANES * sizeof(double)))) column[GRAM_MAX];
	double __attribute__((vector_size(GRAM_LANES * sizeof(double)))) sum[GRAM_MAX * (GRAM_MAX + 1) / 2];
};

void gram_start(struct gram *gram, unsigned unknowns);

/* Sums the rows that wait. */
void gram_sum(struct gram *gram);

static inline void gram_add(struct gram *gram, const double *row)
{
	for (unsigned i = 0; i < gram->columns; i++)
		gram->column[i][gram->rows] = row[i];
	if (++gram->rows == GRAM_LANES)
		gram_sum(gram);
}

/* Adds it all to what lm_problem's normal hands out. Returns how many rows there were. */
size_t gram_finish(struct gram *gram, double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX],
                   double *squares);

#endif
