/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/drop.h"
#include "tests/accuracy/stage.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_randist.h>

#define PI 3.14159265358979323846

#define POST_S 0.060
#define STEP_G (1.0 / 32)
#define Z_PART 0.0412 /* of X: 20 g on S2 */
#define GAP_S 8e-3
#define HUM_HZ 50
#define SPIKE_G 300

/* The study's means at 25 degrees. */
static const struct {
	double damped_hz, interval_s, s1_g[2], sign;
} geometries[] = {
        [STAGE_2A] = {129, 2.0e-3, {310.1, 133.0}, 1},
        [STAGE_2B] = {177, 1.2e-3, {401.0, 225.9}, -1},
};
static const double s2_g[2] = {485.1, 218.4};

double stage_rate(enum stage_channel channel)
{
	return channel == STAGE_S1X || channel == STAGE_S2X ? 7000 : 10000;
}

double stage_noise(const struct scene *scene)
{
	return sqrt(scene->noise_g * scene->noise_g + STEP_G * STEP_G / 12);
}

static double *make_plate(enum synth_shape shape, double damped_hz)
{
	double *plate = calloc(STAGE_TABLE, sizeof(*plate));

	if (!plate)
		abort();
	synth_plate(plate, STAGE_TABLE, shape, STAGE_CONTACT_S,
	            damped_hz / sqrt(1 - STAGE_DAMPING * STAGE_DAMPING), STAGE_DAMPING);
	return plate;
}

static void make_axes(struct stage *stage)
{
	const struct scene *scene = &stage->scene;
	double height, at = synth_plate_peak(stage->plate, STAGE_TABLE, &height);

	for (int i = 0; i < 2; i++) {
		double sign = geometries[scene->geometry].sign;
		struct stage_axis *axis = &stage->axis[i];

		axis->rate_hz = i == 0 ? 7000 : 10000;
		axis->s2_g = sign * (i == 0 && scene->x_peak_g > 0 ? scene->x_peak_g : s2_g[i]);
		axis->skew_s = i == 0 ? 0 : scene->skew_s;
		axis->gain = sign * geometries[scene->geometry].s1_g[i] / height;
		axis->s1_peak_s = synth_pulse_summit(scene->shape) * STAGE_CONTACT_S + stage->interval_s;
		axis->delay_s = axis->s1_peak_s - at;
	}
}

void stage_open(struct stage *stage, const struct scene *scene)
{
	static const char *const names[] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};

	*stage = (struct stage){.scene = *scene,
	                        .damped_hz = geometries[scene->geometry].damped_hz,
	                        .interval_s = geometries[scene->geometry].interval_s};
	stage->plate = make_plate(scene->shape, stage->damped_hz);
	if (scene->second_part > 0)
		stage->second = make_plate(scene->shape, stage->damped_hz + scene->second_hz);
	make_axes(stage);
	stage->random = gsl_rng_alloc(gsl_rng_taus2);
	record_init(&stage->record);
	strcpy(stage->record.file, "stage");
	strcpy(stage->record.format, "csv");
	for (unsigned i = 0; i < STAGE_CHANNELS; i++)
		if (!record_add_channel(&stage->record, names[i], stage_rate((enum stage_channel)i),
		                        (size_t)((STAGE_PRE_S + POST_S) * stage_rate((enum stage_channel)i))))
			abort();
	drop_set_axes(&stage->record);
	stage->onset_s = STAGE_PRE_S;
}

void stage_close(struct stage *stage)
{
	free(stage->plate);
	free(stage->second);
	gsl_rng_free(stage->random);
	record_free(&stage->record);
}

double stage_signal(const struct stage *stage, enum stage_channel channel, double time_s)
{
	bool z = channel == STAGE_S1Z || channel == STAGE_S2Z;
	const struct stage_axis *axis = &stage->axis[channel == STAGE_S1Y || channel == STAGE_S2Y];
	double t = time_s - stage->onset_s - axis->skew_s, value;

	if (channel >= STAGE_S2X) {
		value = axis->s2_g * synth_pulse(stage->scene.shape, t / STAGE_CONTACT_S);
	} else {
		t -= axis->delay_s;
		value = axis->gain * synth_table(stage->plate, STAGE_TABLE, SYNTH_STEP_S, t);
		if (stage->second)
			value += stage->scene.second_part * axis->gain *
			         synth_table(stage->second, STAGE_TABLE, SYNTH_STEP_S, t);
	}
	return z ? Z_PART * value : value;
}

/* Whether sample k is among the count nearest the peak of S2's X or Y. */
static bool near_peak(const struct stage *stage, enum stage_channel channel, size_t k, unsigned count)
{
	double rate = stage_rate(channel), peak;

	if (count == 0 || (channel != STAGE_S2X && channel != STAGE_S2Y))
		return false;
	peak = stage->onset_s + stage->axis[channel == STAGE_S2Y].skew_s +
	       synth_pulse_summit(stage->scene.shape) * STAGE_CONTACT_S;
	return fabs((double)k - floor(peak * rate - count / 2.0 + 1) - (count - 1) / 2.0) < count / 2.0;
}

