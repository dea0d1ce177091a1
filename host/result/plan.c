/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/plan.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/units.h"

#define TRAPEZOID_FLANK 0.1 /* of the duration, each */
#define SPECTRUM_Q 10.0
#define WIDTH_LEVEL 0.1
#define PRESET_LEAST_PERCENT 1e-9

static const struct plan_preset presets[] = {
#define PRESET_READ true
#define PRESET_UNREAD false
#define PRESET(name, SHAPE, peak_g, duration_ms, peak, velocity, band, transverse, VERIFIED, source) \
	{name,     PLAN_##SHAPE, peak_g,     duration_ms,       peak,                                \
	 velocity, band,         transverse, PRESET_##VERIFIED, source},
#include "host/result/preset.def"
};

const struct plan_preset *plan_preset(size_t i)
{
	return i < sizeof(presets) / sizeof(presets[0]) ? &presets[i] : NULL;
}

const struct plan_preset *plan_preset_find(const char *name)
{
	for (size_t i = 0; i < sizeof(presets) / sizeof(presets[0]); i++)
		if (strcmp(presets[i].name, name) == 0)
			return &presets[i];
	return NULL;
}

/* ---- nominal pulses ---- */

double plan_pulse(enum plan_shape shape, double t)
{
	if (!(t >= 0.0 && t <= 1.0))
		return 0.0;
	if (shape == PLAN_SAW_TOOTH)
		return t;
	return shape == PLAN_HALF_SINE ? sin(UNITS_PI * t) : fmin(1.0, fmin(t, 1.0 - t) / TRAPEZOID_FLANK);
}

double plan_width(enum plan_shape shape)
{
	if (shape == PLAN_SAW_TOOTH)
		return 1.0 - WIDTH_LEVEL;
	return 1.0 -
	       2.0 * (shape == PLAN_HALF_SINE ? asin(WIDTH_LEVEL) / UNITS_PI : TRAPEZOID_FLANK * WIDTH_LEVEL);
}

double plan_velocity_m_s(enum plan_shape shape, double peak_g, double duration_s)
{
	static const double area[] = {[PLAN_HALF_SINE] = 2.0 / UNITS_PI,
	                              [PLAN_SAW_TOOTH] = 0.5,
	                              [PLAN_TRAPEZOID] = 1.0 - TRAPEZOID_FLANK};

	return area[shape] * peak_g * UNITS_G_M_S2 * duration_s;
}

double plan_height_m(double velocity_m_s)
{
	return velocity_m_s * velocity_m_s / (2.0 * UNITS_G_M_S2);
}

/* ---- reading ---- */

enum {
	TOLERANCE_PEAK,
	TOLERANCE_DURATION,
	TOLERANCE_VELOCITY,
	TOLERANCE_BAND,
	TOLERANCE_TRANSVERSE,
	TOLERANCES
};

struct plan_reading {
	struct plan *plan;
	const char *file;
	char *message;
	int line;
	double percent[TOLERANCES]; /* NAN: the row's */
};

__attribute__((format(printf, 2, 3))) static int plan_refuse(const struct plan_reading *r, const char *format,
                                                             ...)
{
	int used = snprintf(r->message, SCENE_MESSAGE_MAX, "%.300s%s%.0d: ", r->file, r->line > 0 ? ":" : "",
	                    r->line);
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(r->message + used, (size_t)(SCENE_MESSAGE_MAX - used), format, arguments);
	va_end(arguments);
	return DT_E_FORMAT;
}

/* Whether name is a quantity's place in JSON; what stands before it is whose it is. */
static bool is_at(const char *name, const struct quantity_home *home, const struct quantity *q,
                  char subject[32])
{
	char place[96];
	size_t length = strlen(name), tail;

	snprintf(place, sizeof(place), "%s%s%s", home->path, home->path[0] ? "." : "", q->key);
	tail = strlen(place);
	subject[0] = '\0';
	if (length < tail || strcmp(name + length - tail, place) != 0)
		return false;
	if (length == tail)
		return strcmp(home->array, "resultants") != 0;
	if (!home->array[0] || length < tail + 2 || name[length - tail - 1] != '.' || length - tail > 32)
		return false;
	snprintf(subject, 32, "%.*s", (int)(length - tail - 1), name);
	return strchr(subject, '.') == NULL;
}

static bool plan_find(const char *name, struct plan_limit *limit)
{
	for (int p = 0; p < QUANTITY_PLACES; p++) {
		const struct quantity *q = NULL;

		while ((q = quantity_next(quantity_homes[p].object, q)) != NULL) {
			if (q->kind != QUANTITY_NUMBER || p >= QUANTITY_AT_VERDICT ||
			    !is_at(name, &quantity_homes[p], q, limit->subject))
				continue;
			limit->place = (enum quantity_place)p;
			limit->quantity = q;
			return true;
		}
	}
	return false;
}

/* "-" or a number; the text behind it, NULL when it is neither. */
static const char *read_bound(const char *text, double none, double *bound)
{
	size_t length = strcspn(text, " \t");

	*bound = none;
	if (length == 0 || (!(length == 1 && text[0] == '-') && !number_parse(text, length, '.', bound)))
		return NULL;
	return text + length + strspn(text + length, " \t");
}

/* REFERENCE +- U */
static bool read_reference(const char *value, struct plan_limit *limit)
{
	const char *rest = read_bound(value, (double)NAN, &limit->lower);

	if (rest == NULL || strncmp(rest, "+-", 2) != 0)
		return false;
	rest = read_bound(rest + 2 + strspn(rest + 2, " \t"), (double)NAN, &limit->reference_expanded);
	limit->upper = limit->lower;
	return rest != NULL && *rest == '\0' && isfinite(limit->lower) && limit->reference_expanded > 0.0;
}

static int read_limit(struct plan_reading *r, const char *name, const char *value)
{
	struct plan *plan = r->plan;
	struct plan_limit limit = {.reference_expanded = 0.0};
	const char *rest;
	bool check;

	if (!plan_find(name, &limit))
		return plan_refuse(
		        r, "unknown key '%.60s' in [limits], expected SUBJECT.PLACE as JSON has it", name);
	check = read_reference(value, &limit);
	if (!check) {
		limit.reference_expanded = 0.0;
		rest = read_bound(value, (double)-INFINITY, &limit.lower);
		rest = rest != NULL ? read_bound(rest, (double)INFINITY, &limit.upper) : NULL;
		if (rest == NULL || *rest != '\0' || !(isfinite(limit.lower) || isfinite(limit.upper)))
			return plan_refuse(
			        r,
			        "%.60s is '%.60s', expected a lower and an upper limit, - for none, or a "
			        "reference +- its U",
			        name, value);
	}
	if (!check && !(limit.lower < limit.upper))
		return plan_refuse(r, "%.60s: lower limit %g is not below upper limit %g", name, limit.lower,
		                   limit.upper);
	if (plan->count == PLAN_LIMITS_MAX)
		return plan_refuse(r, "more than %d limits", PLAN_LIMITS_MAX);
	plan->limit[plan->count++] = limit;
	return 0;
}

/* FREQUENCY:LOWER:UPPER ... */
static int read_spectrum(struct plan_reading *r, const char *text)
{
	struct plan *plan = r->plan;

	while (*(text += strspn(text, " \t")) != '\0') {
		struct limit_point p;
		int used = 0;

		if (plan->spectrum.count == PLAN_POINTS_MAX)
			return plan_refuse(r, "more than %d points of a spectrum", PLAN_POINTS_MAX);
		if (sscanf(text, "%lf:%lf:%lf%n", &p.x, &p.lower, &p.upper, &used) != 3 ||
		    strchr(" \t", text[used]) == NULL || !(p.x > 0.0) || !(p.lower > 0.0) ||
		    !(p.lower < p.upper) || !isfinite(p.x + p.upper) ||
		    (plan->spectrum.count > 0 && !(p.x > plan->point[plan->spectrum.count - 1].x)))
			return plan_refuse(r, "'%.40s', expected rising FREQUENCY_HZ:LOWER_G:UPPER_G", text);
		plan->point[plan->spectrum.count++] = p;
		text += used;
	}
	return 0;
}

static int read_preset(struct plan_reading *r, const char *name)
{
	r->plan->preset = plan_preset_find(name);
	if (r->plan->preset != NULL)
		return 0;
	return plan_refuse(r, "no preset '%.60s'; 'droptower analyze --limits list' lists them", name);
}

static int plan_read_number(struct plan_reading *r, const char *name, const char *value, double min,
                            double max, double *number)
{
	if (number_read(value, min, max, number))
		return 0;
	return plan_refuse(r, "%.60s is '%.60s', expected %g to %g", name, value, min, max);
}

static int plan_read_entry(struct plan_reading *r, const char *name, const char *value)
{
	static const char *const tolerances[TOLERANCES] = {
	        "peak_percent", "duration_percent", "velocity_percent", "band_percent", "transverse_percent"};
	struct plan *plan = r->plan;
	double percent;
	int result;

	for (int i = 0; i < TOLERANCES; i++)
		if (strcmp(name, tolerances[i]) == 0)
			return plan_read_number(r, name, value, PRESET_LEAST_PERCENT, 99.0, &r->percent[i]);
	if (strcmp(name, "guard") == 0)
		return plan_read_number(r, name, value, 0.0, 3.0, &plan->guard);
	if (strcmp(name, "spectrum_q") == 0)
		return plan_read_number(r, name, value, 0.6, 1000.0, &plan->q);
	if (strcmp(name, "chain_percent") == 0 || strcmp(name, "spectrum_share") == 0) {
		double *share = name[0] == 'c' ? &plan->chain : &plan->share;

		result = plan_read_number(r, name, value, share == &plan->chain ? 0.0 : 1.0, 100.0, &percent);
		*share = result == 0 ? percent / 100.0 : *share;
		return result;
	}
	if (strcmp(name, "preset") == 0)
		return read_preset(r, value);
	if (strcmp(name, "spectrum") == 0)
		return read_spectrum(r, value);
	if (strcmp(name, "channel") != 0)
		return read_limit(r, name, value);
	if (value[0] == '\0' || strlen(value) >= sizeof(plan->channel))
		return plan_refuse(r, "channel is empty or too long");
	snprintf(plan->channel, sizeof(plan->channel), "%s", value);
	return 0;
}

/* ---- a preset's limits ---- */

static void plan_add(struct plan *plan, const char *name, double nominal, double percent)
{
	struct plan_limit *limit = &plan->limit[plan->count];

	if (!(percent > 0.0) || !plan_find(name, limit))
		return;
	limit->reference_expanded = 0.0;
	limit->lower = nominal * (1.0 - percent / 100.0);
	limit->upper = nominal * (1.0 + percent / 100.0);
	plan->count++;
}

static int plan_expand(struct plan_reading *r)
{
	struct plan *plan = r->plan;
	const struct plan_preset *p = plan->preset;
	double own[TOLERANCES], any = 0.0;

	if (p == NULL)
		return 0;
	own[TOLERANCE_PEAK] = p->peak_percent;
	own[TOLERANCE_DURATION] = 0.0;
	own[TOLERANCE_VELOCITY] = p->velocity_percent;
	own[TOLERANCE_BAND] = p->band_percent;
	own[TOLERANCE_TRANSVERSE] = p->transverse_percent;
	for (int i = 0; i < TOLERANCES; i++) {
		own[i] = isnan(r->percent[i]) ? own[i] : r->percent[i];
		any += own[i];
	}
	r->line = 0;
	if (!(any > 0.0))
		return plan_refuse(
		        r, "[limits]: '%s' has no tolerances of its own, expected peak_percent and others",
		        p->name);
	if (plan->count + 3 > PLAN_LIMITS_MAX)
		return plan_refuse(r, "more than %d limits", PLAN_LIMITS_MAX);
	plan_add(plan, "peak.value_g", p->peak_g, own[TOLERANCE_PEAK]);
	plan_add(plan, "pulse.duration_s", plan_width(p->shape) * p->duration_ms * 1e-3,
	         own[TOLERANCE_DURATION]);
	plan_add(plan, "pulse.velocity_change_m_s",
	         plan_velocity_m_s(p->shape, p->peak_g, p->duration_ms * 1e-3), own[TOLERANCE_VELOCITY]);
	plan->band_g = p->peak_g * own[TOLERANCE_BAND] / 100.0;
	plan->transverse = own[TOLERANCE_TRANSVERSE] / 100.0;
	return 0;
}

int plan_read(struct plan *plan, const char *limits, const char *file, char message[SCENE_MESSAGE_MAX])
{
	struct plan_reading r = {.plan = plan, .file = file, .message = message};
	int result = 0;

	*plan = (struct plan){.guard = 1.0, .chain = (double)NAN, .q = SPECTRUM_Q, .share = 1.0};
	plan->spectrum.point = plan->point;
	for (int i = 0; i < TOLERANCES; i++)
		r.percent[i] = (double)NAN;
	for (const char *at = limits; *at != '\0' && result == 0; at = strchr(at, '\n') + 1) {
		char entry[256], *value;

		snprintf(entry, sizeof(entry), "%.*s", (int)strcspn(at, "\n"), at);
		r.line = (int)strtol(entry, &value, 10);
		value = strchr(value, '=');
		*value++ = '\0';
		result = plan_read_entry(&r, strchr(entry, ':') + 1, value);
	}
	if (result == 0)
		result = plan_expand(&r);
	r.line = 0;
	if (result == 0 && plan->spectrum.count == 1)
		result = plan_refuse(&r, "[limits]: a spectrum of one point, expected 2 or more");
	if (result == 0 && limits[0] != '\0' && plan_is_empty(plan))
		result = plan_refuse(&r, "[limits] limits nothing");
	return result;
}

bool plan_is_empty(const struct plan *plan)
{
	return plan->count == 0 && plan->spectrum.count == 0 && !(plan->band_g > 0.0) &&
	       !(plan->transverse > 0.0);
}
