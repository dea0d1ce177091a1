/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LM_H
#define DT_HOST_ESTIMATE_LM_H
/*
 * Levenberg-Marquardt for a handful of unknowns, without heap: every nonlinear fit of the estimators. The
 * problem makes its own normal equations, so that a model may run by recurrence over its samples and no
 * Jacobian is ever stored. Damping scales the diagonal (Marquardt 1963); a step that does not lower the sum
 * of squares is taken back.
 *
 * Converged when a step is below LM_STEP standard deviations, the residual's own: a measure that asks for no
 * scale of the unknowns; or when it is below one and the next would be below LM_STEP, shrinking once more as
 * it has shrunk. That step is taken without another look at the data.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/estimate/cholesky.h"

#define LM_STEP 1e-2

enum {
	LM_ITERATIONS = 40,
	LM_PATIENCE = 6, /* iterations a kinked model is given before little gain is enough */
};

struct lm_problem {
	unsigned size;     /* unknowns, at most CHOLESKY_MAX */
	const void *model; /* handed to normal */
	/* J^T J (lower triangle), J^T r with r = data - model, and r^T r at p, into zeroed arrays. Unknowns
	 * the model is linear in may be moved to their best for the others first (variable projection).
	 * Returns the samples used; 0 when p is no place for this model, which takes the step back. */
	size_t (*normal)(const void *model, double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
	                 double right[CHOLESKY_MAX], double *squares);
	/* A model whose slope jumps where a sample leaves it may have its minimum on the jump, where steps
	 * only shuttle: a gain below this part of the variance is then the end. 0 for a smooth one. */
	double kink;
};

struct lm_result {
	double squares;         /* at the solution; past the last look as the straight model has it */
	size_t used;            /* samples */
	unsigned iterations;    /* normal equations made */
	struct cholesky factor; /* of J^T J at the last look: covariance for unit noise */
};

/* From p to the minimum, p changed in place. False, p wherever it was left, without convergence. */
bool lm_fit(const struct lm_problem *problem, double *p, struct lm_result *result);

#endif
