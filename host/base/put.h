/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_PUT_H
#define DT_HOST_BASE_PUT_H
/*
 * Building a JSON object: numbers with as many digits as give the same double again, NAN and infinities as
 * null, texts as valid UTF-8. Objects under construction belong to their
 * parent; out of memory anywhere, and failed is set: it is looked at once, by put_out.
 */
#include <stdbool.h>
#include <stdio.h>

#include <cjson/cJSON.h>

struct builder {
	bool failed;
};

/* item may be NULL, which is a failure. */
void put_item(struct builder *b, cJSON *object, const char *key, cJSON *item);
void put_number(struct builder *b, cJSON *object, const char *key, double value);
void put_bool(struct builder *b, cJSON *object, const char *key, bool value);
void put_text(struct builder *b, cJSON *object, const char *key, const char *value);
cJSON *put_object(struct builder *b, cJSON *object, const char *key);
cJSON *put_array(struct builder *b, cJSON *object, const char *key);
cJSON *put_append(struct builder *b, cJSON *array); /* a new object at the array's end */

void put_numbers(struct builder *b, cJSON *object, const char *key, const double *value, size_t count);

/* "flags": names of the bits in flags, by the function that knows the lowest. The array, for more of them. */
cJSON *put_flags(struct builder *b, cJSON *object, unsigned flags, const char *(*name_of)(unsigned));
void put_more_flags(struct builder *b, cJSON *array, unsigned flags, const char *(*name_of)(unsigned));

/* Prints part of a larger whole, to which the caller sees, and frees it. 0 or DT_E_MEMORY. */
int put_part(struct builder *b, cJSON *part, FILE *out);

/* Prints root on one line and frees it. 0, DT_E_SYSTEM or DT_E_MEMORY. */
int put_out(struct builder *b, cJSON *root, FILE *out);

#endif
