/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_BODY_H
#define DT_HOST_MODEL_BODY_H
/*
 * A rigid box that meets the mat with its corners and moves (and, if it may, turns) in its plane, and a
 * plate, a point at the box's centre of gravity, on isotropic mounts inside it; gravity on. Equations of
 * motion and readings only; whoever integrates them chooses how.
 *
 *   corners  at -+lever_x along X and -+lever_y along Y from the centre of gravity; corner 0 (-,-) strikes
 *            first, at the state body_start gives
 *   across   N = K d^1.5 (1 + D d'/v), never pulling; v the speed of the touch, K of the angle at the touch
 *            if `wedge`; both are kept per corner and set by body_touch
 *   along    a spring of `grip` times the normal one's tangent (Mindlin 1949 gives 2/3 for two smooth
 *            bodies), its force held to friction times the normal one: a corner that would slide further
 *            slips, its deflection grows with the limit only and does not fall with it; no friction
 *            where grip is 0
 *   mounts   k (1 + softening/(1 + |u|^2 softening_per_m2)) u + c u', u the plate's place as seen from the
 *            turning box (mounts_turn) or from the room
 *
 * A body that does not turn moves along the vertical only: four states, no grip. Its S2 reads what a box that
 * felt this force would turn by all the same.
 *
 * Readings are as an accelerometer gives them (0 in free fall, positive along the body axis away from the
 * mat), m/s^2, along the body's axes, which turn. SI units, angles from the vertical to X in rad; pure
 * functions, any thread.
 */
#include <stdbool.h>

#include "common/units.h"
#include "host/model/contact.h"

enum { BODY_CORNERS = 4, BODY_FIRST = 1 }; /* BODY_FIRST: the mask of corner 0 */

/* What an integrator carries. The plate's are relative to the box; TURN and SPIN are clockwise, away from the
 * vertical to X; how far the box went across matters to nothing. */
enum body_state {
	BODY_UP, /* centre of gravity, from where it was at the first touch */
	BODY_V_UP,
	BODY_OFF_UP,
	BODY_OFF_V_UP,
	BODY_UPRIGHT,             /* how many a body has that does not turn */
	BODY_TURN = BODY_UPRIGHT, /* from the angle at the first touch */
	BODY_SPIN,
	BODY_V_ACROSS,
	BODY_OFF_ACROSS,
	BODY_OFF_V_ACROSS,
	BODY_GRIP,       /* tangential deflection of the mat under corner 0, */
	BODY_ONE_CORNER, /* how many states while no other corner touches; */
	BODY_STATES = BODY_ONE_CORNER + BODY_CORNERS - 1 /* then that under the others */
};

enum body_hold {
	BODY_STICKS, /* the deflection follows the corner */
	BODY_SLIPS,  /* it follows the limit, which grows more slowly than the corner slides */
	BODY_LAGS    /* it stays beyond a limit that fell, until that catches up or the corner turns back */
};

struct body_touch {
	double stiffness_n_m15; /* K of the touch a corner is in */
	double damping_s_m;     /* D over the speed of that touch */
	enum body_hold hold;
	double side; /* -1 or 1: where to the corner is deflected; of one that does not stick */
};

struct body {
	/* set by the caller */
	bool turns;
	double case_mass_kg, plate_mass_kg; /* plate_mass_kg = 0: no plate */
	double inertia_kg_m2;               /* of the box */
	double angle_rad, gravity_m_s2, speed_m_s;
	double lever_x_m, lever_y_m;
	double stiffness_n_m15; /* K; with wedge, at BODY_WEDGE_RAD */
	bool wedge;             /* K times sin(50 deg)/sin(2 angle), the width of a right angle's imprint */
	struct contact_law law;
	double grip, friction;
	double mount_n_m, mount_damping_n_s_m;
	double softening, softening_per_m2; /* 1/u_s^2 */
	bool mounts_turn;                   /* their dampers turn with the box */
	double s2_offset_m, s1_yaw_rad;
	bool clips; /* for steps that do not end where a hold does: the deflection stops beyond the limit */

	/* by body_prepare */
	double cosine, sine, corner_up_m; /* of the angle; of corner 0 from the centre, at the touch */
	double yaw_cosine, yaw_sine;
	double per_case, per_plate, per_inertia; /* reciprocals; per_plate 0 without a plate */
	double per_mass;                         /* 1/m_p + 1/m_B, 0 without a plate */
	struct body_touch touch[BODY_CORNERS];
};

/* Wedge: where K was identified, and how far from flat an imprint still is one. */
#define BODY_WEDGE_RAD UNITS_RAD(25.0)
#define BODY_WEDGE_MIN_RAD UNITS_RAD(10.0)
double body_wedge(double angle_rad);

/* A later touch is not taken for slower than this, so that a box comes to rest. */
#define BODY_SPEED_MIN_M_S 0.1

/* After the caller's part is set or changed: works out the rest, corner 0 about to touch. */
void body_prepare(struct body *body);

/* The state at the first touch. */
void body_start(const struct body *body, double y[BODY_STATES]);

/* Depth of a corner in the mat (negative: above it), and how fast it closes in. */
double body_depth(const struct body *body, const double y[], int corner);
double body_closing(const struct body *body, const double y[], int corner);

/* A corner touches now: sets its K, v and hold, clears its grip. */
void body_touches(struct body *body, double y[], int corner);

/* Above 0 where a touching corner's hold is over; body_holds then gives it the next one. */
double body_lets_go(const struct body *body, unsigned touching, const double y[], int corner);
void body_holds(struct body *body, unsigned touching, double y[], int corner);
/* Where the tangential deflection under a corner stands in the state. */
int body_grip(int corner);

/* What the sensors read, and what else an instant shows. */
struct body_reading {
	double s1_x, s1_y, s2_x, s2_y; /* m/s^2 */
	double box_x, box_y;           /* at the box's centre of gravity */
	double normal_n;               /* of all corners together */
	double depth_m;                /* of the deepest touching corner, 0 when none touches */
	double lowest_m;               /* of the lowest corner: its depth, below 0 above the mat */
	double travel_m;               /* plate against box; signed if the body does not turn */
};
void body_read(const struct body *body, unsigned touching, const double y[], struct body_reading *reading);

/* Rates of the states; `touching`: the mask of the corners the mat may push now (its grip states other than
 * corner 0's are left alone unless one of theirs is in it). reading may be NULL. */
void body_rates(const struct body *body, unsigned touching, const double y[], double rate[],
                struct body_reading *reading);

/* The plate alone in free flight, the box's spin constant: rates of its off-states, in the order
 * across, up, v_across, v_up. */
void body_swing(const struct body *body, double spin, const double off[4], double rate[4]);

#endif
