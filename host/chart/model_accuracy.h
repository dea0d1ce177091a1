/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_MODEL_ACCURACY_H
#define DT_HOST_CHART_MODEL_ACCURACY_H
/*
 * How far every rung of host/model is from the study's tables and from the finest rung.
 */
#include "common/error.h"

enum ladder_quantity { LADDER_PLATE, LADDER_S2, LADDER_BOX, LADDER_QUANTITIES };

enum { LADDER_RUNGS = 9 };

/* Means of magnitudes, in %; NAN where the rung does not say. */
struct ladder {
	const char *name[LADDER_RUNGS];
	double tables[LADDER_RUNGS][LADDER_QUANTITIES];
	double finest[LADDER_RUNGS][LADDER_QUANTITIES];
	double constant[LADDER_QUANTITIES]; /* from the tables: the mean over the angles, per product and
	                                       column */
	double cost_us[LADDER_RUNGS];       /* of one drop; median over the study's */
};

/* timed: costs too, else NAN. 0, or DT_E_* of host/model. */
DT_MUST_USE int ladder_find(int timed, struct ladder *ladder);

#endif
