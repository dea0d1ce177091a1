/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/verdict.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

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

struct judging {
	const struct plan *plan;
	struct result *result;
	size_t channel; /* the plan's; channel_count: there is none */
	struct verdict *verdict;
};

/* ---- what keeps a value from being decided ---- */

static void verdict_because(struct verdict_item *item, const char *what, const char *word)
{
	size_t used = strlen(item->reason);

	if (word[0] != '\0')
		snprintf(item->reason + used, sizeof(item->reason) - used, "%s%s%s", used > 0 ? ", " : "",
		         what, word);
}

/* Flags that are the drop's and no channel's. */
static unsigned flags_of_drop(const struct record *record)
{
	unsigned of_channels = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		of_channels |= record->channels[i].flags;
	return record->flags & ~of_channels;
}

/* Whether a channel's flags touch what is said of subject: itself, its sensor, or both sensors together. */
static bool touches(const struct channel *channel, const char *subject)
{
	if (subject[0] == '\0')
		return channel->axis == 'X' || channel->axis == 'Y';
	return strncmp(channel->name, subject, strlen(subject)) == 0;
}

static void verdict_flags(const struct judging *j, struct verdict_item *item, const char *subject,
                          unsigned of_value)
{
	const struct record *record = j->result->record;
	unsigned flags = flags_of_drop(record);

	for (size_t i = 0; i < record->channel_count; i++)
		if (touches(&record->channels[i], subject))
			flags |= j->result->analysis->channels[i].flags;
	flags &= ~(unsigned)RECORD_FLAG_DEFAULT_USED; /* the uncertainty is there, and no smaller */
	for (; flags != 0; flags &= flags - 1)
		verdict_because(item, "", record_flag_name(flags));
	for (; of_value != 0; of_value &= of_value - 1)
		verdict_because(item, "", estimate_flag_name(of_value));
}

/* A flag leaves a failure a failure. */
static void verdict_settle(struct verdict_item *item, enum decision decision)
{
	item->decision = item->reason[0] != '\0' && decision != DECIDE_FAIL ? DECIDE_UNDECIDED : decision;
	if (item->decision != DECIDE_UNDECIDED)
		item->reason[0] = '\0';
	else if (item->reason[0] == '\0')
		verdict_because(item, "", isfinite(item->value) ? "no uncertainty" : "no value");
}

static struct verdict_item *verdict_new(struct judging *j, const char *subject, const char *what)
{
	struct verdict_item *item = &j->verdict->item[j->verdict->count++];

	*item = (struct verdict_item){.unit = "g",
	                              .value = (double)NAN,
	                              .sigma = (double)NAN,
	                              .lower = (double)-INFINITY,
	                              .upper = (double)INFINITY,
	                              .at = (double)NAN,
	                              .guard = (double)NAN,
	                              .probability = (double)NAN,
	                              .margin = (double)NAN,
	                              .e_n = (double)NAN};
	snprintf(item->what, sizeof(item->what), "%s%s%s", subject, subject[0] != '\0' ? "." : "", what);
	return item;
}

/* Half of U by the sensors' files, in the unit of the budget; NAN: there is none. */
static double half_of(const struct judging *j, const char *what)
{
	const struct budget_item *item = budget_find(j->result->budget, what);

	return item != NULL ? item->expanded / DECIDE_COVERAGE : (double)NAN;
}

/* Share of a value that all samples of the plan's channel have in common: by its sensor's file, else as the
 * plan states it. */
static double chain_of(const struct judging *j)
{
	const struct record *record = j->result->record;
	const struct budget_item *peak = NULL;
	char what[64];

	if (j->channel < record->channel_count) {
		snprintf(what, sizeof(what), "%s.peak.value_g", record->channels[j->channel].name);
		peak = budget_find(j->result->budget, what);
	}
	if (peak != NULL)
		return sqrt(fmax(0.0, pow(peak->expanded / DECIDE_COVERAGE, 2) -
		                              pow(peak->part[BUDGET_NOISE], 2))) /
		       fabs(peak->value);
	return isfinite(j->plan->chain) ? j->plan->chain : 0.0;
}

