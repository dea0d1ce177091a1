/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/model_numerics.h"

#include <float.h>
#include <math.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_roots.h>

/* ---- contact: m = k = v = 1 ------------------------------------------------------------------------------
 */

static double pressing(double damping, double depth, double speed)
{
	return depth > 0 ? fmax(depth * sqrt(depth) * (1 + damping * speed), 0) : 0;
}

double numerics_rk4_restitution(double damping, double contact_time, double step_share, double phase)
{
	double h = step_share * contact_time, d = -phase * h, v = 1, e = NAN;

	/* ten contact times, and what a few long steps need */
	for (double t = 0; isnan(e) && t < 10 * contact_time + 20 * h; t += h) {
		double a1 = -pressing(damping, d, v), v2 = v + h / 2 * a1;
		double a2 = -pressing(damping, d + h / 2 * v, v2), v3 = v + h / 2 * a2;
		double a3 = -pressing(damping, d + h / 2 * v2, v3), v4 = v + h * a3;
		double a4 = -pressing(damping, d + h * v3, v4);

		d += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
		v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
		if (d <= 0 && v < 0)
			e = -v;
	}
	return e;
}

static double plain_law(double d, void *context)
{
	const double *e = context;

	return log((1 + d) / (1 - *e * d)) - d * (1 + *e);
}

double numerics_plain_damping(double e)
{
	enum { ROUNDS = 200 };
	double low = 0.75 * (1 - e * e) / (1 + e * e * e), high = (1 - DBL_EPSILON) / e, root = NAN;
	gsl_function law = {plain_law, &e};
	gsl_root_fsolver *solver;

	if (!(plain_law(low, &e) < 0 && plain_law(high, &e) > 0))
		return NAN;
	solver = gsl_root_fsolver_alloc(gsl_root_fsolver_brent);
	if (!solver)
		return NAN;
	if (gsl_root_fsolver_set(solver, &law, low, high) == GSL_SUCCESS)
		for (int i = 0; i < ROUNDS && gsl_root_fsolver_iterate(solver) == GSL_SUCCESS; i++) {
			root = gsl_root_fsolver_root(solver);
			if (gsl_root_test_interval(gsl_root_fsolver_x_lower(solver),
			                           gsl_root_fsolver_x_upper(solver), 0,
			                           4 * DBL_EPSILON) == GSL_SUCCESS)
				break;
		}
	gsl_root_fsolver_free(solver);
	return root;
}

double numerics_linear_damping(double e)
{
	return 1.5 * (1 - e);
}

double numerics_damping_of_small(double e)
{
	enum { ROUNDS = 60 };
	double rest = 0;

	for (int i = 0; i < ROUNDS; i++) {
		double d = (1 - rest) / e;

		rest = (1 + d) * exp(-d * (1 + e));
	}
	return (1 - rest) / e;
}

/* sum over k >= 2 of D^(k-2) (e^k - (-1)^k)/k; its first term is -(1 - e)(1 + e)/2. */
static long double series(long double d, long double u)
{
	enum { TERMS = 60 };
	long double e = 1 - u, sum = -u * (1 + e) / 2, power = 1, e_power = e * e;

	for (int k = 3; k < TERMS; k++) {
		power *= d;
		e_power *= e;
		sum += power * (e_power + (k % 2 ? 1 : -1)) / k;
	}
	return sum;
}

double numerics_damping_near_one(double u)
{
	enum { ROUNDS = 200 };
	long double low = 0, high = 3 * (long double)u, middle = 0;

	for (int i = 0; i < ROUNDS; i++) {
		middle = (low + high) / 2;
		if (series(middle, u) < 0)
			low = middle;
		else
			high = middle;
	}
	return (double)middle;
}

/* ---- half-sine --------------------------------------------------------------------------------------------
 */

double numerics_plain_half_sine(double frequency_hz, double zeta, double pulse_s, double t)
{
	double w = 2 * acos(-1) * frequency_hz, forcing = acos(-1) / pulse_s, r = forcing / w;
	double rest = (1 - r * r) * (1 - r * r) + 4 * zeta * zeta * r * r, damped = w * sqrt(1 - zeta * zeta);
	double a = -(1 - r * r) / rest / (w * w), b = 2 * zeta * r / rest / (w * w);
	double s = (-zeta * w * b - a * forcing) / damped;

	return a * sin(forcing * t) + b * cos(forcing * t) +
	       exp(-zeta * w * t) * (s * sin(damped * t) - b * cos(damped * t));
}
