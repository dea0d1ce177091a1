/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/cholesky.h"

#include <math.h>

#include "common/assert.h"
#include "host/estimate/limits.h"

bool cholesky_factor(struct cholesky *factor, unsigned size, double a[CHOLESKY_MAX][CHOLESKY_MAX])
{
	double scaled[CHOLESKY_MAX]; /* a row of L D */

	DT_ASSERT(size <= CHOLESKY_MAX);
	factor->size = size;
	for (unsigned i = 0; i < size; i++) {
		double pivot = a[i][i];

		for (unsigned j = 0; j < i; j++) {
			double sum = a[i][j];

			for (unsigned k = 0; k < j; k++)
				sum -= scaled[k] * factor->lower[j][k];
			scaled[j] = sum;
			factor->lower[i][j] = sum * factor->inverse[j];
			pivot -= sum * factor->lower[i][j];
		}
		if (!(pivot > LIMIT_ROUNDING * a[i][i]) || !isfinite(pivot))
			return false;
		factor->inverse[i] = 1 / pivot;
	}
	return true;
}

/* L z = b */
static void forward(const struct cholesky *factor, const double *b, double *z)
{
	for (unsigned i = 0; i < factor->size; i++) {
		double sum = b[i];

		for (unsigned k = 0; k < i; k++)
			sum -= factor->lower[i][k] * z[k];
		z[i] = sum;
	}
}

void cholesky_solve(const struct cholesky *factor, const double *b, double *x)
{
	forward(factor, b, x);
	for (unsigned i = factor->size; i-- > 0;) {
		x[i] *= factor->inverse[i];
		for (unsigned k = i + 1; k < factor->size; k++)
			x[i] -= factor->lower[k][i] * x[k];
	}
}

double cholesky_variance(const struct cholesky *factor, const double *v)
{
	double z[CHOLESKY_MAX], sum = 0;

	forward(factor, v, z);
	for (unsigned i = 0; i < factor->size; i++)
		sum += z[i] * z[i] * factor->inverse[i];
	return sum;
}
