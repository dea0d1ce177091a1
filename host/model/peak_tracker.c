/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/peak_tracker.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "host/model/root.h"

/* Parabolas through ever closer points, in shares of the samples' distance: their vertex closes in on a
 * smooth peak to the seventh digit and beyond. Two rounds do; where the vertex escaped the second, it gets
 * two more, and where it escapes these there is a kink. */
static const double round_share[] = {0.05, 2e-3, 0.01, 2e-3};
enum { ROUNDS = sizeof(round_share) / sizeof(round_share[0]), KINK_STEPS = 60 };

#define GOLDEN 0.6180339887498949
#define ROUGH_SHARE 0.2

static void peak_tracker_sample(struct peak_tracker *w, const struct ode *ode, double t)
{
	double y[ODE_STATES_MAX];

	memmove(&w->time_s[0], &w->time_s[1], 2 * sizeof(w->time_s[0]));
	memmove(&w->value[0], &w->value[1], 2 * sizeof(w->value[0]));
	if (t != ode->t)
		ode_at(ode, t, y);
	w->time_s[2] = t;
	w->signals(w->context, t != ode->t ? y : ode->y, w->value[2]);
	if (w->seen < 3)
		w->seen++;
}

static void record(struct peak_tracker *w, size_t signal, double t, const double value[])
{
	w->peak[signal] = (struct peak_tracker_peak){value[signal], t};
	memcpy(w->with[signal], value, w->count * sizeof(*value));
}

void peak_tracker_start(struct peak_tracker *w, const struct ode *ode)
{
	w->seen = 0;
	peak_tracker_sample(w, ode, ode->t);
	for (size_t i = 0; i < w->count; i++)
		record(w, i, ode->t, w->value[2]);
}

void peak_tracker_resume(struct peak_tracker *w, const struct ode *ode)
{
	w->seen = 0;
	w->resumed = true;
	peak_tracker_sample(w, ode, ode->t);
	for (size_t i = 0; i < w->count; i++)
		if (!(w->skipped >> i & 1u) && fabs(w->value[2][i]) > fabs(w->peak[i].value))
			record(w, i, ode->t, w->value[2]);
}

static double peak_tracker_magnitude(const struct peak_tracker *w, const struct ode *ode, size_t signal,
                                     double t)
{
	double y[ODE_STATES_MAX], value[PEAK_TRACKER_SIGNALS_MAX];

	ode_at(ode, t, y);
	w->signals(w->context, y, value);
	return fabs(value[signal]);
}

/* The vertex of the parabola through three points, no further away than they are. */
static double vertex(const double t[3], const double f[3])
{
	double left = t[1] - t[0], right = t[2] - t[1];
	double fall_left = (f[1] - f[0]) / left, fall_right = (f[1] - f[2]) / right;
	double at = t[1] + 0.5 * (fall_left * right - fall_right * left) / (fall_left + fall_right);

	if (!(fall_left + fall_right > 0.0))
		return t[1];
	return fmin(fmax(at, t[0]), t[2]);
}

/* Sharpens *t, a peak between two instants. False if no parabola fits. */
static bool close_in(const struct peak_tracker *w, const struct ode *ode, size_t signal,
                     const double time_s[3], double *t)
{
	double reach = fmin(time_s[2] - time_s[1], time_s[1] - time_s[0]), most = 0.0;
	bool within = false;

	for (int i = 0; i < ROUNDS && !(within && i == ROUNDS / 2); i++) {
		double step = round_share[i] * reach, f[3];
		double at[3] = {*t - step, *t, *t + step};

		if (at[0] < time_s[0] || at[2] > time_s[2])
			return false;
		for (int k = 0; k < 3; k++)
			f[k] = peak_tracker_magnitude(w, ode, signal, at[k]);
		*t = vertex(at, f);
		within = *t > at[0] && *t < at[2];
		most = fmax(fmax(f[0], f[1]), f[2]);
	}
	return within && peak_tracker_magnitude(w, ode, signal, *t) >= most * (1.0 - 1e-12);
}

/* The largest between two instants that have one peak between them, whatever its shape. */
static double golden_section(const struct peak_tracker *w, const struct ode *ode, size_t signal, double low,
                             double high)
{
	double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
	double at_a = peak_tracker_magnitude(w, ode, signal, a),
	       at_b = peak_tracker_magnitude(w, ode, signal, b);

	for (int i = 0; i < KINK_STEPS; i++) {
		if (at_a > at_b) {
			high = b;
			b = a;
			at_b = at_a;
			a = high - GOLDEN * (high - low);
			at_a = peak_tracker_magnitude(w, ode, signal, a);
		} else {
			low = a;
			a = b;
			at_a = at_b;
			b = low + GOLDEN * (high - low);
			at_b = peak_tracker_magnitude(w, ode, signal, b);
		}
	}
	return 0.5 * (low + high);
}

/* A narrower parabola about t, as good as long steps deserve. */
static double vertex_again(const struct peak_tracker *w, const struct ode *ode, size_t signal,
                           const double time_s[3], double t)
{
	double step = ROUGH_SHARE * fmin(time_s[2] - time_s[1], time_s[1] - time_s[0]), f[3];
	double at[3] = {t - step, t, t + step};

	if (at[0] < time_s[0] || at[2] > time_s[2])
		return t;
	for (int k = 0; k < 3; k++)
		f[k] = peak_tracker_magnitude(w, ode, signal, at[k]);
	return vertex(at, f);
}

