/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/iepe.h"

void iepe_undo(struct trace *trace, double from_s, double time_constant_s)
{
	double tau = trace->highpass_s > 0 ? trace->highpass_s : time_constant_s;
	double part = 1 / (2 * tau * trace->rate_hz), integral = 0, before = 0;
	size_t at = trace_index(trace, from_s);

	for (size_t k = at; k < trace->count; k++) {
		double value = trace->value_g[k];

		if (!trace_good(trace, k))
			continue;
		integral += (before + value) * part * (double)(k - at);
		before = value;
		at = k;
		trace->value_g[k] += integral;
	}
	trace_changed(trace);
}
