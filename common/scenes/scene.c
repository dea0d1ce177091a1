/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/scenes/scene.h"

#include <errno.h>
#include <ini.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Where the tower's parts stand when the scene leaves them to the height: the product leaves the frame this
 * far above the mat, the frame meets the dampers this far above it, the lower gate is this far before the
 * separation, and the upper gate at this share of the way to it. */
#define SEPARATION_ABOVE_MAT_M 0.114
#define DAMPERS_ABOVE_MAT_M 0.094
#define LOWER_GATE_BEFORE_SEPARATION_M 0.080
#define UPPER_GATE_SHARE (0.200 / 0.780)

struct key {
	const char *section, *name;
	size_t offset;
	double min, max, initial;
};

static const struct key keys[] = {
#define SCENE_KEY(section, key, min, max, initial, doc) \
	{#section, #key, offsetof(struct scene, section##_##key), min, max, initial},
#include "common/scenes/scene.def"
#undef SCENE_KEY
};
enum { KEYS = sizeof(keys) / sizeof(keys[0]) };

static double *value_of(struct scene *scene, const struct key *key)
{
	return (double *)(void *)((char *)scene + key->offset);
}

static double value_in(const struct scene *scene, const struct key *key)
{
	return *(const double *)(const void *)((const char *)scene + key->offset);
}

struct reading {
	struct scene scene;
	FILE *in;
	const char *file;
	int line;       /* of the text inih looks at */
	int line_begun; /* it came without its end: the next piece belongs to it */
	char *message;
	int result;
	int line_of[KEYS]; /* 0 = not given */
	int name_line;
};

/* fgets for inih that counts the lines: Debian's build does not tell the handler where it is. */
static char *read_line(char *text, int size, void *user)
{
	struct reading *reading = user;

	if (fgets(text, size, reading->in) == NULL)
		return NULL;
	if (!reading->line_begun)
		reading->line++;
	reading->line_begun = strchr(text, '\n') == NULL;
	return text;
}

static int fail(struct reading *reading, int code, const char *format, const char *a, const char *b)
{
	int used = snprintf(reading->message, SCENE_MESSAGE_MAX, "%.300s:%d: ", reading->file, reading->line);

	snprintf(reading->message + used, SCENE_MESSAGE_MAX - (size_t)used, format, a, b);
	reading->result = code;
	return 0; /* inih's word for "stop here" */
}

static int read_text(struct reading *reading, const char *name, const char *value)
{
	char *to = strcmp(name, "name") == 0 ? reading->scene.name : reading->scene.title;
	size_t room = to == reading->scene.name ? sizeof(reading->scene.name) : sizeof(reading->scene.title);

	if (strcmp(name, "name") != 0 && strcmp(name, "title") != 0)
		return fail(reading, DT_E_FORMAT,
		            "unknown key '%.60s', expected name or title before the first section%s", name,
		            "");
	if (value[0] == '\0' || strlen(value) >= room)
		return fail(reading, DT_E_FORMAT, "%.60s is empty or too long%s", name, "");
	memcpy(to, value, strlen(value) + 1);
	if (to == reading->scene.name)
		reading->name_line = reading->line;
	return 1;
}

static int read_number(struct reading *reading, size_t index, const char *text)
{
	const struct key *key = &keys[index];
	char limits[96];
	char *end;
	double value;

	if (reading->line_of[index] != 0)
		return fail(reading, DT_E_FORMAT, "%.60s is given twice%s", key->name, "");
	errno = 0;
	value = strtod(text, &end);
	if (end == text || *end != '\0')
		return fail(reading, DT_E_FORMAT, "%.60s = '%.60s' is not a number", key->name, text);
	snprintf(limits, sizeof(limits), "%s, expected %g to %g", text, key->min, key->max);
	if (!(value >= key->min && value <= key->max)) /* NaN fails too */
		return fail(reading, DT_E_RANGE, "%.60s is %.100s", key->name, limits);
	*value_of(&reading->scene, key) = value;
	reading->line_of[index] = reading->line;
	return 1;
}

static int read_entry(void *user, const char *section, const char *name, const char *value)
{
	struct reading *reading = user;
	int known_section = 0;

	if (reading->result != 0)
		return 0;
	if (section[0] == '\0')
		return read_text(reading, name, value);
	for (size_t i = 0; i < KEYS; i++) {
		if (strcmp(section, keys[i].section) != 0)
			continue;
		known_section = 1;
		if (strcmp(name, keys[i].name) == 0)
			return read_number(reading, i, value);
	}
	if (!known_section)
		return fail(reading, DT_E_FORMAT, "unknown section [%.60s]%s", section, "");
	return fail(reading, DT_E_FORMAT, "unknown key '%.60s' in [%.60s]", name, section);
}

static void place_tower(struct scene *scene)
{
	if (scene->tower_separation_m == 0.0)
		scene->tower_separation_m = scene->drop_height_m - SEPARATION_ABOVE_MAT_M;
	if (scene->tower_dampers_m == 0.0)
		scene->tower_dampers_m = scene->drop_height_m - DAMPERS_ABOVE_MAT_M;
	if (scene->tower_gate_lower_m == 0.0)
		scene->tower_gate_lower_m = scene->tower_separation_m - LOWER_GATE_BEFORE_SEPARATION_M;
	if (scene->tower_gate_upper_m == 0.0)
		scene->tower_gate_upper_m = scene->tower_separation_m * UPPER_GATE_SHARE;
}

static int complete(struct reading *reading)
{
	for (size_t i = 0; i < KEYS; i++) {
		if (reading->line_of[i] != 0)
			continue;
		if (isnan(keys[i].initial)) {
			snprintf(reading->message, SCENE_MESSAGE_MAX, "%.300s: [%s] %s is missing",
			         reading->file, keys[i].section, keys[i].name);
			return DT_E_FORMAT;
		}
		*value_of(&reading->scene, &keys[i]) = keys[i].initial;
	}
	if (reading->name_line == 0) {
		snprintf(reading->message, SCENE_MESSAGE_MAX, "%.300s: name is missing", reading->file);
		return DT_E_FORMAT;
	}
	if (reading->scene.title[0] == '\0')
		memcpy(reading->scene.title, reading->scene.name, sizeof(reading->scene.name));
	place_tower(&reading->scene);
	return scene_check(&reading->scene, reading->file, reading->message);
}

int scene_read(struct scene *scene, const char *file, char message[SCENE_MESSAGE_MAX])
{
	struct reading reading = {.file = file, .message = message};
	int result;

	reading.in = fopen(file, "r");
	if (reading.in == NULL) {
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s: %s", file, strerror(errno));
		return DT_E_SYSTEM;
	}
	result = ini_parse_stream(read_line, &reading, read_entry, &reading);
	fclose(reading.in);
	if (reading.result != 0)
		return reading.result;
	if (result != 0) {
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s:%d: not a [section] or key = value", file,
		         result);
		return DT_E_FORMAT;
	}
	result = complete(&reading);
	if (result == 0)
		*scene = reading.scene;
	return result;
}

