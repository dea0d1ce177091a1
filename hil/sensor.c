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

void sensor_advance(struct sensor *sensor, double step_s, double input_g)
{
	const double part = sensor->time_constant_s > 0 ? step_s / sensor->time_constant_s : 0;

	if (sensor->time_constant_s <= 0) {
		sensor->output_g = input_g;
	} else if (part <= 0) {
		sensor->output_g += input_g - sensor->input_g;
	} else {
		const double faded = -expm1(-part);

		sensor->output_g += (input_g - sensor->input_g) * faded / part - sensor->output_g * faded;
	}
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
