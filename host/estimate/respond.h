/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RESPOND_H
#define DT_HOST_ESTIMATE_RESPOND_H
/*
 * What a damped oscillator makes of the acceleration of its base: the absolute acceleration of the mass,
 *
 *     H(s) = (2 a s + a^2 + w^2) / ((s + a)^2 + w^2) = r / (s - l) + its conjugate,
 *     l = -a + i w,  r = a - i (w^2 - a^2) / (2 w)
 *
 * with decay rate a and damped angular frequency w in 1/s. The input is a parabola per step through its ends
 * and its middle, and 0 outside; for such an input the response is exact at the knots, by one complex
 * recurrence. A second recurrence carries the derivative by l, which gives the sensitivities. Between knots
 * cubic Hermite; after the input a free decay.
 */
#include <complex.h>
#include <stdbool.h>

enum { RESPOND_STEPS = 160 };

struct respond_input {
	double from_s, step_s;
	unsigned count;                      /* steps */
	double value[2 * RESPOND_STEPS + 1]; /* at the knots and half-way between, half a step apart */
};

/* The response at one instant, and how it changes. */
struct respond_point {
	double value, slope; /* slope per s */
	double by_decay, by_omega;
};

struct respond_knot {
	struct respond_point at;
	double slope_by_decay, slope_by_omega;
	double complex state; /* value = 2 Re(r state) */
};

struct respond {
	const struct respond_input *input; /* the caller's */
	double decay, omega, end_s;
	double complex pole, residue;
	/* after the input, u past its end: Re(swing e^(l u)), with these derivatives at fixed e^(l u) */
	double complex swing, swing_by_decay, swing_by_omega;
	struct respond_knot knot[RESPOND_STEPS + 1];
};

void respond_make(struct respond *respond, const struct respond_input *input, double decay, double omega);

void respond_at(const struct respond *respond, double time_s, struct respond_point *point);

/* Value, slope per s and curvature per s^2, exact between knots too: ten times as dear. */
void respond_bend(const struct respond *respond, double time_s, double derivative[3]);

/* The maximum of sign times the response. */
struct respond_crest {
	double time_s, value;
	double time_by_decay, time_by_omega;
};

/* False when there is none inside or after the input. */
bool respond_crest(const struct respond *respond, double sign, struct respond_crest *crest);

/* From when on the response lies within level of the free decay it ends in, since the last of an input hardly
 * counts: at most two steps before the input's end, to an eighth of a step. */
double respond_free_since(const struct respond *respond, double level);

#endif
