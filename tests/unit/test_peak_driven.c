/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * S1's peaks by the oscillator that S2 drives, and where they are not: whole records of known truth.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "host/record/drop.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define HEIGHT_G 480.0
#define ONSET_S 0.15
#define LENGTH_S 0.3
#define AGAIN_S 0.031

enum { S1X, S1Y, S2X, S2Y, CHANNELS };
enum { TABLE = 33000 };

/* A half-sine on S2 and a plate of 129 Hz on it. */
struct scene {
	double base_s, damping, noise_g;
	double y_part; /* Y over X */
	double again;  /* the same once more 31 ms later, so much of it; 0: not */
	/* parts of the peak on X: cut there, or only marked from there; 0: not */
	double clip_s1, clip_s2, beyond_s1;
};

static const struct scene plain = {3e-3, 0.1, 1, 0.45, 0, 0, 0, 0};

struct drop {
	struct channel channel[CHANNELS];
	struct record record;
	double onset_s, s1_g, s1_s; /* of X */
	struct analysis analysis;
};

static double plate[TABLE];

static void fill(struct drop *drop, const struct scene *scene, int i, struct synth_random *random)
{
	struct channel *channel = &drop->channel[i];
	bool s1 = i <= S1Y, x = i == S1X || i == S2X;
	double height = HEIGHT_G * (x ? 1 : scene->y_part), limit = INFINITY;

	if (x && (s1 ? scene->clip_s1 : scene->clip_s2) > 0)
		limit = s1 ? scene->clip_s1 * drop->s1_g : scene->clip_s2 * HEIGHT_G;
	for (size_t k = 0; k < channel->count; k++) {
		double t = (double)k / channel->rate_hz - drop->onset_s;
		double value = s1 ? synth_table(plate, TABLE, SYNTH_STEP_S, t)
		                  : synth_pulse(SYNTH_HALF_SINE, t / scene->base_s);

		if (scene->again > 0)
			value += scene->again *
			         (s1 ? synth_table(plate, TABLE, SYNTH_STEP_S, t - AGAIN_S)
			             : synth_pulse(SYNTH_HALF_SINE, (t - AGAIN_S) / scene->base_s));
		value = height * value + scene->noise_g * synth_normal(random);
		channel->value_g[k] = fmax(fmin(value, limit), -limit);
		if (i == S1X && scene->beyond_s1 > 0 && value > scene->beyond_s1 * drop->s1_g)
			channel->sample[k] |= SAMPLE_CLIPPED;
	}
}

static void make(struct drop *drop, const struct scene *scene, double tolerance, struct synth_random *random)
{
	static const char *const names[CHANNELS] = {"S1X", "S1Y", "S2X", "S2Y"};
	struct estimate_options options = {.tolerance = tolerance};
	double height, at;

	memset(drop, 0, sizeof(*drop));
	synth_plate(plate, TABLE, SYNTH_HALF_SINE, scene->base_s, 129, scene->damping);
	drop->onset_s = ONSET_S + 1e-3 * synth_uniform(random);
	at = synth_plate_peak(plate, TABLE, &height);
	drop->s1_g = HEIGHT_G * height;
	drop->s1_s = drop->onset_s + at;
	for (int i = 0; i < CHANNELS; i++) {
		double rate_hz = i == S1X || i == S2X ? 7000 : 10000;

		drop->channel[i] = synth_channel(names[i], rate_hz, 0, (size_t)(LENGTH_S * rate_hz));
		fill(drop, scene, i, random);
	}
	drop->record.channels = drop->channel;
	drop->record.channel_count = CHANNELS;
	drop_set_axes(&drop->record);
	assert_int_equal(estimate_record(&drop->record, &options, &drop->analysis), 0);
}

static void drop_free(struct drop *drop)
{
	estimate_free(&drop->analysis);
	for (int i = 0; i < CHANNELS; i++)
		synth_free(&drop->channel[i]);
}

