/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_ODE_H
#define DT_HOST_MODEL_ODE_H
/*
 * y' = f(y) by the Runge-Kutta pair of Dormand and Prince, order 5 with 4, steps chosen by the error, with
 * Hairer's continuous extension: between the ends of the last two steps any instant costs a polynomial.
 * Written out because a scene takes a few tens of short steps, where GSL's driver spends most of its time
 * around them; the tests hold it against GSL's rk8pd.
 *
 * The caller owns the struct; no memory besides, any thread. Units are the caller's.
 */
#include <stddef.h>

#include "common/error.h"

enum { ODE_STATES_MAX = 13, ODE_STAGES = 7 };

/* One step: what y was in between. */
struct ode_piece {
	double from, length,
	        end; /* end: where it counts as over, length is what its polynomial was made for */
	double term[5][ODE_STATES_MAX];
};

struct ode {
	/* set by the caller before ode_start */
	size_t count; /* of states */
	void (*rates)(const void *context, const double y[], double rate[]);
	const void *context;
	double tolerance;             /* of one step, in units of scale */
	double scale[ODE_STATES_MAX]; /* what counts as much in each state */

	/* read only */
	double t, y[ODE_STATES_MAX];
	double next; /* length of the step to try */
	double rate[ODE_STAGES][ODE_STATES_MAX];
	struct ode_piece last, before;
	unsigned evaluations;
};

enum { ODE_EVALUATIONS_MAX = 50000000 };

/* At t = 0 and y; first_step is a guess. */
void ode_start(struct ode *ode, const double y[], double first_step);

/* One step, not beyond `until`. 0, or DT_E_NUMERIC: y or its rate is no number, or the steps become too many.
 */
DT_MUST_USE int ode_step(struct ode *ode, double until);

/* y at an instant of the last two steps. */
void ode_at(const struct ode *ode, double t, double y[]);

/* Takes the last step back to an instant within it: goes on from there. */
void ode_cut(struct ode *ode, double t);

/* y or its rates were changed at the present instant: goes on from there. */
void ode_renew(struct ode *ode);

#endif
