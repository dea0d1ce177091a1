/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_MODEL_NUMERICS_H
#define DT_HOST_CHART_MODEL_NUMERICS_H
/*
 * The model's equations written out again, plainly, with the numerics that others would use on them: what the
 * model's charts hold host/model against. host/model uses none of this.
 *
 * Pure functions; SI units; NAN where a method has no answer.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

/* ---- contact ---- */

/* Restitution that RK4 of a fixed step finds on Hunt and Crossley's law with this D: step as a share of the
 * contact time (both in units of the contact), the touch at a share `phase` of a step after the start. */
double numerics_rk4_restitution(double damping, double contact_time, double step_share, double phase);

/* D of a restitution: Brent on ln((1 + D)/(1 - e D)) = D (1 + e) as it stands, NAN without a bracket; and the
 * first-order form 1.5 (1 - e). */
double numerics_plain_damping(double restitution);
double numerics_linear_damping(double restitution);

/* The same to all digits by two other ways: 1 - e D as a fixed point, e <= 0.1; a power series in D over
 * 1 - e, which is handed over because e has lost its digits, <= 0.1. */
double numerics_damping_of_small(double restitution);
double numerics_damping_near_one(double short_of_one);

/* ---- half-sine on an oscillator ---- */

/* z at time_s within a pulse of amplitude 1: steady state plus transient over (1 - r^2)^2 + (2 zeta r)^2. */
double numerics_plain_half_sine(double frequency_hz, double zeta, double pulse_s, double time_s);

/* ---- box and plate in motion ---- */

enum { MOTION_STATES_MAX = 10 };

/* coupled: box height, its speed, plate height, its speed. planar: across, up, angle, plate across, plate up,
 * and their rates in this order. Everything in the room's axes, counted from the touch; linear mounts, no
 * friction. */
struct motion {
	bool planar;
	double box_kg, plate_kg, inertia_kg_m2; /* plate_kg 0: no plate, its states stay as they are */
	double gravity_m_s2, speed_m_s, angle_rad, lever_x_m, lever_y_m;
	double stiffness_n_m15, damping; /* k and D of the contact */
	double mount_n_m, mount_damping_n_s_m;
};

void motion_start(const struct motion *motion, double y[]);

/* Readings: magnitude at the box's centre of gravity and of the plate, m/s^2. */
double motion_box(const struct motion *motion, const double y[]);
double motion_plate(const struct motion *motion, const double y[]);

/* How deep a corner at (x, y) from the centre of gravity is below the mat. */
double motion_depth(const struct motion *motion, const double y[], double corner_x_m, double corner_y_m);

/* One step of the classical Runge-Kutta method. */
void motion_rk4(const struct motion *motion, double step_s, double y[]);

/* States at every_s, 2 every_s, ... count every_s: by RK4 of steps no longer than step_s; by one of GSL's
 * ("rkf45", "rkck", "rk8pd", "msadams") within a tolerance of each step. 0, or DT_E_NUMERIC, DT_E_MEMORY. */
void motion_by_rk4(const struct motion *motion, double step_s, double every_s, size_t count,
                   double (*y)[MOTION_STATES_MAX]);
DT_MUST_USE int motion_by_gsl(const struct motion *motion, const char *method, double tolerance,
                              double every_s, size_t count, double (*y)[MOTION_STATES_MAX]);

#endif
