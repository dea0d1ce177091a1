/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_BOUND_H
#define DT_HOST_CHART_BOUND_H
/*
 * Cramer-Rao bounds of a synthetic drop: the least standard deviation that any unbiased estimator can have.
 * From a numeric Fisher matrix: the synthetic signal itself, differenced in each of its parameters. No
 * formula is shared with the estimators.
 *
 *   peak, time, contact, velocity   A, onset, base of the pulse, family known; S2
 *   resultant                       the same of both axes
 *   frequency, damping              gain, delay, frequency, damping (of both modes) over the free decay of
 *                                   S1; pair_*: X and Y together. No offset, no hum among the unknowns.
 *   lag, S1's peak                  all of them, S1 and S2 of an axis
 *
 * Samples that the scene clips or loses do not count; those missing by chance count by their share. The noise
 * counts with what the converter's steps add. The mean square over onsets across the sample grid.
 */
#include "host/chart/synthetic.h"

struct bound {
	double peak_g[2], peak_s[2], contact_s[2], velocity_m_s[2];
	double resultant_g, resultant_s;
	double damped_hz[2], damping[2], natural_hz[2];
	double pair_hz, pair_damping, pair_natural_hz;
	double lag_s[2], pair_lag_s;
	double plate_g[2], plate_s[2];
};

/* Without those of the lag and of S1's peak, which take long, unless lags. Moves the onset. DT_E_MEMORY;
 * DT_E_ARGUMENT when the samples do not determine the parameters. */
DT_MUST_USE int bound_find(struct synthetic *synthetic, bool lags, struct bound *bound);

#endif