static bool in_gap(const struct stage *stage, enum stage_channel channel, size_t k)
{
	double from = (stage->onset_s + GAP_S) * stage_rate(channel);

	return channel < STAGE_S2X && (double)k >= from && (double)k < from + stage->scene.gap;
}

bool stage_keeps(const struct stage *stage, enum stage_channel channel, size_t k)
{
	const struct scene *scene = &stage->scene;
	double t = (double)k / stage_rate(channel);

	return !near_peak(stage, channel, k, scene->lost_at_peak) &&
	       !near_peak(stage, channel, k, scene->zeroed_at_peak) &&
	       !near_peak(stage, channel, k, scene->nan_at_peak) && !in_gap(stage, channel, k) &&
	       !(scene->cut && t > stage->onset_s + 1e-3) &&
	       !(scene->clip_g > 0 && fabs(stage_signal(stage, channel, t)) >= scene->clip_g);
}

/* Hum and drift are the same on all channels, as from one supply. */
static double disturbance(const struct scene *scene, double time_s, double phase)
{
	return scene->offset_g + scene->drift_g_s * time_s +
	       (scene->hum_g > 0 ? scene->hum_g * sin(2 * PI * HUM_HZ * time_s + phase) : 0);
}

static void lose(struct channel *channel, size_t k)
{
	channel->value_g[k] = NAN;
	channel->sample[k] = SAMPLE_LOST;
}

static void damage(struct stage *stage, enum stage_channel c, size_t k)
{
	const struct scene *scene = &stage->scene;
	struct channel *channel = &stage->record.channels[c];

	if (near_peak(stage, c, k, scene->zeroed_at_peak))
		channel->value_g[k] = 0;
	if (near_peak(stage, c, k, scene->nan_at_peak))
		channel->value_g[k] = NAN;
	if (near_peak(stage, c, k, scene->lost_at_peak) || in_gap(stage, c, k) ||
	    (scene->missing > 0 && gsl_rng_uniform(stage->random) < scene->missing))
		lose(channel, k);
}

static void add_spikes(struct stage *stage, enum stage_channel c)
{
	struct channel *channel = &stage->record.channels[c];

	if (c == STAGE_S1X || c == STAGE_S1Y)
		for (unsigned i = 0; i < stage->scene.spikes; i++) {
			double t = stage->onset_s + 5e-3 + 35e-3 * gsl_rng_uniform(stage->random);

			channel->value_g[(size_t)(t * channel->rate_hz)] +=
			        gsl_rng_uniform(stage->random) < 0.5 ? -SPIKE_G : SPIKE_G;
		}
	if (stage->scene.spikes > 0 && (c == STAGE_S2X || c == STAGE_S2Y))
		channel->value_g[(size_t)((stage->onset_s - 10e-3) * channel->rate_hz)] += SPIKE_G;
}

static double converted(const struct scene *scene, double value)
{
	if (scene->clip_g > 0)
		value = fmax(-scene->clip_g, fmin(scene->clip_g, value));
	return STEP_G * rint(value / STEP_G);
}

static void fill(struct stage *stage, enum stage_channel c, double phase)
{
	const struct scene *scene = &stage->scene;
	struct channel *channel = &stage->record.channels[c];

	for (size_t k = 0; k < channel->count; k++) {
		double t = (double)k / channel->rate_hz, value = disturbance(scene, t, phase);

		if (t >= stage->onset_s - 1e-3)
			value += stage_signal(stage, c, t);
		channel->value_g[k] = value + gsl_ran_gaussian_ziggurat(stage->random, scene->noise_g);
		channel->sample[k] = 0;
	}
	add_spikes(stage, c);
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] = converted(scene, channel->value_g[k]);
		damage(stage, c, k);
	}
}

/* Scenes that differ in what they are, not in what the estimators are told, get chances of their own. */
static unsigned long seed_of(const struct scene *scene, unsigned drop)
{
	unsigned long kind = (unsigned long)scene->shape * 2 + (unsigned long)scene->geometry;

	return 1000003ul * (drop + 1) + 131ul * kind + 1009ul * (unsigned long)(10 * scene->noise_g);
}

void stage_drop(struct stage *stage, unsigned drop)
{
	double phase;

	gsl_rng_set(stage->random, seed_of(&stage->scene, drop));
	stage->onset_s = STAGE_PRE_S + 1e-3 * gsl_rng_uniform(stage->random);
	phase = 2 * PI * gsl_rng_uniform(stage->random);
	for (unsigned i = 0; i < STAGE_CHANNELS; i++) {
		struct channel *channel = &stage->record.channels[i];
		double end_s = stage->scene.cut ? stage->onset_s + 1e-3 : STAGE_PRE_S + POST_S;

		channel->count = (size_t)(end_s * channel->rate_hz);
		channel->flags = 0;
		fill(stage, (enum stage_channel)i, phase);
	}
	record_finish(&stage->record);
}
