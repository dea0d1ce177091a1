/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/number.h"
#include "common/scenes/scene.h"
#include "common/plain.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/scenes/settings.h"

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

const char *const scene_fitted[SCENE_FITTED] = {"stiffness_n_m15",  "restitution",   "balance_angle_deg",
                                                "tangential_ratio", "stiffness_n_m", "softening",
                                                "softening_strain", "damping_n_s_m", "s1_yaw_deg"};

/* May be the word CORNER: whoever needs the number predicts it (host/model/corner.h), none has no meaning. */
#define CORNER "corner"
static bool by_corner(const struct key *key)
{
	return key->offset == offsetof(struct scene, contact_stiffness_n_m15) ||
	       key->offset == offsetof(struct scene, contact_duration_s);
}

static double *scene_value_of(struct scene *scene, const struct key *key)
{
	return (double *)(void *)((char *)scene + key->offset);
}

static double value_in(const struct scene *scene, const struct key *key)
{
	return *(const double *)(const void *)((const char *)scene + key->offset);
}

struct reading {
	struct settings settings;
	struct scene scene;
	int line_of[KEYS]; /* 0 = not given */
	int name_line;
};

static int scene_read_text(struct reading *reading, const char *name, const char *value)
{
	struct settings *settings = &reading->settings;
	char *to = strcmp(name, "name") == 0 ? reading->scene.name : reading->scene.title;
	size_t room = to == reading->scene.name ? sizeof(reading->scene.name) : sizeof(reading->scene.title);

	if (strcmp(name, "name") != 0 && strcmp(name, "title") != 0)
		return settings_fail(
		        settings, DT_E_FORMAT,
		        "unknown key '%.60s', expected name, title or chain before the first section", name);
	if (value[0] == '\0' || strlen(value) >= room)
		return settings_fail(settings, DT_E_FORMAT, "%.60s is empty or too long", name);
	if (!plain_is_line(value, strlen(value)))
		return settings_fail(
		        settings, DT_E_FORMAT,
		        "%.60s has a control character or is no UTF-8, expected one line of text", name);
	memcpy(to, value, strlen(value) + 1);
	if (to == reading->scene.name)
		reading->name_line = settings->line;
	return 1;
}

size_t scene_chain_file(const char **list)
{
	size_t length;

	*list += strspn(*list, " ,");
	length = strcspn(*list, ",");
	while (length > 0 && (*list)[length - 1] == ' ')
		length--;
	return length;
}

/* Behind those that are there. */
static int scene_add_chain(struct scene *scene, const char *list, const char *beside)
{
	const char *slash = strrchr(beside, '/'), *at = list;
	int folder = slash != NULL ? (int)(slash + 1 - beside) : 0;
	char *chain = scene->chain, name[PATH_MAX], whole[PATH_MAX];
	size_t room = sizeof(scene->chain), before = strlen(chain), used = before, length;

	while (used < room && (length = scene_chain_file(&at)) > 0) {
		snprintf(name, sizeof(name), "%.*s%.*s", at[0] != '/' ? folder : 0, beside, (int)length, at);
		used += (size_t)snprintf(chain + used, room - used, "%s%s", used > 0 ? "," : "",
		                         realpath(name, whole) != NULL ? whole : name);
		at += length;
	}
	if (used > before && used < room && plain_is_line(list, strlen(list)))
		return 0;
	chain[0] = '\0';
	return DT_E_FORMAT;
}

int scene_set_chain(struct scene *scene, const char *list, const char *beside)
{
	scene->chain[0] = '\0';
	return scene_add_chain(scene, list, beside);
}

/* Those without a folder lie beside the scene. */
static int scene_read_chain(struct reading *reading, const char *value)
{
	if (scene_add_chain(&reading->scene, value, reading->settings.file) == 0)
		return 1;
	return settings_fail(&reading->settings, DT_E_FORMAT,
	                     "chain is '%.60s', expected names of sensor files", value);
}

static int scene_read_number(struct reading *reading, size_t index, const char *text)
{
	struct settings *settings = &reading->settings;
	const struct key *key = &keys[index];
	double any;

	if (reading->line_of[index] != 0)
		return settings_fail(settings, DT_E_FORMAT, "%.60s is given twice", key->name);
	reading->line_of[index] = settings->line;
	if (by_corner(key) && strcmp(text, CORNER) == 0) {
		*scene_value_of(&reading->scene, key) = (double)NAN;
		return 1;
	}
	if (!number_read(text, -INFINITY, INFINITY, &any) && strcasecmp(text, "nan") != 0)
		return settings_fail(settings, DT_E_FORMAT, "%.60s = '%.60s' is not a number", key->name,
		                     text);
	if (!number_read(text, key->min, key->max, scene_value_of(&reading->scene, key)))
		return settings_fail(settings, DT_E_RANGE, "%.60s is %.60s, expected %g to %g", key->name,
		                     text, key->min, key->max);
	return 1;
}

