/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_DRIVEN_H
#define DT_HOST_ESTIMATE_DRIVEN_H
/*
 * One axis when S1 sits on S2 as a damped oscillator, its lag and S1's peak: S1 is gain times the response
 * (respond.h) to S2, later by a delay, on a slope that ends in an offset (the sensors' high-pass leaves one).
 * Gain, delay, frequency, damping and offset are fitted to S1 from the contact to four cycles after it, the
 * decay in block means; to half a cycle where the residual refuses that, and half a cycle fits far better.
 * The lag is the fitted response's largest peak less S2's.
 *
 * S2 enters as smooth pulse (cosine_pulse.h) where it is one, since the noise of its samples would count as
 * input, otherwise by its samples from the pulse's foot to 1.1 widths after the peak. The delay is free
 * because no oscillator explains every lag that was measured.
 *
 * Uncertainty: the fit's, S2's peak time and, with samples, S2's noise as input. Where the residual test
 * refuses (ESTIMATE_FLAG_MODEL) the residual takes the noise's place, and what the fitted peak misses S1's
 * own by is added. NAN with not_converged where S1 does not follow an oscillator at all or that of
 * another contact, or the lag is less certain than a tenth of the pulse's width. S1's or S2's status where
 * they have no peak, S1's ring-down's where it has none. Clipped samples are left out, and flagged as
 * extrapolated; not_converged where S2 is clipped and no smooth pulse.
 */
#include "host/estimate/peak.h"
#include "host/estimate/respond.h"
#include "host/estimate/ringdown.h"

struct driven_axis {
	const struct trace *trace[2]; /* S1, S2 */
	const struct peak *peak[2];
	const struct ringdown *ringdown; /* S1's: the start */
};

struct driven {
	double lag_s, sigma_s;
	double doubt_s; /* what of sigma_s is doubt of S2's crest: both axes have it alike */
	/* S1's by the fitted response and its time, with the fit's uncertainty, and S2's noise where its
	 * samples are the input: no doubt of the model; NAN unless ok and not refused. */
	double peak_g, sigma_peak_g, peak_s, sigma_peak_s;
	/* From when on S1's decay is as good as free; NAN likewise, or where S2 is no smooth pulse. */
	double free_s;
	bool smooth, sampled; /* inputs tried */
	double chi_square;    /* reduced */
	unsigned flags;
	enum estimate_status status;
};

/* The fitted response: S1 at any time. It stays where it is made. */
struct driven_curve {
	struct respond_input input;
	struct respond respond; /* to that input */
	double gain, delay_s;
	double sigma_g, sigma_s; /* of the peak */
};

/* The curve is there when driven's peak is a number. */
void driven_find(const struct driven_axis *axis, struct driven *driven, struct driven_curve *curve);

/* As peak_at, of S1. */
void driven_at(const struct driven_curve *curve, double time_s, double derivative[3], double variance[2]);

/* S1's peak by the oscillator, in place of the smooth curve's: that has twice the error, and a bias near the
 * kink at the end of contact. What the two heights differ by beyond chance enters sigma; where S1 is clipped,
 * and nothing tells, a thousandth does, and the value is flagged as extrapolated. True when it was taken;
 * peak's result then is no longer of its model, span and sample.
 *
 * Not where S2's peak is clipped or below 12 sigma, so that its shape is a guess, nor where
 * the pulse lasts 0.8 cycles and more, or, of a clipped S1, where its flanks are as certain:
 * there the smooth curve's value stays, and its time is less certain by what the two differ. Nor where S1's
 * largest sample is of another contact: the peak stays, driven is flagged "rival". */
bool peak_driven(const struct driven_axis *axis, struct driven *driven, const struct driven_curve *curve,
                 struct peak *peak);

#endif
