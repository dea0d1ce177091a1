/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_MODEL_MAPS_H
#define DT_HOST_CHART_MODEL_MAPS_H
/*
 * The figures behind the model's stability maps. Pure functions of their arguments (the last ones of their
 * seed); NAN where a method has no answer.
 */
#include <stdbool.h>

/* Steady state over exact peak of a plate of f_p on a half-sine of T; pulse: f_p T. */
double maps_steady_ratio(double pulse, double zeta);

/* Relative error of the usual formula of a half-sine's transient where forcing and plate meet: r = 1 - apart.
 */
double maps_plain_transient(double apart, double zeta);

/* RK4 of a fixed step: the restitution found that is farthest from e, over all places of the touch within a
 * step. */
double maps_rk4_restitution(double restitution, double step_share);

/* Relative error of D by one of the ways, at e (small) or at 1 - e. */
enum maps_way { MAPS_PLAIN, MAPS_LINEAR, MAPS_OURS };
double maps_damping_of_small(enum maps_way way, double restitution);
double maps_damping_near_one(enum maps_way way, double short_of_one);

/* The box of geometry 1 with its own corners: when the one that struck leaves the mat, when another one
 * comes down (INFINITY: not within 60 ms), s after the touch. */
struct maps_corners {
	double release_s, second_s;
};
struct maps_corners maps_corners(double angle_deg);

/* Lever of a vertical force at the corner, m, of a box that balances at an angle. */
double maps_lever(double angle_deg, double balance_deg);
double maps_own_balance_deg(void);

/* What Hertz's half space predicts for geometry 1 on a mat of this modulus. */
struct maps_hertz {
	double dent_share, duration_s;
};
struct maps_hertz maps_hertz(double modulus_pa, double height_m);

/* Root mean square error over the damping ratio of a decay of 300 g and 129 Hz at 7 kHz; a drop without a
 * value counts as one that is off by its whole. */
double maps_decay_error(bool ours, double zeta, double noise_g, unsigned drops, unsigned long seed);

#endif
