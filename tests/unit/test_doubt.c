/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Drops of one axis with known truth on a grid of 1 us, of pulses that the estimators have no family for,
 * whole and spoilt. A value is silently wrong that is off by more than three of its own uncertainty and by 2
 * %, status ok, no flag. Drops are DOUBT_DROPS a class; the seed is the class' number.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "host/estimate/doubt.h"
#include "host/estimate/estimate.h"
#include "host/record/drop.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#ifndef DOUBT_DROPS
#define DOUBT_DROPS 60
#endif

#define RATE_HZ 7000.0
#define CODE_G (1.0 / 32)
#define ONSET_S 0.1
#define G_M_S2 9.80665
#define FINE_S 1e-6

enum { SAMPLES = 1400, PLAIN_FLAGS = ESTIMATE_FLAG_TOLERANCE };

enum form { HALF_SINE, HAVERSINE, GAMMA, STEEP_GAMMA, TRAPEZOID, TWO_HUMPS, RING, BELL, SAWTOOTH, FORMS };
enum spoil { WHOLE, CUT_FINE, CUT, CABLE, SHIFT, TAIL, FAR, SPOILS };

static const char *const form_names[FORMS] = {"half-sine", "haversine", "gamma 2", "gamma 1.2", "trapezoid",
                                              "two humps", "800 Hz",    "bell",    "sawtooth"};
static const char *const spoil_names[SPOILS] = {"whole", "cut 0.02 g", "cut 0.05 g", "cable",
                                                "shift", "tail",       "far shift"};

struct drop {
	enum form form;
	enum spoil spoil;
	double height_g, base_s, noise_g, onset_s, cut, part, fails_s;
};

static double smooth(double x)
{
	x = fmin(fmax(x, 0), 1);
	return x * x * (3 - 2 * x);
}

/* Of base 1, height about 1. */
static double pulse_form(enum form form, double x)
{
	static const double pi = 3.14159265358979;

	if (x <= 0 || (x >= 1 && form != GAMMA && form != STEEP_GAMMA && form != BELL))
		return 0;
	switch (form) {
	case HALF_SINE:
		return sin(pi * x);
	case HAVERSINE:
		return pow(sin(pi * x), 2);
	case GAMMA:
		return pow(x / 0.25 * exp(1 - x / 0.25), 2);
	case STEEP_GAMMA:
		return pow(x / 0.25 * exp(1 - x / 0.25), 1.2);
	case TRAPEZOID:
		return smooth(x / 0.35) * smooth((1 - x) / 0.35) * (1 - 0.03 * x);
	case TWO_HUMPS:
		return sin(pi * x) * (1 + 0.5 * cos(4 * pi * x)) / 1.2;
	case RING:
		return sin(pi * x);
	case BELL:
		return exp(-pow((x - 0.5) / 0.18, 2));
	default:
		return smooth(x / 0.8) * smooth((1 - x) / 0.2);
	}
}

/* The shock itself, t after its onset, with what belongs to it. */
static double shock(const struct drop *d, double t)
{
	double value = d->height_g * pulse_form(d->form, t / d->base_s);

	if (d->form == RING && t > 0)
		value += 0.05 * d->height_g * exp(-t / 4e-3) * sin(6.283185307 * 800 * t);
	if (d->spoil == TAIL && t > 0)
		value += d->part * d->height_g * smooth(t / d->base_s) *
		         exp(-fmax(t - d->base_s, 0) / d->base_s);
	return value;
}

struct truth {
	double peak_g, velocity_m_s, width_s;
};

/* The velocity change ends where a twelfth of a thousandth is left, or after the tail. */
static struct truth truth_of(const struct drop *d)
{
	struct truth truth = {0, 0, 0};
	double from = NAN, until = NAN;
	size_t n = (size_t)(8 * d->base_s / FINE_S);

	for (size_t i = 0; i < n; i++) {
		double v = shock(d, (double)i * FINE_S);

		truth.peak_g = fmax(truth.peak_g, v);
		truth.velocity_m_s += v * FINE_S * G_M_S2;
	}
	for (size_t i = 0; i < n; i++) {
		if (shock(d, (double)i * FINE_S) < 0.1 * truth.peak_g)
			continue;
		if (isnan(from))
			from = (double)i * FINE_S;
		if (isnan(until) || (double)i * FINE_S - until < 2 * FINE_S)
			until = (double)i * FINE_S;
	}
	truth.width_s = until - from;
	return truth;
}

