/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/rebound.h"

#include <math.h>

#include "host/estimate/limits.h"

/* Contacts rise steeply and fade slowly: from the 10 % point to where they have faded, or to the noise, and
 * on to the foot by this part of that time, give or take half of it. A force linear in what is left to go
 * asks for a quarter, one of power 1.5 for a half. */
#define FADE_ON 0.4

double rebound_again_g(const struct trace *trace, double peak_g)
{
	return fmax(LIMIT_AGAIN * fabs(peak_g), LIMIT_NOISE * trace->noise_g);
}

static bool rebound_measured(const struct rebound_axes *axes, unsigned i)
{
	return isfinite(axes->pulse[i]->velocity_change_m_s);
}

/* Of the axes that have a pulse of their own; count when none has. */
static unsigned strongest(const struct rebound_axes *axes)
{
	unsigned at = axes->count;

	for (unsigned i = 0; i < axes->count; i++)
		if (rebound_measured(axes, i) && !(axes->peak[i]->result.how.flags & ESTIMATE_FLAG_WEAK) &&
		    (at == axes->count ||
		     fabs(axes->peak[i]->result.value_g) > fabs(axes->peak[at]->result.value_g)))
			at = i;
	return at;
}

static void by_velocity(const struct rebound_axes *axes, double speed_m_s, struct estimate_rebound *rebound)
{
	double square = 0, variance = 0;

	for (unsigned i = 0; i < axes->count; i++) {
		const struct estimate_pulse *pulse = axes->pulse[i];

		if (!rebound_measured(axes, i))
			continue;
		if (pulse->status == ESTIMATE_CLIPPED)
			rebound->status = ESTIMATE_CLIPPED;
		square += pow(pulse->velocity_change_m_s, 2);
		variance += pow(pulse->velocity_change_m_s * pulse->sigma_velocity_m_s, 2);
	}
	rebound->velocity_ratio = sqrt(square) / speed_m_s - 1;
	rebound->sigma_velocity_ratio = sqrt(variance / square) / speed_m_s;
}

/* Where any axis of the case rises from 10 % of its second pulse, and how well that is known: the edge is
 * interpolated between two samples. False when it is not hit again. */
static bool second_impact(const struct rebound_axes *axes, unsigned strong, double *impact_s, double *sigma_s)
{
	const struct estimate_pulse *first = axes->pulse[strong];
	const double peak = axes->peak[strong]->result.value_g;

	*impact_s = INFINITY;
	for (unsigned i = 0; i < axes->count; i++) {
		const struct trace *trace = axes->trace[i];
		double edge;
		size_t k = trace_index(trace, first->end_s + first->duration_s), top;

		k = trace_reaches(trace, k, trace->count, rebound_again_g(trace, peak));
		if (k == trace->count)
			continue;
		for (top = k;
		     k < trace->count && trace_time(trace, k) < trace_time(trace, top) + first->duration_s;
		     k++)
			if (trace_good(trace, k) && fabs(trace->value_g[k]) > fabs(trace->value_g[top]))
				top = k;
		if (!trace_edge(trace, top, -1, trace->value_g[top] < 0 ? -1 : 1,
		                LIMIT_EDGE * fabs(trace->value_g[top]), &edge) ||
		    edge >= *impact_s)
			continue;
		*impact_s = edge;
		*sigma_s = 1 / trace->rate_hz / sqrt(12.0);
	}
	return isfinite(*impact_s);
}

/* Where the first contact is over. */
static double rebound_contact_end(const struct rebound_axes *axes, unsigned strong, double *sigma_s)
{
	const struct estimate_pulse *pulse = axes->pulse[strong];
	const struct peak *peak = axes->peak[strong];
	const struct trace *trace = axes->trace[strong];
	double level = LIMIT_FADED * fabs(peak->result.value_g), fade;

	level = fmax(level, LIMIT_AGREE * trace->noise_g);
	(void)trace_edge(trace, peak->at, 1, peak->sign, level, &fade);
	fade = fmin(fmax(fade - pulse->end_s, 0), pulse->duration_s);
	*sigma_s = hypot(pulse->sigma_duration_s / sqrt(2.0), FADE_ON / 2 * fade);
	return pulse->end_s + (1 + FADE_ON) * fade;
}

static void by_flight(const struct rebound_axes *axes, double speed_m_s, double gravity_m_s2,
                      struct estimate_rebound *rebound)
{
	unsigned strong = strongest(axes);
	double impact, end, sigma = 0, sigma_end, ratio_s = gravity_m_s2 / (2 * speed_m_s);

	if (strong == axes->count || !second_impact(axes, strong, &impact, &sigma))
		return;
	rebound->second_impact_s = impact;
	end = rebound_contact_end(axes, strong, &sigma_end);
	sigma = hypot(sigma, LIMIT_KNOWN * axes->pulse[strong]->duration_s);
	rebound->flight_ratio = ratio_s * (impact - end);
	rebound->sigma_flight_ratio = ratio_s * hypot(sigma, sigma_end);
}

void rebound_find(const struct rebound_axes *axes, double impact_speed_m_s, double gravity_m_s2,
                  struct estimate_rebound *rebound)
{
	struct estimate_rebound found = {NAN, NAN, NAN, NAN, NAN, ESTIMATE_SHORT};
	double apart;

	*rebound = found;
	if (strongest(axes) == axes->count)
		return;
	found.status = ESTIMATE_OK;
	by_velocity(axes, impact_speed_m_s, &found);
	by_flight(axes, impact_speed_m_s, gravity_m_s2, &found);
	apart = fabs(found.velocity_ratio - found.flight_ratio);
	if (found.status == ESTIMATE_OK && apart > LIMIT_SLIGHT &&
	    !(apart <= LIMIT_AGREE * hypot(found.sigma_velocity_ratio, found.sigma_flight_ratio)))
		found.status = ESTIMATE_AMBIGUOUS;
	*rebound = found;
}
