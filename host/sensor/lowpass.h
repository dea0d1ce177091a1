/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SENSOR_LOWPASS_H
#define DT_HOST_SENSOR_LOWPASS_H
/*
 * What a named low-pass of so many poles, with its -3 dB at cutoff_hz, does to a pulse. Pure functions.
 *
 * It comes late by the delay at zero frequency. How far a half-sine of foot to foot T keeps its height and
 * width depends on the periods of the cutoff within it, fc T: that is known of Butterworth and Bessel up to 8
 * poles from 3 on; with less it is another pulse.
 */
#include "common/scenes/transducer.h"

/* Its delay at zero frequency; 0 without a filter. */
double lowpass_delay_s(enum transducer_filter filter, unsigned order, double cutoff_hz);

/* The largest change of the height and of the width at 10 %, in parts of them. */
double lowpass_peak_share(double periods);
double lowpass_width_share(double periods);

#endif
