/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The least rung for a question, held against planar over random drops and questions.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "host/model/auto.h"
#include "tests/unit/shipped.h"

#define PI 3.14159265358979323846

enum { SEED = 20231, DROPS = 500 };

/* Evaluations of planar with its defaults over those of the least rung and its check. */
#define CHEAPER 3.0

static uint64_t state;

/* Vigna's splitmix64, 0 to 1. */
static double uniform(double low, double high)
{
	uint64_t z = (state += 0x9e3779b97f4a7c15u);

	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
	return low + (high - low) * (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static double spread(double low, double high)
{
	return low * exp(uniform(0.0, 1.0) * log(high / low));
}

/* A product, its mat and a drop; the contact's stiffness is near that of its duration. */
static struct scene random_scene(void)
{
	struct model_options plain = model_defaults;
	struct scene s = shipped_scene("2A");
	struct model_prediction p;

	do {
		double reduced, omega;

		s.drop_height_m = uniform(0.2, 2.0);
		s.drop_angle_deg = uniform(12.0, 75.0);
		s.product_case_mass_kg = spread(0.05, 2.0);
		s.product_length_m = spread(0.08, 0.5);
		s.product_width_m = s.product_length_m * uniform(0.25, 1.0);
		s.product_balance_angle_deg = uniform(15.0, 45.0);
		s.product_inertia_ratio = uniform(0.8, 1.4);
		s.contact_duration_s = spread(0.0015, 0.008);
		s.contact_duration_height_m = s.drop_height_m;
		s.contact_mass_kg = s.product_case_mass_kg;
		s.contact_restitution = uniform(0.25, 0.9);
		s.contact_tangential_ratio = uniform(0.0, 3.0);
		s.contact_friction = uniform(0.0, 0.9);
		s.contact_mat_thickness_m = spread(0.01, 0.05);
		s.mount_plate_mass_kg =
		        uniform(0.0, 1.0) < 0.25 ? 0.0 : s.product_case_mass_kg * spread(0.03, 0.4);
		reduced = 1.0 / (1.0 / s.mount_plate_mass_kg + 1.0 / s.product_case_mass_kg);
		omega = 2.0 * PI * spread(0.2, 1.5) / s.contact_duration_s;
		s.mount_stiffness_n_m = reduced * omega * omega;
		s.mount_damping_ratio = uniform(0.02, 0.3);
		s.mount_damping_n_s_m = 0.0;
		s.mount_softening = uniform(-0.5, 0.5) < 0.0 ? 0.0 : uniform(0.0, 0.6);
		s.mount_softening_strain = spread(0.2, 1.5);
		s.mount_cube_m = spread(0.002, 0.008);
		s.sensor_s2_offset_m = uniform(-0.35, 0.35) * s.product_length_m;
		s.sensor_s1_yaw_deg = 0.0;
		plain.refinements = 0;
	} while (model_solve(&s, MODEL_COUPLED, &plain, &p, NULL) != 0);
	s.contact_stiffness_n_m15 = p.stiffness_n_m15 * uniform(0.8, 1.25);
	return s;
}

static const double accuracies[] = {0.01, 0.02, 0.05, 0.1, 0.2};

/* One or two questions; without a plate there is no lag. */
static unsigned random_question(const struct scene *s)
{
	unsigned first = 1u << (unsigned)uniform(0.0, 6.0), second = 1u << (unsigned)uniform(0.0, 6.0);
	unsigned asked = uniform(0.0, 1.0) < 0.7 ? first : first | second;

	if (!(s->mount_plate_mass_kg > 0.0))
		asked &= ~(unsigned)MODEL_ASK_LAG;
	return asked ? asked : MODEL_ASK_BOX;
}

struct tally {
	unsigned long cost, always;
	int questions, good, taken[MODEL_FIDELITIES];
	int serves, least; /* a rung below planar would have done; it was taken */
};

/* The least rung that would have answered. */
static enum model_fidelity least_of(const struct scene *s, const struct model_options *o,
                                    const struct model_prediction *truth, double lag_s)
{
	struct model_options fine = model_defaults;
	struct model_prediction p;

	for (enum model_fidelity rung = MODEL_SDOF; rung < MODEL_PLANAR; rung++) {
		fine.refinements = rung == MODEL_COUPLED ? MODEL_STIFFNESS | MODEL_WEDGE : MODEL_OF_RUNG;
		if (model_solve(s, rung, &fine, &p, NULL) == 0 &&
		    auto_apart(&p, truth, o->asked, lag_s) < o->accuracy)
			return rung;
	}
	return MODEL_PLANAR;
}

static void question(const struct scene *s, struct tally *t)
{
	struct model_options o = model_defaults, fine = model_defaults;
	struct model_prediction least, full, truth;
	double apart, lag_s;
	enum model_fidelity would;

	fine.tolerance = 1e-8;
	o.asked = random_question(s);
	o.accuracy = accuracies[(int)uniform(0.0, 5.0)];
	lag_s = 1e-6 * MODEL_LAG_ACCURACY_US / o.accuracy;
	if (model_solve(s, MODEL_PLANAR, &fine, &truth, NULL) != 0)
		return; /* through the mat */
	t->questions++;
	assert_int_equal(model_solve(s, MODEL_PLANAR, NULL, &full, NULL), 0);
	assert_int_equal(model_solve(s, MODEL_AUTO, &o, &least, NULL), 0);
	apart = auto_apart(&least, &truth, o.asked, lag_s);
	t->good += apart < o.accuracy;
	assert_true(least.rung >= MODEL_SDOF); /* the study's models are no rungs of it */
	t->taken[least.rung]++;
	t->cost += least.evaluations;
	t->always += full.evaluations;
	would = least_of(s, &o, &truth, lag_s);
	t->serves += would < MODEL_PLANAR;
	t->least += would < MODEL_PLANAR && least.rung == would;
	if (!(apart < o.accuracy))
		print_message("question %d: %s misses %x by %.2f %%, asked %g %%, told %.2f %%\n",
		              t->questions, least.fidelity, o.asked, 100.0 * apart, 100.0 * o.accuracy,
		              100.0 * least.difference);
}

static void check_tally(const struct tally *t, double cheaper)
{
	print_message("%d of %d within; sdof %d, coupled %d, planar %d; a rung below planar serves %d times, "
	              "taken %d times; %.1f times fewer evaluations\n",
	              t->good, t->questions, t->taken[MODEL_SDOF], t->taken[MODEL_COUPLED],
	              t->taken[MODEL_PLANAR], t->serves, t->least, (double)t->always / (double)t->cost);
	assert_true(t->good >= t->questions * 99 / 100);
	assert_true(t->least * 10 >= t->serves * 6);
	assert_true((double)t->always >= cheaper * (double)t->cost);
}

static void test_random_questions(void **unused)
{
	struct tally t = {.questions = 0};

	(void)unused;
	state = SEED;
	while (t.questions < DROPS) {
		struct scene s = random_scene();

		question(&s, &t);
	}
	check_tally(&t, CHEAPER);
}

/* Cubes to crates, plates of a thousandth to twice the box, restitution to the ends of its range. */
static void test_widest_questions(void **unused)
{
	struct tally t = {.questions = 0};

	(void)unused;
	state = SEED + 2;
	while (t.questions < DROPS) {
		struct scene s = random_scene();
		double omega;

		s.drop_height_m = spread(0.05, 2.4);
		s.drop_angle_deg = uniform(8.0, 60.0);
		s.product_case_mass_kg = spread(0.05, 50.0);
		s.product_length_m = spread(0.03, 2.0);
		s.product_width_m = s.product_length_m * uniform(0.3, 1.0);
		s.contact_duration_s = spread(0.5e-3, 15e-3);
		s.contact_duration_height_m = s.drop_height_m;
		s.contact_mass_kg = s.product_case_mass_kg;
		s.contact_restitution = uniform(0.01, 0.99);
		s.contact_mat_thickness_m = 10.0;
		s.contact_stiffness_n_m15 = s.product_case_mass_kg * pow(3.3 / s.contact_duration_s, 2.5) /
		                            pow(2.0 * s.drop_gravity_m_s2 * s.drop_height_m, 0.25);
		s.mount_plate_mass_kg = s.product_case_mass_kg * spread(0.001, 2.0);
		omega = 2.0 * PI * spread(0.08, 6.0) / s.contact_duration_s;
		s.mount_stiffness_n_m =
		        omega * omega / (1.0 / s.mount_plate_mass_kg + 1.0 / s.product_case_mass_kg);
		question(&s, &t);
	}
	check_tally(&t, 1.0);
}

/* The default's steps find each slip, hold and second touch: nothing that finer steps would change. */
static void test_steps_are_fine_enough(void **unused)
{
	(void)unused;
	state = SEED + 3;
	for (int i = 0; i < 1500; i++) {
		struct model_options o = model_defaults;
		struct model_prediction p, fine;
		struct scene s = random_scene();

		s.drop_angle_deg = uniform(8.0, 60.0);
		s.contact_restitution = uniform(0.01, 0.99);
		s.contact_mat_thickness_m = 10.0;
		s.contact_friction = uniform(0.05, 1.2);
		s.contact_tangential_ratio = uniform(0.2, 5.0);
		o.ring = false;
		assert_int_equal(model_solve(&s, MODEL_PLANAR, &o, &p, NULL), 0);
		o.tolerance = 1e-8;
		assert_int_equal(model_solve(&s, MODEL_PLANAR, &o, &fine, NULL), 0);
		if (!(auto_apart(&p, &fine, MODEL_ASK_AXES | MODEL_ASK_BOX | MODEL_ASK_S2, 0.0) < 2e-4))
			fail_msg("drop %d: %.3g of a peak", i,
			         auto_apart(&p, &fine, MODEL_ASK_AXES | MODEL_ASK_BOX | MODEL_ASK_S2, 0.0));
	}
}

static struct model_prediction ask(const struct scene *s, unsigned asked, double accuracy)
{
	struct model_options o = model_defaults;
	char message[MODEL_MESSAGE_MAX];
	struct model_prediction p;

	o.asked = asked;
	o.accuracy = accuracy;
	if (model_solve(s, MODEL_AUTO, &o, &p, message) != 0)
		fail_msg("%s", message);
	assert_true(strlen(p.reason) > 40);
	return p;
}

static void test_the_study(void **unused)
{
	struct scene box = shipped_scene("1"), plate = shipped_scene("2A");

	(void)unused;
	/* at the balance angle nothing turns: two masses are enough for the box, one for a rough plate */
	assert_string_equal(ask(&box, MODEL_ASK_BOX, 0.05).fidelity, "coupled");
	assert_string_equal(ask(&plate, MODEL_ASK_BOX, 0.05).fidelity, "coupled");
	assert_string_equal(ask(&plate, MODEL_ASK_PLATE, 0.2).fidelity, "sdof");
	assert_string_equal(ask(&plate, MODEL_ASK_PLATE, 0.01).fidelity, "planar");
	assert_string_equal(ask(&plate, MODEL_ASK_LAG, 0.2).fidelity, "planar");
	assert_string_equal(ask(&plate, MODEL_ASK_ALL, 0.2).fidelity, "planar");
	assert_true(ask(&plate, MODEL_ASK_PLATE, 0.2).next == MODEL_PLANAR);
	assert_true(ask(&plate, MODEL_ASK_PLATE, 0.2).next_change < 0.2);
	assert_true(ask(&plate, MODEL_ASK_BOX, 0.05).difference <= 0.05);
	assert_true(ask(&plate, MODEL_ASK_BOX, 0.01).difference <= 0.01);
	/* with everything asked, it is planar as by itself, ring-down and all */
	assert_true(ask(&plate, 0, 0.0).plate_frequency_hz > 100.0);
	assert_non_null(strstr(ask(&plate, 0, 0.0).reason, "answers every question asked"));
	assert_non_null(strstr(ask(&plate, MODEL_ASK_PLATE, 0.2).reason, "within 20 %"));
}

/* What is not asked for is not told, what is asked for comes as from the whole. */
static void test_partial_answers(void **unused)
{
	const enum model_fidelity rungs[] = {MODEL_COUPLED, MODEL_PLANAR};
	struct scene s = shipped_scene("2B");

	(void)unused;
	s.drop_angle_deg = 33.0;
	for (int r = 0; r < 2; r++)
		for (unsigned asked = 1; asked <= MODEL_ASK_ALL; asked++) {
			struct model_options o = model_defaults;
			struct model_prediction whole, part;

			assert_int_equal(model_solve(&s, rungs[r], &o, &whole, NULL), 0);
			o.asked = asked;
			assert_int_equal(model_solve(&s, rungs[r], &o, &part, NULL), 0);
			assert_true(auto_apart(&part, &whole, asked, 0.0) < 1e-12);
			o.tolerance = 0.01;
			assert_int_equal(model_solve(&s, rungs[r], &o, &part, NULL), 0);
			assert_true(auto_apart(&part, &whole, asked, 0.0) < 5e-3);
			assert_true(part.dent_share > 0.2 && part.dent_share < 0.4);
			if (!(asked & (MODEL_ASK_BOX | MODEL_ASK_S2)))
				assert_true(isnan(part.box.value_g));
			if (asked == MODEL_ASK_BOX)
				assert_true(isnan(part.resultant[0].value_g) && isnan(part.lag_s));
			assert_true(!(part.notes & MODEL_NOTE_STUCK));
		}
}

static void test_names_and_refusals(void **unused)
{
	struct model_options o = model_defaults;
	struct scene s = shipped_scene("2A");
	char message[MODEL_MESSAGE_MAX];
	enum model_question question;
	struct model_prediction p;

	(void)unused;
	assert_int_equal(model_question_parse("direction", &question), 0);
	assert_true(question == MODEL_ASK_DIRECTION);
	assert_int_equal(model_question_parse("plates", &question), DT_E_UNKNOWN);
	o.accuracy = -0.1;
	assert_int_equal(model_solve(&s, MODEL_AUTO, &o, &p, message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, "accuracy"));
	o.accuracy = 0.1;
	s.mount_stiffness_n_m = 0.0;
	assert_int_equal(model_solve(&s, MODEL_AUTO, &o, &p, message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, "stiffness_n_m"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_random_questions),   cmocka_unit_test(test_widest_questions),
	        cmocka_unit_test(test_the_study),          cmocka_unit_test(test_partial_answers),
	        cmocka_unit_test(test_names_and_refusals), cmocka_unit_test(test_steps_are_fine_enough),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
