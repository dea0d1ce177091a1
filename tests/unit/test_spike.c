/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "host/estimate/clean.h"
#include "host/estimate/dropout.h"
#include "host/estimate/spike.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define DATA "../shared/data"
#define PI 3.14159265358979323846

enum { PLATE = 60000 };

static double plate[SYNTH_SHAPES][PLATE];

static double quantised(double value)
{
	return round(value * 32) / 32;
}

/* 20 ms before a contact of that base and 80 ms after it: S2, or the plate of S1. */
static void fill(struct channel *channel, enum synth_shape shape, bool on_plate, double base_s, double peak_g,
                 double noise_g, struct synth_random *random)
{
	double onset = 0.02 + synth_uniform(random) / channel->rate_hz;

	for (size_t k = 0; k < channel->count; k++) {
		double t = (double)k / channel->rate_hz - onset;
		double value = on_plate ? synth_table(plate[shape], PLATE, SYNTH_STEP_S, t * 3e-3 / base_s)
		                        : synth_pulse(shape, t / base_s);

		channel->value_g[k] = quantised(peak_g * value + noise_g * synth_normal(random));
		channel->sample[k] = 0;
	}
}

static size_t marked(const struct channel *channel, double noise_g, size_t *first)
{
	struct trace trace;
	size_t n = 0;
	bool any;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	any = spike_mark(&trace, noise_g);
	for (size_t k = trace.count; k-- > 0;) {
		if (trace.sample[k] & SAMPLE_SPIKE) {
			n++;
			*first = k;
		}
	}
	assert_int_equal(any, n > 0);
	assert_int_equal((trace.flags & RECORD_FLAG_SPIKE) != 0, n > 0);
	trace_close(&trace);
	return n;
}

/* No sample of a clean drop, whatever the shape, the rate, the noise and the base from 1 to 6 ms. */
static void clean(void **state)
{
	static const double noise[] = {0.3, 1, 3, 10};
	struct synth_random random = {20};
	size_t drops = 0, samples = 0, at = 0;

	(void)state;
	for (int run = 0; run < 640; run++) {
		double rate = run % 2 ? 10000 : 7000, sigma = noise[run / 2 % 4];
		struct channel channel = synth_channel("a", rate, 0, (size_t)(0.1 * rate));

		for (int kind = 0; kind < 2 * SYNTH_SHAPES; kind++) {
			double base = run % 4 ? 3e-3 : 1e-3 * (1 + 5 * synth_uniform(&random));
			double peak = run % 4 ? 485 : 1000 * synth_uniform(&random);

			fill(&channel, (enum synth_shape)(kind / 2), kind % 2, base, peak, sigma, &random);
			samples += marked(&channel, sigma, &at);
			drops++;
		}
		synth_free(&channel);
	}
	printf("%zu of the samples of %zu clean channels marked\n", samples, drops);
	assert_int_equal(samples, 0);
}

/* A fifth of the samples missing: still no clean one is marked, and nine spikes of ten beside a hole are. */
static void among_holes(void **state)
{
	static const double noise[] = {0.3, 1, 3, 10};
	struct synth_random random = {25};
	size_t wrong = 0, found = 0, spikes = 0, at = 0;

	(void)state;
	for (int run = 0; run < 640; run++) {
		double rate = run % 2 ? 10000 : 7000, sigma = noise[run / 2 % 4];
		struct channel channel = synth_channel("a", rate, 0, (size_t)(0.1 * rate));

		for (int kind = 0; kind < 2 * SYNTH_SHAPES; kind++) {
			size_t spike = (size_t)((0.03 + 0.06 * synth_uniform(&random)) * rate);

			fill(&channel, (enum synth_shape)(kind / 2), kind % 2, 3e-3, 485, sigma, &random);
			for (size_t k = 0; k < channel.count; k++)
				if (synth_uniform(&random) < 0.2)
					channel.sample[k] = SAMPLE_LOST;
			wrong += marked(&channel, sigma, &at);
			channel.sample[spike] = 0;
			channel.sample[spike + 1] = SAMPLE_LOST;
			channel.value_g[spike] += run % 3 ? 300 : -300;
			spikes++;
			found += marked(&channel, sigma, &at) == 1 && at == spike;
		}
		synth_free(&channel);
	}
	printf("%zu clean samples marked, %zu of %zu spikes found\n", wrong, found, spikes);
	assert_int_equal(wrong, 0);
	assert_true(found >= spikes * 90 / 100 && found < spikes);
}

