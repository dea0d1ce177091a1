/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The drops of host/chart against another synthesis (synth.c, which integrates what synthetic.c has in
 * closed form), and its bounds against closed forms of the literature.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "host/chart/bound.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

enum { DROPS = 20 };

static const enum synth_shape shapes[SYNTHETIC_FAMILIES] = {SYNTH_HALF_SINE, SYNTH_HAVERSINE, SYNTH_HERTZ,
                                                            SYNTH_HUNT_CROSSLEY};

static void pulses_are_the_same(void **state)
{
	(void)state;
	for (unsigned f = 0; f < SYNTHETIC_FAMILIES; f++) {
		enum synthetic_family family = (enum synthetic_family)f;

		for (double s = -0.1; s < 1.1; s += 0.00037)
			assert_near(synthetic_pulse(family, s), synth_pulse(shapes[f], s), 2e-6);
		assert_near(synthetic_pulse_area(family), synth_pulse_area(shapes[f]), 2e-6);
		assert_near(synthetic_pulse_summit(family), synth_pulse_summit(shapes[f]), 2e-6);
	}
}

static void the_plate_moves_the_same(void **state)
{
	enum { COUNT = 30000 };
	double *plate = calloc(COUNT, sizeof(*plate));

	(void)state;
	assert_non_null(plate);
	for (unsigned f = 0; f < SYNTHETIC_FAMILIES; f++) {
		struct synthetic_axis axis = {
		        .peak_g = 1, .contact_s = 3e-3, .gain = 1, .damped_hz = 129, .damping = 0.1};
		struct synthetic_signal signal;

		assert_int_equal(synthetic_signal_open(&signal, (enum synthetic_family)f, &axis), 0);
		synth_plate(plate, COUNT, shapes[f], 3e-3, 129 / sqrt(0.99), 0.1);
		for (size_t k = 0; k < COUNT; k += 7)
			assert_near(synthetic_plate(&signal, (double)k * SYNTH_STEP_S), plate[k], 2e-6);
		synthetic_signal_close(&signal);
	}
	free(plate);
}

static void bounds_agree_with_closed_forms(void **state)
{
	struct synthetic_scene scene = synthetic_scene();
	double n = scene.rate_hz[0] * scene.contact_s, a = 2 * PI * scene.damped_hz * 0.1 / sqrt(0.99);
	struct synthetic synthetic;
	struct bound bound;

	(void)state;
	scene.step_g = 0;
	assert_int_equal(synthetic_open(&synthetic, &scene), 0);
	assert_int_equal(bound_find(&synthetic, false, &bound), 0);
	assert_near_part(bound.peak_g[0], sqrt(2.466 / n), 0.005);
	assert_near_part(bound.peak_s[0], sqrt(2 / n) / PI / scene.peak_g[0] * scene.contact_s, 0.005);
	assert_near_part(bound.contact_s[0], sqrt(1.865 / n) / scene.peak_g[0] * scene.contact_s, 0.01);
	assert_near_part(bound.velocity_m_s[0], 9.80665 * sqrt(0.9995 * scene.contact_s / scene.rate_hz[0]),
	                 0.005);
	assert_near_part(bound.damped_hz[0], 2 / PI * sqrt(a * a * a / scene.rate_hz[0]) / 312, 0.06);
	assert_near_part(bound.pair_hz, 1 / sqrt(pow(bound.damped_hz[0], -2) + pow(bound.damped_hz[1], -2)),
	                 0.01);
	synthetic_close(&synthetic);
}

