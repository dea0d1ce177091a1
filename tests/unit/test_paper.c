/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The printed equations, mistakes and all, against the numbers an independent audit got from them by hand;
 * and the steady state put right against 60-digit values.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/units.h"
#include "host/model/paper.h"
#include "host/model/oscillator.h"
#include "tests/unit/near.h"

/* Geometry 2 as the study has it; the mat by Gent's relation for Shore A 40. */
static struct paper_input study(double angle_deg)
{
	return (struct paper_input){.mass_kg = 0.183,
	                            .length_m = 0.289,
	                            .width_m = 0.101,
	                            .angle_rad = UNITS_RAD(angle_deg),
	                            .speed_m_s = 4.18811174636017,
	                            .radius_m = 0.015,
	                            .case_modulus_pa = 1.12e9,
	                            .case_poisson = 0.451,
	                            .mat_modulus_pa = 1689638.61299818,
	                            .mat_poisson = 0.499,
	                            .case_damping_ratio = 0.4,
	                            .plate_omega = 2.0 * UNITS_PI * 121.0,
	                            .mount_damping_ratio = 0.1};
}

/* The unit of the numbers found by hand. */
#define REFERENCE_G_M_S2 9.81

static struct paper_result solve(const struct paper_input *in)
{
	struct paper_result r;

	assert_int_equal(paper_solve(in, &r), 0);
	return r;
}

static void equivalent_mass_as_printed(void **state)
{
	struct paper_input in = study(15);

	(void)state;
	assert_near_part(solve(&in).equivalent_mass_kg / 0.183, 0.888782310986898, 1e-13);
	in = study(25);
	assert_near_part(solve(&in).equivalent_mass_kg / 0.183, 0.914112476962, 1e-11);
	in = study(35);
	assert_near_part(solve(&in).equivalent_mass_kg / 0.183, 0.941180312730674, 1e-13);
	in.mat_modulus_pa = 1.88e6;
	assert_near_part(solve(&in).contact_modulus_pa, 3331843.9799276, 1e-13); /* (6) is right */
}

/* Exponent 2/3: a contact of a third of a millisecond and ten thousand g. */
static void contact_as_printed(void **state)
{
	struct paper_input in = study(25);
	struct paper_result r = solve(&in);

	(void)state;
	assert_near(r.contact_time_s * 1e3, 0.326, 0.0005);
	assert_near(r.box_m_s2, 102821.0, 1.5);
	assert_near(r.box_m_s2 / REFERENCE_G_M_S2, 10481.0, 1.0);
}

/* With the measured contact time, and v as printed or counted against the impulse. */
static void box_as_printed(void **state)
{
	static const struct {
		double angle_deg;
		bool speed_signed;
		double box_g, speed_ratio;
	} cases[] = {{15, false, 1119, 2.90},
	             {35, false, 1162, 3.01},
	             {15, true, 347, 0.90},
	             {35, true, 390, 1.01}};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct paper_input in = study(cases[i].angle_deg);
		struct paper_result r;

		in.contact_time_s = 0.003;
		in.speed_signed = cases[i].speed_signed;
		r = solve(&in);
		assert_near(r.box_m_s2 / REFERENCE_G_M_S2, cases[i].box_g, 0.6);
		assert_near(r.speed_m_s / in.speed_m_s, cases[i].speed_ratio, 0.0051);
		/* peak |w''| = A0 omega Phi, Phi(.4) of a 60-digit computation */
		assert_near_part(r.box_m_s2, r.speed_m_s * UNITS_PI / 0.003 * 0.863510092837513, 1e-13);
		assert_near_part(fabs(paper_box(&in, &r, r.box_time_s)), r.box_m_s2, 1e-12);
		assert_near_part(paper_box(&in, &r, 0.003) / r.box_m_s2, 0.9265, 1e-4); /* it jumps */
		assert_true(paper_box(&in, &r, 0.0029) == 0.0);
	}
	{
		struct paper_input in = study(25);
		struct paper_result r;

		in.contact_time_s = 0.003;
		in.case_damping_ratio = 0.1;
		r = solve(&in);
		assert_near_part(r.box_m_s2, r.speed_m_s * UNITS_PI / 0.003 * 0.880144344594586, 1e-13);
	}
}

/* Plate resultants of 2A and 2B against the study's means: mean deviations of the audit, in percent. */
static void check_plates(double contact_time_s, bool speed_signed, double a_percent, double b_percent,
                         double within)
{
	static const double a[] = {370.5, 372.0, 337.4, 382.5, 366.5},
	                    b[] = {460.3, 468.1, 460.3, 467.5, 453.9};
	double off_a = 0.0, off_b = 0.0;

	for (int i = 0; i < 5; i++) {
		struct paper_input in = study(15 + 5 * i);

		in.contact_time_s = contact_time_s;
		in.speed_signed = speed_signed;
		off_a += fabs(solve(&in).plate_m_s2 / REFERENCE_G_M_S2 / a[i] - 1.0) * 20.0;
		in.plate_omega = 2.0 * UNITS_PI * 154.0;
		off_b += fabs(solve(&in).plate_m_s2 / REFERENCE_G_M_S2 / b[i] - 1.0) * 20.0;
	}
	assert_near(off_a, a_percent, within);
	assert_near(off_b, b_percent, within);
}

