/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Box and plate against reference values of two unrelated integrators, and against GSL's rk8pd over equations
 * written out again here.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include "host/model/course.h"
#include "tests/unit/near.h"

#define IMPACT_M_S 4.18811174636017
#define G 9.81
#define ANGLE_COSINE 0.8

static struct course study(double mount_n_m, double restitution, double tolerance)
{
	struct course c = {.body.case_mass_kg = 0.169,
	                   .body.plate_mass_kg = 0.014,
	                   .body.gravity_m_s2 = G,
	                   .body.speed_m_s = IMPACT_M_S,
	                   .body.stiffness_n_m15 = 4227303.27134065,
	                   .body.mount_n_m = mount_n_m,
	                   .body.mount_damping_n_s_m = 2 * 0.1 * sqrt(mount_n_m * 0.014),
	                   .body.angle_rad = acos(ANGLE_COSINE),
	                   .body.inertia_kg_m2 = 1.0,
	                   .tolerance = tolerance};

	assert_int_equal(contact_law_init(&c.body.law, restitution), 0);
	if (restitution < 0.49 || restitution > 0.51)
		c.body.stiffness_n_m15 = contact_stiffness(&c.body.law, 0.169, IMPACT_M_S, 0.003);
	return c;
}

static struct course_result solve(const struct course *c)
{
	struct course_result r;

	assert_int_equal(course_solve(c, &r), 0);
	return r;
}

static void the_reference(void **state)
{
	struct course a = study(7550.0, 0.5, 1e-11), b = study(7550.0 * 5 / 3, 0.5, 1e-11);
	struct course_result r = solve(&a);

	(void)state;
	assert_near_part(r.peak[COURSE_CENTRE_R].value, 5373.05617460464, 1e-10);
	assert_near(r.peak[COURSE_CENTRE_R].time_s, 0.744308e-3, 1e-9); /* given to six digits */
	assert_near_part(r.peak[COURSE_S1R].value, 3691.88490, 2e-9);
	assert_near_part(r.peak[COURSE_S1R].time_s, 2.69475824e-3, 2e-9);
	assert_near(r.peak[COURSE_S1R].time_s - r.peak[COURSE_CENTRE_R].time_s, 1.95045e-3, 1e-8);
	assert_near_part(r.peak[COURSE_DEPTH].value, 2.94122581e-3, 1e-8);
	assert_near_part(fabs(r.peak[COURSE_TRAVEL].value), 6.70338575e-3, 1e-7);
	r = solve(&b);
	assert_near_part(r.peak[COURSE_CENTRE_R].value, 5357.37182846565, 1e-10);
	assert_near_part(r.peak[COURSE_CENTRE_R].time_s, 0.000742919065757884, 1e-8);
	assert_near_part(r.peak[COURSE_S1R].value, 4540.28203567002, 1e-10);
	assert_near_part(r.peak[COURSE_S1R].time_s, 0.00231208947364579, 1e-9);
	assert_near_part(r.peak[COURSE_S1R].time_s - r.peak[COURSE_CENTRE_R].time_s, 0.00156917040788791,
	                 1e-8);
	assert_near_part(r.peak[COURSE_DEPTH].value, 0.00294503122423836, 1e-7);
	assert_near_part(fabs(r.peak[COURSE_TRAVEL].value), 0.00495378957990159, 1e-7);
}

/* What one step may miss adds up to less than thirty of them in the peaks, wherever these lie: in the
 * contact, at the release or after it. */
static void what_tolerance_means(void **state)
{
	(void)state;
	for (double tolerance = 1e-7; tolerance < 2e-5; tolerance *= 100.0)
		for (double k = 500.0; k < 100000.0; k *= 1.1)
			for (double e = 0.2; e < 0.96; e += 0.15) {
				struct course c = study(k, e, tolerance), exact = study(k, e, 1e-13);
				struct course_result r = solve(&c), x = solve(&exact);

				assert_near_part(r.peak[COURSE_CENTRE_R].value, x.peak[COURSE_CENTRE_R].value,
				                 30 * tolerance);
				assert_near_part(r.peak[COURSE_S1R].value, x.peak[COURSE_S1R].value,
				                 30 * tolerance);
				assert_near_part(r.peak[COURSE_DEPTH].value, x.peak[COURSE_DEPTH].value,
				                 30 * tolerance);
				assert_near_part(r.peak[COURSE_S2R].value, x.peak[COURSE_S2R].value,
				                 30 * tolerance);
			}
}

