/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/adversarial.h"

#include <math.h>
#include <string.h>

#include "host/record/drop.h"

#define PI 3.14159265358979
#define CODE_G (1.0 / 32)
#define ONSET_S 0.1
#define LENGTH_S 0.3
#define FINE_S 2e-6

enum { FINE = 110000, HELD_SAMPLES = 6 };

const struct adversarial_class adversarial_classes[] = {
        {"half-sine", HALF_SINE, PLAIN, NOTHING, false},
        {"haversine", HAVERSINE, PLAIN, NOTHING, false},
        {"Hertz", HERTZ, PLAIN, NOTHING, false},
        {"gamma", GAMMA, PLAIN, NOTHING, false},
        {"trapezoid", TRAPEZOID, PLAIN, NOTHING, false},
        {"two humps", HUMPS, PLAIN, NOTHING, false},
        {"800 Hz on it", RING, PLAIN, NOTHING, false},
        {"bell", BELL, PLAIN, NOTHING, false},
        {"saw-tooth, final peak", FINAL, PLAIN, NOTHING, false},
        {"saw-tooth, initial peak", INITIAL, PLAIN, NOTHING, false},
        {"two exponentials", EXPONENTIALS, PLAIN, NOTHING, true},
        {"plate hardly damped", HALF_SINE, HARDLY_DAMPED, NOTHING, false},
        {"plate much damped", HALF_SINE, MUCH_DAMPED, NOTHING, false},
        {"plate at 400 Hz", HALF_SINE, FAST, NOTHING, false},
        {"no plate", HALF_SINE, RIGID, NOTHING, false},
        {"two modes", HALF_SINE, TWO_MODES, NOTHING, false},
        {"softening plate", HERTZ, SOFT, NOTHING, false},
        {"0.8 to 1.2 ms", HALF_SINE, PLAIN, SHORT, false},
        {"8 to 12 ms", HAVERSINE, PLAIN, LONG, false},
        {"11 to 30 g", HALF_SINE, PLAIN, WEAK, true},
        {"second contact, less", HERTZ, PLAIN, SECOND, false},
        {"offset", HALF_SINE, PLAIN, OFFSET, false},
        {"hum", HALF_SINE, PLAIN, HUM, false},
        {"Laplace noise", HERTZ, PLAIN, LAPLACE, false},
        {"codes of 0.5 g", HALF_SINE, PLAIN, COARSE, false},
        {"trapezoid in codes of 2 g", TRAPEZOID, PLAIN, COARSER, false},
        {"two contacts in codes of 2 g", HALF_SINE, PLAIN, COARSER_TWICE, false},
        {"noise of 5 g", HERTZ, PLAIN, LOUD, false},
        {"spikes", HERTZ, PLAIN, SPIKES, false},
        {"0.6 ms lost at the peak", HERTZ, PLAIN, LOST, false},
        {"cut, 0.02 g behind it", HALF_SINE, PLAIN, CUT_FINE, false},
        {"cut, 0.05 g behind it", GAMMA, PLAIN, CUT, true},
        {"cut, noise behind it", HALF_SINE, PLAIN, CUT_NOISY, false},
        {"X and Y cut, noise behind", HALF_SINE, PLAIN, CUT_BOTH, true},
        {"cable lost in mid-pulse", HALF_SINE, PLAIN, CABLE, false},
        {"cable lost, Hertz", HERTZ, PLAIN, CABLE, false},
        {"to the rail in mid-pulse", HALF_SINE, PLAIN, RAIL, false},
        {"stuck at the rail", HALF_SINE, PLAIN, STUCK, false},
        {"zero shifts", HALF_SINE, PLAIN, SHIFT, false},
        {"zero shifts at once", HERTZ, PLAIN, SHIFT_AT_ONCE, false},
        {"force fades on", HALF_SINE, PLAIN, TAIL, false},
        {"slap-down", HALF_SINE, PLAIN, SLAP, false},
        {"slap-down, near", HERTZ, PLAIN, SLAP_NEAR, false},
        {"S2Y reversed", HALF_SINE, PLAIN, REVERSED, false},
        {"S1X and S1Y exchanged", HALF_SINE, PLAIN, EXCHANGED, false},
        {"S1 loose", HALF_SINE, PLAIN, S1_LOOSE, false},
        {"S2 loose", HALF_SINE, PLAIN, S2_LOOSE, false},
        {"noise AR(1) 0.8", HALF_SINE, PLAIN, COLOURED, false},
        {"noise AR(1) 0.95", HALF_SINE, PLAIN, RED, false},
        {"burst before", HALF_SINE, PLAIN, BURST, false},
        {"starts inside", HALF_SINE, PLAIN, INSIDE, false},
        {"gain steps in mid-pulse", HALF_SINE, PLAIN, GAIN_STEP, true},
        {"gain less for a third of it", HERTZ, PLAIN, GAIN_BACK, false},
        {"X limited softly", HERTZ, PLAIN, LIMITED, false},
        {"S1's gain steps", HALF_SINE, PLAIN, S1_GAIN_STEP, false},
        {"Y late", HALF_SINE, PLAIN, LATE, false},
        {"S2 late", HALF_SINE, RIGID, S2_LATE, false},
        {"S1 reads 0.8", HERTZ, PLAIN, S1_LESS, true},
        {"S1X limited softly", HALF_SINE, PLAIN, S1_LIMITED, true},
        {"X behind 250 Hz", HALF_SINE, PLAIN, DULL, true},
        {"samples held", HALF_SINE, PLAIN, HELD, true},
        {"one value held, rising", HALF_SINE, PLAIN, FROZEN, false},
        {"each sample twice", HERTZ, PLAIN, TWICE, false},
        {"one polarity lost", HALF_SINE, PLAIN, RECTIFIED, false},
        {"slew rate", HALF_SINE, PLAIN, SLEW, true},
        {"Y dead", HALF_SINE, PLAIN, DEAD, false},
        {"high-pass of 10 ms untold", HALF_SINE, PLAIN, SAG, false},
        {"an edge touches first", EDGE, PLAIN, NOTHING, false},
        {"a block of S1 twice", HALF_SINE, PLAIN, BLOCK_TWICE, false},
        {"S1X dead", HERTZ, PLAIN, S1_DEAD, false},
        {"held as it begins", HALF_SINE, PLAIN, BEGIN_HELD, false},
        {"S2 loose, by less", HALF_SINE, PLAIN, S2_LOOSE_LESS, true},
};

