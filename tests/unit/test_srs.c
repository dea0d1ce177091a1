/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include <cjson/cJSON.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include "host/estimate/estimate.h"
#include "host/shock/signal.h"
#include "host/shock/srs.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846
#define G 9.80665

static const struct srs_options q10 = {.damping = 0.05};

static struct srs_value one(const double *value, size_t count, double rate_hz, double frequency_hz,
                            const struct srs_options *options)
{
	struct srs_value result;

	assert_int_equal(srs_compute(value, count, rate_hz, &frequency_hz, 1, options, &result), 0);
	return result;
}

static double maximax(const double *value, size_t count, double rate_hz, double frequency_hz)
{
	struct srs_value result = one(value, count, rate_hz, frequency_hz, &q10);

	return srs_pick(&result, SRS_MAXIMAX, SRS_TOTAL);
}

/* ---- closed forms ---- */

/* An undamped oscillator on a half-sine (any textbook of mechanical shock): during the pulse
 * (sin pi t/T - r sin w t)/(1 - r^2) with r = pi/(w T), after it 2 r cos(pi/2r)/(r^2 - 1). */
static void half_sine(void **state)
{
	enum { COUNT = 3001 };
	static const double hz[] = {5, 20, 60, 150, 210, 300, 450, 800, 1500, 4000};
	double duration = 0.003, rate = (COUNT - 1) / duration, *value = malloc(COUNT * sizeof(*value));
	struct srs_options undamped = {.damping = 0};

	(void)state;
	assert_non_null(value);
	for (int k = 0; k < COUNT; k++)
		value[k] = 100 * sin(PI * k / (COUNT - 1));
	value[COUNT - 1] = 0;
	for (size_t i = 0; i < sizeof(hz) / sizeof(hz[0]); i++) {
		double w = 2 * PI * hz[i], r = PI / (w * duration), high = 0, low = 0;
		struct srs_value srs = one(value, COUNT, rate, hz[i], &undamped);

		for (int k = 0; k <= 100000; k++) {
			double t = duration * k / 100000;
			double y = 100 * (sin(PI * t / duration) - r * sin(w * t)) / (1 - r * r);

			high = fmax(high, y);
			low = fmin(low, y);
		}
		assert_near(srs.primary_high, high, 1e-3);
		assert_near(srs.primary_low, low, 1e-3);
		assert_near(srs.residual_high, fabs(100 * 2 * r * cos(PI / (2 * r)) / (r * r - 1)), 1e-4);
		assert_near(srs.residual_low, -srs.residual_high, 1e-9);
	}
	free(value);
}

/* A single sample of height 1 is a triangle: its spectrum is known, and an undamped oscillator's residual is
 * 4 sin^2(w dt/2)/(w dt) at any frequency, a ten-millionth of the rate too. */
static void slow_oscillators(void **state)
{
	double value[3] = {0, 1, 0};
	struct srs_options undamped = {.damping = 0}, damped = {.damping = 0.05};
	double root = sqrt(1 - 0.05 * 0.05);

	(void)state;
	for (double hz = 1e-4; hz < 100; hz *= 7) {
		double x = 2 * PI * hz / 1000;
		struct srs_value srs = one(value, 3, 1000, hz, &undamped);
		double expected = 4 * sin(x / 2) * sin(x / 2) / x;

		assert_near_part(srs.residual_high, expected, 1e-9);
		/* A step of velocity v: w v e^(-D wt) ((1 - 2 D^2)/s sin(s wt) + 2 D cos(s wt)). */
		srs = one(value, 3, 1000, hz, &damped);
		expected = 0;
		for (double t = 0; t < PI; t += 1e-4)
			expected = fmax(expected, x * exp(-0.05 * t) *
			                                  ((1 - 2 * 0.05 * 0.05) / root * sin(root * t) +
			                                   2 * 0.05 * cos(root * t)));
		if (hz < 1)
			assert_near_part(srs.residual_high, expected, 1e-5);
	}
}

/* ---- another integrator ---- */

struct segment {
	double w, damping, from_g, to_g, step_s;
};

static int motion(double t, const double y[], double dydt[], void *params)
{
	const struct segment *s = params;
	double base = G * (s->from_g + (s->to_g - s->from_g) * t / s->step_s);

	dydt[0] = y[1];
	dydt[1] = -base - 2 * s->damping * s->w * y[1] - s->w * s->w * y[0];
	return GSL_SUCCESS;
}

