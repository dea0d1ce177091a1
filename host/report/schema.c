/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The table of quantities as a JSON Schema of results: what stands where, of which type, what it means.
 */
#include <string.h>

#include "host/base/put.h"
#include "host/report/report.h"
#include "host/result/quantity.h"

/* object[key], made when it is not there. */
static cJSON *object_within(struct builder *b, cJSON *object, const char *key)
{
	cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);

	return item ? item : put_object(b, object, key);
}

static void put_type(struct builder *b, cJSON *object, const char *type, bool or_null)
{
	cJSON *types;

	if (!or_null) {
		put_text(b, object, "type", type);
		return;
	}
	types = put_array(b, object, "type");
	if (!cJSON_AddItemToArray(types, cJSON_CreateString(type)) ||
	    !cJSON_AddItemToArray(types, cJSON_CreateString("null")))
		b->failed = true;
}

static void put_enum(struct builder *b, cJSON *object, const char *(*name)(unsigned), bool bits)
{
	cJSON *names = put_array(b, object, "enum");

	for (unsigned i = 0; i < 32 && !b->failed; i++) {
		const char *text = name(bits ? 1u << i : i);

		if (text[0] && !cJSON_AddItemToArray(names, cJSON_CreateString(text)))
			b->failed = true;
	}
}

static const char *status_name(unsigned i)
{
	return i <= ESTIMATE_NOT_CONVERGED ? estimate_status_name((enum estimate_status)i) : "";
}

static const char *family_name(unsigned i)
{
	return i < ESTIMATE_FAMILIES ? estimate_family_name((enum estimate_family)i) : "";
}

static void put_property(struct builder *b, cJSON *properties, const struct quantity *q)
{
	cJSON *item = object_within(b, properties, q->key), *items;

	put_text(b, item, "description", q->meaning);
	switch (q->kind) {
	case QUANTITY_YES:
		put_type(b, item, "boolean", false);
		break;
	case QUANTITY_NAME:
		put_type(b, item, "string", false);
		break;
	case QUANTITY_NAMES:
	case QUANTITY_FLAGS:
		put_type(b, item, "array", false);
		items = put_object(b, item, "items");
		put_type(b, items, "string", false);
		if (q->kind == QUANTITY_FLAGS)
			put_enum(b, items, estimate_flag_name, true);
		break;
	case QUANTITY_STATUS:
		put_enum(b, item, status_name, false);
		break;
	case QUANTITY_FAMILY:
		put_enum(b, item, family_name, false);
		break;
	default:
		put_type(b, item, "number", true);
	}
}

/* The schema of the object at a place: "pulse.contact" is contact within pulse. */
static cJSON *schema_at(struct builder *b, cJSON *root, const struct quantity_home *home)
{
	cJSON *node = root;
	const char *path = home->path;

	if (home->array[0]) {
		node = object_within(b, object_within(b, node, "properties"), home->array);
		if (!cJSON_HasObjectItem(node, "type"))
			put_type(b, node, "array", false);
		node = object_within(b, node, "items");
	}
	while (*path) {
		size_t length = strcspn(path, ".");
		char name[40];

		snprintf(name, sizeof(name), "%.*s", (int)length, path);
		node = object_within(b, object_within(b, node, "properties"), name);
		if (!cJSON_HasObjectItem(node, "type"))
			put_type(b, node, "object", !home->array[0]);
		path += length + (path[length] == '.');
	}
	return node;
}

int report_schema(FILE *out)
{
	struct builder b = {.failed = false};
	cJSON *root = cJSON_CreateObject(), *version;

	put_text(&b, root, "$schema", "https://json-schema.org/draft/2020-12/schema");
	put_text(&b, root, "title", "Result of droptower analyze --json, one drop");
	put_type(&b, root, "object", false);
	version = object_within(&b, object_within(&b, root, "properties"), "quantities");
	put_text(&b, version, "description", "version of this table");
	put_text(&b, version, "const", quantity_version());
	put_type(&b, object_within(&b, object_within(&b, root, "properties"), "origin"), "object", false);
	for (int p = 0; p < QUANTITY_PLACES; p++) {
		cJSON *node = schema_at(&b, root, &quantity_homes[p]);
		cJSON *properties = object_within(&b, node, "properties"),
		      *required = put_array(&b, node, "required");
		const struct quantity *q = NULL;

		while ((q = quantity_next(quantity_homes[p].object, q))) {
			put_property(&b, properties, q);
			if (!cJSON_AddItemToArray(required, cJSON_CreateString(q->key)))
				b.failed = true;
		}
	}
	return put_out(&b, root, out);
}
