/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_TRIAL_H
#define DT_HIL_STUDY_TRIAL_H
/*
 * The planar model fitted to the study's printed means, or to some of them, by least squares: six numbers at
 * the most. SI units, angles in deg.
 */
#include <stdbool.h>

#include "hil/study/study.h"

/* What is fitted, in units of what the scenes have. */
enum {
	TRIAL_STIFFNESS,
	TRIAL_GRIP,
	TRIAL_BALANCE,
	TRIAL_SOFTENING,
	TRIAL_DAMPING,
	TRIAL_YAW,
	TRIAL_PARAMETERS
};
#define TRIAL_ALL ((1u << TRIAL_PARAMETERS) - 1u)

enum {
	TRIAL_AXES = 4,                  /* X and Y of S1 and S2 */
	TRIAL_MIDDLE = STUDY_ANGLES / 2, /* features are told at 25 deg */
	TRIAL_FEATURES = 7,
	TRIAL_DATA =
	        STUDY_GEOMETRIES * STUDY_ANGLES * TRIAL_AXES + TRIAL_FEATURES, /* all numbers there are */
};

extern const struct trial_parameter {
	const char *what, *unit;
	double scale;
	double weak_sd; /* what is known beforehand where a few drops are all there is; of logarithms */
	bool logarithm; /* it is above 0 */
} trial_parameters[TRIAL_PARAMETERS];

/* A fit without some angles or one box, with some refinements and some numbers. */
struct trial {
	const struct study *study;
	unsigned refinements, free; /* bits of MODEL_... and of the parameters */
	bool sharp;                 /* balance: the box's own corner */
	unsigned angles;            /* left out: bits of them */
	int geometry;               /* left out; -1: none */
	bool alone;                 /* that one is all there is, with the weak knowledge of the parameters */
	double value[TRIAL_PARAMETERS], sd[TRIAL_PARAMETERS];
	double covariance[TRIAL_PARAMETERS][TRIAL_PARAMETERS]; /* of value, or of its logarithm */
	size_t data, fitted;
	double chi2, aicc;
	struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES];
};

/* Starts at the scenes' values; a number that is not free stays there, and softening and yaw at 0. 0,
 * DT_E_MEMORY or DT_E_NUMERIC. */
DT_MUST_USE int trial_fit(struct trial *trial);

/* The drops of other values; every: those left out, too. 0, or as model_solve. */
DT_MUST_USE int trial_solve(const struct trial *trial, const double value[TRIAL_PARAMETERS],
                            struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES], bool every);
bool trial_left_out(const struct trial *trial, size_t geometry, size_t angle);

/* Of a sensor's printed mean: its own, and what the model lacks at the least. No SD of a resultant is
 * printed. */
double trial_error(const struct study_value mean[STUDY_QUANTITIES], size_t quantity);

#endif
