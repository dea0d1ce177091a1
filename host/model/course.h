/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_COURSE_H
#define DT_HOST_MODEL_COURSE_H
/*
 * The course of a drop: body.h's box from its first touch on, whatever its corners do, by steps that end
 * where one touches, leaves, slips or holds again. Peaks, features and histories come from the same steps.
 *
 * Time 0 is the first touch. Readings are as an accelerometer gives them (0 in free fall), along the body's
 * axes, which turn. SI units, angles from the vertical to X in rad; pure functions, any thread.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "host/model/body.h"
#include "host/model/peak_tracker.h"

struct course {
	struct body body; /* the caller's part of it */
	double tolerance; /* of a step, against the largest depth and the speed of impact */
	bool count_ring;  /* follow the plate for three oscillations more */
	bool rough; /* peaks as good as long steps give them, and an end as soon as all asked for passed */
	unsigned skipped; /* bits 1 << enum course_signal whose peaks nobody asks for; they come as 0 */
};

enum { COURSE_AXES = 4 }; /* the first of the signals */

enum course_signal {
	COURSE_S1X,
	COURSE_S1Y,
	COURSE_S2X,
	COURSE_S2Y,
	COURSE_S1R,
	COURSE_S2R,
	COURSE_CENTRE_R, /* resultant at the box's centre of gravity */
	COURSE_DEPTH,    /* m */
	COURSE_TRAVEL,   /* m, plate against box */
	COURSE_SIGNALS
};

struct course_result {
	struct peak_tracker_peak peak[COURSE_SIGNALS];
	double s1_direction_rad, s2_direction_rad; /* from X towards Y, when the resultant peaks */
	double contact_time_s;                     /* NAN when the corner stays in the mat */
	double restitution;           /* corner's speed of leaving over that of impact, NAN too */
	double velocity_change_m_s;   /* of box and plate together, upwards, by the contact force */
	double spin_rad_s;            /* at the release; positive turns X away from the vertical */
	double ring_hz, ring_damping; /* mean over three oscillations after the release; NAN if not asked */
	bool cut_short;    /* all asked for had passed before the release: what comes of the release is NAN */
	double second_s;   /* the second touch of any corner, within what the peaks are of; NAN: none */
	int second_corner; /* whose; 0 is the one that struck first */
	double until_s;    /* what the peaks are of ends here */
	unsigned evaluations;
};

/* 0, or DT_E_NUMERIC. Peaks are those up to until_s: 0.6 plate periods after the release, or after those of
 * the touches that began by then or while one of those lasted. */
DT_MUST_USE int course_solve(const struct course *course, struct course_result *result);

struct course_sample {
	double axis[COURSE_AXES]; /* COURSE_S1X to COURSE_S2Y, m/s^2 */
	double force_n, depth_m, travel_m, angle_rad;
};

/* Samples at start_s + i step_s, i < count, step_s > 0; all zero before the touch. */
DT_MUST_USE int course_history(const struct course *course, double start_s, double step_s,
                               struct course_sample *samples, size_t count);

#endif
