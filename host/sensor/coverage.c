/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/sensor/coverage.h"

#include <math.h>
#include <stdbool.h>

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_sf_bessel.h>

#include "common/units.h"

#define DEGREES_MANY 1e6 /* are infinitely many */
#define TAIL_SIGMAS 6.0  /* of a normal law: nothing is beyond */
#define NOTHING 1e-10    /* of a characteristic function */

enum { SERIES_MAX = 4000, BISECTIONS = 50 };

void coverage_add(struct coverage *coverage, enum coverage_law law, double u)
{
	if (!(u > 0.0))
		return;
	if (law == COVERAGE_NORMAL || coverage->count == COVERAGE_TERMS_MAX) {
		coverage->normal += u * u;
		return;
	}
	coverage->other += u * u;
	coverage->term[coverage->count].law = law;
	coverage->term[coverage->count++].half = u * sqrt(law == COVERAGE_ARCSINE ? 2.0 : 3.0);
}

static double characteristic(const struct coverage *c, double t)
{
	double product = exp(-0.5 * c->normal * t * t);

	for (size_t i = 0; i < c->count && fabs(product) > NOTHING; i++) {
		double x = c->term[i].half * t;

		product *= c->term[i].law == COVERAGE_ARCSINE ? gsl_sf_bessel_J0(x) : sin(x) / x;
	}
	return product;
}

static double probability_within(const double *series, int terms, double u_over_period)
{
	double probability = u_over_period;

	for (int m = 1; m <= terms; m++)
		probability += 2.0 / UNITS_PI * series[m - 1] * sin(m * UNITS_PI * u_over_period) / m;
	return probability;
}

double coverage_expanded(const struct coverage *coverage)
{
	double period = TAIL_SIGMAS * sqrt(coverage->normal), low = 0.0, high = 1.0, series[SERIES_MAX];
	int terms = 0;

	for (size_t i = 0; i < coverage->count; i++)
		period += coverage->term[i].half;
	if (!(period > 0.0))
		return 0.0;
	while (terms < SERIES_MAX) {
		double t = (terms + 1) * UNITS_PI / period;

		series[terms++] = characteristic(coverage, t);
		if (exp(-0.5 * coverage->normal * t * t) < NOTHING)
			break;
	}
	for (int i = 0; i < BISECTIONS; i++) {
		double middle = 0.5 * (low + high);

		*(probability_within(series, terms, middle) < COVERAGE_PROBABILITY ? &low : &high) = middle;
	}
	return low * period;
}

double coverage_factor(double degrees)
{
	double tail = (1.0 - COVERAGE_PROBABILITY) / 2.0;

	return degrees < DEGREES_MANY ? gsl_cdf_tdist_Qinv(tail, degrees) : gsl_cdf_ugaussian_Qinv(tail);
}

double coverage_degrees(const double *u, const double *degrees, size_t count)
{
	double variance = 0.0, sum = 0.0;

	for (size_t i = 0; i < count; i++) {
		variance += u[i] * u[i];
		sum += pow(u[i], 4) / degrees[i];
	}
	return sum > 0.0 ? variance * variance / sum : (double)INFINITY;
}
