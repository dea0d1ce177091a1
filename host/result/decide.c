/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/decide.h"

#include <math.h>

#include <gsl/gsl_cdf.h>

#include "common/units.h"

#define REACH 8.0 /* of the common part, standard uncertainties */

enum { PANELS = 800 };

const char *decide_name(enum decision decision)
{
	static const char *const names[] = {[DECIDE_NONE] = "none",
	                                    [DECIDE_PASS] = "pass",
	                                    [DECIDE_CONDITIONAL_PASS] = "conditional pass",
	                                    [DECIDE_CONDITIONAL_FAIL] = "conditional fail",
	                                    [DECIDE_UNDECIDED] = "undecided",
	                                    [DECIDE_FAIL] = "fail"};

	return names[decision];
}

bool decide_meets(enum decision decision)
{
	return decision == DECIDE_PASS || decision == DECIDE_CONDITIONAL_PASS;
}

double decide_risk(double guard)
{
	return gsl_cdf_ugaussian_Q(DECIDE_COVERAGE * guard);
}

double decide_probability(double value, double u, double lower, double upper)
{
	if (!isfinite(value) || !isfinite(u))
		return (double)NAN;
	if (!(u > 0.0))
		return value >= lower && value <= upper;
	return gsl_cdf_ugaussian_P((upper - value) / u) - gsl_cdf_ugaussian_P((lower - value) / u);
}

static enum decision by_margin(double margin, double guard)
{
	if (margin >= guard)
		return DECIDE_PASS;
	if (margin >= 0.0)
		return DECIDE_CONDITIONAL_PASS;
	return margin >= -guard ? DECIDE_CONDITIONAL_FAIL : DECIDE_FAIL;
}

enum decision decide_value(double value, double u, double lower, double upper, double guard)
{
	if (!isfinite(value) || !isfinite(u))
		return DECIDE_UNDECIDED;
	return by_margin(fmin(upper - value, value - lower), guard * DECIDE_COVERAGE * u);
}

/* ---- many points ---- */

/* Whatever is exact but for the common part bounds it; what is left is smooth in it. */
static void bound_common(const struct decide_point *p, double *from, double *to)
{
	if (p->own > 0.0)
		return;
	if (p->common > 0.0) {
		*to = fmin(*to, p->below_upper / p->common);
		*from = fmax(*from, -p->above_lower / p->common);
	} else if (p->common < 0.0) {
		*from = fmax(*from, p->below_upper / p->common);
		*to = fmin(*to, -p->above_lower / p->common);
	} else if (!(p->below_upper >= 0.0 && p->above_lower >= 0.0)) {
		*to = *from;
	}
}

/* With the common part at so many of its standard uncertainties. */
static double decide_all_given(const struct decide_point *point, size_t count, double common)
{
	double all = 1.0;

	for (size_t i = 0; i < count && all > 1e-12; i++) {
		const struct decide_point *p = &point[i];
		double shift = common * p->common, high = p->below_upper - shift,
		       low = p->above_lower + shift;

		if (p->own > 0.0 && !(fmin(high, low) > REACH * p->own))
			all *= fmax(0.0,
			            gsl_cdf_ugaussian_P(high / p->own) - gsl_cdf_ugaussian_Q(low / p->own));
	}
	return all;
}

double decide_all(const struct decide_point *point, size_t count)
{
	double from = -REACH, to = REACH, sum = 0.0, step;

	for (size_t i = 0; i < count; i++)
		bound_common(&point[i], &from, &to);
	if (!(to > from))
		return 0.0;
	step = (to - from) / PANELS;
	for (int i = 0; i <= PANELS; i++) { /* Simpson */
		double at = from + i * step, weight = i == 0 || i == PANELS ? 1.0 : i % 2 ? 4.0 : 2.0;

		sum += weight * exp(-0.5 * at * at) * decide_all_given(point, count, at);
	}
	return sum * step / 3.0 / sqrt(2.0 * UNITS_PI);
}

double decide_guard(const struct decide_point *point, size_t count, double guard)
{
	double z = guard > 0.0 ? gsl_cdf_ugaussian_Qinv(decide_risk(guard) / (double)count) : 0.0;

	return guard * DECIDE_COVERAGE * fabs(point->common) + z * point->own;
}

enum decision decide_points(const struct decide_point *point, size_t count, double guard, double share)
{
	size_t within[DECIDE_FAIL + 1] = {0};
	double wanted = share * (double)count - 1e-9;

	for (size_t i = 0; i < count; i++) {
		double w = decide_guard(&point[i], count, guard);
		double margin = fmin(point[i].below_upper, point[i].above_lower);

		if (!isfinite(margin + w))
			return DECIDE_UNDECIDED;
		for (enum decision d = by_margin(margin, w); d <= DECIDE_FAIL; d++)
			within[d]++;
	}
	if (count == 0)
		return DECIDE_UNDECIDED;
	for (enum decision d = DECIDE_PASS; d <= DECIDE_CONDITIONAL_FAIL; d++)
		if ((double)within[d] >= wanted)
			return d;
	return DECIDE_FAIL;
}
