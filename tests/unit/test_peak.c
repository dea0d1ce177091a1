/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/crest.h"
#include "host/estimate/peak.h"
#include "tests/unit/synth.h"

#define HEIGHT_G 485.1
#define BASE_S 3e-3
#define RATE_HZ 7000.0

/* The default pulse, onset_s after 20 ms, in 400 samples at 7 kHz. */
static struct channel pulse_channel(enum synth_shape shape, double onset_s, double noise_g,
                                    struct synth_random *random)
{
	struct channel channel = synth_channel("a", RATE_HZ, 0, 400);

	for (size_t k = 0; k < channel.count; k++) {
		double t = (double)k / RATE_HZ - 0.02 - onset_s;

		channel.value_g[k] = HEIGHT_G * synth_pulse(shape, t / BASE_S);
		if (noise_g > 0)
			channel.value_g[k] += noise_g * synth_normal(random);
	}
	return channel;
}

static struct estimate_peak find(const struct channel *channel, double noise_g)
{
	struct trace trace;
	struct peak peak;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	trace.noise_g = noise_g;
	peak_find(&trace, &peak);
	trace_close(&trace);
	return peak.result;
}

/* Without noise what is left is the polynomial's own error, at every place of the onset between samples. */
static void shapes(void **state)
{
	static const double error_g[SYNTH_SHAPES] = {0.1, 0.15, 0.15, 0.6};
	static const double error_s[SYNTH_SHAPES] = {0.1e-6, 0.1e-6, 0.1e-6, 6e-6};

	(void)state;
	for (unsigned shape = 0; shape < SYNTH_SHAPES; shape++) {
		for (int phase = 0; phase < 12; phase++) {
			double onset = phase / 12.0 / RATE_HZ;
			struct channel channel = pulse_channel(shape, onset, 0, NULL);
			struct estimate_peak peak = find(&channel, 0.3);
			double truth = 0.02 + onset + synth_pulse_summit(shape) * BASE_S;

			if (fabs(peak.value_g - HEIGHT_G) > error_g[shape] ||
			    fabs(peak.time_s - truth) > error_s[shape])
				fail_msg("shape %u phase %d: %.3f g off, %.2f us off", shape, phase,
				         peak.value_g - HEIGHT_G, (peak.time_s - truth) * 1e6);
			assert_string_equal(peak.how.method, "poly4/poly6");
			assert_int_equal(peak.how.status, ESTIMATE_OK);
			synth_free(&channel);
		}
	}
}

struct statistics {
	double bias_g, rmse_g, rmse_s, covered, covered_time;
};

static struct statistics repeat(enum synth_shape shape, double noise_g, uint64_t seed, int times)
{
	struct synth_random random = {seed};
	struct statistics s = {0, 0, 0, 0, 0};

	for (int i = 0; i < times; i++) {
		double onset = synth_uniform(&random) / RATE_HZ;
		struct channel channel = pulse_channel(shape, onset, noise_g, &random);
		struct estimate_peak peak = find(&channel, noise_g);
		double off = peak.value_g - HEIGHT_G;
		double late = peak.time_s - 0.02 - onset - synth_pulse_summit(shape) * BASE_S;

		s.bias_g += off / times;
		s.rmse_g += off * off / times;
		s.rmse_s += late * late / times;
		s.covered += fabs(off) <= 2 * peak.sigma_g ? 100.0 / times : 0;
		s.covered_time += fabs(late) <= 2 * peak.sigma_time_s ? 100.0 / times : 0;
		synth_free(&channel);
	}
	s.rmse_g = sqrt(s.rmse_g);
	s.rmse_s = sqrt(s.rmse_s);
	return s;
}

/* The statistical study's figures for order 6 at 1 g: 0.508 g and 2.52 us; both scale with the noise. */
static void noise(void **state)
{
	static const double level[] = {0.3, 1, 3, 10};

	(void)state;
	for (size_t i = 0; i < sizeof(level) / sizeof(level[0]); i++) {
		struct statistics s = repeat(SYNTH_HALF_SINE, level[i], 1000 + i, 600);

		printf("seed %zu, %g g: bias %+.3f, rmse %.3f g %.2f us, covered %.1f %% %.1f %%\n", 1000 + i,
		       level[i], s.bias_g, s.rmse_g, s.rmse_s * 1e6, s.covered, s.covered_time);
		assert_true(s.rmse_g > 0.8 * 0.508 * level[i] && s.rmse_g < 1.15 * 0.508 * level[i]);
		assert_true(s.rmse_s > 0.7 * 2.52e-6 * level[i] && s.rmse_s < 1.2 * 2.52e-6 * level[i]);
		assert_true(fabs(s.bias_g) < 0.1 * level[i]);
		assert_true(s.covered > 92 && s.covered < 99);
		assert_true(s.covered_time > 92 && s.covered_time < 99.5);
	}
}

