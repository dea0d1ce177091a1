/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/filter.h"

#include <math.h>
#include <stdlib.h>

#include "common/units.h"

enum { SECTIONS = 2 };

/* Reflected length in periods of the corner; the filter has forgotten its start by then. */
#define REFLECT_PERIODS 5.0

struct filter_section filter_section(double corner, double damping)
{
	double w = tan(UNITS_PI * corner), scale = 1 / (1 + damping * w + w * w);

	return (struct filter_section){
	        .b = w * w * scale, .a1 = 2 * (w * w - 1) * scale, .a2 = (1 - damping * w + w * w) * scale};
}

static void filter_settle(struct filter_section *section, size_t sections, double value)
{
	for (size_t i = 0; i < sections; i++) {
		section[i].s1 = value * (1 - section[i].b);
		section[i].s2 = value * (section[i].b - section[i].a2);
	}
}

static double filter_step(struct filter_section *section, size_t sections, double value)
{
	for (size_t i = 0; i < sections; i++) {
		struct filter_section *s = &section[i];
		double in = s->b * value, out = in + s->s1;

		s->s1 = 2 * in - s->a1 * out + s->s2;
		s->s2 = in - s->a2 * out;
		value = out;
	}
	return value;
}

/* Filters run[count] in place; padded holds count + 2 * reflect doubles. */
static void filter_run(struct filter_section *section, size_t sections, double *run, size_t count,
                       size_t reflect, double *padded)
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
	filter_settle(section, sections, padded[0]);
	for (size_t i = 0; i < all; i++)
		padded[i] = filter_step(section, sections, padded[i]);
	filter_settle(section, sections, padded[all - 1]);
	for (size_t i = all; i-- > 0;)
		padded[i] = filter_step(section, sections, padded[i]);
	for (size_t i = 0; i < count; i++)
		run[i] = padded[reflect + i];
}

int filter_two_pass(struct trace *trace, struct filter_section *section, size_t sections, double corner)
{
	/* No run can be reflected further than its own length. */
	size_t reflect = (size_t)fmin(ceil(REFLECT_PERIODS / corner), (double)trace->count), from = 0;
	double *padded = malloc((trace->count + 2 * reflect + 1) * sizeof(*padded));

	if (!padded)
		return DT_E_MEMORY;
	for (size_t k = 0; k <= trace->count; k++) {
		if (k < trace->count && trace_good(trace, k))
			continue;
		if (k > from)
			filter_run(section, sections, trace->value_g + from, k - from, reflect, padded);
		from = k + 1;
	}
	free(padded);
	trace_changed(trace);
	return 0;
}

int filter_lowpass(struct trace *trace, double lowpass_hz)
{
	double corner = lowpass_hz / trace->rate_hz;
	struct filter_section section[SECTIONS];
	double one_pass;

	if (!(corner < FILTER_CORNER_MAX)) {
		trace->flags |= RECORD_FLAG_UNFILTERED;
		return 0;
	}
	if (trace->count == 0)
		return 0;
	/* From the corner of two passes to that of one, both on the bilinear transform's frequency axis, so
	 * that the whole has its corner where it was asked for at any rate. */
	one_pass = atan(pow(sqrt(2.0) - 1, -1.0 / 8) * tan(UNITS_PI * corner)) / UNITS_PI;
	/* Pole pairs at 67.5 and 22.5 degrees from the real axis. */
	for (unsigned i = 0; i < SECTIONS; i++)
		section[i] = filter_section(one_pass, 2 * cos(UNITS_PI * (1 + 2 * i) / (4 * SECTIONS)));
	return filter_two_pass(trace, section, SECTIONS, corner);
}
