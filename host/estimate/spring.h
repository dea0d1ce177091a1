/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SPRING_H
#define DT_HOST_ESTIMATE_SPRING_H
/*
 * The free decay of a mass on a mount that softens with its swing, as a filled rubber does, and comes back
 * to its small-swing stiffness as the swing vanishes:
 *
 *     x'' = -2 a x' - w0^2 x (1 - D (1 + Q x0^2) / x0^2 * x^2 / (1 + Q x^2)),   w0^2 = w^2 + a^2
 *
 * read as the acceleration x'' + b. D is what the swing of time 0, x0, has taken of the stiffness, and Q says
 * over which swings it goes: of all ways to write this law the one whose unknowns hang on each other least,
 * so that a fit needs half the steps. A negative D stiffens. Unlike a frequency that is a function of the
 * envelope it has the harmonics too. Integrated one step per sample, where steps
 * are short by Stoermer's and Adams' formulas, else by Runge-Kutta: four solutions side by side, of which the
 * differences give the derivatives by damping, loss of stiffness and swing; those by time and Q follow, since
 * a later state and another scale have the same solution. Unknowns at the places of modes.h: b, a, w (damped,
 * of a small swing), w0^2 x and w0 x' at time 0 in g, Q in 1/g^2 of the former, D.
 */
#include "host/estimate/block_means.h"
#include "host/estimate/cholesky.h"

enum { SPRING_SIZE = 7 };

/* As lm.h asks for it. */
size_t spring_normal(const struct block_means *series, const double *p,
                     double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX], double *squares);

/* The acceleration at time_s. */
double spring_at(const double *p, double time_s);

/* Mean damped frequency over that many cycles from time 0 on: turns of deflection and speed, integrated in so
 * many steps a cycle. */
double spring_mean_hz(const double *p, unsigned cycles, unsigned steps);

/* Stiffness at the swing of time 0 over that of a small one. */
double spring_softness(const double *p);

#endif
