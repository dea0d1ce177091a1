/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/wire_table.h"
#include "hil/scenario_private.h"

/* ---- pieces of text ---- */

bool scenario_parse_whole(const char *text, unsigned long max, unsigned long *number)
{
	char *end;
	unsigned long value;

	errno = 0;
	value = strtoul(text, &end, 0);
	if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || value > max)
		return false;
	*number = value;
	return true;
}

unsigned scenario_split(char *text, char *words[SCENARIO_WORDS_MAX])
{
	unsigned count = 0;
	char *rest = NULL;

	for (char *word = strtok_r(text, " ,\t", &rest); word != NULL && count < SCENARIO_WORDS_MAX;
	     word = strtok_r(NULL, " ,\t", &rest))
		words[count++] = word;
	return count;
}

int scenario_find(const char *name, unsigned count, const char *(*name_of)(unsigned))
{
	for (unsigned i = 0; i < count; i++)
		if (strcmp(name, name_of(i)) == 0)
			return (int)i;
	return -1;
}

bool scenario_parse_parameter(const char *name, const char *value, struct scenario_parameter *parameter)
{
	unsigned long number;

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		if (strcmp(name, wire_parameters[i].name) != 0)
			continue;
		if (!scenario_parse_whole(value, UINT32_MAX, &number))
			return false;
		*parameter = (struct scenario_parameter){wire_parameters[i].index, (uint32_t)number};
		return true;
	}
	return false;
}

/* ---- [run] [bus] [operator] [scene] [parameters] ---- */