/* ---- a value ---- */

/* The numbers are in the unit that people read. whole: sigma is of all parts, the chain's among them. Its
 * gain cancels in times, frequencies and damping. */
static void judge_number(struct judging *j, struct verdict_item *item, double value, double sigma, bool whole,
                         double lower, double upper)
{
	bool gains = strcmp(item->unit, "g") == 0 || strcmp(item->unit, "m/s") == 0 || item->unit[0] == '%';
	bool lacks = gains && !whole;
	double u = lacks && isfinite(j->plan->chain) ? hypot(sigma, j->plan->chain * value) : sigma;

	if (lacks && j->result->budget != NULL && !isfinite(j->plan->chain))
		verdict_because(item, "", "its sensor has no file");
	item->value = value;
	item->sigma = u;
	item->lower = lower;
	item->upper = upper;
	item->guard = j->plan->guard * DECIDE_COVERAGE * u;
	item->probability = decide_probability(value, u, lower, upper);
	item->margin = u > 0.0 ? fmin(upper - value, value - lower) / (DECIDE_COVERAGE * u) : (double)NAN;
	verdict_settle(item, decide_value(value, u, lower, upper, j->plan->guard));
}

/* ---- a check of a sensor ---- */

/* The sensor that a channel or a resultant is of; NULL: none. */
static struct sensor_used *checked_sensor(const struct judging *j, const char *subject)
{
	struct sensors *sensors = j->result->sensors;
	const struct sensor_used *of;
	unsigned axis;

	if (sensors == NULL)
		return NULL;
	of = sensors_of(sensors, subject, &axis);
	for (size_t i = 0; i < sensors->count; i++)
		if (of == &sensors->used[i] || (of == NULL && strcmp(sensors->used[i].name, subject) == 0))
			return &sensors->used[i];
	return NULL;
}

/* U of the value must be of all parts. */
static void judge_reference(struct judging *j, struct verdict_item *item, const char *subject, double value,
                            double sigma, bool whole, double reference, double expanded)
{
	struct sensor_used *used = checked_sensor(j, subject);
	double both = hypot(DECIDE_COVERAGE * sigma, expanded);

	if (!whole)
		verdict_because(item, "", "no expanded uncertainty");
	item->value = value;
	item->sigma = sigma;
	item->lower = reference - both;
	item->upper = reference + both;
	item->e_n = whole ? (value - reference) / both : (double)NAN;
	item->margin = 1.0 - fabs(item->e_n);
	verdict_settle(item, !isfinite(item->e_n)     ? DECIDE_UNDECIDED
	                     : fabs(item->e_n) <= 1.0 ? DECIDE_PASS
	                                              : DECIDE_FAIL);
	if (item->decision != DECIDE_UNDECIDED)
		snprintf(item->reason, sizeof(item->reason), "E_n %.2f", item->e_n);
	if (used != NULL && item->decision != DECIDE_UNDECIDED && !(fabs(item->e_n) <= fabs(used->e_n)))
		used->e_n = item->e_n;
}

/* ---- a value of the table of quantities ---- */

/* Of peaks and areas the magnitude counts. */
static bool has_direction(enum quantity_place place)
{
	return place == QUANTITY_AT_PEAK || place == QUANTITY_AT_PULSE || place == QUANTITY_AT_CONTACT;
}

static unsigned flags_of_value(const struct quantity *quantity, const void *object)
{
	const struct quantity *flags = quantity_find(quantity->object, "flags");

	return flags != NULL && flags->kind == QUANTITY_FLAGS
	               ? *(const unsigned *)(const void *)((const char *)object + flags->offset)
	               : 0;
}

