/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Estimates without a scene on drops of the bench's plant: its plates soften, swing in the plane and feel a
 * case that turns, which no estimator knows. Noise of 1 g, codes of 1/32 g, no error of gain. Counted is how
 * often the truth lies within two of the value's uncertainty, over angles of 15 to 35 degrees and by
 * geometry; DROPS from the environment is the number of drops an angle.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/units.h"
#include "hil/product.h"
#include "host/estimate/estimate.h"
#include "host/record/drop.h"
#include "tests/unit/shipped.h"
#include "tests/unit/synth.h"

enum { S1X, S1Y, S2X, S2Y, AXES, CHANNELS = AXES, STEPS = 22500, DROPS = 20 };

#define STEP_S 4e-6
#define ONSET_S 0.1
#define LENGTH_S 0.19
#define NOISE_G 1.0
#define CODE_G (1.0 / 32)
#define LAG_SIGMA_S 13e-6 /* at most */
#define CONTACT_S 3e-3    /* what 2 % of a time are of */

/* Of each axis, then of S1's and S2's resultant: height and time. Last the lag. */
enum { HEIGHT, TIME, KINDS, LAG = (AXES + 2) * KINDS, COUNTS };

static const char *const names[COUNTS] = {"S1X",        "S1X's time", "S1Y",        "S1Y's time", "S2X",
                                          "S2X's time", "S2Y",        "S2Y's time", "S1",         "S1's time",
                                          "S2",         "S2's time",  "lag"};

struct count {
	unsigned values, within, silent;
	double sigma_squares;
};

static double reading_g[AXES][STEPS], length_g[2][STEPS];

static void fall(const struct scene *scene, double angle_deg)
{
	struct product product;

	product_init(&product, scene, UNITS_RAD(angle_deg));
	product_strike(&product, sqrt(2 * UNITS_G_M_S2 * scene->drop_height_m));
	for (size_t i = 0; i < STEPS; i++) {
		struct product_reading r;

		product_read(&product, &r);
		reading_g[S1X][i] = r.s1_x / UNITS_G_M_S2;
		reading_g[S1Y][i] = r.s1_y / UNITS_G_M_S2;
		reading_g[S2X][i] = r.s2_x / UNITS_G_M_S2;
		reading_g[S2Y][i] = r.s2_y / UNITS_G_M_S2;
		for (int s = 0; s < 2; s++)
			length_g[s][i] = hypot(reading_g[2 * s][i], reading_g[2 * s + 1][i]);
		assert_true(product_step(&product, STEP_S) == STEP_S);
	}
}

static void sample(struct channel channel[CHANNELS], double onset_s, struct synth_random *random)
{
	static const char *const channel_names[CHANNELS] = {"S1X", "S1Y", "S2X", "S2Y"};

	for (int c = 0; c < CHANNELS; c++) {
		double rate_hz = c == S1X || c == S2X ? 7000 : 10000;

		channel[c] = synth_channel(channel_names[c], rate_hz, 0, (size_t)(LENGTH_S * rate_hz));
		for (size_t k = 0; k < channel[c].count; k++) {
			double t = (double)k / rate_hz - onset_s;
			double value = synth_table(reading_g[c], STEPS, STEP_S, t);

			channel[c].value_g[k] =
			        CODE_G * round((value + NOISE_G * synth_normal(random)) / CODE_G);
		}
	}
}

/* The largest of the first touch, by the parabola through it. */
static double top_of(const double *value, double *time_s)
{
	size_t n = STEPS / 2, at = 1;
	double bend, lean;

	for (size_t i = 1; i + 1 < n; i++)
		if (fabs(value[i]) > fabs(value[at]))
			at = i;
	bend = value[at - 1] - 2 * value[at] + value[at + 1];
	lean = (value[at + 1] - value[at - 1]) / 2;
	*time_s = STEP_S * ((double)at - lean / bend);
	return value[at] - lean * lean / (2 * bend);
}

static void judge(struct count *count, double value, double truth, double sigma, double two_percent,
                  bool flagged)
{
	double off = fabs(value - truth);

	assert_true(isfinite(value));
	count->values++;
	count->sigma_squares += sigma * sigma;
	count->within += off <= 2 * sigma;
	count->silent += !flagged && off > 3 * sigma && off > two_percent;
}

static bool flagged(const struct estimate_how *how)
{
	return how->status != ESTIMATE_OK || (how->flags & ~(unsigned)ESTIMATE_FLAG_TOLERANCE);
}

static void measure(const struct scene *scene, double angle_deg, double onset_s, struct synth_random *random,
                    struct analysis *analysis)
{
	const struct estimate_options options = {0};
	struct channel channel[CHANNELS];
	struct record record = {.channels = channel, .channel_count = CHANNELS, .is_drop = true};

	fall(scene, angle_deg);
	sample(channel, onset_s, random);
	record.trigger_s = onset_s + 0.4e-3;
	drop_set_axes(&record);
	assert_int_equal(estimate_record(&record, &options, analysis), 0);
	for (int c = 0; c < CHANNELS; c++)
		synth_free(&channel[c]);
}

