/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_COLUMNS_H
#define DT_HOST_BATCH_COLUMNS_H
/*
 * Results in JSON as rows: first what tells a row from others, then the columns of quantity.def at the places
 * of one array of the JSON, or of none.
 */
#include <cjson/cJSON.h>

#include "host/base/table.h"
#include "host/result/quantity.h"

enum { COLUMNS_OF_BATCH_MAX = 320 };

struct cell {
	const char *words; /* NULL: not known */
	double number;     /* NAN: not known */
	char text[QUANTITY_TEXT_MAX];
};

struct batch_columns {
	struct table_column column[COLUMNS_OF_BATCH_MAX];
	char name[COLUMNS_OF_BATCH_MAX][64];
	enum quantity_place place[COLUMNS_OF_BATCH_MAX];
	const struct quantity *quantity[COLUMNS_OF_BATCH_MAX]; /* NULL: a column of its own */
	struct cell cell[COLUMNS_OF_BATCH_MAX];                /* the row, for table_row */
	size_t count;
};

/* Adds a column of its own, of words or of numbers. */
void batch_columns_own(struct batch_columns *columns, const char *name, bool words);

/* Adds those of all quantities with this array: "channels", or "". */
void batch_columns_add(struct batch_columns *columns, const char *array);

/* Sets the cells behind the own ones from an object of the array, or the result itself. */
void batch_columns_fill(struct batch_columns *columns, const cJSON *object);

/* Sets the i-th cell to what a key of an object says; words are copied. */
void cell_words(struct batch_columns *columns, size_t i, const cJSON *object, const char *key);
void cell_number(struct batch_columns *columns, size_t i, const cJSON *object, const char *key);

#endif