static bool driven(const struct estimate_how *how)
{
	return strcmp(how->method, "driven-oscillator") == 0;
}

struct score {
	unsigned driven, covered, time_covered;
	double square, time_square; /* mean squares */
	double sigma_g, sigma_s;    /* means */
};

enum { TIMES = 200 };

/* S1 X of many drops. */
static struct score play(const struct scene *scene, uint64_t seed)
{
	struct synth_random random = {seed};
	struct score score = {0};

	for (int i = 0; i < TIMES; i++) {
		const struct estimate_peak *peak;
		struct drop drop;
		double off, late;

		make(&drop, scene, 0, &random);
		peak = &drop.analysis.channels[S1X].peak;
		off = peak->value_g - drop.s1_g;
		late = peak->time_s - drop.s1_s;
		score.driven += driven(&peak->how);
		score.covered += fabs(off) < 2 * peak->sigma_g;
		score.time_covered += fabs(late) < 2 * peak->sigma_time_s;
		score.square += off * off / TIMES;
		score.time_square += late * late / TIMES;
		score.sigma_g += peak->sigma_g / TIMES;
		score.sigma_s += peak->sigma_time_s / TIMES;
		drop_free(&drop);
	}
	printf("seed %u: driven %u, error %.2f g, said %.2f, covered %u; %.1f us, said %.1f, covered %u of "
	       "%d\n",
	       (unsigned)seed, score.driven, sqrt(score.square), score.sigma_g, score.covered,
	       1e6 * sqrt(score.time_square), 1e6 * score.sigma_s, score.time_covered, TIMES);
	return score;
}

/* Half of a smooth curve's error, which is 0.43 of the noise, and what it says is so. */
static void taken(void **state)
{
	struct score score = play(&plain, 1);

	(void)state;
	assert_in_range(score.driven, TIMES - 1, TIMES);
	assert_true(sqrt(score.square) > 0.18 && sqrt(score.square) < 0.3);
	assert_true(sqrt(score.time_square) < 1.5e-6);
	assert_in_range(score.covered, 182, 198);
	assert_in_range(score.time_covered, 182, 198);
}

/* Through a pulse of nearly a cycle the plate follows: its own samples tell, unless they are cut. */
static void long_pulse(void **state)
{
	struct scene scene = plain;
	struct score score;

	(void)state;
	scene.base_s = 7e-3;
	score = play(&scene, 2);
	assert_int_equal(score.driven, 0);
	assert_true(score.covered >= 182 && score.time_covered >= 182);
	assert_true(score.sigma_g < 1);
	scene.clip_s1 = 0.8;
	score = play(&scene, 3);
	assert_int_equal(score.driven, TIMES);
	assert_true(score.covered >= 182 && score.sigma_g < 1.5);
	assert_true(score.time_covered >= 178);
	assert_true(sqrt(score.square) < 0.5);
}

/* The shape of a clipped S2 is a guess: the smooth curve's value stays, and its time, which the kink at the
 * end of contact moves, is no more certain than what the two differ by. */
static void clipped_case(void **state)
{
	struct scene scene = plain;
	struct score score;

	(void)state;
	scene.clip_s2 = 0.8;
	score = play(&scene, 4);
	assert_int_equal(score.driven, 0);
	assert_true(score.covered >= 182 && score.time_covered >= 182);
	assert_true(score.sigma_s < 40e-6);
}

/* Readings beyond the range go on, but the fit leaves them out. */
static void beyond_the_range(void **state)
{
	struct scene scene = plain;
	struct score score;
	struct synth_random random = {5};
	struct drop drop;

	(void)state;
	scene.beyond_s1 = 0.8;
	make(&drop, &scene, 0, &random);
	assert_int_equal(drop.analysis.channels[S1X].peak.how.status, ESTIMATE_CLIPPED);
	assert_true(drop.analysis.channels[S1X].peak.how.flags & ESTIMATE_FLAG_EXTRAPOLATED);
	assert_true(drop.analysis.channels[S1X].peak.sigma_g > 1e-3 * drop.s1_g);
	drop_free(&drop);
	score = play(&scene, 6);
	assert_int_equal(score.driven, TIMES);
	assert_true(score.covered >= 186 && score.sigma_g < 1);
}