static void judge_drop(struct count count[COUNTS], const struct analysis *a, double onset_s)
{
	double time_s[2];

	for (int c = 0; c < AXES; c++) {
		const struct estimate_peak *peak = &a->channels[c].peak;
		double top_s, top = top_of(reading_g[c], &top_s);
		struct count *of = &count[c * KINDS];

		judge(&of[HEIGHT], peak->value_g, top, peak->sigma_g, 0.02 * fabs(top), flagged(&peak->how));
		judge(&of[TIME], peak->time_s, onset_s + top_s, peak->sigma_time_s, 0.02 * CONTACT_S,
		      flagged(&peak->how));
	}
	assert_int_equal(a->resultant_count, 2);
	for (int s = 0; s < 2; s++) {
		const struct estimate_resultant *r = &a->resultants[s];
		double top = top_of(length_g[s], &time_s[s]);
		struct count *of = &count[(AXES + s) * KINDS];

		judge(&of[HEIGHT], r->peak_g, top, r->sigma_g, 0.02 * top, flagged(&r->how));
		judge(&of[TIME], r->time_s, onset_s + time_s[s], r->sigma_time_s, 0.02 * CONTACT_S,
		      flagged(&r->how));
	}
	assert_true(a->has_lag);
	judge(&count[LAG], a->lag.largest_peak_s, time_s[0] - time_s[1], a->lag.sigma_s, 0.02 * CONTACT_S,
	      a->lag.status != ESTIMATE_OK);
}

static void drop(const struct scene *scene, double angle_deg, struct synth_random *random,
                 struct count count[COUNTS])
{
	double onset_s = ONSET_S + 1e-3 * synth_uniform(random);
	struct analysis analysis;

	measure(scene, angle_deg + synth_normal(random), onset_s, random, &analysis);
	judge_drop(count, &analysis, onset_s);
	estimate_free(&analysis);
}

/* Two-sigma coverage of 0.93 to 1, three of its own deviations off at this number of drops. That all are
 * within shows nothing: both axes of a plate-less product lean alike and their doubts add up. */
static void bars_hold(const char *geometry)
{
	const struct scene scene = shipped_scene(geometry);
	unsigned drops = getenv("DROPS") ? (unsigned)atoi(getenv("DROPS")) : DROPS, silent = 0, bad = 0,
	         values = 0, within = 0;
	struct synth_random random = {7};
	struct count count[COUNTS] = {{0}};

	print_message("geometry %s, seed 7, %u drops an angle\n", geometry, drops);
	for (double angle_deg = 15; angle_deg <= 35; angle_deg += 5)
		for (unsigned i = 0; i < drops; i++)
			drop(&scene, angle_deg, &random, count);
	for (int k = 0; k < COUNTS; k++) {
		double n = count[k].values, part = count[k].within / n;

		print_message("  %-11s %5.1f %% of %u, silently wrong %u\n", names[k], 100 * part,
		              count[k].values, count[k].silent);
		bad += !(part >= 0.93 - 3 * sqrt(0.93 * 0.07 / n));
		silent += count[k].silent;
		values += count[k].values;
		within += count[k].within;
	}
	assert_int_equal(bad, 0);
	assert_true(sqrt(count[LAG].sigma_squares / count[LAG].values) < LAG_SIGMA_S);
	assert_true(within <= 0.985 * values);
	assert_true(silent <= 1 + 5 * drops * COUNTS / 1000);
}

static void of_no_plate(void **state)
{
	(void)state;
	bars_hold("1");
}

static void of_hard_cubes(void **state)
{
	(void)state;
	bars_hold("2A");
}

static void of_soft_cubes(void **state)
{
	(void)state;
	bars_hold("2B");
}

/* What turns with the box, from the flattest to the steepest that a scene may ask for, is no doubt of a
 * sensor. */
static void of_no_doubtful_axis(void **state)
{
	static const char *const geometries[] = {"1", "2A", "2B"};
	struct synth_random random = {8};
	unsigned drops = 0, told = 0;

	(void)state;
	for (size_t g = 0; g < sizeof(geometries) / sizeof(geometries[0]); g++) {
		const struct scene scene = shipped_scene(geometries[g]);

		for (double angle_deg = 10; angle_deg <= 70; angle_deg += 2.5, drops++) {
			struct analysis a;
			unsigned flags = 0;

			measure(&scene, angle_deg, ONSET_S, &random, &a);
			for (int c = 0; c < AXES; c++)
				flags |= a.channels[c].peak.how.flags;
			if (flags & ESTIMATE_FLAG_AXES)
				print_message("geometry %s, %g degrees: axes disagree\n", geometries[g],
				              angle_deg);
			told += (flags & ESTIMATE_FLAG_AXES) != 0;
			estimate_free(&a);
		}
	}
	print_message("seed 8, %u drops, %u told\n", drops, told);
	assert_int_equal(told, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(of_no_plate),
	        cmocka_unit_test(of_hard_cubes),
	        cmocka_unit_test(of_soft_cubes),
	        cmocka_unit_test(of_no_doubtful_axis),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
