/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Scenes: the three of the study as the paper gives them, what is derived, and every kind of mistake named
 * by file and line.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/scenes/scene.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static char message[SCENE_MESSAGE_MAX];

static void the_products_of_the_study(void **state)
{
	struct scene g1, a, b;

	(void)state;
	assert_int_equal(scene_read(&g1, "common/scenes/geometry-1.ini", message), 0);
	assert_int_equal(scene_read(&a, "common/scenes/geometry-2A.ini", message), 0);
	assert_int_equal(scene_read(&b, "common/scenes/geometry-2B.ini", message), 0);
	assert_string_equal(a.name, "geometry-2A");
	/* box 165 g, sensors 4 g each, plate 10 g */
	assert_near(g1.product_case_mass_kg, 0.165 + 2 * 0.004, 1e-12);
	assert_near(a.product_case_mass_kg + a.mount_plate_mass_kg, 0.165 + 2 * 0.004 + 0.010, 1e-12);
	assert_near(g1.mount_plate_mass_kg, 0.0, 0.0);
	assert_near(b.mount_stiffness_n_m / a.mount_stiffness_n_m, 5.0 / 3.0,
	            1e-12); /* cubes of 5 and 3 mm */
	assert_near(b.drop_height_m, 0.894, 1e-12);
	assert_near(b.product_length_m, 0.289, 1e-12);
	assert_near(b.product_balance_angle_deg, 25.0, 1e-12);
	assert_near(b.sensor_s2_offset_m, 0.065, 1e-12);
}

static void the_tower_follows_the_height(void **state)
{
	struct scene scene;

	(void)state;
	assert_int_equal(scene_read(&scene, "common/scenes/geometry-2A.ini", message), 0);
	assert_near(scene.tower_gate_upper_m, 0.200, 1e-12);
	assert_near(scene.tower_gate_lower_m, 0.700, 1e-12);
	assert_near(scene.tower_separation_m, 0.780, 1e-12);
	assert_near(scene.tower_dampers_m, 0.800, 1e-12);
	assert_near(scene.tower_magnet_dropout_s, 0.008, 1e-12);
}

/* The scene of geometry 2A with the first line that begins with key put in other words. */
static int read_changed(const char *key, const char *line, char name[64])
{
	char text[256];
	FILE *in = fopen("common/scenes/geometry-2A.ini", "r"), *out;
	struct scene scene;
	int descriptor, result, done = 0;

	assert_non_null(in);
	descriptor = mkstemp(scratch_name(name, "scene"));
	assert_true(descriptor >= 0);
	out = fdopen(descriptor, "w");
	assert_non_null(out);
	while (fgets(text, sizeof(text), in) != NULL) {
		int hit = !done && strncmp(text, key, strlen(key)) == 0;

		fputs(hit ? line : text, out);
		if (hit && line[0] != '\0')
			fputc('\n', out);
		done |= hit;
	}
	fclose(in);
	fclose(out);
	message[0] = '\0';
	result = scene_read(&scene, name, message);
	unlink(name);
	return result;
}