static void plates_as_printed(void **state)
{
	(void)state;
	check_plates(0.003, false, 516, 1494, 0.5);
	check_plates(0.003, true, 99, 414, 0.5);
	check_plates(0.0, false, 32, 28, 0.5);
}

/* (17): its amplitude is right, its arc tangent takes the wrong branch beyond resonance; (18) goes on at the
 * pulse's frequency, not the plate's, with the decay of the time since 0, not since T. */
static void response_as_printed(void **state)
{
	struct paper_input in = study(25);
	struct paper_result r;
	double right, phase, after;

	(void)state;
	in.contact_time_s = 0.003;
	r = solve(&in);
	assert_near(r.transmissibility, 1.562, 0.0005);
	assert_near(UNITS_DEG(r.phase_rad), -22.6, 0.05);
	assert_int_equal(
	        oscillator_steady(500.0 / 3.0 * sqrt(0.84) / (121.0 * sqrt(0.99)), 0.1, &right, &phase), 0);
	assert_near_part(r.transmissibility, right, 1e-13);
	/* psi of (17), by which it follows (1, 2 zeta r) */
	assert_near(UNITS_DEG(phase + atan(0.2 * 500.0 / 3.0 * sqrt(0.84) / (121.0 * sqrt(0.99)))), 157.4,
	            0.05);
	assert_near_part(fabs(paper_plate(&in, &r, r.plate_time_s)), r.plate_m_s2, 1e-12);
	after = paper_plate(&in, &r, 0.0071) / paper_plate(&in, &r, 0.0041);
	assert_near(after, -0.796, 0.0005);
	in.plate_omega = 2.0 * UNITS_PI * 154.0;
	assert_near(solve(&in).transmissibility, 5.112, 0.0005);
}

static void steady_to_twelve_digits(void **state)
{
	static const struct {
		double r, zeta, transmissibility, psi;
	} reference[] = {
	        {0.5, 0.01, 1.33328148969004, 0.0133325432941457},
	        {0.5, 0.1, 1.32822894853937, 0.132551532296674},
	        {0.5, 0.4, 1.26709760167871, 0.489957326253728},
	        {1, 0.01, 50.0099990002, 1.5707963267949},
	        {1, 0.1, 5.09901951359278, 1.5707963267949},
	        {1, 0.4, 1.60078105935821, 1.5707963267949},
	        {1.5, 0.01, 0.800129514909554, 3.11759725999792},
	        {1.5, 0.1, 0.812161718243933, 2.90604767286893},
	        {1.5, 0.4, 0.901474414445625, 2.37659982087888},
	};
	double value, phase;

	(void)state;
	for (size_t i = 0; i < sizeof(reference) / sizeof(reference[0]); i++) {
		assert_int_equal(oscillator_steady(reference[i].r, reference[i].zeta, &value, &phase), 0);
		assert_near_part(value, reference[i].transmissibility, 1e-13);
		assert_near_part(phase, reference[i].psi - atan(2 * reference[i].zeta * reference[i].r),
		                 1e-11);
	}
	/* 1/|1 - r^2| where the printed form cancels */
	assert_int_equal(oscillator_steady(1.0 + 1e-14, 0.0, &value, &phase), 0);
	assert_near_part(value, 1.0 / 1.9984014443252818e-14, 1e-13);
	assert_int_equal(oscillator_steady(1.0, 1e-9, &value, &phase), 0);
	assert_near_part(value, 5e8, 1e-13);
}

static void refusals(void **state)
{
	struct paper_input in = study(25);
	struct paper_result r = {.box_m_s2 = 7.0};
	double value = 7.0, phase = 7.0;

	(void)state;
	in.radius_m = 0.0;
	assert_int_equal(paper_solve(&in, &r), DT_E_ARGUMENT);
	in = study(25);
	in.speed_m_s = 0.0;
	assert_int_equal(paper_solve(&in, &r), DT_E_ARGUMENT);
	in = study(25);
	in.mass_kg = (double)NAN;
	assert_int_equal(paper_solve(&in, &r), DT_E_ARGUMENT);
	in = study(25);
	in.mount_damping_ratio = 1.0;
	assert_int_equal(paper_solve(&in, &r), DT_E_ARGUMENT);
	assert_int_equal(oscillator_steady(1.0, 0.0, &value, &phase), DT_E_NUMERIC);
	assert_int_equal(oscillator_steady(0.0, 0.1, &value, &phase), DT_E_ARGUMENT);
	assert_int_equal(oscillator_steady(1.0, -0.1, &value, &phase), DT_E_ARGUMENT);
	assert_int_equal(oscillator_steady((double)NAN, 0.1, &value, &phase), DT_E_ARGUMENT);
	assert_true(r.box_m_s2 == 7.0 && value == 7.0 && phase == 7.0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(equivalent_mass_as_printed),
	        cmocka_unit_test(contact_as_printed),
	        cmocka_unit_test(box_as_printed),
	        cmocka_unit_test(plates_as_printed),
	        cmocka_unit_test(response_as_printed),
	        cmocka_unit_test(steady_to_twelve_digits),
	        cmocka_unit_test(refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
