/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/baseline.h"
#include "host/estimate/filter.h"
#include "host/estimate/lag.h"
#include "host/estimate/peak.h"
#include "host/estimate/pulse.h"
#include "host/estimate/resultant.h"
#include "host/estimate/ringdown.h"
#include "host/estimate/trace.h"

/* Around the trigger, what belongs to the impact that fired it: the product comes back for another. */
#define EVENT_BEFORE_S 0.02
#define EVENT_AFTER_S 0.1

/* The force fades slowly beyond the pulse's 10 % point: the decay is free this part of a width later. */
#define TAIL_WIDTHS 0.1

/* The next contact is where the case reads this part of its peak again. */
#define NEXT_CONTACT_LEVEL 0.3

/* A plate rings when its decay starts at this part of its peak or more, and, where the case rings too, at
 * this many times the case's. */
#define PLATE_LEVEL 0.1
#define PLATE_OVER_CASE 2.0

struct work {
	struct trace trace;
	struct peak peak;
	struct ringdown ringdown;
};

/* Of one record while it is analysed; channels in the record's order. */
struct desk {
	const struct record *record;
	struct work *work;
	double *scratch;
};

const char *estimate_status_name(enum estimate_status status)
{
	static const char *const names[] = {
	        [ESTIMATE_OK] = "ok",
	        [ESTIMATE_CLIPPED] = "clipped",
	        [ESTIMATE_SHORT] = "short",
	        [ESTIMATE_NO_PEAK] = "no_peak",
	        [ESTIMATE_AMBIGUOUS] = "ambiguous",
	        [ESTIMATE_NOT_CONVERGED] = "not_converged",
	};

	return (unsigned)status < sizeof(names) / sizeof(names[0]) ? names[status] : "unknown";
}

const char *estimate_flag_name(unsigned flags)
{
	static const char *const names[] = {"extrapolated",
	                                    "gaps",
	                                    "spike",
	                                    "hum",
	                                    "two_modes",
	                                    "amplitude_dependent",
	                                    "tolerance_not_met",
	                                    "model_refused",
	                                    "weak_axis",
	                                    "not_separable"};

	for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		if (flags & 1u << i)
			return names[i];
	return "";
}

static const char *const family_names[ESTIMATE_FAMILIES] = {
        [ESTIMATE_FAMILY_AUTO] = "auto",
        [ESTIMATE_FAMILY_HALF_SINE] = "half-sine",
        [ESTIMATE_FAMILY_HAVERSINE] = "haversine",
        [ESTIMATE_FAMILY_SINE_POWER] = "sine-power",
};

const char *estimate_family_name(enum estimate_family family)
{
	return (unsigned)family < ESTIMATE_FAMILIES ? family_names[family] : "unknown";
}

int estimate_family_parse(const char *name, enum estimate_family *family)
{
	for (unsigned i = 0; i < ESTIMATE_FAMILIES; i++) {
		if (strcmp(name, family_names[i]) == 0) {
			*family = (enum estimate_family)i;
			return 0;
		}
	}
	return DT_E_UNKNOWN;
}

static int analyse_channel(const struct desk *desk, size_t i, const struct estimate_options *options,
                           struct estimate_channel *out)
{
	const struct channel *channel = &desk->record->channels[i];
	struct work *work = &desk->work[i];
	double trigger = desk->record->is_drop ? desk->record->trigger_s : NAN;
	double from = isfinite(trigger) ? trigger - EVENT_BEFORE_S : -INFINITY;
	double until = isfinite(trigger) ? trigger + EVENT_AFTER_S : INFINITY;
	int status = trace_open(&work->trace, channel, from, until);

	if (status)
		return status;
	baseline_find(&work->trace, desk->scratch, &out->baseline);
	baseline_remove(&work->trace, &out->baseline);
	if (options->lowpass_hz > 0) {
		status = filter_lowpass(&work->trace, options->lowpass_hz);
		if (status)
			return status;
	}
	peak_find(&work->trace, &work->peak);
	pulse_measure(&work->trace, &work->peak, &out->baseline, &out->pulse);
	out->peak = work->peak.result;
	out->flags = work->trace.flags;
	return 0;
}

/* Index of the channel of that sensor and axis; channel_count if there is none. */
static size_t find(const struct desk *desk, const char *sensor, char axis)
{
	size_t i;

	for (i = 0; i < desk->record->channel_count; i++) {
		const char *name = desk->record->channels[i].name;

		if (strncmp(name, sensor, 2) == 0 && name[2] == axis && name[3] == '\0')
			break;
	}
	return i;
}

static bool measured(const struct analysis *analysis, size_t i)
{
	return i < analysis->channel_count && isfinite(analysis->channels[i].pulse.end_s);
}

/* The channel that tells when channel i's contact ends: for our sensors the stronger axis of the case, S2;
 * otherwise the channel itself. */
static size_t contact_channel(const struct desk *desk, const struct analysis *analysis, size_t i)
{
	const char *name = desk->record->channels[i].name;
	size_t x = find(desk, "S2", 'X'), y = find(desk, "S2", 'Y');

	if (strncmp(name, "S1", 2) != 0 && strncmp(name, "S2", 2) != 0)
		return i;
	if (measured(analysis, x) && measured(analysis, y))
		return fabs(analysis->channels[y].peak.value_g) > fabs(analysis->channels[x].peak.value_g)
		               ? y
		               : x;
	if (measured(analysis, x))
		return x;
	return measured(analysis, y) ? y : i;
}

