/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include <gsl/gsl_math.h>

#include "common/units.h"
#include "host/chart/reference.h"

#define LAG_MAX_S 6e-3

static size_t reference_pulse_largest(const struct reference_series *s)
{
	size_t at = 0;

	for (size_t k = 1; k < s->count; k++)
		if (s->y[k] > s->y[at])
			at = k;
	return at;
}

/* The top of the parabola through y[at - 1 .. at + 1]; of the middle alone at an end. */
static struct reference_peak top(const double *y, size_t at, size_t count, double rate_hz)
{
	double before, after, curve, shift;

	if (at == 0 || at + 1 >= count)
		return (struct reference_peak){y[at], (double)at / rate_hz};
	before = y[at - 1], after = y[at + 1];
	curve = before - 2 * y[at] + after;
	shift = curve < 0 ? (before - after) / (2 * curve) : 0;
	return (struct reference_peak){y[at] - (before - after) * shift / 4, ((double)at + shift) / rate_hz};
}

struct reference_peak reference_maximum(const struct reference_series *s)
{
	size_t at = reference_pulse_largest(s);

	return (struct reference_peak){s->y[at], (double)at / s->rate_hz};
}

struct reference_peak reference_parabola(const struct reference_series *s)
{
	return top(s->y, reference_pulse_largest(s), s->count, s->rate_hz);
}

double reference_resultant(const struct reference_series *x, const struct reference_series *y)
{
	double most = NAN;

	for (size_t k = 0; k < y->count; k++) {
		double place = (double)k / y->rate_hz * x->rate_hz, part;
		size_t i = (size_t)place;

		if (i + 1 >= x->count)
			break;
		part = place - (double)i;
		most = fmax(most, hypot(x->y[i] + part * (x->y[i + 1] - x->y[i]), y->y[k]));
	}
	return most;
}

/* Where the line between two samples meets the level, going out from the largest. */
static double reference_pulse_edge(const struct reference_series *s, size_t at, int step, double level)
{
	size_t k = at;

	while (s->y[k] >= level) {
		if (k == 0 || k + 1 >= s->count)
			return NAN;
		k = step > 0 ? k + 1 : k - 1;
	}
	return ((double)k - step * (level - s->y[k]) / (s->y[step > 0 ? k - 1 : k + 1] - s->y[k])) /
	       s->rate_hz;
}

static double ten_percent(const struct reference_series *s)
{
	size_t at = reference_pulse_largest(s);
	double level = 0.1 * s->y[at];

	return reference_pulse_edge(s, at, 1, level) - reference_pulse_edge(s, at, -1, level);
}

double reference_width(const struct reference_series *s)
{
	return ten_percent(s) / (1 - 2 * asin(0.1) / M_PI);
}

static double sum_around(const struct reference_series *s, double reach_s)
{
	double sum = 0, at = (double)reference_pulse_largest(s), reach = reach_s * s->rate_hz;

	for (size_t k = 0; k < s->count; k++)
		if (fabs((double)k - at) <= reach)
			sum += s->y[k];
	return sum * UNITS_G_M_S2 / s->rate_hz;
}

double reference_area_width(const struct reference_series *s)
{
	return M_PI_2 * sum_around(s, 0.75 * ten_percent(s)) / UNITS_G_M_S2 /
	       s->y[reference_pulse_largest(s)];
}

double reference_velocity(const struct reference_series *s, double contact_s)
{
	return sum_around(s, 3 * contact_s);
}

double reference_correlation(const struct reference_series *a, const struct reference_series *b)
{
	enum { SHIFTS_MAX = 512 };
	double sum[SHIFTS_MAX];
	size_t shifts = (size_t)(LAG_MAX_S * a->rate_hz), at = 0, until;

	if (shifts > SHIFTS_MAX)
		shifts = SHIFTS_MAX;
	until = a->count < b->count ? a->count : b->count;
	for (size_t d = 0; d < shifts; d++) {
		sum[d] = 0;
		for (size_t k = 0; k + d < until; k++)
			sum[d] += a->y[k] * b->y[k + d];
		if (sum[d] > sum[at])
			at = d;
	}
	return shifts > 0 ? top(sum, at, shifts, a->rate_hz).time_s : (double)NAN;
}
