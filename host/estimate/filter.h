/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_FILTER_H
#define DT_HOST_ESTIMATE_FILTER_H
/*
 * Zero-phase low-pass: a 4-pole Butterworth run forward and backward. lowpass_hz is the corner of the whole,
 * where both passes together leave -3 dB: each pass is designed for a corner higher by (sqrt(2)-1)^(-1/8).
 * Ends are continued by their point reflection (2 y_end - y), and each pass starts in the steady state of
 * its first value, so that a constant comes out as it went in and a step at the end makes no wave.
 *
 * Runs of good samples between lost and bad ones are filtered each on their own; what is missing stays
 * missing. A corner too close to half the sampling rate has nothing to remove and leaves the trace as it is.
 */
#include "host/estimate/trace.h"

/* In place. 0, or DT_E_MEMORY with the trace unchanged. */
DT_MUST_USE int filter_lowpass(struct trace *trace, double lowpass_hz);

#endif
