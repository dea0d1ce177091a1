/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_SAID_H
#define DT_HOST_RESULT_SAID_H
/*
 * What the JSON of a result says, by the places and keys of quantity.def. Pure functions.
 */
#include <cjson/cJSON.h>

#include "host/result/quantity.h"

/* Down a path of names with points between, "" stays where it is; NULL where it leads nowhere. */
const cJSON *said_path(const cJSON *from, const char *path);

/* The i-th of a place, and whose it is ("S1X", "S1", ""): false behind the last. object: NULL when that one
 * has none; null: the JSON says so itself. subject is of the JSON, or "". */
struct said {
	const cJSON *object;
	const char *subject;
	bool null;
};
bool said_at(const cJSON *result, const struct quantity_home *home, int i, struct said *said);

/* The object of a subject at a place; NULL. */
const cJSON *said_of(const cJSON *result, const struct quantity_home *home, const char *subject);

/* The value of a key in an object: a text, flags with blanks between. False for what is no text. */
bool said_words(const cJSON *object, const char *key, char text[QUANTITY_TEXT_MAX]);

/* The same as a number, true and false as 1 and 0; NAN for what is none. */
double said_number(const cJSON *object, const char *key);

#endif
