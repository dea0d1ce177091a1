/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/synthetic.h"
#include "host/record/drop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_math.h>
#include <gsl/gsl_randist.h>

#include "common/units.h"

#define LOST_S 8e-3
#define PEAK_LOST_MOST 8.0 /* more, and nothing is left of the pulse */

struct synthetic_scene synthetic_scene(void)
{
	return (struct synthetic_scene){.family = SYNTHETIC_HALF_SINE,
	                                .peak_g = {485.1, 218.4},
	                                .plate_g = {310.1, 133.0},
	                                .rate_hz = {7000, 10000},
	                                .contact_s = 3e-3,
	                                .interval_s = 2e-3,
	                                .damped_hz = 129,
	                                .damping = 0.1,
	                                .pre_s = 0.15,
	                                .decay_s = 45e-3,
	                                .noise_g = 1,
	                                .step_g = 1.0 / 32,
	                                .hum_hz = 50,
	                                .spike_g = 300};
}

/* ---- the oscillator ------------------------------------------------------------------------------------ */

/* What one step does to displacement and velocity, and what the input at its two ends adds. */
struct step {
	double decay, c, s, natural, damping, damped; /* e^-at, cos, sin over one step; rad/s */
};

static struct step step_of(double damped_hz, double damping, double step_s)
{
	struct step step = {.damping = damping, .damped = 2 * M_PI * damped_hz};

	step.natural = step.damped / sqrt(1 - damping * damping);
	step.decay = exp(-damping * step.natural * step_s);
	step.c = cos(step.damped * step_s);
	step.s = sin(step.damped * step_s);
	return step;
}

/* The free motion of z'' + 2 zeta w z' + w^2 z = 0 over one step. */
static void glide(const struct step *step, double state[2])
{
	double a = step->damping * step->natural, z = state[0], v = state[1];

	state[0] = step->decay * (z * (step->c + a / step->damped * step->s) + v / step->damped * step->s);
	state[1] = step->decay * (v * (step->c - a / step->damped * step->s) -
	                          z * step->natural * step->natural / step->damped * step->s);
}

/* Driven by -(b0 + slope t): the particular motion p(t) = -(b0 + slope t) / w^2 + 2 zeta slope / w^3, what is
 * left of the state glides freely. */
static void drive(const struct step *step, double state[2], double b0, double b1, double step_s)
{
	double w = step->natural, slope = (b1 - b0) / step_s, rest = 2 * step->damping * slope / gsl_pow_3(w);
	double free[2] = {state[0] + b0 / (w * w) - rest, state[1] + slope / (w * w)};

	glide(step, free);
	state[0] = free[0] - b1 / (w * w) + rest;
	state[1] = free[1] - slope / (w * w);
}

static double felt(const struct step *step, const double state[2])
{
	return -(2 * step->damping * step->natural * state[1] + step->natural * step->natural * state[0]);
}

static double *respond(const struct synthetic_signal *signal, double damped_hz, double damping,
                       double state[2])
{
	double *out = malloc((signal->steps + 1) * sizeof(*out)),
	       h = signal->axis.contact_s / (double)signal->steps;
	struct step step = step_of(damped_hz, damping, h);

	state[0] = state[1] = 0;
	for (size_t i = 0; out && i <= signal->steps; i++) {
		double s = (double)i / (double)signal->steps;

		if (i > 0)
			drive(&step, state, synthetic_pulse(signal->family, s - 1 / (double)signal->steps),
			      synthetic_pulse(signal->family, s), h);
		out[i] = felt(&step, state);
	}
	return out;
}

static double response_at(const struct synthetic_signal *signal, const double *response,
                          const double state[2], double damped_hz, double damping, double t)
{
	double place = t / signal->axis.contact_s * (double)signal->steps, moved[2] = {state[0], state[1]};
	struct step step;

	if (!(t > 0))
		return 0;
	if (place < (double)signal->steps)
		return synthetic_between(response, signal->steps, place);
	step = step_of(damped_hz, damping, t - signal->axis.contact_s);
	glide(&step, moved);
	return felt(&step, moved);
}