/* Mounts so that the plate peaks just before, at and just after the release: on either side alike. */
static void a_peak_at_the_release(void **state)
{
	double last = 0.0, last_step = 0.0;

	(void)state;
	for (double k = 4000.0; k < 9000.0; k += 10.0) {
		struct course c = study(k, 0.5, 1e-6);
		struct course_result r = solve(&c);
		double step = r.peak[COURSE_S1R].value - last;

		if (last_step > 0.0 && !(fabs(step / last_step - 1.0) < 0.02))
			fail_msg("k %g: step of %.9g after one of %.9g", k, step, last_step);
		last_step = last > 0.0 ? step : 0.0;
		last = r.peak[COURSE_S1R].value;
	}
}

/* ---- the same with GSL: heights and speeds of both masses in the room ---- */

static int room(double t, const double y[], double rate[], void *user)
{
	const struct course *c = user;
	double depth = -y[0], force = 0.0;
	double mount = c->body.mount_n_m * (y[2] - y[0]) + c->body.mount_damping_n_s_m * (y[3] - y[1]);

	(void)t;
	if (depth > 0.0)
		force = fmax(0.0, c->body.stiffness_n_m15 * pow(depth, 1.5) *
		                          (1.0 - c->body.law.damping * y[1] / c->body.speed_m_s));
	rate[0] = y[1];
	rate[1] = (force + mount) / c->body.case_mass_kg - G;
	rate[2] = y[3];
	rate[3] = -mount / c->body.plate_mass_kg - G;
	return GSL_SUCCESS;
}

static void check_against_gsl(const struct course *c)
{
	enum { SAMPLES = 120 };
	const double step_s = 1e-4;
	gsl_odeiv2_system system = {room, NULL, 4, (void *)(uintptr_t)(const void *)c};
	gsl_odeiv2_driver *driver =
	        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-7, 1e-13, 1e-12);
	double y[4] = {0.0, -IMPACT_M_S, 0.0, -IMPACT_M_S}, rate[4], t = 0.0;
	struct course_sample samples[SAMPLES];
	struct course_result r = solve(c);

	assert_non_null(driver);
	assert_int_equal(course_history(c, step_s, step_s, samples, SAMPLES), 0);
	for (int i = 0; i < SAMPLES; i++) {
		assert_int_equal(gsl_odeiv2_driver_apply(driver, &t, step_s * (i + 1), y), GSL_SUCCESS);
		room(t, y, rate, system.params);
		assert_near(samples[i].axis[COURSE_S2X] / ANGLE_COSINE, rate[1] + G,
		            1e-7 * r.peak[COURSE_CENTRE_R].value);
		assert_near(samples[i].axis[COURSE_S1X] / ANGLE_COSINE, rate[3] + G,
		            1e-7 * r.peak[COURSE_S1R].value);
		assert_near(samples[i].travel_m, y[2] - y[0], 1e-7 * fabs(r.peak[COURSE_TRAVEL].value));
		assert_near(samples[i].depth_m, fmax(-y[0], 0.0), 1e-7 * r.peak[COURSE_DEPTH].value);
		assert_true(fabs(samples[i].axis[COURSE_S2X] / ANGLE_COSINE) <=
		            r.peak[COURSE_CENTRE_R].value * (1 + 1e-9));
		assert_true(fabs(samples[i].axis[COURSE_S1X] / ANGLE_COSINE) <=
		            fabs(r.peak[COURSE_S1R].value) * (1 + 1e-9));
	}
	gsl_odeiv2_driver_free(driver);
}

static void like_rk8pd(void **state)
{
	const double restitutions[] = {0.1, 0.3, 0.5, 0.8, 0.99, 1.0}, mounts[] = {500.0, 7550.0, 60000.0};

	(void)state;
	for (size_t e = 0; e < sizeof(restitutions) / sizeof(restitutions[0]); e++)
		for (size_t k = 0; k < sizeof(mounts) / sizeof(mounts[0]); k++) {
			struct course c = study(mounts[k], restitutions[e], 1e-11);

			check_against_gsl(&c);
			c.body.mount_damping_n_s_m *= 15.0; /* overdamped */
			check_against_gsl(&c);
			c.body.mount_damping_n_s_m = 0.0;
			check_against_gsl(&c);
		}
}

/* A box alone is contact.h's law, to the digits of integrals made apart. force: its largest over
 * (m^3 v^6 k^2)^(1/5); time_share: of the contact, at which it comes. */
