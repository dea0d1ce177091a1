/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/contact.h"

#include <math.h>

/* Where the signal, followed from its peak in steps of step, falls to level; samples after the peak. */
static double crossing(const double value[], size_t count, size_t peak, int step, double level)
{
	size_t k = peak;

	while (k > 0 && k + 1 < count && value[k] >= level)
		k = step > 0 ? k + 1 : k - 1;
	if (!(value[k] < level))
		return NAN;
	return (double)k - (double)step * (level - value[k]) / (value[step > 0 ? k - 1 : k + 1] - value[k]);
}

/* The sensor's high-pass undone and zero taken off, both by the 20 ms before the pulse. */
static size_t contact_restore(const struct channel *channel, double tau_s, double at_s, double value[],
                              size_t room)
{
	size_t first = (size_t)fmax(0.0, (at_s - 0.022) * channel->rate_hz),
	       quiet = (size_t)(0.020 * channel->rate_hz);
	size_t count = 0;
	double zero = 0.0, sum = 0.0;

	if (first + quiet + room / 4 > channel->count)
		return 0;
	for (size_t k = 0; k < quiet; k++)
		zero += channel->value_g[first + k] / (double)quiet;
	for (; count < room && first + count < channel->count; count++) {
		double v = channel->value_g[first + count] - zero;

		if (!isfinite(v))
			return 0;
		sum += v / channel->rate_hz;
		value[count] = v + sum / tau_s;
	}
	return count;
}

double contact_time(const struct record *record, double tau_s, double at_s)
{
	enum { ROOM = 500 };
	const struct channel *channel = record_channel(record, "S1X");
	double value[ROOM];
	size_t count = channel != NULL ? contact_restore(channel, tau_s, at_s, value, ROOM) : 0, peak = 0;
	double level;

	for (size_t k = 1; k < count; k++)
		if (value[k] > value[peak])
			peak = k;
	if (count == 0)
		return NAN;
	level = 0.01 * value[peak];
	return (crossing(value, count, peak, 1, level) - crossing(value, count, peak, -1, level)) /
	       channel->rate_hz;
}