int synthetic_signal_open(struct synthetic_signal *signal, enum synthetic_family family,
                          const struct synthetic_axis *axis)
{
	*signal = (struct synthetic_signal){.family = family, .axis = *axis};
	signal->steps = (size_t)(axis->contact_s / SYNTHETIC_STEP_S + 0.5);
	signal->response = respond(signal, axis->damped_hz, axis->damping, signal->state);
	if (fabs(axis->second_gain) > 0)
		signal->second = respond(signal, axis->second_hz, axis->second_damping, signal->second_state);
	if (signal->response && (signal->second || !(fabs(axis->second_gain) > 0)))
		return 0;
	synthetic_signal_close(signal);
	return DT_E_MEMORY;
}

void synthetic_signal_close(struct synthetic_signal *signal)
{
	free(signal->response);
	free(signal->second);
	signal->response = signal->second = NULL;
}

double synthetic_box(const struct synthetic_signal *signal, double time_s)
{
	const struct synthetic_axis *axis = &signal->axis;

	return axis->peak_g * synthetic_pulse(signal->family, (time_s - axis->onset_s) / axis->contact_s);
}

double synthetic_plate(const struct synthetic_signal *signal, double time_s)
{
	const struct synthetic_axis *axis = &signal->axis;
	double t = time_s - axis->onset_s;
	double value = axis->gain * response_at(signal, signal->response, signal->state, axis->damped_hz,
	                                        axis->damping, t - axis->delay_s);

	if (signal->second)
		value += axis->second_gain * response_at(signal, signal->second, signal->second_state,
		                                         axis->second_hz, axis->second_damping,
		                                         t - axis->second_delay_s);
	return value;
}

/* ---- truth ------------------------------------------------------------------------------------------------
 */

/* Where f is largest in a..b, one maximum inside: golden section. */
static double summit_of(double (*f)(const void *context, double t), const void *context, double a, double b)
{
	const double golden = (sqrt(5) - 1) / 2;
	double c = b - golden * (b - a), d = a + golden * (b - a), fc = f(context, c), fd = f(context, d);

	for (int i = 0; i < 70; i++) {
		if (fc > fd) {
			b = d, d = c, fd = fc;
			fc = f(context, c = b - golden * (b - a));
		} else {
			a = c, c = d, fc = fd;
			fd = f(context, d = a + golden * (b - a));
		}
	}
	return (a + b) / 2;
}

static double plate_of(const void *signal, double t)
{
	return synthetic_plate(signal, t);
}

static double resultant_of(const void *context, double t)
{
	const struct synthetic_signal *signal = context;

	return hypot(synthetic_box(&signal[0], t), synthetic_box(&signal[1], t));
}

/* The first swing has one maximum between the onset and a period of the plate after it. */
static double plate_summit(const struct synthetic_signal *signal)
{
	const struct synthetic_axis *axis = &signal->axis;
	double from = axis->onset_s + axis->delay_s, step = 0.01 / axis->damped_hz, at = from;

	for (double t = from; t < from + axis->contact_s + 1 / axis->damped_hz; t += step)
		if (synthetic_plate(signal, t) > synthetic_plate(signal, at))
			at = t;
	return summit_of(plate_of, signal, at - step, at + step);
}

double synthetic_plate_peak(const struct synthetic_signal *signal)
{
	return synthetic_plate(signal, plate_summit(signal));
}

double synthetic_lag(const struct synthetic_signal *signal)
{
	const struct synthetic_axis *axis = &signal->axis;

	return plate_summit(signal) - axis->onset_s -
	       synthetic_pulse_summit(signal->family) * axis->contact_s;
}

double synthetic_resultant(const struct synthetic_signal signal[2])
{
	double apart = synthetic_pulse_summit(signal[0].family), a = INFINITY, b = -INFINITY;

	for (int i = 0; i < 2; i++) {
		double at = signal[i].axis.onset_s + apart * signal[i].axis.contact_s;

		a = fmin(a, at - 1e-4);
		b = fmax(b, at + 1e-4);
	}
	return resultant_of(signal, summit_of(resultant_of, signal, a, b));
}

struct synthetic_truth synthetic_truth(const struct synthetic *synthetic)
{
	const struct synthetic_axis *x = &synthetic->signal[0].axis;
	enum synthetic_family family = synthetic->scene.family;

