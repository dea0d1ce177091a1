/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/baseline.h"
#include "host/estimate/bump.h"
#include "host/estimate/cfc.h"
#include "host/estimate/clip.h"
#include "host/estimate/dropout.h"
#include "host/estimate/filter.h"
#include "host/estimate/iepe.h"
#include "host/estimate/lag.h"
#include "host/estimate/peak.h"
#include "host/estimate/pulse.h"
#include "host/estimate/rebound.h"
#include "host/estimate/resultant.h"
#include "host/estimate/ringdown.h"
#include "host/estimate/spike.h"
#include "host/estimate/trace.h"

/* Around the trigger, what belongs to the impact that fired it: the product comes back for another. */
#define EVENT_BEFORE_S 0.02
#define EVENT_AFTER_S 0.1

/* The force fades slowly beyond the pulse's 10 % point: the decay is surely free this part of a width later,
 * and may have been for this part of a width. */
#define TAIL_WIDTHS 0.3
#define MARGIN_WIDTHS 0.35

/* A peak is sure of its pulse's end at this many times the noise; otherwise a bump tells, whose edges are the
 * force's less exactly. */
#define PEAK_SURE 8.0
#define BUMP_TAIL_WIDTHS 0.5

/* The next contact is where the case reads this part of its peak again, and so much noise at least. */
#define NEXT_CONTACT_LEVEL 0.3
#define NEXT_CONTACT_NOISE 6.0

/* A plate rings when its decay starts at this part of its peak or more, and, where the case rings too, at
 * this many times the case's. */
#define PLATE_LEVEL 0.1
#define PLATE_OVER_CASE 2.0

/* Standard deviations between an axis' damping and the plate's that chance makes. */
#define PLATE_AGREE 3.0

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
	                                    "not_separable",
	                                    "zero_unsure",
	                                    "rival"};

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

/* What is wrong with single samples, and where zero is without them. */
static void clean(struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	bool marked;

	baseline_find(trace, scratch, baseline);
	marked = spike_mark(trace, baseline->noise_g);
	marked |= dropout_mark(trace, baseline->noise_g);
	if (marked) {
		trace_marked(trace);
		baseline_find(trace, scratch, baseline);
	}
	clip_judge_twins(trace, baseline->noise_g);
}

static int prepare(const struct desk *desk, size_t i, const struct estimate_options *options,
                   struct estimate_baseline *baseline)
{
	struct trace *trace = &desk->work[i].trace;

	clean(trace, desk->scratch, baseline);
	baseline_remove(trace, baseline);
	if (options->iepe_time_constant_s > 0)
		iepe_undo(trace, baseline->from_s, options->iepe_time_constant_s);
	if (options->cfc > 0) {
		int result = cfc_filter(trace, options->cfc);

		if (result != 0)
			return result;
	}
	return options->lowpass_hz > 0 ? filter_lowpass(trace, options->lowpass_hz) : 0;
}

static void analyse_channel(const struct desk *desk, size_t i, const struct estimate_options *options,
                            struct estimate_channel *out)
{
	struct work *work = &desk->work[i];

	peak_find(&work->trace, options, &work->peak);
	pulse_measure(&work->trace, &work->peak, &out->baseline, options->family, &out->pulse);
	out->peak = work->peak.result;
	out->flags = work->trace.flags;
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

/* Weak axes of a sensor take the shape of its strongest one. */
static void analyse_weak(const struct desk *desk, const struct estimate_options *options, const char *sensor,
                         struct analysis *analysis)
{
	size_t strong = analysis->channel_count;

	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = find(desk, sensor, *axis);

