/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "host/model/auto.h"
#include "host/model/drop.h"
#include "host/model/rung.h"

const struct model_options model_defaults = {
        .tolerance = MODEL_TOLERANCE, .refinements = MODEL_OF_RUNG, .ring = true};

static const struct rung *const rungs[MODEL_FIDELITIES] = {
        [MODEL_PAPER] = &rung_paper,     [MODEL_STEADY] = &rung_steady, [MODEL_SDOF] = &rung_sdof,
        [MODEL_COUPLED] = &rung_coupled, [MODEL_PLANAR] = &rung_planar,
};

const char *model_fidelity_name(enum model_fidelity fidelity)
{
	return fidelity == MODEL_AUTO ? "auto" : rungs[fidelity]->name;
}

int model_fidelity_parse(const char *name, enum model_fidelity *fidelity)
{
	for (enum model_fidelity f = MODEL_AUTO; f < MODEL_FIDELITIES; f++)
		if (!strcmp(name, model_fidelity_name(f))) {
			*fidelity = f;
			return 0;
		}
	return DT_E_UNKNOWN;
}

/* 0: no such name. */
static unsigned bit_of(const char *name, const char *const names[], size_t count)
{
	for (size_t i = 0; i < count; i++)
		if (!strcmp(name, names[i]))
			return 1u << i;
	return 0;
}

int model_refinement_parse(const char *name, enum model_refinement *refinement)
{
	static const char *const names[] = {"stiffness", "wedge", "grip", "mounts"};
	unsigned bit = bit_of(name, names, sizeof(names) / sizeof(names[0]));

	*refinement = bit ? (enum model_refinement)bit : *refinement;
	return bit ? 0 : DT_E_UNKNOWN;
}

int model_question_parse(const char *name, enum model_question *question)
{
	static const char *const names[] = {"plate", "axes", "box", "lag", "s2", "direction"};

	unsigned bit = bit_of(name, names, sizeof(names) / sizeof(names[0]));

	*question = bit ? (enum model_question)bit : *question;
	return bit ? 0 : DT_E_UNKNOWN;
}

/* Nothing said yet. */
static struct model_prediction blank(const struct drop *drop)
{
	const double none = (double)NAN;
	struct model_prediction p = {
	        .has_plate = drop->has_plate,
	        .impact_speed_m_s = drop->speed_m_s,
	        .velocity_change_m_s = none,
	        .contact_time_s = none,
	        .restitution = none,
	        .stiffness_n_m15 = none,
	        .dent_m = none,
	        .dent_share = none,
	        .plate_travel_m = none,
	        .plate_frequency_hz = drop->has_plate ? none : 0.0,
	        .plate_damping_ratio = drop->has_plate ? none : 0.0,
	        .spin_rad_s = none,
	        .box = {none, none},
	        .direction_deg = {none, none},
	        .second_touch_s = none,
	        .until_s = none,
	        .lag_s = none,
	        .difference = none,
	        .next_change = none,
	};

	for (int i = 0; i < MODEL_AXES; i++)
		p.peak[i] = (struct model_peak){none, none};
	p.resultant[0] = p.resultant[1] = p.box;
	return p;
}

static void to_g(struct model_peak *peak)
{
	peak->value_g /= UNITS_G_M_S2;
}

static int model_check_options(const struct model_options *o, char *message)
{
	if (!(o->tolerance == 0.0 || (o->tolerance >= MODEL_TOLERANCE_MIN && o->tolerance <= 0.01)))
		return drop_refuse(message, DT_E_ARGUMENT, "tolerance is %g, expected %g to 0.01",
		                   o->tolerance, MODEL_TOLERANCE_MIN);
	if (!(o->accuracy >= 0.0 && o->accuracy <= 1.0))
		return drop_refuse(message, DT_E_ARGUMENT, "accuracy is %g, expected 0 to 1", o->accuracy);
	if (!(o->lag_accuracy_us >= 0.0))
		return drop_refuse(message, DT_E_ARGUMENT, "lag accuracy is %g us, expected above 0",
		                   o->lag_accuracy_us);
	return 0;
}

/* The rung's prediction, finished: g, dent against mat, direction and lag from what it said. */
static int solve_rung(const struct drop *drop, enum model_fidelity fidelity,
                      const struct model_options *options, struct model_prediction *prediction, char *message)
{
	struct model_prediction p = blank(drop);
	double mat_m = drop->scene->contact_mat_thickness_m;
	int error = rungs[fidelity]->predict(drop, options, &p, message);

	if (error)
		return error;
	p.rung = fidelity;
	p.fidelity = rungs[fidelity]->name;
	p.dent_share = p.dent_m / mat_m;
	switch (isfinite(p.dent_m) ? contact_validity(p.dent_m, mat_m) : CONTACT_SOUND) {
	case CONTACT_THROUGH:
		return drop_refuse(message, DT_E_RANGE,
		                   "mat_thickness_m is %g, but the corner would sink in by %.2g m", mat_m,
		                   p.dent_m);
	case CONTACT_DEEP:
		p.notes |= MODEL_NOTE_DEEP;
		break;
	case CONTACT_SOUND:
		break;
	}
	p.lag_s = p.resultant[0].time_s - p.resultant[1].time_s;
	for (int i = 0; i < MODEL_AXES; i++)
		to_g(&p.peak[i]);
	to_g(&p.resultant[0]);
	to_g(&p.resultant[1]);
	to_g(&p.box);
	*prediction = p;
	return 0;
}