/* Relative displacement, pseudo velocity and absolute acceleration from y = {z, z'}. */
static double quantity_of(enum srs_quantity quantity, const struct segment *s, const double y[2])
{
	if (quantity == SRS_DISPLACEMENT)
		return y[0];
	if (quantity == SRS_VELOCITY)
		return s->w * y[0];
	return -(2 * s->damping * s->w * y[1] + s->w * s->w * y[0]) / G;
}

static void reach(double value, double *high, double *low)
{
	*high = fmax(*high, value);
	*low = fmin(*low, value);
}

static struct srs_value integrate(const double *value, size_t count, double rate_hz, double frequency_hz,
                                  const struct srs_options *options)
{
	struct segment s = {2 * PI * frequency_hz, options->damping, 0, 0, 1 / rate_hz};
	gsl_odeiv2_system system = {motion, NULL, 2, &s};
	gsl_odeiv2_driver *driver =
	        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, s.step_s / 8, 1e-14, 1e-12);
	struct srs_value result = {0};
	double y[2] = {0, 0}, t, dense;

	for (size_t k = 0; k <= count; k++) {
		s.to_g = k < count ? value[k] : 0;
		t = 0;
		gsl_odeiv2_driver_reset_hstart(driver, s.step_s / 8);
		assert_int_equal(gsl_odeiv2_driver_apply(driver, &t, s.step_s, y), GSL_SUCCESS);
		s.from_g = s.to_g;
		if (k < count)
			reach(quantity_of(options->quantity, &s, y), &result.primary_high,
			      &result.primary_low);
	}
	reach(quantity_of(options->quantity, &s, y), &result.residual_high, &result.residual_low);
	s.to_g = 0;
	dense = 1 / frequency_hz / 500;
	t = 0;
	gsl_odeiv2_driver_reset_hstart(driver, dense);
	for (int i = 1; i <= 750; i++) {
		assert_int_equal(gsl_odeiv2_driver_apply(driver, &t, i * dense, y), GSL_SUCCESS);
		reach(quantity_of(options->quantity, &s, y), &result.residual_high, &result.residual_low);
	}
	gsl_odeiv2_driver_free(driver);
	return result;
}

static void integrator(void **state)
{
	static const double damping[] = {0, 0.001, 0.05, 0.5, 0.9, 0.9999}, hz[] = {0.3, 7, 40, 99};
	struct synth_random random = {5};
	double value[80];

	(void)state;
	for (size_t k = 0; k < 80; k++)
		value[k] = 100 * synth_normal(&random);
	for (size_t i = 0; i < 6 * 4 * SRS_QUANTITIES; i++) {
		struct srs_options options = {.damping = damping[i % 6],
		                              .quantity = (enum srs_quantity)(i / 24)};
		double f = hz[i / 6 % 4];
		struct srs_value srs = one(value, 80, 1000, f, &options);
		struct srs_value truth = integrate(value, 80, 1000, f, &options);
		double scale = fmax(srs_pick(&truth, SRS_MAXIMAX, SRS_TOTAL), 1e-12);

		assert_near(srs.primary_high, truth.primary_high, 1e-9 * scale);
		assert_near(srs.primary_low, truth.primary_low, 1e-9 * scale);
		assert_near(srs.residual_high, truth.residual_high, 3e-5 * scale);
		assert_near(srs.residual_low, truth.residual_low, 3e-5 * scale);
	}
}

/* ---- side by side ---- */

static void lanes(void **state)
{
	struct synth_random random = {6};
	double value[300], hz[61];
	struct srs_value all[61];

	(void)state;
	for (size_t k = 0; k < 300; k++)
		value[k] = synth_normal(&random);
	for (size_t i = 0; i < 61; i++)
		hz[i] = i % 3 == 0 ? 499.0 / (double)(i + 1)
		                   : 1 + (double)i; /* neither sorted nor of one rate */
	assert_int_equal(srs_compute(value, 300, 1000, hz, 61, &q10, all), 0);
	for (size_t i = 0; i < 61; i++) {
		struct srs_value alone = one(value, 300, 1000, hz[i], &q10);

		if (hz[i] <= 100)
			assert_memory_equal(&alone, &all[i], sizeof(alone));
		else /* the factor is that of the highest frequency */
			assert_near_part(srs_pick(&alone, SRS_MAXIMAX, SRS_TOTAL),
			                 srs_pick(&all[i], SRS_MAXIMAX, SRS_TOTAL), 0.02);
	}
}

