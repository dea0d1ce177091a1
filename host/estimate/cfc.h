/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CFC_H
#define DT_HOST_ESTIMATE_CFC_H
/*
 * The channel frequency classes of SAE J211-1 and ISO 6487 (annex with the algorithm): a Butterworth of two
 * poles run forward and backward, both passes together without phase and with -3 dB near 5/3 of the class.
 * Holes and ends as filter.h has them.
 *
 * The standards want a rate of ten times the class or more: 10 kHz for CFC1000, so that an axis sampled at
 * 7 kHz goes up to CFC600.
 */
#include "host/estimate/trace.h"

/* Corner of both passes over the class: 100 Hz for CFC60. */
#define CFC_CORNER (5.0 / 3.0)

/* 0; DT_E_UNKNOWN for a class other than 60, 180, 600 and 1000; DT_E_RANGE when the rate is too low. */
DT_MUST_USE int cfc_check(unsigned class, double rate_hz);

/* The highest class for a rate; 0 when it is too low for any. */
unsigned cfc_highest(double rate_hz);

/* In place. As cfc_check, or DT_E_MEMORY; then the trace is unchanged. */
DT_MUST_USE int cfc_filter(struct trace *trace, unsigned class);

#endif
