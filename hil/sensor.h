/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_SENSOR_H
#define DT_HIL_SENSOR_H
/*
 * One axis of a sensor, from what it feels to the code its converter gives: the high-pass of the IEPE
 * supply, white noise, the converter's limits, rounding to 1/32 g.
 *
 * The high-pass is of first order and continuous in time: a step fades as exp(-t / time constant). It is
 * exact for an input that goes in straight lines between the calls of sensor_advance; a call with no time
 * in between is a jump. The noise is drawn for each conversion. The sensor itself stays linear beyond its
 * nominal range, which is for the firmware to mark.
 *
 * Plain functions on a struct the caller owns: no heap, no errors, any context. Units: g.
 */
#include <stdint.h>

#include <gsl/gsl_rng.h>

struct sensor {
	double time_constant_s; /* 0: no high-pass */
	double noise_g;         /* standard deviation; 0: none is drawn */
	double input_g;         /* at the last call */
	double output_g;        /* behind the high-pass */
};

/* The supply has been on for long, with this input. */
void sensor_settle(struct sensor *sensor, double input_g);

/* What a step is to all sensors of a time constant: its part of that, and how much of an output fades. */
struct sensor_fading {
	double part, faded;
};
struct sensor_fading sensor_fading(double time_constant_s, double step_s);

/* Time went on by that step while the input went straight to input_g. */
static inline void sensor_advance(struct sensor *sensor, struct sensor_fading fading, double input_g)
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

/* With a spike on top; -32767 to 32767, never -32768, which on the wire means "not taken". */
int16_t sensor_convert(const struct sensor *sensor, double spike_g, gsl_rng *noise);

#endif
