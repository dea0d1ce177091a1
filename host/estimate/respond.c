/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/respond.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/complex_product.h"

enum {
	TERMS = 12,
	NEWTON = 5,
	FREE_STEPS = 2, /* before the input's end are looked at, each in so many parts */
	FREE_PARTS = 8,
};

/* What one step adds to the state: its input's start, middle and end times these. */
struct hold {
	double complex turn;
	double complex weight[3];
	double complex by_pole[3]; /* derivative of weight */
};

/* The integrals of s^n e^(z (1 - s)) over 0..1, n = 0 1 2, and their derivatives by z. They are n! f(n + 1),
 * f(m) = sum of z^k / (k + m)! over k, by the series of the last: in closed form they cancel for small z. */
static void moments(double complex z, double complex moment[3], double complex by_z[3])
{
	static const double factor[TERMS] = {1.0 / 24,         1.0 / 120,         1.0 / 720,
	                                     1.0 / 5040,       1.0 / 40320,       1.0 / 362880,
	                                     1.0 / 3628800,    1.0 / 39916800,    1.0 / 479001600,
	                                     1.0 / 6227020800, 1.0 / 87178291200, 1.0 / 1307674368000};
	double complex first, second, third, fourth = 0;

	for (unsigned k = TERMS; k-- > 0;)
		fourth = product(fourth, z) + factor[k];
	third = product(fourth, z) + 1.0 / 6;
	second = product(third, z) + 1.0 / 2;
	first = product(second, z) + 1;
	moment[0] = first;
	moment[1] = second;
	moment[2] = 2 * third;
	by_z[0] = first - second;
	by_z[1] = second - 2 * third;
	by_z[2] = 2 * (third - 3 * fourth);
}

static void make_hold(struct hold *hold, double complex pole, double step_s)
{
	double complex moment[3], by_z[3];

	moments(pole * step_s, moment, by_z);
	hold->turn = cexp(pole * step_s);
	hold->weight[0] = step_s * (moment[0] - 3 * moment[1] + 2 * moment[2]);
	hold->weight[1] = step_s * 4 * (moment[1] - moment[2]);
	hold->weight[2] = step_s * (2 * moment[2] - moment[1]);
	hold->by_pole[0] = step_s * step_s * (by_z[0] - 3 * by_z[1] + 2 * by_z[2]);
	hold->by_pole[1] = step_s * step_s * 4 * (by_z[1] - by_z[2]);
	hold->by_pole[2] = step_s * step_s * (2 * by_z[2] - by_z[1]);
}

/* Of the residue: d/da and d/dw. */
static void residue_slopes(const struct respond *respond, double complex slope[2])
{
	double part = respond->decay / respond->omega;

	slope[0] = 1 + I * part;
	slope[1] = -I * (1 + part * part) / 2;
}

/* d/da = -d/dl, d/dw = i d/dl, beside what the residue does. */
static void fill_knot(const struct respond *respond, const double complex residue_by[2], double complex state,
                      double complex by_pole, double input, struct respond_knot *knot)
{
	double complex residue = respond->residue, rate = product(respond->pole, state) + input;
	double complex rate_by_pole = state + product(respond->pole, by_pole);
	double complex moved = product(residue, by_pole), rate_moved = product(residue, rate_by_pole);

	knot->state = state;
	knot->at.value = 2 * product_real(residue, state);
	knot->at.slope = 2 * product_real(residue, rate);
	knot->at.by_decay = 2 * (product_real(residue_by[0], state) - creal(moved));
	knot->at.by_omega = 2 * (product_real(residue_by[1], state) - cimag(moved));
	knot->slope_by_decay = 2 * (product_real(residue_by[0], rate) - creal(rate_moved));
	knot->slope_by_omega = 2 * (product_real(residue_by[1], rate) - cimag(rate_moved));
}

