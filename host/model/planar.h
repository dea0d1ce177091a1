/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_PLANAR_H
#define DT_HOST_MODEL_PLANAR_H
/*
 * A rigid box that strikes the mat with one corner and moves and turns in its plane, and a plate (a point at
 * the box's centre of gravity) on isotropic mounts inside it, gravity on.
 *
 *   corner   at -lever_x along X and -lever_y along Y from the centre of gravity
 *   across   contact.h's law, k constant during the drop
 *   along    a spring of `grip` times the normal one's tangent, its force held to friction times the normal
 *            one; beyond that limit it stretches no further (Mindlin 1949 gives 2/3 for two smooth bodies);
 *            grip = 0: frictionless
 *   mounts   k (1 + softening/(1 + (|u|/u_s)^2)) u + c u', u the plate's place as seen from the turning box
 *
 * Any corner may touch, and touch again: body.h. Time 0 is the first touch. Readings are as an
 * accelerometer gives them (0 in free fall), along the body's axes, which turn. SI units, angles from the
 * vertical to X in rad; pure functions, any thread.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "host/model/body.h"
#include "host/model/contact.h"
#include "host/model/watch.h"

struct planar {
	double case_mass_kg, plate_mass_kg; /* plate_mass_kg = 0: no plate */
	double inertia_kg_m2;               /* of the box */
	double angle_rad, gravity_m_s2, speed_m_s;
	double lever_x_m, lever_y_m;
	double stiffness_n_m15; /* with wedge: at BODY_WEDGE_RAD */
	bool wedge;
	struct contact_law law;
	double grip, friction;
	double mount_n_m, mount_damping_n_s_m;
	double softening, softening_m; /* softening_m: u_s; unused with softening = 0 */
	bool mounts_turn;              /* their dampers turn with the box; else they stand in the room */
	double s2_offset_m, s1_yaw_rad;
	double tolerance; /* of a step, against the largest depth and the speed of impact */
	bool count_ring;  /* follow the plate for three oscillations more */
	bool rough; /* peaks as good as long steps give them, and an end as soon as all asked for passed */
	unsigned skipped; /* bits 1 << enum planar_signal whose peaks nobody asks for; they come as 0 */
};

enum { PLANAR_AXES = 4 }; /* the first of the signals */

enum planar_signal {
	PLANAR_S1X,
	PLANAR_S1Y,
	PLANAR_S2X,
	PLANAR_S2Y,
	PLANAR_S1R,
	PLANAR_S2R,
	PLANAR_CENTRE_R, /* resultant at the box's centre of gravity */
	PLANAR_DEPTH,    /* m */
	PLANAR_TRAVEL,   /* m, plate against box */
	PLANAR_SIGNALS
};

struct planar_result {
	struct watch_peak peak[PLANAR_SIGNALS];
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

/* 0, or DT_E_NUMERIC. Peaks are those up to until_s: 0.6 plate periods after the release. */
DT_MUST_USE int planar_solve(const struct planar *planar, struct planar_result *result);

struct planar_sample {
	double axis[PLANAR_AXES]; /* PLANAR_S1X to PLANAR_S2Y, m/s^2 */
	double force_n, depth_m, travel_m, angle_rad;
};

/* Samples at start_s + i step_s, i < count, step_s > 0; all zero before the touch. */
DT_MUST_USE int planar_history(const struct planar *planar, double start_s, double step_s,
                               struct planar_sample *samples, size_t count);

#endif