static const struct number {
	const char *section, *name;
	size_t offset;
	double min, max, initial;
} numbers[] = {
#define SCENARIO_NUMBER(section, key, min, max, initial, doc) \
	{#section, #key, offsetof(struct scenario, section##_##key), min, max, initial},
#include "hil/scenario.def"
};
enum { NUMBERS = sizeof(numbers) / sizeof(numbers[0]) };

static double *number_in(struct scenario *scenario, const struct number *number)
{
	return (double *)(void *)((char *)scenario + number->offset);
}

static const struct {
	const char *name;
	size_t offset;
	double min, max;
} scene_keys[] = {
#define SCENE_KEY(section, key, min, max, initial, doc) \
	{#key, offsetof(struct scene, section##_##key), min, max},
#include "common/scenes/scene.def"
#undef SCENE_KEY
};
enum { SCENE_KEYS = sizeof(scene_keys) / sizeof(scene_keys[0]) };

static int fail_number(struct scenario_reading *reading, const char *what, const char *text, double min,
                       double max)
{
	return settings_fail(&reading->settings, DT_E_RANGE,
	                     "%.60s = '%.60s', expected a number from %g to %g", what, text, min, max);
}

static int scenario_read_text(struct scenario_reading *reading, const char *name, const char *value, char *to,
                              size_t size)
{
	if (to[0] != '\0')
		return settings_fail(&reading->settings, DT_E_FORMAT, "%s is given twice", name);
	if (value[0] == '\0' || strlen(value) >= size)
		return settings_fail(&reading->settings, DT_E_FORMAT, "%s is empty or too long", name);
	memcpy(to, value, strlen(value) + 1);
	return 1;
}

static int scenario_read_number(struct scenario_reading *reading, const char *section, const char *name,
                                const char *value)
{
	for (unsigned i = 0; i < NUMBERS; i++) {
		const struct number *number = &numbers[i];

		if (strcmp(section, number->section) != 0 || strcmp(name, number->name) != 0)
			continue;
		if (!number_read(value, number->min, number->max, number_in(&reading->scenario, number)))
			return fail_number(reading, name, value, number->min, number->max);
		return 1;
	}
	return settings_fail(&reading->settings, DT_E_FORMAT, "unknown key '%.60s' in [%.60s]", name,
	                     section);
}

static int read_override(struct scenario_reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;

	for (unsigned i = 0; i < SCENE_KEYS; i++) {
		struct scenario_override *to = &scenario->override[scenario->override_count];

		if (strcmp(name, scene_keys[i].name) != 0)
			continue;
		if (scenario->override_count == SCENARIO_OVERRIDES_MAX)
			return settings_fail(&reading->settings, DT_E_FULL,
			                     "only %d values of the scene can be changed",
			                     SCENARIO_OVERRIDES_MAX);
		if (!number_read(value, scene_keys[i].min, scene_keys[i].max, &to->value))
			return fail_number(reading, name, value, scene_keys[i].min, scene_keys[i].max);
		to->offset = scene_keys[i].offset;
		scenario->override_count++;
		return 1;
	}
	return settings_fail(&reading->settings, DT_E_FORMAT,
	                     "the scene has no '%.60s' (common/scenes/scene.def)", name);
}

static int read_parameter(struct scenario_reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;

	if (scenario->parameter_count == SCENARIO_PARAMETERS_MAX)
		return settings_fail(&reading->settings, DT_E_FULL, "only %d parameters can be written",
		                     SCENARIO_PARAMETERS_MAX);
	if (!scenario_parse_parameter(name, value, &scenario->parameter[scenario->parameter_count]))
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "%.60s = '%.60s', expected a parameter of wire.def and a whole number",
		                     name, value);
	scenario->parameter_count++;
	return 1;
}

/* ---- the file ---- */

static int scenario_read_entry(struct settings *settings, const char *section, const char *name,
                               const char *value)
{
	struct scenario_reading *reading = (struct scenario_reading *)settings;
	struct scenario *scenario = &reading->scenario;

	if (section[0] == '\0' && strcmp(name, "title") == 0)
		return scenario_read_text(reading, name, value, scenario->title, sizeof(scenario->title));
	if (strcmp(section, "run") == 0 && strcmp(name, "scene") == 0)
		return scenario_read_text(reading, name, value, scenario->scene_file,
		                          sizeof(scenario->scene_file));
	if (strcmp(section, "scene") == 0)
		return read_override(reading, name, value);
	if (strcmp(section, "parameters") == 0)
		return read_parameter(reading, name, value);
	if (strcmp(section, "at") == 0)
		return scenario_read_event(reading, name, value);
	if (strcmp(section, "expect") == 0)
		return scenario_read_expectation(reading, name, value);
	if (strcmp(section, "counters") == 0)
		return scenario_read_counter(reading, name, value);
	return scenario_read_number(reading, section, name, value);
}

static int scenario_complete(const struct scenario_reading *reading)
{
	const struct scenario *scenario = &reading->scenario;
	const bool all = scenario->run_safety == 0;
	const char *missing = NULL;

	if (scenario->title[0] == '\0')
		missing = "title";
	else if (scenario->scene_file[0] == '\0')
		missing = "[run] scene";
	else if (all && !scenario->end.given)
		missing = "[expect] end";
	else if (all && !scenario->fault.given)
		missing = "[expect] fault";
	else if (all && !scenario->emcy.given)
		missing = "[expect] emcy";
	else if (all && !scenario->marks.given && !(scenario->result[SCENARIO_captures].max <= 0))
		missing = "[expect] marks";
	return missing == NULL ? 0
	                       : settings_refuse(&reading->settings, DT_E_FORMAT, "%s is missing", missing);
}

int scenario_read(struct scenario *scenario, const char *file, char message[SCENARIO_MESSAGE_MAX])
{
	struct scenario_reading reading = {
	        .settings = {.file = file, .message = message, .entry = scenario_read_entry}};
	int result;

	for (unsigned i = 0; i < NUMBERS; i++)
		*number_in(&reading.scenario, &numbers[i]) = numbers[i].initial;
	scenario_expect_nominal(&reading.scenario);
	result = settings_read(&reading.settings);
	if (reading.scenario.run_safety != 0)
		scenario_expect_safety(&reading.scenario);
	if (result == 0)
		result = scenario_complete(&reading);
	if (result == 0)
		*scenario = reading.scenario;
	return result;
}

int scenario_scene(const struct scenario *scenario, struct scene *scene, char message[SCENE_MESSAGE_MAX])
{
	char where[SCENE_MESSAGE_MAX];
	struct scene wanted;
	int result = scene_read(&wanted, scenario->scene_file, message);

	if (result != 0)
		return result;
	if (!isnan(scenario->run_angle_deg))
		wanted.drop_angle_deg = scenario->run_angle_deg;
	for (unsigned i = 0; i < scenario->override_count; i++)
		*(double *)(void *)((char *)&wanted + scenario->override[i].offset) =
		        scenario->override[i].value;
	snprintf(where, sizeof(where), "%.200s%s", scenario->scene_file,
	         scenario->override_count > 0 ? ", changed by [scene]" : "");
	result = scene_check(&wanted, where, message);
	if (result == 0)
		result = scene_check_tower(&wanted, where, message);
	if (result == 0)
		*scene = wanted;
	return result;
}