		if (i < analysis->channel_count && isfinite(analysis->channels[i].peak.value_g) &&
		    (strong == analysis->channel_count ||
		     fabs(analysis->channels[i].peak.value_g) >
		             fabs(analysis->channels[strong].peak.value_g)))
			strong = i;
	}
	for (const char *axis = "XYZ"; *axis && strong < analysis->channel_count; axis++) {
		size_t i = find(desk, sensor, *axis);
		struct work *work = &desk->work[i];

		if (i == analysis->channel_count || i == strong || !peak_is_weak(&work->trace, &work->peak) ||
		    !peak_weak(&work->trace, options, &desk->work[strong].trace, &desk->work[strong].peak,
		               &work->peak))
			continue;
		pulse_of_weak(&work->peak, &analysis->channels[strong].pulse, &analysis->channels[i].pulse);
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

static void analyse_rebound(const struct desk *desk, double impact_speed_m_s, struct analysis *analysis)
{
	struct rebound_axes axes = {.count = 0};

	for (const char *axis = "XYZ"; *axis; axis++) {
		size_t i = find(desk, "S2", *axis);

		if (i == analysis->channel_count)
			continue;
		axes.trace[axes.count] = &desk->work[i].trace;
		axes.peak[axes.count] = &desk->work[i].peak;
		axes.pulse[axes.count] = &analysis->channels[i].pulse;
		axes.count++;
	}
	rebound_find(&axes, impact_speed_m_s, &analysis->rebound);
	analysis->has_rebound = analysis->rebound.status != ESTIMATE_SHORT;
}

static bool measured(const struct analysis *analysis, size_t i)
{
	return i < analysis->channel_count && isfinite(analysis->channels[i].pulse.end_s);
}

/* The channel that tells when channel i's contact ends: for our sensors the stronger axis of the case, S2, or
 * where noise hides that its X; otherwise the channel itself. */
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
	if (measured(analysis, y))
		return y;
	return x < analysis->channel_count ? x : i;
}

/* When the case is hit again; INFINITY if it is not. */
static double next_contact(const struct trace *trace, double after_s, double level_g)
{
	size_t k = trace_reaches(trace, trace_index(trace, after_s), trace->count, level_g);

	return k < trace->count ? trace_time(trace, k) : INFINITY;
}

/* Whether a channel's peak is too near the noise to say where its pulse ends. */
static bool doubtful(const struct desk *desk, const struct analysis *analysis, size_t i)
{
	return !(fabs(analysis->channels[i].peak.value_g) > PEAK_SURE * desk->work[i].trace.noise_g);
}

/* The decay's window: surely free somewhat after the contact's pulse meets 10 %, and perhaps from then on.
 * The case's pulse, if there is one, tells of its plate too, which feels it a little later. */
static void window_by_pulse(const struct estimate_pulse *pulse, struct ringdown_span *span)
{
	span->from_s = pulse->end_s + TAIL_WIDTHS * pulse->duration_s;
	span->margin_s = MARGIN_WIDTHS * pulse->duration_s;
}

static bool window_by_bump(const struct trace *trace, struct ringdown_span *span)
{
	struct bump bump;

	if (!bump_find(trace, &bump))
		return false;
	span->from_s = bump.end_s + BUMP_TAIL_WIDTHS * (bump.end_s - bump.start_s);
	span->margin_s = TAIL_WIDTHS * (bump.end_s - bump.start_s);
	return true;
}

/* What a contact channel says of the decay after it, and when the case is hit again. */
struct contact {
	size_t channel; /* record->channel_count: none looked at yet */
	struct ringdown_span span;
	double again_s;
};

static void look_at_contact(const struct desk *desk, const struct analysis *analysis, size_t i,
                            struct contact *contact)
{
	const struct estimate_channel *hit = &analysis->channels[i];
	const struct trace *trace = &desk->work[i].trace;
	struct ringdown_span *span = &contact->span;

	contact->channel = i;
	*span = (struct ringdown_span){.from_s = NAN, .until_s = INFINITY};
	if (!doubtful(desk, analysis, i) || !window_by_bump(trace, span))
		window_by_pulse(&hit->pulse, span);
	contact->again_s = next_contact(
	        trace, span->from_s + span->margin_s / MARGIN_WIDTHS,
	        fmax(NEXT_CONTACT_LEVEL * fabs(hit->peak.value_g), NEXT_CONTACT_NOISE * trace->noise_g));
}

/* contact is what the channels before had; mostly it is the same one. */
static void analyse_ringdown(const struct desk *desk, size_t i, const struct estimate_options *options,
                             struct contact *contact, struct analysis *analysis)
{
	struct estimate_channel *channel = &analysis->channels[i];
	struct work *work = &desk->work[i];
	size_t hit = contact_channel(desk, analysis, i);
	struct ringdown_span span;

