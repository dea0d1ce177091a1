/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown.h"

#include <math.h>

#include "host/estimate/limits.h"

/* How far apart exchange between the axes may lead a law's damping, as part of it; a hundredth of it is left
 * in doubt. */
#define LAW_APART 0.15

/* What the contact's last force leaves in a damping, as part of its uncertainty: both axes have it. */
#define COMMON 0.25

struct value {
	double value, sigma;
	bool agree;
};

/* By the inverse squares of their own uncertainties. Where the two disagree, half of what they are apart is
 * added. One difference says little of its own size, so chance does not widen. */
static struct value weighted_mean(double a, double sigma_a, double b, double sigma_b)
{
	/* Data without noise must not divide by zero. */
	double sa = fmax(sigma_a, 1e-12 * fabs(a)), sb = fmax(sigma_b, 1e-12 * fabs(b));
	double wa = 1 / (sa * sa), wb = 1 / (sb * sb);
	struct value mean = {(wa * a + wb * b) / (wa + wb), 0, fabs(a - b) < LIMIT_AGREE * hypot(sa, sb)};

	mean.sigma = hypot(sqrt(1 / (wa + wb)), mean.agree ? 0 : (a - b) / 2);
	return mean;
}

/* Mounts that stiffen or soften hand swing from one axis to the other: what one seems to lose the other seems
 * to keep. The weights go as the swings' squares, as their energy does, so that the mean is hardly touched.
 */
static struct value mean_of_laws(double a, double sigma_a, double b, double sigma_b)
{
	struct value mean = weighted_mean(a, sigma_a, b, sigma_b);

	mean.agree = mean.agree || fabs(a - b) < LAW_APART * mean.value;
	if (mean.agree)
		mean.sigma = hypot(1 / hypot(1 / sigma_a, 1 / sigma_b), LIMIT_PART * mean.value);
	return mean;
}

static double ringdown_combine_mean_of(double a, double b)
{
	return isnan(a) ? b : isnan(b) ? a : (a + b) / 2;
}

void ringdown_combine(const struct ringdown *x, const struct ringdown *y, struct estimate_ringdown *combined)
{
	const struct estimate_ringdown *a = &x->result, *b = &y->result;
	struct estimate_ringdown found = b->sigma_hz < a->sigma_hz ? *b : *a;
	struct value mean;
	unsigned flags = a->how.flags | b->how.flags;
	bool agree;

	if (a->how.status != ESTIMATE_OK || b->how.status != ESTIMATE_OK) {
		*combined = b->how.status == ESTIMATE_OK ? *b : *a;
		return;
	}
	mean = weighted_mean(a->frequency_hz, a->sigma_hz, b->frequency_hz, b->sigma_hz);
	found.frequency_hz = mean.value;
	found.sigma_hz = mean.sigma;
	agree = mean.agree;
	if (!mean.agree && fabs(a->frequency_hz - b->frequency_hz) > LIMIT_KNOWN * mean.value)
		found.how.status = ESTIMATE_AMBIGUOUS;
	mean = weighted_mean(a->natural_frequency_hz, a->sigma_natural_hz, b->natural_frequency_hz,
	                     b->sigma_natural_hz);
	found.natural_frequency_hz = mean.value;
	found.sigma_natural_hz = mean.sigma;
	mean = (flags & ESTIMATE_FLAG_AMPLITUDE ? mean_of_laws : weighted_mean)(
	        a->damping_ratio, a->sigma_damping, b->damping_ratio, b->sigma_damping);
	found.damping_ratio = mean.value;
	found.sigma_damping = hypot(mean.sigma, COMMON * fmin(a->sigma_damping, b->sigma_damping));
	agree = agree && mean.agree;
	found.small_swing_hz = ringdown_combine_mean_of(a->small_swing_hz, b->small_swing_hz);
	found.amplitude_g = hypot(a->amplitude_g, b->amplitude_g);
	found.three_cycle_frequency_hz =
	        ringdown_combine_mean_of(a->three_cycle_frequency_hz, b->three_cycle_frequency_hz);
	found.how.flags = flags | (agree ? 0u : ESTIMATE_FLAG_MODEL);
	*combined = found;
}