static void judge_limit(struct judging *j, const struct plan_limit *limit)
{
	const struct record *record = j->result->record;
	const struct quantity *q = limit->quantity;
	bool listed = strcmp(quantity_homes[limit->place].array, "channels") == 0;
	const char *subject = limit->subject, *whose, *path = quantity_homes[limit->place].path;
	double scale = quantity_scale(q), value = (double)NAN, sigma = (double)NAN;
	struct verdict_item *item;
	const void *object = NULL;
	bool whole;
	char what[80];

	if (listed && subject[0] == '\0')
		subject = j->channel < record->channel_count ? record->channels[j->channel].name
		                                             : j->plan->channel;
	for (size_t i = 0; (object = result_at(j->result, limit->place, i, &whose)) != NULL; i++)
		if (strcmp(whose, subject) == 0)
			break;
	snprintf(what, sizeof(what), "%s%s%s", path, path[0] != '\0' ? "." : "", q->key);
	item = verdict_new(j, subject, what);
	item->unit = q->shown;
	if (object != NULL) {
		value = quantity_number(q, object) * scale;
		sigma = quantity_sigma(q, object) * scale;
		if (isfinite(half_of(j, item->what)))
			sigma = half_of(j, item->what) * scale;
		if (quantity_status(q, object) != ESTIMATE_OK)
			verdict_because(item, "status ", estimate_status_name(quantity_status(q, object)));
		verdict_flags(j, item, subject, flags_of_value(q, object));
	}
	whole = isfinite(half_of(j, item->what));
	value = has_direction(limit->place) ? fabs(value) : value;
	if (limit->reference_expanded > 0.0)
		judge_reference(j, item, subject, value, sigma, whole, limit->lower * scale,
		                limit->reference_expanded * scale);
	else
		judge_number(j, item, value, sigma, whole, limit->lower * scale, limit->upper * scale);
}

/* ---- other axes of the plan's sensor ---- */

static bool is_beside(const struct channel *a, const struct channel *b)
{
	size_t length = strlen(a->name);

	return a != b && length > 1 && strlen(b->name) == length &&
	       strncmp(a->name, b->name, length - 1) == 0;
}

static void judge_transverse(struct judging *j)
{
	const struct record *record = j->result->record;
	const struct channel *main = &record->channels[j->channel];
	const struct estimate_peak *peak = &j->result->analysis->channels[j->channel].peak, *most = NULL;
	struct verdict_item *item = verdict_new(j, main->name, "transverse_ratio");
	char main_what[64], other_what[64] = "";
	double ratio, sigma;
	bool whole;

	snprintf(main_what, sizeof(main_what), "%s.peak.value_g", main->name);
	for (size_t i = 0; i < record->channel_count; i++) {
		const struct estimate_peak *other = &j->result->analysis->channels[i].peak;

		if (!is_beside(main, &record->channels[i]))
			continue;
		verdict_flags(j, item, record->channels[i].name,
		              other->how.flags & ~(unsigned)ESTIMATE_FLAG_WEAK);
		if (most == NULL || fabs(other->value_g) > fabs(most->value_g)) {
			most = other;
			snprintf(other_what, sizeof(other_what), "%s.peak.value_g", record->channels[i].name);
		}
	}
	item->unit = "%";
	verdict_flags(j, item, main->name, peak->how.flags);
	ratio = most != NULL ? 100.0 * fabs(most->value_g / peak->value_g) : (double)NAN;
	sigma = most != NULL ? 100.0 * hypot(most->sigma_g, peak->sigma_g * most->value_g / peak->value_g) /
	                               fabs(peak->value_g)
	                     : (double)NAN;
	whole = most != NULL && isfinite(half_of(j, other_what)) && isfinite(half_of(j, main_what));
	if (whole)
		sigma = 100.0 *
		        hypot(half_of(j, other_what), half_of(j, main_what) * most->value_g / peak->value_g) /
		        fabs(peak->value_g);
	judge_number(j, item, ratio, sigma, whole, (double)-INFINITY, 100.0 * j->plan->transverse);
}

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
	                       .chain = chain_of(j),
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

