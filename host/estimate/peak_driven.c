/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "host/estimate/driven.h"
#include "host/estimate/limits.h"
#include "host/estimate/peak_private.h"

/* Cycles of the plate that S2's pulse may last, as wide as a half-sine of its width: a plate that follows the
 * case through a longer one has that pulse's shape, which its own samples tell better than any model of S2's.
 */
#define PULSE_CYCLES 0.8

/* S1's largest sample may lie above the oscillator by some of the peak and noise; higher, it is of another
 * contact. */
static bool peak_driven_same_contact(const struct driven_axis *axis, const struct driven *driven,
                                     const struct driven_curve *curve)
{
	const struct trace *trace = axis->trace[0];
	size_t at = axis->peak[0]->at;
	double there[3];

	driven_at(curve, trace_time(trace, at), there, NULL);
	return fabs(trace->value_g[at]) - fabs(there[0]) <
	       PEAK_FOOT_LEVEL * fabs(driven->peak_g) + LIMIT_NOISE * fmax(trace->noise_g, 0);
}

static bool knows_better(const struct driven_axis *axis, double sigma_g)
{
	const struct estimate_peak *s1 = &axis->peak[0]->result, *s2 = &axis->peak[1]->result;

	if (s2->how.status == ESTIMATE_CLIPPED ||
	    fabs(s2->value_g) < PEAK_WEAK_SIGMAS * axis->trace[1]->noise_g)
		return false;
	if (s1->how.status == ESTIMATE_CLIPPED)
		return !(sigma_g >= s1->sigma_g);
	return axis->peak[1]->width_s * axis->ringdown->result.frequency_hz < PULSE_CYCLES;
}

/* What the oscillator differs from the smooth curve's peak beyond chance, there: noise may have lifted
 * another swing. */
static double apart(const struct estimate_peak *s1, const struct driven *driven,
                    const struct driven_curve *curve)
{
	double chance = pow(s1->sigma_g, 2) - pow(driven->sigma_peak_g, 2), there[3], beyond;

	driven_at(curve, s1->time_s, there, NULL);
	beyond = pow(s1->value_g - there[0], 2) - pow(LIMIT_AGREE, 2) * fmax(chance, 0);
	return sqrt(fmax(beyond, 0));
}

static void peak_driven_take(const struct driven *driven, double sigma_g, struct estimate_peak *s1)
{
	s1->value_g = driven->peak_g;
	s1->sigma_g = sigma_g;
	s1->time_s = driven->peak_s;
	/* where it rests on S2's shape alone, S2's own uncertainty is in it */
	s1->sigma_time_s = s1->how.status == ESTIMATE_CLIPPED ? driven->sigma_s : driven->sigma_peak_s;
	s1->how.method = "driven-oscillator";
	peak_tried(&s1->how, s1->how.method);
	s1->how.chi_square = driven->chi_square;
	s1->how.flags &= ~(unsigned)(ESTIMATE_FLAG_MODEL | ESTIMATE_FLAG_WEAK);
	if (s1->how.status == ESTIMATE_CLIPPED)
		s1->how.flags |= ESTIMATE_FLAG_EXTRAPOLATED;
}

bool peak_driven(const struct driven_axis *axis, struct driven *driven, const struct driven_curve *curve,
                 struct peak *peak)
{
	struct estimate_peak *s1 = &peak->result;
	bool clipped = s1->how.status == ESTIMATE_CLIPPED, taken;
	double sigma;

	if (isnan(driven->peak_g))
		return false;
	if (!peak_driven_same_contact(axis, driven, curve)) {
		driven->flags |= ESTIMATE_FLAG_RIVAL;
		return false;
	}
	sigma = hypot(driven->sigma_peak_g,
	              clipped ? LIMIT_UNSEEN * driven->peak_g : apart(s1, driven, curve));
	taken = knows_better(axis, sigma);
	if (taken)
		peak_driven_take(driven, sigma, s1);
	else
		s1->sigma_time_s = hypot(s1->sigma_time_s, s1->time_s - driven->peak_s);
	return taken;
}
