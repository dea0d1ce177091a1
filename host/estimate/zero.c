/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/zero.h"

#include "common/units.h"

static void turn_with(struct zero *w, double hum_g, double hum_hz, double phase)
{
	double turns = 2 * UNITS_PI * hum_hz;

	w->hum_g[w->hums] = hum_g;
	w->hum[w->hums++] = phasor_at(turns * (w->time_s - w->middle_s) + phase, turns * w->step_s);
}

struct zero zero_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k)
{
	struct zero w = {.baseline = baseline,
	                 .middle_s = (baseline->from_s + baseline->until_s) / 2,
	                 .reach_s = (baseline->until_s - baseline->from_s) / 2 + DRIFT_REACH_S,
	                 .time_s = trace_time(trace, k),
	                 .step_s = 1 / trace->rate_hz};

	if (baseline->hum_g > 0)
		turn_with(&w, baseline->hum_g, baseline->hum_hz, baseline->hum_phase);
	for (unsigned i = 0; i < baseline->tones; i++)
		turn_with(&w, baseline->tone[i].amplitude_g, baseline->tone[i].hz, baseline->tone[i].phase);
	return w;
}
