/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "host/base/mapped.h"
#include "host/estimate/cfc.h"
#include "host/estimate/clean.h"
#include "host/estimate/doubt.h"
#include "host/estimate/estimate_private.h"
#include "host/estimate/filter.h"
#include "host/estimate/iepe.h"
#include "host/estimate/limits.h"
#include "host/estimate/pulse.h"
#include "host/estimate/quiet.h"
#include "host/estimate/rebound.h"
#include "host/estimate/ripple.h"
#include "host/estimate/spike.h"

/* Around the trigger, what belongs to the impact that fired it: the product comes back for another. */
#define EVENT_BEFORE_S 0.02
#define EVENT_AFTER_S 0.1

static int estimate_prepare(const struct desk *desk, size_t i, struct estimate_baseline *baseline)
{
	const struct estimate_options *options = desk->options;
	struct trace *trace = &desk->work[i].trace;

	clean_find(trace, desk->scratch, baseline);
	baseline_remove(trace, baseline);
	spike_of_noise(trace, baseline);
	trace->noise_g *= quiet_colour(trace, baseline);
	if (options->iepe_time_constant_s > 0)
		iepe_undo(trace, baseline->from_s, options->iepe_time_constant_s);
	if (options->cfc > 0) {
		int result = cfc_filter(trace, options->cfc);

		if (result != 0)
			return result;
	}
	return options->lowpass_hz > 0 ? filter_lowpass(trace, options->lowpass_hz) : 0;
}

static void analyse_channel(const struct desk *desk, size_t i, struct estimate_channel *out)
{
	struct work *work = &desk->work[i];

	peak_find(&work->trace, desk->options, &work->peak);
	if (work->first_of_two)
		work->peak.result.how.flags |= ESTIMATE_FLAG_FIRST;
	if (out->baseline.unsettled && work->peak.result.how.status == ESTIMATE_OK)
		work->peak.result.how.status = ESTIMATE_AMBIGUOUS;
	pulse_measure(&work->trace, &work->peak, &out->baseline, desk->options->family, &out->pulse);
	if (work->first_of_two)
		out->pulse.flags |= ESTIMATE_FLAG_FIRST;
	doubt_channel(&work->trace, &out->baseline, desk->record->channels[i].sensor == 1, &work->peak,
	              &out->pulse);
	doubt_chain(&work->trace, &out->baseline, &work->peak, &out->pulse);
	if (out->baseline.unsettled && out->pulse.status == ESTIMATE_OK)
		out->pulse.status = ESTIMATE_AMBIGUOUS;
	out->peak = work->peak.result;
	out->flags = work->trace.flags;
}

size_t estimate_find(const struct desk *desk, const char *sensor, char axis)
{
	size_t i;

	for (i = 0; i < desk->record->channel_count; i++) {
		const struct channel *channel = &desk->record->channels[i];

		if (channel->sensor > 0 && channel->sensor == sensor[1] - '0' && channel->axis == axis)
			break;
	}
	return i;
}

/* What a ripple under the noise leaves in doubt of the case's peaks, or of a plate's that is as wide and
 * follows. */
static void analyse_ripple(const struct desk *desk, const char *sensor, struct analysis *analysis)
{
	const struct trace *trace[2];
	struct peak *peak[2];
	size_t at[2];
	unsigned count = 0;

	for (const char *axis = "XY"; *axis; axis++) {
		size_t box = estimate_find(desk, "S2", *axis), i = estimate_find(desk, sensor, *axis);

		if (box == analysis->channel_count || i == analysis->channel_count ||
		    !(fabs(desk->work[i].peak.width_s - desk->work[box].peak.width_s) <
		      LIMIT_SLIGHT * desk->work[box].peak.width_s))
			continue;
		at[count] = i;
		trace[count] = &desk->work[i].trace;
		peak[count++] = &desk->work[i].peak;
	}
	ripple_widen(trace, peak, count);
	for (unsigned i = 0; i < count; i++)
		analysis->channels[at[i]].peak = peak[i]->result;
}

