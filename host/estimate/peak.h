/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PEAK_H
#define DT_HOST_ESTIMATE_PEAK_H
/*
 * The peak of one axis: the extreme of largest magnitude in the trace's event window.
 *
 * Methods, best first: "poly4/poly6" (crest.h); "parabola" through three samples when the pulse has too few
 * for that; "sample" when a neighbour is missing too. The simpler two take what they change of the raw
 * sample as their model uncertainty.
 *
 * Status: short below three good samples, or when the pulse falls to half on neither side; no_peak below 5
 * sigma of noise, value NAN; clipped when a clipped sample lies under the pulse: the value is then what the
 * samples as read say, the least the true one can be if the sensor was at its end, sigma_g NAN, and
 * sigma_time_s no less than half the clipped run; ambiguous when the summit may hide in a hole of missing
 * samples, or beyond the end of the trace.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/local.h"

struct peak {
	struct estimate_peak result;
	size_t at;              /* its largest sample */
	double sign;            /* +1 or -1 */
	double width_s;         /* base of the half-sine as wide at half height */
	struct local_span span; /* around it, above 5 % of it */
};

/* Everything but result is meaningful unless the status is short or no_peak. */
void peak_find(const struct trace *trace, struct peak *peak);

#endif
