/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LM_H
#define DT_HOST_ESTIMATE_LM_H
/*
 * Levenberg-Marquardt for a handful of unknowns, without heap: every nonlinear fit of the estimators. The
 * problem makes its own normal equations, so that a model may run by recurrence over its samples and no
 * Jacobian is ever stored. Damping scales the diagonal (Marquardt 1963); a step that does not lower the sum
 * of squares is taken back.
 *
 * Converged when the step just taken was below LM_STEP standard deviations, the residual's own: a measure
 * that asks for no scale of the unknowns. The error left is far smaller, as the steps shrink quadratically.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/estimate/cholesky.h"

#define LM_STEP 1e-3

enum { LM_ITERATIONS = 40 };

struct lm_problem {
	unsigned size;     /* unknowns, at most CHOLESKY_MAX */
	const void *model; /* handed to normal */
	/* J^T J (lower triangle), J^T r with r = data - model, and r^T r at p, into zeroed arrays. Returns
	 * the samples used; 0 when p is no place for this model, which takes the step back. */
	size_t (*normal)(const void *model, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
	                 double right[CHOLESKY_MAX], double *squares);
};

struct lm_result {
	double squares;         /* at the solution */
	size_t used;            /* samples */
	unsigned iterations;    /* normal equations made */
	struct cholesky factor; /* of J^T J at the solution: covariance for unit noise */
};

/* From p to the minimum, p changed in place. False, p wherever it was left, without convergence. */
bool lm_fit(const struct lm_problem *problem, double *p, struct lm_result *result);

#endif
