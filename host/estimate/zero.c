/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/zero.h"

#include "common/units.h"
#include "host/estimate/quiet.h"

static void turn_with(struct zero *w, double hum_g, double hum_hz, double phase)
{
	double turns = 2 * UNITS_PI * hum_hz, after_s = w->after_s[0];

	w->hum_g[w->hums] = hum_g;
	w->hum[w->hums++] = phasor_two(phasor_at(turns * after_s + phase, turns * w->step_s / 2));
}

struct zero zero_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k)
{
	double reach_s = (baseline->until_s - baseline->from_s) / 2 + 2 * QUIET_S;
	double after_s = trace_time(trace, k) - (baseline->from_s + baseline->until_s) / 2;
	struct zero w = {.baseline = baseline,
	                 .after_s = {after_s, after_s + 1 / trace->rate_hz},
	                 .reach_s = {reach_s, reach_s},
	                 .step_s = 2 / trace->rate_hz};

	if (baseline->hum_g > 0)
		turn_with(&w, baseline->hum_g, baseline->hum_hz, baseline->hum_phase);
	for (unsigned i = 0; i < baseline->tones; i++)
		turn_with(&w, baseline->tone[i].amplitude_g, baseline->tone[i].hz, baseline->tone[i].phase);
	return w;
}
