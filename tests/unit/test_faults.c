/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Faults that others pass over in silence, one by one through the whole analysis: each is flagged, and what
 * can be cured comes out as it would have without the fault.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "host/record/drop.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846
#define ONSET_S 0.1003
#define BASE_S 3e-3
#define PEAK_G 485.1
#define NATURAL_HZ 129
#define RATE_HZ 7000.0

enum { PLATE = 200000, S1X = 0, S2X, CHANNELS, SUMMIT = 713 };

static double plate[PLATE];

struct drop {
	struct channel channel[CHANNELS];
	struct record record;
};

static void make(struct drop *drop, uint64_t seed)
{
	static const char *const names[CHANNELS] = {"S1X", "S2X"};
	struct synth_random random = {seed};

	memset(drop, 0, sizeof(*drop));
	for (int i = 0; i < CHANNELS; i++) {
		struct channel *c = &drop->channel[i];

		*c = synth_channel(names[i], RATE_HZ, 0, (size_t)(0.4 * RATE_HZ));
		for (size_t k = 0; k < c->count; k++) {
			double t = (double)k / RATE_HZ - ONSET_S;
			double value = i == S1X ? synth_table(plate, PLATE, SYNTH_STEP_S, t)
			                        : synth_pulse(SYNTH_HALF_SINE, t / BASE_S);

			c->value_g[k] = round(32 * (PEAK_G * value + synth_normal(&random))) / 32;
		}
	}
	drop->record.channels = drop->channel;
	drop->record.channel_count = CHANNELS;
	drop_set_axes(&drop->record);
}

static void drop_free(struct drop *drop)
{
	for (int i = 0; i < CHANNELS; i++)
		synth_free(&drop->channel[i]);
}

static struct analysis analyse(struct drop *drop)
{
	struct estimate_options options = {.family = ESTIMATE_FAMILY_HALF_SINE};
	struct analysis analysis;

	assert_int_equal(estimate_record(&drop->record, &options, &analysis), 0);
	return analysis;
}

/* What a cure leaves: some bounds' worth of the clean drop's truth. */
static void check_cured(const struct analysis *a)
{
	const struct estimate_channel *s1 = &a->channels[S1X], *s2 = &a->channels[S2X];

	assert_int_equal(s2->peak.how.status, ESTIMATE_OK);
	assert_near(s2->peak.value_g, PEAK_G, 2);
	assert_near(s2->peak.time_s, ONSET_S + BASE_S / 2, 5e-6);
	assert_near(s2->pulse.velocity_change_m_s, 9.80665 * PEAK_G * BASE_S * 2 / PI, 0.06);
	assert_int_equal(s1->ringdown.how.status, ESTIMATE_OK);
	assert_near(s1->ringdown.frequency_hz, NATURAL_HZ * sqrt(0.99), 0.15);
	assert_near(s1->ringdown.damping_ratio, 0.1, 0.0015);
}

/* Feeds what break_it makes of a clean drop; expects these flags and no others on S1X and S2X. */
static void feed(void (*break_it)(struct drop *), unsigned s1_flags, unsigned s2_flags)
{
	for (uint64_t seed = 1; seed <= 5; seed++) {
		struct drop drop;
		struct analysis a;

		make(&drop, seed);
		break_it(&drop);
		a = analyse(&drop);
		assert_int_equal(a.channels[S1X].flags, s1_flags);
		assert_int_equal(a.channels[S2X].flags, s2_flags);
		check_cured(&a);
		estimate_free(&a);
		drop_free(&drop);
	}
}

static void leave(struct drop *drop)
{
	(void)drop;
}

static void nothing(void **state)
{
	(void)state;
	feed(leave, 0, 0);
}

static void put_nan(struct drop *drop)
{
	drop->channel[S2X].value_g[SUMMIT + 3] = NAN;
	drop->channel[S1X].value_g[800] = INFINITY;
	drop->channel[S1X].value_g[300] = NAN;
}

static void not_a_number(void **state)
{
	(void)state;
	feed(put_nan, RECORD_FLAG_BAD, RECORD_FLAG_BAD);
}

static void put_offset(struct drop *drop)
{
	for (int i = 0; i < CHANNELS; i++)
		for (size_t k = 0; k < drop->channel[i].count; k++)
			drop->channel[i].value_g[k] += i == S1X ? 20 : -20;
}

static void offset(void **state)
{
	(void)state;
	feed(put_offset, RECORD_FLAG_OFFSET, RECORD_FLAG_OFFSET);
}

static void put_drift(struct drop *drop)
{
	for (int i = 0; i < CHANNELS; i++)
		for (size_t k = 0; k < drop->channel[i].count; k++)
			drop->channel[i].value_g[k] += 100 * ((double)k / RATE_HZ - 0.05);
}

static void drift(void **state)
{
	(void)state;
	feed(put_drift, RECORD_FLAG_DRIFT, RECORD_FLAG_DRIFT);
}

static void put_hum(struct drop *drop)
{
	for (int i = 0; i < CHANNELS; i++)
		for (size_t k = 0; k < drop->channel[i].count; k++)
			drop->channel[i].value_g[k] += 5 * sin(2 * PI * 50 * (double)k / RATE_HZ + i);
}

static void hum(void **state)
{
	(void)state;
	feed(put_hum, RECORD_FLAG_HUM, RECORD_FLAG_HUM);
}

static void put_spikes(struct drop *drop)
{
	drop->channel[S1X].value_g[770] += 300;
	drop->channel[S1X].value_g[815] -= 300;
	drop->channel[S1X].value_g[880] += 300;
	drop->channel[S2X].value_g[SUMMIT + 2] += 300;
	drop->channel[S2X].value_g[150] = 900; /* larger than the pulse, and before it */
}

