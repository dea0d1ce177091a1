/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/columns.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

#include "host/result/said.h"

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

void cell_words(struct batch_columns *columns, size_t i, const cJSON *object, const char *key)
{
	struct cell *cell = &columns->cell[i];

	cell->words = said_words(object, key, cell->text) ? cell->text : NULL;
}

void cell_number(struct batch_columns *columns, size_t i, const cJSON *object, const char *key)
{
	columns->cell[i].number = said_number(object, key);
}

void batch_columns_fill(struct batch_columns *columns, const cJSON *object)
{
	int place = -1;
	const cJSON *home = NULL;

	for (size_t i = 0; i < columns->count; i++) {
		if (columns->quantity[i] == NULL)
			continue;
		if (place != (int)columns->place[i]) {
			place = (int)columns->place[i];
			home = said_path(object, quantity_homes[place].path);
		}
		if (columns->column[i].kind == TABLE_WORDS)
			cell_words(columns, i, home, columns->quantity[i]->key);
		else
			cell_number(columns, i, home, columns->quantity[i]->key);
	}
}
