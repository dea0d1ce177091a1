/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The contact that is predicted from a table of finite elements: against elements that are not in it, against
 * a closed form of small strains, against energies summed here; what it does not reach; scenes that ask for
 * it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/units.h"
#include "host/model/body.h"
#include "host/model/corner.h"
#include "host/model/ensemble.h"
#include "host/model/model.h"
#include "host/model/vary.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static char message[SCENE_MESSAGE_MAX];

static struct scene study(void)
{
	struct scene scene;

	assert_int_equal(scene_read(&scene, "common/scenes/geometry-1.ini", message), 0);
	return scene;
}

static struct corner predicted(const struct scene *scene)
{
	struct corner corner;

	if (corner_predict(scene, &corner, message) != 0)
		fail_msg("%s", message);
	return corner;
}

/* Solved, but not part of the table that is interpolated. */
static void between_the_points_of_the_table(void **state)
{
	static const struct {
		double angle_deg, radius, force[CORNER_DEPTHS];
	} apart[] = {
#define LIST(...)           \
	{                   \
		__VA_ARGS__ \
	}
#define CORNER_POINT(angle, radius, force, mesh)
#define CORNER_APART(angle, radius, force, mesh) {angle, radius, force},
#include "host/model/corner.def"
	};

	(void)state;
	for (size_t i = 0; i < sizeof(apart) / sizeof(apart[0]); i++) {
		double force[CORNER_DEPTHS];

		corner_forces(apart[i].angle_deg, apart[i].radius, force);
		for (int k = 0; k < CORNER_DEPTHS; k++)
			assert_near_part(force[k], apart[i].force[k], 0.05);
		corner_forces(90.0 - apart[i].angle_deg, apart[i].radius, force);
		assert_near_part(force[2], apart[i].force[2], 0.05);
	}
}

/* Hertz' line contact on an elastic layer that holds to its floor, r = 2 t, d = t/15. */
static void a_shallow_dent_is_hertz_on_a_layer(void **state)
{
	double force[CORNER_DEPTHS];

	(void)state;
	corner_forces(45.0, 2.0, force);
	assert_near_part(force[0], 0.092556, 0.03);
}

/* Force at any depth, as a power between those of the table. */
static double force_at(const double force[CORNER_DEPTHS], double depth)
{
	int k = (int)fmin(fmax(floor(depth / CORNER_DEPTH_STEP), 1.0), CORNER_DEPTHS - 1.0);

	return force[k - 1] *
	       pow(depth / (k * CORNER_DEPTH_STEP), log(force[k] / force[k - 1]) / log((k + 1.0) / k));
}

/* A ball's worth of energy: all of it with e = 1 at the balance angle, where nothing turns. */
static void the_stiffness_stores_the_fall_s_energy(void **state)
{
	enum { SLICES = 100000 };
	struct scene scene = study();
	double force[CORNER_DEPTHS], stored = 0.0, unit, mat = scene.contact_mat_thickness_m;
	struct corner c;

	(void)state;
	scene.contact_restitution = 1.0;
	scene.contact_mat_modulus_pa = 5e6;
	c = predicted(&scene);
	corner_forces(25.0, 1.5, force);
	unit = 5e6 / (1.0 - 0.499 * 0.499) * 0.021 * mat;
	for (int i = 0; i < SLICES; i++)
		stored += unit * force_at(force, (i + 0.5) / SLICES * c.depth_m / mat) * c.depth_m / SLICES;
	assert_near_part(stored, 0.173 * 9.80665 * 0.894, 1e-4);
	assert_near_part(0.4 * c.stiffness_n_m15 * pow(c.depth_m, 2.5), stored, 1e-4);
	assert_near_part(unit * force_at(force, c.depth_m / mat) / (c.stiffness_n_m15 * pow(c.depth_m, 1.5)),
	                 1.0 + c.misfit, 1e-9);
}

/* Twice the rubber and twice the fall: the same dent, of twice the stiffness. */
static void stiffness_is_as_the_modulus(void **state)
{
	struct scene scene = study();
	struct corner one, two;

	(void)state;
	scene.contact_mat_modulus_pa = 3e6;
	one = predicted(&scene);
	scene.contact_mat_modulus_pa *= 2.0;
	scene.drop_height_m *= 2.0;
	two = predicted(&scene);
	assert_near_part(two.depth_m, one.depth_m, 1e-9);
	assert_near_part(two.stiffness_n_m15, 2.0 * one.stiffness_n_m15, 1e-9);
	assert_near_part(hypot(one.table_u, 0.5), one.relative_u, 1e-12);
}