static void mistakes_are_named_by_line(void **state)
{
	static const struct {
		const char *key, *line;
		int result, at; /* at: line of the file, 0 = none */
		const char *says;
	} cases[] = {
	        {"cube_m", "cubes_m = 0.003", DT_E_FORMAT, 38, "unknown key 'cubes_m' in [mount]"},
	        {"[mount]", "[mounts]", DT_E_FORMAT, 34, "unknown section [mounts]"},
	        {"restitution", "restitution = 1.5", DT_E_RANGE, 22,
	         "restitution is 1.5, expected 1e-06 to 1"},
	        {"restitution", "restitution = nan", DT_E_RANGE, 22, "expected 1e-06 to 1"},
	        {"restitution", "restitution = inf", DT_E_RANGE, 22, "expected 1e-06 to 1"},
	        {"restitution", "restitution = half", DT_E_FORMAT, 22, "'half' is not a number"},
	        {"restitution", "restitution = 0.5 m", DT_E_FORMAT, 22, "is not a number"},
	        {"restitution", "restitution", DT_E_FORMAT, 22, "not a [section] or key = value"},
	        {"restitution", "duration_s = 0.002", DT_E_FORMAT, 22, "duration_s is given twice"},
	        {"height_m", "", DT_E_FORMAT, 0, "[drop] height_m is missing"},
	        {"angle_deg", "angle_deg = 95", DT_E_RANGE, 8, "angle_deg is 95, expected 10 to 80"},
	        {"name", "title = again", DT_E_FORMAT, 0, "name is missing"},
	        {"name", "colour = red", DT_E_FORMAT, 3, "unknown key 'colour'"},
	        {"stiffness_n_m ", "stiffness_n_m = 0", DT_E_RANGE, 0, "a plate needs mounts"},
	        {"range_g", "range_g = 2000", DT_E_RANGE, 46, "range_g"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		char name[64], where[96];

		assert_int_equal(read_changed(cases[i].key, cases[i].line, name), cases[i].result);
		snprintf(where, sizeof(where), cases[i].at > 0 ? "%s:%d: " : "%s: ", name, cases[i].at);
		if (strncmp(message, where, strlen(where)) != 0 || strstr(message, cases[i].says) == NULL)
			fail_msg("'%s' does not begin with '%s' and say '%s'", message, where, cases[i].says);
	}
}

/* What would make a model divide by zero or take a root of nothing is refused on reading, by the key's name.
 */
static void degenerate_values_are_refused(void **state)
{
	static const char *const lines[] = {
	        "height_m = 0",          "height_m = nan",         "angle_deg = 0",
	        "angle_deg = 90",        "angle_deg = inf",        "case_mass_kg = 0",
	        "case_mass_kg = -1",     "length_m = 0",           "width_m = 0",
	        "balance_angle_deg = 0", "case_damping_ratio = 1", "duration_s = 0",
	        "duration_s = nan",      "mass_kg = -1",           "restitution = 0",
	        "restitution = -0.5",    "restitution = 1.01",     "stiffness_n_m15 = 0",
	        "friction = -0.1",       "mat_thickness_m = 0",    "corner_radius_m = 0",
	        "case_modulus_pa = 0",   "case_poisson = 0.51",    "mat_modulus_pa = inf",
	        "mat_poisson = -0.1",    "plate_mass_kg = -1",     "damping_ratio = -0.1",
	        "damping_n_s_m = nan",   "softening_strain = 0",   "s2_offset_m = nan",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(lines) / sizeof(lines[0]); i++) {
		char name[64], key[64];

		snprintf(key, sizeof(key), "%.*s ", (int)strcspn(lines[i], " "), lines[i]);
		if (read_changed(key, lines[i], name) != DT_E_RANGE || strstr(message, key) == NULL)
			fail_msg("'%s': '%s'", lines[i], message);
	}
}

static void a_file_that_is_not_there(void **state)
{
	struct scene scene = {.name = "untouched"};

	(void)state;
	assert_int_equal(scene_read(&scene, "common/scenes/none.ini", message), DT_E_SYSTEM);
	assert_string_equal(message,
	                    "common/scenes/none.ini: No such file or directory, expected a scene file");
	assert_string_equal(scene.name, "untouched");
}

static void values_changed_after_reading_are_checked_too(void **state)
{
	struct scene scene;

	(void)state;
	assert_int_equal(scene_read(&scene, "common/scenes/geometry-2B.ini", message), 0);
	assert_int_equal(scene_check(&scene, "--angle", message), 0);
	scene.drop_angle_deg = 5.0;
	assert_int_equal(scene_check(&scene, "--angle", message), DT_E_RANGE);
	assert_string_equal(message, "--angle: angle_deg is 5, expected 10 to 80");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(the_products_of_the_study),
	        cmocka_unit_test(the_tower_follows_the_height),
	        cmocka_unit_test(mistakes_are_named_by_line),
	        cmocka_unit_test(degenerate_values_are_refused),
	        cmocka_unit_test(a_file_that_is_not_there),
	        cmocka_unit_test(values_changed_after_reading_are_checked_too),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
