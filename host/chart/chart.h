/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_CHART_H
#define DT_HOST_CHART_CHART_H
/*
 * `droptower chart`: what the estimates cost and where they fail, as pictures, tables and CSV files.
 */
#include <stddef.h>
#include <stdio.h>

#include "common/scenes/scene.h"
#include "host/chart/synthetic.h"

enum { CHART_MESSAGE_MAX = 512, CHART_ABOUT_MAX = 160 };

struct chart_options {
	const char *folder; /* must exist */
	unsigned drops;     /* of each scene */
	unsigned long seed;
	/* accuracy and stability: */
	struct synthetic_scene drop; /* nothing wrong with it */
	bool no_plate;               /* what needs one is left out */
	char about[CHART_ABOUT_MAX]; /* of the drop, for titles */
};

/* The drop that they take: of a scene, as host/model predicts its peaks, times and ring-down, with the
 * scene's noise and range; NULL: synthetic_scene(). 0, or DT_E_* with a line in message. */
DT_MUST_USE int chart_drop(const struct scene *scene, struct chart_options *options, char *message);

/* Error against cost of every method at four noise levels, accuracy-QUANTITY.svg and .csv; ratios to the
 * bound as a table to out. 0, or DT_E_* with a line in message. */
DT_MUST_USE int chart_accuracy(const struct chart_options *options, FILE *out, char *message);

/* Every method under every trouble, stability-QUANTITY.svg and .csv; what fails where as a table to out. */
DT_MUST_USE int chart_stability(const struct chart_options *options, FILE *out, char *message);

/* The model's rungs: model-tables, model-finest and model-integrators, .svg and .csv; tables to out. drops
 * and seed play no part. 0, or DT_E_* with a line in message. */
DT_MUST_USE int chart_model(const struct chart_options *options, FILE *out, char *message);
DT_MUST_USE int chart_integrators(const struct chart_options *options, FILE *out, char *message);

/* Where the model's methods fail, model-stability-*.svg and .csv; what each picture says to out. drops: of
 * each cell that depends on chance. 0, or DT_E_* with a line in message. */
DT_MUST_USE int chart_model_stability(const struct chart_options *options, FILE *out, char *message);

#endif