static double reading(const struct drop *d, double t, struct synth_random *random)
{
	double value = shock(d, t), after = d->noise_g;

	if (d->spoil == SHIFT && t > 0)
		value += d->part * d->height_g * smooth(t / d->base_s);
	if (d->spoil == FAR && t > 0.6 * d->fails_s)
		value += (0.1 + 2 * d->part) * d->height_g;
	if (d->spoil == CABLE && t > d->fails_s)
		value = 0;
	value += after * synth_normal(random);
	if (d->spoil >= CUT_FINE && d->spoil <= CUT && value > d->cut * d->height_g) {
		static const double trembles_g[] = {0.02, 0.05};

		value = d->cut * d->height_g + trembles_g[d->spoil - CUT_FINE] * synth_normal(random);
	}
	return CODE_G * round(value / CODE_G);
}

static struct drop draw(enum form form, enum spoil spoil, struct synth_random *random)
{
	struct drop d = {.form = form, .spoil = spoil};

	d.height_g = 100 * pow(8, synth_uniform(random));
	d.base_s = 1.5e-3 * pow(4, synth_uniform(random));
	d.noise_g = fmin(0.3 * pow(10, synth_uniform(random)), d.height_g / 100);
	d.onset_s = ONSET_S + synth_uniform(random) / RATE_HZ;
	d.cut = 0.6 + 0.25 * synth_uniform(random);
	d.part = 0.03 + 0.07 * synth_uniform(random);
	d.fails_s = d.base_s * (0.5 + 0.2 * synth_uniform(random));
	if (form == GAMMA || form == STEEP_GAMMA)
		d.fails_s = d.base_s * (0.3 + 0.2 * synth_uniform(random));
	return d;
}

struct count {
	unsigned peak, velocity, width; /* silently wrong */
	unsigned clipped, flat, step, tail;
};

static unsigned wrong(double value, double truth, double sigma, unsigned flags, enum estimate_status status)
{
	return status == ESTIMATE_OK && !(flags & ~(unsigned)PLAIN_FLAGS) && isfinite(value) &&
	       fabs(value - truth) > 3 * sigma && fabs(value - truth) > 0.02 * fabs(truth);
}

static struct count repeat(enum form form, enum spoil spoil, unsigned drops)
{
	struct synth_random random = {1 + (uint64_t)(form * SPOILS + spoil)};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	const struct record record = {.channels = &channel, .channel_count = 1};
	struct count count = {0};

	for (unsigned i = 0; i < drops; i++) {
		const struct estimate_options options = {0};
		const struct drop d = draw(form, spoil, &random);
		const struct truth truth = truth_of(&d);
		const struct estimate_channel *c;
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++)
			channel.value_g[k] = reading(&d, (double)k / RATE_HZ - d.onset_s, &random);
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		c = &analysis.channels[0];
		count.peak += wrong(c->peak.value_g, truth.peak_g, c->peak.sigma_g, c->peak.how.flags,
		                    c->peak.how.status);
		count.velocity += wrong(c->pulse.velocity_change_m_s, truth.velocity_m_s,
		                        c->pulse.sigma_velocity_m_s, c->pulse.flags, c->pulse.status);
		count.width += wrong(c->pulse.duration_s, truth.width_s, c->pulse.sigma_duration_s,
		                     c->pulse.flags, c->pulse.status);
		count.clipped += (c->flags & RECORD_FLAG_CLIPPED) != 0;
		count.flat += !(c->flags & RECORD_FLAG_CLIPPED) && c->peak.how.flags & ESTIMATE_FLAG_FLAT;
		count.step += (c->pulse.flags & ESTIMATE_FLAG_STEP) != 0;
		count.tail += ((c->pulse.flags | c->peak.how.flags) & ESTIMATE_FLAG_TAIL) != 0;
		estimate_free(&analysis);
	}
	synth_free(&channel);
	return count;
}

static void print_count(enum form form, enum spoil spoil, const struct count *c)
{
	printf("%-10s %-10s of %u: silent peak %u dv %u width %u; clipped %u flat %u step %u tail %u\n",
	       spoil_names[spoil], form_names[form], DOUBT_DROPS, c->peak, c->velocity, c->width, c->clipped,
	       c->flat, c->step, c->tail);
}

/* Nothing is said against a whole record. */
static void whole(void **state)
{
	unsigned alarms = 0;

	(void)state;
	for (int f = 0; f < FORMS; f++) {
		struct count c = repeat((enum form)f, WHOLE, DOUBT_DROPS);

		print_count((enum form)f, WHOLE, &c);
		alarms += c.clipped + c.step + c.tail;
	}
	assert_in_range(alarms, 0, 1);
}

