/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/put.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/error.h"

void put_item(struct builder *b, cJSON *object, const char *key, cJSON *item)
{
	if (!item || !cJSON_AddItemToObject(object, key, item)) {
		cJSON_Delete(item);
		b->failed = true;
	}
}

/* cJSON's own numbers may lose the last digit. */
static cJSON *base_put_number(double value)
{
	char text[NUMBER_CHARS];

	if (!isfinite(value))
		return cJSON_CreateNull();
	number_format(text, value, 15);
	return cJSON_CreateRaw(text);
}

void put_number(struct builder *b, cJSON *object, const char *key, double value)
{
	put_item(b, object, key, base_put_number(value));
}

void put_numbers(struct builder *b, cJSON *object, const char *key, const double *value, size_t count)
{
	cJSON *array = put_array(b, object, key);

	for (size_t i = 0; i < count; i++) {
		cJSON *item = base_put_number(value[i]);

		if (!item || !cJSON_AddItemToArray(array, item)) {
			cJSON_Delete(item);
			b->failed = true;
		}
	}
}

void put_bool(struct builder *b, cJSON *object, const char *key, bool value)
{
	put_item(b, object, key, cJSON_CreateBool(value));
}

/* Length of the UTF-8 character at s, 0 where there is none. (RFC 3629: neither longer than it need be, nor
 * half of a UTF-16 pair, nor beyond U+10FFFF) */
static size_t utf8_length(const unsigned char *s)
{
	static const struct {
		unsigned char first, last, second_low, second_high, length;
	} table[] = {
	        {0x01, 0x7F, 0x00, 0xFF, 1}, {0xC2, 0xDF, 0x80, 0xBF, 2}, {0xE0, 0xE0, 0xA0, 0xBF, 3},
	        {0xE1, 0xEC, 0x80, 0xBF, 3}, {0xED, 0xED, 0x80, 0x9F, 3}, {0xEE, 0xEF, 0x80, 0xBF, 3},
	        {0xF0, 0xF0, 0x90, 0xBF, 4}, {0xF1, 0xF3, 0x80, 0xBF, 4}, {0xF4, 0xF4, 0x80, 0x8F, 4},
	};
	size_t row = 0, count = sizeof(table) / sizeof(table[0]);

	while (row < count && (s[0] < table[row].first || s[0] > table[row].last))
		row++;
	if (row == count || s[1] < table[row].second_low || s[1] > table[row].second_high)
		return 0;
	for (size_t i = 2; i < table[row].length; i++)
		if ((s[i] & 0xC0) != 0x80)
			return 0;
	return table[row].length;
}

/* File names are bytes, JSON is UTF-8: what is no UTF-8 becomes a question mark. */
void put_text(struct builder *b, cJSON *object, const char *key, const char *value)
{
	char *copy = strdup(value);

	for (char *s = copy; s && *s;) {
		size_t length = utf8_length((const unsigned char *)s);

		if (!length)
			*s = '?';
		s += length ? length : 1;
	}
	put_item(b, object, key, copy ? cJSON_CreateString(copy) : NULL);
	free(copy);
}

cJSON *put_object(struct builder *b, cJSON *object, const char *key)
{
	cJSON *item = cJSON_AddObjectToObject(object, key);

	b->failed |= !item;
	return item;
}

cJSON *put_array(struct builder *b, cJSON *object, const char *key)
{
	cJSON *item = cJSON_AddArrayToObject(object, key);

	b->failed |= !item;
	return item;
}

cJSON *put_append(struct builder *b, cJSON *array)
{
	cJSON *item = cJSON_CreateObject();

	if (!item || !cJSON_AddItemToArray(array, item)) {
		cJSON_Delete(item);
		b->failed = true;
		return NULL;
	}
	return item;
}

void put_more_flags(struct builder *b, cJSON *array, unsigned flags, const char *(*name_of)(unsigned))
{
	for (; flags; flags &= flags - 1) {
		cJSON *name = cJSON_CreateString(name_of(flags));

		if (!name || !cJSON_AddItemToArray(array, name)) {
			cJSON_Delete(name);
			b->failed = true;
		}
	}
}

cJSON *put_flags(struct builder *b, cJSON *object, unsigned flags, const char *(*name_of)(unsigned))
{
	cJSON *array = put_array(b, object, "flags");

	put_more_flags(b, array, flags, name_of);
	return array;
}

int put_part(struct builder *b, cJSON *part, FILE *out)
{
	char *text = b->failed ? NULL : cJSON_PrintUnformatted(part);

	cJSON_Delete(part);
	if (!text)
		return DT_E_MEMORY;
	fputs(text, out);
	cJSON_free(text);
	return 0;
}

int put_out(struct builder *b, cJSON *root, FILE *out)
{
	int result = put_part(b, root, out);

	if (result != 0)
		return result;
	fputc('\n', out);
	return fflush(out) != 0 || ferror(out) ? DT_E_SYSTEM : 0;
}