static void sides_and_parts(void **state)
{
	struct srs_value value = {5, -3, 2, -7};

	(void)state;
	assert_near(srs_pick(&value, SRS_POSITIVE, SRS_TOTAL), 5, 0);
	assert_near(srs_pick(&value, SRS_NEGATIVE, SRS_TOTAL), 7, 0);
	assert_near(srs_pick(&value, SRS_MAXIMAX, SRS_TOTAL), 7, 0);
	assert_near(srs_pick(&value, SRS_MAXIMAX, SRS_PRIMARY), 5, 0);
	assert_near(srs_pick(&value, SRS_NEGATIVE, SRS_PRIMARY), 3, 0);
	assert_near(srs_pick(&value, SRS_POSITIVE, SRS_RESIDUAL), 2, 0);
}

/* ---- up-sampling ---- */

static double burst(double t, double hz)
{
	double x = t / 0.02;

	return x > 0 && x < 1 ? 100 * sin(PI * x) * sin(PI * x) * sin(2 * PI * hz * t) : 0;
}

/* A band-limited shock at 10 kHz has the spectrum it has at 320 kHz. */
static void upsampling(void **state)
{
	static const double hz[] = {1001, 1500, 2500, 4000, 5000};
	enum { COUNT = 400, FINE = 32 };
	double coarse[COUNT], *fine = malloc(COUNT * FINE * sizeof(*fine)), worst = 0, worst_kept = 0;
	struct srs_options kept = {.damping = 0.05, .keep_rate = true};

	(void)state;
	assert_non_null(fine);
	for (size_t i = 0; i < sizeof(hz) / sizeof(hz[0]); i++) {
		double truth, carrier = hz[i] < 3000 ? hz[i] : 3000;

		for (int k = 0; k < COUNT; k++)
			coarse[k] = burst((k - 50.3) / 10000, carrier);
		for (int k = 0; k < COUNT * FINE; k++)
			fine[k] = burst(((double)k / FINE - 50.3) / 10000, carrier);
		truth = maximax(fine, (COUNT - 1) * FINE + 1, 10000 * FINE, hz[i]);
		worst = fmax(worst, fabs(maximax(coarse, COUNT, 10000, hz[i]) / truth - 1));
		if (hz[i] < 4500) {
			struct srs_value srs = one(coarse, COUNT, 10000, hz[i], &kept);

			worst_kept =
			        fmax(worst_kept, fabs(srs_pick(&srs, SRS_MAXIMAX, SRS_TOTAL) / truth - 1));
		}
	}
	assert_true(worst < 0.006);
	assert_true(worst_kept > 0.05); /* that it is needed */
	free(fine);
}

/* What does not end at zero makes no wave at its ends: a constant is one from its first to its last sample.
 */
static void ends(void **state)
{
	double value[200];
	struct srs_options stiff = {.damping = 0.5};

	(void)state;
	for (size_t k = 0; k < 200; k++)
		value[k] = 10;
	for (double hz = 1; hz < 500; hz *= 3) {
		struct srs_value low = one(value, 200, 1000, hz, &stiff);

		/* Half damped, a step of 10 g overshoots to less than 13. */
		assert_true(low.primary_high >= (hz < 2 ? 5 : 9.9) && low.primary_high < 13);
	}
	assert_near(maximax(value, 1, 1000, 30), maximax((double[3]){0, 10, 0}, 3, 1000, 30), 1e-9);
}

static void refused(void **state)
{
	double value[4] = {1, 2, 3, 4}, hz = 10;
	struct srs_value out = {1, 2, 3, 4};
	struct srs_options options = {.damping = 1};

	(void)state;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &options, &out), DT_E_ARGUMENT);
	options.damping = -0.01;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &options, &out), DT_E_ARGUMENT);
	options.damping = NAN;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &options, &out), DT_E_ARGUMENT);
	assert_int_equal(srs_compute(value, 0, 1000, &hz, 1, &q10, &out), DT_E_ARGUMENT);
	assert_int_equal(srs_compute(value, 4, NAN, &hz, 1, &q10, &out), DT_E_ARGUMENT);
	hz = 0;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &q10, &out), DT_E_ARGUMENT);
	hz = 501;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &q10, &out), DT_E_RANGE);
	hz = 10;
	value[2] = NAN;
	assert_int_equal(srs_compute(value, 4, 1000, &hz, 1, &q10, &out), DT_E_ARGUMENT);
	assert_near(out.primary_high + out.residual_low, 5, 0);
}

/* ---- what a record may have ---- */

enum { FAULT_COUNT = 2000, FAULT_AT = 800 };

