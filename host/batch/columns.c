/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/columns.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static bool quantity_is_words(const struct quantity *q)
{
	return q->kind == QUANTITY_NAME || q->kind == QUANTITY_FLAGS || q->kind == QUANTITY_STATUS ||
	       q->kind == QUANTITY_FAMILY;
}

static size_t columns_new(struct batch_columns *columns, bool words)
{
	size_t i = columns->count++, at = i * sizeof(struct cell);

	assert(i < COLUMNS_OF_BATCH_MAX);
	columns->column[i] = (struct table_column){
	        .kind = words ? TABLE_WORDS : TABLE_NUMBER,
	        .offset = at + (words ? offsetof(struct cell, words) : offsetof(struct cell, number)),
	        .key = columns->name[i]};
	return i;
}

void batch_columns_own(struct batch_columns *columns, const char *name, bool words)
{
	size_t i = columns_new(columns, words);

	snprintf(columns->name[i], sizeof(columns->name[i]), "%s", name);
}

void batch_columns_add(struct batch_columns *columns, const char *array)
{
	for (int place = 0; place < QUANTITY_PLACES; place++) {
		const struct quantity_home *home = &quantity_homes[place];
		const struct quantity *q = NULL;

		if (strcmp(home->array, array) != 0)
			continue;
		while ((q = quantity_next(home->object, q)) != NULL) {
			size_t i;

			if (q->kind == QUANTITY_NAMES)
				continue;
			i = columns_new(columns, quantity_is_words(q));
			columns->quantity[i] = q;
			columns->place[i] = (enum quantity_place)place;
			snprintf(columns->name[i], sizeof(columns->name[i]), "%s%s%s", home->path,
			         home->path[0] != '\0' ? "." : "", q->key);
		}
	}
}

/* "a.b" of an object; NULL where it is not. */
static const cJSON *at_path(const cJSON *object, const char *path)
{
	char key[64];

	while (object != NULL && *path != '\0') {
		size_t length = strcspn(path, ".");

		snprintf(key, sizeof(key), "%.*s", (int)length, path);
		object = cJSON_GetObjectItemCaseSensitive(object, key);
		path += length + (path[length] == '.');
	}
	return object;
}

static void add_words(struct cell *cell, const char *words)
{
	size_t used = strlen(cell->text);

	snprintf(cell->text + used, sizeof(cell->text) - used, "%s%s", used > 0 ? " " : "", words);
}

void cell_words(struct batch_columns *columns, size_t i, const cJSON *value)
{
	struct cell *cell = &columns->cell[i];

	cell->text[0] = '\0';
	cell->words = cJSON_IsString(value) || cJSON_IsArray(value) ? cell->text : NULL;
	if (cJSON_IsString(value))
		add_words(cell, value->valuestring);
	for (const cJSON *item = cJSON_IsArray(value) ? value->child : NULL; item != NULL; item = item->next)
		if (cJSON_IsString(item))
			add_words(cell, item->valuestring);
}

void cell_number(struct batch_columns *columns, size_t i, const cJSON *value)
{
	columns->cell[i].number = cJSON_IsNumber(value) ? value->valuedouble
	                          : cJSON_IsBool(value) ? (double)cJSON_IsTrue(value)
	                                                : (double)NAN;
}

void batch_columns_fill(struct batch_columns *columns, const cJSON *object)
{
	int place = -1;
	const cJSON *home = NULL;

	for (size_t i = 0; i < columns->count; i++) {
		const cJSON *value;

		if (columns->quantity[i] == NULL)
			continue;
		if (place != (int)columns->place[i]) {
			place = (int)columns->place[i];
			home = at_path(object, quantity_homes[place].path);
		}
		value = cJSON_GetObjectItemCaseSensitive(home, columns->quantity[i]->key);
		if (columns->column[i].kind == TABLE_WORDS)
			cell_words(columns, i, value);
		else
			cell_number(columns, i, value);
	}
}
