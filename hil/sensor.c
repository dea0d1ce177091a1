/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/sensor.h"

#include <math.h>

#include <gsl/gsl_randist.h>

#include "common/wire.h"

void sensor_settle(struct sensor *sensor, double input_g)
{
	sensor->input_g = input_g;
	sensor->output_g = sensor->time_constant_s > 0 ? 0 : input_g;
}

struct sensor_fading sensor_fading(double time_constant_s, double step_s)
{
	const double part = time_constant_s > 0 ? step_s / time_constant_s : 0;

	return (struct sensor_fading){part, part > 0 ? -expm1(-part) : 0};
}

int16_t sensor_convert(const struct sensor *sensor, double spike_g, gsl_rng *noise)
{
	double g = sensor->output_g + spike_g;

	if (sensor->noise_g > 0)
		g += gsl_ran_gaussian_ziggurat(noise, sensor->noise_g);
	g *= WIRE_COUNTS_PER_G;
	if (g >= WIRE_SAMPLE_FULL_SCALE)
		return WIRE_SAMPLE_FULL_SCALE;
	if (g <= -WIRE_SAMPLE_FULL_SCALE)
		return -WIRE_SAMPLE_FULL_SCALE;
	return (int16_t)lrint(g);
}
