/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/burst.h"

#include <math.h>

#include "host/estimate/limits.h"

enum { SHORTEST = 8, LONGEST = 128 };

static double burst_value_of(const struct trace *trace, size_t k)
{
	return trace_good(trace, k) ? trace->value_g[k] : 0;
}

bool burst_find(const struct trace *trace, struct burst *burst)
{
	struct burst best = {.sigmas = 0};

	for (size_t width = SHORTEST; width <= LONGEST; width *= 2) {
		const double unit = trace->noise_g * sqrt((double)width);
		double sum = 0;

		for (size_t k = trace->first; k < trace->last; k++) {
			sum += burst_value_of(trace, k);
			if (k < trace->first + width)
				continue;
			sum -= burst_value_of(trace, k - width);
			if (fabs(sum) > best.sigmas * unit)
				best = (struct burst){trace_time(trace, k + 1 - width),
				                      trace_time(trace, k + 1), fabs(sum) / unit};
		}
	}
	/* Without a noise the unit is no number, or the excess none. */
	if (!(best.sigmas >= LIMIT_SURE) || isinf(best.sigmas))
		return false;
	*burst = best;
	return true;
}
