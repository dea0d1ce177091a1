/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What `droptower model` answers: one drop, its histories, many drops, or sensitivities.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "host/command/command.h"
#include "host/command/model_private.h"
#include "host/base/atomic_file.h"
#include "host/report/forecast.h"

#define HISTORY_BEFORE_S 0.002
enum { TIMINGS = 5 };

static int not_written(void)
{
	return command_output_failed(strerror(errno));
}

static int no_drop(const struct model_arguments *a, const char *message)
{
	command_error("%s: %s", a->scene_file, message);
	return COMMAND_INPUT;
}

static double seconds(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* The best of a few, in us. */
static double cost_of(const struct ensemble *e)
{
	double best = INFINITY;

	for (int i = 0; i < TIMINGS; i++) {
		struct model_prediction p;
		double start = seconds();

		if (model_solve(e->scene, e->fidelity, &e->options, &p, NULL) == 0)
			best = fmin(best, 1e6 * (seconds() - start));
	}
	return best;
}

/* The rung above the one taken, with what that one takes of itself; false: there is none. */
static bool solve_next(const struct ensemble *e, enum model_fidelity rung, struct model_prediction *next)
{
	struct model_options options = e->options;

	if (rung == MODEL_PLANAR || rung < MODEL_STEADY)
		return false;
	if (rung == MODEL_SDOF && e->fidelity == MODEL_AUTO)
		options.refinements = MODEL_STIFFNESS | MODEL_WEDGE;
	return model_solve(e->scene, rung + 1, &options, next, NULL) == 0;
}

static int one(const struct model_arguments *a)
{
	const struct ensemble *e = &a->ensemble;
	char message[MODEL_MESSAGE_MAX];
	struct model_prediction prediction, next;
	double u[ENSEMBLE_OUTPUTS];
	struct forecast forecast = {
	        .scene = e->scene, .asked = e->options.asked, .prediction = &prediction, .next = &next};

	if (model_solve(e->scene, e->fidelity, &e->options, &prediction, message) != 0)
		return no_drop(a, message);
	if (!solve_next(e, prediction.rung, &next))
		forecast.next = NULL;
	if (ensemble_bars(e, u))
		forecast.u = u;
	forecast.cost_us = cost_of(e);
	return (a->json ? forecast_json(&forecast, stdout) : forecast_text(&forecast, stdout)) == 0
	               ? COMMAND_DONE
	               : not_written();
}

static int write_history(FILE *out, double (*value)[MODEL_AXES], size_t count, double step_s)
{
	fputs("time_s,S1X_g,S1Y_g,S2X_g,S2Y_g\n", out);
	for (size_t k = 0; k < count; k++) {
		fprintf(out, "%.9g", -HISTORY_BEFORE_S + (double)k * step_s);
		for (int axis = 0; axis < MODEL_AXES; axis++)
			if (isnan(value[k][axis]))
				fputs(",", out);
			else
				fprintf(out, ",%.9g", value[k][axis]);
		fputc('\n', out);
	}
	return ferror(out) ? DT_E_SYSTEM : 0;
}

static int model_answer_history(const struct model_arguments *a)
{
	const struct ensemble *e = &a->ensemble;
	char message[512];
	double step_s = a->step_us * 1e-6;
	size_t count = (size_t)((a->span_ms * 1e-3 + HISTORY_BEFORE_S) / step_s + 1e-9) + 1;
	double(*value)[MODEL_AXES] = malloc(count * sizeof(*value));
	struct model_prediction taken;
	struct atomic_file atomic;
	int result = value ? model_solve(e->scene, e->fidelity, &e->options, &taken, message) : DT_E_MEMORY;

	if (result == 0)
		result = model_histories(e->scene, taken.rung, &e->options, -HISTORY_BEFORE_S, step_s, value,
		                         count, message);
	if (result == DT_E_MEMORY)
		snprintf(message, sizeof(message), "%s", error_text(result));
	if (result != 0) {
		free(value);
		return no_drop(a, message);
	}
	result = atomic_file_open(&atomic, a->history, message, sizeof(message));
	if (result == 0)
		result = atomic_file_close(&atomic, write_history(atomic.out, value, count, step_s), message,
		                           sizeof(message));
	free(value);
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

/* Many predictions: what could not be is told, and is a failure when nothing is left. */
static int many(const struct model_arguments *a)
{
	const struct ensemble *e = &a->ensemble;
	size_t failed = 0, points = a->draws > 0 ? a->draws : ensemble_points(e);
	int result = a->draws > 0 ? forecast_monte_carlo(e, points, a->json, stdout, &failed)
	                          : forecast_sweep(e, a->json, stdout, &failed);

	if (result != 0 && result != DT_E_EMPTY)
		return command_output_failed(error_text(result));
	if (failed > 0)
		command_error("%s: %zu of %zu scenes make no drop", a->scene_file, failed, points);
	return result == DT_E_EMPTY || failed == points ? COMMAND_INPUT : COMMAND_DONE;
}

static int sensitivity(const struct model_arguments *a)
{
	struct ensemble at = a->ensemble; /* one rung for all, so that no change of rungs shows */
	char message[MODEL_MESSAGE_MAX];
	struct model_prediction p;

	if (model_solve(at.scene, at.fidelity, &at.options, &p, message) != 0)
		return no_drop(a, message);
	if (at.fidelity == MODEL_AUTO)
		at.options.refinements = p.rung == MODEL_PLANAR ? (unsigned)MODEL_OF_RUNG : p.refinements;
	at.fidelity = p.rung;
	return forecast_sensitivity(&at, a->json, stdout) == 0 ? COMMAND_DONE : not_written();
}

static int model_answer_design(struct design *design, const struct model_arguments *a)
{
	int error;

	design->ensemble.options.ring = false;
	for (size_t i = 0; i < design->limits; i++)
		design->ensemble.options.ring =
		        design->ensemble.options.ring ||
		        strcmp(design->limit[i].quantity.key, "plate_frequency_hz") == 0;
	error = design_write(design, a->json ? TABLE_JSON : a->csv ? TABLE_CSV : TABLE_TEXT, stdout);
	if (error == DT_E_EMPTY)
		return no_drop(a, "no design makes a drop of which this model tells what is limited");
	if (error != 0)
		return command_output_failed(error_text(error));
	return fflush(stdout) != 0 || ferror(stdout) ? not_written() : COMMAND_DONE;
}

int model_answer(const struct model_arguments *a)
{
	if (a->design_keys) {
		struct design design = a->design;

		return model_answer_design(&design, a);
	}
	if (a->ensemble.axes > 0 || a->draws > 0)
		return many(a);
	if (a->sensitivity)
		return sensitivity(a);
	return a->history ? model_answer_history(a) : one(a);
}