const unsigned adversarial_count = sizeof(adversarial_classes) / sizeof(adversarial_classes[0]);

/* Of height 1 at its own amplitude: S2's pulse and the plate's answer from the onset on, whole. */
static double case_g[FINE], plate_g[FINE];

static double smooth(double x)
{
	x = fmin(fmax(x, 0), 1);
	return x * x * (3 - 2 * x);
}

static double pulse_form(enum form form, double x)
{
	if (form == EDGE) /* 0.4 of the base before the rest of it */
		return x < 0.4 ? 0.08 * pow(sin(PI * fmax(x, 0) / 0.4), 2)
		               : fmax(sin(PI * fmin(x - 0.4, 1)), 0);
	if (x <= 0 || (x >= 1 && form != GAMMA && form != BELL && form != EXPONENTIALS))
		return 0;
	switch (form) {
	case HAVERSINE:
		return pow(sin(PI * x), 2);
	case HERTZ:
		return pow(sin(PI * x), 1.5);
	case GAMMA:
		return pow(x / 0.25 * exp(1 - x / 0.25), 2);
	case TRAPEZOID:
		return smooth(x / 0.3) * smooth((1 - x) / 0.3) * (1 - 0.03 * x);
	case HUMPS:
		return sin(PI * x) * (1 + 0.5 * cos(4 * PI * x)) / 1.2;
	case BELL:
		return exp(-pow((x - 0.5) / 0.18, 2));
	case FINAL:
		return smooth(x / 0.75) * smooth((1 - x) / 0.25);
	case INITIAL:
		return smooth(x / 0.25) * smooth((1 - x) / 0.75);
	case EXPONENTIALS:
		return 2.1 * (exp(-x / 0.35) - exp(-x / 0.12));
	default:
		return sin(PI * x);
	}
}

static double case_at(const struct adversarial_drop *d, double t)
{
	double value = pulse_form(d->class->form, t / d->base_s);

	if (d->class->form == RING && t > 0)
		value += 0.05 * exp(-t / 4e-3) * sin(2 * PI * 800 * t);
	if (d->class->spoil == TAIL && t > 0)
		value += d->much * smooth(t / d->base_s) * exp(-fmax(t - d->base_s, 0) / d->base_s);
	return value;
}

