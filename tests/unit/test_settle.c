/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "host/estimate/settle.h"
#include "host/record/read.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PEAK_G 3970.0
#define BASE_S 2e-3

enum decay { EXPONENTIAL, HYPERBOLA, RAMP, STEP };

struct drop {
	double amplitude_g, time_constant_s, noise_g, onset_s, sign, offset_g;
	enum decay decay;
};

static double zero(const struct drop *drop, double t)
{
	double x = t / drop->time_constant_s;

	switch (drop->decay) {
	case EXPONENTIAL:
		return drop->amplitude_g * exp(-x);
	case HYPERBOLA:
		return drop->amplitude_g / (1 + x);
	case RAMP:
		return drop->amplitude_g * fmax(1 - x, 0);
	case STEP:
		return x < 1 ? drop->amplitude_g : 0;
	}
	return 0;
}

static struct analysis analyse(const struct drop *drop, double rate_hz, struct synth_random *random)
{
	struct estimate_options options = {.family = ESTIMATE_FAMILY_AUTO};
	size_t count = (size_t)((drop->onset_s + 0.1) * rate_hz);
	struct channel *channel;
	struct analysis analysis;
	struct record record;

	record_init(&record);
	channel = record_add_channel(&record, "a", rate_hz, count);
	assert_non_null(channel);
	for (size_t k = 0; k < count; k++) {
		double t = (double)k / rate_hz;

		channel->value_g[k] =
		        drop->offset_g + zero(drop, t) + drop->noise_g * synth_normal(random) +
		        drop->sign * PEAK_G * synth_pulse(SYNTH_HALF_SINE, (t - drop->onset_s) / BASE_S);
		channel->sample[k] = 0;
	}
	record_finish(&record);
	assert_int_equal(estimate_record(&record, &options, &analysis), 0);
	record_free(&record);
	return analysis;
}

static bool holds(const struct analysis *analysis, const struct drop *drop, double part)
{
	const struct estimate_peak *peak = &analysis->channels[0].peak;

	return fabs(peak->value_g - drop->sign * PEAK_G) < 4 * peak->sigma_g + part * PEAK_G &&
	       fabs(peak->time_s - drop->onset_s - BASE_S / 2) < 5e-5;
}

/* Offsets from a hundredth to four times the pulse, settling within a hundredth to four times the way to it,
 * both polarities of each: the pulse is what it is without. */
static void exponential(void **state)
{
	static const double amplitude[] = {40, 400, 2000, 15000}, part[] = {0.02, 0.1, 0.3, 1, 4};
	static const double noise[] = {0.02, 1, 8};
	struct synth_random random = {91};
	int runs = 0, flagged = 0, refused = 0;

	(void)state;
	for (size_t i = 0; i < 2 * 2 * 4 * 5 * 3 * 2; i++) {
		double onset_s = i & 4 ? 0.0203 : 0.0811, rate_hz = 50000;
		struct drop drop = {.amplitude_g = (i & 1 ? -1 : 1) * amplitude[i / 8 % 4],
		                    .time_constant_s = part[i / 32 % 5] * onset_s,
		                    .noise_g = noise[i / 160 % 3],
		                    .onset_s = onset_s,
		                    .sign = i & 2 ? -1 : 1,
		                    .offset_g = 7};
		struct analysis a = analyse(&drop, rate_hz, &random);

		refused += a.channels[0].peak.how.status != ESTIMATE_OK;
		if (a.channels[0].peak.how.status == ESTIMATE_OK && !holds(&a, &drop, 6e-4))
			fail_msg("%g g over %g s under %g g, pulse %+g at %g s: %g +- %g g at %g s, flags %x",
			         drop.amplitude_g, drop.time_constant_s, drop.noise_g, drop.sign, onset_s,
			         a.channels[0].peak.value_g, a.channels[0].peak.sigma_g,
			         a.channels[0].peak.time_s, a.channels[0].flags);
		runs++;
		flagged += (a.channels[0].flags & RECORD_FLAG_SETTLING) != 0;
		estimate_free(&a);
	}
	printf("# %d records, %d flagged settling, %d not ok; the others too slow to tell from a slope\n",
	       runs, flagged, refused);
	assert_true(flagged > runs * 8 / 10 && refused < runs / 20);
}

/* A record that ends long before the offset has gone, of too few samples before its pulse for an exponential
 * at times: the pulse is what it is without, or is not ok. */
static void outlasts_the_record(void **state)
{
	static const double amplitude[] = {0.2, 0.67, 1, 3}, time_constant_s[] = {0.05, 0.1, 0.2, 0.5, 2};
	struct synth_random random = {17};
	int runs = 0, ok = 0;

	(void)state;
	for (size_t i = 0; i < 2 * 2 * 2 * 4 * 5; i++) {
		struct drop drop = {.amplitude_g = (i & 1 ? -1 : 1) * amplitude[i / 8 % 4] * PEAK_G,
		                    .time_constant_s = time_constant_s[i / 32],
		                    .noise_g = 10,
		                    .onset_s = i & 2 ? 0.02 : 0.05,
		                    .sign = 1};
		struct analysis analysis = analyse(&drop, i & 4 ? 5000 : 20000, &random);
		bool is_ok = analysis.channels[0].peak.how.status == ESTIMATE_OK;

		if (is_ok && !holds(&analysis, &drop, 0.02))
			fail_msg("%.0f g and %g s at %g s: %g g +- %g", drop.amplitude_g,
			         drop.time_constant_s, drop.onset_s, analysis.channels[0].peak.value_g,
			         analysis.channels[0].peak.sigma_g);
		ok += is_ok;
		runs++;
		estimate_free(&analysis);
	}
	print_message("# %d records, %d ok\n", runs, ok);
	assert_true(ok > runs / 2);
}

