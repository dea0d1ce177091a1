/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Predictions for the study's products against computed reference values and the study's measured means.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "host/model/model.h"

#define PI 3.14159265358979323846

static void check_close(const char *what, double value, double expected, double relative)
{
	if (!(fabs(value - expected) <= relative * fabs(expected)))
		fail_msg("%s: %.15g, expected %.15g within %g of it", what, value, expected, relative);
}

static struct scene box(void)
{
	return (struct scene){
	        .drop_height_m = 0.894,
	        .drop_angle_deg = 25.0,
	        .product_case_mass_kg = 0.173,
	        .product_length_m = 0.289,
	        .product_width_m = 0.101,
	        .product_thickness_m = 0.021,
	        .product_balance_angle_deg = 25.0,
	        .product_inertia_ratio = 1.0,
	        .contact_duration_s = 0.003,
	        .contact_restitution = 0.5,
	        .sensor_s2_offset_m = 0.065,
	};
}

static struct scene plate(double stiffness_n_m)
{
	struct scene scene = box();

	scene.product_case_mass_kg = 0.169;
	scene.mount_plate_mass_kg = 0.014;
	scene.mount_stiffness_n_m = stiffness_n_m;
	scene.mount_damping_ratio = 0.1;
	return scene;
}

static struct model_prediction predict(const struct scene *scene)
{
	struct model_prediction p;

	assert_int_equal(model_predict(scene, MODEL_AUTO, &p), 0);
	assert_string_equal(p.fidelity, "sdof");
	assert_true(strlen(p.reason) > 40 && strlen(p.reason) < sizeof(p.reason) - 1);
	return p;
}

static void test_box_without_plate(void **state)
{
	struct scene scene = box();
	struct model_prediction p = predict(&scene);

	(void)state;
	check_close("v", p.impact_speed_m_s, 4.18811174636017, 1e-14);
	check_close("dv", p.velocity_change_m_s, 6.28216761954025, 1e-14);
	assert_true(p.contact_time_s == 0.003 && !p.has_plate && p.plate_frequency_hz == 0.0);
	check_close("S1 X", p.peak[MODEL_S1X].value_g, 335.304309245113 * cos(25 * PI / 180), 1e-14);
	check_close("S1 Y", p.peak[MODEL_S1Y].value_g, 335.304309245113 * sin(25 * PI / 180), 1e-14);
	check_close("S1", p.resultant[0].value_g, 335.304309245113, 1e-14);
	check_close("S2", p.resultant[1].value_g, 335.304309245113, 1e-14);
	check_close("time", p.resultant[0].time_s, 0.0015, 1e-14);
	assert_true(p.lag_s == 0.0);
}

/* With a box of no inertia to speak of the mounts see the plate alone: values of a 60-digit computation. */
static void test_plate_on_a_heavy_box(void **state)
{
	struct scene scene = plate(7550.0);
	struct model_prediction p;

	(void)state;
	scene.product_case_mass_kg = 1e15;
	p = predict(&scene);
	check_close("2A", p.resultant[0].value_g, 368.323190670, 1e-11);
	check_close("2A lag", p.lag_s, 0.00327080406287 - 0.0015, 1e-11);
	scene.mount_stiffness_n_m = 7550.0 * 5 / 3;
	p = predict(&scene);
	check_close("2B", p.resultant[0].value_g, 438.710225306128, 1e-11);
	check_close("2B lag", p.lag_s, 0.0014020535008937, 1e-11);
}

static void test_plate_frequency(void **state)
{
	struct scene scene = plate(7550.0);
	struct model_prediction p = predict(&scene);

	(void)state;
	check_close("2A", p.plate_frequency_hz, 121.621899556609 * sqrt(0.99), 1e-12);
	assert_true(p.has_plate && p.plate_damping_ratio == 0.1);
	scene.mount_stiffness_n_m = 12583.3333333333333;
	p = predict(&scene);
	check_close("2B", p.plate_frequency_hz, 157.013197172286 * sqrt(0.99), 1e-12);
}

/* The plate's resultants at 15 to 35 deg as the study measured them: the model's mean absolute and mean
 * signed deviation were computed elsewhere, to one decimal of a percent. */
static void check_study(double stiffness_n_m, const double measured_g[5], double mae, double bias)
{
	struct scene scene = plate(stiffness_n_m);
	double sum = 0.0, absolute = 0.0;

	for (int k = 0; k < 5; k++) {
		double percent;

		scene.drop_angle_deg = 15.0 + 5.0 * k;
		percent = 100.0 * (predict(&scene).resultant[0].value_g / measured_g[k] - 1.0);
		sum += percent / 5;
		absolute += fabs(percent) / 5;
	}
	if (!(fabs(absolute - mae) < 0.06) || !(fabs(sum - bias) < 0.06))
		fail_msg("deviation %.2f %% (%+.2f %%), expected %.1f (%+.1f)", absolute, sum, mae, bias);
}

static void test_against_the_study(void **state)
{
	static const double a[] = {370.5, 372.0, 337.4, 382.5, 366.5},
	                    b[] = {460.3, 468.1, 460.3, 467.5, 453.9};

	(void)state;
	check_study(7550.0, a, 4.3, 3.9);
	check_study(7550.0 * 5 / 3, b, 2.9, -2.9);
}

/* Above the contact S2 reads the box's direction; beside it, by the moment about the centre of gravity:
 * tan(direction) = s2 ly/i^2 + (1 - s2 lx/i^2) tan(angle). */