/* "u r1 r2 ..." */
static int scene_read_fitted(struct reading *reading, const char *name, const char *text)
{
	size_t row = 0, n = 0;
	double value[SCENE_FITTED];
	char *end;

	while (row < SCENE_FITTED && strcmp(name, scene_fitted[row]) != 0)
		row++;
	if (row == SCENE_FITTED)
		return settings_fail(&reading->settings, DT_E_FORMAT, "unknown key '%.60s' in [fit]", name);
	for (const char *at = text; n <= row; n++, at = end) {
		value[n] = strtod(at, &end);
		if (end == at || !(n == 0 ? value[n] >= 0.0 && value[n] < 1e6 : fabs(value[n]) <= 1.0))
			break;
		if (n == row && end[strspn(end, " \t")] != '\0')
			break;
	}
	if (n != row + 1)
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "%.60s is '%.60s', expected an uncertainty and %zu correlations", name,
		                     text, row);
	reading->scene.fitted_u[row] = value[0];
	for (size_t i = 0; i < row; i++)
		reading->scene.fitted_correlation[row][i] = reading->scene.fitted_correlation[i][row] =
		        value[i + 1];
	reading->scene.fitted_correlation[row][row] = 1.0;
	return 1;
}

static int scene_read_limit(struct reading *reading, const char *name, const char *value)
{
	char *limits = reading->scene.limits;
	size_t used = strlen(limits);
	int more = snprintf(limits + used, sizeof(reading->scene.limits) - used, "%d:%s=%s\n",
	                    reading->settings.line, name, value);

	if (!plain_is_line(value, strlen(value)))
		return settings_fail(&reading->settings, DT_E_FORMAT, "%.60s is no line of UTF-8 text", name);
	if (used + (size_t)more >= sizeof(reading->scene.limits))
		return settings_fail(&reading->settings, DT_E_FORMAT, "[limits] is longer than %d characters",
		                     SCENE_LIMITS_MAX);
	return 1;
}

static int scene_read_entry(struct settings *settings, const char *section, const char *name,
                            const char *value)
{
	struct reading *reading = (struct reading *)settings;
	int known_section = 0;

	if (section[0] == '\0' && strcmp(name, "chain") == 0)
		return scene_read_chain(reading, value);
	if (section[0] == '\0')
		return scene_read_text(reading, name, value);
	if (strcmp(section, "fit") == 0)
		return scene_read_fitted(reading, name, value);
	if (strcmp(section, "limits") == 0)
		return scene_read_limit(reading, name, value);
	for (size_t i = 0; i < KEYS; i++) {
		if (strcmp(section, keys[i].section) != 0)
			continue;
		known_section = 1;
		if (strcmp(name, keys[i].name) == 0)
			return scene_read_number(reading, i, value);
	}
	if (!known_section)
		return settings_fail(settings, DT_E_FORMAT, "unknown section [%.60s]", section);
	return settings_fail(settings, DT_E_FORMAT, "unknown key '%.60s' in [%.60s]", name, section);
}

