/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/synthetic.h"
#include "host/record/drop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_math.h>
#include <gsl/gsl_randist.h>

#include "common/units.h"

#define GAP_S 5e-3     /* after the contact */
#define SPIKES_S 35e-3 /* the span that they fall in, from SPIKES_LATE_S after the contact */
#define SPIKES_LATE_S 2e-3
#define SPIKE_EARLY_S 10e-3
#define CUT_S 1e-3
#define PLAY_S 1e-3 /* of the onset */

struct synthetic_scene synthetic_scene(void)
{
	return (struct synthetic_scene){.family = SYNTHETIC_HALF_SINE,
	                                .peak_g = {485.1, 218.4},
	                                .plate_g = {310.1, 133.0},
	                                .rate_hz = {7000, 10000},
	                                .z_part = 0.0412, /* 20 g on S2 */
	                                .contact_s = 3e-3,
	                                .interval_s = 2e-3,
	                                .damped_hz = 129,
	                                .damping = 0.1,
	                                .pre_s = 0.15,
	                                .post_s = 0.06,
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
static void synthetic_drive(const struct step *step, double state[2], double b0, double b1, double step_s)
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

static double *synthetic_respond(const struct synthetic_signal *signal, double damped_hz, double damping,
                                 double state[2])
{
	double *out = malloc((SYNTHETIC_STEPS + 1) * sizeof(*out));
	double h = signal->axis.contact_s / SYNTHETIC_STEPS, before = 0;
	struct step step = step_of(damped_hz, damping, h);

	state[0] = state[1] = 0;
	for (int i = 0; out && i <= SYNTHETIC_STEPS; i++) {
		double pulse = synthetic_pulse(signal->family, (double)i / SYNTHETIC_STEPS);

		if (i > 0)
			synthetic_drive(&step, state, before, pulse, h);
		out[i] = felt(&step, state);
		before = pulse;
	}
	return out;
}

static double response_at(const struct synthetic_signal *signal, const double *response,
                          const double state[2], double damped_hz, double damping, double t)
{
	double place = t / signal->axis.contact_s * SYNTHETIC_STEPS, moved[2] = {state[0], state[1]};
	struct step step;

	if (!(t > 0))
		return 0;
	if (place < SYNTHETIC_STEPS)
		return synthetic_between(response, SYNTHETIC_STEPS, place);
	step = step_of(damped_hz, damping, t - signal->axis.contact_s);
	glide(&step, moved);
	return felt(&step, moved);
}

int synthetic_signal_open(struct synthetic_signal *signal, enum synthetic_family family,
                          const struct synthetic_axis *axis)
{
	*signal = (struct synthetic_signal){.family = family, .axis = *axis};
	signal->response = synthetic_respond(signal, axis->damped_hz, axis->damping, signal->state);
	if (fabs(axis->second_gain) > 0)
		signal->second = synthetic_respond(signal, axis->second_hz, axis->second_damping,
		                                   signal->second_state);
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

/* Upwards whatever its sign. */
static double synthetic_plate_of(const void *context, double t)
{
	const struct synthetic_signal *signal = context;

	return signal->axis.gain < 0 ? -synthetic_plate(signal, t) : synthetic_plate(signal, t);
}

static double box_magnitude(const void *context, double t)
{
	const struct synthetic_signal *signal = context;

	return hypot(synthetic_box(&signal[0], t), synthetic_box(&signal[1], t));
}

static double plate_magnitude(const void *context, double t)
{
	const struct synthetic_signal *signal = context;

	return hypot(synthetic_plate(&signal[0], t), synthetic_plate(&signal[1], t));
}

/* The same where there may be several: the surroundings of the largest of steps in a..b. */
static double highest_of(double (*f)(const void *context, double t), const void *context, double a, double b,
                         double step)
{
	double at = a;

	for (double t = a; t < b; t += step)
		if (f(context, t) > f(context, at))
			at = t;
	return summit_of(f, context, at - step, at + step);
}

/* The first swing has one maximum between the onset and a period of the plate after it. */
double synthetic_plate_summit(const struct synthetic_signal *signal)
{
	const struct synthetic_axis *axis = &signal->axis;
	double from = axis->onset_s + axis->delay_s;

	return highest_of(synthetic_plate_of, signal, from, from + axis->contact_s + 1 / axis->damped_hz,
	                  0.02 / axis->damped_hz);
}

static double box_summit(const struct synthetic_signal *signal)
{
	return signal->axis.onset_s + synthetic_pulse_summit(signal->family) * signal->axis.contact_s;
}

double synthetic_lag(const struct synthetic_signal *signal)
{
	return synthetic_plate_summit(signal) - box_summit(signal);
}

double synthetic_resultant(const struct synthetic_signal signal[2], double *at)
{
	double x = box_summit(&signal[0]), y = box_summit(&signal[1]);

	*at = summit_of(box_magnitude, signal, fmin(x, y) - 1e-4, fmax(x, y) + 1e-4);
	return box_magnitude(signal, *at);
}

static double synthetic_plate_resultant(const struct synthetic_signal signal[2], double *at)
{
	double x = synthetic_plate_summit(&signal[0]), y = synthetic_plate_summit(&signal[1]);

	*at = highest_of(plate_magnitude, signal, fmin(x, y), fmax(x, y) + 1e-5, 1e-5);
	return plate_magnitude(signal, *at);
}

/* Of base 1, at a tenth of the height. */
static double synthetic_width_of(enum synthetic_family family)
{
	double edge[2];

	for (int side = 0; side < 2; side++) {
		double inside = synthetic_pulse_summit(family), outside = side;

		for (int i = 0; i < 60; i++) {
			double middle = (inside + outside) / 2;

			if (synthetic_pulse(family, middle) > 0.1)
				inside = middle;
			else
				outside = middle;
		}
		edge[side] = inside;
	}
	return edge[1] - edge[0];
}

static void find_truth(struct synthetic *synthetic)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	const struct synthetic_signal *signal = synthetic->signal;
	struct synthetic_truth *truth = &synthetic->at_zero;

	*truth =
	        (struct synthetic_truth){.z_peak_g = scene->z_part * scene->peak_g[0],
	                                 .damped_hz = scene->damped_hz,
	                                 .natural_hz = scene->damped_hz / sqrt(1 - gsl_pow_2(scene->damping)),
	                                 .damping = scene->damping,
	                                 .contact_s = scene->contact_s,
	                                 .width_s = synthetic_width_of(scene->family) * scene->contact_s,
	                                 .velocity_m_s = synthetic_pulse_area(scene->family) *
	                                                 scene->contact_s * scene->peak_g[0] * UNITS_G_M_S2};
	for (int i = 0; i < 2; i++) {
		truth->peak_g[i] = scene->peak_g[i];
		truth->peak_s[i] = box_summit(&signal[i]);
		truth->plate_s[i] = synthetic_plate_summit(&signal[i]);
		truth->plate_g[i] = synthetic_plate(&signal[i], truth->plate_s[i]);
		truth->lag_s[i] = truth->plate_s[i] - truth->peak_s[i];
	}
	truth->resultant_g = synthetic_resultant(signal, &truth->resultant_s);
	truth->plate_resultant_g = synthetic_plate_resultant(signal, &truth->plate_resultant_s);
}

struct synthetic_truth synthetic_truth(const struct synthetic *synthetic)
{
	struct synthetic_truth truth = synthetic->at_zero;

	for (int i = 0; i < 2; i++) {
		truth.peak_s[i] += synthetic->onset_s;
		truth.plate_s[i] += synthetic->onset_s;
	}
	truth.resultant_s += synthetic->onset_s;
	truth.plate_resultant_s += synthetic->onset_s;
	return truth;
}

/* ---- a drop ---------------------------------------------------------------------------------------------
 */

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

static double synthetic_rate_of(const struct synthetic *synthetic, enum synthetic_channel channel)
{
	return synthetic->scene.rate_hz[channel != SYNTHETIC_S1X && channel != SYNTHETIC_S2X];
}

/* Axis 0: X and Z. */
static int axis_of(enum synthetic_channel channel)
{
	return channel == SYNTHETIC_S1Y || channel == SYNTHETIC_S2Y;
}

int synthetic_open(struct synthetic *synthetic, const struct synthetic_scene *scene)
{
	static const char *const names[SYNTHETIC_CHANNELS] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};
	bool failed;

	*synthetic = (struct synthetic){.scene = *scene, .onset_s = scene->pre_s};
	synthetic->random = gsl_rng_alloc(gsl_rng_taus2);
	record_init(&synthetic->record);
	strcpy(synthetic->record.file, "synthetic");
	strcpy(synthetic->record.format, "csv");
	failed = !synthetic->random || make_axis(synthetic, 0) || make_axis(synthetic, 1);
	for (unsigned i = 0; i < SYNTHETIC_CHANNELS && !failed; i++) {
		double rate = synthetic_rate_of(synthetic, (enum synthetic_channel)i);

		failed = !record_add_channel(&synthetic->record, names[i], rate,
		                             (size_t)((scene->pre_s + scene->post_s) * rate));
	}
	drop_set_axes(&synthetic->record);
	if (!failed) {
		find_truth(synthetic);
		return 0;
	}
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

static double signal_at(const struct synthetic *synthetic, enum synthetic_channel channel, double time_s)
{
	const struct synthetic_signal *signal = &synthetic->signal[axis_of(channel)];
	double t = time_s - synthetic->onset_s;
	double value = channel < SYNTHETIC_S2X ? synthetic_plate(signal, t) : synthetic_box(signal, t);

	return channel == SYNTHETIC_S1Z || channel == SYNTHETIC_S2Z ? synthetic->scene.z_part * value : value;
}

/* Whether sample k is among the count nearest the peak of S2's X or Y. */
static bool near_peak(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k,
                      unsigned count)
{
	double peak;

	if (count == 0 || (channel != SYNTHETIC_S2X && channel != SYNTHETIC_S2Y))
		return false;
	peak = synthetic->onset_s + synthetic->at_zero.peak_s[axis_of(channel)];
	return fabs((double)k - floor(peak * synthetic_rate_of(synthetic, channel) - count / 2.0 + 1) -
	            (count - 1) / 2.0) < count / 2.0;
}

static bool synthetic_in_gap(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k)
{
	double from = (synthetic->onset_s + synthetic->scene.contact_s + GAP_S) *
	              synthetic_rate_of(synthetic, channel);

	return channel < SYNTHETIC_S2X && (double)k >= from && (double)k < from + synthetic->scene.gap;
}

bool synthetic_keeps(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double t = (double)k / synthetic_rate_of(synthetic, channel);

	return !near_peak(synthetic, channel, k, scene->lost_at_peak) &&
	       !near_peak(synthetic, channel, k, scene->zeroed_at_peak) &&
	       !near_peak(synthetic, channel, k, scene->nan_at_peak) &&
	       !synthetic_in_gap(synthetic, channel, k) && !(scene->cut && t > synthetic->onset_s + CUT_S) &&
	       !(scene->clip_g > 0 && fabs(signal_at(synthetic, channel, t)) >= scene->clip_g);
}

static double disturbance(const struct synthetic *synthetic, double time_s, double phase)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double value = scene->offset_g + scene->drift_g_s * time_s;

	if (scene->hum_g > 0)
		value += scene->hum_g * sin(2 * M_PI * scene->hum_hz * time_s + phase);
	return time_s > synthetic->onset_s + scene->contact_s ? value + scene->shift_g : value;
}

static void add_spikes(struct synthetic *synthetic, enum synthetic_channel c)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	struct channel *channel = &synthetic->record.channels[c];
	double from = scene->contact_s + SPIKES_LATE_S, span = fmin(SPIKES_S, scene->post_s - PLAY_S - from);

