/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ACCURACY_BOUND_H
#define DT_TESTS_ACCURACY_BOUND_H
/*
 * Cramer-Rao bounds of a stage's quantities, from a numeric Fisher matrix: the stated signal is computed at
 * its parameters and a little beside them, the differences make the Jacobian, samples that the scene loses
 * or clips do not count. No formula is shared with the estimators.
 *
 *   pulse      A, t_p, T of each axis of S2, shape known
 *   resultant  from both axes' pulses
 *   decay      c, s, a, w of each axis of S1 over STAGE_DECAY_S from where its drive ends; both axes together
 *              share a and w; a second mode adds its own four. No offset, no hum among the unknowns.
 *   lag        A, t_p, T of S2 and gain, delay, frequency, damping of S1, all samples of both; S1's peak
 *
 * The noise counts with what the converter's steps add. Standard deviations, mean square over onsets across
 * the sample grid.
 */
#include "tests/accuracy/stage.h"

struct bounds {
	double peak_g[2], peak_s[2], contact_s[2], velocity_m_s[2];
	double resultant_g, resultant_s;
	double frequency_hz[2], damping[2], natural_hz[2];
	double joint_hz, joint_damping, joint_natural_hz;
	double lag_s[2], joint_lag_s;
	double plate_g[2], plate_s[2]; /* S1's peak and its time */
};

/* Without those of the lag and of S1's peak, which take long, unless lags. Moves the stage's onset and leaves
 * it anywhere. */
void bounds_find(struct stage *stage, bool lags, struct bounds *bounds);

/* The true resultant of S2 in the present drop, and when; that of S1. */
double stage_resultant(const struct stage *stage, double *at);
double stage_plate_resultant(const struct stage *stage, double *at);

#endif
