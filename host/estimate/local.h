/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LOCAL_H
#define DT_HOST_ESTIMATE_LOCAL_H
/*
 * A polynomial through the good samples around an instant, by least squares: it assumes a smooth signal
 * and no pulse shape. Value and derivatives at any time inside, each with its standard deviation.
 */
#include "host/estimate/cholesky.h"
#include "host/estimate/trace.h"

struct local {
	unsigned terms; /* order + 1 */
	double centre_s, half_s;
	double coefficient[CHOLESKY_MAX]; /* of ((t - centre_s) / half_s)^i */
	double residual_g;                /* standard deviation of the samples about it */
	unsigned freedom;                 /* samples less terms, of the residual */
	struct cholesky normal;
};

/* Where a local fit may take its samples. */
struct local_span {
	double from_s, until_s;
};

/* Fits samples with |t - centre_s| <= half_s inside span. False when they are fewer than order + 3, or do
 * not determine the polynomial. */
bool local_fit(struct local *local, const struct trace *trace, double centre_s, double half_s,
               const struct local_span *span, unsigned order);

/* Value, slope per s and curvature per s^2 at time_s. */
void local_at(const struct local *local, double time_s, double derivative[3]);

/* Standard deviation of derivative number order for samples with a standard deviation of 1. */
double local_spread(const struct local *local, double time_s, unsigned order);

#endif
