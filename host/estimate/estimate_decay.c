/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate_private.h"

#include <math.h>
#include <string.h>

#include "host/estimate/burst.h"
#include "host/estimate/limits.h"
#include "host/estimate/rebound.h"

/* The force fades slowly beyond the pulse's 10 % point: the decay is surely free this part of a width later,
 * and may have been for this part of a width. */
#define TAIL_WIDTHS 0.3
#define MARGIN_WIDTHS 0.35

/* A burst's edges are the force's less exactly. */
#define BURST_TAIL_WIDTHS 0.5

static bool estimate_decay_measured(const struct analysis *analysis, size_t i)
{
	return i < analysis->channel_count && isfinite(analysis->channels[i].pulse.end_s);
}

/* The channel that tells when channel i's contact ends: for our sensors the stronger axis of the case, S2, or
 * where noise hides that its X; otherwise the channel itself. */
static size_t contact_channel(const struct desk *desk, const struct analysis *analysis, size_t i)
{
	size_t x = estimate_find(desk, "S2", 'X'), y = estimate_find(desk, "S2", 'Y');

	if (desk->record->channels[i].sensor == 0)
		return i;
	if (estimate_decay_measured(analysis, x) && estimate_decay_measured(analysis, y))
		return fabs(analysis->channels[y].peak.value_g) > fabs(analysis->channels[x].peak.value_g)
		               ? y
		               : x;
	if (estimate_decay_measured(analysis, x))
		return x;
	if (estimate_decay_measured(analysis, y))
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
	return !(fabs(analysis->channels[i].peak.value_g) > LIMIT_SURE * desk->work[i].trace.noise_g);
}

/* The decay's window: surely free somewhat after the contact's pulse meets 10 %, and perhaps from then on.
 * The case's pulse, if there is one, tells of its plate too, which feels it a little later. */
static void window_by_pulse(const struct estimate_pulse *pulse, struct ringdown_span *span)
{
	span->from_s = pulse->end_s + TAIL_WIDTHS * pulse->duration_s;
	span->margin_s = MARGIN_WIDTHS * pulse->duration_s;
}

static bool window_by_burst(const struct trace *trace, struct ringdown_span *span)
{
	struct burst burst;

	if (!burst_find(trace, &burst))
		return false;
	span->from_s = burst.end_s + BURST_TAIL_WIDTHS * (burst.end_s - burst.start_s);
	span->margin_s = TAIL_WIDTHS * (burst.end_s - burst.start_s);
	return true;
}

/* What a contact channel says of the decay after it, and when the case is hit again. */
struct contact {
	size_t channel; /* record->channel_count: none looked at yet */
	struct ringdown_span span;
	double again_s;
	const struct ringdown_law *law; /* the last that an axis needed */
};

static void look_at_contact(const struct desk *desk, const struct analysis *analysis, size_t i,
                            struct contact *contact)
{
	const struct estimate_channel *hit = &analysis->channels[i];
	const struct trace *trace = &desk->work[i].trace;
	struct ringdown_span *span = &contact->span;

	contact->channel = i;
	*span = (struct ringdown_span){.from_s = NAN, .until_s = INFINITY};
	if (!doubtful(desk, analysis, i) || !window_by_burst(trace, span))
		window_by_pulse(&hit->pulse, span);
	contact->again_s = next_contact(trace, span->from_s + span->margin_s / MARGIN_WIDTHS,
	                                rebound_again_g(trace, hit->peak.value_g));
}

/* contact is what the channels before had; mostly it is the same one. */
static void analyse_ringdown(const struct desk *desk, size_t i, struct contact *contact,
                             struct analysis *analysis)
{
	struct estimate_channel *channel = &analysis->channels[i];
	struct work *work = &desk->work[i];
	size_t hit = contact_channel(desk, analysis, i);
	struct ringdown_span *span = &work->span;

	if (hit != contact->channel)
		look_at_contact(desk, analysis, hit, contact);
	*span = contact->span;
	span->tolerance = desk->options->tolerance;
	if (isfinite(channel->peak.value_g))
		span->peak_g = fabs(channel->peak.value_g);
	if (hit != i)
		span->until_s = contact->again_s;
	span->law = contact->law;
	ringdown_find(&work->trace, span, &work->ringdown);
	if (work->ringdown.law.found)
		contact->law = &work->ringdown.law;
	if (!isfinite(span->from_s) && !isfinite(channel->peak.value_g))
		work->ringdown.result.how.status = channel->peak.how.status;
	channel->ringdown = work->ringdown.result;
}

void estimate_decays(const struct desk *desk, struct analysis *analysis)
{
	struct contact contact = {.channel = analysis->channel_count};

	for (size_t i = 0; i < analysis->channel_count; i++)
		analyse_ringdown(desk, i, &contact, analysis);
}

/* Whether that axis of S1 rings on its own. */
static bool rings(const struct desk *desk, char axis)
{
	size_t plate = estimate_find(desk, "S1", axis), box = estimate_find(desk, "S2", axis),
	       none = desk->record->channel_count;
	double amplitude;

	if (plate == none || desk->work[plate].ringdown.result.how.status != ESTIMATE_OK)
		return false;
	amplitude = desk->work[plate].ringdown.amplitude_g;
	if (amplitude < LIMIT_EDGE * fabs(desk->work[plate].peak.result.value_g))
		return false;
	return box == none || amplitude >= LIMIT_OVER * desk->work[box].ringdown.amplitude_g;
}

/* An axis whose law gives it another damping than the plate's tells what it exchanged with the other one. */
static void widen_by_plate(const struct desk *desk, char axis, struct analysis *analysis)
{
	struct estimate_ringdown *ring = &analysis->channels[estimate_find(desk, "S1", axis)].ringdown;
	double apart = fabs(ring->damping_ratio - analysis->plate.damping_ratio);

	if (ring->how.flags & ESTIMATE_FLAG_AMPLITUDE && apart > LIMIT_AGREE * ring->sigma_damping)
		ring->sigma_damping = hypot(ring->sigma_damping, apart);
}

void estimate_plate(const struct desk *desk, struct analysis *analysis)
{
	bool x = rings(desk, 'X'), y = rings(desk, 'Y');
	const struct ringdown *rx = x ? &desk->work[estimate_find(desk, "S1", 'X')].ringdown : NULL;
	const struct ringdown *ry = y ? &desk->work[estimate_find(desk, "S1", 'Y')].ringdown : NULL;

	analysis->has_plate = x || y;
	if (x && y) {
		ringdown_combine(rx, ry, &analysis->plate);
		widen_by_plate(desk, 'X', analysis);
		widen_by_plate(desk, 'Y', analysis);
	} else if (x || y) {
		analysis->plate = x ? rx->result : ry->result;
	}
}