	for (unsigned i = 0; i < scene->spikes && (c == SYNTHETIC_S1X || c == SYNTHETIC_S1Y) && span > 0;
	     i++) {
		double t = synthetic->onset_s + from + span * gsl_rng_uniform(synthetic->random);

		channel->value_g[(size_t)(t * channel->rate_hz)] +=
		        gsl_rng_uniform(synthetic->random) < 0.5 ? -scene->spike_g : scene->spike_g;
	}
	if (scene->spikes > 0 && (c == SYNTHETIC_S2X || c == SYNTHETIC_S2Y))
		channel->value_g[(size_t)((synthetic->onset_s - SPIKE_EARLY_S) * channel->rate_hz)] +=
		        scene->spike_g;
}

static double quantized(const struct synthetic_scene *scene, double value)
{
	if (scene->clip_g > 0)
		value = fmax(-scene->clip_g, fmin(scene->clip_g, value));
	return scene->step_g > 0 ? scene->step_g * rint(value / scene->step_g) : value;
}

static void damage(struct synthetic *synthetic, enum synthetic_channel c, size_t k)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	struct channel *channel = &synthetic->record.channels[c];

	if (near_peak(synthetic, c, k, scene->zeroed_at_peak))
		channel->value_g[k] = 0;
	if (near_peak(synthetic, c, k, scene->nan_at_peak))
		channel->value_g[k] = NAN;
	if (near_peak(synthetic, c, k, scene->lost_at_peak) || synthetic_in_gap(synthetic, c, k) ||
	    (scene->missing > 0 && gsl_rng_uniform(synthetic->random) < scene->missing)) {
		channel->value_g[k] = NAN;
		channel->sample[k] = SAMPLE_LOST;
	}
}

