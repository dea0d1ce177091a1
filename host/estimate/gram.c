/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/gram.h"

#include <string.h>

static unsigned entries(const struct gram *gram)
{
	return gram->columns * (gram->columns + 1) / 2;
}

void gram_start(struct gram *gram, unsigned unknowns)
{
	gram->columns = unknowns + 1;
	gram->rows = 0;
	gram->taken = 0;
	memset(gram->sum, 0, entries(gram) * sizeof(*gram->sum));
}

void gram_sum(struct gram *gram)
{
	size_t k = 0;

	for (size_t i = 0; i < gram->columns; i++)
		for (size_t j = 0; j <= i; j++)
			gram->sum[k++] += gram->column[i] * gram->column[j];
	gram->taken += gram->rows;
	gram->rows = 0;
}

static double total(const struct gram *gram, unsigned k)
{
	return (gram->sum[k][0] + gram->sum[k][1]) + (gram->sum[k][2] + gram->sum[k][3]);
}

size_t gram_finish(struct gram *gram, double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX],
                   double *squares)
{
	const unsigned unknowns = gram->columns - 1;
	unsigned k = 0;

	for (unsigned i = 0; i < gram->columns; i++)
		for (unsigned lane = gram->rows; lane < GRAM_LANES; lane++)
			gram->column[i][lane] = 0;
	gram_sum(gram);
	for (unsigned i = 0; i < unknowns; i++)
		for (unsigned j = 0; j <= i; j++)
			normal[i][j] += total(gram, k++);
	for (unsigned i = 0; i < unknowns; i++)
		right[i] += total(gram, k++);
	*squares += total(gram, k);
	return gram->taken;
}
