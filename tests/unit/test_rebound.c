/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/pulse.h"
#include "host/estimate/rebound.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define SPEED_M_S 4.2
#define G_M_S2 9.80665    /* of a reading */
#define GRAVITY_M_S2 9.78 /* of the flight */
#define BASE_S 3e-3
#define ONSET_S 0.1

enum { AXES = 3 };

struct bench {
	double noise_g;
	struct channel channel[AXES];
	struct trace trace[AXES];
	struct peak peak[AXES];
	struct estimate_pulse pulse[AXES];
};

/* A case that comes with SPEED_M_S, leaves with ratio times that, and flies until it is back; Z at rest. Its
 * acceleration is gain times too high. The second impact turns the other way. */
static struct estimate_rebound run(struct bench *b, double ratio, double gain, double until_s, uint64_t seed)
{
	static const double part[AXES] = {0.906, -0.423, 0}, again[AXES] = {-0.3, 0.6, 0};
	double height = SPEED_M_S * (1 + ratio) / (G_M_S2 * BASE_S * synth_pulse_area(SYNTH_HUNT_CROSSLEY));
	double flight = 2 * ratio * SPEED_M_S / GRAVITY_M_S2;
	struct synth_random random = {seed};
	struct rebound_axes axes = {.count = AXES};
	struct estimate_rebound rebound;

	for (unsigned i = 0; i < AXES; i++) {
		double rate = i == 0 ? 7000 : 10000;
		struct estimate_baseline baseline = {.samples = 900};

		b->channel[i] = synth_channel("S2", rate, 0, (size_t)(until_s * rate));
		for (size_t k = 0; k < b->channel[i].count; k++) {
			double t = (double)k / rate - ONSET_S;
			double first = synth_pulse(SYNTH_HUNT_CROSSLEY, t / BASE_S);
			double second = synth_pulse(SYNTH_HUNT_CROSSLEY, (t - BASE_S - flight) / BASE_S);

			b->channel[i].value_g[k] = gain * height * (part[i] * first + again[i] * second) +
			                           b->noise_g * synth_normal(&random);
		}
		assert_int_equal(trace_open(&b->trace[i], &b->channel[i], 0.08, 0.2), 0);
		b->trace[i].noise_g = b->noise_g;
		peak_find(&b->trace[i], &(struct estimate_options){0}, &b->peak[i]);
		pulse_measure(&b->trace[i], &b->peak[i], &baseline, ESTIMATE_FAMILY_AUTO, &b->pulse[i]);
		axes.trace[i] = &b->trace[i];
		axes.peak[i] = &b->peak[i];
		axes.pulse[i] = &b->pulse[i];
	}
	rebound_find(&axes, SPEED_M_S, GRAVITY_M_S2, &rebound);
	for (unsigned i = 0; i < AXES; i++) {
		trace_close(&b->trace[i]);
		synth_free(&b->channel[i]);
	}
	return rebound;
}

/* Both ways, each within its own uncertainty; the clock is the sharper one. */
static void both_ways(void **state)
{
	static const double ratio[] = {0.2, 0.48, 0.7};

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		struct bench b = {.noise_g = 0.3};
		struct estimate_rebound r = run(&b, ratio[i], 1, 0.8, 10 + i);
		double flight = 2 * ratio[i] * SPEED_M_S / GRAVITY_M_S2;

		printf("seed %zu: %.4f +- %.4f, %.5f +- %.5f of %.2f\n", 10 + i, r.velocity_ratio,
		       r.sigma_velocity_ratio, r.flight_ratio, r.sigma_flight_ratio, ratio[i]);
		assert_int_equal(r.status, ESTIMATE_OK);
		assert_near(r.velocity_ratio, ratio[i], 3 * r.sigma_velocity_ratio);
		assert_true(r.sigma_velocity_ratio > 2e-4 && r.sigma_velocity_ratio < 5e-3);
		assert_near(r.flight_ratio, ratio[i], 3 * r.sigma_flight_ratio);
		assert_true(r.sigma_flight_ratio > 2e-5 && r.sigma_flight_ratio < 5e-4);
		assert_near(r.second_impact_s, ONSET_S + BASE_S + flight, 0.25e-3);
	}
}

/* A gain that is wrong by a tenth shows in one of them only, and then in the status. */
static void disagree(void **state)
{
	struct bench b = {.noise_g = 0.3};
	struct estimate_rebound r = run(&b, 0.5, 1.1, 0.8, 20);

	(void)state;
	assert_near(r.velocity_ratio, 1.5 * 1.1 - 1, 0.01);
	assert_near(r.flight_ratio, 0.5, 1e-3);
	assert_int_equal(r.status, ESTIMATE_AMBIGUOUS);
}

static void record_ends(void **state)
{
	struct bench b = {.noise_g = 0.3};
	struct estimate_rebound r = run(&b, 0.5, 1, 0.4, 30);

	(void)state;
	assert_int_equal(r.status, ESTIMATE_OK);
	assert_near(r.velocity_ratio, 0.5, 0.01);
	assert_true(isnan(r.flight_ratio) && isnan(r.sigma_flight_ratio) && isnan(r.second_impact_s));
	/* Nor a first impact. */
	r = run(&b, 0.5, 1, 0.09, 31);
	assert_int_equal(r.status, ESTIMATE_SHORT);
	assert_true(isnan(r.velocity_ratio) && isnan(r.flight_ratio));
}

/* Noise of a tenth of the peak reaches three tenths of it time and again; it is no second impact, and hides
 * none of six times its size. */
static void noisy(void **state)
{
	enum { RUNS = 20 };
	int ghosts = 0, found = 0;

	(void)state;
	for (uint64_t seed = 40; seed < 40 + RUNS; seed++) {
		struct bench b = {.noise_g = 40};
		struct estimate_rebound r = run(&b, 0.5, 1, 0.4, seed);

		assert_true(isfinite(r.velocity_ratio));
		ghosts += !isnan(r.second_impact_s) || !isnan(r.flight_ratio);
		r = run(&b, 0.5, 1, 0.8, seed);
		found += fabs(r.second_impact_s - (ONSET_S + BASE_S + SPEED_M_S / GRAVITY_M_S2)) < 2e-3;
	}
	printf("seeds 40 to 59: %d of %d second impacts that are none, %d found\n", ghosts, RUNS, found);
	assert_int_equal(ghosts, 0);
	assert_int_equal(found, RUNS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(both_ways),
	        cmocka_unit_test(disagree),
	        cmocka_unit_test(record_ends),
	        cmocka_unit_test(noisy),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
