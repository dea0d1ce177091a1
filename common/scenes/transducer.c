/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/scenes/transducer.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/base/date.h"
#include "common/base/number.h"
#include "common/plain.h"

enum need { PLAIN, TOLD, NEEDED };

static const struct text_key {
	const char *section, *name;
	size_t offset;
	enum need need;
} texts[] = {
#define TRANSDUCER_TEXT(section, key, NEED, doc) \
	{#section, #key, offsetof(struct transducer, section##_##key), NEED},
#include "common/scenes/transducer.def"
};

static const struct number_key {
	const char *section, *name;
	size_t offset;
	double min, max, initial;
	enum need need;
} numbers[] = {
#define TRANSDUCER_KEY(section, key, min, max, initial, NEED, doc) \
	{#section, #key, offsetof(struct transducer, section##_##key), min, max, initial, NEED},
#include "common/scenes/transducer.def"
};

enum { TEXTS = sizeof(texts) / sizeof(texts[0]), NUMBERS = sizeof(numbers) / sizeof(numbers[0]) };

struct transducer_reading {
	struct settings settings;
	struct transducer transducer;
	int line_of[TEXTS + NUMBERS]; /* 0: not given */
};

double transducer_reads(const struct transducer *t, unsigned axis, unsigned other)
{
	const double m[TRANSDUCER_AXES][TRANSDUCER_AXES] = {
	        {1.0, t->calibration_matrix_xy, t->calibration_matrix_xz},
	        {t->calibration_matrix_yx, 1.0, t->calibration_matrix_yz},
	        {t->calibration_matrix_zx, t->calibration_matrix_zy, 1.0}};

	return m[axis][other];
}

/* ---- entries ---- */

static int transducer_text(struct transducer_reading *r, size_t i, const char *value)
{
	struct settings *settings = &r->settings;
	const char *name = texts[i].name;

	if (r->line_of[i] != 0)
		return settings_fail(settings, DT_E_FORMAT, "%.60s is given twice", name);
	if (value[0] == '\0' || strlen(value) >= TRANSDUCER_TEXT_MAX || !plain_is_line(value, strlen(value)))
		return settings_fail(settings, DT_E_FORMAT, "%.60s is no line of 1 to %d bytes of UTF-8",
		                     name, TRANSDUCER_TEXT_MAX - 1);
	if ((strcmp(name, "date") == 0 || strcmp(name, "due") == 0) && !date_is_day(value))
		return settings_fail(settings, DT_E_FORMAT, "%.60s is '%.60s', expected YYYY-MM-DD", name,
		                     value);
	memcpy((char *)&r->transducer + texts[i].offset, value, strlen(value) + 1);
	r->line_of[i] = settings->line;
	return 1;
}

static int transducer_number(struct transducer_reading *r, size_t i, const char *value)
{
	const struct number_key *key = &numbers[i];
	double *into = (double *)(void *)((char *)&r->transducer + key->offset);

	if (r->line_of[TEXTS + i] != 0)
		return settings_fail(&r->settings, DT_E_FORMAT, "%.60s is given twice", key->name);
	if (!number_read(value, key->min, key->max, into))
		return settings_fail(&r->settings, DT_E_RANGE,
		                     "%.60s is '%.60s', expected a number from %g to %g", key->name, value,
		                     key->min, key->max);
	if (strncmp(key->name, "polarity", 8) == 0 && fabs(*into) < 1.0)
		return settings_fail(&r->settings, DT_E_RANGE, "%.60s is '%.60s', expected 1 or -1",
		                     key->name, value);
	if (strcmp(key->name, "order") == 0 && floor(*into) < *into)
		return settings_fail(&r->settings, DT_E_RANGE, "%.60s is '%.60s', expected a whole number",
		                     key->name, value);
	r->line_of[TEXTS + i] = r->settings.line;
	return 1;
}

static int transducer_entry(struct settings *settings, const char *section, const char *name,
                            const char *value)
{
	struct transducer_reading *r = (struct transducer_reading *)settings;

	for (size_t i = 0; i < TEXTS; i++)
		if (strcmp(section, texts[i].section) == 0 && strcmp(name, texts[i].name) == 0)
			return transducer_text(r, i, value);
	for (size_t i = 0; i < NUMBERS; i++)
		if (strcmp(section, numbers[i].section) == 0 && strcmp(name, numbers[i].name) == 0)
			return transducer_number(r, i, value);
	return settings_fail(settings, DT_E_FORMAT,
	                     "unknown key '%.60s' in [%.60s], expected one of [sensor], [calibration] or "
	                     "[chain]",
	                     name, section);
}

/* ---- all of it ---- */

static int line_of(const struct transducer_reading *r, const char *name)
{
	for (size_t i = 0; i < TEXTS; i++)
		if (strcmp(texts[i].name, name) == 0)
			return r->line_of[i];
	for (size_t i = 0; i < NUMBERS; i++)
		if (strcmp(numbers[i].name, name) == 0)
			return r->line_of[TEXTS + i];
	return 0;
}

/* "S1X S1Y S1Z" */
static int transducer_channels(struct transducer_reading *r)
{
	const char *at = r->transducer.sensor_channels;
	size_t axis = 0, length, used = 0;

	for (at += strspn(at, " \t"); *at != '\0'; at += length, at += strspn(at, " \t")) {
		length = strcspn(at, " \t");
		if (axis == TRANSDUCER_AXES || length >= TRANSDUCER_NAME_MAX)
			break;
		if (!(length == 1 && *at == '-')) {
			memcpy(r->transducer.channel[axis], at, length);
			used++;
		}
		axis++;
	}
	if (axis == TRANSDUCER_AXES && *at == '\0' && used > 0)
		return 0;
	r->settings.line = line_of(r, "channels");
	(void)settings_fail(&r->settings, DT_E_FORMAT,
	                    "channels is '%.60s', expected three names, - for none, as S1X S1Y S1Z",
	                    r->transducer.sensor_channels);
	return DT_E_FORMAT;
}

static int transducer_filter_of(struct transducer_reading *r)
{
	static const char *const names[] = {"none", "butterworth", "bessel"};
	const char *given = r->transducer.chain_filter;

	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		if (strcmp(given, names[i]) == 0 || (given[0] == '\0' && i == 0)) {
			r->transducer.filter = (enum transducer_filter)i;
			return 0;
		}
	r->settings.line = line_of(r, "filter");
	(void)settings_fail(&r->settings, DT_E_FORMAT,
	                    "filter is '%.60s', expected none, butterworth or bessel", given);
	return DT_E_FORMAT;
}

/* What a channel needs. */
static int transducer_needs(const struct transducer_reading *r)
{
	const struct transducer *t = &r->transducer;

	for (size_t i = 0; i < TRANSDUCER_AXES; i++) {
		const char *lacks = NULL;

		if (t->channel[i][0] == '\0')
			continue;
		if (!(TRANSDUCER_OF(t, calibration_sensitivity_x_mv_g, i) > 0.0))
			lacks = "[calibration] sensitivity_%c_mv_g";
		else if (!(TRANSDUCER_OF(t, chain_scaled_x_mv_g, i) > 0.0))
			lacks = "[chain] scaled_%c_mv_g";
		else if (t->filter != TRANSDUCER_NO_FILTER && !(TRANSDUCER_OF(t, chain_cutoff_x_hz, i) > 0.0))
			lacks = "[chain] cutoff_%c_hz";
		if (lacks != NULL) {
			size_t before = strcspn(lacks, "%");

			return settings_refuse(&r->settings, DT_E_FORMAT,
			                       "%.*s%c%s is missing, expected a number above 0 for channel "
			                       "%s",
			                       (int)before, lacks, "xyz"[i], lacks + before + 2,
			                       t->channel[i]);
		}
	}
	return 0;
}

static int transducer_complete(struct transducer_reading *r)
{
	struct transducer *t = &r->transducer;
	int result;

	for (size_t i = 0; i < TEXTS; i++)
		if (texts[i].need == NEEDED && r->line_of[i] == 0)
			return settings_refuse(&r->settings, DT_E_FORMAT, "[%s] %s is missing",
			                       texts[i].section, texts[i].name);
	for (size_t i = 0; i < NUMBERS; i++) {
		const struct number_key *key = &numbers[i];
		bool given = r->line_of[TEXTS + i] != 0;

		t->has_matrix |=
		        given && strncmp(key->name, "matrix_", 7) == 0 && strcmp(key->name, "matrix_u") != 0;
		if (!given)
			*(double *)(void *)((char *)t + key->offset) = key->initial;
		t->default_used |= !given && key->need == TOLD &&
		                   !(t->has_matrix && strcmp(key->name, "transverse_percent") == 0);
	}
	result = transducer_channels(r);
	if (result == 0)
		result = transducer_filter_of(r);
	if (result == 0)
		result = transducer_needs(r);
	if (result == 0 && strcmp(t->calibration_due, t->calibration_date) < 0)
		result = settings_refuse(&r->settings, DT_E_RANGE,
		                         "due is %s, expected a day not before date %s", t->calibration_due,
		                         t->calibration_date);
	return result;
}

int transducer_read(struct transducer *transducer, const char *file, char message[SETTINGS_MESSAGE_MAX])
{
	struct transducer_reading r = {
	        .settings = {.file = file, .message = message, .entry = transducer_entry}};
	int result = settings_read(&r.settings);

	if (result == DT_E_SYSTEM) {
		size_t said = strlen(message);

		snprintf(message + said, SETTINGS_MESSAGE_MAX - said, ", expected a sensor file");
	}
	if (result == 0)
		result = transducer_complete(&r);
	if (result == 0)
		*transducer = r.transducer;
	return result;
}
