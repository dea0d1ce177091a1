/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "host/estimate/estimate.h"
#include "host/estimate/iepe.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846
#define BASE_S 3e-3
#define ONSET_S 0.1003

/* A half-sine of height 1 and base T from 0 on, behind a high-pass of tau, in closed form: in the pulse
 * y = (w tau / (1 + w^2 tau^2)) (cos w t + w tau sin w t - e^{-t/tau}), afterwards a decay from where it is.
 */
static double behind(double t, double tau)
{
	double w = PI / BASE_S, q = w * tau, scale = q / (1 + q * q);

	if (t < 0)
		return 0;
	if (t < BASE_S)
		return scale * (cos(w * t) + q * sin(w * t) - exp(-t / tau));
	return scale * (-1 - exp(-BASE_S / tau)) * exp(-(t - BASE_S) / tau);
}

static struct channel make(double rate_hz, double tau, double offset_g, double noise_g, uint64_t seed)
{
	struct channel channel = synth_channel("S2X", rate_hz, 0, (size_t)(0.5 * rate_hz));
	struct synth_random random = {seed};

	for (size_t k = 0; k < channel.count; k++) {
		channel.value_g[k] = offset_g + 485 * behind((double)k / rate_hz - ONSET_S, tau);
		if (noise_g > 0)
			channel.value_g[k] += noise_g * synth_normal(&random);
	}
	return channel;
}

/* The pulse comes back, and nothing is left after it. */
static void exact(void **state)
{
	static const double tau[] = {0.05, 0.3, 1};

	(void)state;
	for (int i = 0; i < 3; i++) {
		struct channel channel = make(10000, tau[i], 0, 0, 0);
		struct trace trace;

		assert_true(channel.value_g[1100] <
		            -0.8 * 485 * 2 * BASE_S / PI / tau[i] * exp(-0.007 / tau[i]));
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		iepe_undo(&trace, 0.02, tau[i]);
		for (size_t k = 0; k < trace.count; k++)
			assert_near(
			        trace.value_g[k],
			        485 * synth_pulse(SYNTH_HALF_SINE, ((double)k / 10000 - ONSET_S) / BASE_S),
			        0.003 / tau[i]);
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* A few lost samples cost what a straight line over them does; what came before is left as it was. */
static void bridged(void **state)
{
	struct channel channel = make(10000, 0.3, 0, 0, 0);
	struct trace trace;

	(void)state;
	synth_lose(&channel, 1016, 4);
	channel.value_g[50] = 7;
	assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
	iepe_undo(&trace, 0.02, 0.3);
	assert_near(trace.value_g[50], 7, 0);
	assert_true(isnan(trace.value_g[1017]));
	/* h^3 / 12 of the curvature at the summit: 485 (pi / T)^2 (5e-4)^3 / 12, over tau */
	assert_near(trace.value_g[4999], -485 * pow(PI / BASE_S, 2) * 1.25e-10 / 12 / 0.3, 0.002);
	trace_close(&trace);
	synth_free(&channel);
}

static struct estimate_channel analyse(const struct channel *channel, double tau)
{
	struct channel copy = *channel;
	struct record record = {.channels = &copy, .channel_count = 1};
	struct estimate_options options = {.iepe_time_constant_s = tau, .family = ESTIMATE_FAMILY_HALF_SINE};
	struct estimate_channel found;
	struct analysis analysis;

	assert_int_equal(estimate_record(&record, &options, &analysis), 0);
	found = analysis.channels[0];
	estimate_free(&analysis);
	return found;
}

/* Through the whole analysis, with an offset: what the supply took is there again. */
static void whole(void **state)
{
	struct channel channel = make(7000, 0.3, 1.5, 0.1, 3);
	struct estimate_channel plain = analyse(&channel, 0), undone = analyse(&channel, 0.3);
	double area = 9.80665 * 485 * 2 * BASE_S / PI;

	(void)state;
	assert_near(plain.peak.value_g, 485 - 1.5, 0.5);
	assert_near(undone.peak.value_g, 485, 0.2);
	assert_near(undone.peak.time_s, ONSET_S + BASE_S / 2, 0.5e-6);
	assert_near(undone.pulse.velocity_change_m_s, area, 0.02);
	assert_true(fabs(plain.pulse.velocity_change_m_s - area) > 0.03);
	synth_free(&channel);
}

/* Noise does not run away: 0.4 s later its walk and what the offset is off have left some hundredths. */
static void does_not_run_away(void **state)
{
	double worst = 0, squares = 0;
	int runs = 200;

	(void)state;
	for (int run = 0; run < runs; run++) {
		struct synth_random random = {(uint64_t)run + 1};
		struct channel channel = synth_channel("a", 7000, 0, 3500);
		struct trace trace;
		double sum = 0;

		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] = synth_normal(&random);
		for (size_t k = 0; k < 700; k++)
			sum += channel.value_g[k] / 700;
		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] -= sum;
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		iepe_undo(&trace, 0, 0.3);
		sum = 0;
		for (size_t k = 3400; k < 3500; k++)
			sum += (trace.value_g[k] - channel.value_g[k]) / 100;
		worst = fmax(worst, fabs(sum));
		squares += sum * sum / runs;
		trace_close(&trace);
		synth_free(&channel);
	}
	/* offset: t / (tau sqrt(700)); walk: sqrt(t / rate) / tau; t = 0.393 */
	assert_near_part(sqrt(squares), hypot(0.393 / 0.3 / sqrt(700), sqrt(0.393 / 7000) / 0.3), 0.15);
	assert_true(worst < 0.25);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(exact),
	        cmocka_unit_test(bridged),
	        cmocka_unit_test(whole),
	        cmocka_unit_test(does_not_run_away),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