static void spoilt(void **state)
{
	/* Parts of the drops in which it must be seen: least of all forms. */
	static const double seen[SPOILS] = {
	        [CUT_FINE] = 0.75, [CUT] = 0.45, [CABLE] = 0.45, [SHIFT] = 0.95, [TAIL] = 0.5, [FAR] = 0.95};

	(void)state;
	for (int s = WHOLE + 1; s < SPOILS; s++)
		for (int f = 0; f < FORMS; f++) {
			struct count c = repeat((enum form)f, (enum spoil)s, DOUBT_DROPS);
			unsigned n = s == CABLE ? c.step : s >= SHIFT ? c.tail : c.clipped + c.flat;

			print_count((enum form)f, (enum spoil)s, &c);
			assert_true(n >= seen[s] * DOUBT_DROPS);
			assert_true(s != FAR || c.peak == 0);
		}
}

/* Half-sines of 3 to 12 ms whose noise is a fiftieth to a hundredth of them: that of a round top hides how
 * round it is over a few samples, in some windows of many. */
static void round_tops_in_noise(void **state)
{
	enum { DROPS = 1500 };
	struct synth_random random = {5};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES / 2 + SAMPLES / 8);
	const struct record record = {.channels = &channel, .channel_count = 1};
	unsigned level = 0;

	(void)state;
	for (unsigned i = 0; i < DROPS; i++) {
		const struct estimate_options options = {0};
		double base_s = 3e-3 * pow(4, synth_uniform(&random)), noise_g = 1 + synth_uniform(&random);
		double onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ;
		struct analysis analysis;

		for (size_t k = 0; k < channel.count; k++) {
			double x = ((double)k / RATE_HZ - onset_s) / base_s;

			channel.value_g[k] = 100 * pulse_form(HALF_SINE, x) + noise_g * synth_normal(&random);
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		level += (analysis.channels[0].peak.how.flags & ESTIMATE_FLAG_FLAT) != 0;
		estimate_free(&analysis);
	}
	print_message("%u of %u round tops level\n", level, DROPS);
	assert_int_equal(level, 0);
	synth_free(&channel);
}

/* After a half-sine of base 1 and height 1, by kind: rattle, a second contact at once or late, a slow swing
 * before one. */
static double follows(unsigned kind, double x, struct synth_random *random, double part[6])
{
	double value = 0;

	if (x < 0) {
		for (unsigned i = 0; i < 6; i++)
			part[i] = synth_uniform(random);
		return 0;
	}
	for (unsigned i = 0; kind == 0 && i < 3; i++) {
		double t = x - 3 * part[i], w = 18 + 12 * part[3 + i];

		value += t > 0 ? 0.04 * exp(-0.1 * w * t) * sin(w * t) : 0;
	}
	if (kind == 1)
		value = 0.6 * pulse_form(HALF_SINE, x - (part[1] < 0.5 ? 1 : 5 + 2 * part[0]));
	if (kind == 2)
		value = x < 2.8 ? -0.03 * pulse_form(HALF_SINE, (x - 1) / 1.8)
		                : 0.3 * pulse_form(HALF_SINE, x - 2.8);
	return value;
}

static void no_tail(void **state)
{
	enum { DROPS = 400, KINDS = 3 };
	struct synth_random random = {6};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	const struct record record = {.channels = &channel, .channel_count = 1};
	unsigned tails[KINDS] = {0};

	(void)state;
	for (unsigned i = 0; i < DROPS * KINDS; i++) {
		const struct estimate_options options = {0};
		double base_s = 1.5e-3 * pow(4, synth_uniform(&random)),
		       height_g = 100 * pow(4, synth_uniform(&random));
		double onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ, part[6];
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++) {
			double x = ((double)k / RATE_HZ - onset_s) / base_s;

			channel.value_g[k] =
			        height_g * (pulse_form(HALF_SINE, x) + follows(i % KINDS, x, &random, part)) +
			        0.3 * synth_normal(&random);
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		tails[i % KINDS] +=
		        ((analysis.channels[0].pulse.flags | analysis.channels[0].peak.how.flags) &
		         ESTIMATE_FLAG_TAIL) != 0;
		estimate_free(&analysis);
	}
	print_message("of %u: tails of a rattle %u, a second contact %u, a swing %u\n", DROPS, tails[0],
	              tails[1], tails[2]);
	assert_true(tails[0] + tails[1] + tails[2] <= 6);
	synth_free(&channel);
}

/* One sample of a half-sine off by 9 to 15 sigma, which is too little for a spike under a pulse, and a back
 * that falls within two samples are no steps; a gain that steps by a third is. */
