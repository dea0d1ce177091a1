/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RESULTANT_H
#define DT_HOST_ESTIMATE_RESULTANT_H
/*
 * The resultant of a sensor's X and Y: the maximum over continuous time of hypot(X(t), Y(t)), each axis by
 * the model that gave its own peak (peak.h), a family's or a local polynomial, or a driven oscillator's, at
 * its own rate. Never the hypot of two maxima, which lie at different instants, nor of nearest samples. Where
 * the axes' own peaks are not of the resultant's pulse, polynomials are fitted to both around the resultant's
 * (crest.h); not to a stronger axis that is clipped: its own peak stands, with what the other one reads then.
 * Where the weaker axis has no peak, though samples, the resultant is the stronger one's own peak; where it
 * has the stronger one's shape ("weak_axis"), both are at that one's time.
 *
 * The axes coincide when their own maxima lie no further apart than RESULTANT_COINCIDE_S, about two samples.
 * Flags are those of the axes that have a peak, but "tolerance_not_met" is the resultant's own, judged as a
 * peak's. Status: the stronger axis' when that is short or no_peak; short when the weaker axis has too few
 * samples under the pulse to say what it did; clipped and ambiguous as for a peak.
 */
#include "host/estimate/driven.h"
#include "host/estimate/peak.h"

#define RESULTANT_COINCIDE_S 0.25e-3

/* Two axes of a sensor and what is known of each. */
struct resultant_axes {
	const struct trace *trace[2]; /* X, Y */
	const struct peak *peak[2];
	const struct driven_curve *curve[2]; /* what gave the peak; NULL: its own model did */
	double tolerance;                    /* as in estimate_options */
};

struct resultant {
	struct estimate_resultant result; /* sensor is left to the caller */
	double width_s;                   /* of the stronger axis */
	struct local_span span;           /* of the stronger axis */
	double first_peak_s; /* the first local maximum above half of the largest; NAN unless found */
};

void resultant_find(const struct resultant_axes *axes, struct resultant *resultant);

#endif
