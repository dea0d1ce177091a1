/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "host/estimate/baseline.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846
#define ONSET_S 0.1003

/* What lies under the pulse. */
struct under {
	double offset_g, drift_g_s, hum_g, hum_hz, noise_g;
};

static double zero(const struct under *u, double t)
{
	return u->offset_g + u->drift_g_s * (t - ONSET_S / 2) + u->hum_g * cos(2 * PI * u->hum_hz * t + 0.7);
}

static void fill(struct channel *channel, const struct under *u, struct synth_random *random)
{
	for (size_t k = 0; k < channel->count; k++) {
		double t = channel->start_s + (double)k / channel->rate_hz;

		channel->value_g[k] = zero(u, t) + 485 * synth_pulse(SYNTH_HALF_SINE, (t - ONSET_S) / 3e-3);
		if (u->noise_g > 0)
			channel->value_g[k] += u->noise_g * synth_normal(random);
		channel->sample[k] = 0;
	}
}

static struct estimate_baseline find(const struct channel *channel, struct trace *trace)
{
	static double scratch[20000];
	struct estimate_baseline baseline;

	assert_int_equal(trace_open(trace, channel, -INFINITY, INFINITY), 0);
	baseline_find(trace, scratch, &baseline);
	baseline_remove(trace, &baseline);
	return baseline;
}

/* Mean and plain standard deviation of the same samples, by another road; spread by noise level. */
static void offset_and_noise(void **state)
{
	static const double noise[] = {0.1, 0.3, 1, 3, 10};
	struct channel channel = synth_channel("a", 7000, 0, 3500);
	struct synth_random random = {31};
	double off = 0, spread = 0;
	int runs = 500;

	(void)state;
	for (int run = 0; run < runs; run++) {
		struct under u = {.offset_g = 2.5, .noise_g = noise[run % 5]};
		struct estimate_baseline b;
		struct trace trace;
		double mean = 0, squares = 0;
		size_t from, n;

		fill(&channel, &u, &random);
		b = find(&channel, &trace);
		assert_true(b.samples > 675 && b.samples < 703);
		assert_near(b.until_s, ONSET_S, 4e-3);
		from = trace_index(&trace, b.from_s);
		n = trace_index(&trace, b.until_s) + 1 - from;
		for (size_t k = from; k < from + n; k++)
			mean += channel.value_g[k] / (double)n;
		for (size_t k = from; k < from + n; k++)
			squares += pow(channel.value_g[k] - mean, 2) / ((double)n - 1);
		assert_near(b.deviation_g, sqrt(squares), 1e-9);
		assert_near(b.offset_g, mean, 0.02 * u.noise_g); /* one far sample may be left out */
		assert_near_part(b.noise_g, sqrt(squares), 0.02);
		assert_near(trace.noise_g, b.noise_g, 0);
		assert_near(trace.value_g[100], channel.value_g[100] - b.offset_g, 1e-12);
		off += pow((b.offset_g - 2.5) / u.noise_g, 2) / runs;
		spread += pow(b.noise_g / u.noise_g - 1, 2) / runs;
		trace_close(&trace);
	}
	/* sigma / sqrt(n) and 1 / sqrt(2 n) */
	assert_near_part(sqrt(off), 1 / sqrt(700), 0.12);
	assert_near_part(sqrt(spread), 1 / sqrt(1400), 0.15);
	synth_free(&channel);
}

/* In thousands of quiet records there is neither drift nor hum; hardly one is allowed. */
static void no_ghosts(void **state)
{
	struct synth_random random = {32};
	int ghosts = 0;

	(void)state;
	for (int run = 0; run < 3000; run++) {
		struct channel channel = synth_channel("a", run % 2 ? 10000 : 7000, 0, 1200);
		struct under u = {.offset_g = 0.5, .noise_g = 1};
		struct estimate_baseline b;
		struct trace trace;

		fill(&channel, &u, &random);
		b = find(&channel, &trace);
		assert_int_equal(trace.flags & RECORD_FLAG_OFFSET, 0);
		ghosts += b.hum_g > 0 || fabs(b.drift_g_s) > 0 || b.doubtful;
		assert_int_equal(trace.flags != 0, b.hum_g > 0 || fabs(b.drift_g_s) > 0 || b.doubtful);
		assert_true(b.hum_g > 0 || isnan(b.hum_hz));
		trace_close(&trace);
		synth_free(&channel);
	}
	printf("%d of 3000 quiet records with drift or hum\n", ghosts);
	assert_true(ghosts <= 2);
}

