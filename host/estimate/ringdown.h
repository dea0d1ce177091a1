/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RINGDOWN_H
#define DT_HOST_ESTIMATE_RINGDOWN_H
/*
 * Frequency and damping of the free decay after a contact: least squares of
 *
 *     e^{-a t} (c cos w t + s sin w t) + b
 *
 * over five cycles from from_s on, a w c s b all unknown, the offset always among them (the sensor's
 * high-pass leaves one). Started by zero crossings with hysteresis; Levenberg-Marquardt with the function by
 * recurrence. Masked and clipped samples are left out.
 *
 * Frequency is the damped one, w / 2 pi; the natural one is sqrt(w^2 + a^2) / 2 pi; the damping ratio a over
 * that. Standard uncertainties come from the covariance with the larger of the trace's noise and the
 * residual: a decay that is not the model's (mounts that stiffen as it dies away) widens them, though it may
 * shift the values by more. three_cycle_frequency_hz is 3 over the time from the first zero crossing to the
 * seventh, offset removed; NAN when there are fewer.
 *
 * Status: no_peak when nothing swings by 5 sigma and 2 % of the peak for one whole cycle, or the fit
 * explains less than half of the variance; short when the trace, or the quiet time until until_s, ends
 * before a cycle is complete or from_s is not known; not_converged when the fit fails or gives no decay.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

struct ringdown {
	struct estimate_ringdown result;
	double amplitude_g; /* at from_s; 0 unless the status is ok */
	double offset_g;
};

/* peak_g: magnitude of the channel's peak, which says what is small. */
void ringdown_find(const struct trace *trace, double from_s, double until_s, double peak_g,
                   struct ringdown *ringdown);

/* X's and Y's decay of the same thing as one, by the inverse squares of their uncertainties; where they
 * disagree by more than these say, the uncertainty grows to cover it. Only what is ok counts: the result is
 * x's when neither is. Ambiguous when they lie more than 5 % apart. */
void ringdown_combine(const struct ringdown *x, const struct ringdown *y, struct estimate_ringdown *combined);

#endif
