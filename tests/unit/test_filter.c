/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "host/estimate/filter.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

static struct trace filtered(const struct channel *channel, double lowpass_hz)
{
	struct trace trace;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	assert_int_equal(filter_lowpass(&trace, lowpass_hz), 0);
	return trace;
}

/* Gain of two passes of a 4-pole Butterworth whose common corner is corner_hz, on the bilinear axis. */
static double gain(double hz, double corner_hz, double rate_hz)
{
	double ratio = tan(PI * hz / rate_hz) / tan(PI * corner_hz / rate_hz);

	return 1 / (1 + (sqrt(2) - 1) * pow(ratio, 8));
}

/* A sine keeps its phase and gets the gain of the closed form; -3 dB at the corner asked for. */
static void response(void **state)
{
	static const double hz[] = {20, 300, 600, 1000, 1300, 2000};

	(void)state;
	assert_near(gain(1000, 1000, 10000), sqrt(0.5), 1e-12);
	for (size_t i = 0; i < sizeof(hz) / sizeof(hz[0]); i++) {
		struct channel channel = synth_channel("a", 10000, 0, 2000);
		struct trace trace;

		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] = sin(2 * PI * hz[i] * (double)k / 10000 + 0.3);
		trace = filtered(&channel, 1000);
		for (size_t k = 500; k < 1500; k++)
			assert_near(trace.value_g[k], gain(hz[i], 1000, 10000) * channel.value_g[k], 1e-6);
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* A straight line passes unchanged, ends included. */
static void ends(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 300);
	struct trace trace;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 12 - 0.7 * (double)k;
	trace = filtered(&channel, 150);
	for (size_t k = 0; k < channel.count; k++)
		assert_near(trace.value_g[k], channel.value_g[k], 1e-3);
	trace_close(&trace);
	synth_free(&channel);
}

/* Each run between holes is filtered as if it were alone; the holes stay, whatever they hold. */
static void segments(void **state)
{
	struct synth_random random = {11};
	struct channel channel = synth_channel("a", 10000, 0, 500), part;
	struct trace trace, alone;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = synth_normal(&random);
	synth_lose(&channel, 0, 1);
	synth_lose(&channel, 200, 3);
	channel.value_g[340] = NAN;
	synth_lose(&channel, 342, 1);
	trace = filtered(&channel, 800);
	part = channel;
	part.value_g += 203;
	part.sample += 203;
	part.count = 340 - 203;
	alone = filtered(&part, 800);
	for (size_t k = 0; k < part.count; k++)
		assert_near(trace.value_g[203 + k], alone.value_g[k], 1e-12);
	for (size_t k = 0; k < channel.count; k++) {
		bool hole = k == 0 || (k >= 200 && k < 203) || k == 340 || k == 342;

		assert_int_equal(trace_good(&trace, k), !hole);
		assert_true(hole || isfinite(trace.value_g[k]));
	}
	assert_near(trace.value_g[341], channel.value_g[341], 0);
	trace_close(&alone);
	trace_close(&trace);
	synth_free(&channel);
}

static void nothing_to_do(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 50);
	struct trace trace;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = k % 2 ? 1 : -1;
	trace = filtered(&channel, 4600);
	assert_memory_equal(trace.value_g, channel.value_g, channel.count * sizeof(double));
	trace_close(&trace);
	for (size_t n = 0; n < 4; n++) {
		channel.count = n;
		trace = filtered(&channel, 10);
		for (size_t k = 0; k < n; k++)
			assert_true(fabs(trace.value_g[k]) <= 3);
		trace_close(&trace);
	}
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(response),
	        cmocka_unit_test(ends),
	        cmocka_unit_test(segments),
	        cmocka_unit_test(nothing_to_do),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
