/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate_private.h"

#include <math.h>
#include <string.h>

#include "host/estimate/lag.h"
#include "host/estimate/resultant.h"

/* S1 peaks near the kink at the end of the contact, which no smooth curve follows. Where the driven
 * oscillator explains S1, its distance to what the curves say of an axis goes into the uncertainty of that
 * axis' time, and of what hangs on it. */
static void widen_by_driven(const struct desk *desk, struct analysis *analysis)
{
	struct estimate_lag *lag = &analysis->lag;
	static const char axes[2] = {'X', 'Y'};

	if (lag->driven.status != ESTIMATE_OK || (lag->driven.flags & ESTIMATE_FLAG_MODEL))
		return;
	for (unsigned i = 0; i < 2; i++) {
		struct estimate_peak *s1 = &analysis->channels[estimate_find(desk, "S1", axes[i])].peak;
		const struct estimate_peak *s2 = &analysis->channels[estimate_find(desk, "S2", axes[i])].peak;
		double apart = s1->time_s - s2->time_s - lag->driven_axis_s[i];

		if (isfinite(apart))
			s1->sigma_time_s = hypot(s1->sigma_time_s, apart);
	}
	if (isfinite(lag->largest_peak_s - lag->driven_s)) {
		double apart = lag->largest_peak_s - lag->driven_s;

		lag->sigma_s = hypot(lag->sigma_s, apart);
		analysis->resultants[0].sigma_time_s = hypot(analysis->resultants[0].sigma_time_s, apart);
	}
}

/* The flanks of a clipped S1 tell less of its peak than the oscillator that S2 drives. */
static void unclip_by_driven(const struct desk *desk, struct analysis *analysis)
{
	const struct estimate_lag *lag = &analysis->lag;
	static const char axes[2] = {'X', 'Y'};

	for (unsigned i = 0; i < 2; i++) {
		struct estimate_peak *s1 = &analysis->channels[estimate_find(desk, "S1", axes[i])].peak;
		const struct estimate_peak *s2 = &analysis->channels[estimate_find(desk, "S2", axes[i])].peak;

		if (!(s1->how.flags & ESTIMATE_FLAG_EXTRAPOLATED) || s2->how.status == ESTIMATE_CLIPPED ||
		    !(lag->sigma_driven_peak_g[i] < s1->sigma_g))
			continue;
		s1->value_g = lag->driven_peak_g[i];
		s1->sigma_g = lag->sigma_driven_peak_g[i];
		s1->time_s = s2->time_s + lag->driven_axis_s[i];
		s1->sigma_time_s = lag->sigma_driven_axis_s[i];
		s1->how.method = "driven-oscillator";
		s1->how.chi_square = lag->driven.chi_square;
		s1->how.flags &= ~(unsigned)(ESTIMATE_FLAG_MODEL | ESTIMATE_FLAG_TOLERANCE);
	}
}

/* The driven oscillator knows better than the contact's pulse alone when S1's decay is free. */
static void refine_decays(const struct desk *desk, const double free_s[2], struct analysis *analysis)
{
	static const char axes[2] = {'X', 'Y'};

	for (unsigned i = 0; i < 2; i++) {
		size_t s1 = estimate_find(desk, "S1", axes[i]);
		struct work *work = &desk->work[s1];

		if (isnan(free_s[i]))
			continue;
		work->span.from_s = free_s[i];
		ringdown_refine(&work->trace, &work->span, &work->ringdown);
		analysis->channels[s1].ringdown = work->ringdown.result;
	}
}

void estimate_sensors(const struct desk *desk, struct analysis *analysis)
{
	static const char *const names[ESTIMATE_SENSORS_MAX] = {"S1", "S2"};
	struct resultant resultant[ESTIMATE_SENSORS_MAX];
	struct lag_sensor sensor[ESTIMATE_SENSORS_MAX];
	double tolerance = desk->options->tolerance > 0 ? desk->options->tolerance : ESTIMATE_TOLERANCE,
	       free_s[2];

	analysis->resultant_count = 0;
	for (unsigned i = 0; i < ESTIMATE_SENSORS_MAX; i++) {
		size_t x = estimate_find(desk, names[i], 'X'), y = estimate_find(desk, names[i], 'Y'),
		       n = analysis->resultant_count;

		if (x == analysis->channel_count || y == analysis->channel_count)
			continue;
		sensor[n].axes = (struct resultant_axes){{&desk->work[x].trace, &desk->work[y].trace},
		                                         {&desk->work[x].peak, &desk->work[y].peak}};
		sensor[n].resultant = &resultant[n];
		sensor[n].ringdown[0] = &desk->work[x].ringdown;
		sensor[n].ringdown[1] = &desk->work[y].ringdown;
		resultant_find(&sensor[n].axes, &resultant[n]);
		analysis->resultants[n] = resultant[n].result;
		memcpy(analysis->resultants[n].sensor, names[i], sizeof("S1"));
		analysis->resultant_count++;
	}
	analysis->has_lag = analysis->resultant_count == ESTIMATE_SENSORS_MAX;
	if (!analysis->has_lag)
		return;
	lag_find(&sensor[0], &sensor[1], &analysis->lag, free_s);
	if (!(analysis->lag.driven.flags & ESTIMATE_FLAG_MODEL) &&
	    analysis->lag.sigma_driven_s > tolerance * resultant[1].width_s)
		analysis->lag.driven.flags |= ESTIMATE_FLAG_TOLERANCE;
	widen_by_driven(desk, analysis);
	unclip_by_driven(desk, analysis);
	refine_decays(desk, free_s, analysis);
}
