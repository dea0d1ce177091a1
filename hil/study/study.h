/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_STUDY_H
#define DT_HIL_STUDY_STUDY_H
/*
 * The study, again: what it printed, what the drops on the simulated tower gave, what the models say.
 *
 * Accelerations in g, positive along the body axis away from the mat (the study prints them with the opposite
 * sign). Times in s. What is not there is NAN. Memory is the caller's, in one struct study.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "common/error.h"
#include "common/scenes/scene.h"
#include "host/archive/table.h"
#include "host/model/model.h"

enum {
	STUDY_GEOMETRIES = 3,
	STUDY_ANGLES = 5,
	STUDY_SENSORS = 2,
	STUDY_DROPS_MAX = 50, /* of one series */
	STUDY_PATH_MAX = 4400,
	STUDY_MESSAGE_MAX = 800,
};

enum study_quantity { STUDY_X, STUDY_Y, STUDY_R, STUDY_Z, STUDY_QUANTITIES };

/* Of a drop, besides its peaks. */
enum study_feature {
	STUDY_LAG,       /* s, S1's resultant peak after S2's */
	STUDY_FREQUENCY, /* Hz, of the plate over its first three oscillations */
	STUDY_DAMPING,
	STUDY_CONTACT, /* s, geometry 1: X above 1 % of its peak */
	STUDY_REBOUND, /* by the velocity change of the box */
	STUDY_FEATURES
};

struct study_value {
	double mean, sd;
};

struct study_series {
	struct study_value published[STUDY_SENSORS][STUDY_QUANTITIES];
	double published_ratio[STUDY_QUANTITIES]; /* of S1 to geometry 1's; Z and geometry 1: NAN */
	struct archive_cell cell;                 /* of the drops: what the archive knows of them */
	double contact_s[STUDY_DROPS_MAX], rebound[STUDY_DROPS_MAX]; /* [cell.drops], and what it does not */
	char log[STUDY_PATH_MAX];                                    /* of the last drop */
	double s2_peak_s;                                            /* in it */
	struct model_prediction planar, coupled;
};

struct study {
	struct scene scene[STUDY_GEOMETRIES];
	struct study_series series[STUDY_GEOMETRIES][STUDY_ANGLES];
};

extern const char *const study_geometry[STUDY_GEOMETRIES]; /* "1", "2A", "2B" */
extern const double study_angle_deg[STUDY_ANGLES];

/* Reads the published tables and the scenes, solves the models. Paths are relative to the repository. 0, or
 * DT_E_* and one line in message. */
DT_MUST_USE int study_open(struct study *study, char message[STUDY_MESSAGE_MAX]);

/* Takes every drop of an archive that is of the study's scenes and angles and not rejected; DT_E_EMPTY
 * when a geometry has none. */
DT_MUST_USE int study_read(struct study *study, const char *folder, char message[STUDY_MESSAGE_MAX]);

/* Mean and standard deviation over the drops of a series that have the value. */
struct study_value study_peak(const struct study_series *series, size_t sensor, enum study_quantity quantity);
struct study_value study_mean(const struct study_series *series, enum study_feature feature);

/* (here - published)/published in percent. */
double study_difference(const struct study_series *series, size_t sensor, enum study_quantity quantity);

/* ---- what is told of it; text and page get the same ---- */

struct sheet;

/* What this is, and how it came out, in a few lines. */
void study_introduce(const struct study *study, struct sheet *sheet);

/* Tables, features, deviations; whether the study agrees, as far as all of it was dropped. */
bool study_tell(const struct study *study, struct sheet *sheet);

/* The figures as documents, malloc'ed. ALL is those of geometry 2A and 2B in one picture. */
enum study_figure { STUDY_FIGURE_10, STUDY_FIGURE_11, STUDY_FIGURE_12, STUDY_FIGURE_ALL, STUDY_FIGURES };
extern const char *const study_figure_name[STUDY_FIGURES]; /* of its file */
extern const char *const study_figure_title[STUDY_FIGURES];
extern const char *const study_figure_text[STUDY_FIGURES]; /* what to see in it */
DT_MUST_USE int study_draw(const struct study *study, enum study_figure figure, char **svg,
                           char message[STUDY_MESSAGE_MAX]);

/* One line for each sensor row. */
void study_write_csv(const struct study *study, FILE *out);

#endif
