/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Decisions, test plans and verdicts. The numbers of decision rules are those of ILAC-G8, JCGM 106 and of our
 * own calculations, to their last digit.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "host/result/decide.h"
#include "host/result/plan.h"
#include "host/result/verdict.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

/* ---- one value ---- */

static void test_risk_at_the_guard_band(void **state)
{
	(void)state;
	assert_near(decide_risk(0.0), 0.50, 0.005);
	assert_near(decide_risk(0.5), 0.159, 0.0005);
	assert_near(decide_risk(0.83), 0.048, 0.0005);
	assert_near(decide_risk(1.0), 0.023, 0.0005);
	assert_near(decide_risk(1.5), 0.0013, 0.00005);
}

static void test_probability_of_conformity(void **state)
{
	(void)state;
	assert_near(decide_probability(13.6, 1.8, 12.5, 16.3), 0.6626, 0.00005);
	assert_near(decide_probability(10, 1, -INFINITY, 10), 0.5, 1e-12);
	assert_near(decide_probability(9, 0, 8, 10), 1, 0);
	assert_near(decide_probability(11, 0, 8, 10), 0, 0);
	assert_true(isnan(decide_probability(9, NAN, 8, 10)));
}

/* TL 500, u 5, so U 10: the edges of the four zones, for r 1 and for r 0. */
static void test_four_zones_with_their_edges(void **state)
{
	static const struct {
		double value, guard;
		enum decision decision;
	} cases[] = {
	        {490, 1, DECIDE_PASS},
	        {490.001, 1, DECIDE_CONDITIONAL_PASS},
	        {500, 1, DECIDE_CONDITIONAL_PASS},
	        {500.001, 1, DECIDE_CONDITIONAL_FAIL},
	        {510, 1, DECIDE_CONDITIONAL_FAIL},
	        {510.001, 1, DECIDE_FAIL},
	        {500, 0, DECIDE_PASS},
	        {500.001, 0, DECIDE_FAIL},
	        {495, 0.5, DECIDE_PASS},
	        {495.001, 0.5, DECIDE_CONDITIONAL_PASS},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
		assert_int_equal(decide_value(cases[i].value, 5, -INFINITY, 500, cases[i].guard),
		                 cases[i].decision);
	assert_int_equal(decide_value(490, NAN, -INFINITY, 500, 1), DECIDE_UNDECIDED);
	assert_int_equal(decide_value(NAN, 5, -INFINITY, 500, 1), DECIDE_UNDECIDED);
	/* guard bands that overlap leave no pass between two limits */
	assert_int_equal(decide_value(495, 5, 485, 500, 1), DECIDE_CONDITIONAL_PASS);
}

static void test_names_and_what_meets(void **state)
{
	(void)state;
	assert_string_equal(decide_name(DECIDE_CONDITIONAL_PASS), "conditional pass");
	assert_true(decide_meets(DECIDE_PASS) && decide_meets(DECIDE_CONDITIONAL_PASS));
	assert_false(decide_meets(DECIDE_UNDECIDED) || decide_meets(DECIDE_CONDITIONAL_FAIL) ||
	             decide_meets(DECIDE_FAIL) || decide_meets(DECIDE_NONE));
}

/* ---- many points ---- */

enum { POINTS = 21 };

/* All of them at TL - U, a share of their variance common: the probability that one is outside. */
static double outside(size_t count, double common_share)
{
	struct decide_point point[POINTS];

	for (size_t i = 0; i < count; i++)
		point[i] = (struct decide_point){2.0, INFINITY, sqrt(1 - common_share), sqrt(common_share)};
	return 1 - decide_all(point, count);
}

static void test_many_points_at_the_guard_band(void **state)
{
	(void)state;
	for (size_t count = 1; count <= POINTS; count += 5)
		assert_near(outside(count, 1.0), 0.02275, 0.00001);
	assert_near(outside(5, 0.0), 0.108691, 1e-6); /* 1 - P(2)^n */
	assert_near(outside(21, 0.0), 0.383237, 1e-6);
	/* By draws elsewhere 8.5 and 20 %, and 10.8 and 38 % for the two above: within their scatter. */
	assert_near(outside(5, 0.5), 0.084152, 1e-6);
	assert_near(outside(21, 0.5), 0.201315, 1e-6);
}

/* Against draws: common parts once a trial, noise for each point. */
static void test_probability_of_a_curve_against_draws(void **state)
{
	enum { DRAWS = 200000 };
	struct decide_point point[POINTS];
	size_t within = 0;

	(void)state;
	for (size_t i = 0; i < POINTS; i++)
		point[i] = (struct decide_point){2.0 + 0.3 * (double)(i % 4), 2.5 + 0.2 * (double)(i % 3),
		                                 0.8, i % 2 ? 1.1 : -0.6};
	srand48(7);
	for (size_t n = 0; n < DRAWS; n++) {
		double common = sqrt(-2 * log(1 - drand48())) * cos(2 * 3.14159265358979 * drand48());
		bool inside = true;

		for (size_t i = 0; i < POINTS && inside; i++) {
			double own = sqrt(-2 * log(1 - drand48())) * cos(2 * 3.14159265358979 * drand48());
			double off = common * point[i].common + own * point[i].own;

			inside = off <= point[i].below_upper && off >= -point[i].above_lower;
		}
		within += inside;
	}
	assert_near(decide_all(point, POINTS), (double)within / DRAWS, 0.01);
}

static void test_points_without_noise_of_their_own(void **state)
{
	struct decide_point point[2] = {{1, 2, 0, 1}, {3, 1, 0, 1}};

	(void)state;
	assert_near(decide_all(point, 2), 0.6827, 0.0001); /* common part within -1 to 1 */
	point[1].common = 0;
	assert_near(decide_all(point, 2), 0.8186, 0.0001); /* within -2 to 1 */
	point[1].below_upper = -1;
	assert_near(decide_all(point, 2), 0, 0);
}

static void test_decision_over_points_and_shares(void **state)
{
	struct decide_point point[10];

	(void)state;
	for (size_t i = 0; i < 10; i++)
		point[i] = (struct decide_point){5, 5, 1, 0};
	/* own parts among ten points: the band of one, and wider */
	assert_near(decide_guard(&point[0], 1, 1), 2, 1e-9);
	assert_near(decide_guard(&point[0], 10, 1), 2.8373, 0.0001);
	assert_int_equal(decide_points(point, 10, 1, 1), DECIDE_PASS);
	point[3].below_upper = 2.5;
	assert_int_equal(decide_points(point, 10, 1, 1), DECIDE_CONDITIONAL_PASS);
	point[3].below_upper = -2.5;
	assert_int_equal(decide_points(point, 10, 1, 1), DECIDE_CONDITIONAL_FAIL);
	point[3].below_upper = -3;
	assert_int_equal(decide_points(point, 10, 1, 1), DECIDE_FAIL);
	assert_int_equal(decide_points(point, 10, 1, 0.9), DECIDE_PASS);
	point[4].below_upper = -3;
	assert_int_equal(decide_points(point, 10, 1, 0.9), DECIDE_FAIL);
	point[5].own = NAN;
	assert_int_equal(decide_points(point, 10, 1, 0.9), DECIDE_UNDECIDED);
	assert_int_equal(decide_points(point, 0, 1, 1), DECIDE_UNDECIDED);
}

/* ---- plans ---- */

static void refuses(const char *limits, const char *why)
{
	char message[SCENE_MESSAGE_MAX] = "";
	struct plan plan;

	assert_int_not_equal(plan_read(&plan, limits, "s.ini", message), 0);
	if (strstr(message, why) == NULL)
		fail_msg("'%s' has no '%s'", message, why);
}

static void reads(struct plan *plan, const char *limits)
{
	char message[SCENE_MESSAGE_MAX] = "";

	if (plan_read(plan, limits, "s.ini", message) != 0)
		fail_msg("%s", message);
}

static void test_a_plan_is_read(void **state)
{
	struct plan plan;

	(void)state;
	reads(&plan, "4:channel=S2X\n5:peak.value_g=400 600\n6:S1.peak_g=- 300\n7:plate.frequency_hz=100 -\n"
	             "8:guard=0.5\n9:chain_percent=1.4\n10:spectrum=10:5:20\n11:spectrum=100:100:400\n"
	             "12:lag.driven.lag_s=0.001 0.002\n13:spectrum_share=90\n");
	assert_int_equal(plan.count, 4);
	assert_int_equal(plan.limit[0].place, QUANTITY_AT_PEAK);
	assert_string_equal(plan.limit[0].subject, "");
	assert_string_equal(plan.limit[1].subject, "S1");
	assert_int_equal(plan.limit[1].place, QUANTITY_AT_RESULTANT);
	assert_true(isinf(plan.limit[1].lower) && isinf(plan.limit[2].upper));
	assert_int_equal(plan.limit[3].place, QUANTITY_AT_DRIVEN);
	assert_int_equal(plan.spectrum.count, 2);
	assert_near(plan.guard, 0.5, 0);
	assert_near(plan.chain, 0.014, 1e-12);
	assert_near(plan.share, 0.9, 1e-12);
	reads(&plan, "");
	assert_true(plan_is_empty(&plan));
}

static void test_a_wrong_plan_is_refused_by_line(void **state)
{
	(void)state;
	refuses("4:peek.value_g=1 2\n", "s.ini:4: unknown key 'peek.value_g'");
	refuses("5:S1.S2.peak_g=1 2\n", "s.ini:5: unknown key");
	refuses("4:peak.value_g=600 400\n", "s.ini:4: peak.value_g: lower limit 600 is not below");
	refuses("4:peak.value_g=- -\n", "expected a lower and an upper limit");
	refuses("4:peak.value_g=1\n", "expected a lower and an upper limit");
	refuses("4:peak.value_g=1 2 3\n", "expected a lower and an upper limit");
	refuses("4:guard=4\n", "s.ini:4: guard is '4', expected 0 to 3");
	refuses("4:preset=iec\n", "s.ini:4: no preset 'iec'");
	refuses("4:preset=jesd22-b110-b\n", "'jesd22-b110-b' has no tolerances of its own");
	refuses("4:spectrum=10:5:20\n", "a spectrum of one point");
	refuses("4:spectrum=10:5:20 9:5:20\n", "expected rising FREQUENCY_HZ:LOWER_G:UPPER_G");
	refuses("4:guard=1\n", "[limits] limits nothing");
	refuses("4:verdict.guard_ratio=1 2\n", "unknown key");
	refuses("4:channel=\n", "channel is empty");
}

static void test_a_preset_gives_limits(void **state)
{
	struct plan plan;

	(void)state;
	reads(&plan, "4:preset=iec-60068-2-27-500g-1ms\n");
	assert_int_equal(plan.count, 2);
	assert_near(plan.limit[0].lower, 400, 1e-9);
	assert_near(plan.limit[0].upper, 600, 1e-9);
	assert_near(plan.limit[1].lower, 0.85 * 3.1215, 0.001);
	assert_near(plan.band_g, 100, 1e-9);
	assert_near(plan.transverse, 0.3, 1e-12);
	assert_false(plan.preset->verified);
	reads(&plan, "4:preset=mil-std-810h-516-ground\n5:peak_percent=15\n6:duration_percent=10\n");
	assert_int_equal(plan.count, 2);
	assert_near(plan.limit[1].upper, 1.1 * 0.9 * 0.011, 1e-9);
}

/* A D times 2/pi, 1/2 and .9; height dv^2/2g; B of JESD22-B110B 4.68 m/s, 112 cm. */
static void test_nominal_pulses(void **state)
{
	double dv = plan_velocity_m_s(PLAN_HALF_SINE, 1500, 0.0005);

	(void)state;
	assert_near(dv, 4.68, 0.005);
	assert_near(100 * plan_height_m(dv), 112, 0.5);
	for (enum plan_shape shape = PLAN_HALF_SINE; shape <= PLAN_TRAPEZOID; shape++) {
		double sum = 0;

		for (int i = 0; i < 100000; i++)
			sum += plan_pulse(shape, (i + 0.5) / 100000) / 100000;
		assert_near(plan_velocity_m_s(shape, 1 / 9.80665, 1), sum, 1e-5);
		for (double x = 0; x < 0.5; x += 1e-5)
			if (plan_pulse(shape, x) < 0.1 && plan_pulse(shape, x + 1e-5) >= 0.1 &&
			    shape != PLAN_SAW_TOOTH)
				assert_near(plan_width(shape), 1 - 2 * x, 1e-4);
	}
	assert_near(plan_width(PLAN_SAW_TOOTH), 0.9, 0);
}

static void test_every_preset_is_a_pulse(void **state)
{
	size_t i = 0;

	(void)state;
	for (; plan_preset(i) != NULL; i++) {
		const struct plan_preset *p = plan_preset(i);

		assert_true(p->peak_g > 0 && p->duration_ms > 0 && p->source[0] != '\0');
		assert_false(p->verified); /* until somebody has read the standard */
	}
	assert_int_equal(i, 13 + 9 + 3);
}

/* ---- verdicts on records ---- */

#define RATE_HZ 100000.0

/* A half-sine on a quiet base with noise of sigma_g, called main, and a weaker one beside it. */
struct trial {
	struct record record;
	struct analysis analysis;
	struct estimate_options options;
	struct verdict verdict;
};

static void trial_channel(struct record *record, const char *name, double peak_g, double duration_s,
                          double sigma_g, unsigned seed)
{
	struct channel *c = record_add_channel(record, name, RATE_HZ, 6000);

	assert_non_null(c);
	srand48(seed);
	for (size_t k = 0; k < c->count; k++) {
		double t = (double)k / RATE_HZ - 0.03;
		double gauss = sqrt(-2 * log(1 - drand48())) * cos(2 * 3.14159265358979 * drand48());

		c->value_g[k] = peak_g * plan_pulse(PLAN_HALF_SINE, t / duration_s) + sigma_g * gauss;
		c->sample[k] = 0;
	}
}

static void judge(struct trial *t, double peak_g, double transverse_g, double sigma_g, const char *limits)
{
	struct result said;
	struct plan plan;

	memset(t, 0, sizeof(*t));
	record_init(&t->record);
	trial_channel(&t->record, "aX", peak_g, 0.001, sigma_g, 3);
	trial_channel(&t->record, "aY", transverse_g, 0.001, sigma_g, 4);
	record_finish(&t->record);
	assert_int_equal(estimate_record(&t->record, &t->options, &t->analysis), 0);
	said = result_of(&t->record, &t->analysis, &t->options);
	reads(&plan, limits);
	assert_int_equal(verdict_judge(&t->verdict, &plan, &said), 0);
}

static void trial_end(struct trial *t)
{
	estimate_free(&t->analysis);
	record_free(&t->record);
}

static const struct verdict_item *item_of(const struct trial *t, const char *what)
{
	for (size_t i = 0; i < t->verdict.count; i++)
		if (strcmp(t->verdict.item[i].what, what) == 0)
			return &t->verdict.item[i];
	fail_msg("no %s", what);
	return NULL;
}

#define PRESET_LIMITS "1:preset=iec-60068-2-27-500g-1ms\n2:channel=aX\n"

static void test_a_good_pulse_passes(void **state)
{
	struct trial t;

	(void)state;
	judge(&t, -505, 60, 1.0, PRESET_LIMITS "3:chain_percent=1\n"); /* the magnitude counts */
	assert_int_equal(t.verdict.count, 4);
	for (size_t i = 0; i < t.verdict.count; i++)
		if (t.verdict.item[i].decision != DECIDE_PASS)
			fail_msg("%s: %s %s", t.verdict.item[i].what, decide_name(t.verdict.item[i].decision),
			         t.verdict.item[i].reason);
	assert_int_equal(t.verdict.decision, DECIDE_PASS);
	assert_near(item_of(&t, "aX.peak.value_g")->sigma, 5.05, 0.1);
	assert_near(item_of(&t, "aX.transverse_ratio")->value, 100.0 * 60 / 505, 1);
	assert_false(t.verdict.verified);
	trial_end(&t);
}

static void test_each_limit_can_fail(void **state)
{
	struct trial t;

	(void)state;
	judge(&t, 640, 60, 1.0, PRESET_LIMITS);
	assert_int_equal(item_of(&t, "aX.peak.value_g")->decision, DECIDE_FAIL);
	assert_int_equal(item_of(&t, "aX.pulse.velocity_change_m_s")->decision, DECIDE_FAIL);
	assert_int_equal(item_of(&t, "aX.band")->decision, DECIDE_FAIL);
	assert_near(item_of(&t, "aX.band")->at, 0.5, 0.2); /* at the crest, ms after the start */
	assert_int_equal(t.verdict.failed, 3);
	trial_end(&t);
	judge(&t, 500, 200, 1.0, PRESET_LIMITS);
	assert_int_equal(item_of(&t, "aX.transverse_ratio")->decision, DECIDE_FAIL);
	assert_int_equal(t.verdict.failed, 1);
	assert_string_equal(t.verdict.name, "fail");
	trial_end(&t);
}

/* The limit at the edge of the uncertainty: the chain's 1 % of 500 g is u 5 g, U 10 g. */
static void test_a_limit_at_the_edge(void **state)
{
	static const struct {
		const char *limits;
		enum decision decision;
	} cases[] = {{"1:channel=aX\n2:chain_percent=1\n3:peak.value_g=- 512\n", DECIDE_PASS},
	             {"1:channel=aX\n2:chain_percent=1\n3:peak.value_g=- 508\n", DECIDE_CONDITIONAL_PASS},
	             {"1:channel=aX\n2:chain_percent=1\n3:peak.value_g=- 494\n", DECIDE_CONDITIONAL_FAIL},
	             {"1:channel=aX\n2:chain_percent=1\n3:peak.value_g=- 487\n", DECIDE_FAIL},
	             {"1:channel=aX\n2:peak.value_g=- 508\n", DECIDE_PASS}};
	struct trial t;

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		judge(&t, 500, 10, 1.0, cases[i].limits);
		assert_int_equal(t.verdict.decision, cases[i].decision);
		trial_end(&t);
	}
}