static double worst_after(const struct trace *trace, double from_s, double until_s)
{
	double worst = 0;

	for (size_t k = trace_index(trace, from_s); k < trace_index(trace, until_s); k++)
		worst = fmax(worst, fabs(trace->value_g[k]));
	return worst;
}

/* Found, flagged, and gone from the decay's time. */
static void drift_and_hum(void **state)
{
	static const struct under table[] = {
	        {0.5, 100, 0, 50, 0.01}, {-2, -500, 0, 50, 0.01}, {0.5, 0, 5, 50, 0.01},
	        {0.5, 0, 2, 60, 0.01},   {12, 0, 5, 60, 0.01},    {1, 60, 5, 50, 0.01},
	        {0, 0, 0.2, 50, 0.01},
	};
	struct synth_random random = {33};

	(void)state;
	for (size_t i = 0; i < 2 * sizeof(table) / sizeof(table[0]); i++) {
		const struct under *u = &table[i / 2];
		struct channel channel = synth_channel("a", i % 2 ? 10000 : 7000, 0, 2000);
		struct estimate_baseline b;
		struct trace trace;
		unsigned flags = (u->hum_g > 0 ? RECORD_FLAG_HUM : 0u) |
		                 (fabs(u->drift_g_s) > 0 ? RECORD_FLAG_DRIFT : 0u) |
		                 (u->offset_g > 5 ? RECORD_FLAG_OFFSET : 0u);

		fill(&channel, u, &random);
		b = find(&channel, &trace);
		assert_int_equal(trace.flags, flags);
		assert_near(b.drift_g_s, u->drift_g_s, 0.2);
		assert_near(b.hum_g, u->hum_g, 0.01);
		if (u->hum_g > 0)
			assert_near(b.hum_hz, u->hum_hz, 0);
		assert_true(u->hum_g > 0 ? trace.hum_hz == b.hum_hz : isnan(trace.hum_hz));
		assert_near_part(b.noise_g, u->noise_g, 0.15);
		assert_true(b.deviation_g > 5 * u->noise_g);
		assert_true(worst_after(&trace, ONSET_S + 0.004, ONSET_S + 0.05) < 0.08);
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* With noise of its own size: the amplitude's spread is sigma sqrt(2 / n). */
static void hum_in_noise(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 1000);
	struct synth_random random = {34};
	double squares = 0;
	int runs = 300, seen = 0;

	(void)state;
	for (int run = 0; run < runs; run++) {
		struct under u = {.hum_g = 1, .hum_hz = run % 2 ? 60 : 50, .noise_g = 1};
		struct estimate_baseline b;
		struct trace trace;

		fill(&channel, &u, &random);
		b = find(&channel, &trace);
		if (b.hum_g > 0) {
			assert_near(b.hum_hz, u.hum_hz, 0);
			squares += pow(b.hum_g - 1, 2);
			seen++;
		}
		trace_close(&trace);
	}
	assert_int_equal(seen, runs);
	assert_near_part(sqrt(squares / runs), sqrt(2 / 700.0), 0.15);
	synth_free(&channel);
}

/* Motion before the pulse is no drift, however far a line would follow it: a step, a slow swing. */
static void motion(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 5000);
	struct synth_random random = {35};
	struct under u = {.noise_g = 0.3};

	(void)state;
	for (int kind = 0; kind < 2; kind++) {
		struct estimate_baseline b;
		struct trace trace;

		fill(&channel, &u, &random);
		for (size_t k = 0; k < 1000; k++)
			channel.value_g[k] +=
			        kind ? 10 * sin(2 * PI * 11 * (double)k / 10000) : (k < 300 ? 5 : 0);
		b = find(&channel, &trace);
		assert_near(b.drift_g_s, 0, 0);
		assert_near(b.hum_g, 0, 0);
		assert_int_equal(trace.flags & RECORD_FLAG_ZERO_UNSURE, RECORD_FLAG_ZERO_UNSURE);
		trace_close(&trace);
	}
	synth_free(&channel);
}

/* A quiet part too short for drift or hum, or of too few samples: hum makes its zero unsure, noise does not.
 */
