/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "host/estimate/resultant.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

/* X at 7 kHz, Y at 10 kHz, half-sines of 3 ms, 485.1 and 218.4 g: 532 g together. */
#define X_G 485.1
#define Y_G 218.4
#define BASE_S 3e-3
#define ONSET_S 0.02

struct scene {
	struct channel x, y;
	struct trace trace[2];
	struct peak peak[2];
};

static double half_sine(double t)
{
	return synth_pulse(SYNTH_HALF_SINE, t / BASE_S);
}

/* Y starts apart_s after X. */
static void make(struct scene *s, double phase, double apart_s, double noise_g, struct synth_random *random)
{
	s->x = synth_channel("S2X", 7000, 0, 400);
	s->y = synth_channel("S2Y", 10000, 0, 600);
	for (size_t k = 0; k < s->x.count; k++)
		s->x.value_g[k] = X_G * half_sine(((double)k - phase) / 7000 - ONSET_S);
	for (size_t k = 0; k < s->y.count; k++)
		s->y.value_g[k] = Y_G * half_sine((double)k / 10000 - phase / 7000 - ONSET_S - apart_s);
	for (size_t k = 0; noise_g > 0 && k < s->x.count; k++)
		s->x.value_g[k] += noise_g * synth_normal(random);
	for (size_t k = 0; noise_g > 0 && k < s->y.count; k++)
		s->y.value_g[k] += noise_g * synth_normal(random);
}

static struct resultant find(struct scene *s, double noise_g)
{
	struct resultant_axes axes = {{&s->trace[0], &s->trace[1]}, {&s->peak[0], &s->peak[1]}};
	struct resultant resultant;

	assert_int_equal(trace_open(&s->trace[0], &s->x, -INFINITY, INFINITY), 0);
	assert_int_equal(trace_open(&s->trace[1], &s->y, -INFINITY, INFINITY), 0);
	for (int i = 0; i < 2; i++) {
		s->trace[i].noise_g = noise_g;
		peak_find(&s->trace[i], &s->peak[i]);
	}
	resultant_find(&axes, &resultant);
	trace_close(&s->trace[0]);
	trace_close(&s->trace[1]);
	return resultant;
}

static void drop(struct scene *s)
{
	synth_free(&s->x);
	synth_free(&s->y);
}

/* The truth by looking at every tenth of a microsecond. */
static void truth(double phase, double apart_s, double *peak_g, double *time_s)
{
	*peak_g = 0;
	for (int i = 0; i < 60000; i++) {
		double t = i * 1e-7, value = hypot(X_G * half_sine(t), Y_G * half_sine(t - apart_s));

		if (value > *peak_g) {
			*peak_g = value;
			*time_s = t + ONSET_S + phase / 7000;
		}
	}
}

static void continuous_time(void **state)
{
	static const double apart[] = {0, 0.2e-3, -0.2e-3, 0.5e-3};

	(void)state;
	for (size_t i = 0; i < sizeof(apart) / sizeof(apart[0]); i++) {
		for (int phase = 0; phase < 8; phase++) {
			struct resultant r;
			struct scene s;
			double peak, time;

			make(&s, phase / 8.0, apart[i], 0, NULL);
			r = find(&s, 0.3);
			truth(phase / 8.0, apart[i], &peak, &time);
			assert_int_equal(r.result.how.status, ESTIMATE_OK);
			assert_near(r.result.peak_g, peak, 0.2);
			assert_near(r.result.time_s, time, 1e-6);
			assert_near(r.result.axes_apart_s, apart[i], 1e-6);
			assert_int_equal(r.result.axes_coincide, fabs(apart[i]) < 0.25e-3);
			assert_near(r.first_peak_s, r.result.time_s, 0);
			/* The hypot of the two maxima would be too much. */
			if (apart[i] > 0.4e-3)
				assert_true(r.result.peak_g < hypot(X_G, Y_G) - 5);
			drop(&s);
		}
	}
}

