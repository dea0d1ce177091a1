/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/lm.h"

#include <math.h>
#include <string.h>

#include "host/estimate/limits.h"

#define DAMPING_START 1e-4
#define DAMPING_DOWN 0.1

/* Less hardly changes a step: one that was taken back would be again. */
#define DAMPING_FELT (DAMPING_START / DAMPING_DOWN)

/* On a kinked model: to stay short of the kink takes more, and is needed again at the next step. */
#define KINK_DOWN 0.3
#define KINK_FELT (DAMPING_FELT / DAMPING_DOWN)

struct place {
	double normal[CHOLESKY_MAX][CHOLESKY_MAX];
	double right[CHOLESKY_MAX];
	double squares;
	size_t used;
};

static bool stand(const struct lm_problem *problem, double *p, struct place *place)
{
	memset(place->normal, 0, problem->size * sizeof(place->normal[0]));
	memset(place->right, 0, sizeof(place->right));
	place->squares = 0;
	place->used = problem->normal(problem->model, p, place->normal, place->right, &place->squares);
	return place->used > problem->size && isfinite(place->squares);
}

/* The damped step from a place, and what of the sum of squares the straight model promises for it. */
static bool lm_step(const struct lm_problem *problem, const struct place *place, double damping,
                    double *change, double *promise)
{
	double damped[CHOLESKY_MAX][CHOLESKY_MAX];
	struct cholesky factor;

	memcpy(damped, place->normal, problem->size * sizeof(damped[0]));
	for (unsigned i = 0; i < problem->size; i++)
		damped[i][i] *= 1 + damping;
	if (!cholesky_factor(&factor, problem->size, damped))
		return false;
	cholesky_solve(&factor, place->right, change);
	*promise = 0;
	for (unsigned i = 0; i < problem->size; i++)
		*promise += change[i] * place->right[i];
	return isfinite(*promise);
}

/* The sum of squares that the unknowns themselves would make as a step. */
static double lm_squares_of(const struct lm_problem *problem, const struct place *place, const double *p)
{
	double sum = 0;

	for (unsigned i = 0; i < problem->size; i++)
		for (unsigned j = 0; j <= i; j++)
			sum += (i == j ? 1 : 2) * p[i] * place->normal[i][j] * p[j];
	return sum;
}

/* Whether a step of that promise, after one of before, is the last: 0 when that one tells nothing, as none
 * does on a kinked model. */
static bool is_last(const struct lm_problem *problem, double promise, double before, double variance)
{
	const double end = LM_STEP * LM_STEP * variance;

	return promise <= end ||
	       (!(problem->kink > 0) && promise <= variance && promise * promise <= end * before);
}

static bool lm_finish(const struct lm_problem *problem, struct place *place, double promise,
                      struct lm_result *result)
{
	result->squares = fmax(place->squares - promise, 0);
	result->used = place->used;
	return cholesky_factor(&result->factor, problem->size, place->normal);
}

bool lm_fit(const struct lm_problem *problem, double *p, struct lm_result *result)
{
	struct place place[2], *here = &place[0], *there = &place[1];
	const double felt = problem->kink > 0 ? KINK_FELT : DAMPING_FELT;
	const double down = problem->kink > 0 ? KINK_DOWN : DAMPING_DOWN;
	double damping = DAMPING_START, before = 0, rounding;

	if (!stand(problem, p, here))
		return false;
	/* A step that promises no more of the sum of squares, or is no larger a part of the unknowns. */
	rounding = fmax(LIMIT_ROUNDING * here->squares,
	                LIMIT_ROUNDING * LIMIT_ROUNDING * lm_squares_of(problem, here, p));
	result->iterations = 1;
	while (result->iterations < LM_ITERATIONS) {
		double change[CHOLESKY_MAX], trial[CHOLESKY_MAX], promise, gain, variance;
		struct place *swap;

		if (!lm_step(problem, here, damping, change, &promise))
			return false;
		for (unsigned i = 0; i < problem->size; i++)
			trial[i] = p[i] + change[i];
		variance = here->squares / (double)(here->used - problem->size);
		if (damping < DAMPING_FELT && is_last(problem, promise, before, variance)) {
			memcpy(p, trial, problem->size * sizeof(*p));
			return lm_finish(problem, here, promise, result);
		}
		result->iterations++;
		if (!stand(problem, trial, there) || there->squares > here->squares) {
			/* Damped that much and still no better: the bottom, as far as rounding can tell. */
			if (promise <= rounding || damping > 1 / LIMIT_SMALL)
				return lm_finish(problem, here, 0, result);
			damping = fmax(damping / DAMPING_DOWN, felt);
			before = 0;
			continue;
		}
		gain = here->squares - there->squares;
		memcpy(p, trial, problem->size * sizeof(*p));
		swap = here;
		here = there;
		there = swap;
		before = damping < DAMPING_FELT ? promise : 0;
		damping *= down;
		variance = here->squares / (double)(here->used - problem->size);
		if (promise <= LM_STEP * LM_STEP * variance || promise <= rounding ||
		    (result->iterations > LM_PATIENCE && gain <= problem->kink * variance))
			return lm_finish(problem, here, 0, result);
	}
	return false;
}
