/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/auto.h"

#include <math.h>
#include <stdio.h>

#include "host/model/rung.h"

/* Numerical tolerance over the one asked for, and the loosest. */
#define NUMERICAL_SHARE 0.2
#define NUMERICAL_MAX 0.01
#define NUMERICAL_MAX_INSTANT 0.002 /* for what hangs on the instant of a peak: lag, direction */

/* A corner beside the centre of gravity lowers a shock by about this share of the log of the mass felt. */
#define FELT_SHARE 0.3

double auto_apart(const struct model_prediction *p, const struct model_prediction *to, unsigned asked,
                  double lag_s)
{
	const struct {
		unsigned asked;
		double value, to;
	} all[] = {
	        {MODEL_ASK_PLATE, p->resultant[0].value_g, to->resultant[0].value_g},
	        {MODEL_ASK_AXES, p->peak[MODEL_S1X].value_g, to->peak[MODEL_S1X].value_g},
	        {MODEL_ASK_AXES, p->peak[MODEL_S1Y].value_g, to->peak[MODEL_S1Y].value_g},
	        {MODEL_ASK_BOX, p->box.value_g, to->box.value_g},
	        {MODEL_ASK_LAG, p->lag_s, to->lag_s},
	        {MODEL_ASK_S2, p->peak[MODEL_S2X].value_g, to->peak[MODEL_S2X].value_g},
	        {MODEL_ASK_S2, p->peak[MODEL_S2Y].value_g, to->peak[MODEL_S2Y].value_g},
	        {MODEL_ASK_S2, p->resultant[1].value_g, to->resultant[1].value_g},
	        {MODEL_ASK_DIRECTION, p->direction_deg[0], to->direction_deg[0]},
	        {MODEL_ASK_DIRECTION, p->direction_deg[1], to->direction_deg[1]},
	};
	double worst = 0.0;

	for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++) {
		bool lag = all[i].asked == MODEL_ASK_LAG && lag_s > 0.0;
		double apart = fabs(all[i].value - all[i].to) / (lag ? lag_s : fabs(all[i].to));

		if ((all[i].asked & asked) && !(apart <= worst)) /* a NaN stays */
			worst = apart;
	}
	return worst;
}

/* What each rung is asked with: no more digits than are wanted. */
static struct model_options options_of(const struct model_options *options, enum model_fidelity rung)
{
	double most = options->asked & (MODEL_ASK_LAG | MODEL_ASK_DIRECTION) ? NUMERICAL_MAX_INSTANT
	                                                                     : NUMERICAL_MAX;
	struct model_options o = *options;

	if (rung == MODEL_COUPLED)
		o.refinements = MODEL_STIFFNESS | MODEL_WEDGE;
	if (o.asked) {
		o.ring = false;
		o.tolerance = fmax(fmin(NUMERICAL_SHARE * o.accuracy, most), MODEL_TOLERANCE_MIN);
	}
	return o;
}

static int model_auto_solve(const struct drop *drop, enum model_fidelity rung,
                            const struct model_options *options, const char *why, struct model_prediction *p,
                            char *message)
{
	struct model_options o = options_of(options, rung);

	return rung_solve(drop, rung, &o, why, p, message);
}

/* What no rung above can mend: the answer must not depend on it. */
static bool ends(int error)
{
	return error == DT_E_MEMORY;
}

/* planar as by itself; sdof, which says what it can, where planar has no answer. */
static int planar_or_sdof(const struct drop *drop, const struct model_options *options, const char *why,
                          struct model_prediction *p, char *message)
{
	int error = rung_solve(drop, MODEL_PLANAR, options, why, p, message);

	if (ends(error))
		return error;
	if (error)
		return model_auto_solve(drop, MODEL_SDOF, options, "planar has no answer here", p, message);
	p->difference = options->tolerance;
	return 0;
}

/* Whether two masses may do: where the corner feels much less than the box's mass they do not, and need not
 * be tried. */
static bool coupled_may_serve(const struct drop *d, const struct model_options *o)
{
	double across = d->lever_y_m * d->cosine - d->lever_x_m * d->sine;
	double felt = log1p(across * across * d->scene->product_case_mass_kg / d->inertia_kg_m2);

	return !(o->asked & ~(unsigned)(MODEL_ASK_LAG | MODEL_ASK_DIRECTION)) ||
	       FELT_SHARE * felt <= o->accuracy;
}

/* Takes a rung whose answers differ from planar's by no more than is allowed, the error of the numbers
 * included: 1, 0, DT_E_MEMORY. */
static int auto_serves(const struct drop *drop, enum model_fidelity rung, const struct model_options *o,
                       const char *why, const struct model_prediction *planar, struct model_prediction *p)
{
	int error = model_auto_solve(drop, rung, o, why, p, NULL);
	double lag_s = 1e-6 * o->lag_accuracy_us / o->accuracy;

	if (error)
		return ends(error) ? error : 0;
	p->difference = auto_apart(p, planar, o->asked, lag_s) + options_of(o, rung).tolerance;
	p->next = MODEL_PLANAR;
	p->next_change = p->difference;
	return p->difference <= o->accuracy;
}

static int auto_least(const struct drop *drop, const struct model_options *o, const char *why,
                      struct model_prediction *p, char *message)
{
	struct model_prediction planar;
	unsigned evaluations;
	int error = model_auto_solve(drop, MODEL_PLANAR, o, why, &planar, message), serves;

	if (ends(error))
		return error;
	if (error) /* of loose steps, perhaps */
		return planar_or_sdof(drop, o, why, p, message);
	evaluations = planar.evaluations;
	serves = auto_serves(drop, MODEL_SDOF, o, why, &planar, p);
	if (serves == 0 && coupled_may_serve(drop, o)) {
		serves = auto_serves(drop, MODEL_COUPLED, o, why, &planar, p);
		evaluations += p->evaluations;
	}
	if (serves < 0)
		return drop_refuse(message, serves, "%s", error_text(serves));
	if (serves == 0) {
		*p = planar;
		p->difference = options_of(o, MODEL_PLANAR).tolerance;
	}
	p->evaluations = evaluations;
	return 0;
}

int auto_solve(const struct drop *drop, const struct model_options *options,
               struct model_prediction *prediction, char message[MODEL_MESSAGE_MAX])
{
	struct model_options o = *options;
	struct model_prediction p;
	bool whole = !o.asked || !(o.refinements & MODEL_OF_RUNG);
	char why[64] = "answers every question asked";
	int error;

	if (!(o.accuracy > 0.0))
		o.accuracy = MODEL_ACCURACY;
	if (!(o.lag_accuracy_us > 0.0))
		o.lag_accuracy_us = MODEL_LAG_ACCURACY_US;
	if (!whole)
		snprintf(why, sizeof(why), "the least that answers within %.4g %%", 100.0 * o.accuracy);
	error = whole ? planar_or_sdof(drop, &o, why, &p, message) : auto_least(drop, &o, why, &p, message);
	if (!error)
		*prediction = p;
	return error;
}