	return (struct synthetic_truth){
	        .peak_g = x->peak_g,
	        .peak_s = synthetic->onset_s + x->onset_s + synthetic_pulse_summit(family) * x->contact_s,
	        .resultant_g = synthetic_resultant(synthetic->signal),
	        .plate_peak_g = synthetic_plate_peak(&synthetic->signal[0]),
	        .lag_s = synthetic_lag(&synthetic->signal[0]),
	        .damped_hz = x->damped_hz,
	        .damping = x->damping,
	        .contact_s = x->contact_s,
	        .velocity_m_s = synthetic_pulse_area(family) * x->contact_s * x->peak_g * UNITS_G_M_S2};
}

/* ---- a drop
 * ------------------------------------------------------------------------------------------------ */

/* Gain and delay from the plate's peak and the interval asked for. A second mode goes with the first's. */
static int make_axis(struct synthetic *synthetic, int i)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	struct synthetic_axis axis = {.rate_hz = scene->rate_hz[i],
	                              .peak_g = scene->peak_g[i],
	                              .onset_s = i == 0 ? 0 : scene->skew_s,
	                              .contact_s = scene->contact_s,
	                              .gain = 1,
	                              .damped_hz = scene->damped_hz,
	                              .damping = scene->damping,
	                              .second_hz = scene->damped_hz + scene->second_apart_hz,
	                              .second_damping = scene->damping};
	struct synthetic_signal unit;
	double at;

	if (synthetic_signal_open(&unit, scene->family, &axis))
		return DT_E_MEMORY;
	at = synthetic_lag(&unit);
	axis.delay_s = scene->interval_s - at;
	at += axis.onset_s + synthetic_pulse_summit(scene->family) * axis.contact_s;
	axis.gain = scene->plate_g[i] / synthetic_plate(&unit, at);
	axis.second_gain = scene->second_part * axis.gain;
	axis.second_delay_s = axis.delay_s;
	synthetic_signal_close(&unit);
	return synthetic_signal_open(&synthetic->signal[i], scene->family, &axis);
}

static double rate_of(const struct synthetic *synthetic, enum synthetic_channel channel)
{
	return synthetic->scene.rate_hz[channel & 1u];
}

/* Up to a millisecond of the onset's play comes on top. */
static size_t count_of(const struct synthetic *synthetic, enum synthetic_channel channel)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double end = scene->pre_s + scene->contact_s + scene->skew_s +
	             fmax(0, synthetic->signal[0].axis.delay_s) + scene->decay_s + 1e-3;

	return (size_t)(end * rate_of(synthetic, channel));
}

int synthetic_open(struct synthetic *synthetic, const struct synthetic_scene *scene)
{
	static const char *const names[SYNTHETIC_CHANNELS] = {"S1X", "S1Y", "S2X", "S2Y"};
	bool failed;

	*synthetic = (struct synthetic){.scene = *scene, .onset_s = scene->pre_s};
	synthetic->random = gsl_rng_alloc(gsl_rng_taus2);
	record_init(&synthetic->record);
	strcpy(synthetic->record.file, "synthetic");
	strcpy(synthetic->record.format, "csv");
	failed = !synthetic->random || make_axis(synthetic, 0) || make_axis(synthetic, 1);
	for (unsigned i = 0; i < SYNTHETIC_CHANNELS && !failed; i++)
		failed = !record_add_channel(&synthetic->record, names[i],
		                             rate_of(synthetic, (enum synthetic_channel)i),
		                             count_of(synthetic, (enum synthetic_channel)i));
	drop_set_axes(&synthetic->record);
	if (!failed)
		return 0;
	synthetic_close(synthetic);
	return DT_E_MEMORY;
}

void synthetic_close(struct synthetic *synthetic)
{
	gsl_rng_free(synthetic->random);
	record_free(&synthetic->record);
	for (int i = 0; i < 2; i++)
		synthetic_signal_close(&synthetic->signal[i]);
}

static bool plate_channel(enum synthetic_channel channel)
{
	return channel == SYNTHETIC_S1X || channel == SYNTHETIC_S1Y;
}

