/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_RUNG_H
#define DT_HOST_MODEL_RUNG_H
/*
 * One rung of the ladder as model.c sees it: a drop in, a prediction or a time history out. The physics lives
 * in modules of their own that know no scene (paper, oscillator, sdof, course); a rung puts the drop
 * into such a module's terms and its answer into the prediction's. Used within host/model.
 */
#include <stddef.h>

#include "host/model/drop.h"
#include "host/model/model.h"

struct rung {
	const char *name;
	const char *says; /* what it explains and what not: with a plate, without */
	const char *says_without_plate;

	/* Fills what it can say; the rest comes as NAN and stays. In m/s^2 where the prediction has g:
	 * model.c turns them. 0 or DT_E_* with message. */
	int (*predict)(const struct drop *drop, const struct model_options *options,
	               struct model_prediction *prediction, char *message);

	/* All axes, m/s^2, at start_s + i step_s; NAN where the rung says nothing. 0 or DT_E_*. */
	int (*history)(const struct drop *drop, const struct model_options *options, double start_s,
	               double step_s, double (*value)[MODEL_AXES], size_t count, char *message);
};

/* One rung's prediction, finished; its reason begins with `why`. */
DT_MUST_USE int rung_solve(const struct drop *drop, enum model_fidelity fidelity,
                           const struct model_options *options, const char *why,
                           struct model_prediction *prediction, char *message);

/* The plate's free swing. */
void rung_swing(double omega, double zeta, struct model_prediction *prediction);

extern const struct rung rung_paper, rung_steady, rung_sdof, rung_coupled, rung_planar;

#endif
