/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/sensor/lowpass.h"

#include <complex.h>
#include <math.h>

#include "common/units.h"

enum { BISECTIONS = 60 };

/* Reverse Bessel polynomial over its value at 0: one over the response, whose delay at zero is 1 s. */
static double bessel_magnitude(unsigned order, double w)
{
	double complex before = 1.0, now = 1.0 + w * _Complex_I;
	double at_zero = 1.0;

	for (unsigned n = 2; n <= order; n++) {
		double complex next = (2.0 * n - 1.0) * now - w * w * before;
		double next_at_zero = (2.0 * n - 1.0) * at_zero;

		before = now;
		now = next;
		at_zero = next_at_zero;
	}
	return at_zero / cabs(now);
}

/* Where that is -3 dB. */
static double bessel_corner(unsigned order)
{
	double low = 0.0, high = 10.0;

	for (int i = 0; i < BISECTIONS; i++) {
		double middle = 0.5 * (low + high);

		*(bessel_magnitude(order, middle) > sqrt(0.5) ? &low : &high) = middle;
	}
	return low;
}

double lowpass_delay_s(enum transducer_filter filter, unsigned order, double cutoff_hz)
{
	double w = 2.0 * UNITS_PI * cutoff_hz;

	if (filter == TRANSDUCER_NO_FILTER)
		return 0.0;
	return filter == TRANSDUCER_BESSEL ? bessel_corner(order) / w
	                                   : 1.0 / (sin(UNITS_PI / (2.0 * order)) * w);
}

#define PERIODS_MANY 5.0
#define PERIODS_LEAST 3.0
#define ANOTHER_PULSE 0.2

double lowpass_peak_share(double periods)
{
	if (periods >= PERIODS_MANY)
		return 0.0035;
	return periods >= PERIODS_LEAST ? 0.009 : ANOTHER_PULSE;
}

double lowpass_width_share(double periods)
{
	if (periods >= PERIODS_MANY)
		return 0.0045;
	return periods >= PERIODS_LEAST ? 0.018 : ANOTHER_PULSE;
}