static void test_spectrum_between_curves(void **state)
{
	struct trial t;

	(void)state;
	judge(&t, 500, 10, 1.0, "1:channel=aX\n2:spectrum=100:50:600 1000:400:1000\n");
	assert_int_equal(t.verdict.decision, DECIDE_PASS);
	trial_end(&t);
	judge(&t, 500, 10, 1.0, "1:channel=aX\n2:spectrum=100:50:600 1000:400:700\n");
	assert_int_equal(t.verdict.decision, DECIDE_FAIL);
	assert_true(item_of(&t, "aX.spectrum")->at > 500);
	trial_end(&t);
}

/* A sensor's file puts its U in the place of the value's noise; a value of a sensor without one is undecided.
 */
static void test_a_budget_decides(void **state)
{
	struct budget_item item = {.what = "aX.peak.value_g", .value = 500, .part = {1}};
	struct budget budget = {.count = 1, .item = &item};
	struct trial t;
	struct result said;
	struct plan plan;

	(void)state;
	judge(&t, 500, 1, 1.0, "1:channel=aX\n2:peak.value_g=400 600\n");
	said = result_of(&t.record, &t.analysis, &t.options);
	said.budget = &budget;
	reads(&plan, "1:channel=aX\n2:peak.value_g=400 600\n");
	item.expanded = 99;
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_PASS);
	assert_near(t.verdict.item[0].guard, 99, 1e-9);
	item.expanded = 101;
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_CONDITIONAL_PASS);
	item.what[0] = 'b';
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	assert_string_equal(t.verdict.item[0].reason, "its sensor has no file");
	trial_end(&t);
}

