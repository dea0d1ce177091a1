/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_COSINE_PULSE_H
#define DT_HOST_ESTIMATE_COSINE_PULSE_H
/*
 * A symmetric contact pulse without a named family, as smooth input for the oscillator:
 *
 *     height c^power (1 + bulge (1 - c^2)),   c = cos(pi (t - centre) / base),  0 outside its base
 *
 * Half-sine and haversine are powers 1 and 2 without a bulge; an elastic Hertz contact needs a small one.
 * Power, base and bulge are hard to tell apart, so the bulge carries a weak prior about 0: it moves only
 * where the samples ask for it. Its centre is the peak's time, and by symmetry does not hang on the others.
 *
 * Refused when the residual is no noise, so by a skewed pulse, or one that does not end at zero.
 */
#include "host/estimate/peak.h"

struct cosine_pulse {
	double height_g; /* signed */
	double centre_s, base_s, power, bulge;
	double sigma_centre_s;
	double chi_square; /* reduced */
};

/* Lost, bad and clipped samples are left out. False when too few are left, the fit fails or its residual
 * refuses it; cosine is then undefined. */
bool cosine_pulse_fit(const struct trace *trace, const struct peak *peak, struct cosine_pulse *cosine);

/* Where the curve's cosine is c, from 0 to 1. */
double cosine_pulse_of(const struct cosine_pulse *cosine, double c);

/* At an instant; 0 beyond its feet. */
double cosine_pulse_at(const struct cosine_pulse *cosine, double time_s);
double cosine_pulse_area(const struct cosine_pulse *cosine); /* in g s */

#endif
