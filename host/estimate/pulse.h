/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PULSE_H
#define DT_HOST_ESTIMATE_PULSE_H
/*
 * Width and area of the pulse under a peak. The width is family-free: between the points where the straight
 * line through two samples meets 10 % of the peak. The velocity change is the trapezoid sum from where the
 * reading leaves zero to where it is back, at most one width beyond the 10 % points on either side, with
 * 1 g = 9.81 m/s^2; what is missing is bridged by a straight line and enters the uncertainty.
 *
 * The status is the peak's; short when the trace ends inside the pulse. sigma_velocity_m_s is NAN without a
 * baseline.
 */
#include "host/estimate/peak.h"

void pulse_measure(const struct trace *trace, const struct peak *peak,
                   const struct estimate_baseline *baseline, struct estimate_pulse *pulse);

#endif
