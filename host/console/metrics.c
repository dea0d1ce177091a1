/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/metrics.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/text.h"

static const char *number_kind(const char *group)
{
	return strcmp(group, "counters") == 0 || strcmp(group, "lost") == 0 ? "counter" : "gauge";
}

static void write_label(FILE *out, const char *name, const char *value, const char *before)
{
	fprintf(out, "%s%s=\"", before, name);
	for (; *value; value++) {
		if (*value == '\\' || *value == '"')
			fputc('\\', out);
		if (*value == '\n')
			fputs("\\n", out);
		else
			fputc(*value, out);
	}
	fputc('"', out);
}

/* The number or yes-no of a place; false for anything else. */
static bool metrics_value(const cJSON *item, double *value)
{
	*value = cJSON_IsNumber(item) ? item->valuedouble : cJSON_IsTrue(item) ? 1 : 0;
	return cJSON_IsNumber(item) || cJSON_IsBool(item);
}

/* The texts of a thing, but the places where none is told. */
static void write_info(FILE *out, const char *group, const cJSON *object)
{
	const char *before = "{";
	const cJSON *item;

	cJSON_ArrayForEach(item, object)
	{
		if (!cJSON_IsString(item) || item->valuestring[0] == '\0')
			continue;
		if (before[0] == '{')
			fprintf(out, "# TYPE droptower_%s%sinfo gauge\ndroptower_%s%sinfo", group,
			        group[0] ? "_" : "", group, group[0] ? "_" : "");
		write_label(out, item->string, item->valuestring, before);
		before = ",";
	}
	if (before[0] == ',')
		fputs("} 1\n", out);
}

static void write_numbers(FILE *out, const char *group, const cJSON *object)
{
	const char *kind = number_kind(group), *ending = strcmp(kind, "counter") == 0 ? "_total" : "";
	const cJSON *item;
	double value;

	cJSON_ArrayForEach(item, object) if (metrics_value(item, &value))
	        fprintf(out, "# TYPE droptower_%s_%s%s %s\ndroptower_%s_%s%s %.17g\n", group, item->string,
	                ending, kind, group, item->string, ending, value);
}

/* Things of one kind: the first number or yes-no of each, by its name. */
static void write_list(FILE *out, const char *group, const cJSON *list)
{
	const char *told = NULL;
	const cJSON *thing, *item;
	double value;

	cJSON_ArrayForEach(thing, list)
	{
		const cJSON *name = cJSON_GetObjectItem(thing, "name");

		cJSON_ArrayForEach(item, thing)
		{
			if (!cJSON_IsString(name) || !metrics_value(item, &value))
				continue;
			if (told == NULL)
				fprintf(out, "# TYPE droptower_%s_%s gauge\n", group, item->string);
			told = item->string;
			fprintf(out, "droptower_%s_%s", group, item->string);
			write_label(out, "name", name->valuestring, "{");
			fprintf(out, "} %.17g\n", value);
		}
	}
}

char *metrics_text(const cJSON *state, size_t *size)
{
	struct text text;
	const cJSON *item;

	if (state == NULL || text_open(&text) != 0)
		return NULL;
	write_info(text.out, "", state);
	cJSON_ArrayForEach(item, state)
	{
		if (cJSON_IsArray(item))
			write_list(text.out, item->string, item);
		if (!cJSON_IsObject(item))
			continue;
		write_info(text.out, item->string, item);
		write_numbers(text.out, item->string, item);
		write_list(text.out, item->string, cJSON_GetObjectItem(item, "faults"));
	}
	*size = 0;
	if (text_close(&text, 0) != 0)
		return NULL;
	*size = text.size;
	return text.bytes;
}
