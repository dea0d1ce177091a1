/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_FORECAST_H
#define DT_HOST_REPORT_FORECAST_H
/*
 * Predictions without a drop, as a table or JSON: one, a sweep, a Monte Carlo run, sensitivities. The
 * functions only read what they are given. Each returns 0, DT_E_SYSTEM (could not be written), DT_E_MEMORY or
 * what it says.
 */
#include <stdbool.h>
#include <stdio.h>

#include "host/model/ensemble.h"

struct forecast {
	const struct scene *scene;
	unsigned asked; /* MODEL_ASK_*; 0: everything */
	const struct model_prediction *prediction;
	const struct model_prediction *next; /* by the rung above; NULL: none */
	const double *u; /* of each of ensemble_outputs, by the parameters' uncertainty; NULL: not known */
	double cost_us;
};

DT_MUST_USE int forecast_text(const struct forecast *forecast, FILE *out);
DT_MUST_USE int forecast_json(const struct forecast *forecast, FILE *out);

/* One row for each point of the grid; JSON: an array of objects. *failed: points that make no drop, whose
 * values are null. */
DT_MUST_USE int forecast_sweep(const struct ensemble *ensemble, bool json, FILE *out, size_t *failed);

/* DT_E_EMPTY: too few draws make a drop. */
DT_MUST_USE int forecast_monte_carlo(const struct ensemble *ensemble, size_t draws, bool json, FILE *out,
                                     size_t *failed);

/* Every key of the scene that the answers depend on. */
DT_MUST_USE int forecast_sensitivity(const struct ensemble *ensemble, bool json, FILE *out);

#endif
