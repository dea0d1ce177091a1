/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/filter.h"

#include <math.h>
#include <stdlib.h>

#include "common/units.h"

enum { SECTIONS = 2 };

/* (sqrt(2) - 1)^(-1/8): from the corner of two passes to that of one, both on the bilinear transform's
 * frequency axis, so that the whole has its corner where it was asked for at any rate. */
#define ONE_PASS_CORNER 1.1164697500474103

/* Corner over the sampling rate, from which on the filter has nothing to remove. */
#define CORNER_MAX 0.45

/* Reflected length in periods of the corner; the filter has forgotten its start by then. */
#define REFLECT_PERIODS 5.0

/* Second-order section, unity at zero frequency, transposed direct form II. */
struct section {
	double b, a1, a2; /* numerator b (1 + 2/z + 1/z^2) */
	double s1, s2;
};

static void design(struct section section[SECTIONS], double corner)
{
	double w = ONE_PASS_CORNER * tan(UNITS_PI * corner);

	for (unsigned i = 0; i < SECTIONS; i++) {
		/* Pole pairs at 67.5 and 22.5 degrees from the real axis. */
		double damping = 2 * cos(UNITS_PI * (1 + 2 * i) / (4 * SECTIONS));
		double scale = 1 / (1 + damping * w + w * w);

		section[i].b = w * w * scale;
		section[i].a1 = 2 * (w * w - 1) * scale;
		section[i].a2 = (1 - damping * w + w * w) * scale;
	}
}

static void settle(struct section section[SECTIONS], double value)
{
	for (unsigned i = 0; i < SECTIONS; i++) {
		section[i].s1 = value * (1 - section[i].b);
		section[i].s2 = value * (section[i].b - section[i].a2);
	}
}

static double step(struct section section[SECTIONS], double value)
{
	for (unsigned i = 0; i < SECTIONS; i++) {
		struct section *s = &section[i];
		double in = s->b * value, out = in + s->s1;

		s->s1 = 2 * in - s->a1 * out + s->s2;
		s->s2 = in - s->a2 * out;
		value = out;
	}
	return value;
}

/* Filters run[count] in place; padded holds count + 2 * reflect doubles. */
static void filter_run(struct section section[SECTIONS], double *run, size_t count, size_t reflect,
                       double *padded)
{
	size_t all;

	if (reflect > count - 1)
		reflect = count - 1;
	all = count + 2 * reflect;
	for (size_t i = 0; i < reflect; i++) {
		padded[i] = 2 * run[0] - run[reflect - i];
		padded[reflect + count + i] = 2 * run[count - 1] - run[count - 2 - i];
	}
	for (size_t i = 0; i < count; i++)
		padded[reflect + i] = run[i];
	settle(section, padded[0]);
	for (size_t i = 0; i < all; i++)
		padded[i] = step(section, padded[i]);
	settle(section, padded[all - 1]);
	for (size_t i = all; i-- > 0;)
		padded[i] = step(section, padded[i]);
	for (size_t i = 0; i < count; i++)
		run[i] = padded[reflect + i];
}

int filter_lowpass(struct trace *trace, double lowpass_hz)
{
	double corner = lowpass_hz / trace->rate_hz, periods;
	struct section section[SECTIONS];
	size_t reflect, from = 0;
	double *padded;

	if (!(corner < CORNER_MAX) || trace->count == 0)
		return 0;
	/* No run can be reflected further than its own length. */
	periods = fmin(ceil(REFLECT_PERIODS / corner), (double)trace->count);
	reflect = (size_t)periods;
	padded = malloc((trace->count + 2 * reflect) * sizeof(*padded));
	if (!padded)
		return DT_E_MEMORY;
	design(section, corner);
	for (size_t k = 0; k <= trace->count; k++) {
		if (k < trace->count && trace_good(trace, k))
			continue;
		if (k > from)
			filter_run(section, trace->value_g + from, k - from, reflect, padded);
		from = k + 1;
	}
	free(padded);
	return 0;
}
