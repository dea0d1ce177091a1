/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_MOTION_H
#define DT_HOST_FIT_MOTION_H
/*
 * The history of one drop for a fit: host/model/body.h (its mounts turn with the box) by classical
 * Runge-Kutta on fixed nodes, the same for every set of parameters, so that differences of two histories are
 * smooth in what differs. Only the first touch of one corner; its contact is over for good when the depth is
 * back at 0. Time 0 is the touch. SI units; pure functions, any thread.
 */
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"

/* What drops of one product share, in the coordinates of the fit. */
enum motion_shared {
	MOTION_LN_STIFFNESS, /* ln of stiffness_n_m15 */
	MOTION_LOGIT_RESTITUTION,
	MOTION_BALANCE_DEG,
	MOTION_LN_GRIP,    /* ln of tangential_ratio */
	MOTION_LN_MOUNT_K, /* the rest: of a scene with a plate */
	MOTION_SOFTENING,
	MOTION_LN_STRAIN,
	MOTION_LN_MOUNT_C,
	MOTION_YAW_DEG,
	MOTION_SHARED
};

/* Those and what is each drop's own. */
enum { MOTION_GAMMA_DEG = MOTION_SHARED, MOTION_LN_SPEED, MOTION_PARAMETERS };

enum { MOTION_S1X, MOTION_S1Y, MOTION_S2X, MOTION_S2Y, MOTION_AXES };

#define MOTION_FINE_S 20e-6   /* between nodes up to MOTION_FINE_NODES */
#define MOTION_COARSE_S 50e-6 /* beyond */
enum { MOTION_FINE_NODES = 400, MOTION_NODES = MOTION_FINE_NODES + 660 + 1 };

struct motion {
	double axis[MOTION_NODES][MOTION_AXES]; /* g, behind the sensors' high-pass */
	size_t nodes;                           /* filled; fewer where another corner touches */
	double end_s;                           /* of the last one */
};

/* The true motion, without sensors. */
enum motion_derived {
	MOTION_CONTACT_S,   /* contact time; NAN where the corner stays */
	MOTION_RESTITUTION, /* upward speed of the centre of gravity of box and plate at the release, over
	                       that of impact */
	MOTION_SPIN_RAD_S,
	MOTION_LAG_S,   /* S1's largest resultant after S2's */
	MOTION_LAG_X_S, /* S1X's largest after S2X's */
	MOTION_S1R_G,
	MOTION_S2R_G,
	MOTION_PEAK_S1X_G, /* largest with its sign; the four axes in order */
	MOTION_PEAK_S1Y_G,
	MOTION_PEAK_S2X_G,
	MOTION_PEAK_S2Y_G,
	MOTION_DERIVED
};

double motion_node_s(size_t node);

/* Parameters of a scene. They are finite for a scene that was checked and has, with a plate, softening_strain
 * and damping_n_s_m above 0 (fit.h sees to that). */
void motion_of_scene(const struct scene *scene, double p[MOTION_PARAMETERS]);

/* The other way round, of what drops share; mounts and yaw where there is a plate. */
void motion_to_scene(const double p[MOTION_SHARED], struct scene *scene);

/* A shared parameter as a scene has it, from the fit's coordinate p; slope, which may be NULL: its
 * derivative. */
double motion_value(enum motion_shared parameter, double p, double *slope);

/* Nodes up to most. derived may be NULL. 0, or DT_E_NUMERIC where these are no parameters of a product. */
DT_MUST_USE int motion_solve(const struct scene *scene, const double p[MOTION_PARAMETERS], size_t most,
                             struct motion *motion, double derived[MOTION_DERIVED]);

#endif
