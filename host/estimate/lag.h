/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LAG_H
#define DT_HOST_ESTIMATE_LAG_H
/*
 * The time from S2's peak to S1's, by three definitions:
 *   largest_peak       between the largest maxima of the two resultants
 *   first_peak         between their first local maxima above half of the largest
 *   cross_correlation  the shift of S1 against S2's pulse that correlates best, X and Y together with their
 *                      signs, each axis at its own rate with S1 interpolated to the shifted time, holes
 *                      bridged by straight lines, and a parabola through the top three shifts
 * The resultant, not an axis: the three then do not hang on how the product was turned.
 *
 * S1 is a filtered copy of S2 and no delayed one, so the definitions need not agree: ambiguous when they
 * spread more than LAG_SPREAD_MAX_S. Otherwise the worse status of the two resultants. sigma_s is that of
 * largest_peak.
 */
#include "host/estimate/resultant.h"

#define LAG_SPREAD_MAX_S 0.3e-3

struct lag_sensor {
	struct resultant_axes axes;
	const struct resultant *resultant;
};

void lag_find(const struct lag_sensor *s1, const struct lag_sensor *s2, struct estimate_lag *lag);

#endif
