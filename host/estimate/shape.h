/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SHAPE_H
#define DT_HOST_ESTIMATE_SHAPE_H
/*
 * A contact pulse of a named family, by least squares (lm.h): with phi = pi (t - peak) / base, inside the
 * base
 *
 *     half-sine A cos phi,   haversine A cos^2 phi,   sine-power A cos^p phi,   and 0 outside.
 *
 * A, the peak's instant, the base and p are unknown; zero is the trace's. Missing samples are left out.
 * Samples at a limit enter as what they are, "at least this": the likelihood of a censored normal variable
 * (Tobin 1958), which is exact for noise of the trace's size and for none.
 *
 * Two questions are put to the residual beside chi-square, each of one degree of freedom and therefore far
 * sharper: is it lopsided, does it ask for another power? Both as the score of that further unknown, in its
 * standard deviations (Rao 1948); all families are symmetric, so lopsided refuses every one of them.
 *
 * Standard deviations are from the covariance and the trace's noise; without a noise, the residual's.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/lm.h"
#include "host/estimate/trace.h"

/* What the residual says of a family. Doubtful happens to the right one too, in one of a hundred fits;
 * refused in one of ten thousand. */
enum shape_verdict {
	SHAPE_FITS,
	SHAPE_DOUBTFUL,
	SHAPE_REFUSED,
};

struct shape_start {
	double peak_g; /* signed */
	double peak_s;
	double half_width_s; /* full width at half height */
	/* samples between are as if at a limit; none when from_s > until_s */
	double limit_from_s, limit_until_s;
};

struct shape {
	enum estimate_family family;
	double peak_g, sigma_peak_g; /* signed */
	double peak_s, sigma_peak_s;
	double base_s, sigma_base_s;
	double power; /* 1, 2, or fitted */
	double area_g_s, sigma_area_g_s;
	double chi_square;      /* reduced; NAN without a noise to hold it against */
	unsigned freedom;       /* of chi_square */
	double skew_z, power_z; /* the scores; power_z 0 for sine-power; NAN like chi_square */
	double noise_g;         /* the sigmas are for this */
	struct cholesky factor; /* of the unknowns peak_g, peak_s - its start, base_s, power */
};

/* False when the samples are too few or no such pulse comes out. */
bool shape_fit(struct shape *shape, const struct trace *trace, enum estimate_family family,
               const struct shape_start *start);

/* Without a noise to hold the residual against everything fits. */
enum shape_verdict shape_judge(const struct shape *shape);

/* Whether no symmetric family will do: being lopsided is much of what the residual says, and not only what
 * sampling makes of another misfit. */
bool shape_lopsided(const struct shape *shape);

/* Whether none of the families will do, by the fit of one: it is refused, and lopsided or not for its power.
 */
bool shape_hopeless(const struct shape *shape);

/* The families in the order they are asked where none is given. */
enum { SHAPE_LADDER = 3 };
extern const enum estimate_family shape_ladder[SHAPE_LADDER];

/* Of cos^power over its half turn: the area of such a pulse of height and base 1. */
double shape_mean_cosine(double power);

/* Value, slope per s, curvature per s^2, and the variances of value and slope unless that is NULL. */
void shape_at(const struct shape *shape, double time_s, double derivative[3], double variance[2]);

#endif
