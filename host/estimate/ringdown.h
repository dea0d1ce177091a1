/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RINGDOWN_H
#define DT_HOST_ESTIMATE_RINGDOWN_H
/*
 * Frequency and damping of the free decay after a contact, by least squares (modes.h) with the offset always
 * among the unknowns. The window follows from the data: five cycles, or until the swing has fallen to a
 * hundredth where that takes longer, up to eighty cycles. Masked and clipped samples are left out.
 *
 * The cheapest fit first, the next only while the residual refuses it: its chi-square against the noise
 * before the pulse exceeds 1 by more than chance does.
 *   "block"      means of blocks, at least thirteen points per cycle
 *   "full"       every sample: where some are missing, or outliers (outlier.h) must go
 *   "full+hum"   mains terms too, if they help
 *   "amplitude"  a frequency that follows the swing; the value is the mean of its first three cycles
 *   "two-modes"  started from the one mode and another beside it
 * The last two only when an F-test prefers them (F > 7: the nominal limit fires on clean records, because
 * a mode of no amplitude has no frequency); of several that explain the residual, the one with the best
 * Bayesian information. Two modes that are surely nearer than the width of a resonance, or not surely apart,
 * are not separable and not taken. What is still refused keeps the best fit, flagged, its uncertainty widened
 * by the square root of its chi-square; but not two modes or a law that are grossly refused (chi-square over
 * 3): then the mean of the window stays, and the distance to the other's answer is added to its uncertainty.
 * A fit that is not refused but less certain than the tolerance is flagged.
 *
 * What two modes and the quadratic law did not explain on another axis of the same thing, but the softening
 * spring did, is tried first, from there.
 *
 * The window opens where the decay is surely free and then reaches back as far as the fit foretells the
 * samples before it, since every cycle lost at the start costs most.
 *
 * The fit starts from zero crossings; from a scan (grid_search.h) where noise or outliers hide them.
 *
 * Frequency is the damped one, w / 2 pi; the natural one is sqrt(w^2 + a^2) / 2 pi; the damping ratio a over
 * that. three_cycle_frequency_hz is 3 over the time from the first zero crossing to the seventh, offset
 * removed; NAN when there are fewer.
 *
 * Status: no_peak when nothing swings by 2 % of the peak, the swing does not stand out of the noise, or the
 * fit explains less than half of what is not noise; short when the trace, or the quiet time until until_s,
 * ends before a cycle is complete or from_s is not known; not_converged when the fit fails or gives no decay.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

/* How much of a mount's stiffness the swing at the start has taken, and over which swings, as spring.h has
 * it. */
struct ringdown_law {
	bool found; /* no other shape passed before it */
	double decay, omega;
	double q, d; /* q: of that swing */
};

struct ringdown {
	struct estimate_ringdown result;
	double amplitude_g; /* at start_s; 0 unless the status is ok */
	double start_s;     /* of the samples that were fitted */
	double offset_g;
	struct ringdown_law law;
};

/* What to look at: the decay is free from from_s until until_s. */
struct ringdown_span {
	double from_s, until_s;
	double peak_g;    /* magnitude of the channel's peak, which says what is small */
	double tolerance; /* part of the value; 0 = ESTIMATE_TOLERANCE */
	double margin_s;  /* the decay may have been free this much before from_s; 0 = not looked for */
	const struct ringdown_law *law; /* what another axis of the thing needed is tried first; NULL: none */
};

void ringdown_find(const struct trace *trace, const struct ringdown_span *span, struct ringdown *ringdown);

/* Once more from span->from_s, where the decay is known to begin: a plain one starts from its last answer and
 * stays what it was where the residual refuses that. Of what needed more than one mode nothing changes. */
void ringdown_refine(const struct trace *trace, const struct ringdown_span *span, struct ringdown *ringdown);

/* X's and Y's decay of the same thing as one, by the inverse squares of their uncertainties; where they
 * disagree by three standard deviations, half of what they are apart is added to the uncertainty, flagged.
 * Only what is ok counts: the result is x's when neither is. Method, path, chi-square and second mode are the
 * more certain axis'; flags are both's. Ambiguous when they lie more than 5 % and three standard deviations
 * apart. */
void ringdown_combine(const struct ringdown *x, const struct ringdown *y, struct estimate_ringdown *combined);

#endif