/* 510 +- 8 against 500 +- 6: E_n is 1; by the noise alone nothing is known. */
static void test_a_check_against_a_reference(void **state)
{
	static const char limits[] = "1:channel=aX\n2:peak.value_g=500 +- 6\n";
	struct budget_item item = {.what = "aX.peak.value_g", .value = 510, .part = {1}, .expanded = 8};
	struct budget budget = {.count = 1, .item = &item};
	struct sensors sensors = {.count = 2};
	struct trial t;
	struct result said;
	struct plan plan;

	(void)state;
	reads(&plan, limits);
	judge(&t, 510, 1, 1.0, limits);
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	assert_string_equal(t.verdict.item[0].reason, "no expanded uncertainty");
	said = result_of(&t.record, &t.analysis, &t.options);
	said.budget = &budget;
	said.sensors = &sensors;
	snprintf(sensors.used[1].transducer.channel[2], sizeof(sensors.used[1].transducer.channel[2]), "aX");
	sensors.used[0].e_n = sensors.used[1].e_n = NAN;
	t.analysis.channels[0].peak.value_g = -509.999;
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_PASS);
	assert_near(sensors.used[1].e_n, 0.9999, 1e-9);
	assert_true(isnan(sensors.used[0].e_n));
	assert_near(t.verdict.item[0].lower, 490, 1e-9);
	t.analysis.channels[0].peak.value_g = 488.2;
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_FAIL);
	assert_near(sensors.used[1].e_n, -1.18, 1e-9);
	assert_string_equal(t.verdict.item[0].reason, "E_n -1.18");
	trial_end(&t);
	refuses("1:S1.peak_g=500 +- 0\n", "expected a lower and an upper limit");
	refuses("1:S1.peak_g=500 +-\n", "expected a lower and an upper limit");
	refuses("1:S1.peak_g=- +- 5\n", "expected a lower and an upper limit");
}