/* A decay that begins suddenly, damping ratio to 0.1, of any frequency that a sensor's bandwidth lets
 * through: up to 0.43 of the rate. */
static void vibrations(void **state)
{
	struct channel channel = synth_channel("a", 10000, 0, 1000);
	struct synth_random random = {21};
	size_t at = 0;

	(void)state;
	for (int run = 0; run < 2000; run++) {
		double w = 2 * PI * 0.35 * synth_uniform(&random), phase = 2 * PI * synth_uniform(&random);
		double decay = 0.1 * synth_uniform(&random);

		for (size_t k = 0; k < 1000; k++) {
			double t = (double)k - 300;

			channel.value_g[k] =
			        (t < 0 ? 0 : 300 * exp(-decay * w * t) * sin(w * t + (run % 2 ? phase : 0))) +
			        synth_normal(&random);
		}
		if (marked(&channel, 1, &at) > 0)
			fail_msg("run %d: w %g phase %g decay %g at %zu", run, w, phase, decay, at);
	}
	synth_free(&channel);
}

/* No spikes: a swing that ends at once, 20 to 60 times the noise, and rings of 8 to 40 times it that are gone
 * after a few samples, up to 0.43 of the rate. */
static void steps_and_rings(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 200);
	struct synth_random random = {27};
	size_t steps = 0, rings = 0, at = 0;

	(void)state;
	for (int run = 0; run < 20000; run++) {
		bool ring = run % 2;
		double size = ring ? 8 * pow(5, synth_uniform(&random)) : 20 + 40 * synth_uniform(&random);
		double w = 2 * PI * (ring ? 0.17 + 0.26 * synth_uniform(&random) : 0.01);
		double decay = 0.05 + 0.1 * synth_uniform(&random), begin = synth_uniform(&random);

		for (size_t k = 0; k < 200; k++) {
			double t = (double)k - 100 - begin;
			double value =
			        ring ? (t > 0) * exp(-decay * w * t) * sin(w * t) : (t < 0) * cos(w * t);

			channel.value_g[k] = size * value + synth_normal(&random);
		}
		*(ring ? &rings : &steps) += marked(&channel, 1, &at) > 0;
	}
	printf("%zu of 10000 steps, %zu of 10000 rings marked\n", steps, rings);
	assert_int_equal(steps, 0);
	assert_true(rings <= 80);
	synth_free(&channel);
}

/* Of Student's distribution with five degrees of freedom, deviation 1. */
static double student(struct synth_random *random)
{
	double square = 0;

	for (int i = 0; i < 5; i++)
		square += pow(synth_normal(random), 2);
	return synth_normal(random) / sqrt(square / 5) * sqrt(3.0 / 5);
}

/* The largest of 2 000 samples of such noise reach further than three times the largest of the 700 before
 * them, once in a hundred channels: they are left out, and no defect. A spike of twelve times that is one. */
static void noise_that_reaches_far(void **state)
{
	enum { QUIET = 700, ALL = 2700, CHANNELS = 1500 };
	const struct estimate_baseline quiet = {
	        .from_s = 0, .until_s = (QUIET - 0.5) / 7000, .samples = QUIET, .noise_g = 1};
	struct channel channel = synth_channel("a", 7000, 0, ALL);
	struct synth_random random = {28};
	size_t left_out = 0, flagged = 0, found = 0;

	(void)state;
	for (int run = 0; run < CHANNELS; run++) {
		double most = 0;
		struct trace trace;

		for (size_t k = 0; k < ALL; k++) {
			channel.value_g[k] = student(&random);
			most = k < QUIET ? fmax(most, fabs(channel.value_g[k])) : most;
		}
		channel.value_g[QUIET + 500] += run % 10 ? 0 : 12 * most;
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		trace.noise_g = 1;
		left_out += spike_mark(&trace, 1) && run % 10;
		spike_of_noise(&trace, &quiet);
		*(run % 10 ? &flagged : &found) += (trace.flags & RECORD_FLAG_SPIKE) != 0;
		trace_close(&trace);
	}
	printf("Student: %zu of %d channels with samples left out, %zu flagged; %zu of %d spikes\n", left_out,
	       CHANNELS * 9 / 10, flagged, found, CHANNELS / 10);
	assert_true(left_out > 20);
	assert_true(flagged <= 1);
	assert_int_equal(found, CHANNELS / 10);
	synth_free(&channel);
}

