/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_STEADY_H
#define DT_HOST_MODEL_STEADY_H
/*
 * The steady state of a damped oscillator on a base that shakes in a sine: equation (17) in its usual form,
 * with the branch of its phase put right. r = forcing over undamped natural frequency. A drop lasts less than
 * a cycle of the plate, so this is a bound to compare with more than a prediction. Pure functions.
 */
#include "common/error.h"

/* Amplitude over the base's, and by how much it comes after it (0 to pi). 0, or DT_E_ARGUMENT: r > 0,
 * damping_ratio >= 0, finite; DT_E_NUMERIC at resonance without damping, where there is none. */
DT_MUST_USE int steady_response(double r, double damping_ratio, double *transmissibility, double *phase_rad);

#endif
