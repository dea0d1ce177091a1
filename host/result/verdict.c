/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/verdict_private.h"

#include <math.h>
#include <string.h>

#include "host/shock/band.h"

/* ---- what keeps a value from being decided ---- */

void verdict_because(struct verdict_item *item, const char *what, const char *word)
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

void verdict_flags(const struct judging *j, struct verdict_item *item, const char *subject, unsigned of_value)
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
void verdict_settle(struct verdict_item *item, enum decision decision)
{
	item->decision = item->reason[0] != '\0' && decision != DECIDE_FAIL ? DECIDE_UNDECIDED : decision;
	if (item->decision != DECIDE_UNDECIDED)
		item->reason[0] = '\0';
	else if (item->reason[0] == '\0')
		verdict_because(item, "", isfinite(item->value) ? "no uncertainty" : "no value");
}

struct verdict_item *verdict_new(struct judging *j, const char *subject, const char *what)
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
double verdict_chain(const struct judging *j)
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
			code = verdict_band(&j);
		if (code == 0 && plan->spectrum.count > 0)
			code = verdict_spectrum(&j);
	}
	verdict_sum(v);
	return code;
}