/* The weak axis of S2 has no shape of its own. */
static void weak_case(void **state)
{
	static const double part[2] = {8 / HEIGHT_G, 40 / HEIGHT_G};
	struct synth_random random = {7};

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct scene scene = plain;
		struct drop drop;

		scene.y_part = part[i];
		make(&drop, &scene, 0, &random);
		assert_true(driven(&drop.analysis.channels[S1X].peak.how));
		assert_int_equal(driven(&drop.analysis.channels[S1Y].peak.how), i == 1);
		drop_free(&drop);
	}
}

/* A weak Y beside X by the oscillator: both are of one swing, and so is the resultant. */
static void weak_axis(void **state)
{
	struct synth_random random = {12};
	struct scene scene = plain;
	int weak = 0, covered = 0;
	double late = 0, sigma = 0;

	(void)state;
	scene.noise_g = 10;
	scene.y_part = 0.12;
	for (int i = 0; i < TIMES; i++) {
		const struct estimate_resultant *r;
		struct drop drop;

		make(&drop, &scene, 0, &random);
		r = &drop.analysis.resultants[0];
		if (strcmp(drop.analysis.channels[S1Y].peak.how.method, "strong-axis") == 0) {
			weak++;
			assert_true(driven(&r->how));
			assert_true(r->how.flags & ESTIMATE_FLAG_WEAK);
			late += r->time_s - drop.s1_s;
			sigma += r->sigma_time_s;
			covered += fabs(r->time_s - drop.s1_s) < 2 * r->sigma_time_s;
		}
		drop_free(&drop);
	}
	printf("seed 12: %d weak, %+.2f us, said %.2f, covered %d\n", weak, 1e6 * late / weak,
	       1e6 * sigma / weak, covered);
	assert_true(weak > TIMES / 4);
	assert_true(fabs(late) < 3e-6 * weak);
	assert_true(sigma > 4e-6 * weak && sigma < 9e-6 * weak);
	assert_in_range(100 * covered / weak, 88, 99);
}

/* Nothing on Y: the resultant of S1 is X's peak by the oscillator, without the smooth curve's bias of 17 us
 * near the kink, and the lag is so. */
static void silent_axis(void **state)
{
	struct synth_random random = {11};
	struct scene scene = plain;
	int covered = 0, lag_covered = 0;
	double late = 0;

	(void)state;
	scene.y_part = 0;
	for (int i = 0; i < TIMES; i++) {
		const struct estimate_resultant *r;
		const struct estimate_lag *lag;
		struct drop drop;

		make(&drop, &scene, 0, &random);
		r = &drop.analysis.resultants[0];
		lag = &drop.analysis.lag;
		assert_true(driven(&r->how));
		assert_near(r->peak_g, drop.analysis.channels[S1X].peak.value_g, 1e-9);
		late += (r->time_s - drop.s1_s) / TIMES;
		covered += fabs(r->time_s - drop.s1_s) < 2 * r->sigma_time_s;
		lag_covered += fabs(lag->largest_peak_s - (drop.s1_s - drop.onset_s - scene.base_s / 2)) <
		               2 * lag->sigma_s;
		drop_free(&drop);
	}
	printf("seed 11: %+.2f us, covered %d, lag %d of %d\n", 1e6 * late, covered, lag_covered, TIMES);
	assert_true(fabs(late) < 0.5e-6);
	assert_in_range(covered, 182, 198);
	assert_in_range(lag_covered, 184, 200);
}

