/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/quantity.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/crc.h"
#include "host/result/verdict.h"

#define QUANTITY_OBJECT(OBJECT, type) typedef type object_##OBJECT;
#include "host/result/quantity.def"

static const struct quantity table[] = {
#define QUANTITY(OBJECT, KIND, key, field, sigma, shown, digits, label, text, meaning) \
	{QUANTITY_##OBJECT,                                                            \
	 QUANTITY_##KIND,                                                              \
	 offsetof(object_##OBJECT, field),                                             \
	 key,                                                                          \
	 sigma,                                                                        \
	 shown,                                                                        \
	 digits,                                                                       \
	 label,                                                                        \
	 text,                                                                         \
	 meaning},
#include "host/result/quantity.def"
};
enum { COUNT = sizeof(table) / sizeof(table[0]) };

const struct quantity *quantity_next(enum quantity_object object, const struct quantity *last)
{
	for (const struct quantity *q = last ? last + 1 : table; q < table + COUNT; q++)
		if (q->object == object)
			return q;
	return NULL;
}

const struct quantity *quantity_find(enum quantity_object object, const char *key)
{
	const struct quantity *q = NULL;

	while ((q = quantity_next(object, q)) && strcmp(q->key, key))
		;
	return q;
}

double quantity_number(const struct quantity *quantity, const void *object)
{
	const char *at = (const char *)object + quantity->offset;
	double value = (double)NAN;

	switch (quantity->kind) {
	case QUANTITY_NUMBER:
		return *(const double *)(const void *)at;
	case QUANTITY_POSITIVE:
		value = *(const double *)(const void *)at;
		return value > 0.0 ? value : (double)NAN;
	case QUANTITY_COUNT:
		return (double)*(const size_t *)(const void *)at;
	case QUANTITY_WHOLE:
		return *(const uint32_t *)(const void *)at;
	case QUANTITY_LARGE:
		return (double)*(const uint64_t *)(const void *)at;
	case QUANTITY_YES:
		return *(const bool *)(const void *)at;
	default:
		return value;
	}
}

double quantity_sigma(const struct quantity *quantity, const void *object)
{
	const struct quantity *sigma = quantity_find(quantity->object, quantity->sigma);

	return sigma ? quantity_number(sigma, object) : (double)NAN;
}

double quantity_scale(const struct quantity *quantity)
{
	static const struct {
		const char *shown, *unit;
		double scale;
	} units[] = {{"ms", "s", 1e3}, {"us", "s", 1e6}, {"mm", "m", 1e3}};
	const char *unit = strrchr(quantity->key, '_');

	for (size_t i = 0; unit && i < sizeof(units) / sizeof(units[0]); i++)
		if (!strcmp(quantity->shown, units[i].shown) && !strcmp(unit + 1, units[i].unit))
			return units[i].scale;
	return 1.0;
}

enum estimate_status quantity_object_status(enum quantity_object which, const void *object)
{
	const struct quantity *q = quantity_find(which, "status");

	return q ? *(const enum estimate_status *)(const void *)((const char *)object + q->offset)
	         : ESTIMATE_OK;
}

enum estimate_status quantity_status(const struct quantity *quantity, const void *object)
{
	enum estimate_status status = quantity_object_status(quantity->object, object);

	return status == ESTIMATE_OK && !isfinite(quantity_number(quantity, object)) ? ESTIMATE_SHORT
	                                                                             : status;
}

const struct quantity_home quantity_homes[QUANTITY_PLACES] = {
#define QUANTITY_PLACE(PLACE, OBJECT, table, array, path) {QUANTITY_##OBJECT, table, array, path},
#include "host/result/quantity.def"
};

const struct quantity_column quantity_columns[QUANTITY_COLUMNS] = {
#define QUANTITY_COLUMN(NAME, name, unit, PLACE, subject, key, title, head, shown, digits)          \
	{name, unit,  name "_" unit, name "_sigma_" unit, QUANTITY_AT_##PLACE, subject, key, title, \
	 head, shown, digits},
#include "host/result/quantity.def"
};

double quantity_column_scale(const struct quantity_column *column)
{
	return quantity_scale(quantity_find(quantity_homes[column->place].object, column->key));
}

void quantity_column_what(const struct quantity_column *c, char what[QUANTITY_WHAT_MAX])
{
	const char *path = quantity_homes[c->place].path;

	snprintf(what, QUANTITY_WHAT_MAX, "%s%s%s%s%s", c->subject, c->subject[0] ? "." : "", path,
	         path[0] ? "." : "", c->key);
}

/* ---- texts ---- */

static void flag_names(unsigned flags, char *text, size_t size)
{
	size_t at = 0;

	text[0] = '\0';
	for (; flags && at < size; flags &= flags - 1)
		at += (size_t)snprintf(text + at, size - at, "%s%s", at ? " " : "",
		                       estimate_flag_name(flags));
}

bool quantity_words(const struct quantity *quantity, const void *object, char text[QUANTITY_TEXT_MAX])
{
	const void *at = (const char *)object + quantity->offset;
	const char *name = "";

	switch (quantity->kind) {
	case QUANTITY_NAME:
		name = *(const char *const *)at ? *(const char *const *)at : "";
		break;
	case QUANTITY_STATUS:
		name = estimate_status_name(*(const enum estimate_status *)at);
		break;
	case QUANTITY_FAMILY:
		name = estimate_family_name(*(const enum estimate_family *)at);
		break;
	case QUANTITY_FLAGS:
		flag_names(*(const unsigned *)at, text, QUANTITY_TEXT_MAX);
		return true;
	default:
		return false;
	}
	snprintf(text, QUANTITY_TEXT_MAX, "%s", name);
	return true;
}

static unsigned quantity_flags_of(const char *text)
{
	unsigned flags = 0;

	while (*text) {
		size_t length = strcspn(text, " ");

		for (unsigned bit = 1; estimate_flag_name(bit)[0]; bit <<= 1)
			if (strlen(estimate_flag_name(bit)) == length &&
			    !strncmp(estimate_flag_name(bit), text, length))
				flags |= bit;
		text += length + strspn(text + length, " ");
	}
	return flags;
}

static enum estimate_status status_of(const char *text)
{
	for (enum estimate_status s = ESTIMATE_OK; s <= ESTIMATE_NOT_CONVERGED; s++)
		if (!strcmp(estimate_status_name(s), text))
			return s;
	return ESTIMATE_NO_PEAK;
}

void quantity_set_text(const struct quantity *quantity, void *object, const char *text)
{
	void *at = (char *)object + quantity->offset;

	if (quantity->kind == QUANTITY_FLAGS)
		*(unsigned *)at = quantity_flags_of(text);
	else if (quantity->kind == QUANTITY_STATUS)
		*(enum estimate_status *)at = status_of(text);
	else if (quantity->kind == QUANTITY_NAME)
		*(const char **)at = "";
	else if (quantity->kind == QUANTITY_FAMILY && estimate_family_parse(text, at) != 0)
		*(enum estimate_family *)at = ESTIMATE_FAMILY_AUTO;
}

void quantity_set_number(const struct quantity *quantity, void *object, double value)
{
	void *at = (char *)object + quantity->offset;
	bool counts = value >= 0.0 && value <= 9e15;

	switch (quantity->kind) {
	case QUANTITY_NUMBER:
	case QUANTITY_POSITIVE:
		*(double *)at = value;
		break;
	case QUANTITY_COUNT:
		*(size_t *)at = counts ? (size_t)value : 0;
		break;
	case QUANTITY_WHOLE:
		*(uint32_t *)at = counts && value <= UINT32_MAX ? (uint32_t)value : 0;
		break;
	case QUANTITY_LARGE:
		*(uint64_t *)at = counts ? (uint64_t)value : 0;
		break;
	case QUANTITY_YES:
		*(bool *)at = value > 0.0;
		break;
	default:
		break;
	}
}

void quantity_clear(enum quantity_object which, void *object)
{
	const struct quantity *q = NULL;

	while ((q = quantity_next(which, q))) {
		quantity_set_number(q, object, (double)NAN);
		quantity_set_text(q, object, "");
	}
}

/* ---- one record's ---- */

struct result result_of(struct record *record, struct analysis *analysis, struct estimate_options *options)
{
	return (struct result){record, analysis, options, measured_of(record), NULL, NULL, NULL};
}

static void *of_channel(struct result *result, enum quantity_place place, size_t i, const char **subject)
{
	struct estimate_channel *e = &result->analysis->channels[i];

	if (i >= result->analysis->channel_count)
		return NULL;
	*subject = result->record->channels[i].name;
	switch (place) {
	case QUANTITY_AT_SAMPLES:
		return &result->record->channels[i];
	case QUANTITY_AT_BASELINE:
		return &e->baseline;
	case QUANTITY_AT_PEAK:
		return &e->peak;
	case QUANTITY_AT_RINGDOWN:
		return &e->ringdown;
	default:
		return &e->pulse;
	}
}

static void *of_drop(struct result *result, enum quantity_place place)
{
	struct analysis *a = result->analysis;

	switch (place) {
	case QUANTITY_AT_RECORD:
		return result->record;
	case QUANTITY_AT_PROCESSING:
		return result->options;
	case QUANTITY_AT_DROP:
		return result->record->is_drop ? result->record : NULL;
	case QUANTITY_AT_TOWER:
		return result->record->is_drop ? &result->measured : NULL;
	case QUANTITY_AT_PLATE:
		return a->has_plate ? &a->plate : NULL;
	case QUANTITY_AT_REBOUND:
		return a->has_rebound ? &a->rebound : NULL;
	case QUANTITY_AT_MOTION:
		return a->has_motion ? &a->motion : NULL;
	case QUANTITY_AT_VERDICT:
		return result->verdict;
	default:
		return a->has_lag ? &a->lag : NULL;
	}
}

static void *of_chain(struct result *result, enum quantity_place place, size_t i, const char **subject)
{
	size_t count = place == QUANTITY_AT_SENSOR ? (result->sensors ? result->sensors->count : 0)
	                                           : (result->budget ? result->budget->count : 0);

	if (i >= count)
		return NULL;
	*subject = place == QUANTITY_AT_SENSOR ? result->sensors->used[i].name : result->budget->item[i].what;
	return place == QUANTITY_AT_SENSOR ? (void *)&result->sensors->used[i] : &result->budget->item[i];
}

void *result_at(struct result *result, enum quantity_place place, size_t i, const char **subject)
{
	*subject = "";
	if (!strcmp(quantity_homes[place].array, "channels"))
		return of_channel(result, place, i, subject);
	if (place == QUANTITY_AT_SENSOR || place == QUANTITY_AT_BUDGET)
		return of_chain(result, place, i, subject);
	if (place != QUANTITY_AT_RESULTANT)
		return i ? NULL : of_drop(result, place);
	if (i >= result->analysis->resultant_count)
		return NULL;
	*subject = result->analysis->resultants[i].sensor;
	return &result->analysis->resultants[i];
}

static uint32_t quantity_hash(void)
{
	static const char text[] =
#define QUANTITY_PLACE(PLACE, OBJECT, table, array, path) #OBJECT " " array "/" path ";"
#define QUANTITY(OBJECT, KIND, key, field, sigma, shown, digits, label, text, meaning) \
#OBJECT " " #KIND " " key " " sigma ";"
#include "host/result/quantity.def"
	        ;

	return crc32(CRC32_INIT, (const uint8_t *)text, sizeof(text) - 1);
}

const char *quantity_version(void)
{
	static char text[QUANTITY_VERSION_CHARS];

	snprintf(text, sizeof(text), "%08" PRIX32, quantity_hash());
	return text;
}
