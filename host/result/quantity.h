/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_QUANTITY_H
#define DT_HOST_RESULT_QUANTITY_H
/*
 * quantity.def as a table: what is reported of a record, where it stands in memory and where in JSON and
 * archive. Pure functions of it.
 */
#include "host/estimate/estimate.h"
#include "host/result/measured.h"
#include "host/sensor/budget.h"

enum quantity_object {
#define QUANTITY_OBJECT(OBJECT, type) QUANTITY_##OBJECT,
#include "host/result/quantity.def"
	QUANTITY_OBJECTS
};

enum quantity_place {
#define QUANTITY_PLACE(PLACE, OBJECT, table, array, path) QUANTITY_AT_##PLACE,
#include "host/result/quantity.def"
	QUANTITY_PLACES
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

struct quantity_home {
	enum quantity_object object;
	const char *table, *array, *path;
};
extern const struct quantity_home quantity_homes[QUANTITY_PLACES];

/* A value of a drop in tables of drops: column NAME_UNIT, and NAME_sigma_UNIT. */
struct quantity_column {
	const char *name, *unit, *value, *sigma;
	enum quantity_place place;
	const char *subject, *key, *title, *head, *shown;
	int digits;
};
enum {
#define QUANTITY_COLUMN(NAME, name, unit, PLACE, subject, key, title, head, shown, digits) \
	QUANTITY_COLUMN_##NAME,
#include "host/result/quantity.def"
	QUANTITY_COLUMNS
};
extern const struct quantity_column quantity_columns[QUANTITY_COLUMNS];

/* Those of an object, in order: the next one behind last (NULL: the first), NULL behind the last. */
const struct quantity *quantity_next(enum quantity_object object, const struct quantity *last);

/* The one with this key; NULL when there is none. */
const struct quantity *quantity_find(enum quantity_object object, const char *key);

/* Its value in an object; of texts NAN. Its standard uncertainty, NAN without one. */
double quantity_number(const struct quantity *quantity, const void *object);
double quantity_sigma(const struct quantity *quantity, const void *object);

/* Texts of those that are no number: a name, flags with blanks between. False for a number, and for NAMES,
 * which only JSON has. */
enum { QUANTITY_TEXT_MAX = 240 };
bool quantity_words(const struct quantity *quantity, const void *object, char text[QUANTITY_TEXT_MAX]);

/* The same back; a name that is kept nowhere becomes "". */
void quantity_set_number(const struct quantity *quantity, void *object, double value);
void quantity_set_text(const struct quantity *quantity, void *object, const char *text);

/* Nothing known: numbers NAN or 0, status no_peak. */
void quantity_clear(enum quantity_object which, void *object);

/* What a number is times to be shown: 1000 for s as ms. */
double quantity_scale(const struct quantity *quantity);
double quantity_column_scale(const struct quantity_column *column);

/* What the budget calls it: "S2X.peak.value_g". */
enum { QUANTITY_WHAT_MAX = sizeof(((struct budget_item *)NULL)->what) };
void quantity_column_what(const struct quantity_column *column, char what[QUANTITY_WHAT_MAX]);

/* Status of an object; ok where it has none. */
enum estimate_status quantity_object_status(enum quantity_object which, const void *object);

/* The status that goes with a value of this object: that of the object, "short" for a value that is not there
 * although the object is ok. */
enum estimate_status quantity_status(const struct quantity *quantity, const void *object);

struct verdict;

/* All that is reported of one record. */
struct result {
	struct record *record;
	struct analysis *analysis;
	struct estimate_options *options;
	struct measured measured;
	struct verdict *verdict; /* NULL: none */
	struct sensors *sensors; /* whose files were applied; NULL: none */
	struct budget *budget;   /* by them; NULL: none */
};
struct result result_of(struct record *record, struct analysis *analysis, struct estimate_options *options);

/* The i-th object at a place, and whose it is ("S1X", "S1", ""); NULL behind the last. */
void *result_at(struct result *result, enum quantity_place place, size_t i, const char **subject);

/* CRC-32 of what a reader of results must know: keys, kinds, places. Another number: another table. Eight
 * hexadecimal digits; every call writes the same into one place. */
enum { QUANTITY_VERSION_CHARS = 9 };
const char *quantity_version(void);

#endif