static void coverage_of_shapes(void **state)
{
	(void)state;
	for (unsigned shape = 0; shape < SYNTH_SHAPES; shape++) {
		struct statistics s = repeat(shape, 1, 2000 + shape, 400);

		printf("seed %u, shape %u: bias %+.3f, rmse %.3f g %.2f us, covered %.1f %% %.1f %%\n",
		       2000 + shape, shape, s.bias_g, s.rmse_g, s.rmse_s * 1e6, s.covered, s.covered_time);
		assert_true(s.covered > 90 && s.covered < 99.5);
		assert_true(s.covered_time > (shape == SYNTH_HUNT_CROSSLEY ? 80 : 90));
	}
}

/* Missing samples at the summit cost certainty, not truth. */
static void holes(void **state)
{
	static const size_t missing[] = {1, 4, 8};

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		struct synth_random random = {77 + i};
		struct channel channel = pulse_channel(SYNTH_HALF_SINE, 0.3 / RATE_HZ, 1, &random);
		struct estimate_peak whole = find(&channel, 1), peak;

		synth_lose(&channel, 151 - missing[i] / 2, missing[i]);
		peak = find(&channel, 1);
		printf("seed %zu, %zu missing: %+.2f g, sigma %.2f\n", 77 + i, missing[i],
		       peak.value_g - HEIGHT_G, peak.sigma_g);
		assert_int_equal(peak.how.status, i < 2 ? ESTIMATE_OK : ESTIMATE_AMBIGUOUS);
		assert_true(fabs(peak.value_g - HEIGHT_G) < 3 * peak.sigma_g);
		assert_true(peak.sigma_g > whole.sigma_g && peak.sigma_g < 20);
		synth_free(&channel);
	}
}

/* A summit that is gone altogether cannot pass for a good peak. */
static void summit_lost(void **state)
{
	struct synth_random random = {5};
	struct channel channel = pulse_channel(SYNTH_HALF_SINE, 0, 1, &random);
	struct estimate_peak peak;

	(void)state;
	synth_lose(&channel, 146, 60);
	peak = find(&channel, 1);
	assert_int_equal(peak.how.status, ESTIMATE_AMBIGUOUS);
	synth_free(&channel);
}

static void clipped(void **state)
{
	struct channel channel = pulse_channel(SYNTH_HALF_SINE, 0, 0, NULL);
	struct estimate_peak peak;

	(void)state;
	/* Flat top: the sensor was at its end, and nobody marked it. */
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = -fmin(channel.value_g[k], 450);
	peak = find(&channel, 0.3);
	assert_int_equal(peak.how.status, ESTIMATE_CLIPPED);
	assert_true(peak.value_g < -449 && peak.value_g > -HEIGHT_G);
	assert_true(isnan(peak.sigma_g));
	assert_true(fabs(peak.time_s - 0.0215) < 3 * peak.sigma_time_s && peak.sigma_time_s > 0.2e-3);
	synth_free(&channel);

	/* Beyond the range, yet read and marked: the reading is the best there is. */
	channel = pulse_channel(SYNTH_HALF_SINE, 0, 0, NULL);
	for (size_t k = 0; k < channel.count; k++)
		if (channel.value_g[k] > 450)
			channel.sample[k] = SAMPLE_CLIPPED;
	peak = find(&channel, 0.3);
	assert_int_equal(peak.how.status, ESTIMATE_CLIPPED);
	assert_true(fabs(peak.value_g - HEIGHT_G) < 0.1);
	/* A limit elsewhere is not this peak's business. */
	memset(channel.sample, 0, channel.count);
	channel.sample[10] = SAMPLE_CLIPPED;
	assert_int_equal(find(&channel, 0.3).how.status, ESTIMATE_OK);
	synth_free(&channel);
}

