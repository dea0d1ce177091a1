/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Scenes at their limits: each contradiction by itself, texts of every length, places of the tower given or
 * not.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/scenes/scene.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static char message[SCENE_MESSAGE_MAX];

static struct scene good(void)
{
	struct scene scene;

	assert_int_equal(scene_read(&scene, "common/scenes/geometry-2A.ini", message), 0);
	return scene;
}

static void contradicts(const struct scene *scene, const char *says)
{
	assert_int_equal(scene_check(scene, "here", message), DT_E_RANGE);
	if (strncmp(message, "here: ", 6) != 0 || strstr(message, says) == NULL)
		fail_msg("\"%s\" does not say \"%s\"", message, says);
}

/* A product all the same, for who runs no drop. */
static void no_tower(const struct scene *scene, const char *says)
{
	assert_int_equal(scene_check(scene, "here", message), 0);
	assert_int_equal(scene_check_tower(scene, "here", message), DT_E_RANGE);
	if (strncmp(message, "here: ", 6) != 0 || strstr(message, says) == NULL)
		fail_msg("\"%s\" does not say \"%s\"", message, says);
}

static void each_contradiction_is_said(void **state)
{
	struct scene scene = good();

	(void)state;
	scene.tower_gate_lower_m = scene.tower_separation_m;
	no_tower(&scene, "gate_lower_m < separation_m");
	scene = good();
	scene.tower_gate_upper_m = scene.tower_gate_lower_m;
	no_tower(&scene, "gate_upper_m < gate_lower_m");
	scene = good();
	scene.tower_separation_m = scene.tower_dampers_m;
	assert_int_equal(scene_check_tower(&scene, "here", message), 0); /* at the same travel is in time */
	scene.tower_dampers_m -= 0.001;
	no_tower(&scene, "separation_m <= dampers_m");
	scene = good();
	scene.tower_dampers_m = scene.drop_height_m;
	no_tower(&scene, "dampers_m < height_m");
	scene = good();
	scene.product_length_m = scene.product_width_m;
	assert_int_equal(scene_check(&scene, "here", message), 0); /* a square is both */
	scene.product_width_m += 0.001;
	contradicts(&scene, "width_m <= length_m");
	scene = good();
	scene.mount_cube_m = 0;
	contradicts(&scene, "a plate needs mounts");
	scene.mount_plate_mass_kg = scene.mount_stiffness_n_m = 0; /* no plate, no mounts */
	assert_int_equal(scene_check(&scene, "here", message), 0);
	scene.drop_angle_deg = 80.5;
	contradicts(&scene, "angle_deg is 80.5, expected 10 to 80");
}

/* Geometry 2A with its name and title in other words, and more lines at its end. */
static int read_with(struct scene *scene, const char *head, const char *tail)
{
	char file[SCRATCH_MAX], line[256];
	FILE *in = fopen("common/scenes/geometry-2A.ini", "r"),
	     *out = fdopen(mkstemp(scratch_name(file, "scene")), "w");
	int result;

	assert_non_null(in);
	assert_non_null(out);
	fputs(head, out);
	while (fgets(line, sizeof(line), in) != NULL)
		if (strncmp(line, "name", 4) != 0 && strncmp(line, "title", 5) != 0)
			fputs(line, out);
	fputs(tail, out);
	fclose(in);
	fclose(out);
	result = scene_read(scene, file, message);
	unlink(file);
	return result;
}

static void texts_fit_or_are_refused(void **state)
{
	struct scene scene;
	char head[200], name[64];

	(void)state;
	memset(name, 'x', sizeof(name));
	snprintf(head, sizeof(head), "name = %.63s\n", name);
	assert_int_equal(read_with(&scene, head, ""), 0);
	assert_int_equal(strlen(scene.name), 63);
	assert_string_equal(scene.title, scene.name); /* where none is given */
	snprintf(head, sizeof(head), "name = %.64s\n", name);
	assert_int_equal(read_with(&scene, head, ""), DT_E_FORMAT);
	assert_non_null(strstr(message, ":1: name is empty or too long"));
	assert_int_equal(read_with(&scene, "name = a\ntitle =\n", ""), DT_E_FORMAT);
	assert_non_null(strstr(message, ":2: title is empty or too long"));
}

static void places_that_are_given_stay(void **state)
{
	struct scene scene;

	(void)state;
	assert_int_equal(read_with(&scene, "name = a\n",
	                           "[tower]\ngate_upper_m = 0.1\ngate_lower_m = 0.5\nseparation_m = 0.7\n"
	                           "dampers_m = 0.75\n"),
	                 0);
	assert_near(scene.tower_gate_upper_m, 0.1, 1e-12);
	assert_near(scene.tower_gate_lower_m, 0.5, 1e-12);
	assert_near(scene.tower_separation_m, 0.7, 1e-12);
	assert_near(scene.tower_dampers_m, 0.75, 1e-12);
}

/* Geometry 2A's text without the lines that begin with one of two keys. */
static void read_without(struct scene *scene, const char *one, const char *two)
{
	char file[SCRATCH_MAX], line[256];
	FILE *in = fopen("common/scenes/geometry-2A.ini", "r"),
	     *out = fdopen(mkstemp(scratch_name(file, "scene")), "w");

	assert_non_null(in);
	assert_non_null(out);
	while (fgets(line, sizeof(line), in) != NULL)
		if (strncmp(line, one, strlen(one)) != 0 && strncmp(line, two, strlen(two)) != 0)
			fputs(line, out);
	fclose(in);
	fclose(out);
	assert_int_equal(scene_read(scene, file, message), 0);
	unlink(file);
}

/* The drop in which the contact time was measured: as given, else the scene's own as read; written and read
 * again it stays, whatever has become of height and mass. */
static void the_drop_of_the_contact_time_stays(void **state)
{
	struct scene scene = good();
	char file[SCRATCH_MAX];
	FILE *out;

	(void)state;
	assert_true(scene.contact_duration_height_m == 0.894 && scene.contact_mass_kg == 0.173);
	read_without(&scene, "duration_height_m", "mass_kg");
	assert_true(scene.contact_duration_height_m == 0.894 && scene.contact_mass_kg == 0.169);
	scene.drop_height_m = 1.2;
	scene.product_case_mass_kg = 0.5;
	out = fdopen(mkstemp(scratch_name(file, "scene")), "w");
	assert_non_null(out);
	scene_write(&scene, out);
	fclose(out);
	memset(&scene, 0, sizeof(scene));
	assert_int_equal(scene_read(&scene, file, message), 0);
	unlink(file);
	assert_true(scene.drop_height_m == 1.2 && scene.product_case_mass_kg == 0.5);
	assert_true(scene.contact_duration_height_m == 0.894 && scene.contact_mass_kg == 0.169);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(each_contradiction_is_said),
	        cmocka_unit_test(texts_fit_or_are_refused),
	        cmocka_unit_test(places_that_are_given_stay),
	        cmocka_unit_test(the_drop_of_the_contact_time_stays),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