static void test_what_is_flagged_or_unknown_never_passes(void **state)
{
	struct trial t;
	struct result said;
	struct plan plan;

	(void)state;
	judge(&t, 500, 10, 1.0, "1:channel=aX\n2:peak.value_g=400 600\n3:lag.spread_s=0 1\n");
	assert_int_equal(t.verdict.item[0].decision, DECIDE_PASS);
	assert_int_equal(t.verdict.item[1].decision, DECIDE_UNDECIDED); /* one sensor has no lag */
	assert_string_equal(t.verdict.item[1].reason, "no value");
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	said = result_of(&t.record, &t.analysis, &t.options);
	reads(&plan, "1:channel=aX\n2:peak.value_g=400 600\n");
	for (unsigned bit = 1; record_flag_name(bit)[0] != '\0'; bit <<= 1) { /* of the channel */
		t.analysis.channels[0].flags = bit;
		assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
		/* a default is an uncertainty, too */
		assert_int_equal(t.verdict.decision,
		                 bit == RECORD_FLAG_DEFAULT_USED ? DECIDE_PASS : DECIDE_UNDECIDED);
		assert_string_equal(t.verdict.item[0].reason,
		                    bit == RECORD_FLAG_DEFAULT_USED ? "" : record_flag_name(bit));
	}
	t.analysis.channels[0].flags = 0;
	for (unsigned bit = 1; estimate_flag_name(bit)[0] != '\0'; bit <<= 1) { /* of the value */
		t.analysis.channels[0].peak.how.flags = bit;
		assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
		assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	}
	t.analysis.channels[0].peak.how.flags = 0;
	t.record.flags = RECORD_FLAG_FAULT; /* of the drop */
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	t.record.flags = 0;
	t.analysis.channels[1].flags = RECORD_FLAG_CLIPPED; /* another channel's is none of it */
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_PASS);
	t.analysis.channels[0].peak.sigma_g = NAN;
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	assert_string_equal(t.verdict.item[0].reason, "no uncertainty");
	t.analysis.channels[0].peak.sigma_g = 1;
	t.analysis.channels[0].flags = RECORD_FLAG_CLIPPED; /* but what fails, fails */
	reads(&plan, "1:channel=aX\n2:peak.value_g=- 400\n");
	assert_int_equal(verdict_judge(&t.verdict, &plan, &said), 0);
	assert_int_equal(t.verdict.decision, DECIDE_FAIL);
	trial_end(&t);
}