/* Weak axes of a sensor take the shape of its strongest one. */
static void analyse_weak(const struct desk *desk, const char *sensor, struct analysis *analysis)
{
	size_t strong = analysis->channel_count;

	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = estimate_find(desk, sensor, *axis);

		if (i < analysis->channel_count && isfinite(analysis->channels[i].peak.value_g) &&
		    (strong == analysis->channel_count ||
		     fabs(analysis->channels[i].peak.value_g) >
		             fabs(analysis->channels[strong].peak.value_g)))
			strong = i;
	}
	for (const char *axis = "XYZ"; *axis && strong < analysis->channel_count; axis++) {
		size_t i = estimate_find(desk, sensor, *axis);
		struct work *work = &desk->work[i];

		if (i == analysis->channel_count || i == strong)
			continue;
		if (!peak_is_weak(&work->trace, &work->peak) ||
		    !peak_weak(&work->trace, &desk->work[strong].trace, &desk->work[strong].peak,
		               &work->peak)) {
			doubt_share((const struct trace *const[]){&desk->work[strong].trace, &work->trace},
			            (struct peak *const[]){&desk->work[strong].peak, &work->peak},
			            (struct estimate_pulse *const[]){&analysis->channels[strong].pulse,
			                                             &analysis->channels[i].pulse});
			analysis->channels[i].peak = work->peak.result;
			continue;
		}
		work->strong = &desk->work[strong].peak;
		pulse_of_weak(&work->trace, &work->peak, &analysis->channels[i].baseline,
		              &analysis->channels[strong].pulse, &analysis->channels[i].pulse);
		analysis->channels[i].peak = work->peak.result;
	}
}

/* Whether the trace begins or ends inside its pulse. */
static bool cuts_pulse(const struct work *work)
{
	const struct trace *trace = &work->trace;
	double time = work->peak.result.time_s, width = work->peak.width_s;

	return time - trace->start_s < width || trace_time(trace, trace->count) - time < width;
}

static void flag_short(const struct desk *desk, struct analysis *analysis)
{
	for (size_t i = 0; i < analysis->channel_count; i++) {
		struct estimate_channel *channel = &analysis->channels[i];

		if (channel->peak.how.status == ESTIMATE_SHORT ||
		    (channel->pulse.status == ESTIMATE_SHORT && cuts_pulse(&desk->work[i])))
			channel->flags |= RECORD_FLAG_SHORT;
	}
}

/* What all channels were before the case was hit is quiet. A drop whose trigger did not come with it has that
 * instant for one. */
static void estimate_touch(const struct desk *desk)
{
	double touch_s = INFINITY, height[] = {0, 0, 0}, most = 0;
	const char *axes = "XYZ";

	for (unsigned j = 0; j < 3; j++) {
		size_t i = estimate_find(desk, "S2", axes[j]);

		if (i < desk->record->channel_count)
			most = fmax(most, height[j] = doubt_height_g(&desk->work[i].trace));
	}
	for (unsigned j = 0; j < 3; j++)
		if (height[j] > LIMIT_EXPLAINS * most)
			touch_s = fmin(touch_s,
			               doubt_touch_s(&desk->work[estimate_find(desk, "S2", axes[j])].trace));
	for (size_t i = 0; isfinite(touch_s) && desk->record->is_drop && i < desk->record->channel_count;
	     i++) {
		struct trace *trace = &desk->work[i].trace;

		trace->still = trace_index(trace, touch_s);
		if (isfinite(desk->record->trigger_s))
			continue;
		trace->first = trace_index(trace, touch_s - EVENT_BEFORE_S);
		trace->last = trace_index(trace, touch_s + EVENT_AFTER_S);
	}
}

/* A corner drop's second contact may be the larger one: the first is the one that was asked for. */
static void estimate_first_contact(const struct desk *desk)
{
	double until = INFINITY;

	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = estimate_find(desk, "S2", *axis);

		if (i < desk->record->channel_count)
			until = fmin(until, doubt_slap_s(&desk->work[i].trace));
	}
	for (size_t i = 0; isfinite(until) && i < desk->record->channel_count; i++) {
		struct trace *trace = &desk->work[i].trace;

		trace->last = trace_index(trace, until);
		desk->work[i].first_of_two = true;
	}
}

/* Whether S1 and S2 see one shock. */
static void estimate_compare(const struct desk *desk, struct analysis *analysis)
{
	struct estimate_channel *channel[2][2] = {{NULL}};
	const struct trace *trace[2][2] = {{NULL}};
	unsigned flags;

	for (unsigned i = 0; i < 4; i++) {
		size_t at = estimate_find(desk, i < 2 ? "S1" : "S2", i % 2 == 0 ? 'X' : 'Y');

		if (at == desk->record->channel_count)
			return;
		channel[i / 2][i % 2] = &analysis->channels[at];
		trace[i / 2][i % 2] = &desk->work[at].trace;
	}
	flags = doubt_axes(trace, channel);
	for (size_t i = 0; i < analysis->resultant_count; i++)
		analysis->resultants[i].how.flags |= flags;
	if (!(flags & ESTIMATE_FLAG_AXES))
		return;
	if (analysis->lag.status == ESTIMATE_OK)
		analysis->lag.status = ESTIMATE_AMBIGUOUS;
	analysis->lag.driven.flags |= ESTIMATE_FLAG_AXES;
}

