/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Hunt and Crossley's contact against 40- to 60-digit quadratures made elsewhere and against the equation its
 * D must solve; Hertz against the study's literal inputs.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "host/model/contact.h"
#include "tests/unit/near.h"

#define IMPACT_M_S 4.18811174636017

static struct contact_law law_of(double restitution)
{
	struct contact_law law;

	if (contact_law_init(&law, restitution) != 0)
		fail_msg("no law for e = %.17g", restitution);
	return law;
}

static const struct {
	double e, damping, duration, depth;
} reference[] = {
        {1e-3, 999.99999999999998, 91.136904105479815, 0.090776130205809263},
        {0.01, 99.999999999999998, 23.139119267491544, 0.22437156521801641},
        {0.03, 33.333333333331929, 12.255828373815669, 0.33926830309907446},
        {0.1, 9.9981593974956673, 6.4575394876068116, 0.51472499415614872},
        {0.25, 3.8408060397780143, 4.3961611311645763, 0.68165959770884719},
        {0.4, 2.0824981641470068, 3.8066536023345588, 0.78818670858636774},
        {0.5, 1.432750533271375, 3.6035605840461364, 0.84799291297791089},
        {0.6, 0.97487171081326537, 3.4684833324621794, 0.90276440687168501},
        {0.75, 0.4959113182344873, 3.3371871182988381, 0.97852942470299701},
        {0.9, 0.16648195068530806, 3.2554610060706117, 1.0488221456992377},
        {0.99, 0.015151362109441019, 3.2213311761210142, 1.0889809346688537},
};

static void the_law_to_twelve_digits(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(reference) / sizeof(reference[0]); i++) {
		struct contact_law law = law_of(reference[i].e);

		assert_near_part(law.damping, reference[i].damping, 1e-13);
		assert_near_part(law.duration, reference[i].duration, 1e-13);
		assert_near_part(law.depth, reference[i].depth, 1e-13);
	}
}

/* Where the usual form cancels: D of a 40-digit root at 1 - e = 1e-3, 1e-6 and 1e-9, series beyond. */
static void nearly_elastic(void **state)
{
	/* T* of an elastic contact: (4 sqrt(pi)/5) G(2/5)/G(9/10) 1.25^(2/5) */
	const double elastic = 2.9432751843247 * 1.0933620739432771;
	double last = 0.0;

	(void)state;
	assert_near_part(law_of(0.999).damping, 0.0015015013512010866, 1e-12);
	assert_near_part(law_of(0.999999).damping, 1.5000015000444836e-6, 1e-12);
	assert_near_part(law_of(0.999999999).damping, 1.4999999590771027e-9, 1e-9);
	assert_near_part(law_of(0.999999999).duration, elastic, 1e-9);
	assert_near_part(law_of(1.0).duration, elastic, 1e-13);
	assert_near(law_of(1.0).damping, 0.0, 1e-14);
	for (int k = 0; k < 300; k++) { /* no jump where one form takes over from the other */
		double e = 1.0 - 0.5 * pow(10.0, -k / 30.0), damping = law_of(e).damping;

		if (k > 0 && !(damping < last && damping > 0.85 * last))
			fail_msg("D jumps from %.15g to %.15g at 1 - e = %g", last, damping, 1.0 - e);
		last = damping;
	}
}

/* ln((1 + D)/(1 - e D)) = D (1 + e) where it can be formed; 1/e below, where 1 - e D has no digits left. */
static void from_sticking_to_bouncing(void **state)
{
	double last = 1e300;

	(void)state;
	for (double e = 1e-6; e < 1.0; e *= 1.01) {
		struct contact_law law = law_of(e);

		if (e > 0.1 && e < 0.9)
			assert_near(log1p(law.damping) - log1p(-e * law.damping), law.damping * (1.0 + e),
			            1e-11);
		if (e < 0.02)
			assert_near_part(law.damping, 1.0 / e, 1e-12);
		if (!(law.duration < last) || !isfinite(law.depth))
			fail_msg("T* %.15g after %.15g at e %g", law.duration, last, e);
		last = law.duration;
	}
}