/* Numbers so coarse that nothing trembles before a pulse of six of them: one of them after it is no spike. */
static void level_before(void **state)
{
	static const double pulse[] = {1, 3, 4, 6, 4, 3, 1};
	struct channel channel = synth_channel("a", 7000, 0, 2000);
	struct estimate_baseline baseline;
	double scratch[2000];
	struct trace trace;

	(void)state;
	for (size_t k = 0; k < 7; k++)
		channel.value_g[1000 + k] = 1.5 * pulse[k];
	channel.value_g[1400] = channel.value_g[1600] = 1.5;
	assert_int_equal(trace_open(&trace, &channel, 0.13, 0.23), 0);
	clean_find(&trace, scratch, &baseline);
	assert_int_equal(trace.flags, 0);
	trace_close(&trace);
	synth_free(&channel);
}

/* A spike of one sample or two, wherever it stands; exactly it is marked. */
static void found(void **state)
{
	struct synth_random random = {22};
	size_t missed = 0, at = 0;

	(void)state;
	for (int run = 0; run < 2000; run++) {
		struct channel channel = synth_channel("a", 7000, 0, 700);
		size_t wide = 1 + (size_t)(run % 2), k = 10 + (size_t)(680 * synth_uniform(&random));
		double size = synth_uniform(&random) < 0.5 ? 300 : -300;

		/* On the plate, whose decay is the steepest thing after the contact. */
		fill(&channel, SYNTH_HALF_SINE, true, 3e-3, 400, 1, &random);
		for (size_t i = 0; i < wide; i++)
			channel.value_g[k + i] += size;
		if (marked(&channel, 1, &at) != wide || at != k)
			missed++;
		synth_free(&channel);
	}
	printf("%zu of 2000 spikes missed\n", missed);
	assert_int_equal(missed, 0);
}

/* Two within four samples of each other, of any sign, and higher than the plate: neither hides the other. */
static void found_near(void **state)
{
	static const double noise[] = {0.3, 1, 3, 10};
	struct synth_random random = {26};
	size_t missed = 0, at = 0;

	(void)state;
	for (int run = 0; run < 2000; run++) {
		double rate = run % 3 ? 10000 : 7000, sigma = noise[run % 4];
		struct channel channel = synth_channel("a", rate, 0, (size_t)(0.1 * rate));
		size_t k = (size_t)((0.028 + 0.06 * synth_uniform(&random)) * rate);
		size_t behind = 1 + (size_t)(run / 4 % 4);

		fill(&channel, SYNTH_HALF_SINE, true, 3e-3, 300, sigma, &random);
		channel.value_g[k] += synth_uniform(&random) < 0.5 ? 600 : -600;
		channel.value_g[k + behind] += synth_uniform(&random) < 0.5 ? 600 : -600;
		if (marked(&channel, sigma, &at) != 2 || at != k)
			missed++;
		synth_free(&channel);
	}
	printf("%zu of 2000 pairs missed\n", missed);
	assert_true(missed <= 10);
}

/* On the contact itself, at its summit and on its flanks, but for the steep onset of a Hunt-Crossley pulse.
 */
static void on_the_pulse(void **state)
{
	struct synth_random random = {23};
	size_t at = 0;

	(void)state;
	for (int run = 0; run < 1200; run++) {
		enum synth_shape shape = (enum synth_shape)(run % SYNTH_SHAPES);
		double summit = 0.02 + 3e-3 * synth_pulse_summit(shape);
		struct channel channel = synth_channel("a", 7000, 0, 700);
		size_t k = (size_t)(summit * 7000) + (size_t)(run / SYNTH_SHAPES % 4);

		fill(&channel, shape, false, 3e-3, 485, 1, &random);
		channel.value_g[k] += run % 3 ? 300 : -300;
		if (marked(&channel, 1, &at) != 1 || at != k)
			fail_msg("run %d: shape %d, sample %zu", run, shape, k);
		synth_free(&channel);
	}
}

