/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/said.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const cJSON *said_path(const cJSON *from, const char *path)
{
	char name[32];

	while (*path != '\0' && from != NULL) {
		size_t length = strcspn(path, ".");

		snprintf(name, sizeof(name), "%.*s", (int)length, path);
		from = cJSON_GetObjectItemCaseSensitive(from, name);
		path += length + (path[length] == '.');
	}
	return from;
}

bool said_at(const cJSON *result, const struct quantity_home *home, int i, struct said *said)
{
	static const char *const keys[] = {"name", "sensor", "what"};
	const cJSON *whose = result, *name = NULL, *at;
	bool listed = home->array[0] != '\0';

	if (listed)
		whose = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(result, home->array), i);
	if (whose == NULL || (!listed && i > 0))
		return false;
	for (size_t k = 0; k < sizeof(keys) / sizeof(keys[0]) && !cJSON_IsString(name); k++)
		name = cJSON_GetObjectItemCaseSensitive(whose, keys[k]);
	at = said_path(whose, home->path);
	*said = (struct said){.object = cJSON_IsObject(at) ? at : NULL,
	                      .subject = listed && cJSON_IsString(name) ? name->valuestring : "",
	                      .null = cJSON_IsNull(at)};
	return true;
}

const cJSON *said_of(const cJSON *result, const struct quantity_home *home, const char *subject)
{
	struct said said;

	for (int i = 0; said_at(result, home, i, &said); i++)
		if (said.object != NULL && strcmp(said.subject, subject) == 0)
			return said.object;
	return NULL;
}

bool said_words(const cJSON *object, const char *key, char text[QUANTITY_TEXT_MAX])
{
	const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key), *flag;
	size_t at = 0;

	text[0] = '\0';
	if (cJSON_IsString(value))
		snprintf(text, QUANTITY_TEXT_MAX, "%s", value->valuestring);
	if (!cJSON_IsArray(value))
		return cJSON_IsString(value);
	cJSON_ArrayForEach(flag, value) if (cJSON_IsString(flag) && at < QUANTITY_TEXT_MAX) at +=
	        (size_t)snprintf(text + at, QUANTITY_TEXT_MAX - at, "%s%s", at > 0 ? " " : "",
	                         flag->valuestring);
	return true;
}

double said_number(const cJSON *object, const char *key)
{
	const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key);

	if (cJSON_IsBool(value))
		return cJSON_IsTrue(value) ? 1.0 : 0.0;
	return cJSON_IsNumber(value) ? value->valuedouble : (double)NAN;
}