static void spikes(void **state)
{
	(void)state;
	feed(put_spikes, RECORD_FLAG_SPIKE, RECORD_FLAG_SPIKE);
}

static void put_zeros(struct drop *drop)
{
	memset(&drop->channel[S1X].value_g[772], 0, 4 * sizeof(double));
	memset(&drop->channel[S2X].value_g[SUMMIT + 2], 0, 4 * sizeof(double));
}

static void zeroed(void **state)
{
	const unsigned flags = RECORD_FLAG_ZEROED | RECORD_FLAG_BAD;

	(void)state;
	feed(put_zeros, flags, flags);
}

static void lose_some(struct drop *drop)
{
	synth_lose(&drop->channel[S1X], 790, 20);
	synth_lose(&drop->channel[S2X], SUMMIT + 2, 4);
	drop->channel[S1X].flags = drop->channel[S2X].flags = RECORD_FLAG_LOST; /* as a reader says */
}

static void missing(void **state)
{
	(void)state;
	feed(lose_some, RECORD_FLAG_LOST, RECORD_FLAG_LOST);
}

/* All of it at once. */
static void put_all(struct drop *drop)
{
	put_offset(drop);
	put_drift(drop);
	put_spikes(drop);
	drop->channel[S1X].value_g[300] = NAN;
	synth_lose(&drop->channel[S1X], 790, 10);
}

static void together(void **state)
{
	const unsigned both = RECORD_FLAG_OFFSET | RECORD_FLAG_DRIFT | RECORD_FLAG_SPIKE;

	(void)state;
	feed(put_all, both | RECORD_FLAG_BAD, both);
}

/* Clipped: flagged, and the value is either one from the family, said to be extrapolated, or not ok. */
static void clipped(void **state)
{
	(void)state;
	for (uint64_t seed = 1; seed <= 5; seed++) {
		struct drop drop;
		struct analysis a;
		const struct estimate_peak *peak;

		make(&drop, seed);
		for (size_t k = 0; k < drop.channel[S2X].count; k++)
			drop.channel[S2X].value_g[k] = fmin(drop.channel[S2X].value_g[k], 400);
		if (seed % 2)
			drop.channel[S2X].value_g[150] = 900; /* hides the limit until it is marked */
		a = analyse(&drop);
		peak = &a.channels[S2X].peak;
		assert_int_equal(a.channels[S2X].flags,
		                 RECORD_FLAG_CLIPPED | (seed % 2 ? RECORD_FLAG_SPIKE : 0u));
		assert_int_equal(a.channels[S1X].flags, 0);
		assert_true(peak->how.status == ESTIMATE_CLIPPED);
		if (peak->how.flags & ESTIMATE_FLAG_EXTRAPOLATED)
			assert_near(peak->value_g, PEAK_G, 5);
		estimate_free(&a);
		drop_free(&drop);
	}
}

/* Too short, at either end. */
static void too_short(void **state)
{
	struct drop drop;
	struct analysis a;

	(void)state;
	make(&drop, 1);
	drop.channel[S1X].count = drop.channel[S2X].count = SUMMIT - 2;
	a = analyse(&drop);
	for (int i = 0; i < CHANNELS; i++) {
		assert_true(a.channels[i].flags & RECORD_FLAG_SHORT);
		assert_true(a.channels[i].ringdown.how.status != ESTIMATE_OK);
		assert_true(a.channels[i].pulse.status != ESTIMATE_OK);
	}
	estimate_free(&a);
	drop.channel[S1X].count = drop.channel[S2X].count = 2;
	a = analyse(&drop);
	for (int i = 0; i < CHANNELS; i++)
		assert_int_equal(a.channels[i].flags, RECORD_FLAG_SHORT);
	estimate_free(&a);
	/* Long enough for the pulse, not for the decay. */
	drop.channel[S1X].count = drop.channel[S2X].count = 750;
	a = analyse(&drop);
	assert_int_equal(a.channels[S2X].peak.how.status, ESTIMATE_OK);
	assert_int_equal(a.channels[S1X].ringdown.how.status, ESTIMATE_SHORT);
	estimate_free(&a);
	drop_free(&drop);
}

static void options(void **state)
{
	const struct estimate_options wrong[] = {
	        {.lowpass_hz = -1},
	        {.lowpass_hz = NAN},
	        {.iepe_time_constant_s = -1},
	        {.iepe_time_constant_s = INFINITY},
	        {.tolerance = -1},
	        {.tolerance = NAN},
	        {.impact_speed_m_s = -1},
	        {.impact_speed_m_s = NAN},
	        {.family = ESTIMATE_FAMILIES},
	        {.family = (enum estimate_family) - 1},
	};
	struct analysis analysis = {.channel_count = 77};
	struct drop drop;

	(void)state;
	make(&drop, 1);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		assert_int_equal(estimate_record(&drop.record, &wrong[i], &analysis), DT_E_ARGUMENT);
	assert_int_equal(analysis.channel_count, 77);
	drop_free(&drop);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(nothing), cmocka_unit_test(not_a_number), cmocka_unit_test(offset),
	        cmocka_unit_test(drift),   cmocka_unit_test(hum),          cmocka_unit_test(spikes),
	        cmocka_unit_test(zeroed),  cmocka_unit_test(missing),      cmocka_unit_test(together),
	        cmocka_unit_test(clipped), cmocka_unit_test(too_short),    cmocka_unit_test(options),
	};

	synth_plate(plate, PLATE, SYNTH_HALF_SINE, BASE_S, NATURAL_HZ, 0.1);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