/* A half-sine of 485 g and 3 ms at 10 kHz in 1 g of noise. */
static struct channel shock(struct synth_random *random)
{
	struct channel channel = synth_channel("S2X", 10000, 0, FAULT_COUNT);

	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 485 * synth_pulse(SYNTH_HALF_SINE, ((double)k - FAULT_AT - 0.3) / 30) +
		                     synth_normal(random);
	return channel;
}

/* The largest difference to the clean spectrum, 5 to 1 918 Hz. */
static double spoilt(struct channel *channel, const double clean[104], unsigned *flags)
{
	double hz[104], worst = 0;
	struct srs_value value[104];
	struct signal signal;

	for (int i = 0; i < 104; i++)
		hz[i] = 5 * exp2(i / 12.0);
	assert_int_equal(signal_open(&signal, channel, false), 0);
	*flags = signal.flags;
	assert_int_equal(srs_compute(signal.value_g, signal.count, signal.rate_hz, hz, 104, &q10, value), 0);
	for (int i = 0; i < 104; i++)
		worst = fmax(worst, fabs(srs_pick(&value[i], SRS_MAXIMAX, SRS_TOTAL) / clean[i] - 1));
	signal_close(&signal);
	return worst;
}

static void faults(void **state)
{
	struct synth_random random = {9};
	struct channel channel = shock(&random), copy = synth_channel("S2X", 10000, 0, FAULT_COUNT);
	double hz, clean[104];
	unsigned flags;

	(void)state;
	for (int i = 0; i < 104; i++) {
		hz = 5 * exp2(i / 12.0);
		clean[i] = maximax(channel.value_g, channel.count, 10000, hz);
	}
	assert_true(spoilt(&channel, clean, &flags) < 0.01);
	assert_int_equal(flags, 0);
	for (int fault = 0; fault < 6; fault++) {
		memcpy(copy.value_g, channel.value_g, channel.count * sizeof(double));
		memset(copy.sample, 0, channel.count);
		switch (fault) {
		case 0: /* one that is no number */
			copy.value_g[FAULT_AT + 10] = NAN;
			break;
		case 1: /* lost at the peak */
			synth_lose(&copy, FAULT_AT + 12, 6);
			break;
		case 2: /* zeroed at the peak */
			memset(&copy.value_g[FAULT_AT + 12], 0, 6 * sizeof(double));
			break;
		case 3: /* a spike */
			copy.value_g[FAULT_AT + 300] += 800;
			break;
		case 4: /* a block of 30 ms lost where it is quiet */
			synth_lose(&copy, FAULT_AT + 700, 90);
			break;
		default:
			for (size_t k = 0; k < copy.count; k++)
				copy.value_g[k] += 20;
		}
		assert_true(spoilt(&copy, clean, &flags) < 0.025);
		assert_int_equal(flags, fault == 5 ? 0 : SIGNAL_BRIDGED);
	}
	synth_free(&channel);
	synth_free(&copy);
}

static void holes_refused(void **state)
{
	struct synth_random random = {10};
	struct channel channel = shock(&random);
	struct signal signal;

	(void)state;
	synth_lose(&channel, FAULT_AT + 8, 14);
	assert_int_equal(signal_open(&signal, &channel, false), DT_E_INCOMPLETE);
	synth_free(&channel);
	channel = shock(&random);
	for (size_t k = 0; k + 8 < channel.count; k += 25)
		synth_lose(&channel, k + 4, 4);
	assert_int_equal(signal_open(&signal, &channel, false), DT_E_INCOMPLETE);
	synth_lose(&channel, 0, channel.count);
	assert_int_equal(signal_open(&signal, &channel, false), DT_E_EMPTY);
	synth_free(&channel);
}

/* On a slope of 2 g/s: what the estimates say of the same channel. */
static void one_zero(void **state)
{
	struct synth_random random = {12};
	struct channel channel = shock(&random);
	struct record record = {.channels = &channel, .channel_count = 1};
	const struct estimate_options options = {0};
	struct analysis analysis;
	struct signal signal;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] += 0.5 + 20 * (double)k / channel.rate_hz;
	assert_int_equal(signal_open(&signal, &channel, false), 0);
	assert_int_equal(estimate_record(&record, &options, &analysis), 0);
	assert_true(analysis.channels[0].flags & RECORD_FLAG_DRIFT);
	assert_int_equal(signal.data_flags, analysis.channels[0].flags);
	assert_near(signal.offset_g, analysis.channels[0].baseline.offset_g, 0);
	assert_near(signal.value_g[FAULT_AT - 200], 0, 5);
	estimate_free(&analysis);
	signal_close(&signal);
	synth_free(&channel);
}

