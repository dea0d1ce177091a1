/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a scene with [fit] is good for: predictions with their bars, and a later drop of its product. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/fit/fit_private.h"
#include "host/model/corner.h"

/* ---- predictions ---- */

int fit_predict(const struct scene *scene, double derived[MOTION_DERIVED], double sd[MOTION_DERIVED])
{
	struct motion *motion = malloc(sizeof(*motion));
	double p[MOTION_PARAMETERS], slope[MOTION_SHARED][MOTION_DERIVED], variance[MOTION_DERIVED] = {0.0};
	int error = motion ? 0 : DT_E_MEMORY;

	motion_of_scene(scene, p);
	if (!error && !(scene->fitted_u[MOTION_LN_STIFFNESS] > 0.0))
		error = DT_E_ARGUMENT;
	if (!error)
		error = motion_solve(scene, p, MOTION_NODES, motion, derived);
	for (size_t i = 0; i < MOTION_SHARED && !error; i++) {
		double was = p[i], moved[MOTION_DERIVED];

		p[i] += solve_step_of(i);
		error = scene->fitted_u[i] > 0.0 ? motion_solve(scene, p, MOTION_NODES, motion, moved) : 0;
		for (size_t q = 0; q < MOTION_DERIVED; q++)
			slope[i][q] =
			        scene->fitted_u[i] > 0.0
			                ? scene->fitted_u[i] * (moved[q] - derived[q]) / solve_step_of(i)
			                : 0.0;
		p[i] = was;
	}
	free(motion);
	for (size_t q = 0; q < MOTION_DERIVED && !error; q++) {
		for (size_t i = 0; i < MOTION_SHARED; i++)
			for (size_t j = 0; j < MOTION_SHARED; j++)
				variance[q] += (i == j ? 1.0 : scene->fitted_correlation[i][j]) *
				               slope[i][q] * slope[j][q];
		sd[q] = sqrt(fmax(variance[q], 0.0));
	}
	return error;
}

/* ---- a later drop ---- */

/* To 6 ms for onset, angle and speed alone, then to 10 ms: what the plate does later tells no more of them.
 */
enum { LATER_ITERATIONS = 2, LATER_OWN_NODES = 300, LATER_NODES = MOTION_FINE_NODES + 40 };

/* Gains of squares that are not worth another iteration, without and with the product's parameters. */
#define LATER_ENOUGH 2.0
#define LATER_ENOUGH_ALL 20.0

/* What [fit] knows of the product takes the place of the weak priors. False: it is no covariance. */
static bool start_known(const struct scene *scene, struct solve *s)
{
	double a[FIT_COMMON][FIT_COMMON];

	memset(a, 0, sizeof(a));
	for (size_t i = 0; i < FIT_COMMON; i++) {
		if (i < MOTION_SHARED)
			s->prior_sd[i] = s->prior_sd[i] > 0.0 ? scene->fitted_u[i] : 0.0;
		a[i][i] = s->prior_sd[i] > 0.0 ? s->prior_sd[i] * s->prior_sd[i] : 1.0;
	}
	for (size_t i = 0; i < MOTION_SHARED; i++)
		for (size_t j = 0; j < i; j++)
			a[i][j] = scene->fitted_correlation[i][j] * s->prior_sd[i] * s->prior_sd[j];
	if (!solve_factor(FIT_COMMON, FIT_COMMON, &a[0][0]))
		return false;
	solve_invert(FIT_COMMON, &a[0][0], &s->known[0][0]);
	return true;
}

/* The drop's own unknowns first, then, to first order, all together. */
static int later_solve(struct solve *s, struct fit_later *later, char message[FIT_MESSAGE_MAX])
{
	struct solve_drop *d = s->drop;
	bool found;

	fit_align(s, d);
	s->held = true;
	s->nodes = LATER_OWN_NODES;
	found = solve_run(s, LATER_ITERATIONS, LATER_ENOUGH);
	s->held = false;
	s->nodes = LATER_NODES;
	s->derives = true;
	if (!found || !solve_run(s, LATER_ITERATIONS, LATER_ENOUGH_ALL) || !solve_covariance_there(s)) {
		snprintf(message, FIT_MESSAGE_MAX, "the scene's product cannot have made this drop");
		return DT_E_NUMERIC;
	}
	fit_conclude_drop(s, d, &later->drop);
	later->doubt.moved = solve_known(s);
	s->nodes = MOTION_NODES;
	if (judge(s, &later->drop, 1.0, &later->doubt) != 0) {
		snprintf(message, FIT_MESSAGE_MAX, "no memory");
		return DT_E_MEMORY;
	}
	memcpy(later->drop.derived, s->derived[1 + MOTION_PARAMETERS], sizeof(later->drop.derived));
	return 0;
}

int fit_later_drop(const struct scene *scene, const struct fit_drop *drop, const struct fit_options *options,
                   struct fit_later *later, char message[FIT_MESSAGE_MAX])
{
	struct solve_drop d;
	struct solve s = {.scene = scene, .drop = &d, .drops = 1};
	int error = prepare_drop(scene, drop, options, &d, message);

	if (error)
		return error;
	*later = (struct fit_later){.doubt.words = ""};
	s.motion = malloc((1 + MOTION_PARAMETERS) * sizeof(*s.motion));
	fit_start_common(scene, options, &s);
	if (!s.motion) {
		error = DT_E_MEMORY;
		snprintf(message, FIT_MESSAGE_MAX, "no memory");
	} else if (!(scene->fitted_u[MOTION_LN_STIFFNESS] > 0.0) || corner_predicted(scene) ||
	           !start_known(scene, &s)) {
		error = DT_E_ARGUMENT;
		snprintf(message, FIT_MESSAGE_MAX, "the scene has no [fit] that is a covariance");
	} else {
		error = later_solve(&s, later, message);
	}
	free(s.motion);
	prepare_free(&d);
	return error;
}
