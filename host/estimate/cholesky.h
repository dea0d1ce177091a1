/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CHOLESKY_H
#define DT_HOST_ESTIMATE_CHOLESKY_H
/*
 * Normal equations of a handful of unknowns, without heap: every least-squares fit of the estimators.
 * Row major, at most CHOLESKY_MAX unknowns; only the lower triangle is read.
 */
#include <stdbool.h>

enum { CHOLESKY_MAX = 11 };

struct cholesky {
	unsigned size;
	double lower[CHOLESKY_MAX][CHOLESKY_MAX]; /* L below its diagonal of ones */
	double inverse[CHOLESKY_MAX];             /* of D */
};

/* a = L D L^T, the form of Cholesky's without square roots. False, and factor undefined, unless a is positive
 * definite beyond rounding. */
bool cholesky_factor(struct cholesky *factor, unsigned size, double a[CHOLESKY_MAX][CHOLESKY_MAX]);

/* x = a^-1 b; x may be b. */
void cholesky_solve(const struct cholesky *factor, const double *b, double *x);

/* v^T a^-1 v: the variance of v . parameters for unit noise. */
double cholesky_variance(const struct cholesky *factor, const double *v);

#endif