/* Noise lifts a later swing of a plate that hardly loses any: its peaks are those of the first, and so is the
 * resultant. */
static void another_swing(void **state)
{
	struct scene scene = plain;
	struct synth_random random = {8};
	int flagged = 0, known = 0;

	(void)state;
	scene.damping = 0.003;
	scene.noise_g = 8;
	for (int i = 0; i < 100; i++) {
		const struct estimate_resultant *r;
		const struct estimate_peak *x;
		struct drop drop;

		make(&drop, &scene, 0, &random);
		r = &drop.analysis.resultants[0];
		x = &drop.analysis.channels[S1X].peak;
		if (driven(&x->how) && driven(&drop.analysis.channels[S1Y].peak.how)) {
			known++;
			flagged += (x->how.flags & ESTIMATE_FLAG_RIVAL) != 0;
			assert_near(x->time_s, drop.s1_s, 5 * x->sigma_time_s);
			assert_near(r->time_s, x->time_s, 0.2e-3);
			assert_true(r->peak_g > fabs(x->value_g));
			assert_true(driven(&r->how));
		}
		drop_free(&drop);
	}
	printf("seed 8: %d of 100 known, %d with a rival\n", known, flagged);
	assert_true(known >= 95 && flagged > 10);
}

/* A hardly damped plate that is hit again swings higher: its peak is not the first contact's, cut or not. */
static void another_contact(void **state)
{
	static const double part[3][2] = {{0, 0}, {1.2, 0}, {0, 1.2}};
	struct synth_random random = {10};

	(void)state;
	for (int i = 0; i < 3; i++) {
		struct scene scene = plain;
		const struct estimate_peak *x;
		struct drop drop;

		scene.damping = 0.03;
		scene.again = 0.95;
		scene.clip_s1 = part[i][0];
		scene.beyond_s1 = part[i][1];
		make(&drop, &scene, 0, &random);
		x = &drop.analysis.channels[S1X].peak;
		assert_true(x->time_s - drop.s1_s > 0.02);
		assert_true(fabs(x->value_g) > 1.19 * drop.s1_g); /* cut on both sides */
		assert_true(i > 0 || drop.analysis.lag.driven.flags & ESTIMATE_FLAG_RIVAL);
		assert_true(i > 0 || fabs(drop.analysis.resultants[0].time_s - x->time_s) < 0.5e-3);
		drop_free(&drop);
	}
}

/* What was asked for is asked of height and time. */
static void tolerance(void **state)
{
	static const double asked[4] = {1e-2, 6e-4, 3e-4, 1e-5};
	struct synth_random random = {9};

	(void)state;
	for (int i = 0; i < 4; i++) {
		struct scene scene = plain;
		struct drop drop;
		const struct estimate_peak *peak;

		make(&drop, &scene, asked[i], &random);
		peak = &drop.analysis.channels[S1X].peak;
		printf("asked for %g: %.2g of the height\n", asked[i], peak->sigma_g / peak->value_g);
		assert_int_equal((peak->how.flags & ESTIMATE_FLAG_TOLERANCE) != 0, i > 1);
		drop_free(&drop);
		/* the smooth curve's time is off by half a percent */
		scene.clip_s2 = 0.8;
		make(&drop, &scene, 1.5e-3, &random);
		peak = &drop.analysis.channels[S1X].peak;
		assert_true(peak->sigma_g < 1.5e-3 * peak->value_g);
		assert_true(peak->how.flags & ESTIMATE_FLAG_TOLERANCE);
		drop_free(&drop);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(taken),        cmocka_unit_test(long_pulse),
	        cmocka_unit_test(clipped_case), cmocka_unit_test(beyond_the_range),
	        cmocka_unit_test(weak_case),    cmocka_unit_test(another_swing),
	        cmocka_unit_test(tolerance),    cmocka_unit_test(another_contact),
	        cmocka_unit_test(silent_axis),  cmocka_unit_test(weak_axis),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