/* The statistical study has 0.48 g and 1.9 us at 1 g for order 4, 1.41-1.47 times the bound of 0.3345 g. */
static void noise(void **state)
{
	enum { TIMES = 300 };
	static const double apart[] = {0, 0.2e-3, 0.5e-3};

	(void)state;
	for (size_t a = 0; a < 3; a++) {
		struct synth_random random = {40 + a};
		double square = 0, mean = 0, time_square = 0;
		int covered = 0, time_covered = 0;

		for (int i = 0; i < TIMES; i++) {
			double phase = synth_uniform(&random), peak, time;
			struct resultant r;
			struct scene s;

			make(&s, phase, apart[a], 1, &random);
			r = find(&s, 1);
			truth(phase, apart[a], &peak, &time);
			mean += (r.result.peak_g - peak) / TIMES;
			square += pow(r.result.peak_g - peak, 2) / TIMES;
			time_square += pow(r.result.time_s - time, 2) / TIMES;
			covered += fabs(r.result.peak_g - peak) < 2 * r.result.sigma_g;
			time_covered += fabs(r.result.time_s - time) < 2 * r.sigma_time_s;
			drop(&s);
		}
		printf("seed %zu, %.1f ms apart: bias %+.3f, rmse %.3f g %.2f us, covered %d %d of %d\n",
		       40 + a, apart[a] * 1e3, mean, sqrt(square), sqrt(time_square) * 1e6, covered,
		       time_covered, TIMES);
		/* With 0.5 ms between them the kink at Y's start lies in the window of X. */
		assert_true(sqrt(square) > 0.8 * 0.48 && sqrt(square) < (a < 2 ? 1.15 : 1.3) * 0.5);
		assert_true(fabs(mean) < 0.1);
		assert_true(sqrt(time_square) > 1e-6 && sqrt(time_square) < (a < 2 ? 3e-6 : 5e-6));
		assert_true(covered > 0.91 * TIMES && covered < TIMES);
		assert_true(time_covered > 0.9 * TIMES && time_covered <= TIMES);
	}
}

/* Two humps: the second is the largest, the first is above half of it. */
static void first_peak(void **state)
{
	struct synth_random random = {60};
	struct resultant r;
	struct scene s;

	(void)state;
	make(&s, 0, 0, 1, &random);
	for (size_t k = 0; k < s.x.count; k++)
		s.x.value_g[k] += 0.7 * X_G * half_sine((double)k / 7000 - ONSET_S + 4.2e-3);
	for (size_t k = 0; k < s.y.count; k++)
		s.y.value_g[k] += 0.7 * Y_G * half_sine((double)k / 10000 - ONSET_S + 4.2e-3);
	r = find(&s, 1);
	assert_near(r.result.time_s, ONSET_S + BASE_S / 2, 10e-6);
	assert_near(r.first_peak_s, ONSET_S + BASE_S / 2 - 4.2e-3, 15e-6);
	drop(&s);
	/* Below half of it the first does not count. */
	make(&s, 0, 0, 1, &random);
	for (size_t k = 0; k < s.x.count; k++)
		s.x.value_g[k] += 0.4 * X_G * half_sine((double)k / 7000 - ONSET_S + 4.2e-3);
	r = find(&s, 1);
	assert_near(r.first_peak_s, r.result.time_s, 0);
	drop(&s);
}

static void flawed(void **state)
{
	struct resultant r;
	struct scene s;

	(void)state;
	/* Y says nothing: the resultant is X's, but the axes cannot be compared. */
	make(&s, 0.3, 0, 0, NULL);
	for (size_t k = 0; k < s.y.count; k++)
		s.y.value_g[k] = 0.2;
	r = find(&s, 0.3);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_near(r.result.peak_g, X_G, 0.1);
	assert_true(isnan(r.result.axes_apart_s) && !r.result.axes_coincide);
	/* Y was lost under the pulse. */
	synth_lose(&s.y, 190, 60);
	r = find(&s, 0.3);
	assert_int_equal(r.result.how.status, ESTIMATE_SHORT);
	assert_true(isnan(r.result.peak_g));
	/* Nothing at all. */
	for (size_t k = 0; k < s.x.count; k++)
		s.x.value_g[k] = 0;
	assert_int_equal(find(&s, 0.3).result.how.status, ESTIMATE_NO_PEAK);
	drop(&s);
	/* One axis at its end. */
	make(&s, 0.3, 0, 0, NULL);
	for (size_t k = 0; k < s.x.count; k++)
		s.x.value_g[k] = fmin(s.x.value_g[k], 460);
	r = find(&s, 0.3);
	assert_int_equal(r.result.how.status, ESTIMATE_CLIPPED);
	assert_true(isnan(r.result.sigma_g) && r.result.peak_g > 500 && r.result.peak_g < 532);
	drop(&s);
	/* A few samples missing at the summit of X. */
	make(&s, 0.3, 0, 0, NULL);
	synth_lose(&s.x, 150, 2);
	r = find(&s, 0.3);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_near(r.result.peak_g, hypot(X_G, Y_G), 0.3);
	drop(&s);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(continuous_time),
	        cmocka_unit_test(noise),
	        cmocka_unit_test(first_peak),
	        cmocka_unit_test(flawed),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
