/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What a chain leaves in a record of one axis, each in as many drops: flagged in every one of them, a sample
 * that is there twice or missing in nine of ten, and nothing in a whole one. Corners and noise of far reach
 * are no defect: bars hold, no flag.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "tests/unit/synth.h"

#define RATE_HZ 7000.0
#define HEIGHT_G 300.0
#define BASE_S 4e-3
#define ONSET_S 0.1
#define SHIFT_G 9.0

enum { SAMPLES = 1400, DROPS = 40 };

enum spoil { WHOLE, CABLE, LATE_SHIFT, REPEATED, MISSING, CORNER, STUDENT, STUDENT_SPIKE };

/* As the sensor sees it, t after the onset. */
static double shock(enum spoil spoil, double t)
{
	double x = t / BASE_S, value = HEIGHT_G * synth_pulse(SYNTH_HALF_SINE, x);

	if (spoil == CORNER)
		value = x > 0 && x < 1 ? HEIGHT_G * (1 - fabs(2 * x - 1)) : 0;
	return spoil == LATE_SHIFT && t > 0.04 ? value + SHIFT_G : value;
}

/* Student's of three degrees of freedom, of deviation 1, is what reaches far. */
static double noise(enum spoil spoil, double t, struct synth_random *random)
{
	double value = synth_normal(random), square = 0;

	for (unsigned i = 0; i < 3; i++)
		square += pow(synth_normal(random), 2);
	if (spoil >= STUDENT)
		return value / sqrt(square);
	return (spoil == CABLE && t > 0.01 ? 0.05 : 1) * value;
}

/* The flags of channel, peak and pulse; whether the peak is within three of its bars. */
static bool flagged(enum spoil spoil, struct synth_random *random, unsigned of_channel, unsigned of_value,
                    bool *covered)
{
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	struct record record = {.channels = &channel, .channel_count = 1};
	const struct estimate_options options = {0};
	double onset_s = ONSET_S + synth_uniform(random) / RATE_HZ;
	size_t at = (size_t)(RATE_HZ * (onset_s + BASE_S / 5));
	const struct estimate_channel *result;
	struct analysis analysis;
	bool found;

	for (size_t k = 0; k < SAMPLES; k++) {
		double t = (double)k / RATE_HZ - onset_s;

		channel.value_g[k] = shock(spoil, t) + noise(spoil, t, random);
	}
	if (spoil == REPEATED)
		memmove(channel.value_g + at + 1, channel.value_g + at, (SAMPLES - at - 1) * sizeof(double));
	if (spoil == MISSING)
		memmove(channel.value_g + at, channel.value_g + at + 1, (SAMPLES - at - 1) * sizeof(double));
	if (spoil == STUDENT_SPIKE)
		channel.value_g[at + 200] += 400; /* noise itself comes to 40 */
	assert_int_equal(estimate_record(&record, &options, &analysis), 0);
	result = &analysis.channels[0];
	found = result->flags & of_channel || result->peak.how.flags & of_value ||
	        result->pulse.flags & of_value;
	*covered = fabs(result->peak.value_g - HEIGHT_G) < 3 * result->peak.sigma_g;
	estimate_free(&analysis);
	synth_free(&channel);
	return found;
}

static unsigned count(enum spoil spoil, unsigned of_channel, unsigned of_value, unsigned *covered)
{
	struct synth_random random = {1 + (uint64_t)spoil};
	unsigned found = 0;

	*covered = 0;
	for (unsigned i = 0; i < DROPS; i++) {
		bool holds;

		found += flagged(spoil, &random, of_channel, of_value, &holds);
		*covered += holds;
	}
	return found;
}

static void chain(void **state)
{
	const unsigned any = RECORD_FLAG_CABLE | RECORD_FLAG_SPIKE;
	const unsigned doubt = ESTIMATE_FLAG_TAIL | ESTIMATE_FLAG_STEP;
	unsigned covered;

	(void)state;
	assert_int_equal(count(WHOLE, any, doubt, &covered), 0);
	assert_int_equal(count(CABLE, RECORD_FLAG_CABLE, 0, &covered), DROPS);
	assert_int_equal(count(LATE_SHIFT, 0, ESTIMATE_FLAG_TAIL, &covered), DROPS);
	assert_true(count(REPEATED, 0, ESTIMATE_FLAG_STEP, &covered) >= DROPS - 4);
	assert_true(count(MISSING, 0, ESTIMATE_FLAG_STEP, &covered) >= DROPS - 4);
}

static void no_defect(void **state)
{
	unsigned covered;

	(void)state;
	assert_int_equal(count(CORNER, RECORD_FLAG_CABLE | RECORD_FLAG_SPIKE, ESTIMATE_FLAG_STEP, &covered),
	                 0);
	assert_true(covered >= DROPS - 1);
	assert_int_equal(count(STUDENT, RECORD_FLAG_SPIKE, ESTIMATE_FLAG_SPIKE, &covered), 0);
	assert_true(covered >= DROPS - 1);
	assert_int_equal(count(STUDENT_SPIKE, RECORD_FLAG_SPIKE, 0, &covered), DROPS);
}

/* A pulse of nine samples bends too much for its rises to be alike: the same number twice tells. */
static void twice_in_a_short_pulse(void **state)
{
	enum { SHORT_DROPS = 300 };
	struct synth_random random = {40};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	struct record record = {.channels = &channel, .channel_count = 1};
	unsigned found[2] = {0, 0};

	(void)state;
	for (unsigned i = 0; i < 2 * SHORT_DROPS; i++) {
		const struct estimate_options options = {0};
		double onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ;
		size_t at = (size_t)(RATE_HZ * onset_s) + 2 + (size_t)(2 * synth_uniform(&random));
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++) {
			double x = ((double)k / RATE_HZ - onset_s) / 1.3e-3;
			double v = HEIGHT_G * synth_pulse(SYNTH_HALF_SINE, x) + synth_normal(&random);

			channel.value_g[k] = round(32 * v) / 32;
		}
		if (i % 2)
			memmove(channel.value_g + at + 1, channel.value_g + at,
			        (SAMPLES - at - 1) * sizeof(double));
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		found[i % 2] += (analysis.channels[0].pulse.flags & ESTIMATE_FLAG_STEP) != 0;
		estimate_free(&analysis);
	}
	print_message("twice: %u of %u told, %u of %u whole ones\n", found[1], SHORT_DROPS, found[0],
	              SHORT_DROPS);
	assert_true(found[1] > SHORT_DROPS * 9 / 10);
	assert_int_equal(found[0], 0);
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(chain), cmocka_unit_test(no_defect),
	                                   cmocka_unit_test(twice_in_a_short_pulse)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
