/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/quantity.h"

#include <math.h>
#include <string.h>

#include "common/crc.h"

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

enum estimate_status quantity_status(const struct quantity *quantity, const void *object)
{
	const struct quantity *q = NULL;
	enum estimate_status status = ESTIMATE_OK;

	while ((q = quantity_next(quantity->object, q)))
		if (q->kind == QUANTITY_STATUS)
			status = *(const enum estimate_status *)(const void *)((const char *)object +
			                                                       q->offset);
	return status == ESTIMATE_OK && !isfinite(quantity_number(quantity, object)) ? ESTIMATE_SHORT
	                                                                             : status;
}

uint32_t quantity_hash(void)
{
	static const char text[] =
#define QUANTITY_PLACE(PLACE, OBJECT, table, array, path) #OBJECT " " array "/" path ";"
#define QUANTITY(OBJECT, KIND, key, field, sigma, shown, digits, label, text, meaning) \
#OBJECT " " #KIND " " key " " sigma ";"
#include "host/result/quantity.def"
	        ;

	return crc32(CRC32_INIT, (const uint8_t *)text, sizeof(text) - 1);
}
