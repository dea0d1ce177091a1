/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/verdict_private.h"

#include <math.h>
#include <stdlib.h>

#include "common/units.h"
#include "host/shock/band.h"
#include "host/shock/signal.h"
#include "host/shock/spectrum.h"

#define BAND_BEFORE 0.4 /* of the pulse's duration: where the band begins before it and ends behind it */
#define BAND_AFTER 0.1
#define BAND_STEEP 0.05 /* of the duration: how far a steep side may be off in time */
#define SHIFT_MOST 0.15 /* of the duration: how far the band is moved to where it fits best */
#define SPECTRUM_PER_OCTAVE 12.0

enum { SHIFT_STEPS = 30, SHIFT_PASSES = 3, HULL_STEPS = 8, SPECTRUM_MAX = 400 };

/* ---- a pulse in its band ---- */

struct pulse_band {
	const struct plan *plan;
	const struct trace *trace;
	double sign, duration_s, own, chain;
	struct decide_point *point; /* room for all samples */
	double *time_s;
	size_t count, missing, worst;
};

static struct limit_point band_at(const struct plan *plan, double t)
{
	const struct plan_preset *p = plan->preset;
	double steep = p->shape == PLAN_HALF_SINE ? 0.0 : BAND_STEEP, low = plan_pulse(p->shape, t),
	       high = low;

	for (int i = -HULL_STEPS; i <= HULL_STEPS; i++) {
		double value = plan_pulse(p->shape, t + steep * i / HULL_STEPS);

		low = fmin(low, value);
		high = fmax(high, value);
	}
	return (struct limit_point){t, p->peak_g * low - plan->band_g, p->peak_g * high + plan->band_g};
}

/* Lays the band so that its pulse begins at start_s; returns the least margin. */
static double band_lay(struct pulse_band *b, double start_s)
{
	size_t k = trace_index(b->trace, start_s - BAND_BEFORE * b->duration_s);
	double least = (double)INFINITY;

	b->count = b->missing = b->worst = 0;
	for (; k < b->trace->count; k++) {
		double t = (trace_time(b->trace, k) - start_s) / b->duration_s, value;
		struct limit_point at = band_at(b->plan, t);
		double margin;

		if (t > 1.0 + BAND_AFTER)
			break;
		if (!trace_good(b->trace, k)) {
			b->missing++;
			continue;
		}
		value = b->sign * b->trace->value_g[k];
		margin = fmin(at.upper - value, value - at.lower);
		if (margin < least) {
			least = margin;
			b->worst = b->count;
		}
		b->time_s[b->count] = t * b->duration_s;
		b->point[b->count++] =
		        (struct decide_point){at.upper - value, value - at.lower, b->own, b->chain * value};
	}
	return least;
}

/* To where the band fits best. */
static void band_fit(struct pulse_band *b, double start_s)
{
	double span_s = SHIFT_MOST * b->duration_s, best_s = start_s, best = (double)-INFINITY;

	for (int pass = 0; pass < SHIFT_PASSES; pass++, span_s *= 2.0 / SHIFT_STEPS) {
		double middle_s = best_s;

		for (int i = -SHIFT_STEPS; i <= SHIFT_STEPS; i++) {
			double at_s = middle_s + span_s * i / SHIFT_STEPS, margin = band_lay(b, at_s);

			if (margin > best) {
				best = margin;
				best_s = at_s;
			}
		}
	}
	band_lay(b, best_s);
}

static void judge_points(struct judging *j, struct verdict_item *item, const struct decide_point *point,
                         size_t count, size_t worst, double share)
{
	const struct decide_point *p = &point[worst];

	item->sigma = hypot(p->own, p->common);
	item->lower = item->value - p->above_lower;
	item->upper = item->value + p->below_upper;
	item->guard = decide_guard(p, count, j->plan->guard);
	item->margin = item->sigma > 0.0
	                       ? fmin(p->below_upper, p->above_lower) / (DECIDE_COVERAGE * item->sigma)
	                       : (double)NAN;
	item->probability = isfinite(item->sigma) && share >= 1.0 ? decide_all(point, count) : (double)NAN;
	verdict_settle(item, decide_points(point, count, j->plan->guard, share));
}