static void synthetic_fill(struct synthetic *synthetic, enum synthetic_channel c, double phase)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	struct channel *channel = &synthetic->record.channels[c];

	for (size_t k = 0; k < channel->count; k++) {
		double t = (double)k / channel->rate_hz, value = disturbance(synthetic, t, phase);

		value += gsl_ran_gaussian_ziggurat(synthetic->random, scene->noise_g);
		if (scene->jitter_s > 0)
			t += gsl_ran_gaussian_ziggurat(synthetic->random, scene->jitter_s);
		channel->value_g[k] = value + signal_at(synthetic, c, t);
		channel->sample[k] = 0;
	}
	add_spikes(synthetic, c);
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] = quantized(scene, channel->value_g[k]);
		damage(synthetic, c, k);
	}
}

void synthetic_drop(struct synthetic *synthetic, unsigned long drop)
{
	const struct synthetic_scene *scene = &synthetic->scene;
	double phase;

	gsl_rng_set(synthetic->random, scene->seed + 1000003 * (drop + 1));
	synthetic->onset_s = scene->pre_s + PLAY_S * gsl_rng_uniform(synthetic->random);
	phase = 2 * M_PI * gsl_rng_uniform(synthetic->random);
	for (unsigned i = 0; i < SYNTHETIC_CHANNELS; i++) {
		struct channel *channel = &synthetic->record.channels[i];
		double end_s = scene->cut ? synthetic->onset_s + CUT_S : scene->pre_s + scene->post_s;

		channel->count = (size_t)(end_s * channel->rate_hz);
		channel->flags = 0;
		synthetic_fill(synthetic, (enum synthetic_channel)i, phase);
	}
	record_finish(&synthetic->record);
}