/* README.md's figures: the study's fitted 3.81e6 beside what its mat's slow modulus predicts. */
static void the_study_s_own_mat(void **state)
{
	struct scene scene = study();
	struct corner slow;

	(void)state;
	slow = predicted(&scene);
	assert_near_part(slow.stiffness_n_m15, 2.722e6, 0.01);
	assert_true(fabs(log(3.81e6 / slow.stiffness_n_m15)) < 2.0 * slow.relative_u);
	scene.contact_mat_modulus_pa = 2.472e6;
	assert_near_part(predicted(&scene).stiffness_n_m15, 3.81e6, 0.01);
}

static void not_reached(double value, double *key, struct scene *scene, const char *says)
{
	double was = *key;
	struct corner c;

	*key = value;
	assert_int_equal(corner_predict(scene, &c, message), DT_E_RANGE);
	if (strstr(message, says) == NULL)
		fail_msg("\"%s\" does not say \"%s\"", message, says);
	*key = was;
}

static void beyond_the_table_the_key_is_named(void **state)
{
	struct scene s = study();

	(void)state;
	not_reached(0.0024, &s.contact_corner_radius_m, &s, "corner_radius_m");
	not_reached(0.0201, &s.contact_corner_radius_m, &s, "corner_radius_m");
	not_reached(0.45, &s.contact_mat_poisson, &s, "mat_poisson");
	not_reached(1e5, &s.contact_mat_modulus_pa, &s, "mat_modulus_pa");
	not_reached(1e9, &s.contact_mat_modulus_pa, &s, "mat_modulus_pa");
}

/* Geometry 1 with some keys in other words, read again. */
static int read_scene(const char *duration, const char *stiffness, struct scene *scene)
{
	char file[SCRATCH_MAX], line[256];
	FILE *in = fopen("common/scenes/geometry-1.ini", "r"),
	     *out = fdopen(mkstemp(scratch_name(file, "scene")), "w");
	int result;

	assert_non_null(in);
	assert_non_null(out);
	while (fgets(line, sizeof(line), in) != NULL)
		if (strncmp(line, "duration_s", 10) == 0)
			fprintf(out, "duration_s = %s\n", duration);
		else if (strncmp(line, "stiffness_n_m15", 15) == 0)
			fprintf(out, "stiffness_n_m15 = %s\n", stiffness);
		else
			fputs(line, out);
	fclose(in);
	fclose(out);
	result = scene_read(scene, file, message);
	unlink(file);
	return result;
}

static void a_scene_may_leave_its_contact_to_it(void **state)
{
	struct scene scene, again, fixed = study();
	struct model_prediction p;
	struct corner c;
	struct contact_law law;
	char file[SCRATCH_MAX];
	FILE *out;

	(void)state;
	assert_int_equal(read_scene("corner", "3.81e6", &scene), DT_E_RANGE);
	assert_int_equal(read_scene("0.003", "corner", &scene), DT_E_RANGE);
	assert_non_null(strstr(message, "both"));
	assert_int_equal(read_scene("nan", "nan", &scene), DT_E_RANGE);
	assert_int_equal(read_scene("corner", "corner", &scene), 0);
	assert_int_equal(scene_check_tower(&scene, "here", message), DT_E_RANGE);
	assert_non_null(strstr(message, "stiffness_n_m15"));
	assert_int_equal(model_solve(&scene, MODEL_AUTO, NULL, &p, message), DT_E_ARGUMENT);
	out = fdopen(mkstemp(scratch_name(file, "scene")), "w");
	assert_non_null(out);
	scene_write(&scene, out);
	fclose(out);
	assert_int_equal(scene_read(&again, file, message), 0);
	unlink(file);
	assert_true(isnan(again.contact_stiffness_n_m15) && isnan(again.contact_duration_s));

	scene.drop_angle_deg = 35.0;
	c = predicted(&scene);
	assert_int_equal(corner_fill(&scene, message), 0);
	assert_near_part(scene.contact_stiffness_n_m15 * sin(UNITS_RAD(50.0)) / sin(UNITS_RAD(70.0)),
	                 c.stiffness_n_m15, 1e-12);
	assert_true(scene.predicted_u == c.relative_u && scene_check_tower(&scene, "here", message) == 0);
	assert_int_equal(contact_law_init(&law, 0.5), 0);
	assert_near_part(
	        contact_stiffness(&law, 0.173, sqrt(2.0 * 9.80665 * 0.894), scene.contact_duration_s),
	        c.stiffness_n_m15, 1e-9);
	assert_int_equal(model_solve(&scene, MODEL_PLANAR, NULL, &p, message), 0);
	assert_near_part(p.stiffness_n_m15, c.stiffness_n_m15, 1e-9);
	assert_int_equal(corner_fill(&fixed, message), 0);
	assert_true(fixed.contact_stiffness_n_m15 == 3.81e6 && fixed.predicted_u == 0.0);
}

