/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PULSE_H
#define DT_HOST_ESTIMATE_PULSE_H
/*
 * Width and area of the pulse under a peak. The width is between the points where it meets 10 % of the
 * peak, the velocity change its sum with 1 g = 9.80665 m/s^2. Both are the samples' own: no family is needed,
 * but where one fits, or another symmetric pulse does, it tells what lies between the samples
 * (control_variate.h), and what is missing or clipped follows it, from its foot to its foot. Where none fits:
 * straight lines between samples, and the trapezoid sum from where the reading leaves zero to where it is
 * back, at most one width beyond the 10 % points on either side; what is missing or clipped follows the
 * family that gave the peak; where none did it is bridged by a straight line, clipped samples count as read,
 * and the gap enters the uncertainty.
 *
 * How long a contact is depends on its family by a fifth, so that it is given only together with one: the
 * family asked for, otherwise the one of half-sine and haversine that fits better, otherwise sine-power; foot
 * to foot, and the area under it. When the residual refuses them (shape.h) these are NAN, the method is ""
 * and the flag says "model_refused": another pulse than a symmetric contact's, or no contact at all.
 *
 * The status is the peak's; short when the trace ends inside the pulse. sigma_velocity_m_s is NAN without a
 * baseline, and flags say so where that is doubtful ("zero_unsure").
 */
#include "host/estimate/peak.h"

void pulse_measure(const struct trace *trace, const struct peak *peak,
                   const struct estimate_baseline *baseline, enum estimate_family family,
                   struct estimate_pulse *pulse);

/* Of a weak axis (peak_weak): strong's pulse at the weak axis' height, with the doubt of both axes' zeros. */
void pulse_of_weak(const struct trace *trace, const struct peak *weak,
                   const struct estimate_baseline *baseline, const struct estimate_pulse *strong,
                   struct estimate_pulse *pulse);

#endif
