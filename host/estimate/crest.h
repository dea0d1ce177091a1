/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CREST_H
#define DT_HOST_ESTIMATE_CREST_H
/*
 * The crest of the magnitude of one or two axes: sqrt(sum of squares) of local polynomials, one per axis at
 * its own rate, maximised on one continuous time. One axis is a peak, two are a resultant.
 *
 * Two orders are fitted, order 4 over +-0.35 width and order 6 over +-0.465 width. Where order 6 leaves a
 * residual that noise does not explain (ripple on the pulse), or half the orders' difference is more than
 * noise makes of order 6 (a steep side), both windows shrink until it is not, or the samples run out. The
 * value is that of order 6, its standard uncertainty noise or residual through the fit and half the
 * difference of the two orders, added in squares: the difference sees a shape that the polynomials cannot
 * follow.
 */
#include "host/estimate/local.h"

enum { CREST_AXES_MAX = 2 };

struct crest {
	double value_g; /* magnitude, not negative */
	double sigma_g;
	double time_s;
	double sigma_time_s;
	double model_g, model_s;           /* half the difference of the orders, within the sigmas */
	double chi_square;                 /* reduced, of order 6 over all axes; NAN without a noise */
	struct local axis[CREST_AXES_MAX]; /* order 6 */
};

/* Looks around near_s with samples inside span; width_s is the base of a half-sine as wide as the pulse at
 * half height. False when there is no maximum inside, or the samples are too few for both orders. */
bool crest_fit(struct crest *crest, const struct trace *const axes[], unsigned count, double near_s,
               double width_s, const struct local_span *span);

/* The noise a local fit is to be believed with: the trace's, or the residual where that is more than noise.
 */
double crest_noise(const struct local *local, const struct trace *trace);

#endif