static void no_step(void **state)
{
	enum { DROPS = 600, KINDS = 3 };
	struct synth_random random = {7};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	const struct record record = {.channels = &channel, .channel_count = 1};
	unsigned steps[KINDS] = {0};

	(void)state;
	for (unsigned i = 0; i < DROPS * KINDS; i++) {
		const struct estimate_options options = {0};
		double base_s = 2e-3 * pow(4, synth_uniform(&random)),
		       height_g = 60 + 60 * synth_uniform(&random);
		double onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ,
		       at = 0.35 + 0.3 * synth_uniform(&random);
		double off_g = (synth_uniform(&random) < 0.5 ? -1 : 1) * (9 + 6 * synth_uniform(&random));
		double fall = (1.6 + synth_uniform(&random)) / (RATE_HZ * base_s);
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++) {
			double x = ((double)k / RATE_HZ - onset_s) / base_s,
			       v = height_g * pulse_form(HALF_SINE, x);

			if (i % KINDS == 0 && x > at && x < at + 1 / (RATE_HZ * base_s))
				v += off_g;
			if (i % KINDS == 1)
				v = height_g * fmax(x, 0) * smooth((1 - x) / fall);
			if (i % KINDS == 2 && x > at)
				v *= 0.67;
			channel.value_g[k] = v + (i % KINDS == 1 ? 0.2 : 1) * synth_normal(&random);
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		steps[i % KINDS] +=
		        ((analysis.channels[0].pulse.flags | analysis.channels[0].peak.how.flags) &
		         ESTIMATE_FLAG_STEP) != 0;
		estimate_free(&analysis);
	}
	print_message("of %u: steps of an outlier %u, a steep back %u, a gain %u\n", DROPS, steps[0],
	              steps[1], steps[2]);
	assert_true(steps[0] <= 12 && steps[1] <= 1);
	assert_true(steps[2] >= 0.8 * DROPS);
	synth_free(&channel);
}

/* Two samples of noise side by side, one step of coarse numbers high, are no contact before one of three. */
static void no_contact_of_noise(void **state)
{
	struct channel channel = synth_channel("S2Z", RATE_HZ, 0, SAMPLES);
	struct trace trace;

	(void)state;
	for (size_t k = 0; k < SAMPLES; k += 50)
		channel.value_g[k] = 1;
	channel.value_g[SAMPLES / 2 - 99] = 1;
	for (size_t k = 0; k < 10; k++)
		channel.value_g[SAMPLES / 2 + k] = round(3.4 * sin(0.314159265358979 * (double)k));
	assert_int_equal(trace_open(&trace, &channel, 0.08, 0.2), 0);
	trace.still = trace.first;
	assert_true(doubt_slap_s(&trace) > trace_time(&trace, trace.count));
	trace_close(&trace);
	synth_free(&channel);
}