static double signal_at(const struct synthetic *synthetic, enum synthetic_channel channel, double time_s)
{
	const struct synthetic_signal *signal = &synthetic->signal[channel & 1u];

	return plate_channel(channel) ? synthetic_plate(signal, time_s - synthetic->onset_s)
	                              : synthetic_box(signal, time_s - synthetic->onset_s);
}

/* Whether sample k belongs to the run of lost ones. */
static bool in_run(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k)
{
	const struct synthetic_axis *axis = &synthetic->signal[channel & 1u].axis;
	double lost =
	        plate_channel(channel) ? synthetic->scene.lost : fmin(synthetic->scene.lost, PEAK_LOST_MOST);
	double from = synthetic->onset_s + axis->onset_s;

	if (synthetic->scene.lost == 0)
		return false;
	if (plate_channel(channel))
		from = (from + LOST_S) * axis->rate_hz;
	else
		from = rint((from + synthetic_pulse_summit(synthetic->scene.family) * axis->contact_s) *
		                    axis->rate_hz -
		            lost / 2);
	return (double)k >= from && (double)k < from + lost;
}

bool synthetic_keeps(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double t = (double)k / rate_of(synthetic, channel);

	return !in_run(synthetic, channel, k) &&
	       !(scene->clip_g > 0 && fabs(signal_at(synthetic, channel, t)) >= scene->clip_g);
}

static double sample_at(struct synthetic *synthetic, enum synthetic_channel channel, size_t k, double phase)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double t = (double)k / rate_of(synthetic, channel), value;

	value = gsl_ran_gaussian_ziggurat(synthetic->random, scene->noise_g);
	if (scene->hum_g > 0)
		value += scene->hum_g * sin(2 * M_PI * scene->hum_hz * t + phase);
	if (t > synthetic->onset_s + scene->contact_s)
		value += scene->offset_g;
	if (scene->jitter_s > 0)
		t += gsl_ran_gaussian_ziggurat(synthetic->random, scene->jitter_s);
	return value + signal_at(synthetic, channel, t);
}

static void add_spikes(struct synthetic *synthetic, const struct channel *channel)
{
	const struct synthetic_scene *scene = &synthetic->scene;

	for (unsigned i = 0; i < scene->spikes; i++) {
		double t = synthetic->onset_s + 2 * scene->contact_s +
		           fmax(0, scene->decay_s - scene->contact_s) * gsl_rng_uniform(synthetic->random);
		size_t k = (size_t)(t * channel->rate_hz);

		if (k < channel->count)
			channel->value_g[k] +=
			        gsl_rng_uniform(synthetic->random) < 0.5 ? -scene->spike_g : scene->spike_g;
	}
}

static void finish_sample(struct synthetic *synthetic, enum synthetic_channel c, size_t k)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	struct channel *channel = &synthetic->record.channels[c];
	double value = channel->value_g[k];
	bool lost = in_run(synthetic, c, k) ||
	            (scene->missing > 0 && gsl_rng_uniform(synthetic->random) < scene->missing);

	if (scene->clip_g > 0)
		value = fmax(-scene->clip_g, fmin(scene->clip_g, value));
	if (scene->step_g > 0)
		value = scene->step_g * rint(value / scene->step_g);
	channel->value_g[k] = lost ? (double)NAN : value;
	channel->sample[k] = lost ? SAMPLE_LOST : 0;
}

void synthetic_drop(struct synthetic *synthetic, unsigned long seed, unsigned long drop)
{
	double phase;

	gsl_rng_set(synthetic->random, seed * 7919 + drop * 104729 + 1);
	synthetic->onset_s = synthetic->scene.pre_s + 1e-3 * gsl_rng_uniform(synthetic->random);
	phase = 2 * M_PI * gsl_rng_uniform(synthetic->random);
	for (unsigned i = 0; i < SYNTHETIC_CHANNELS; i++) {
		struct channel *channel = &synthetic->record.channels[i];

		channel->flags = 0;
		for (size_t k = 0; k < channel->count; k++)
			channel->value_g[k] = sample_at(synthetic, (enum synthetic_channel)i, k, phase);
		if (plate_channel((enum synthetic_channel)i))
			add_spikes(synthetic, channel);
		for (size_t k = 0; k < channel->count; k++)
			finish_sample(synthetic, (enum synthetic_channel)i, k);
	}
	record_finish(&synthetic->record);
}
