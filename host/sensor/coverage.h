/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SENSOR_COVERAGE_H
#define DT_HOST_SENSOR_COVERAGE_H
/*
 * How far a sum of independent errors lies from zero: what 10^6 draws of a budget tell (JCGM 101), without
 * drawing. The sum's characteristic function is the product of its terms', and the probability within +-U a
 * Fourier series of it. Pure functions.
 */
#include <stddef.h>

#define COVERAGE_PROBABILITY 0.9545 /* that of a normal law within two standard deviations */

enum coverage_law {
	COVERAGE_NORMAL,
	COVERAGE_RECTANGULAR, /* anywhere within its half-width, sqrt 3 of its standard deviation */
	COVERAGE_ARCSINE,     /* the component of a vector of known length and unknown direction: sqrt 2 */
};

enum { COVERAGE_TERMS_MAX = 96 };

struct coverage {
	double normal; /* variance of all that is normal */
	double other;  /* and of all that is not */
	size_t count;
	struct {
		enum coverage_law law;
		double half;
	} term[COVERAGE_TERMS_MAX];
};

/* A term more, by its standard deviation; beyond COVERAGE_TERMS_MAX it is taken as normal. */
void coverage_add(struct coverage *coverage, enum coverage_law law, double u);

/* U with P(|sum| < U) = COVERAGE_PROBABILITY; 0 of nothing. */
double coverage_expanded(const struct coverage *coverage);

/* The factor k of so many degrees of freedom; 2 of infinitely many. */
double coverage_factor(double degrees);

/* Of parts u with degrees each (infinite: a certificate), by Welch and Satterthwaite; of no part: infinite.
 */
double coverage_degrees(const double *u, const double *degrees, size_t count);

#endif