/* Decays of another law: the value holds to half a percent, or is not called ok. */
static void other_decays(void **state)
{
	static const double amplitude[] = {100, 400, 2000, 15000}, part[] = {0.1, 0.3, 0.9, 3};
	struct synth_random random = {92};
	int wrong = 0, ok = 0;

	(void)state;
	for (int i = 0; i < 2 * 2 * 4 * 4 * 3; i++) {
		struct drop drop = {.amplitude_g = (i & 1 ? -1 : 1) * amplitude[i / 4 % 4],
		                    .time_constant_s = part[i / 16 % 4] * 0.0811,
		                    .noise_g = 5,
		                    .onset_s = 0.0811,
		                    .sign = i & 2 ? -1 : 1,
		                    .decay = (enum decay)(HYPERBOLA + i / 64)};
		struct analysis a;

		/* a step as large as the pulse is a shock of its own */
		if (drop.decay == STEP && fabs(drop.amplitude_g) > 400)
			continue;
		a = analyse(&drop, 50000, &random);
		if (a.channels[0].peak.how.status == ESTIMATE_OK) {
			ok++;
			if (!holds(&a, &drop, 5e-3)) {
				wrong++;
				print_message(
				        "# %g g, law %d over %g s, pulse %+g: %g +- %g g ok, flags %x\n",
				        drop.amplitude_g, drop.decay, drop.time_constant_s, drop.sign,
				        a.channels[0].peak.value_g, a.channels[0].peak.sigma_g,
				        a.channels[0].flags);
			}
		}
		estimate_free(&a);
	}
	printf("# of 160 records %d ok, %d of them wrong\n", ok, wrong);
	assert_int_equal(wrong, 0);
	assert_true(ok > 20);
}

/* Noise, white and of a narrow band, hum, a slope, a pulse that has begun, a decaying swing: nothing settles.
 */
static void clean(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 2000);
	struct synth_random random = {93};
	int found[6] = {0};

	(void)state;
	for (int run = 0; run < 1200; run++) {
		struct settle settle;
		struct trace trace;
		int kind = run % 6;
		double band = 0, phase = synth_uniform(&random);

		for (size_t k = 0; k < channel.count; k++) {
			double t = (double)k / 10000, v = synth_normal(&random);

			band = 0.8 * band + 0.6 * v;
			if (kind == 1)
				v = band;
			else if (kind == 2)
				v += 10 * sin(2 * 3.14159265 * (50 * t + phase));
			else if (kind == 3)
				v += 300 * t;
			else if (kind == 4) /* cut between a fifth and four fifths of its base */
				v += 900 * synth_pulse(SYNTH_HALF_SINE, t / 0.01 + 0.2 + 0.6 * phase);
			else if (kind == 5)
				v += 300 * exp(-40 * t) * cos(2 * 3.14159265 * (130 * t + phase));
			channel.value_g[k] = v;
			if (kind != 4)
				channel.value_g[k] += 900 * synth_pulse(SYNTH_HALF_SINE, (t - 0.12) / 3e-3);
		}
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		found[kind] += settle_find(&trace, &settle);
		trace_close(&trace);
	}
	printf("# of 200 each: white %d, band %d, hum %d, slope %d, cut pulse %d, swing %d\n", found[0],
	       found[1], found[2], found[3], found[4], found[5]);
	for (int kind = 0; kind < 6; kind++)
		assert_int_equal(found[kind], 0);
	synth_free(&channel);
}

/* A real shock that rises from its first samples on, with an offset of twice its height laid under it: as
 * without where it settles before that, and not ok where it does not. */
static void real_shock(void **state)
{
	static const char file[] = "../shared/data/afrl_in_situ/T04.txt";
	struct estimate_options options = {.family = ESTIMATE_FAMILY_AUTO, .lowpass_hz = 50000};
	struct analysis plain, settling;
	char message[READ_MESSAGE_MAX];
	struct record record;

	(void)state;
	if (access(file, R_OK))
		skip();
	assert_int_equal(read_record(&record, file, "time:ms,fixture:g,-,-,-,-", message), 0);
	assert_int_equal(estimate_record(&record, &options, &plain), 0);
	for (int i = 0; i < 3; i++) {
		double tau_s = (i == 0 ? 0.02 : i == 1 ? 0.1 : 0.5) * plain.channels[0].peak.time_s;
		struct channel *channel = &record.channels[0];
		const struct estimate_peak *peak;

		for (size_t k = 0; k < channel->count; k++)
			channel->value_g[k] += 15000 * exp(-(double)k / channel->rate_hz / tau_s);
		assert_int_equal(estimate_record(&record, &options, &settling), 0);
		peak = &settling.channels[0].peak;
		print_message("# %g +- %g g, %g +- %g g over %g ms\n", plain.channels[0].peak.value_g,
		              plain.channels[0].peak.sigma_g, peak->value_g, peak->sigma_g, 1e3 * tau_s);
		assert_true(i > 0 || settling.channels[0].flags & RECORD_FLAG_SETTLING);
		if (i == 0 || peak->how.status == ESTIMATE_OK) {
			assert_near_part(peak->value_g, plain.channels[0].peak.value_g, 0.01);
			assert_near(peak->time_s, plain.channels[0].peak.time_s, 1e-5);
		}
		for (size_t k = 0; k < channel->count; k++)
			channel->value_g[k] -= 15000 * exp(-(double)k / channel->rate_hz / tau_s);
		estimate_free(&settling);
	}
	estimate_free(&plain);
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(exponential),  cmocka_unit_test(outlasts_the_record),
	        cmocka_unit_test(other_decays), cmocka_unit_test(clean),
	        cmocka_unit_test(real_shock),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
