/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate_private.h"

#include <math.h>
#include <string.h>

#include "host/estimate/lag.h"
#include "host/estimate/resultant.h"

/* What an oscillator's peak may be off, as part of it, before the residual shows that the plate is none such:
 * where S1 is clipped nothing else tells. */
#define UNSEEN 1e-3

/* Cycles of the plate that S2's pulse may last: a plate that follows the case through a longer one has that
 * pulse's shape, which its own samples tell better than any model of S2's. */
#define PULSE_CYCLES 0.8

/* Standard deviations between a smooth curve's peak and the oscillator's that chance makes. */
#define PEAK_AGREE 3.0

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
	return true;
}

/* What the oscillator differs from the smooth curve's peak beyond chance, there: noise may have lifted
 * another swing. */
static double apart(const struct estimate_peak *s1, const struct driven *driven,
                    const struct driven_curve *curve)
{
	double chance = pow(s1->sigma_g, 2) - pow(driven->sigma_peak_g, 2), there[3], beyond;

	driven_at(curve, s1->time_s, there, NULL);
	beyond = pow(s1->value_g - there[0], 2) - pow(PEAK_AGREE, 2) * fmax(chance, 0);
	return sqrt(fmax(beyond, 0));
}

static void add_to_path(struct estimate_how *how, const char *method)
{
	unsigned tried = 0;

	while (tried < ESTIMATE_PATH_MAX && how->path[tried])
		tried++;
	if (tried < ESTIMATE_PATH_MAX)
		how->path[tried] = method;
}

/* S1 peaks near the kink at the end of the contact, which no smooth curve follows, and a clipped S1's flanks
 * tell less than the oscillator that S2 drives, where S2's shape is no guess. True where S1's peak is taken
 * from that. */
static bool take_driven(const struct estimate_peak *s2, const struct driven *driven,
                        const struct driven_curve *curve, double tolerance, struct estimate_peak *s1)
{
	bool clipped = s1->how.flags & ESTIMATE_FLAG_EXTRAPOLATED;
	double sigma;

	if (isnan(driven->peak_g) || s2->how.status == ESTIMATE_CLIPPED)
		return false;
	sigma = hypot(driven->sigma_peak_g, clipped ? UNSEEN * driven->peak_g : apart(s1, driven, curve));
	if (clipped && !(sigma < s1->sigma_g))
		return false;
	s1->value_g = driven->peak_g;
	s1->sigma_g = sigma;
	s1->time_s = driven->peak_s;
	s1->sigma_time_s = driven->sigma_peak_s;
	s1->how.method = "driven-oscillator";
	add_to_path(&s1->how, s1->how.method);
	s1->how.chi_square = driven->chi_square;
	s1->how.flags &= ~(unsigned)ESTIMATE_FLAG_MODEL;
	if (sigma <= tolerance * fabs(s1->value_g))
		s1->how.flags &= ~(unsigned)ESTIMATE_FLAG_TOLERANCE;
	return true;
}

/* An axis of S1 on S2: its peak, and when its decay is free, which the contact's pulse alone knows less well.
 */
static void drive(const struct desk *desk, unsigned axis, const struct sensor *s2, double tolerance,
                  struct sensor *s1, struct driven *driven, struct driven_curve *curve)
{
	struct work *work = &desk->work[s1->at[axis]];
	const struct peak *peak = s2->axes.peak[axis];
	const struct driven_axis pair = {
	        {&work->trace, s2->axes.trace[axis]}, {&work->peak, peak}, &work->ringdown};

	driven_find(&pair, driven, curve);
	if (peak->width_s * work->ringdown.result.frequency_hz < PULSE_CYCLES &&
	    take_driven(&peak->result, driven, curve, tolerance, &work->peak.result))
		s1->axes.curve[axis] = curve;
	if (isnan(driven->free_s))
		return;
	work->span.from_s = driven->free_s;
	ringdown_refine(&work->trace, &work->span, &work->ringdown);
}

static void add_resultant(const char *name, struct sensor *sensor, struct analysis *analysis)
{
	struct estimate_resultant *result = &analysis->resultants[analysis->resultant_count++];

	resultant_find(&sensor->axes, &sensor->resultant);
	*result = sensor->resultant.result;
	strcpy(result->sensor, name);
}

void estimate_sensors(const struct desk *desk, struct analysis *analysis)
{
	double tolerance = desk->options->tolerance > 0 ? desk->options->tolerance : ESTIMATE_TOLERANCE;
	struct estimate_lag *lag = &analysis->lag;
	struct sensor s1, s2;
	struct driven driven[2];
	struct driven_curve curve[2];
	bool has_s1 = find_sensor(desk, "S1", &s1), has_s2 = find_sensor(desk, "S2", &s2);

	analysis->has_lag = has_s1 && has_s2;
	analysis->resultant_count = 0;
	for (unsigned i = 0; analysis->has_lag && i < 2; i++) {
		struct estimate_channel *channel = &analysis->channels[s1.at[i]];

		drive(desk, i, &s2, tolerance, &s1, &driven[i], &curve[i]);
		channel->peak = desk->work[s1.at[i]].peak.result;
		channel->ringdown = desk->work[s1.at[i]].ringdown.result;
	}
	if (has_s1)
		add_resultant("S1", &s1, analysis);
	if (has_s2)
		add_resultant("S2", &s2, analysis);
	if (!analysis->has_lag)
		return;
	lag_find(&(struct lag_sensor){s1.axes, &s1.resultant}, &(struct lag_sensor){s2.axes, &s2.resultant},
	         driven, lag);
	if (!(lag->driven.flags & ESTIMATE_FLAG_MODEL) &&
	    lag->sigma_driven_s > tolerance * s2.resultant.width_s)
		lag->driven.flags |= ESTIMATE_FLAG_TOLERANCE;
}