/* What must hold between keys; the text says it as a person would. */
static const char *contradiction(const struct scene *scene)
{
	if (!(scene->tower_gate_upper_m > 0.0))
		return "the upper gate is above the latch, expected gate_upper_m > 0: is the height too "
		       "small?";
	if (!(scene->tower_gate_upper_m < scene->tower_gate_lower_m))
		return "the gates are not in order, expected gate_upper_m < gate_lower_m";
	if (!(scene->tower_gate_lower_m < scene->tower_separation_m))
		return "the lower gate comes too late, expected gate_lower_m < separation_m";
	if (!(scene->tower_separation_m <= scene->tower_dampers_m))
		return "the frame is braked before the product leaves, expected separation_m <= dampers_m";
	if (!(scene->tower_dampers_m < scene->drop_height_m))
		return "the product lands before the frame is braked, expected dampers_m < height_m";
	if (scene->mount_plate_mass_kg > 0.0 &&
	    !(scene->mount_stiffness_n_m > 0.0 && scene->mount_cube_m > 0.0))
		return "a plate needs mounts, expected stiffness_n_m and cube_m above 0";
	if (!(scene->product_width_m <= scene->product_length_m))
		return "X runs along the length, expected width_m <= length_m";
	return NULL;
}

int scene_check(const struct scene *scene, const char *where, char message[SCENE_MESSAGE_MAX])
{
	const char *wrong = contradiction(scene); /* first: it says more than a derived value out of range */

	if (wrong != NULL) {
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s: %s", where, wrong);
		return DT_E_RANGE;
	}
	for (size_t i = 0; i < KEYS; i++) {
		double value = value_in(scene, &keys[i]);

		if (value >= keys[i].min && value <= keys[i].max)
			continue;
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s: %s is %g, expected %g to %g", where,
		         keys[i].name, value, keys[i].min, keys[i].max);
		return DT_E_RANGE;
	}
	return 0;
}