static void without_a_plate(void **state)
{
	static const struct {
		double e, force, time_share;
	} law[] = {
	        {0.1, 1.6362271138935137, 0.067916869856252159},
	        {0.25, 1.2481263307366935, 0.14433935335854073},
	        {0.4, 1.1106595326287271, 0.20888497033485947},
	        {0.5, 1.0628707219376534, 0.25124462024310612},
	        {0.6, 1.0380205495126072, 0.29536287008530569},
	        {0.75, 1.0384455760084895, 0.36765203682591672},
	        {0.9, 1.085186961810159, 0.44718080293585624},
	        {0.99, 1.1365054818123886, 0.49487877719269195},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(law) / sizeof(law[0]); i++) {
		double e = law[i].e;
		struct course c = study(1.0, e, 1e-13);
		const struct contact_law *l = &c.body.law;
		double k = c.body.stiffness_n_m15;
		struct course_result r;

		c.body.plate_mass_kg = 0.0;
		c.body.gravity_m_s2 = 0.0;
		r = solve(&c);
		assert_near_part(r.peak[COURSE_CENTRE_R].value * 0.169,
		                 law[i].force * pow(pow(0.169, 3) * pow(IMPACT_M_S, 6) * k * k, 0.2), 3e-11);
		assert_near_part(r.contact_time_s, contact_duration(l, 0.169, IMPACT_M_S, k), 1e-12);
		assert_near_part(r.peak[COURSE_CENTRE_R].time_s, law[i].time_share * r.contact_time_s, 1e-8);
		assert_near_part(r.peak[COURSE_DEPTH].value, contact_depth(l, 0.169, IMPACT_M_S, k), 1e-12);
		assert_near(r.restitution, e, 1e-11);
		assert_near_part(r.velocity_change_m_s, (1 + e) * IMPACT_M_S, 1e-11);
		assert_true(r.peak[COURSE_S1R].value == r.peak[COURSE_CENTRE_R].value &&
		            fabs(r.peak[COURSE_TRAVEL].value) == 0.0);
		c.body.gravity_m_s2 = G; /* is felt by a thousandth */
		r = solve(&c);
		assert_near_part(r.contact_time_s, contact_duration(l, 0.169, IMPACT_M_S, k), 0.02);
		assert_near(r.restitution, e, 0.01);
	}
}

/* Momentum: what the contact gave both masses is what they have. */
static void momentum_is_kept(void **state)
{
	struct course c = study(7550.0, 0.5, 1e-10);
	struct course_result r = solve(&c);
	struct course_sample samples[4001];
	double impulse = 0.0;

	(void)state;
	assert_int_equal(course_history(&c, 0.0, 1e-6, samples, 4001), 0);
	for (int i = 1; i < 4000; i++)
		impulse += samples[i].force_n * 1e-6;
	assert_near_part(r.velocity_change_m_s, impulse / 0.183, 1e-6);
}

/* From a box that hardly rises to one that loses nothing: no number missing, no jump. */
static void over_all_restitutions(void **state)
{
	double last = 0.0;

	(void)state;
	for (int i = 0; i < 160; i++) {
		double e = i < 60 ? 1e-3 * pow(10.0, i / 22.25) : 1.0 - 0.5 * pow(0.8, i - 60);
		struct course c = study(7550.0, e, 1e-6);
		struct course_result r = solve(&c);

		assert_true(isfinite(r.peak[COURSE_CENTRE_R].value) && isfinite(r.peak[COURSE_S1R].value) &&
		            isfinite(r.peak[COURSE_DEPTH].value));
		if (last > 0.0 && !(fabs(r.peak[COURSE_S1R].value / last - 1.0) < 0.1))
			fail_msg("plate %.9g after %.9g at e %g", r.peak[COURSE_S1R].value, last, e);
		last = r.peak[COURSE_S1R].value;
	}
	{
		struct course c = study(7550.0, 1e-4, 1e-6);
		struct course_result r = solve(&c);

		assert_true(isfinite(r.peak[COURSE_S1R].value) && r.peak[COURSE_S1R].value > 2000.0 &&
		            r.peak[COURSE_S1R].value < 3000.0);
	}
}

/* A box so soft and slow that its own weight keeps it in the mat. */
static void a_box_that_stays(void **state)
{
	struct course c = study(7550.0, 0.01, 1e-6);
	struct course_result r;

	(void)state;
	c.body.speed_m_s = 0.05;
	c.body.stiffness_n_m15 = 1e4;
	r = solve(&c);
	assert_true(isnan(r.contact_time_s) && isnan(r.restitution));
	assert_true(isfinite(r.peak[COURSE_S1R].value) && isfinite(r.peak[COURSE_CENTRE_R].value) &&
	            r.peak[COURSE_DEPTH].value > 0.0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(the_reference),    cmocka_unit_test(what_tolerance_means),
	        cmocka_unit_test(like_rk8pd),       cmocka_unit_test(without_a_plate),
	        cmocka_unit_test(momentum_is_kept), cmocka_unit_test(over_all_restitutions),
	        cmocka_unit_test(a_box_that_stays), cmocka_unit_test(a_peak_at_the_release),
	};

	gsl_set_error_handler_off();
	return cmocka_run_group_tests(tests, NULL, NULL);
}