/* Left out, it is placed by the height. */
static bool by_height(const struct key *key)
{
	return key->initial == 0.0 && strcmp(key->section, "tower") == 0;
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

/* What is changed after reading leaves the drop alone in which the contact time was measured. */
static void scene_of_contact_time(struct scene *scene)
{
	if (scene->contact_duration_height_m == 0.0)
		scene->contact_duration_height_m = scene->drop_height_m;
	if (scene->contact_mass_kg == 0.0)
		scene->contact_mass_kg = scene->product_case_mass_kg;
}

static int scene_complete(struct reading *reading)
{
	const struct settings *settings = &reading->settings;

	for (size_t i = 0; i < KEYS; i++) {
		if (reading->line_of[i] != 0)
			continue;
		if (isnan(keys[i].initial))
			return settings_refuse(settings, DT_E_FORMAT, "[%s] %s is missing", keys[i].section,
			                       keys[i].name);
		*scene_value_of(&reading->scene, &keys[i]) = keys[i].initial;
	}
	if (reading->name_line == 0)
		return settings_refuse(settings, DT_E_FORMAT, "name is missing");
	if (reading->scene.title[0] == '\0')
		memcpy(reading->scene.title, reading->scene.name, sizeof(reading->scene.name));
	scene_of_contact_time(&reading->scene);
	place_tower(&reading->scene);
	return scene_check(&reading->scene, settings->file, settings->message);
}

int scene_read(struct scene *scene, const char *file, char message[SCENE_MESSAGE_MAX])
{
	struct reading reading = {.settings = {.file = file, .message = message, .entry = scene_read_entry}};
	int result = settings_read(&reading.settings);

	if (result == DT_E_SYSTEM) {
		size_t said = strlen(message);

		snprintf(message + said, SCENE_MESSAGE_MAX - said, ", expected a scene file");
	}
	if (result == 0)
		result = scene_complete(&reading);
	if (result == 0)
		*scene = reading.scene;
	return result;
}

static void scene_write_fitted(const struct scene *scene, FILE *out)
{
	fputs("\n[fit]\n", out);
	for (size_t i = 0; i < SCENE_FITTED; i++) {
		if (!(scene->fitted_u[i] > 0.0))
			continue;
		fprintf(out, "%s = %.6g", scene_fitted[i], scene->fitted_u[i]);
		for (size_t j = 0; j < i; j++)
			fprintf(out, " %.6f", scene->fitted_correlation[i][j]);
		fputc('\n', out);
	}
}

/* Each without its line's number; what goes on in a further line is a key again. */
static void scene_write_limits(const struct scene *scene, FILE *out)
{
	fputs("\n[limits]\n", out);
	for (const char *at = scene->limits; *at != '\0'; at = strchr(at, '\n') + 1) {
		const char *key = strchr(at, ':') + 1, *value = strchr(key, '=') + 1;

		fprintf(out, "%.*s = %.*s\n", (int)(value - 1 - key), key, (int)strcspn(value, "\n"), value);
	}
}

void scene_write(const struct scene *scene, FILE *out)
{
	struct scene placed = *scene;
	const char *section = "";
	bool fitted = false;
	size_t length;

	placed.tower_separation_m = placed.tower_dampers_m = 0.0;
	placed.tower_gate_lower_m = placed.tower_gate_upper_m = 0.0;
	place_tower(&placed);
	fprintf(out, "; SPDX-License-Identifier: GPL-3.0-or-later\nname = %s\ntitle = %s\n", scene->name,
	        scene->title);
	for (const char *at = scene->chain; (length = scene_chain_file(&at)) > 0; at += length)
		fprintf(out, "chain = %.*s\n", (int)length, at);
	for (size_t i = 0; i < KEYS; i++) {
		double value = value_in(scene, &keys[i]);

		if (value == keys[i].initial || (by_height(&keys[i]) && value == value_in(&placed, &keys[i])))
			continue;
		if (strcmp(section, keys[i].section) != 0)
			fprintf(out, "\n[%s]\n", keys[i].section);
		section = keys[i].section;
		if (isnan(value))
			fprintf(out, "%s = " CORNER "\n", keys[i].name);
		else
			fprintf(out, "%s = %.10g\n", keys[i].name, value);
	}
	for (size_t i = 0; i < SCENE_FITTED; i++)
		fitted = fitted || scene->fitted_u[i] > 0.0;
	if (fitted)
		scene_write_fitted(scene, out);
	if (scene->limits[0] != '\0')
		scene_write_limits(scene, out);
}

void scene_limits(const char *section, const char *key, double *min, double *max)
{
	*min = *max = (double)NAN;
	for (size_t i = 0; i < KEYS; i++) {
		if (strcmp(keys[i].section, section) != 0 || strcmp(keys[i].name, key) != 0)
			continue;
		*min = keys[i].min;
		*max = keys[i].max;
	}
}

/* What must hold between keys; the text says it as a person would. */
static const char *contradiction_of_tower(const struct scene *scene)
{
	if (isnan(scene->contact_stiffness_n_m15))
		return "the contact is '" CORNER "', which only predictions take: expected numbers for "
		       "duration_s and stiffness_n_m15";
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
	return NULL;
}

static const char *contradiction(const struct scene *scene)
{
	if (isnan(scene->contact_stiffness_n_m15) != isnan(scene->contact_duration_s))
		return "a predicted contact is whole, expected duration_s and stiffness_n_m15 both '" CORNER
		       "' or neither";
	for (size_t i = 0; i < SCENE_FITTED && isnan(scene->contact_stiffness_n_m15); i++)
		if (scene->fitted_u[i] > 0.0)
			return "the contact is '" CORNER "', expected no [fit], which is of another contact";
	if (scene->mount_plate_mass_kg > 0.0 &&
	    !(scene->mount_stiffness_n_m > 0.0 && scene->mount_cube_m > 0.0))
		return "a plate needs mounts, expected stiffness_n_m and cube_m above 0";
	if (!(scene->product_width_m <= scene->product_length_m))
		return "X runs along the length, expected width_m <= length_m";
	return NULL;
}

/* wrong: NULL, nothing is. */
static int scene_say(const char *wrong, const char *where, char message[SCENE_MESSAGE_MAX])
{
	if (wrong != NULL)
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s: %s", where, wrong);
	return wrong != NULL ? DT_E_RANGE : 0;
}

int scene_check_tower(const struct scene *scene, const char *where, char message[SCENE_MESSAGE_MAX])
{
	return scene_say(contradiction_of_tower(scene), where, message);
}

int scene_check(const struct scene *scene, const char *where, char message[SCENE_MESSAGE_MAX])
{
	int result = scene_say(contradiction(scene), where, message);

	if (result != 0)
		return result;
	for (size_t i = 0; i < KEYS; i++) {
		double value = value_in(scene, &keys[i]);

		if ((value >= keys[i].min && value <= keys[i].max) || by_height(&keys[i]) ||
		    (by_corner(&keys[i]) && isnan(value)))
			continue;
		snprintf(message, SCENE_MESSAGE_MAX, "%.300s: %s is %g, expected %g to %g", where,
		         keys[i].name, value, keys[i].min, keys[i].max);
		return DT_E_RANGE;
	}
	return 0;
}
