/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate_private.h"

#include <math.h>
#include <string.h>

#include "host/estimate/lag.h"
#include "host/estimate/resultant.h"

/* X and Y of a sensor in the record. */
struct sensor {
	size_t at[2];
	struct resultant_axes axes;
	struct resultant resultant;
};

/* False unless both are there. */
static bool find_sensor(const struct desk *desk, const char *name, struct sensor *sensor)
{
	static const char axis[2] = {'X', 'Y'};

	for (unsigned i = 0; i < 2; i++) {
		sensor->at[i] = estimate_find(desk, name, axis[i]);
		if (sensor->at[i] == desk->record->channel_count)
			return false;
		sensor->axes.trace[i] = &desk->work[sensor->at[i]].trace;
		sensor->axes.peak[i] = &desk->work[sensor->at[i]].peak;
		sensor->axes.curve[i] = NULL;
	}
	sensor->axes.tolerance = desk->options->tolerance;
	return true;
}

/* An axis of S1 on S2: its peak, and when its decay is free, which the contact's pulse alone knows less well.
 */
static void estimate_sensors_drive(const struct desk *desk, unsigned i, const struct sensor *s2,
                                   struct sensor *s1, struct driven *driven, struct driven_curve *curve)
{
	struct work *work = &desk->work[s1->at[i]];
	const struct driven_axis axis = {
	        {&work->trace, s2->axes.trace[i]}, {&work->peak, s2->axes.peak[i]}, &work->ringdown};

	driven_find(&axis, driven, curve);
	if (peak_driven(&axis, driven, curve, &work->peak))
		s1->axes.curve[i] = curve;
	else if (driven->status == ESTIMATE_NOT_CONVERGED || driven->flags & ESTIMATE_FLAG_MODEL)
		peak_narrow(&work->trace, &work->peak);
	if (isnan(driven->free_s))
		return;
	work->span.from_s = driven->free_s;
	ringdown_refine(&work->trace, &work->span, &work->ringdown);
}

/* S1's weak axes, where no oscillator of their own gave their peak, peak with the strong one. */
static void time_weak(const struct desk *desk, struct analysis *analysis)
{
	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = estimate_find(desk, "S1", *axis);
		struct work *work = &desk->work[i];

		if (i == analysis->channel_count || !work->strong ||
		    !(work->peak.result.how.flags & ESTIMATE_FLAG_WEAK))
			continue;
		peak_weak_time(work->strong, &work->peak);
		analysis->channels[i].peak = work->peak.result;
	}
}

static void estimate_sensors_add_resultant(const char *name, struct sensor *sensor, struct analysis *analysis)
{
	struct estimate_resultant *result = &analysis->resultants[analysis->resultant_count++];

	resultant_find(&sensor->axes, &sensor->resultant);
	*result = sensor->resultant.result;
	strcpy(result->sensor, name);
}

void estimate_sensors(const struct desk *desk, struct analysis *analysis)
{
	struct estimate_lag *lag = &analysis->lag;
	struct sensor s1, s2;
	struct driven driven[2];
	struct driven_curve curve[2];
	bool has_s1 = find_sensor(desk, "S1", &s1), has_s2 = find_sensor(desk, "S2", &s2);

	analysis->has_lag = has_s1 && has_s2;
	analysis->resultant_count = 0;
	for (unsigned i = 0; analysis->has_lag && i < 2; i++) {
		struct estimate_channel *channel = &analysis->channels[s1.at[i]];

		estimate_sensors_drive(desk, i, &s2, &s1, &driven[i], &curve[i]);
		channel->peak = desk->work[s1.at[i]].peak.result;
		if (s1.axes.curve[i] && channel->peak.time_s > channel->pulse.start_s &&
		    channel->peak.time_s < channel->pulse.end_s)
			channel->pulse.flags &=
			        ~(unsigned)ESTIMATE_FLAG_RIVAL; /* it knows which swing is the largest */
		channel->ringdown = desk->work[s1.at[i]].ringdown.result;
	}
	time_weak(desk, analysis);
	if (has_s1)
		estimate_sensors_add_resultant("S1", &s1, analysis);
	if (has_s2)
		estimate_sensors_add_resultant("S2", &s2, analysis);
	if (!analysis->has_lag)
		return;
	lag_find(&(struct lag_sensor){s1.axes, &s1.resultant}, &(struct lag_sensor){s2.axes, &s2.resultant},
	         driven, lag);
	if (!(lag->driven.flags & ESTIMATE_FLAG_MODEL) &&
	    !estimate_meets(lag->sigma_driven_s, s2.resultant.width_s, desk->options->tolerance))
		lag->driven.flags |= ESTIMATE_FLAG_TOLERANCE;
}
