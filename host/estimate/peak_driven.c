/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "host/estimate/driven.h"
#include "host/estimate/peak_private.h"

/* What an oscillator's peak may be off, as part of it, before the residual shows that the plate is none such:
 * where S1 is clipped nothing else tells. */
#define UNSEEN 1e-3

/* Cycles of the plate that S2's pulse may last, as wide as a half-sine of its width: a plate that follows the
 * case through a longer one has that pulse's shape, which its own samples tell better than any model of S2's.
 */
#define PULSE_CYCLES 0.8

/* Sigma from which S2's shape is more than a guess. */
#define SHAPE_SIGMAS 12.0

/* Standard deviations between a smooth curve's peak and the oscillator's that chance makes. */
#define AGREE 3.0

static bool knows_better(const struct driven_axis *axis, double sigma_g)
{
	const struct estimate_peak *s1 = &axis->peak[0]->result, *s2 = &axis->peak[1]->result;

	if (s2->how.status == ESTIMATE_CLIPPED || fabs(s2->value_g) < SHAPE_SIGMAS * axis->trace[1]->noise_g)
		return false;
	if (s1->how.status == ESTIMATE_CLIPPED)
		return sigma_g < s1->sigma_g;
	return axis->peak[1]->width_s * axis->ringdown->result.frequency_hz < PULSE_CYCLES;
}

/* What the oscillator differs from the smooth curve's peak beyond chance, there: noise may have lifted
 * another swing. */
static double apart(const struct estimate_peak *s1, const struct driven *driven,
                    const struct driven_curve *curve)
{
	double chance = pow(s1->sigma_g, 2) - pow(driven->sigma_peak_g, 2), there[3], beyond;

	driven_at(curve, s1->time_s, there, NULL);
	beyond = pow(s1->value_g - there[0], 2) - pow(AGREE, 2) * fmax(chance, 0);
	return sqrt(fmax(beyond, 0));
}

bool peak_driven(const struct driven_axis *axis, const struct driven *driven,
                 const struct driven_curve *curve, const struct estimate_options *options, struct peak *peak)
{
	struct estimate_peak *s1 = &peak->result;
	bool clipped = s1->how.status == ESTIMATE_CLIPPED;
	double sigma;

	if (isnan(driven->peak_g))
		return false;
	sigma = hypot(driven->sigma_peak_g, clipped ? UNSEEN * driven->peak_g : apart(s1, driven, curve));
	if (!knows_better(axis, sigma)) {
		s1->sigma_time_s = hypot(s1->sigma_time_s, s1->time_s - driven->peak_s);
		return false;
	}
	s1->value_g = driven->peak_g;
	s1->sigma_g = sigma;
	s1->time_s = driven->peak_s;
	s1->sigma_time_s = clipped ? driven->sigma_s : driven->sigma_peak_s;
	s1->how.method = "driven-oscillator";
	peak_tried(&s1->how, s1->how.method);
	s1->how.chi_square = driven->chi_square;
	s1->how.flags &= ~(unsigned)(ESTIMATE_FLAG_MODEL | ESTIMATE_FLAG_WEAK | ESTIMATE_FLAG_TOLERANCE);
	s1->how.flags |= clipped ? ESTIMATE_FLAG_EXTRAPOLATED : 0;
	if (!peak_meets(peak, options))
		s1->how.flags |= ESTIMATE_FLAG_TOLERANCE;
	return true;
}
