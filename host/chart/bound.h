/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_BOUND_H
#define DT_HOST_CHART_BOUND_H
/*
 * Cramer-Rao bounds of a synthetic drop: the least standard deviation that any unbiased estimator can have.
 * From a numeric Fisher matrix: the synthetic signal itself, differenced in each of its parameters.
 *
 *   peak, time, contact, velocity   A, onset, base of the pulse, family known; S2 X
 *   resultant                       the same of both axes
 *   frequency, damping              gain, delay, frequency, damping (of both modes) over the free decay of
 *                                   S1 X; pair_*: X and Y together
 *   lag, S1's peak                  all of them, S1 X and S2 X
 *
 * Samples that the scene clips or loses do not count; those missing by chance count by their share. The
 * mean square over onsets across the sample grid.
 */
#include "host/chart/synthetic.h"

struct bound {
	double peak_g, peak_s, contact_s, velocity_m_s;
	double resultant_g;
	double damped_hz, damping, pair_hz, pair_damping;
	double lag_s, plate_peak_g;
};

/* Moves the onset. DT_E_MEMORY; DT_E_ARGUMENT when the samples do not determine the parameters. */
DT_MUST_USE int bound_find(struct synthetic *synthetic, struct bound *bound);

#endif