static void short_quiet(void **state)
{
	static const struct {
		double rate_hz, quiet_s;
		int hummed; /* at least, of 200 */
	} table[] = {{10000, 0.007, 150}, {10000, 0.009, 190}, {10000, 0.012, 200}, {7000, 0.02, 200},
	             {10000, 0.03, 200},  {100000, 0.01, 200}, {1000, 0.1, 200},    {500, 0.1, 120}};
	struct synth_random random = {45};

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		double rate = table[i].rate_hz, from = ONSET_S - table[i].quiet_s;
		struct channel channel = synth_channel("a", rate, from, (size_t)(rate * 0.15));
		int white = 0, hummed = 0;

		for (int run = 0; run < 1200; run++) {
			struct under u = {.offset_g = 1, .noise_g = 0.3};
			double phase = 2 * PI * synth_uniform(&random);
			struct trace trace;
			bool unsure;

			fill(&channel, &u, &random);
			for (size_t k = 0; run >= 1000 && k < channel.count; k++)
				channel.value_g[k] += 5 * sin(2 * PI * 50 * (double)k / rate + phase);
			(void)find(&channel, &trace);
			unsure = trace.flags & RECORD_FLAG_ZERO_UNSURE;
			white += run < 1000 && unsure;
			hummed += run >= 1000 && unsure;
			trace_close(&trace);
		}
		printf("%g Hz, %g ms: unsure in %d of 1000 with noise, %d of 200 with hum\n", rate,
		       1e3 * table[i].quiet_s, white, hummed);
		assert_true(white <= 10 && hummed >= table[i].hummed);
		synth_free(&channel);
	}
}

/* A record of little else than motion: zero is where it begins, unless it begins within. */
static void mostly_motion(void **state)
{
	struct channel channel = synth_channel("a", 1e5, 0, 1400);
	struct estimate_baseline b;
	struct trace trace;

	(void)state;
	for (int within = 0; within < 2; within++) {
		for (size_t k = 0; k < channel.count; k++) {
			double t = (double)k * 1e-5 - (within ? -2e-3 : 2e-3);

			channel.value_g[k] = t < 0 ? 0 : 390 * exp(-80 * t) * sin(2 * PI * 129 * t);
		}
		b = find(&channel, &trace);
		assert_int_equal(b.samples, within ? 0 : 36);
		assert_near(b.offset_g, 0, 1e-9);
		if (!within)
			assert_near(b.noise_g, 0, 1e-9);
		trace_close(&trace);
	}
	synth_free(&channel);
}

/* Spikes and lost samples in the quiet part: neither moves zero nor widens the noise. */
static void robust(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 1400);
	struct synth_random random = {36};

	(void)state;
	for (int run = 0; run < 100; run++) {
		struct under u = {.offset_g = 20, .noise_g = 1};
		struct estimate_baseline b;
		struct trace trace;

		fill(&channel, &u, &random);
		for (int i = 0; i < 7; i++) {
			channel.value_g[20 + 91 * i] += i % 2 ? 300 : 250;
			synth_lose(&channel, (size_t)(50 + 93 * i), 10);
		}
		b = find(&channel, &trace);
		assert_near(b.offset_g, 20, 0.2);
		assert_near(b.noise_g, 1, 0.15);
		assert_true(b.deviation_g > 20);
		assert_int_equal(trace.flags & (RECORD_FLAG_OFFSET | RECORD_FLAG_DRIFT | RECORD_FLAG_HUM),
		                 RECORD_FLAG_OFFSET);
		trace_close(&trace);
	}
	synth_free(&channel);
}

/* Up to three tones of any frequency, harmonics that the block means only show folded, mains off its nominal:
 * found, flagged, gone from the decay's time. */
