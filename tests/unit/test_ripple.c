/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A half-sine of 4 ms on X and Y of the case, and of a plate that is fixed to it, with a ripple of 2.5 % that
 * fades over 6 ms, 1 to 2.2 kHz, in noise of 1.2 %. The true top is looked for on a grid of 1 us.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "host/record/drop.h"
#include "tests/unit/synth.h"

enum { CHANNELS = 4, DROPS = 300, SAMPLES = 1400 };

#define HEIGHT_G 200.0
#define BASE_S 4e-3
#define ONSET_S 0.1
#define NOISE_G (0.012 * HEIGHT_G)
#define FADES_S 6e-3
#define ANGLE 0.6

static const double pi = 3.14159265358979;

struct ripple {
	double part, hz, onset_s;
};

/* In parts of the height, t after the onset. */
static double shock(const struct ripple *ripple, double t)
{
	double pulse = t > 0 && t < BASE_S ? sin(pi * t / BASE_S) : 0;

	return t > 0 ? pulse + ripple->part * exp(-t / FADES_S) * sin(2 * pi * ripple->hz * t) : 0;
}

static double top_s(const struct ripple *ripple)
{
	double top = 0;

	for (double t = 0; t < BASE_S; t += 1e-6)
		if (shock(ripple, t) > shock(ripple, top))
			top = t;
	return ripple->onset_s + top;
}

struct count {
	unsigned told, covered, wide; /* times; wide: bars of more than a hundredth of the base */
};

static struct count repeat(double part)
{
	const double part_of[2] = {cos(ANGLE), sin(ANGLE)};
	struct synth_random random = {5};
	struct channel channels[CHANNELS] = {
	        synth_channel("S2X", 7000, 0, SAMPLES), synth_channel("S2Y", 10000, 0, 2 * SAMPLES),
	        synth_channel("S1X", 7000, 0, SAMPLES), synth_channel("S1Y", 10000, 0, 2 * SAMPLES)};
	struct record record = {
	        .channels = channels, .channel_count = CHANNELS, .is_drop = true, .trigger_s = ONSET_S};
	struct count count = {0, 0, 0};

	drop_set_axes(&record);
	for (unsigned i = 0; i < DROPS; i++) {
		const struct estimate_options options = {0};
		const struct ripple ripple = {part, 1000 * pow(2.2, synth_uniform(&random)),
		                              ONSET_S + synth_uniform(&random) / 7000};
		struct analysis analysis;

		for (unsigned c = 0; c < CHANNELS; c++)
			for (size_t k = 0; k < channels[c].count; k++)
				channels[c].value_g[k] =
				        HEIGHT_G * part_of[c % 2] *
				                shock(&ripple,
				                      (double)k / channels[c].rate_hz - ripple.onset_s) +
				        NOISE_G * synth_normal(&random);
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		for (unsigned c = 0; c < CHANNELS; c++) {
			const struct estimate_peak *peak = &analysis.channels[c].peak;

			if (peak->how.status != ESTIMATE_OK)
				continue;
			count.told++;
			count.covered += fabs(peak->time_s - top_s(&ripple)) < 2 * peak->sigma_time_s;
			count.wide += peak->sigma_time_s > BASE_S / 100;
		}
		estimate_free(&analysis);
	}
	for (unsigned c = 0; c < CHANNELS; c++)
		synth_free(&channels[c]);
	print_message("ripple of %g: %u told, %u within two bars, %u wide\n", part, count.told, count.covered,
	              count.wide);
	return count;
}

/* Without the ripple's doubt two bars hold 24 % of the times; with it 87. */
static void a_ripple_under_noise(void **state)
{
	struct count count = repeat(0.025);

	(void)state;
	assert_true(count.told >= CHANNELS * DROPS * 0.95);
	assert_true(count.covered >= 0.82 * count.told);
}

/* Chance is a ripple too: 13 % of the bars are wide, 7 without its doubt. */
static void a_pulse_without_one(void **state)
{
	struct count count = repeat(0);

	(void)state;
	assert_true(count.told >= CHANNELS * DROPS * 0.95);
	assert_true(count.covered >= 0.94 * count.told);
	assert_true(count.wide <= 0.17 * count.told);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(a_ripple_under_noise),
	                                   cmocka_unit_test(a_pulse_without_one)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