static void the_study_s_contact(void **state)
{
	struct contact_law law = law_of(0.5);
	double k = contact_stiffness(&law, 0.173, IMPACT_M_S, 0.003);

	(void)state;
	assert_near_part(k, 4227303.27134065, 1e-12);
	assert_near_part(contact_duration(&law, 0.173, IMPACT_M_S, k), 0.003, 1e-14);
	assert_near_part(contact_depth(&law, 0.173, IMPACT_M_S, k), 0.00295664995509965, 1e-12);
}

static struct contact_hertz_input study(void)
{
	return (struct contact_hertz_input){.mass_kg = 0.173,
	                                    .speed_m_s = IMPACT_M_S,
	                                    .radius_m = 0.015,
	                                    .case_modulus_pa = 1.12e9,
	                                    .case_poisson = 0.451,
	                                    .mat_modulus_pa = 1.88e6,
	                                    .mat_poisson = 0.499,
	                                    .mat_thickness_m = 0.010};
}

static void hertz_predicts_and_does_not_hold(void **state)
{
	struct contact_hertz_input in = study();
	struct contact_hertz h;

	(void)state;
	assert_int_equal(contact_hertz(&in, &h), 0);
	assert_near_part(h.modulus_pa, 3331843.9799276, 1e-13);
	assert_near_part(h.depth_m, 0.00971191652121225, 1e-13);
	assert_near_part(h.duration_s, 0.00682523404824617, 1e-12);
	assert_near_part(h.depth_share, 0.971191652121225, 1e-13);
	assert_int_equal(h.validity, CONTACT_DEEP);
	/* a slowly loaded Shore A 40: through the mat from 1.747 MPa down */
	in.mat_modulus_pa = 1.748e6;
	assert_int_equal(contact_hertz(&in, &h), 0);
	assert_int_equal(h.validity, CONTACT_DEEP);
	in.mat_modulus_pa = 1.746e6;
	assert_int_equal(contact_hertz(&in, &h), 0);
	assert_int_equal(h.validity, CONTACT_THROUGH);
	/* where it would hold */
	in.mat_modulus_pa = 1e9;
	assert_int_equal(contact_hertz(&in, &h), 0);
	assert_int_equal(h.validity, CONTACT_SOUND);
}

static void the_mat_s_depth(void **state)
{
	(void)state;
	assert_int_equal(contact_validity(0.00299, 0.010), CONTACT_SOUND);
	assert_int_equal(contact_validity(0.00301, 0.010), CONTACT_DEEP);
	assert_int_equal(contact_validity(0.00999, 0.010), CONTACT_DEEP);
	assert_int_equal(contact_validity(0.010, 0.010), CONTACT_THROUGH);
	assert_int_equal(contact_validity((double)NAN, 0.010), CONTACT_THROUGH);
}

static void refusals(void **state)
{
	const double bad[] = {0.0, -0.5, 9e-7, 1.0000001, (double)NAN, (double)INFINITY};
	struct contact_law law = law_of(0.5), before = law;
	struct contact_hertz h = {.depth_m = 7.0};

	(void)state;
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_int_equal(contact_law_init(&law, bad[i]), DT_E_ARGUMENT);
	assert_memory_equal(&law, &before, sizeof(law));
	for (int i = 0; i < 8; i++) {
		struct contact_hertz_input in = study();
		double *const field[] = {&in.mass_kg,         &in.speed_m_s,      &in.radius_m,
		                         &in.case_modulus_pa, &in.case_poisson,   &in.mat_modulus_pa,
		                         &in.mat_poisson,     &in.mat_thickness_m};

		*field[i] = i == 4 || i == 6 ? 0.51 : 0.0;
		assert_int_equal(contact_hertz(&in, &h), DT_E_ARGUMENT);
		*field[i] = (double)NAN;
		assert_int_equal(contact_hertz(&in, &h), DT_E_ARGUMENT);
	}
	assert_true(h.depth_m == 7.0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(the_law_to_twelve_digits),
	        cmocka_unit_test(nearly_elastic),
	        cmocka_unit_test(from_sticking_to_bouncing),
	        cmocka_unit_test(the_study_s_contact),
	        cmocka_unit_test(hertz_predicts_and_does_not_hold),
	        cmocka_unit_test(the_mat_s_depth),
	        cmocka_unit_test(refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