/* A half-sine of 4 ms behind a high-pass of 20 ms; the record ends 8 ms after it. */
static void a_high_pass_in_a_short_record(void **state)
{
	enum { UNTIL = 784 };
	struct synth_random random = {3};
	struct channel channel = synth_channel("a", RATE_HZ, 0, UNTIL);
	const struct record record = {.channels = &channel, .channel_count = 1};

	(void)state;
	for (unsigned i = 0; i < DOUBT_DROPS; i++) {
		const struct estimate_options options = {0};
		double height_g = 100 * pow(8, synth_uniform(&random)), passed_g = 0, before_g = 0;
		struct analysis analysis;

		for (size_t k = 0; k < UNTIL; k++) {
			double t = ((double)k / RATE_HZ - ONSET_S) / 4e-3;
			double now_g = t > 0 && t < 1 ? height_g * sin(3.14159265358979 * t) : 0;

			passed_g = (passed_g + now_g - before_g) * exp(-1 / (RATE_HZ * 20e-3));
			before_g = now_g;
			channel.value_g[k] = passed_g + height_g / 1000 * synth_normal(&random);
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		assert_true(analysis.channels[0].peak.how.flags & ESTIMATE_FLAG_TAIL);
		assert_true(fabs(analysis.channels[0].peak.value_g - height_g) <
		            3 * analysis.channels[0].peak.sigma_g);
		estimate_free(&analysis);
	}
	synth_free(&channel);
}

/* A converter of 16 to 80 steps a pulse, and nothing that spreads its readings: the fit's own bars alone
 * cover 87 %.
 */
static void a_coarse_converter(void **state)
{
	enum { DROPS = 400 };
	struct synth_random random = {4};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	const struct record record = {.channels = &channel, .channel_count = 1};
	unsigned told = 0, covered = 0;

	(void)state;
	for (unsigned i = 0; i < DROPS; i++) {
		const struct estimate_options options = {0};
		double height_g = 100 * pow(8, synth_uniform(&random)),
		       base_s = 3e-3 + 9e-3 * synth_uniform(&random);
		double step_g = height_g / (16 + 64 * synth_uniform(&random)),
		       onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ;
		const struct estimate_peak *peak;
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++) {
			double t = ((double)k / RATE_HZ - onset_s) / base_s;

			channel.value_g[k] =
			        t > 0 && t < 1 ? step_g * round(height_g * sin(3.14159265358979 * t) / step_g)
			                       : 0;
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		peak = &analysis.channels[0].peak;
		if (peak->how.status == ESTIMATE_OK) {
			told++;
			covered += fabs(peak->value_g - height_g) < 2 * peak->sigma_g;
		}
		estimate_free(&analysis);
	}
	print_message("%u told, %u within two bars\n", told, covered);
	assert_true(told >= 20);
	assert_true(covered >= 0.93 * told);
	synth_free(&channel);
}

/* A drop of which no trigger came, and a weak axis of the plate that swings on: its largest sample is a later
 * one, the quiet part ends before the first all the same. */
static void what_is_quiet_before_a_drop(void **state)
{
	struct synth_random random = {11};
	const struct estimate_options options = {0};
	unsigned unsure = 0;

	(void)state;
	for (unsigned i = 0; i < 40; i++) {
		struct channel channels[2] = {synth_channel("S2X", RATE_HZ, 0, 1400),
		                              synth_channel("S1Z", RATE_HZ, 0, 1400)};
		struct record record = {
		        .channels = channels, .channel_count = 2, .is_drop = true, .trigger_s = NAN};
		struct analysis analysis;

		for (size_t k = 0; k < 1400; k++) {
			double t = (double)k / RATE_HZ - 0.1;

			channels[0].value_g[k] =
			        300 * synth_pulse(SYNTH_HALF_SINE, t / 4e-3) + synth_normal(&random);
			channels[1].value_g[k] = (t > 0 ? 7 * sin(377 * t) : 0) + synth_normal(&random);
		}
		drop_set_axes(&record);
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		unsure += analysis.channels[1].baseline.doubtful;
		estimate_free(&analysis);
		synth_free(&channels[0]);
		synth_free(&channels[1]);
	}
	assert_int_equal(unsure, 0);
}

/* A quarter of a sine, then a force that fades on by 2 ms, in a hundredth of noise: 132 of 200 where what
 * follows has to be 5 sigma of its mean, and 1 % of the velocity change. */
static void a_force_that_fades_on(void **state)
{
	enum { DROPS = 200 };
	const double rise_s = 1.8e-3, fades_s = 2e-3;
	struct synth_random random = {6};
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);
	const struct record record = {.channels = &channel, .channel_count = 1};
	unsigned covered = 0;

	(void)state;
	for (unsigned i = 0; i < DROPS; i++) {
		const struct estimate_options options = {0};
		const double height_g = 150,
		             truth = G_M_S2 * height_g * (rise_s * 2 / 3.14159265358979 + fades_s);
		double onset_s = ONSET_S + synth_uniform(&random) / RATE_HZ;
		const struct estimate_pulse *pulse;
		struct analysis analysis;

		for (size_t k = 0; k < SAMPLES; k++) {
			double t = (double)k / RATE_HZ - onset_s;
			double value = t < rise_s ? sin(fmax(t, 0) / rise_s * 3.14159265358979 / 2)
			                          : exp(-(t - rise_s) / fades_s);

			channel.value_g[k] = height_g * value + 1.5 * synth_normal(&random);
		}
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		pulse = &analysis.channels[0].pulse;
		covered += fabs(pulse->velocity_change_m_s - truth) < 2 * pulse->sigma_velocity_m_s;
		estimate_free(&analysis);
	}
	print_message("a force that fades on: %u of %u velocity changes within two bars\n", covered, DROPS);
	assert_true(covered >= 0.88 * DROPS);
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(whole),
	                                   cmocka_unit_test(spoilt),
	                                   cmocka_unit_test(round_tops_in_noise),
	                                   cmocka_unit_test(no_contact_of_noise),
	                                   cmocka_unit_test(no_tail),
	                                   cmocka_unit_test(no_step),
	                                   cmocka_unit_test(a_high_pass_in_a_short_record),
	                                   cmocka_unit_test(a_coarse_converter),
	                                   cmocka_unit_test(a_force_that_fades_on),
	                                   cmocka_unit_test(what_is_quiet_before_a_drop)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
