/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LAG_H
#define DT_HOST_ESTIMATE_LAG_H
/*
 * The time from S2's peak to S1's, by four definitions. Three of the resultants, which do not hang on how the
 * product was turned:
 *   largest_peak       between the largest maxima of the two resultants
 *   first_peak         between their first local maxima above half of the largest
 *   cross_correlation  the shift of S1 against S2's pulse that correlates best, X and Y together with their
 *                      signs, each axis at its own rate with S1 interpolated to the shifted time, holes
 *                      bridged by straight lines, and a parabola through the top three shifts
 * Correlation is tried at coarse shifts with some of the samples first, then with all around the best.
 *
 * S1 is a filtered copy of S2 and no delayed one, so the definitions need not agree: ambiguous when they
 * spread more than LAG_SPREAD_MAX_S. Otherwise the worse status of the two resultants. sigma_s is that of
 * largest_peak.
 *
 * The fourth takes S1 for what it is, an oscillator driven by S2, per axis (driven.h), X and Y weighed by
 * their uncertainties; where they disagree by more than these say, the combined one covers it. Of an axis
 * that does not follow one nothing is used. How: the path names the inputs that were tried, "pulse" and
 * "samples"; its chi-square is the larger of the axes', the status X's when neither has a value.
 */
#include "host/estimate/driven.h"
#include "host/estimate/resultant.h"

#define LAG_SPREAD_MAX_S 0.3e-3

struct lag_sensor {
	struct resultant_axes axes;
	const struct resultant *resultant;
};

/* driven: of X and Y. */
void lag_find(const struct lag_sensor *s1, const struct lag_sensor *s2, const struct driven driven[2],
              struct estimate_lag *lag);

#endif
