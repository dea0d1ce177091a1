/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/cfc.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

/* The standards' algorithm, word by word: y = a0 x + a1 x1 + a2 x2 + b1 y1 + b2 y2, forward and backward. */
static double gain(unsigned class, double rate_hz, double hz)
{
	double wd = 2 * PI * class * 2.0775, wa = sin(wd / rate_hz / 2) / cos(wd / rate_hz / 2);
	double below = 1 + sqrt(2) * wa + wa * wa, a0 = wa * wa / below;
	double b1 = -2 * (wa * wa - 1) / below, b2 = (-1 + sqrt(2) * wa - wa * wa) / below;
	double complex z = cexp(-I * 2 * PI * hz / rate_hz);
	double one_pass = cabs((a0 + 2 * a0 * z + a0 * z * z) / (1 - b1 * z - b2 * z * z));

	return one_pass * one_pass;
}

static void response(void **state)
{
	static const struct {
		unsigned class;
		double rate_hz;
	} table[] = {{60, 10000}, {180, 7000}, {600, 7000}, {600, 10000}, {1000, 10000}, {1000, 1000000}};

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		unsigned class = table[i].class;
		size_t count = (size_t)(60 * table[i].rate_hz / class);
		struct channel channel = synth_channel("a", table[i].rate_hz, 0, count);
		struct trace trace;

		for (double part = 0.2; part < 3; part += 0.4) {
			double hz = part * class, g = gain(class, table[i].rate_hz, hz);

			for (size_t k = 0; k < count; k++)
				channel.value_g[k] = sin(2 * PI * hz * (double)k / table[i].rate_hz + 0.3);
			assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
			assert_int_equal(cfc_filter(&trace, class), 0);
			for (size_t k = count / 3; k < 2 * count / 3; k++)
				assert_near(trace.value_g[k], g * channel.value_g[k], 1e-6);
			trace_close(&trace);
		}
		/* The classes' corridor: flat within half a decibel to a tenth of the class, +0.5 to -1 dB at
		 * it, +0.5 to -4 dB at 5/3 of it, -30 dB or less at ten times 5/3 where there is such. */
		assert_true(fabs(20 * log10(gain(class, table[i].rate_hz, 0.1 * class))) < 0.5);
		assert_true(20 * log10(gain(class, table[i].rate_hz, class)) > -1);
		assert_true(20 * log10(gain(class, table[i].rate_hz, class / 0.6)) > -4);
		synth_free(&channel);
	}
}

/* A shock keeps its place and its area; ends and holes are the low-pass' (test_filter). */
static void pulse(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 1000);
	struct trace trace;
	double before = 0, after = 0, moment = 0;

	(void)state;
	for (size_t k = 0; k < channel.count; k++) {
		channel.value_g[k] = 485 * synth_pulse(SYNTH_HALF_SINE, ((double)k - 485) / 30);
		before += channel.value_g[k];
	}
	synth_lose(&channel, 900, 5);
	assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
	assert_int_equal(cfc_filter(&trace, 180), 0);
	for (size_t k = 0; k < 900; k++) {
		after += trace.value_g[k];
		moment += trace.value_g[k] * (double)k;
	}
	assert_near_part(after, before, 1e-6);
	assert_near(moment / after, 500, 1e-3);
	assert_false(trace_good(&trace, 902));
	assert_near(trace.value_g[950], 0, 1e-6);
	trace_close(&trace);
	synth_free(&channel);
}

static void rates(void **state)
{
	struct channel channel = synth_channel("S1X", 7000, 0, 100);
	struct trace trace;

	(void)state;
	assert_int_equal(cfc_check(1000, 10000), 0);
	assert_int_equal(cfc_check(1000, 9999), DT_E_RANGE);
	assert_int_equal(cfc_check(600, 7000), 0);
	assert_int_equal(cfc_check(180, 1799), DT_E_RANGE);
	assert_int_equal(cfc_check(700, 1e6), DT_E_UNKNOWN);
	assert_int_equal(cfc_check(60, NAN), DT_E_RANGE);
	assert_int_equal((int)cfc_highest(7000), 600);
	assert_int_equal((int)cfc_highest(10000), 1000);
	assert_int_equal((int)cfc_highest(500), 0);
	channel.value_g[50] = 1;
	assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
	assert_int_equal(cfc_filter(&trace, 1000), DT_E_RANGE);
	assert_memory_equal(trace.value_g, channel.value_g, 100 * sizeof(double));
	trace_close(&trace);
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(response),
	        cmocka_unit_test(pulse),
	        cmocka_unit_test(rates),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
