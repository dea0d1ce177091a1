/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_OSCILLATOR_H
#define DT_HOST_MODEL_OSCILLATOR_H
/*
 * A mass on a spring and a damper left to itself, z'' + 2 zeta omega z' + omega^2 z = 0, in closed form for
 * any zeta >= 0: below, at and above critical damping alike, without a jump between them. Its acceleration
 * obeys the same equation, so the same functions serve for it. Pure functions; SI units.
 */
#include "common/error.h"

/* Filled by oscillator_init; read only. */
struct oscillator {
	double omega; /* undamped, rad/s */
	double zeta;
	double decay;   /* zeta omega */
	double split;   /* omega sqrt|1 - zeta^2|: damped frequency, or half the distance of the two rates */
	int overdamped; /* which of the two */
};

/* 0, or DT_E_ARGUMENT: omega positive, zeta not negative, both finite. */
DT_MUST_USE int oscillator_init(struct oscillator *oscillator, double omega, double zeta);

/* *z and *v (= z') move on by tau >= 0. */
void oscillator_move(const struct oscillator *oscillator, double tau, double *z, double *v);

/* When z, which starts as z and z', first turns round; 0 when it never does. Every later turn is smaller. */
double oscillator_turn(const struct oscillator *oscillator, double z, double v);

/* On a base that has always shaken in a sine: equation (17) in its usual form, with the branch of its phase
 * put right. r: forcing over undamped natural frequency. Amplitude over the base's, and by how much it comes
 * after it (0 to pi). 0, DT_E_ARGUMENT: r > 0, zeta >= 0, finite; DT_E_NUMERIC at resonance without damping.
 */
DT_MUST_USE int oscillator_steady(double r, double zeta, double *transmissibility, double *phase_rad);

#endif
