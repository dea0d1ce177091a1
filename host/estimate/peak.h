/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PEAK_H
#define DT_HOST_ESTIMATE_PEAK_H
/*
 * The peak of one axis: the extreme of largest magnitude in the trace's event window.
 *
 * Methods, cheapest first:
 *
 *   "poly4/poly6"  crest.h. Where the pulse has too few samples for that "parabola" through three, "sample"
 *                  where a neighbour is missing too: those two take what they change of the raw sample as
 *                  their model's uncertainty.
 *
 *   "sine-power"   while the uncertainty is above the tolerance, or a hole may hide the summit. Stays out
 *                  when its residual speaks against it (shape.h), and when the polynomials disagree by 4
 *                  sigma or are as certain: its own uncertainty holds half of what they differ by and a
 *                  thousandth of the height, as not every pulse is of this family.
 *
 * A family that is given is asked first, and at the statistical limit where it is the pulse's. Flagged
 * "model_refused" when its residual speaks against it: doubtful, its value stands with half of what the
 * polynomials, parabola or sample differ by in its sigma; refused, it gives nothing and the ladder above
 * does.
 *
 * Clipped, status clipped, is either of two things. Samples at a limit (trace.h), or marked ones no further
 * apart than noise, say "at least this": the value follows from the flanks by the family given, otherwise
 * the first of half-sine, haversine and sine-power that fits, flagged "extrapolated"; its sigma holds what
 * the others say, by their likelihoods (Hoeting 1999). When none fits, one of them is the value all the same,
 * "model_refused", and half of what it adds enters sigma.
 * Marked samples that go on above the range are readings of less trust: used as read, and a tenth of what
 * they add to the least of them enters sigma.
 *
 * Weak: an axis below 10 sigma of noise, whose largest sample is mostly noise, takes the shape of its
 * sensor's strongest axis and fits one amplitude to it, signed ("strong-axis", peak_weak).
 *
 * Flagged "rival" where another pulse of the event is as high, as far as noise and sampling let tell.
 *
 * Status besides: short below three good samples, or when the pulse falls to half on neither side; no_peak
 * below 5 sigma of noise, value NAN; ambiguous when the summit may hide in a hole, or beyond the end of the
 * trace, and within four samples of an end where it may be a spike: narrower than four, or with too few
 * samples for polynomials.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/local.h"
#include "host/estimate/shape.h"

/* A pulse's samples are those above this part of its peak. */
#define PEAK_FOOT_LEVEL 0.05

enum peak_model {
	PEAK_MODEL_NONE, /* too few samples for one */
	PEAK_MODEL_LOCAL,
	PEAK_MODEL_SHAPE,
};

struct peak {
	struct estimate_peak result;
	size_t at;              /* its largest sample */
	double sign;            /* +1 or -1 */
	double width_s;         /* base of the half-sine as wide at half height */
	struct local_span span; /* around it, above 5 % of it */
	bool lopsided;          /* no symmetric family will do: its middle wanders, or it swings below zero */
	/* for pulse_measure and resultant_find */
	struct shape_start start;               /* of a family's fit */
	double clipped_from_s, clipped_until_s; /* where samples only say "at least"; equal when nowhere */
	enum peak_model model;                  /* what gave the value, unless an oscillator did (driven.h) */
	struct local local;
	struct shape shape;     /* the family's fit asked for last; its family is AUTO when there was none */
	struct shape half_sine; /* that fit, likewise */
	struct estimate_peak plain; /* the polynomials' result where a family's that nobody told stands; else
	                               its value is 0 */
	double noise_g;             /* of local */
	double doubt_s;  /* what of sigma_time_s is the polynomials', which have it alike on both axes */
	double ripple_s; /* what of that a ripple under the noise is (ripple.h) */
	double scale;    /* model to axis: 1 but for a weak axis */
};

/* Everything but result is meaningful unless the status is short or no_peak. */
void peak_find(const struct trace *trace, const struct estimate_options *options, struct peak *peak);

/* Whether peak_weak is to be asked for it. */
bool peak_is_weak(const struct trace *trace, const struct peak *peak);

/* The amplitude of strong's shape in trace, an axis of the same sensor. Peak stays as it is when that is not
 * significant and it has none of its own, or when the residual says that the shape is another one. True if it
 * was replaced. */
bool peak_weak(const struct trace *trace, const struct trace *strong_trace, const struct peak *strong,
               struct peak *peak);

/* The peak of a plate that no oscillator explains, by polynomials as narrow as what the case's contact leaves
 * under its top. Those as wide as its swing fit within the noise and are up to five of their sigma off in
 * time. A peak that is not of polynomials, ok and an axis of its own stays. */
void peak_narrow(const struct trace *trace, struct peak *peak);

/* The time of peak, which peak_weak gave strong's shape, once strong's has changed. */
void peak_weak_time(const struct peak *strong, struct peak *peak);

/* Value, slope per s and curvature per s^2 of the axis' model at an instant, and the variances of the first
 * two unless that is NULL; false where it does not reach. */
bool peak_at(const struct peak *peak, double time_s, double derivative[3], double variance[2]);

#endif
