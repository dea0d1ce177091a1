/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate_private.h"

#include <math.h>

bool estimate_meets(double sigma, double whole, double tolerance)
{
	return sigma <= (tolerance > 0 ? tolerance : ESTIMATE_TOLERANCE) * fabs(whole);
}

static void estimate_tolerance_peak(double width_s, double tolerance, struct estimate_peak *peak)
{
	if (isfinite(peak->value_g) && isfinite(peak->sigma_g) &&
	    !(estimate_meets(peak->sigma_g, peak->value_g, tolerance) &&
	      estimate_meets(peak->sigma_time_s, width_s, tolerance)))
		peak->how.flags |= ESTIMATE_FLAG_TOLERANCE;
}

static void estimate_tolerance_pulse(double tolerance, struct estimate_pulse *pulse)
{
	if ((isfinite(pulse->duration_s) &&
	     !estimate_meets(pulse->sigma_duration_s, pulse->duration_s, tolerance)) ||
	    (isfinite(pulse->velocity_change_m_s) &&
	     !estimate_meets(pulse->sigma_velocity_m_s, pulse->velocity_change_m_s, tolerance)))
		pulse->flags |= ESTIMATE_FLAG_TOLERANCE;
	if (isfinite(pulse->contact_time_s) &&
	    !estimate_meets(pulse->sigma_contact_s, pulse->contact_time_s, tolerance))
		pulse->contact.flags |= ESTIMATE_FLAG_TOLERANCE;
}

void estimate_tolerance(const struct desk *desk, struct analysis *analysis)
{
	double tolerance = desk->options->tolerance;

	for (size_t i = 0; i < analysis->channel_count; i++) {
		struct estimate_channel *channel = &analysis->channels[i];

		estimate_tolerance_peak(desk->work[i].peak.width_s, tolerance, &channel->peak);
		estimate_tolerance_pulse(tolerance, &channel->pulse);
	}
}
