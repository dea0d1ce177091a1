/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ACCURACY_CELLS_H
#define DT_TESTS_ACCURACY_CELLS_H
/*
 * What is promised of the estimates, as scenes of known truth and limits on what estimate_record makes of
 * many drops of each. A cell is one quantity of one scene:
 *
 *   ratio     root mean square error over the Cramer-Rao bound
 *   bias      mean error, in parts of the bound or in the quantity's unit, beyond two standard errors of it
 *   coverage  drops whose truth lies within two reported standard uncertainties, of those with a value
 *   marked    drops that are flagged as the fault that they have
 *   absent    drops without a value; gross: those off by more than 15 %
 *
 * All limits are two-sided where both sides mean something: an error below the bound is a mistake of the
 * test or an estimator that knows the answer.
 */
#include "host/chart/campaign.h"
#include "host/estimate/estimate.h"

enum quantity {
	QUANTITY_PEAK_X,
	QUANTITY_PEAK_Y,
	QUANTITY_PEAK_Z,
	QUANTITY_PEAK_TIME_X,
	QUANTITY_PEAK_TIME_Y,
	QUANTITY_WIDTH_X,
	QUANTITY_VELOCITY_X,
	QUANTITY_CONTACT_X,
	QUANTITY_FITTED_VELOCITY_X,
	QUANTITY_RESULTANT,
	QUANTITY_RESULTANT_TIME,
	QUANTITY_FREQUENCY_X,
	QUANTITY_FREQUENCY_Y,
	QUANTITY_FREQUENCY,
	QUANTITY_NATURAL,
	QUANTITY_DAMPING_X,
	QUANTITY_DAMPING_Y,
	QUANTITY_DAMPING,
	QUANTITY_LAG_X,
	QUANTITY_LAG_Y,
	QUANTITY_LAG,
	QUANTITY_PLATE_PEAK_X, /* S1's; the peaks above are S2's */
	QUANTITY_PLATE_PEAK_Y,
	QUANTITY_PLATE_TIME_X,
	QUANTITY_PLATE_TIME_Y,
	QUANTITY_PLATE_RESULTANT,
	QUANTITY_PLATE_RESULTANT_TIME,
	QUANTITIES
};

/* What a scene's drops are looked at for. */
enum group {
	GROUP_KNOWN,   /* the family is told */
	GROUP_UNKNOWN, /* it is not */
	GROUP_SKEWED,  /* Hunt-Crossley, not told */
	GROUP_APART_KNOWN,
	GROUP_APART,     /* X and Y peak apart */
	GROUP_DISTURBED, /* the decay's troubles */
	GROUP_TWO_MODES,
	GROUP_LOUD, /* 30 and 100 g */
	GROUP_CLIPPED,
	GROUP_HOLE,  /* four samples lost at the peak */
	GROUP_WRONG, /* a family that it is not */
	GROUP_FAULT,
	GROUPS
};

/* The study's means at 25 degrees. */
enum geometry { GEOMETRY_2A, GEOMETRY_2B };

struct cell_scene {
	const char *name;
	struct synthetic_scene scene;
	enum estimate_family family; /* what the estimators are told */
	enum geometry geometry;
	enum group group;
	unsigned drops, refused; /* estimate_record failed */
	unsigned marked;         /* as flagged as the scene asks for */
	unsigned second;         /* drops with a second mode, in any axis or the plate */
	struct tally tally[QUANTITIES];
};

struct cells {
	struct cell_scene *scene; /* [count] */
	unsigned count;
};

struct cells_options {
	unsigned drops;             /* of each scene */
	bool all;                   /* else the short set: sigma 1 g and what must never fail */
	const char *only;           /* part of a scene's name; NULL: all of them */
	const struct cells *bounds; /* of the same scenes, to take the bounds from; NULL: they are computed */
};

/* Runs every scene. Ends the program when it cannot. Free with cells_free. */
void cells_run(const struct cells_options *options, struct cells *cells);
void cells_free(struct cells *cells);

const char *group_name(enum group group);

enum cells_print { CELLS_ALL, CELLS_FAILURES, CELLS_NOTHING };

/* Prints a line for every cell of the group that has a limit; returns how many fail. slack: standard
 * deviations of the Monte Carlo's own scatter that the limits are widened by. */
unsigned cells_judge(const struct cells *cells, enum group group, double slack, enum cells_print print,
                     unsigned *judged);

#endif
