/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/gram.h"

#include <string.h>

#include "common/assert.h"

void gram_start(struct gram *gram, unsigned unknowns)
{
	DT_ASSERT(unknowns < GRAM_MAX);
	gram->columns = unknowns + 1;
	gram->taken = 0;
	memset(gram->sum, 0, (unknowns < GRAM_COMMON ? GRAM_COMMON : unknowns + 1) * sizeof(gram->sum[0]));
}

void gram_add_any(struct gram *gram, const double *row)
{
	const unsigned columns = gram->columns;

	gram->taken++;
	for (unsigned i = 0; i < GRAM_COMMON; i++)
		gram_add_column(gram, row, i);
	gram_add_column(gram, row, 6);
	if (columns > 7)
		gram_add_column(gram, row, 7);
	if (columns > 8)
		gram_add_column(gram, row, 8);
	if (columns > 9)
		gram_add_column(gram, row, 9);
	if (columns > 10)
		gram_add_column(gram, row, 10);
	if (columns > 11)
		gram_add_column(gram, row, 11);
}

size_t gram_finish(const struct gram *gram, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares)
{
	const unsigned unknowns = gram->columns - 1;

	for (unsigned i = 0; i < unknowns; i++) {
		for (unsigned j = 0; j <= i; j++)
			normal[i][j] += gram->sum[i][j / 2][j % 2];
		right[i] += gram->sum[unknowns][i / 2][i % 2];
	}
	*squares += gram->sum[unknowns][unknowns / 2][unknowns % 2];
	return gram->taken;
}