static void other_hum(void **state)
{
	static const struct {
		double hz[3], g[3];
	} table[] = {
	        {{16.7}, {5}},
	        {{49.8}, {5}},
	        {{100}, {5}},
	        {{150}, {3}},
	        {{180}, {2}},
	        {{300}, {3}},
	        {{360}, {5}},
	        {{50, 150}, {5, 2}},
	        {{60, 300}, {3, 2}},
	        {{50, 100, 150}, {5, 2, 2}},
	        {{50.2, 150.6}, {5, 2}},
	};
	struct synth_random random = {38};

	(void)state;
	for (size_t i = 0; i < 2 * sizeof(table) / sizeof(table[0]); i++) {
		struct channel channel = synth_channel("a", i % 2 ? 10000 : 7000, -0.15, i % 2 ? 3500 : 2500);
		struct under u = {.offset_g = 1, .noise_g = 0.3};
		struct estimate_baseline b;
		struct trace trace;

		fill(&channel, &u, &random);
		for (size_t k = 0; k < channel.count; k++)
			for (size_t h = 0; h < 3; h++)
				channel.value_g[k] +=
				        table[i / 2].g[h] *
				        sin(2 * PI * table[i / 2].hz[h] * (double)k / channel.rate_hz + 1.1);
		b = find(&channel, &trace);
		if (trace.flags != RECORD_FLAG_HUM || fabs(b.hum_g - table[i / 2].g[0]) > 0.1)
			print_message("tone %g Hz: %g g at %g Hz, flags %x\n", table[i / 2].hz[0], b.hum_g,
			              b.hum_hz, trace.flags);
		assert_int_equal(trace.flags, RECORD_FLAG_HUM);
		assert_near(b.hum_g, table[i / 2].g[0], 0.1);
		assert_near(b.hum_hz, table[i / 2].hz[0], 0.1);
		assert_near(b.offset_g, 1, 0.1);
		assert_near_part(b.noise_g, 0.3, 0.1);
		/* noise alone would be 4 of 0.3 */
		assert_true(worst_after(&trace, ONSET_S + 0.004, ONSET_S + 0.05) < 1.8);
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* A shock of another origin in the quiet part: neither zero nor noise are its, and the flag is up. */
static void earlier_shock(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 3000);
	struct synth_random random = {39};
	struct under u = {.offset_g = 2, .noise_g = 0.3};
	struct estimate_baseline b;
	struct trace trace;

	(void)state;
	fill(&channel, &u, &random);
	for (size_t k = 500; k < 1000; k++)
		channel.value_g[k] +=
		        40 * sin(2 * PI * 230 * (double)(k - 500) / 10000) * exp(-(double)(k - 500) / 400);
	b = find(&channel, &trace);
	assert_int_equal(trace.flags, RECORD_FLAG_ZERO_UNSURE);
	assert_true(b.doubtful);
	assert_near(b.offset_g, 2, 0.1);
	assert_near(b.noise_g, 0.3, 0.1);
	trace_close(&trace);
	synth_free(&channel);
}

/* A record that begins inside its pulse, one that is constant, one of nothing. */
static void without_quiet(void **state)
{
	struct channel channel = synth_channel("a", 7000, ONSET_S + 0.0002, 700);
	struct synth_random random = {37};
	struct under u = {.offset_g = 1, .noise_g = 1};
	struct estimate_baseline b;
	struct trace trace;

	(void)state;
	fill(&channel, &u, &random);
	b = find(&channel, &trace);
	assert_int_equal(b.samples, 0);
	assert_near(b.offset_g, 0, 0);
	assert_near(b.noise_g, 1, 0.2);
	assert_true(isnan(b.from_s) && isnan(b.hum_hz));
	assert_true(b.doubtful);
	trace_close(&trace);
	for (size_t k = 0; k < 700; k++)
		channel.value_g[k] = 3;
	b = find(&channel, &trace);
	assert_near(b.offset_g, 3, 0);
	assert_near(b.noise_g, 0, 0);
	trace_close(&trace);
	channel.count = 0;
	b = find(&channel, &trace);
	assert_true(isnan(b.noise_g) && b.samples == 0);
	trace_close(&trace);
	channel.count = 700;
	synth_free(&channel);
}

/* Only marks that the quiet part has, and what moves it, ask for another baseline. */
static void holds(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 3500);
	struct under u = {.offset_g = 2, .noise_g = 1};
	struct synth_random random = {38};
	static double scratch[3500];
	struct estimate_baseline b;
	struct trace trace;
	size_t quiet;

	(void)state;
	fill(&channel, &u, &random);
	assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
	baseline_find(&trace, scratch, &b);
	assert_true(baseline_holds(&trace, &b));
	trace.sample[900] |= SAMPLE_SPIKE;
	trace_marked(&trace);
	assert_true(baseline_holds(&trace, &b));
	quiet = trace_index(&trace, b.from_s) + 100;
	trace.sample[quiet] |= SAMPLE_SPIKE;
	assert_false(baseline_holds(&trace, &b));
	trace.sample[quiet] = SAMPLE_BAD;
	assert_false(baseline_holds(&trace, &b));
	trace.sample[quiet] = 0;
	trace.value_g[quiet + 300] = 900;
	trace_changed(&trace);
	assert_false(baseline_holds(&trace, &b));
	b.samples = 0;
	assert_false(baseline_holds(&trace, &b));
	trace_close(&trace);
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(offset_and_noise), cmocka_unit_test(no_ghosts),
	        cmocka_unit_test(drift_and_hum),    cmocka_unit_test(hum_in_noise),
	        cmocka_unit_test(motion),           cmocka_unit_test(short_quiet),
	        cmocka_unit_test(mostly_motion),    cmocka_unit_test(robust),
	        cmocka_unit_test(other_hum),        cmocka_unit_test(earlier_shock),
	        cmocka_unit_test(without_quiet),    cmocka_unit_test(holds),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