static void offsets(void **state)
{
	struct synth_random random = {11};
	struct channel channel = shock(&random);
	struct signal signal;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] += 3;
	assert_int_equal(signal_open(&signal, &channel, true), 0);
	assert_near(signal.offset_g, 3, 0.15);
	assert_near(signal.value_g[7], channel.value_g[7], 0);
	signal_close(&signal);
	channel.value_g += FAULT_AT; /* it starts inside its event */
	channel.sample += FAULT_AT;
	channel.count = 500;
	assert_int_equal(signal_open(&signal, &channel, false), 0);
	assert_near(signal.offset_g, 0, 0);
	assert_true(signal.flags & SIGNAL_NO_OFFSET);
	signal_close(&signal);
	channel.count = 15; /* and ends there */
	assert_int_equal(signal_open(&signal, &channel, false), 0);
	assert_true(signal.flags & SIGNAL_NOT_ENDED);
	signal_close(&signal);
	channel.value_g -= FAULT_AT;
	channel.sample -= FAULT_AT;
	synth_free(&channel);
}

/* ---- a spectrum from outside ---- */

enum { PEER_PERIODS = 111 };

#define PEER "../shared/data/peer_rsn8883/"

static size_t peer_record(double *value, size_t room)
{
	FILE *file = fopen(PEER "RSN8883_14383980_13849360.AT2", "r");
	char line[256];
	size_t count = 0;

	if (!file)
		return 0;
	for (int i = 0; i < 4; i++)
		assert_non_null(fgets(line, sizeof(line), file));
	while (count < room && fscanf(file, "%lf", &value[count]) == 1)
		count++;
	fclose(file);
	return count;
}

static void peer_periods(double period[PEER_PERIODS], double spectrum[PEER_PERIODS])
{
	static char text[65536];
	FILE *file = fopen(PEER "peer_nga_west2.json", "r");
	cJSON *root, *record, *one_spectrum, *item;
	size_t length;
	int i = 0;

	assert_non_null(file);
	length = fread(text, 1, sizeof(text) - 1, file);
	text[length] = '\0';
	fclose(file);
	root = cJSON_Parse(text);
	record = cJSON_GetArrayItem(root, 0);
	cJSON_ArrayForEach(item, cJSON_GetObjectItem(record, "period")) period[i++] = item->valuedouble;
	assert_int_equal(i, PEER_PERIODS);
	cJSON_ArrayForEach(one_spectrum, cJSON_GetObjectItem(record, "spectra"))
	{
		if (fabs(cJSON_GetObjectItem(one_spectrum, "damping")->valuedouble - 0.05) > 1e-9)
			continue;
		i = 0;
		cJSON_ArrayForEach(item, cJSON_GetObjectItem(one_spectrum, "h1")) spectrum[i++] =
		        item->valuedouble;
		assert_int_equal(i, PEER_PERIODS);
	}
	cJSON_Delete(root);
}

/* A ground motion and its pseudo acceleration as published; above 10 Hz the publisher interpolates. */
static void published(void **state)
{
	static double value[20000];
	size_t count = peer_record(value, 20000), checked = 0;
	double period[PEER_PERIODS], spectrum[PEER_PERIODS];
	struct srs_options options = {.damping = 0.05, .quantity = SRS_DISPLACEMENT};

	(void)state;
	if (count == 0)
		skip();
	assert_int_equal(count, 16396);
	peer_periods(period, spectrum);
	for (int i = 0; i < PEER_PERIODS; i++) {
		double w = 2 * PI / period[i];
		struct srs_value srs;

		if (period[i] < 0.1)
			continue;
		srs = one(value, count, 200, 1 / period[i], &options);
		assert_near_part(srs_pick(&srs, SRS_MAXIMAX, SRS_TOTAL) * w * w / G, spectrum[i], 1e-4);
		checked++;
	}
	assert_int_equal(checked, 85);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(half_sine),  cmocka_unit_test(slow_oscillators),
	        cmocka_unit_test(integrator), cmocka_unit_test(lanes),
	        cmocka_unit_test(upsampling), cmocka_unit_test(ends),
	        cmocka_unit_test(refused),    cmocka_unit_test(sides_and_parts),
	        cmocka_unit_test(faults),     cmocka_unit_test(holes_refused),
	        cmocka_unit_test(one_zero),   cmocka_unit_test(offsets),
	        cmocka_unit_test(published),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