/* Acceleration of an oscillator on the case by central differences of what lies between them. */
static void plate_make(double hz, double damping, double part, double soft)
{
	double w = 2 * PI * hz, u = 0, v = 0, most = soft > 0 ? 1 / (w * w) : 1;

	for (size_t i = 0; i < FINE; i++) {
		double k = w * w / (1 + soft * fabs(u) / most);
		double force = -k * u - 2 * damping * w * v;

		plate_g[i] += part * force;
		v += FINE_S * (force - case_g[i]);
		u += FINE_S * v;
	}
}

static void shock_make(const struct adversarial_drop *d)
{
	for (size_t i = 0; i < FINE; i++)
		case_g[i] = case_at(d, (double)i * FINE_S);
	memset(plate_g, 0, sizeof(plate_g));
	if (d->class->plate == RIGID)
		memcpy(plate_g, case_g, sizeof(plate_g));
	else
		plate_make(d->hz, d->damping, 1, d->class->plate == SOFT ? 0.3 : 0);
	if (d->class->plate == TWO_MODES)
		plate_make(2.3 * d->hz, d->damping, 0.1, 0);
}

static struct adversarial_drop draw(const struct adversarial_class *class, struct synth_random *random)
{
	struct adversarial_drop d = {.class = class};
	double height = 150 * pow(4, synth_uniform(random));

	d.base_s = 1.8e-3 * pow(3, synth_uniform(random));
	d.noise_g = 0.3 * pow(7, synth_uniform(random));
	d.onset_s = ONSET_S + 1e-3 * synth_uniform(random);
	d.hz = 90 + 130 * synth_uniform(random);
	d.damping = 0.02 + 0.1 * synth_uniform(random);
	d.at = synth_uniform(random);
	d.much = 0.03 + 0.05 * synth_uniform(random);
	d.again_s = 0.06 + 0.025 * synth_uniform(random);
	if (class->plate == HARDLY_DAMPED)
		d.damping = 0.003;
	if (class->plate == MUCH_DAMPED)
		d.damping = 0.25;
	if (class->plate == FAST)
		d.hz = 400;
	if (class->spoil == SHORT)
		d.base_s = 0.8e-3 + 0.4e-3 * synth_uniform(random);
	if (class->spoil == LONG)
		d.base_s = 8e-3 + 4e-3 * synth_uniform(random);
	if (class->spoil == WEAK)
		height = 11 + 19 * synth_uniform(random);
	if (class->spoil == LOUD)
		d.noise_g = 5;
	if (class->spoil == COARSER || class->spoil == COARSER_TWICE)
		d.noise_g = 0.2;
	if (class->spoil == SLAP_NEAR)
		d.again_s = 0.025;
	d.part[S1X] = d.part[S2X] = height;
	d.part[S1Y] = d.part[S2Y] = height * (0.35 + 0.4 * synth_uniform(random));
	d.part[S2Z] = 0.03 * height;
	if (class->spoil == S1_DEAD) /* a weak X: what S1 and S2 gain of speed does not tell */
		d.part[S1X] = d.part[S2X] = height / 3;
	return d;
}

static double table(const double *value, double t)
{
	return synth_table(value, FINE, FINE_S, t);
}