static void analyse_rebound(const struct desk *desk, struct analysis *analysis)
{
	const double gravity = desk->options->gravity_m_s2 > 0 ? desk->options->gravity_m_s2 : UNITS_G_M_S2;
	struct rebound_axes axes = {.count = 0};

	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = estimate_find(desk, "S2", *axis);

		if (i == analysis->channel_count)
			continue;
		axes.trace[axes.count] = &desk->work[i].trace;
		axes.peak[axes.count] = &desk->work[i].peak;
		axes.pulse[axes.count] = &analysis->channels[i].pulse;
		axes.count++;
	}
	rebound_find(&axes, desk->options->impact_speed_m_s, gravity, &analysis->rebound);
	analysis->has_rebound = analysis->rebound.status != ESTIMATE_SHORT;
}

static bool has_good_sample(const struct desk *desk)
{
	for (size_t i = 0; i < desk->record->channel_count; i++)
		for (size_t k = 0; k < desk->work[i].trace.count; k++)
			if (trace_good(&desk->work[i].trace, k))
				return true;
	return false;
}

static int estimate_analyse(const struct desk *desk, struct analysis *analysis)
{
	estimate_touch(desk);
	estimate_first_contact(desk);
	for (size_t i = 0; i < analysis->channel_count; i++) {
		int status = estimate_prepare(desk, i, &analysis->channels[i].baseline);

		if (status)
			return status;
		analyse_channel(desk, i, &analysis->channels[i]);
	}
	if (!has_good_sample(desk))
		return DT_E_EMPTY;
	analyse_ripple(desk, "S1", analysis);
	analyse_ripple(desk, "S2", analysis);
	analyse_weak(desk, "S1", analysis);
	analyse_weak(desk, "S2", analysis);
	flag_short(desk, analysis);
	estimate_decays(desk, analysis);
	estimate_sensors(desk, analysis);
	estimate_plate(desk, analysis);
	estimate_compare(desk, analysis);
	if (desk->options->impact_speed_m_s > 0)
		analyse_rebound(desk, analysis);
	estimate_tolerance(desk, analysis);
	return 0;
}

static bool estimate_allowed(double option)
{
	return option >= 0 && isfinite(option);
}

static size_t longest_of(const struct record *record)
{
	size_t longest = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].count > longest)
			longest = record->channels[i].count;
	return longest;
}

/* One piece of memory for all samples: the scratch, then the traces. */
static void *lay_out(struct desk *desk)
{
	const struct record *record = desk->record;
	double trigger = record->is_drop ? record->trigger_s : NAN;
	double from = isfinite(trigger) ? trigger - EVENT_BEFORE_S : -INFINITY;
	double until = isfinite(trigger) ? trigger + EVENT_AFTER_S : INFINITY;
	size_t bytes = longest_of(record) * sizeof(*desk->scratch);
	char *memory, *next;

	for (size_t i = 0; i < record->channel_count; i++)
		bytes += trace_bytes(&record->channels[i]);
	memory = mapped_work(bytes);
	if (!memory)
		return NULL;
	desk->scratch = (double *)(void *)memory;
	next = memory + longest_of(record) * sizeof(*desk->scratch);
	for (size_t i = 0; i < record->channel_count; i++) {
		trace_lay(&desk->work[i].trace, &record->channels[i], from, until, next);
		next += trace_bytes(&record->channels[i]);
	}
	return memory;
}

int estimate_record(const struct record *record, const struct estimate_options *options,
                    struct analysis *analysis)
{
	struct analysis found = {.channel_count = record->channel_count};
	struct desk desk = {.record = record, .options = options};
	int status = DT_E_MEMORY;
	void *samples = NULL;

	if (record->channel_count == 0)
		return DT_E_EMPTY;
	if (!estimate_allowed(options->lowpass_hz) || !estimate_allowed(options->iepe_time_constant_s) ||
	    !estimate_allowed(options->tolerance) || !estimate_allowed(options->impact_speed_m_s) ||
	    !estimate_allowed(options->gravity_m_s2) || (unsigned)options->family >= ESTIMATE_FAMILIES)
		return DT_E_ARGUMENT;
	desk.work = calloc(record->channel_count, sizeof(*desk.work));
	found.channels = calloc(record->channel_count, sizeof(*found.channels));
	if (desk.work && found.channels)
		samples = lay_out(&desk);
	if (samples)
		status = estimate_analyse(&desk, &found);
	mapped_free(samples);
	free(desk.work);
	if (status) {
		free(found.channels);
		return status;
	}
	*analysis = found;
	return 0;
}

void estimate_free(struct analysis *analysis)
{
	free(analysis->channels);
	memset(analysis, 0, sizeof(*analysis));
}