static void test_a_channel_that_is_not_there(void **state)
{
	struct trial t;

	(void)state;
	judge(&t, 500, 10, 1.0, "1:preset=iec-60068-2-27-500g-1ms\n2:channel=zX\n");
	assert_int_equal(t.verdict.decision, DECIDE_UNDECIDED);
	assert_int_equal(t.verdict.undecided, t.verdict.count);
	trial_end(&t);
	/* a sensor that is torn off reads noise */
	judge(&t, 0, 0, 1.0, PRESET_LIMITS);
	assert_false(decide_meets(t.verdict.decision));
	assert_int_not_equal(item_of(&t, "aX.peak.value_g")->decision, DECIDE_PASS);
	assert_int_not_equal(item_of(&t, "aX.band")->decision, DECIDE_PASS);
	trial_end(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_risk_at_the_guard_band),
	        cmocka_unit_test(test_probability_of_conformity),
	        cmocka_unit_test(test_four_zones_with_their_edges),
	        cmocka_unit_test(test_names_and_what_meets),
	        cmocka_unit_test(test_many_points_at_the_guard_band),
	        cmocka_unit_test(test_probability_of_a_curve_against_draws),
	        cmocka_unit_test(test_points_without_noise_of_their_own),
	        cmocka_unit_test(test_decision_over_points_and_shares),
	        cmocka_unit_test(test_a_plan_is_read),
	        cmocka_unit_test(test_a_wrong_plan_is_refused_by_line),
	        cmocka_unit_test(test_a_preset_gives_limits),
	        cmocka_unit_test(test_nominal_pulses),
	        cmocka_unit_test(test_every_preset_is_a_pulse),
	        cmocka_unit_test(test_a_good_pulse_passes),
	        cmocka_unit_test(test_each_limit_can_fail),
	        cmocka_unit_test(test_a_limit_at_the_edge),
	        cmocka_unit_test(test_spectrum_between_curves),
	        cmocka_unit_test(test_a_budget_decides),
	        cmocka_unit_test(test_a_check_against_a_reference),
	        cmocka_unit_test(test_what_is_flagged_or_unknown_never_passes),
	        cmocka_unit_test(test_a_channel_that_is_not_there),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
