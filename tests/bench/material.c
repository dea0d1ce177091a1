/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/drop.h"
#include "tests/bench/material.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

#define ONSET_S 0.1003
#define LENGTH_S 0.5
#define BASE_S 3e-3
#define PEAK_G 530.0
#define STEP_G (1.0 / 32)
#define LIMIT_G 400.0

enum { PLATE = 250000 };

static double plate[PLATE], second[PLATE];

static double reading(int sensor, enum material_kind kind, double t)
{
	if (sensor == 2)
		return synth_pulse(SYNTH_HALF_SINE, t / BASE_S);
	return synth_table(plate, PLATE, SYNTH_STEP_S, t) +
	       (kind == MATERIAL_WORST ? 0.2 * synth_table(second, PLATE, SYNTH_STEP_S, t) : 0);
}

static void fill(struct channel *channel, int i, enum material_kind kind, struct synth_random *random)
{
	static const double part[3] = {0.9, 0.41, 0.04};

	for (size_t k = 0; k < channel->count; k++) {
		double t = (double)k / channel->rate_hz;
		double value = PEAK_G * part[i % 3] * reading(i / 3 + 1, kind, t - ONSET_S);

		value += 0.3 * i + synth_normal(random);
		if (kind == MATERIAL_WORST)
			value += 5 * cos(2 * PI * 50 * t + i);
		channel->value_g[k] = STEP_G * round(value / STEP_G);
	}
}

/* Three spikes of 300 g in the decay, a limit, and a block of each tenth tick lost from the contact on. */
static void spoil(struct channel *channel)
{
	size_t tick = (size_t)(channel->rate_hz / 1000);

	for (size_t i = 0; i < 3; i++)
		channel->value_g[(size_t)((ONSET_S + 0.009 + 0.0063 * (double)i) * channel->rate_hz)] += 300;
	for (size_t k = 0; k < channel->count; k++)
		channel->value_g[k] = fmin(channel->value_g[k], LIMIT_G);
	for (size_t i = 110; i < 500; i += 10)
		synth_lose(channel, i * tick, tick);
}

void material_make(struct material *material, enum material_kind kind)
{
	static const char *const names[MATERIAL_CHANNELS] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};
	struct synth_random random = {11};

	synth_plate(plate, PLATE, SYNTH_HALF_SINE, BASE_S, 129, 0.1);
	synth_plate(second, PLATE, SYNTH_HALF_SINE, BASE_S, 165, 0.1);
	memset(material, 0, sizeof(*material));
	for (int i = 0; i < MATERIAL_CHANNELS; i++) {
		double rate = i % 3 ? 10000 : 7000;

		material->channel[i] = synth_channel(names[i], rate, 0, (size_t)(LENGTH_S * rate));
		fill(&material->channel[i], i, kind, &random);
		if (kind == MATERIAL_WORST)
			spoil(&material->channel[i]);
	}
	material->contact_end_s = ONSET_S + BASE_S;
	material->record.channels = material->channel;
	material->record.channel_count = MATERIAL_CHANNELS;
	drop_set_axes(&material->record);
	material->record.is_drop = true;
	material->record.trigger_s = ONSET_S + 0.0002;
}

void material_free(struct material *material)
{
	for (int i = 0; i < MATERIAL_CHANNELS; i++)
		synth_free(&material->channel[i]);
}