/* Ripple of a tenth of the width: the summit of the ripple is the peak, not the middle of it. */
static void ripple(void **state)
{
	struct channel channel = synth_channel("a", 1e6, 0, 2000);
	struct estimate_peak peak;

	(void)state;
	for (size_t k = 0; k < channel.count; k++) {
		double x = ((double)k * 1e-6 - 0.5e-3) / 0.3e-3;

		channel.value_g[k] = 6000 * synth_pulse(SYNTH_HALF_SINE, x) *
		                     (1 + 0.1 * cos(20 * 3.14159265358979 * (x - 0.5)));
	}
	peak = find(&channel, 5);
	assert_true(fabs(peak.value_g - 6600) < 3);
	assert_true(fabs(peak.time_s - 0.65e-3) < 0.2e-6);
	synth_free(&channel);
}

/* Five samples over the pulse: a parabola; a pulse cut off by the end: a sample. */
static void few_samples(void **state)
{
	struct channel channel = synth_channel("a", 200, 1, 40);
	struct estimate_peak peak;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 17 * synth_pulse(SYNTH_HAVERSINE, ((double)k - 18.2) / 6);
	peak = find(&channel, 0.03);
	assert_string_equal(peak.how.method, "parabola");
	assert_true(fabs(peak.value_g - 17) < 2 * peak.sigma_g && peak.sigma_g < 1.5);
	assert_true(fabs(peak.time_s - (1 + 21.2 / 200)) < 2 * peak.sigma_time_s &&
	            peak.sigma_time_s < 1.0 / 200);
	channel.count = 21;
	peak = find(&channel, 0.03);
	assert_string_equal(peak.how.method, "sample");
	assert_int_equal(peak.how.status, ESTIMATE_AMBIGUOUS);
	synth_free(&channel);
}

/* A hundred and more samples over the pulse, and a baseline of noise far below. */
static void many_samples(void **state)
{
	struct synth_random random = {9};
	struct channel channel = synth_channel("a", 1e6, 0, 5000);
	struct estimate_peak peak;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 20000 * synth_pulse(SYNTH_HAVERSINE, ((double)k - 1000.37) / 300) +
		                     20 * synth_normal(&random);
	peak = find(&channel, 20);
	assert_string_equal(peak.how.method, "poly4/poly6");
	assert_true(fabs(peak.value_g - 20000) < 3 * peak.sigma_g && peak.sigma_g < 10);
	assert_true(fabs(peak.time_s - 1150.37e-6) < 3 * peak.sigma_time_s && peak.sigma_time_s < 0.5e-6);
	synth_free(&channel);
}

static void no_peak(void **state)
{
	struct synth_random random = {3};
	struct channel channel = synth_channel("a", 10000, 0, 4000);
	struct estimate_peak peak;

	(void)state;
	assert_int_equal(find(&channel, 0).how.status, ESTIMATE_NO_PEAK);
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = synth_normal(&random);
	peak = find(&channel, 1);
	assert_int_equal(peak.how.status, ESTIMATE_NO_PEAK);
	assert_true(isnan(peak.value_g) && isnan(peak.sigma_g) && isnan(peak.time_s));
	synth_free(&channel);
}

static void degenerate(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 5);

	(void)state;
	for (size_t n = 0; n <= 5; n++) {
		channel.count = n;
		for (size_t k = 0; k < n; k++)
			channel.value_g[k] = k == n / 2 ? 1 : 0;
		assert_int_equal(find(&channel, NAN).how.status, n < 3 ? ESTIMATE_SHORT : ESTIMATE_OK);
	}
	for (size_t k = 0; k < 5; k++)
		channel.value_g[k] = k % 2 ? NAN : 1e300;
	assert_int_equal(find(&channel, NAN).how.status, ESTIMATE_SHORT);
	channel.rate_hz = 0;
	assert_int_equal(find(&channel, NAN).how.status, ESTIMATE_SHORT);
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(shapes),
	        cmocka_unit_test(noise),
	        cmocka_unit_test(coverage_of_shapes),
	        cmocka_unit_test(holes),
	        cmocka_unit_test(summit_lost),
	        cmocka_unit_test(clipped),
	        cmocka_unit_test(ripple),
	        cmocka_unit_test(few_samples),
	        cmocka_unit_test(many_samples),
	        cmocka_unit_test(no_peak),
	        cmocka_unit_test(degenerate),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