static int judge_band(struct judging *j)
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
		                                 chain_of(j) * value};
		if (!(margin >= least)) {
			least = margin;
			worst = i;
		}
	}
	item->at = s->frequency_hz[worst];
	item->value = s->channel[0].side[SRS_MAXIMAX][worst];
	judge_points(j, item, point, count, worst, j->plan->share);
}

static int judge_spectrum(struct judging *j)
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

/* ---- all of it ---- */

static void verdict_sum(struct verdict *v)
{
	v->probability = (double)NAN;
	for (size_t i = 0; i < v->count; i++) {
		const struct verdict_item *item = &v->item[i];

		if (item->decision > v->decision)
			v->decision = item->decision;
		v->undecided += item->decision == DECIDE_UNDECIDED;
		v->failed += item->decision == DECIDE_FAIL || item->decision == DECIDE_CONDITIONAL_FAIL;
		v->probability = fmin(v->probability, item->probability);
	}
	v->name = decide_name(v->decision);
}

int verdict_judge(struct verdict *v, const struct plan *plan, struct result *result)
{
	const struct record *record = result->record;
	struct judging j = {.plan = plan, .result = result, .verdict = v};
	int code = 0;

	*v = (struct verdict){
	        .decision = DECIDE_NONE,
	        .by = plan->preset != NULL ? plan->preset->name : "",
	        .rule = "ILAC-G8:09/2019, 4.2: pass up to the limit less the guard band r U, "
	                "conditional up to "
	                "the limit; U = 2 u",
	        .rests_on = result->budget != NULL ? "noise and fit of each value, and its sensor's file"
	                    : isfinite(plan->chain)
	                            ? "noise and fit of each value, and the measuring chain"
	                            : "noise and fit of each value; the measuring chain's is not "
	                              "stated, so that this is no statement of conformity",
	        .verified = plan->preset == NULL || plan->preset->verified,
	        .guard = plan->guard,
	        .risk = decide_risk(plan->guard)};
	j.channel = band_channel(record, result->analysis, plan->channel[0] != '\0' ? plan->channel : NULL);
	for (size_t i = 0; i < plan->count; i++)
		judge_limit(&j, &plan->limit[i]);
	if (j.channel == record->channel_count) {
		if (plan->transverse > 0.0 || plan->band_g > 0.0 || plan->spectrum.count > 0)
			verdict_settle(verdict_new(&j, plan->channel, "channel"), DECIDE_UNDECIDED);
	} else {
		if (plan->transverse > 0.0)
			judge_transverse(&j);
		if (plan->band_g > 0.0)
			code = judge_band(&j);
		if (code == 0 && plan->spectrum.count > 0)
			code = judge_spectrum(&j);
	}
	verdict_sum(v);
	return code;
}

/* ---- back from JSON ---- */

static const char *verdict_text(const cJSON *object, const char *key)
{
	const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));

	return text != NULL ? text : "";
}

static enum decision verdict_decision(const cJSON *object)
{
	for (enum decision d = DECIDE_NONE; d <= DECIDE_FAIL; d++)
		if (strcmp(decide_name(d), verdict_text(object, "decision")) == 0)
			return d;
	return DECIDE_UNDECIDED;
}

static void verdict_read_item(struct verdict_item *item, const cJSON *json)
{
	*item = (struct verdict_item){.unit = verdict_text(json, "unit"),
	                              .value = said_number(json, "value"),
	                              .sigma = said_number(json, "sigma"),
	                              .lower = said_number(json, "lower"),
	                              .upper = said_number(json, "upper"),
	                              .at = said_number(json, "at"),
	                              .guard = said_number(json, "guard_band"),
	                              .probability = said_number(json, "probability"),
	                              .margin = said_number(json, "margin_u95"),
	                              .e_n = said_number(json, "e_n"),
	                              .decision = verdict_decision(json)};
	snprintf(item->what, sizeof(item->what), "%s", verdict_text(json, "what"));
	snprintf(item->reason, sizeof(item->reason), "%s", verdict_text(json, "reason"));
}