/* The middle one of three instants is where the signal is largest, as far as known; f: its magnitudes. */
static void peak_tracker_refine(struct peak_tracker *w, const struct ode *ode, size_t signal,
                                const double time_s[3], const double f[3])
{
	double t = vertex(time_s, f), y[ODE_STATES_MAX], value[PEAK_TRACKER_SIGNALS_MAX];

	if (w->rough)
		t = vertex_again(w, ode, signal, time_s, t);
	else if (!close_in(w, ode, signal, time_s, &t))
		t = golden_section(w, ode, signal, time_s[0], time_s[2]);
	ode_at(ode, t, y);
	w->signals(w->context, y, value);
	if (fabs(value[signal]) < f[1]) {
		t = time_s[1];
		ode_at(ode, t, y);
		w->signals(w->context, y, value);
	}
	if (fabs(value[signal]) > fabs(w->peak[signal].value))
		record(w, signal, t, value);
}

/* How far above the largest sample a peak between samples may lie. */
#define HIDDEN_SHARE 1.1

/* How near the end, or the new start, of all its slope is looked at. */
#define END_SHARE 1e-3

/* Between the first two samples after peak_tracker_resume, where no earlier one tells of a peak. */
static void peak_tracker_look_at_start(struct peak_tracker *w, const struct ode *ode, size_t signal)
{
	double from = w->time_s[0], to = w->time_s[1], edge[3] = {from, from + END_SHARE * (to - from), to};
	double f[3] = {fabs(w->value[0][signal]), 0.0, fabs(w->value[1][signal])};

	if (f[0] < f[2])
		return;
	f[1] = peak_tracker_magnitude(w, ode, signal, edge[1]);
	if (f[1] > f[0])
		peak_tracker_refine(w, ode, signal, edge, f);
}

static void peak_tracker_look(struct peak_tracker *w, const struct ode *ode, double t)
{
	peak_tracker_sample(w, ode, t);
	if (w->seen < 3)
		return;
	for (size_t i = 0; i < w->count; i++) {
		double f[3];

		if (w->skipped >> i & 1u)
			continue;
		for (int k = 0; k < 3; k++)
			f[k] = fabs(w->value[k][i]);
		if (f[1] >= f[0] && f[1] > f[2] && f[1] * HIDDEN_SHARE > fabs(w->peak[i].value))
			peak_tracker_refine(w, ode, i, w->time_s, f);
		if (w->resumed && f[0] * HIDDEN_SHARE > fabs(w->peak[i].value))
			peak_tracker_look_at_start(w, ode, i);
	}
	w->resumed = false;
}

void peak_tracker_step(struct peak_tracker *w, const struct ode *ode)
{
	peak_tracker_look(w, ode, 0.5 * (ode->last.from + ode->last.end));
	peak_tracker_look(w, ode, ode->last.end);
}

/* Between the last two samples, where no later one tells of a peak. */
static void peak_tracker_look_at_end(struct peak_tracker *w, const struct ode *ode, size_t signal)
{
	double from = w->time_s[1], to = w->time_s[2], half[3] = {from, 0.5 * (from + to), to};
	double edge[3] = {half[1], to - END_SHARE * (to - from), to}, end = fabs(w->value[2][signal]);
	double middle = peak_tracker_magnitude(w, ode, signal, half[1]);
	double before = fabs(w->value[1][signal]), slope;

	if (middle >= end && middle >= before) {
		peak_tracker_refine(w, ode, signal, half, (const double[]){before, middle, end});
	} else if (middle < end) {
		slope = peak_tracker_magnitude(w, ode, signal, edge[1]);
		if (slope > end)
			peak_tracker_refine(w, ode, signal, edge, (const double[]){middle, slope, end});
	}
	if (end > fabs(w->peak[signal].value))
		record(w, signal, to, w->value[2]);
}

bool peak_tracker_passed(const struct peak_tracker *w, size_t signal, double share)
{
	double now = fabs(w->value[2][signal]);

	return w->seen == 3 && now < fabs(w->value[1][signal]) && now < share * fabs(w->peak[signal].value);
}

void peak_tracker_end(struct peak_tracker *w, const struct ode *ode)
{
	for (size_t i = 0; i < w->count; i++)
		if (!(w->skipped >> i & 1u) && fabs(w->value[2][i]) * HIDDEN_SHARE > fabs(w->peak[i].value))
			peak_tracker_look_at_end(w, ode, i);
}

struct crossing {
	const struct ode *ode;
	size_t state;
};

static double crossing_at(double t, void *context)
{
	const struct crossing *c = context;
	double y[ODE_STATES_MAX];

	ode_at(c->ode, t, y);
	return y[c->state];
}

double peak_tracker_crossing(const struct ode *ode, size_t state)
{
	struct crossing c = {ode, state};
	double t = ode->last.end;

	return root_find(crossing_at, &c, ode->last.from, ode->last.end, &t) == 0 ? t : ode->last.end;
}