/* The interval that was asked for, from the samples of a quiet drop. */
static void the_peaks_are_apart_as_asked(void **state)
{
	struct synthetic_scene scene = synthetic_scene();
	struct synthetic synthetic;

	(void)state;
	scene.noise_g = scene.step_g = 0;
	scene.rate_hz[0] = scene.rate_hz[1] = 1e6;
	for (unsigned f = 0; f < SYNTHETIC_FAMILIES; f++) {
		double when[2];

		scene.family = (enum synthetic_family)f;
		assert_int_equal(synthetic_open(&synthetic, &scene), 0);
		synthetic_drop(&synthetic, f);
		for (unsigned i = 0; i < 2; i++) {
			const struct channel *channel =
			        &synthetic.record.channels[i ? SYNTHETIC_S2X : SYNTHETIC_S1X];
			size_t at = 0;

			for (size_t k = 1; k < channel->count; k++)
				if (channel->value_g[k] > channel->value_g[at])
					at = k;
			assert_near(channel->value_g[at], i ? 485.1 : 310.1, 1e-3);
			when[i] = (double)at / channel->rate_hz;
		}
		assert_near(when[0] - when[1], 2e-3, 2.1e-6);
		assert_near(synthetic_truth(&synthetic).lag_s[0], 2e-3, 1e-7);
		assert_near(synthetic_truth(&synthetic).peak_s[0], when[1], 1.1e-6);
		assert_near(synthetic_truth(&synthetic).plate_g[0], 310.1, 1e-6);
		synthetic_close(&synthetic);
	}
}

static size_t count_marked(const struct synthetic *synthetic, enum synthetic_channel c)
{
	size_t n = 0;

	for (size_t k = 0; k < synthetic->record.channels[c].count; k++)
		n += synthetic->record.channels[c].sample[k] == SAMPLE_LOST;
	return n;
}

static void troubles_are_as_asked(void **state)
{
	struct synthetic_scene scene = synthetic_scene();
	struct synthetic synthetic;
	size_t missing = 0, samples = 0;

	(void)state;
	scene.clip_g = 300;
	scene.gap = scene.lost_at_peak = 4;
	assert_int_equal(synthetic_open(&synthetic, &scene), 0);
	for (unsigned drop = 0; drop < DROPS; drop++) {
		synthetic_drop(&synthetic, drop);
		for (unsigned c = 0; c < SYNTHETIC_CHANNELS; c++) {
			assert_int_equal(count_marked(&synthetic, (enum synthetic_channel)c),
			                 c == SYNTHETIC_S2Z ? 0 : 4);
			for (size_t k = 0; k < synthetic.record.channels[c].count; k++)
				assert_false(synthetic.record.channels[c].value_g[k] > 300);
		}
	}
	synthetic_close(&synthetic);
	scene = synthetic_scene();
	scene.missing = 0.2;
	assert_int_equal(synthetic_open(&synthetic, &scene), 0);
	for (unsigned drop = 0; drop < DROPS; drop++) {
		synthetic_drop(&synthetic, drop);
		missing += count_marked(&synthetic, SYNTHETIC_S1X);
		samples += synthetic.record.channels[SYNTHETIC_S1X].count;
	}
	synthetic_close(&synthetic);
	assert_near((double)missing / (double)samples, 0.2, 0.01); /* 4 standard deviations */
}

static void a_drop_is_its_seed(void **state)
{
	struct synthetic_scene scene = synthetic_scene();
	struct synthetic one, other;
	size_t bytes;

	(void)state;
	scene.hum_g = 1;
	scene.spikes = 2;
	scene.jitter_s = 1e-6;
	assert_int_equal(synthetic_open(&one, &scene), 0);
	assert_int_equal(synthetic_open(&other, &scene), 0);
	synthetic_drop(&one, 5);
	synthetic_drop(&other, 4);
	bytes = one.record.channels[0].count * sizeof(double);
	assert_memory_not_equal(one.record.channels[0].value_g, other.record.channels[0].value_g, bytes);
	synthetic_drop(&other, 5);
	assert_memory_equal(one.record.channels[0].value_g, other.record.channels[0].value_g, bytes);
	synthetic_close(&one);
	synthetic_close(&other);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(pulses_are_the_same),
	        cmocka_unit_test(the_plate_moves_the_same),
	        cmocka_unit_test(bounds_agree_with_closed_forms),
	        cmocka_unit_test(the_peaks_are_apart_as_asked),
	        cmocka_unit_test(troubles_are_as_asked),
	        cmocka_unit_test(a_drop_is_its_seed),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