/* What the channel shows, without noise: what is wrong with the chain. */
static double shown(const struct adversarial_drop *d, int c, double t)
{
	const double *whole = c <= S1Y ? plate_g : case_g;
	double x = t / d->base_s, height = d->part[c],
	       sign = c == S2Y && d->class->spoil == REVERSED ? -1 : 1;
	double value;

	if (d->class->spoil == EXCHANGED && c <= S1Y)
		height = d->part[S1X + S1Y - c];
	if ((d->class->spoil == LATE && (c == S1Y || c == S2Y)) || (d->class->spoil == S2_LATE && c >= S2X))
		t -= 0.3e-3 + 0.3e-3 * d->at;
	value = sign * height * table(whole, t);
	switch (d->class->spoil) {
	case SECOND:
	case COARSER_TWICE:
		return value + 0.6 * height * table(whole, t - d->again_s);
	case SLAP:
	case SLAP_NEAR:
		return value + (1.2 + d->at) * height * table(whole, t - d->again_s);
	case OFFSET:
		return value + 12;
	case HUM:
		return value + 3 * sin(2 * PI * 50 * t + 6 * d->at);
	case SHIFT:
		return value + (c == S2X && t > 0 ? d->much * height * smooth(x) : 0);
	case SHIFT_AT_ONCE:
		return value + (c == S2X && t > 0 ? d->much * height * smooth(5 * x) : 0);
	case CABLE:
		return c == S2X && x > 0.55 + 0.2 * d->at ? 0 : value;
	case RAIL:
		return c == S2X && x > 0.2 + 0.6 * d->at ? 2000 : value;
	case STUCK:
		return c == S2X ? 2000 : value;
	case S1_LOOSE:
		if (c <= S1Y && t > 0)
			value += 0.3 * height * exp(-t / 8e-3) * sin(2 * PI * 1900 * t + 9 * sin(700 * t));
		return value;
	case S2_LOOSE:
		if (c == S2X && t > 0)
			value += 0.3 * height * exp(-t / 5e-3) * sin(2 * PI * 1500 * t + 9 * sin(900 * t));
		return value;
	case S2_LOOSE_LESS:
		return value +
		       (c >= S2X && t > 0 ? 0.12 * height * exp(-t / 5e-3) * sin(2 * PI * 1000 * t) : 0);
	case BURST:
		return value + 0.2 * height * table(case_g, t + 0.02);
	case GAIN_STEP:
		return c == S2X && x > 0.35 + 0.3 * d->at ? 0.7 * value : value;
	case GAIN_BACK:
		return c == S2X && x > 0.2 + 0.3 * d->at && x < 0.5 + 0.3 * d->at ? 0.75 * value : value;
	case LIMITED:
		return c == S2X ? 0.8 * height * tanh(value / (0.8 * height)) : value;
	case S1_LESS:
		return c <= S1Y ? 0.8 * value : value;
	case S1_LIMITED:
		return c == S1X ? 0.6 * height * tanh(value / (0.6 * height)) : value;
	case S1_GAIN_STEP:
		return c <= S1Y && t > 0.015 ? 0.8 * value : value;
	case RECTIFIED:
		return c == S1X ? fmax(value, 0) : value;
	case DEAD:
		return c == S2Y ? 0 : value;
	case S1_DEAD:
		return c == S1X ? 0 : value;
	default:
		return value;
	}
}

static double noise_of(const struct adversarial_drop *d, double *before, struct synth_random *random)
{
	double white = synth_normal(random), memory = d->class->spoil == RED ? 0.95 : 0.8;

	if (d->class->spoil == LAPLACE) {
		double u = synth_uniform(random) - 0.5;

		return -d->noise_g / sqrt(2) * copysign(log(1 - 2 * fabs(u) + 1e-12), u);
	}
	if (d->class->spoil != COLOURED && d->class->spoil != RED)
		return d->noise_g * white;
	*before = memory * *before + sqrt(1 - memory * memory) * d->noise_g * white;
	return *before;
}

static double cut_off(const struct adversarial_drop *d, int c, double value, double own,
                      struct synth_random *random)
{
	double limit = (0.6 + 0.25 * d->at) * d->part[c];

	switch (d->class->spoil) {
	case CUT_FINE:
	case CUT:
		if (c != S2X || value + own < limit)
			break;
		return limit + (d->class->spoil == CUT ? 0.05 : 0.02) * synth_normal(random);
	case CUT_NOISY:
		return (c == S2X ? fmin(value, limit) : value) + own;
	case CUT_BOTH:
		return (c >= S2X ? fmin(value, limit) : value) + own;
	case RAIL:
	case STUCK:
		if (value >= 2000)
			return 2000;
		break;
	default:
		break;
	}
	return value + own;
}

/* Chain errors that go from sample to sample. */
static void chain(const struct adversarial_drop *d, int c, double *v, size_t n, double rate_hz)
{
	double low = 0, pole = exp(-2 * PI * 250 / rate_hz), mean = 0;

	for (size_t k = 0; k < n; k++) {
		double value = v[k];

		low = pole * low + (1 - pole) * value;
		if (d->class->spoil == DULL && c == S2X)
			v[k] = low;
		if (d->class->spoil == HELD && c == S2X && k % 4 > 0)
			v[k] = v[k - 1];
		if (d->class->spoil == SLEW && c == S2X && k > 0) {
			double most = d->part[c] / (0.4 * d->base_s * rate_hz);

			v[k] = v[k - 1] + fmin(fmax(value - v[k - 1], -most), most);
		}
		if (d->class->spoil == SAG) {
			mean += (value - mean) / (10e-3 * rate_hz);
			v[k] = value - mean;
		}
	}
}

