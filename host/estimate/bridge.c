/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/bridge.h"

double bridge_hole(const struct trace *trace, ptrdiff_t k)
{
	ptrdiff_t before = k, after = k, count = (ptrdiff_t)trace->count;

	if (k < 0 || k >= count)
		return 0;
	while (before >= 0 && k - before <= BRIDGE_MAX && !trace_good(trace, (size_t)before))
		before--;
	while (after < count && after - k <= BRIDGE_MAX && !trace_good(trace, (size_t)after))
		after++;
	if (before < 0 || after >= count || after - before > BRIDGE_MAX)
		return 0;
	return trace->value_g[before] + (trace->value_g[after] - trace->value_g[before]) *
	                                        (double)(k - before) / (double)(after - before);
}
