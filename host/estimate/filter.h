/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_FILTER_H
#define DT_HOST_ESTIMATE_FILTER_H
/*
 * Zero-phase low-pass: second-order sections run forward and backward. That of filter_lowpass is a 4-pole
 * Butterworth; lowpass_hz is the corner of the whole, where both passes together leave -3 dB: each pass is
 * designed for a corner higher by (sqrt(2)-1)^(-1/8). cfc.h has the crash-test standards' classes. Ends are
 * continued by their point reflection (2 y_end - y), and each pass starts in the steady state of its first
 * value, so that a constant comes out as it went in and a step at the end makes no wave.
 *
 * Runs of good samples between lost and bad ones are filtered each on their own; what is missing stays
 * missing. A corner too close to half the sampling rate leaves the trace as it is, flagged "unfiltered".
 */
#include "host/estimate/trace.h"

/* Over the sampling rate: filter_lowpass leaves alone from there on. */
#define FILTER_CORNER_MAX 0.45

/* Unity at zero frequency: b (1 + 2/z + 1/z^2) / (1 + a1/z + a2/z^2), and its state. */
struct filter_section {
	double b, a1, a2;
	double s1, s2;
};

/* Two poles by the bilinear transform: s^2 + damping s + 1, corner over the sampling rate. */
struct filter_section filter_section(double corner, double damping);

/* The sections one after the other, forward and backward, in place; corner as above, of the whole, for how
 * far the ends are continued. 0, or DT_E_MEMORY with the trace unchanged. */
DT_MUST_USE int filter_two_pass(struct trace *trace, struct filter_section *section, size_t sections,
                                double corner);

/* In place. 0, or DT_E_MEMORY with the trace unchanged. */
DT_MUST_USE int filter_lowpass(struct trace *trace, double lowpass_hz);

#endif