void respond_make(struct respond *respond, const struct respond_input *input, double decay, double omega)
{
	double complex state = 0, by_pole = 0, residue_by[2];
	struct hold hold;

	respond->input = input;
	respond->decay = decay;
	respond->omega = omega;
	respond->end_s = input->from_s + input->count * input->step_s;
	respond->pole = -decay + I * omega;
	respond->residue = decay - I * (omega * omega - decay * decay) / (2 * omega);
	residue_slopes(respond, residue_by);
	make_hold(&hold, respond->pole, input->step_s);
	fill_knot(respond, residue_by, 0, 0, input->value[0], &respond->knot[0]);
	for (unsigned k = 0; k < input->count; k++) {
		const double *value = &input->value[2 * k];

		by_pole = product(hold.turn, by_pole + input->step_s * state) + hold.by_pole[0] * value[0] +
		          hold.by_pole[1] * value[1] + hold.by_pole[2] * value[2];
		state = product(hold.turn, state) + hold.weight[0] * value[0] + hold.weight[1] * value[1] +
		        hold.weight[2] * value[2];
		fill_knot(respond, residue_by, state, by_pole, value[2], &respond->knot[k + 1]);
	}
	respond->swing = 2 * respond->residue * state;
	respond->swing_by_decay = 2 * (residue_by[0] * state - respond->residue * by_pole);
	respond->swing_by_omega = 2 * (residue_by[1] * state + I * respond->residue * by_pole);
}

static void after_input(const struct respond *respond, double past_s, struct respond_point *point)
{
	double complex turn = cexp(respond->pole * past_s), swing = product(respond->swing, turn);

	point->value = creal(swing);
	point->slope = product_real(respond->pole, swing);
	point->by_decay = product_real(respond->swing_by_decay, turn) - past_s * creal(swing);
	point->by_omega = product_real(respond->swing_by_omega, turn) - past_s * cimag(swing);
}

/* At part x of the step from a to b. */
static void respond_between(const struct respond_knot *a, const struct respond_knot *b, double x, double step,
                            struct respond_point *point)
{
	double to_b = x * x * (3 - 2 * x), to_a = 1 - to_b, bend = 6 * x * (1 - x) / step;
	double slope_a = x * (1 - x) * (1 - x) * step, slope_b = x * x * (x - 1) * step;

	point->value =
	        to_a * a->at.value + to_b * b->at.value + slope_a * a->at.slope + slope_b * b->at.slope;
	point->slope = bend * (b->at.value - a->at.value) + (1 - x) * (1 - 3 * x) * a->at.slope +
	               x * (3 * x - 2) * b->at.slope;
	point->by_decay = to_a * a->at.by_decay + to_b * b->at.by_decay + slope_a * a->slope_by_decay +
	                  slope_b * b->slope_by_decay;
	point->by_omega = to_a * a->at.by_omega + to_b * b->at.by_omega + slope_a * a->slope_by_omega +
	                  slope_b * b->slope_by_omega;
}

void respond_at(const struct respond *respond, double time_s, struct respond_point *point)
{
	double step = respond->input->step_s, place = (time_s - respond->input->from_s) / step;
	unsigned k;

	if (!(place > 0)) {
		*point = (struct respond_point){0, 0, 0, 0};
		return;
	}
	if (place >= respond->input->count) {
		after_input(respond, time_s - respond->end_s, point);
		return;
	}
	k = (unsigned)place;
	respond_between(&respond->knot[k], &respond->knot[k + 1], place - k, step, point);
}

void respond_bend(const struct respond *respond, double time_s, double derivative[3])
{
	double step = respond->input->step_s, place = (time_s - respond->input->from_s) / step;
	double complex state[3];

	if (place >= respond->input->count) {
		state[0] = product(respond->swing, cexp(respond->pole * (time_s - respond->end_s)));
		state[1] = respond->pole * state[0];
		state[2] = respond->pole * state[1];
	} else if (place > 0) {
		unsigned k = (unsigned)place;
		const double *value = &respond->input->value[2 * k];
		double x = place - k, push = -3 * value[0] + 4 * value[1] - value[2];
		double bow = 2 * (value[0] - 2 * value[1] + value[2]);
		double half = value[0] + x / 2 * (push + x / 2 * bow), now = value[0] + x * (push + x * bow);
		struct hold hold;

		make_hold(&hold, respond->pole, x * step);
		state[0] = hold.turn * respond->knot[k].state + hold.weight[0] * value[0] +
		           hold.weight[1] * half + hold.weight[2] * now;
		state[1] = respond->pole * state[0] + now;
		state[2] = respond->pole * state[1] + (push + 2 * x * bow) / step;
		for (unsigned i = 0; i < 3; i++)
			state[i] *= 2 * respond->residue;
	} else {
		state[0] = state[1] = state[2] = 0;
	}
	for (unsigned i = 0; i < 3; i++)
		derivative[i] = creal(state[i]);
}