/* "why: says", without printf, which a million predictions would notice. */
static void give_reason(struct model_prediction *p, const char *why, const char *says)
{
	const char *const parts[] = {why, ": ", says};
	size_t at = 0;

	for (size_t i = 0; i < sizeof(parts) / sizeof(parts[0]); i++) {
		size_t length = strlen(parts[i]), room = sizeof(p->reason) - 1 - at;

		length = length < room ? length : room;
		memcpy(p->reason + at, parts[i], length);
		at += length;
	}
	p->reason[at] = '\0';
}

void rung_swing(double omega, double zeta, struct model_prediction *p)
{
	p->plate_damping_ratio = zeta;
	p->plate_frequency_hz =
	        zeta < 1.0 ? omega * sqrt((1.0 - zeta) * (1.0 + zeta)) / (2.0 * UNITS_PI) : (double)NAN;
}

int rung_solve(const struct drop *drop, enum model_fidelity fidelity, const struct model_options *options,
               const char *why, struct model_prediction *prediction, char *message)
{
	struct model_prediction p;
	int error = solve_rung(drop, fidelity, options, &p, message);

	if (error)
		return error;
	give_reason(&p, why, drop->has_plate ? rungs[fidelity]->says : rungs[fidelity]->says_without_plate);
	*prediction = p;
	return 0;
}

int model_solve(const struct scene *scene, enum model_fidelity fidelity, const struct model_options *options,
                struct model_prediction *prediction, char message[MODEL_MESSAGE_MAX])
{
	const struct model_options *o = options ? options : &model_defaults;
	struct drop drop;
	int error = model_check_options(o, message);

	if (!error)
		error = drop_of_scene(scene, &drop, message);
	if (!error && fidelity == MODEL_AUTO)
		return auto_solve(&drop, o, prediction, message);
	return error ? error : rung_solve(&drop, fidelity, o, "asked for", prediction, message);
}

int model_below(const struct scene *scene, const struct model_prediction *prediction,
                struct model_prediction *below)
{
	struct model_options options = model_defaults;

	options.refinements = MODEL_STIFFNESS | MODEL_WEDGE;
	if (prediction->rung != MODEL_PLANAR && prediction->rung != MODEL_COUPLED)
		return DT_E_UNKNOWN;
	return model_solve(scene, prediction->rung - 1, &options, below, NULL);
}

int model_hertz(const struct scene *scene, struct contact_hertz *hertz, char message[MODEL_MESSAGE_MAX])
{
	struct contact_hertz_input in = {
	        .mass_kg = scene->product_case_mass_kg,
	        .radius_m = scene->contact_corner_radius_m,
	        .case_modulus_pa = scene->contact_case_modulus_pa,
	        .case_poisson = scene->contact_case_poisson,
	        .mat_modulus_pa = scene->contact_mat_modulus_pa,
	        .mat_poisson = scene->contact_mat_poisson,
	        .mat_thickness_m = scene->contact_mat_thickness_m,
	};
	struct drop drop;
	int error = drop_of_scene(scene, &drop, message);

	if (error)
		return error;
	in.speed_m_s = drop.speed_m_s;
	error = contact_hertz(&in, hertz);
	if (error)
		return drop_refuse(
		        message, error,
		        "corner_radius_m, mat_thickness_m and the moduli must be above 0, Poisson's "
		        "ratios within 0 to 0.5");
	return 0;
}

int model_histories(const struct scene *scene, enum model_fidelity fidelity,
                    const struct model_options *options, double start_s, double step_s,
                    double (*value_g)[MODEL_AXES], size_t count, char message[MODEL_MESSAGE_MAX])
{
	enum model_fidelity taken = fidelity == MODEL_AUTO ? MODEL_PLANAR : fidelity;
	struct drop drop;
	int error = model_check_options(options ? options : &model_defaults, message);

	if (!error && (!isfinite(start_s) || !(step_s > 0.0) || !isfinite(step_s)))
		error = drop_refuse(message, DT_E_ARGUMENT, "times from %g in steps of %g", start_s, step_s);
	if (!error)
		error = drop_of_scene(scene, &drop, message);
	if (!error)
		error = rungs[taken]->history(&drop, options ? options : &model_defaults, start_s, step_s,
		                              value_g, count, message);
	if (error)
		return error;
	for (size_t k = 0; k < count; k++)
		for (int axis = 0; axis < MODEL_AXES; axis++)
			value_g[k][axis] /= UNITS_G_M_S2;
	return 0;
}

int model_history(const struct scene *scene, enum model_fidelity fidelity, enum model_axis axis,
                  double start_s, double step_s, double *value_g, size_t count)
{
	double(*all)[MODEL_AXES] = malloc((count ? count : 1) * sizeof(*all));
	int error;

	if (!all)
		return DT_E_MEMORY;
	error = model_histories(scene, fidelity, NULL, start_s, step_s, all, count, NULL);
	for (size_t k = 0; k < count && !error; k++)
		value_g[k] = all[k][axis];
	free(all);
	return error;
}