static int judge_band_of(struct judging *j, struct verdict_item *item, const struct trace *trace)
{
	const struct estimate_channel *e = &j->result->analysis->channels[j->channel];
	const struct plan_preset *p = j->plan->preset;
	double rise = p->shape == PLAN_HALF_SINE   ? asin(0.1) / UNITS_PI
	              : p->shape == PLAN_SAW_TOOTH ? 0.1
	                                           : 0.01;
	struct pulse_band b = {.plan = j->plan,
	                       .trace = trace,
	                       .sign = e->peak.value_g < 0.0 ? -1.0 : 1.0,
	                       .duration_s = p->duration_ms * 1e-3,
	                       .own = e->baseline.noise_g,
	                       .chain = verdict_chain(j),
	                       .point = malloc(trace->count * sizeof(struct decide_point)),
	                       .time_s = malloc(trace->count * sizeof(double))};

	if (b.point != NULL && b.time_s != NULL) {
		band_fit(&b, e->pulse.start_s - rise * b.duration_s);
		if (b.missing > 0)
			verdict_because(item, "", "samples are missing");
		if (b.count > 0) {
			const struct decide_point *worst = &b.point[b.worst];

			item->at = b.time_s[b.worst] * 1e3;
			item->value =
			        band_at(j->plan, b.time_s[b.worst] / b.duration_s).upper - worst->below_upper;
			judge_points(j, item, b.point, b.count, b.worst, 1.0);
		}
	}
	free(b.time_s);
	free(b.point);
	return b.point != NULL && b.time_s != NULL ? 0 : DT_E_MEMORY;
}

int verdict_band(struct judging *j)
{
	struct result *r = j->result;
	const struct estimate_channel *e = &r->analysis->channels[j->channel];
	struct verdict_item *item = verdict_new(j, r->record->channels[j->channel].name, "band");
	struct trace trace;
	int result = 0;

	verdict_settle(item, DECIDE_UNDECIDED);
	if (!isfinite(e->pulse.start_s))
		return 0;
	item->reason[0] = '\0';
	verdict_flags(j, item, r->record->channels[j->channel].name, e->peak.how.flags);
	result = band_open(&trace, r->record, r->analysis, r->options, j->channel);
	if (result != 0)
		return result == DT_E_MEMORY ? result : 0;
	result = judge_band_of(j, item, &trace);
	trace_close(&trace);
	return result;
}

/* ---- a spectrum between its curves ---- */

/* White noise of the samples, as an oscillator at that frequency answers it (Miles). */
static double noise_of_spectrum(const struct estimate_channel *e, double rate_hz, double q,
                                double frequency_hz)
{
	return e->baseline.noise_g * sqrt(UNITS_PI * frequency_hz * q / rate_hz);
}

static void judge_spectrum_of(struct judging *j, struct verdict_item *item, const struct spectrum *s)
{
	const struct estimate_channel *e = &j->result->analysis->channels[j->channel];
	struct decide_point point[SPECTRUM_MAX];
	double least = (double)INFINITY;
	size_t worst = 0, count = s->count < SPECTRUM_MAX ? s->count : SPECTRUM_MAX;

	for (size_t i = 0; i < count; i++) {
		double value = s->channel[0].side[SRS_MAXIMAX][i], f = s->frequency_hz[i];
		struct limit_point at = {f, (double)NAN, (double)NAN};
		double margin;

		(void)limit_at(&j->plan->spectrum, LIMIT_SPECTRUM, f, &at);
		/* in dB, so that no frequency weighs more than another */
		margin = log(fmin(at.upper / value, value / at.lower));
		point[i] = (struct decide_point){at.upper - value, value - at.lower,
		                                 noise_of_spectrum(e, s->channel[0].rate_hz, j->plan->q, f),
		                                 verdict_chain(j) * value};
		if (!(margin >= least)) {
			least = margin;
			worst = i;
		}
	}
	item->at = s->frequency_hz[worst];
	item->value = s->channel[0].side[SRS_MAXIMAX][worst];
	judge_points(j, item, point, count, worst, j->plan->share);
}

int verdict_spectrum(struct judging *j)
{
	const struct limit_curve *curve = &j->plan->spectrum;
	struct record one = {.channels = &j->result->record->channels[j->channel], .channel_count = 1};
	struct spectrum_options options = {.srs = {.damping = 0.5 / j->plan->q},
	                                   .side = SRS_MAXIMAX,
	                                   .part = SRS_TOTAL,
	                                   .per_octave = SPECTRUM_PER_OCTAVE,
	                                   .from_hz = curve->point[0].x,
	                                   .to_hz = curve->point[curve->count - 1].x};
	struct verdict_item *item = verdict_new(j, one.channels->name, "spectrum");
	struct spectrum s;
	int result = spectrum_compute(&one, &options, &s);

	verdict_flags(j, item, one.channels->name, 0);
	if (result != 0) {
		verdict_settle(item, DECIDE_UNDECIDED);
		return result == DT_E_MEMORY ? result : 0;
	}
	for (unsigned flags = s.channel[0].flags; flags != 0; flags &= flags - 1)
		verdict_because(item, "", signal_flag_name(flags));
	judge_spectrum_of(j, item, &s);
	spectrum_free(&s);
	return 0;
}