/* Among the first or last four samples, where one side has too few neighbours; the outermost has none. */
static void at_the_ends(void **state)
{
	struct synth_random random = {27};
	size_t missed = 0, at = 0;

	(void)state;
	for (int run = 0; run < 800; run++) {
		struct channel channel = synth_channel("a", 7000, 0, 700);
		size_t beyond = (size_t)(run / 2 % 4), k = run % 2 ? channel.count - 1 - beyond : beyond;

		fill(&channel, SYNTH_HALF_SINE, true, 3e-3, 400, 3, &random);
		channel.value_g[k] += run / 8 % 2 ? 300 : -300;
		if (marked(&channel, 3, &at) != (beyond > 0) || (beyond > 0 && at != k))
			missed++;
		synth_free(&channel);
	}
	printf("%zu of 600 spikes at an end missed, or the outermost marked\n", missed);
	assert_int_equal(missed, 0);
}

/* Records that begin or end anywhere in a pulse, in the decay after it, or in a vibration that begins there:
 * no clean sample is marked. */
static void cut_off(void **state)
{
	static const double noise[] = {0.3, 1, 3, 10};
	struct synth_random random = {28};
	size_t wrong = 0, at = 0;

	(void)state;
	for (int run = 0; run < 6400; run++) {
		double rate = run % 2 ? 10000 : 7000, sigma = noise[run / 2 % 4];
		double w = 2 * PI * 0.35 * synth_uniform(&random), phase = 2 * PI * synth_uniform(&random);
		struct channel channel = synth_channel("a", rate, 0, (size_t)(0.06 * rate)), part = channel;
		size_t from = (size_t)((0.018 + 0.02 * synth_uniform(&random)) * rate);

		fill(&channel, (enum synth_shape)(run / 8 % SYNTH_SHAPES), run % 3 > 0, 3e-3, 485, sigma,
		     &random);
		for (size_t k = 0; run % 5 == 0 && k < channel.count; k++)
			channel.value_g[k] = 300 * exp(-0.03 * w * ((double)k - (double)from)) *
			                             cos(w * ((double)k - (double)from) + phase) +
			                     sigma * synth_normal(&random);
		part.value_g += run % 7 ? from : 0;
		part.count = run % 7 ? channel.count - from : from;
		wrong += marked(&part, sigma, &at);
		synth_free(&channel);
	}
	printf("%zu samples of 6400 cut channels marked\n", wrong);
	assert_int_equal(wrong, 0);
}

/* Nothing to say without noise, beside holes. */
static void says_nothing(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 100);
	size_t at = 0;

	(void)state;
	channel.value_g[50] = 300;
	assert_int_equal(marked(&channel, 0, &at), 1);
	assert_int_equal(marked(&channel, NAN, &at), 0);
	assert_int_equal(marked(&channel, 60, &at), 0);
	synth_lose(&channel, 52, 1);
	assert_int_equal(marked(&channel, 0, &at), 1);
	synth_lose(&channel, 41, 8);
	assert_int_equal(marked(&channel, 0, &at), 0); /* too few to compare with within reach */
	channel.value_g[50] = 0;
	channel.value_g[2] = channel.value_g[98] = 300;
	synth_lose(&channel, 3, 1);
	synth_lose(&channel, 96, 1);
	assert_int_equal(marked(&channel, 0, &at), 0);
	for (size_t count = 0; count < 12; count++) {
		channel.count = count;
		channel.value_g[count / 2] = 300;
		marked(&channel, 0, &at);
	}
	synth_free(&channel);
}

