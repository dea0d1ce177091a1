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

void sensor_advance(struct sensor *sensor, struct sensor_fading fading, double input_g)
{
	const double change_g = input_g - sensor->input_g;

	if (sensor->time_constant_s <= 0)
		sensor->output_g = input_g;
	else if (fading.part <= 0)
		sensor->output_g += change_g;
	else
		sensor->output_g += change_g * fading.faded / fading.part - sensor->output_g * fading.faded;
	sensor->input_g = input_g;
}

int16_t sensor_convert(const struct sensor *sensor, gsl_rng *noise)
{
	double g = sensor->output_g;

	if (sensor->noise_g > 0)
		g += gsl_ran_gaussian_ziggurat(noise, sensor->noise_g);
	g = fmin(fmax(g * WIRE_COUNTS_PER_G, -WIRE_SAMPLE_FULL_SCALE), WIRE_SAMPLE_FULL_SCALE);
	return (int16_t)lrint(g);
}