	if (hit != contact->channel)
		look_at_contact(desk, analysis, hit, contact);
	span = contact->span;
	span.tolerance = options->tolerance;
	if (isfinite(channel->peak.value_g))
		span.peak_g = fabs(channel->peak.value_g);
	if (hit != i)
		span.until_s = contact->again_s;
	ringdown_find(&work->trace, &span, &work->ringdown);
	if (!isfinite(span.from_s) && !isfinite(channel->peak.value_g))
		work->ringdown.result.how.status = channel->peak.how.status;
	channel->ringdown = work->ringdown.result;
}

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
		struct estimate_peak *s1 = &analysis->channels[find(desk, "S1", axes[i])].peak;
		const struct estimate_peak *s2 = &analysis->channels[find(desk, "S2", axes[i])].peak;
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
		struct estimate_peak *s1 = &analysis->channels[find(desk, "S1", axes[i])].peak;
		const struct estimate_peak *s2 = &analysis->channels[find(desk, "S2", axes[i])].peak;

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
static void refine_ringdowns(const struct desk *desk, const struct estimate_options *options,
                             double contact_again_s, const double free_s[2], struct analysis *analysis)
{
	static const char axes[2] = {'X', 'Y'};

	for (unsigned i = 0; i < 2; i++) {
		size_t s1 = find(desk, "S1", axes[i]);
		struct work *work = &desk->work[s1];
		struct ringdown_span span = {.from_s = free_s[i],
		                             .until_s = contact_again_s,
		                             .peak_g = fabs(work->peak.result.value_g),
		                             .tolerance = options->tolerance};

		if (isnan(free_s[i]))
			continue;
		ringdown_refine(&work->trace, &span, &work->ringdown);
		analysis->channels[s1].ringdown = work->ringdown.result;
	}
}

/* The resultants of the sensors that have X and Y, and where both have the lag, and what it says of S1's
 * decay. */
static void analyse_sensors(const struct desk *desk, const struct estimate_options *options,
                            double contact_again_s, struct analysis *analysis)
{
	static const char *const names[ESTIMATE_SENSORS_MAX] = {"S1", "S2"};
	struct resultant resultant[ESTIMATE_SENSORS_MAX];
	struct lag_sensor sensor[ESTIMATE_SENSORS_MAX];
	double tolerance = options->tolerance > 0 ? options->tolerance : ESTIMATE_TOLERANCE, free_s[2];

	analysis->resultant_count = 0;
	for (unsigned i = 0; i < ESTIMATE_SENSORS_MAX; i++) {
		size_t x = find(desk, names[i], 'X'), y = find(desk, names[i], 'Y'),
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
	refine_ringdowns(desk, options, contact_again_s, free_s, analysis);
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

/* An axis whose law gives it another damping than the plate's tells what it exchanged with the other one. */
static void widen_by_plate(const struct desk *desk, char axis, struct analysis *analysis)
{
	struct estimate_ringdown *ring = &analysis->channels[find(desk, "S1", axis)].ringdown;
	double apart = fabs(ring->damping_ratio - analysis->plate.damping_ratio);

	if (ring->how.flags & ESTIMATE_FLAG_AMPLITUDE && apart > PLATE_AGREE * ring->sigma_damping)
		ring->sigma_damping = hypot(ring->sigma_damping, apart);
}

static void analyse_plate(const struct desk *desk, struct analysis *analysis)
{
	bool x = rings(desk, 'X'), y = rings(desk, 'Y');
	const struct ringdown *rx = x ? &desk->work[find(desk, "S1", 'X')].ringdown : NULL;
	const struct ringdown *ry = y ? &desk->work[find(desk, "S1", 'Y')].ringdown : NULL;

	analysis->has_plate = x || y;
	if (x && y) {
		ringdown_combine(rx, ry, &analysis->plate);
		widen_by_plate(desk, 'X', analysis);
		widen_by_plate(desk, 'Y', analysis);
	} else if (x || y) {
		analysis->plate = x ? rx->result : ry->result;
	}
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
	struct contact contact = {.channel = analysis->channel_count};

	for (size_t i = 0; i < analysis->channel_count; i++) {
		int status = prepare(desk, i, options, &analysis->channels[i].baseline);

		if (status)
			return status;
		analyse_channel(desk, i, options, &analysis->channels[i]);
	}
	if (!has_good_sample(desk))
		return DT_E_EMPTY;
	analyse_weak(desk, options, "S1", analysis);
	analyse_weak(desk, options, "S2", analysis);
	flag_short(desk, analysis);
	for (size_t i = 0; i < analysis->channel_count; i++)
		analyse_ringdown(desk, i, options, &contact, analysis);
	analyse_sensors(desk, options, contact.again_s, analysis);
	analyse_plate(desk, analysis);
	if (options->impact_speed_m_s > 0)
		analyse_rebound(desk, options->impact_speed_m_s, analysis);
	return 0;
}

static bool allowed(double option)
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
	memory = malloc(bytes);
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
	struct desk desk = {.record = record};
	int status = DT_E_MEMORY;
	void *samples = NULL;

	if (record->channel_count == 0)
		return DT_E_EMPTY;
	if (!allowed(options->lowpass_hz) || !allowed(options->iepe_time_constant_s) ||
	    !allowed(options->tolerance) || !allowed(options->impact_speed_m_s) ||
	    (unsigned)options->family >= ESTIMATE_FAMILIES)
		return DT_E_ARGUMENT;
	desk.work = calloc(record->channel_count, sizeof(*desk.work));
	found.channels = calloc(record->channel_count, sizeof(*found.channels));
	if (desk.work && found.channels)
		samples = lay_out(&desk);
	if (samples)
		status = analyse(&desk, options, &found);
	free(samples);
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