/* When the case is hit again; INFINITY if it is not. */
static double next_contact(const struct trace *trace, double after_s, double peak_g)
{
	for (size_t k = trace_index(trace, after_s); k < trace->count; k++)
		if (trace_good(trace, k) && fabs(trace->value_g[k]) > NEXT_CONTACT_LEVEL * fabs(peak_g))
			return trace_time(trace, k);
	return INFINITY;
}

static void analyse_ringdown(const struct desk *desk, size_t i, struct analysis *analysis)
{
	struct estimate_channel *channel = &analysis->channels[i];
	struct work *work = &desk->work[i];
	size_t contact = contact_channel(desk, analysis, i);
	const struct estimate_channel *hit = &analysis->channels[contact];
	double from = hit->pulse.end_s + TAIL_WIDTHS * hit->pulse.duration_s, until = INFINITY;

	if (!isfinite(channel->peak.value_g))
		from = NAN;
	if (contact != i)
		until = next_contact(&desk->work[contact].trace, from + hit->pulse.duration_s,
		                     hit->peak.value_g);
	ringdown_find(&work->trace, from, until, fabs(channel->peak.value_g), &work->ringdown);
	if (!isfinite(channel->peak.value_g))
		work->ringdown.result.how.status = channel->peak.how.status;
	channel->ringdown = work->ringdown.result;
}

/* The resultants of the sensors that have X and Y, and the lag when both have. */
static void analyse_sensors(const struct desk *desk, struct analysis *analysis)
{
	static const char *const names[ESTIMATE_SENSORS_MAX] = {"S1", "S2"};
	struct resultant resultant[ESTIMATE_SENSORS_MAX];
	struct lag_sensor sensor[ESTIMATE_SENSORS_MAX];

	analysis->resultant_count = 0;
	for (unsigned i = 0; i < ESTIMATE_SENSORS_MAX; i++) {
		size_t x = find(desk, names[i], 'X'), y = find(desk, names[i], 'Y'),
		       n = analysis->resultant_count;

		if (x == analysis->channel_count || y == analysis->channel_count)
			continue;
		sensor[n].axes = (struct resultant_axes){{&desk->work[x].trace, &desk->work[y].trace},
		                                         {&desk->work[x].peak, &desk->work[y].peak}};
		sensor[n].resultant = &resultant[n];
		resultant_find(&sensor[n].axes, &resultant[n]);
		analysis->resultants[n] = resultant[n].result;
		memcpy(analysis->resultants[n].sensor, names[i], sizeof("S1"));
		analysis->resultant_count++;
	}
	analysis->has_lag = analysis->resultant_count == ESTIMATE_SENSORS_MAX;
	if (analysis->has_lag)
		lag_find(&sensor[0], &sensor[1], &analysis->lag);
}

/* Whether that axis of S1 rings on its own. */
static bool rings(const struct desk *desk, char axis)
{
	size_t plate = find(desk, "S1", axis), box = find(desk, "S2", axis),
	       none = desk->record->channel_count;
	double amplitude;

	if (plate == none || desk->work[plate].ringdown.result.how.status != ESTIMATE_OK)
		return false;
	amplitude = desk->work[plate].ringdown.amplitude_g;
	if (amplitude < PLATE_LEVEL * fabs(desk->work[plate].peak.result.value_g))
		return false;
	return box == none || amplitude >= PLATE_OVER_CASE * desk->work[box].ringdown.amplitude_g;
}

static void analyse_plate(const struct desk *desk, struct analysis *analysis)
{
	bool x = rings(desk, 'X'), y = rings(desk, 'Y');
	const struct ringdown *rx = x ? &desk->work[find(desk, "S1", 'X')].ringdown : NULL;
	const struct ringdown *ry = y ? &desk->work[find(desk, "S1", 'Y')].ringdown : NULL;

	analysis->has_plate = x || y;
	if (x && y)
		ringdown_combine(rx, ry, &analysis->plate);
	else if (x || y)
		analysis->plate = x ? rx->result : ry->result;
}

static bool has_good_sample(const struct desk *desk)
{
	for (size_t i = 0; i < desk->record->channel_count; i++)
		for (size_t k = 0; k < desk->work[i].trace.count; k++)
			if (trace_good(&desk->work[i].trace, k))
				return true;
	return false;
}

static int analyse(const struct desk *desk, const struct estimate_options *options, struct analysis *analysis)
{
	for (size_t i = 0; i < analysis->channel_count; i++) {
		int status = analyse_channel(desk, i, options, &analysis->channels[i]);

		if (status)
			return status;
	}
	if (!has_good_sample(desk))
		return DT_E_EMPTY;
	for (size_t i = 0; i < analysis->channel_count; i++)
		analyse_ringdown(desk, i, analysis);
	analyse_sensors(desk, analysis);
	analyse_plate(desk, analysis);
	return 0;
}

int estimate_record(const struct record *record, const struct estimate_options *options,
                    struct analysis *analysis)
{
	struct analysis found = {.channel_count = record->channel_count};
	struct desk desk = {.record = record};
	size_t longest = 1;
	int status = DT_E_MEMORY;

	if (record->channel_count == 0)
		return DT_E_EMPTY;
	if (!(options->lowpass_hz >= 0) || isinf(options->lowpass_hz))
		return DT_E_ARGUMENT;
	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].count > longest)
			longest = record->channels[i].count;
	desk.work = calloc(record->channel_count, sizeof(*desk.work));
	desk.scratch = malloc(2 * longest * sizeof(*desk.scratch));
	found.channels = calloc(record->channel_count, sizeof(*found.channels));
	if (desk.work && desk.scratch && found.channels)
		status = analyse(&desk, options, &found);
	for (size_t i = 0; desk.work && i < record->channel_count; i++)
		trace_close(&desk.work[i].trace);
	free(desk.work);
	free(desk.scratch);
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
