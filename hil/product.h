/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_PRODUCT_H
#define DT_HIL_PRODUCT_H
/*
 * The product: a rigid box in the plane whose corners meet the mat, and inside it the plate on its
 * mounts. Written apart from host/model and sharing no formula with it, so that each can check the other.
 *
 * World axes: x to the side, y up, the mat's face at y = 0. The angle is measured from the vertical to the
 * body's X axis, so that eX = (sin, cos) and eY = (-cos, sin). The centre of gravity is the body's origin;
 * the corners are at (+-lx, +-ly) with ly = half the width and lx = ly / tan(balance angle): the outline
 * that the recorded drops ask for, which is not the box's own.
 *
 *   contact   N = K d^1.5 (1 + D d'/v0), never pulling, d the depth of a corner, v0 its speed at touch-down;
 *             K = K25 sin(50 deg) / |sin(2 angle)|, the width of a right-angled wedge's imprint;
 *             D from the restitution e: ln((1 + D)/(1 - e D)) = D (1 + e)   (Hunt and Crossley's law)
 *   along it  a spring of tangential_ratio times the normal stiffness, held to friction times N
 *   mounts    F = k (1 + softening / (1 + (|u| / (softening_strain cube))^2)) u + c u', any direction
 *
 * The plate is a point at the box's centre; it moves in the plane and does not turn. The mounts act on the
 * box at its centre of gravity. Only the first touch-down was ever measured; later ones follow the same law
 * with K and v0 taken anew, v0 not below PRODUCT_APPROACH_MIN so that the box comes to rest.
 *
 * Plain functions on a struct the caller owns: no heap, no errors, any context. The scene must have passed
 * scene_check. SI units throughout. One call of product_step integrates by classical Runge-Kutta.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"

enum { PRODUCT_CORNERS = 4 };

enum product_state {
	PRODUCT_X, /* the box's centre of gravity */
	PRODUCT_Y,
	PRODUCT_ANGLE, /* rad */
	PRODUCT_VX,
	PRODUCT_VY,
	PRODUCT_SPIN, /* d(angle)/dt */
	PRODUCT_PLATE_X,
	PRODUCT_PLATE_Y,
	PRODUCT_PLATE_VX,
	PRODUCT_PLATE_VY,
	PRODUCT_GRIP, /* tangential deflection of the mat under each corner */
	PRODUCT_STATES = PRODUCT_GRIP + PRODUCT_CORNERS
};

#define PRODUCT_STEP_S 20e-6 /* the longest of the first contact; its error stays below a converter code */
#define PRODUCT_APPROACH_MIN_M_S 0.1
#define PRODUCT_REST_SPEED 1e-11 /* m/s, rad/s */
#define PRODUCT_REST_RATE 1e-8   /* of these, a second: 3e-8 of a converter code */

/* Sine and cosine of the angle in a state. */
struct product_turn {
	double sn, cs;
};

struct product {
	double gravity_m_s2;
	double case_mass_kg, plate_mass_kg, inertia_kg_m2;
	double lever_x_m, lever_y_m;
	double radius_m;                                                  /* of the corners */
	double stiffness25_n_m15, hysteresis, tangential_ratio, friction; /* hysteresis: D */
	double mount_n_m, mount_damping_n_s_m, softening, softening_per_m2;
	double s2_offset_m, yaw_cos, yaw_sin;

	double state[PRODUCT_STATES];
	double rate[PRODUCT_STATES]; /* of state, now */
	double stiffness_n_m15[PRODUCT_CORNERS], approach_m_s[PRODUCT_CORNERS];
	double strike_m_s, contact_step_s,
	        mount_step_s; /* from product_strike on; the steps by speed and mounts */
	struct product_turn turn;
	bool at_rest; /* nothing moves it any more, until the next product_strike */
};

/* What the sensors feel, m/s^2 along their axes: acceleration plus the reaction to gravity, so 0 in free
 * fall. S1 sits on the plate (on the box's centre where there is none), S2 on the box. */
struct product_reading {
	double s1_x, s1_y, s2_x, s2_y;
};

/* Takes the scene's product, at rest in space at an angle, carried by something that stands still. */
void product_init(struct product *p, const struct scene *scene, double angle_rad);

/* Carried, or in free fall, without turning: from now on it accelerates downwards. Sets what is read. */
void product_carry(struct product *p, double down_m_s2);

/* The lowest corner touches the mat now, the centre of gravity falling straight at this speed; a spin that
 * the caller has put into the state stays. */
void product_strike(struct product *p, double speed_m_s);

/* After product_strike: goes on by one step, all of the span at most, and returns its length; at rest the
 * span goes by. */
DT_MUST_USE double product_step(struct product *p, double span_s);

void product_read(const struct product *p, struct product_reading *reading);

#endif
