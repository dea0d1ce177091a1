/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_SYNTH_H
#define DT_TESTS_UNIT_SYNTH_H
/*
 * Signals whose truth is known, for the tests of the estimators: pulse shapes in closed form or by an
 * integration of their own, an oscillator driven by them, seeded Gaussian noise. Shares nothing with
 * host/estimate, host/model or hil.
 */
#include <stddef.h>
#include <stdint.h>

#include "host/record/record.h"

struct synth_random {
	uint64_t state;
};

double synth_uniform(struct synth_random *random); /* [0, 1) */
double synth_normal(struct synth_random *random);

enum synth_shape { SYNTH_HALF_SINE, SYNTH_HAVERSINE, SYNTH_HERTZ, SYNTH_HUNT_CROSSLEY, SYNTH_SHAPES };

/* A pulse of base 1 and height 1; 0 outside 0..1. Hunt-Crossley with a restitution of 0.5. */
double synth_pulse(enum synth_shape shape, double x);
double synth_pulse_summit(enum synth_shape shape); /* where it is 1 */
double synth_pulse_area(enum synth_shape shape);

/* A plate on a box that feels the pulse: SYNTH_STEP_S apart from the start of contact on, its acceleration
 * for a pulse of height 1 and base base_s. */
#define SYNTH_STEP_S 2e-6
void synth_plate(double *value, size_t count, enum synth_shape shape, double base_s, double natural_hz,
                 double damping);

/* When such a plate peaks, and how high: a parabola through its largest value. */
double synth_plate_peak(const double *value, size_t count, double *height);

/* Between its points by straight lines; 0 before the first and after the last. */
double synth_table(const double *value, size_t count, double step, double x);

/* A channel of count good samples of 0; free with synth_free. */
struct channel synth_channel(const char *name, double rate_hz, double start_s, size_t count);
void synth_free(struct channel *channel);

/* Marks count samples as lost. */
void synth_lose(struct channel *channel, size_t first, size_t count);

#endif