static void fill(struct adversarial_drop *d, int c, struct synth_random *random)
{
	struct channel *channel = &d->channel[c];
	double before = 0, code = d->class->spoil == COARSE                                        ? 0.5
	                          : d->class->spoil == COARSER || d->class->spoil == COARSER_TWICE ? 2
	                                                                                           : CODE_G;
	size_t rise = (size_t)((d->onset_s + (0.2 + 0.2 * d->at) * d->base_s - channel->start_s) *
	                       channel->rate_hz);
	size_t top = (size_t)((d->onset_s + d->base_s / 2 - channel->start_s) * channel->rate_hz);
	size_t fall = 2 * top - rise, block = (size_t)(1e-3 * channel->rate_hz);

	for (size_t k = 0; k < channel->count; k++) {
		double t = channel->start_s + (double)k / channel->rate_hz - d->onset_s;

		channel->value_g[k] = shown(d, c, t);
	}
	chain(d, c, channel->value_g, channel->count, channel->rate_hz);
	for (size_t k = 0; k < channel->count; k++) {
		double value = cut_off(d, c, channel->value_g[k], noise_of(d, &before, random), random);

		channel->value_g[k] = code * round(value / code);
	}
	if (c == S2X && d->class->spoil == FROZEN)
		for (size_t k = rise + 1; k < rise + HELD_SAMPLES; k++)
			channel->value_g[k] = channel->value_g[rise];
	if (c <= S1Y && d->class->spoil == BLOCK_TWICE)
		memcpy(channel->value_g + fall, channel->value_g + fall - block, block * sizeof(double));
	if (c >= S2X && d->class->spoil == BEGIN_HELD)
		for (size_t k = rise - block; k < rise; k++)
			channel->value_g[k] = channel->value_g[rise - block - 1];
	for (size_t k = 1; c == S2X && d->class->spoil == TWICE && k < channel->count; k += 2)
		channel->value_g[k] = channel->value_g[k - 1];
	for (int i = 0; d->class->spoil == SPIKES && i < 3; i++)
		channel->value_g[(size_t)(synth_uniform(random) * (double)(channel->count - 1))] += 300;
	if (d->class->spoil == LOST)
		synth_lose(channel, top - (size_t)(0.3e-3 * channel->rate_hz),
		           (size_t)(0.6e-3 * channel->rate_hz));
}

void adversarial_make(const struct adversarial_class *class, bool told, struct synth_random *random,
                      struct adversarial_drop *d)
{
	static const char *const names[CHANNELS] = {"S1X", "S1Y", "S2X", "S2Y", "S2Z"};
	double start;

	*d = draw(class, random);
	start = class->spoil == INSIDE ? d->onset_s + (0.1 + 0.3 * d->at) * d->base_s : 0;
	shock_make(d);
	for (int c = 0; c < CHANNELS; c++) {
		double rate_hz = c == S1X || c == S2X ? 7000 : 10000;

		d->channel[c] =
		        synth_channel(names[c], rate_hz, start, (size_t)((LENGTH_S - start) * rate_hz));
		fill(d, c, random);
	}
	d->record.channels = d->channel;
	d->record.channel_count = CHANNELS;
	d->record.is_drop = true;
	d->record.trigger_s = told ? d->onset_s + 0.4e-3 : NAN;
	drop_set_axes(&d->record);
}

void adversarial_free(struct adversarial_drop *d)
{
	for (int c = 0; c < CHANNELS; c++)
		synth_free(&d->channel[c]);
}

struct adversarial_truth adversarial_truth(unsigned sensor)
{
	const double *value = sensor == 1 ? plate_g : case_g;
	struct adversarial_truth truth = {0, 0, 0, 0};
	size_t n = (size_t)(40e-3 / FINE_S), from = 0, until = 0, top = 0;

	for (size_t i = 0; i < n; i++) {
		if (fabs(value[i]) > fabs(value[top]))
			top = i;
		truth.area += value[i] * FINE_S;
	}
	truth.peak = value[top];
	truth.time_s = (double)top * FINE_S;
	for (from = top; from > 0 && value[from] / truth.peak > 0.1; from--)
		;
	for (until = top; until < n && value[until] / truth.peak > 0.1; until++)
		;
	truth.width_s = (double)(until - from) * FINE_S;
	return truth;
}