/* The second column of a recording; false when it is not there. */
static bool read_second(const char *file, struct channel *channel)
{
	FILE *in = fopen(file, "r");
	char line[256];
	double time, value;
	size_t n = 0;

	if (!in)
		return false;
	*channel = synth_channel("a", 1e6, 0, 10000);
	while (n < 10000 && fgets(line, sizeof(line), in))
		if (sscanf(line, "%lf %lf", &time, &value) == 2)
			channel->value_g[n++] = value;
	fclose(in);
	channel->count = n;
	return true;
}

/* Real shocks: fixtures at 1 MS/s, a board at 50 kS/s and what it stood on. Noise from the first samples. */
static void recordings(void **state)
{
	static const char *const files[] = {"afrl_in_situ/T04.txt",
	                                    "afrl_in_situ/T06.txt",
	                                    "afrl_in_situ/T08.txt",
	                                    "repeated_impacts/acc_pcb_a0.txt",
	                                    "repeated_impacts/acc_pcb_a1.txt",
	                                    "repeated_impacts/acc_pcb_a2.txt",
	                                    "repeated_impacts/acc_base_a0.txt"};

	(void)state;
	for (size_t i = 0; i < sizeof(files) / sizeof(files[0]); i++) {
		struct channel channel;
		double squares = 0;
		char path[128];
		size_t at = 0;

		snprintf(path, sizeof(path), DATA "/%s", files[i]);
		if (!read_second(path, &channel))
			skip();
		for (size_t k = 2; k < 32; k++)
			squares += pow(
			        channel.value_g[k] - 2 * channel.value_g[k - 1] + channel.value_g[k - 2], 2);
		assert_int_equal(marked(&channel, sqrt(squares / 30 / 6), &at), 0);
		synth_free(&channel);
	}
}

/* Zeros in the middle of a pulse or of its decay are taken out; those of a quiet sensor are not. */
static void dropouts(void **state)
{
	struct synth_random random = {24};
	struct channel channel = synth_channel("a", 7000, 0, 700);
	size_t clean_marked = 0;

	(void)state;
	for (int run = 0; run < 2000; run++) {
		size_t from = 140 + (size_t)(12 * synth_uniform(&random)),
		       n = run % 2 ? 3 + (size_t)run % 5 : 0;
		double sigma = 0.02 + 0.3 * synth_uniform(&random); /* fine enough for many exact zeros */
		struct trace trace;

		fill(&channel, (enum synth_shape)(run / 2 % SYNTH_SHAPES), false, 3e-3, 485, sigma, &random);
		for (size_t k = from; k < from + n; k++)
			channel.value_g[k] = 0;
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		if (n > 0 && fabs(channel.value_g[from - 1]) > 20 && fabs(channel.value_g[from + n]) > 20) {
			assert_true(dropout_mark(&trace, sigma));
			assert_int_equal(trace.flags, RECORD_FLAG_BAD | RECORD_FLAG_ZEROED);
			for (size_t k = 0; k < 700; k++)
				assert_int_equal(trace.sample[k], k >= from && k < from + n ? SAMPLE_BAD : 0);
		} else if (n == 0) {
			clean_marked += dropout_mark(&trace, sigma);
		}
		trace_close(&trace);
	}
	assert_int_equal(clean_marked, 0);
	synth_free(&channel);
}

/* In numbers coarser than the noise the case at rest reads zeros, between a contact's end and what rings on
 * too; three to five zeros under the contact are a hole. */
static void rest_in_coarse_numbers(void **state)
{
	struct channel channel = synth_channel("a", 7000, 0, 700);
	struct synth_random random = {29};
	size_t rest = 0, found = 0, holes = 0;

	(void)state;
	for (int run = 0; run < 4000; run++) {
		size_t hole = run % 2 ? 3 + (size_t)run % 3 : 0,
		       from = 105 + (size_t)(10 * synth_uniform(&random));
		double base = 20 + 20 * synth_uniform(&random), again = 3 + 12 * synth_uniform(&random);
		double w = 1 + synth_uniform(&random), begin = synth_uniform(&random);
		struct trace trace;

		for (size_t k = 0; k < 700; k++) {
			double t = (double)k - 100 - begin, after = t - base - again;
			double v = 250 * synth_pulse(SYNTH_HALF_SINE, t / base) +
			           (after > 0 ? 12 * exp(-0.1 * w * after) * sin(w * after) : 0);

			channel.value_g[k] =
			        k >= from && k < from + hole ? 0 : round(v + 0.1 * synth_normal(&random));
		}
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		trace.step_g = 1;
		*(hole ? &found : &rest) += dropout_mark(&trace, 0.3);
		holes += hole > 0;
		trace_close(&trace);
	}
	printf("%zu of 2000 rests marked, %zu of %zu holes\n", rest, found, holes);
	assert_int_equal(rest, 0);
	assert_true(found > holes * 95 / 100);
	synth_free(&channel);
}

