/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RIPPLE_H
#define DT_HOST_ESTIMATE_RIPPLE_H
/*
 * A ripple on a pulse that no sample shows for noise: a line in the spectrum of what X and Y of a sensor
 * read beyond the curves of their peaks, in parts of those. A smooth curve's
 * top is flat, so that a ripple of 2 % puts the highest instant anywhere within a tenth of the width, and no
 * curve through the noise says so.
 *
 * Lines of two cycles and more under the curve are looked at; the largest one is a hint where white noise
 * makes such a one in a drop of twenty. Then height and time are as unsure as they change when the line is
 * added to the curve.
 */
#include "host/estimate/peak.h"

/* Trace and peak of count axes, at most two. A peak that is weak, not ok or without a model tells nothing
 * and is left as it is. */
void ripple_widen(const struct trace *const trace[], struct peak *const peak[], unsigned count);

#endif