double respond_free_since(const struct respond *respond, double level)
{
	double back_s = respond->input->step_s / FREE_PARTS;
	double complex turn = cexp(-respond->pole * back_s), swing = respond->swing;
	double since_s = respond->end_s;

	for (unsigned i = 0; i < FREE_STEPS * FREE_PARTS; i++) {
		struct respond_point point;

		swing *= turn;
		respond_at(respond, since_s - back_s, &point);
		if (!(fabs(point.value - creal(swing)) < level))
			break;
		since_s -= back_s;
	}
	return since_s;
}

/* The free decay's first maximum of sign times the response. */
static bool crest_after(const struct respond *respond, double sign, struct respond_crest *crest)
{
	double phase = carg(sign * respond->pole * respond->swing);
	double angle = UNITS_PI / 2 - phase, past_s, bend;
	double complex turn, by_decay, by_omega;

	if (angle < 0)
		angle += 2 * UNITS_PI;
	past_s = angle / respond->omega;
	turn = cexp(respond->pole * past_s);
	bend = creal(respond->pole * respond->pole * respond->swing * turn);
	/* of pole * swing * turn */
	by_decay = respond->pole * respond->swing_by_decay - respond->swing -
	           respond->pole * respond->swing * past_s;
	by_omega = respond->pole * respond->swing_by_omega + I * respond->swing +
	           I * respond->pole * respond->swing * past_s;
	crest->time_s = respond->end_s + past_s;
	crest->value = creal(respond->swing * turn);
	crest->time_by_decay = -creal(by_decay * turn) / bend;
	crest->time_by_omega = -creal(by_omega * turn) / bend;
	return isfinite(crest->time_by_decay) && isfinite(crest->time_by_omega);
}

/* The slope's zero in step k: a cubic through the slopes and curvatures at its ends. */
static bool crest_inside(const struct respond *respond, unsigned k, struct respond_crest *crest)
{
	const double *value = &respond->input->value[2 * k];
	const struct respond_knot *a = &respond->knot[k], *b = a + 1;
	double step = respond->input->step_s, from = a->at.slope, to = b->at.slope, x = from / (from - to);
	double push_a = -3 * value[0] + 4 * value[1] - value[2],
	       push_b = value[0] - 4 * value[1] + 3 * value[2];
	double complex pole = respond->pole;
	double bend_a = 2 * creal(respond->residue * (step * pole * (pole * a->state + value[0]) + push_a));
	double bend_b = 2 * creal(respond->residue * (step * pole * (pole * b->state + value[2]) + push_b));
	double bend = to - from;
	struct respond_point point;

	for (unsigned i = 0; i < NEWTON; i++) {
		double slope = from * (1 + 2 * x) * (1 - x) * (1 - x) + bend_a * x * (1 - x) * (1 - x) +
		               to * x * x * (3 - 2 * x) + bend_b * x * x * (x - 1);

		bend = 6 * x * (1 - x) * (to - from) + (1 - x) * (1 - 3 * x) * bend_a +
		       x * (3 * x - 2) * bend_b;
		x -= slope / bend;
	}
	if (!(x >= -0.01 && x <= 1.01))
		return false;
	crest->time_s = respond->input->from_s + (k + x) * step;
	respond_at(respond, crest->time_s, &point);
	crest->value = point.value;
	crest->time_by_decay = -(a->slope_by_decay * (1 - x) + b->slope_by_decay * x) * step / bend;
	crest->time_by_omega = -(a->slope_by_omega * (1 - x) + b->slope_by_omega * x) * step / bend;
	return true;
}

bool respond_crest(const struct respond *respond, double sign, struct respond_crest *crest)
{
	struct respond_crest after;
	bool free = crest_after(respond, sign, &after), found = false;
	unsigned top = 0;

	for (unsigned k = 1; k <= respond->input->count; k++)
		if (sign * respond->knot[k].at.value > sign * respond->knot[top].at.value)
			top = k;
	if (top > 0 && sign * respond->knot[top].at.slope <= 0)
		found = crest_inside(respond, top - 1, crest);
	else if (top < respond->input->count)
		found = crest_inside(respond, top, crest);
	if (free && (!found || sign * after.value > sign * crest->value)) {
		*crest = after;
		found = true;
	}
	return found;
}