static void test_s2_direction(void **state)
{
	const double i2 = (0.289 * 0.289 + 0.101 * 0.101) / 12, ly = 0.0505, lx = 0.108297599;
	struct scene scene = box();

	(void)state;
	for (double angle = 10.0; angle <= 80.0; angle += 5.0) {
		double tangent = tan(angle * PI / 180);
		struct model_prediction p;

		scene.drop_angle_deg = angle;
		p = predict(&scene);
		check_close("S2 Y/X", p.peak[MODEL_S2Y].value_g / p.peak[MODEL_S2X].value_g,
		            0.065 * ly / i2 + (1 - 0.065 * lx / i2) * tangent, 1e-7);
		check_close("S1 Y/X", p.peak[MODEL_S1Y].value_g / p.peak[MODEL_S1X].value_g, tangent, 1e-13);
		check_close("S2", p.resultant[1].value_g,
		            hypot(p.peak[MODEL_S2X].value_g, p.peak[MODEL_S2Y].value_g), 1e-14);
	}
	scene.drop_angle_deg = 35.0;
	scene.product_inertia_ratio = 2.0; /* turns half as easily */
	check_close("heavy ends",
	            predict(&scene).peak[MODEL_S2Y].value_g / predict(&scene).peak[MODEL_S2X].value_g,
	            0.065 * ly / i2 / 2 + (1 - 0.065 * lx / i2 / 2) * tan(35 * PI / 180), 1e-7);
}

static void test_s1_turned(void **state)
{
	struct scene scene = plate(12583.3333333333333);
	struct model_prediction straight = predict(&scene), turned;
	double x = straight.peak[MODEL_S1X].value_g, y = straight.peak[MODEL_S1Y].value_g;
	double c = cos(4.7 * PI / 180), s = sin(4.7 * PI / 180);

	(void)state;
	scene.sensor_s1_yaw_deg = 4.7;
	turned = predict(&scene);
	check_close("X", turned.peak[MODEL_S1X].value_g, x * c - y * s, 1e-13);
	check_close("Y", turned.peak[MODEL_S1Y].value_g, x * s + y * c, 1e-13);
	check_close("resultant", turned.resultant[0].value_g, straight.resultant[0].value_g, 1e-14);
	check_close("S2", turned.peak[MODEL_S2Y].value_g, straight.peak[MODEL_S2Y].value_g, 1e-14);
}

static void test_history(void **state)
{
	struct scene scene = plate(7550.0);
	struct model_prediction p = predict(&scene);
	double value[1201];

	(void)state;
	for (enum model_axis axis = 0; axis < MODEL_AXES; axis++) {
		double largest = 0.0;

		assert_int_equal(model_history(&scene, MODEL_SDOF, axis, -0.002, 1e-5, value, 1201), 0);
		for (int k = 0; k < 1201; k++) {
			largest = fmax(largest, value[k]);
			assert_true(k > 200 || value[k] == 0.0);
		}
		check_close("largest", largest, p.peak[axis].value_g, 1e-4);
		assert_true(largest <= p.peak[axis].value_g);
		assert_int_equal(model_history(&scene, MODEL_AUTO, axis, p.peak[axis].time_s, 1.0, value, 1),
		                 0);
		check_close("at the peak", value[0], p.peak[axis].value_g, 1e-14);
		assert_int_equal(model_history(&scene, MODEL_AUTO, axis, 0.0031, 1.0, value, 1), 0);
		assert_true((value[0] == 0.0) == (axis == MODEL_S2X || axis == MODEL_S2Y));
	}
}

static void test_refusals(void **state)
{
	struct model_prediction p = {.lag_s = 42.0};
	enum model_fidelity fidelity = MODEL_SDOF;
	double value[2] = {7.0, 7.0};
	struct scene scene;

	(void)state;
	scene = plate(7550.0);
	scene.mount_damping_ratio = 1.0;
	assert_int_equal(model_predict(&scene, MODEL_AUTO, &p), DT_E_NUMERIC);
	scene = plate((double)NAN);
	assert_int_equal(model_predict(&scene, MODEL_AUTO, &p), DT_E_NUMERIC);
	assert_int_equal(model_history(&scene, MODEL_AUTO, MODEL_S1X, 0.0, 1e-4, value, 2), DT_E_NUMERIC);
	scene = box();
	scene.contact_duration_s = 0.0;
	assert_int_equal(model_predict(&scene, MODEL_AUTO, &p), DT_E_NUMERIC);
	scene = box();
	scene.product_balance_angle_deg = 0.0;
	assert_int_equal(model_predict(&scene, MODEL_AUTO, &p), DT_E_NUMERIC);
	assert_true(p.lag_s == 42.0 && value[0] == 7.0 && value[1] == 7.0);

	assert_int_equal(model_fidelity_parse("auto", &fidelity), 0);
	assert_int_equal(fidelity, MODEL_AUTO);
	assert_int_equal(model_fidelity_parse("planar", &fidelity), DT_E_UNKNOWN);
	assert_int_equal(fidelity, MODEL_AUTO);
	assert_int_equal(model_fidelity_parse("sdof", &fidelity), 0);
	assert_int_equal(fidelity, MODEL_SDOF);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_box_without_plate), cmocka_unit_test(test_plate_on_a_heavy_box),
	        cmocka_unit_test(test_plate_frequency),   cmocka_unit_test(test_against_the_study),
	        cmocka_unit_test(test_s2_direction),      cmocka_unit_test(test_s1_turned),
	        cmocka_unit_test(test_history),           cmocka_unit_test(test_refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
