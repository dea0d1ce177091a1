/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_QUANTITY_H
#define DT_HOST_RESULT_QUANTITY_H
/*
 * quantity.def as a table: what is reported of a record, where it stands in memory and where in JSON and
 * archive. Pure functions of it.
 */
#include "host/estimate/estimate.h"
#include "host/result/measured.h"

enum quantity_object {
#define QUANTITY_OBJECT(OBJECT, type) QUANTITY_##OBJECT,
#include "host/result/quantity.def"
	QUANTITY_OBJECTS
};

enum quantity_kind {
	QUANTITY_NUMBER,
	QUANTITY_POSITIVE,
	QUANTITY_COUNT,
	QUANTITY_WHOLE,
	QUANTITY_LARGE,
	QUANTITY_YES,
	QUANTITY_NAME,
	QUANTITY_NAMES,
	QUANTITY_FLAGS,
	QUANTITY_STATUS,
	QUANTITY_FAMILY,
};

struct quantity {
	enum quantity_object object;
	enum quantity_kind kind;
	size_t offset;
	const char *key, *sigma, *shown;
	int digits;
	const char *label, *text, *meaning;
};

/* Those of an object, in order: the next one behind last (NULL: the first), NULL behind the last. */
const struct quantity *quantity_next(enum quantity_object object, const struct quantity *last);

/* The one with this key; NULL when there is none. */
const struct quantity *quantity_find(enum quantity_object object, const char *key);

/* Its value in an object; of texts NAN. Its standard uncertainty, NAN without one. */
double quantity_number(const struct quantity *quantity, const void *object);
double quantity_sigma(const struct quantity *quantity, const void *object);

/* What a number is times to be shown: 1000 for s as ms. */
double quantity_scale(const struct quantity *quantity);

/* The status that goes with a value of this object: that of the object, "short" for a value that is not there
 * although the object is ok. */
enum estimate_status quantity_status(const struct quantity *quantity, const void *object);

/* CRC-32 of what a reader of results must know: keys, kinds, places. Another number: another table. */
uint32_t quantity_hash(void);

#endif
