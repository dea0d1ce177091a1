/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/interpolate.h"

static bool is_good(const struct trace *trace, size_t k)
{
	return k < trace->count && trace_good(trace, k);
}

/* The cubic through the samples from - 2, from - 1, until and until + 1 (Lagrange). */
static double cubic(const struct trace *trace, size_t from, size_t until, size_t k)
{
	const double length = (double)(until - from), x = (double)k - (double)from;
	const double place[4] = {-2, -1, length, length + 1};
	const double node[4] = {trace->value_g[from - 2], trace->value_g[from - 1], trace->value_g[until],
	                        trace->value_g[until + 1]};
	double sum = 0;

	for (unsigned i = 0; i < 4; i++) {
		double weight = 1;

		for (unsigned j = 0; j < 4; j++)
			if (j != i)
				weight *= (x - place[j]) / (place[i] - place[j]);
		sum += weight * node[i];
	}
	return sum;
}

double interpolate_over(const struct trace *trace, size_t from, size_t until, size_t k)
{
	const double before = trace->value_g[from - 1], after = trace->value_g[until];

	if (until - from <= INTERPOLATE_CUBIC && from >= 2 && is_good(trace, from - 2) &&
	    is_good(trace, until + 1))
		return cubic(trace, from, until, k);
	return before + (after - before) * (double)(k - from + 1) / (double)(until - from + 1);
}

double interpolate_hole(const struct trace *trace, ptrdiff_t k)
{
	ptrdiff_t before = k, after = k, count = (ptrdiff_t)trace->count;

	if (k < 0 || k >= count)
		return 0;
	while (before >= 0 && k - before <= INTERPOLATE_MAX && !trace_good(trace, (size_t)before))
		before--;
	while (after < count && after - k <= INTERPOLATE_MAX && !trace_good(trace, (size_t)after))
		after++;
	if (before < 0 || after >= count || after - before > INTERPOLATE_MAX)
		return 0;
	return interpolate_over(trace, (size_t)before + 1, (size_t)after, (size_t)k);
}