bool verdict_read(struct verdict *v, const cJSON *result)
{
	const cJSON *json = cJSON_GetObjectItemCaseSensitive(result, "verdict"), *item;

	if (!cJSON_IsObject(json))
		return false;
	*v = (struct verdict){.decision = verdict_decision(json),
	                      .by = verdict_text(json, "limits_by"),
	                      .rule = verdict_text(json, "rule"),
	                      .rests_on = verdict_text(json, "uncertainty"),
	                      .verified = said_number(json, "verified") > 0.0,
	                      .guard = said_number(json, "guard_ratio"),
	                      .risk = said_number(json, "risk")};
	v->name = decide_name(v->decision);
	cJSON_ArrayForEach(item,
	                   cJSON_GetObjectItemCaseSensitive(json, "items")) if (v->count < VERDICT_ITEMS_MAX)
	        verdict_read_item(&v->item[v->count++], item);
	return true;
}

/* ---- for people and programs ---- */

struct verdict_row {
	struct verdict_item item;
	char said[190];
	struct table_value value;
	const char *decision;
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct verdict_row, member, __VA_ARGS__)

static const struct table_column verdict_columns[] = {
        COLUMN(CHARS, item.what, .key = "what", .title = "limit on", .width = -32),
        COLUMN(VALUE, value, .key = "value", .sigma = "sigma", .title = "value", .width = 10, .digits = 3),
        COLUMN(NUMBER, item.sigma, .title = "u", .width = 8, .digits = 3),
        COLUMN(NUMBER, item.lower, .key = "lower", .title = "from", .width = 9, .digits = -5),
        COLUMN(NUMBER, item.upper, .key = "upper", .title = "to", .width = 9, .digits = -5),
        COLUMN(WORDS, item.unit, .key = "unit", .title = "", .width = -4),
        COLUMN(NUMBER, item.at, .key = "at"),
        COLUMN(NUMBER, item.guard, .key = "guard_band", .title = "guard", .width = 8, .digits = 3),
        COLUMN(NUMBER, item.margin, .key = "margin_u95", .title = "margin/U", .width = 9, .digits = 2),
        COLUMN(NUMBER, item.e_n, .key = "e_n"),
        COLUMN(NUMBER, item.probability, .key = "probability", .title = "p", .width = 7, .digits = 4),
        COLUMN(WORDS, decision, .key = "decision"),
        COLUMN(CHARS, item.reason, .key = "reason"),
        COLUMN(CHARS, said, .title = "decision", .gap = "  "),
};

int verdict_table(const struct verdict *verdict, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};

	table_begin(&table, verdict_columns, TABLE_COUNT(verdict_columns));
	for (size_t i = 0; i < verdict->count; i++) {
		struct verdict_row row = {.item = verdict->item[i]};

		row.value = (struct table_value){row.item.value, row.item.sigma, false};
		row.decision = decide_name(row.item.decision);
		snprintf(row.said, sizeof(row.said), "%s%s%s", row.decision,
		         row.item.reason[0] != '\0' ? ": " : "", row.item.reason);
		if (!isfinite(row.item.lower))
			row.item.lower = (double)NAN;
		if (!isfinite(row.item.upper))
			row.item.upper = (double)NAN;
		table_row(&table, &row);
	}
	return table_end(&table);
}

void verdict_word(enum decision decision, FILE *out)
{
	for (const char *at = decide_name(decision); *at != '\0'; at++)
		fputc(toupper((unsigned char)*at), out);
}

void verdict_line(const struct verdict *verdict, FILE *out)
{
	verdict_word(verdict->decision, out);
	fprintf(out, ": %zu of %zu limits fail, %zu undecided; guard band %g U, risk of a pass up to %.2g %%",
	        verdict->failed, verdict->count, verdict->undecided, verdict->guard, 100.0 * verdict->risk);
}