/* Changing a scene by name predicts again, to what a scene that has been so from the start would get. */
static void a_changed_scene_is_predicted_again(void **state)
{
	static const struct {
		const char *key;
		double value;
	} changes[] = {{"angle", 15.0},
	               {"contact.mat_thickness_m", 0.012},
	               {"product.thickness_m", 0.03},
	               {"height", 1.1}};
	struct vary_key key;
	struct scene moved;

	(void)state;
	assert_int_equal(read_scene("corner", "corner", &moved), 0);
	assert_int_equal(corner_fill(&moved, message), 0);
	for (size_t i = 0; i < sizeof(changes) / sizeof(changes[0]); i++) {
		struct scene fresh = moved;

		assert_int_equal(vary_find(changes[i].key, &key), 0);
		vary_set(&moved, &key, changes[i].value);
		vary_set(&fresh, &key, changes[i].value);
		fresh.contact_stiffness_n_m15 = fresh.contact_duration_s = (double)NAN;
		assert_int_equal(corner_fill(&fresh, message), 0);
		assert_near_part(moved.contact_stiffness_n_m15, fresh.contact_stiffness_n_m15, 1e-12);
		assert_near_part(moved.contact_duration_s, fresh.contact_duration_s, 1e-12);
	}
	assert_int_equal(vary_find("contact.corner_radius_m", &key), 0);
	vary_set(&moved, &key, 0.001);
	assert_true(isnan(moved.contact_stiffness_n_m15) && isnan(moved.contact_duration_s));
}

/* Peaks are as stiffness^0.4: those of a half-sine exactly, the box's own at the balance angle but for its
 * weight, which is a hundredth of the force. The logarithm of the stiffness is moved by its bar to each side.
 */
static void bars_stand_for_the_predicted_stiffness(void **state)
{
	struct ensemble e = {.fidelity = MODEL_SDOF, .options = model_defaults, .seed = 3};
	struct ensemble_spread spread[ENSEMBLE_OUTPUTS];
	struct model_prediction p;
	struct scene scene;
	double u[ENSEMBLE_OUTPUTS], share;
	size_t box = 0, failed;

	(void)state;
	while (strcmp(ensemble_outputs[box].key, "box_peak_g") != 0)
		box++;
	assert_int_equal(read_scene("corner", "corner", &scene), 0);
	assert_false(corner_predicted(&scene));
	assert_int_equal(corner_fill(&scene, message), 0);
	assert_true(corner_predicted(&scene));
	e.scene = &scene;
	share = 0.4 * predicted(&scene).relative_u;
	assert_int_equal(model_solve(&scene, MODEL_SDOF, NULL, &p, message), 0);
	assert_true(ensemble_bars(&e, u));
	assert_near_part(u[box], p.box.value_g * sinh(share), 1e-6);
	assert_int_equal(ensemble_monte_carlo(&e, 4000, spread, &failed), 0);
	assert_near_part(spread[box].low, p.box.value_g * exp(-1.96 * share), 0.05);
	assert_near_part(spread[box].high, p.box.value_g * exp(1.96 * share), 0.05);
	e.fidelity = MODEL_PLANAR;
	assert_int_equal(model_solve(&scene, MODEL_PLANAR, NULL, &p, message), 0);
	assert_true(ensemble_bars(&e, u));
	assert_near_part(u[box], p.box.value_g * sinh(share), 0.02);

	scene.fitted_u[1] = 0.01; /* a fit's */
	assert_false(corner_predicted(&scene));
	scene.contact_stiffness_n_m15 = scene.contact_duration_s = (double)NAN;
	assert_int_equal(scene_check(&scene, "here", message), DT_E_RANGE);
	assert_non_null(strstr(message, "[fit]"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(between_the_points_of_the_table),
	        cmocka_unit_test(a_shallow_dent_is_hertz_on_a_layer),
	        cmocka_unit_test(the_stiffness_stores_the_fall_s_energy),
	        cmocka_unit_test(stiffness_is_as_the_modulus),
	        cmocka_unit_test(the_study_s_own_mat),
	        cmocka_unit_test(beyond_the_table_the_key_is_named),
	        cmocka_unit_test(a_scene_may_leave_its_contact_to_it),
	        cmocka_unit_test(a_changed_scene_is_predicted_again),
	        cmocka_unit_test(bars_stand_for_the_predicted_stiffness),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