/* One value held on the way up is left out but for its first sample, one on the way down too; a whole pulse
 * holds none. Codes of 1/32 g; a run that chance could make is none. */
static void held(void **state)
{
	struct synth_random random = {25};
	struct channel channel = synth_channel("a", 7000, 0, 700);
	size_t clean_marked = 0, found = 0, held_runs = 0;

	(void)state;
	for (int run = 0; run < 4000; run++) {
		size_t from = 145 + (size_t)(9 * synth_uniform(&random)),
		       n = run % 2 ? 5 + (size_t)run % 4 : 0;
		double sigma = 0.3 * pow(10, synth_uniform(&random));
		struct trace trace;

		fill(&channel, (enum synth_shape)(run / 2 % SYNTH_SHAPES), false, 3e-3, 485, sigma, &random);
		for (size_t k = from + 1; k < from + n; k++)
			channel.value_g[k] = channel.value_g[from];
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		if (n == 0) {
			clean_marked += dropout_mark(&trace, sigma);
		} else if (channel.value_g[from - 1] < channel.value_g[from] &&
		           channel.value_g[from + n] > channel.value_g[from]) {
			held_runs++;
			found += dropout_mark(&trace, sigma);
			assert_int_equal(trace.flags, RECORD_FLAG_BAD | RECORD_FLAG_STUCK);
			for (size_t k = 0; k < 700; k++)
				assert_int_equal(trace.sample[k], k > from && k < from + n ? SAMPLE_BAD : 0);
		}
		trace_close(&trace);
	}
	print_message("held: %zu of %zu found\n", found, held_runs);
	assert_true(held_runs > 500);
	assert_int_equal(found, held_runs);
	assert_int_equal(clean_marked, 0);
	synth_free(&channel);
}

/* Samples that are repeated all along are flagged and stay; those of coarse numbers are not. */
static void repeated(void **state)
{
	struct synth_random random = {26};
	struct channel channel = synth_channel("a", 7000, 0, 700);

	(void)state;
	for (int run = 0; run < 200; run++) {
		double code = run % 2 ? 1.0 / 32 : 1;
		struct trace trace;

		fill(&channel, SYNTH_HERTZ, false, 3e-3, 485, 0.6, &random);
		for (size_t k = 0; k < 700; k++)
			channel.value_g[k] = code * round(channel.value_g[k - (run % 2 ? k % 2 : 0)] / code);
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		assert_false(dropout_mark(&trace, 0.6));
		assert_int_equal(trace.flags & ~(unsigned)RECORD_FLAG_CLIPPED,
		                 run % 2 ? RECORD_FLAG_STUCK : 0);
		trace_close(&trace);
	}
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(clean),
	        cmocka_unit_test(vibrations),
	        cmocka_unit_test(found),
	        cmocka_unit_test(found_near),
	        cmocka_unit_test(on_the_pulse),
	        cmocka_unit_test(recordings),
	        cmocka_unit_test(says_nothing),
	        cmocka_unit_test(dropouts),
	        cmocka_unit_test(among_holes),
	        cmocka_unit_test(at_the_ends),
	        cmocka_unit_test(cut_off),
	        cmocka_unit_test(held),
	        cmocka_unit_test(repeated),
	        cmocka_unit_test(steps_and_rings),
	        cmocka_unit_test(noise_that_reaches_far),
	        cmocka_unit_test(level_before),
	        cmocka_unit_test(rest_in_coarse_numbers),
	};

	for (int shape = 0; shape < SYNTH_SHAPES; shape++)
		synth_plate(plate[shape], PLATE, (enum synth_shape)shape, 3e-3, 129, 0.1);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
