/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/clean.h"

#include <math.h>

#include "host/estimate/clip.h"
#include "host/estimate/doubt.h"
#include "host/estimate/dropout.h"
#include "host/estimate/settle.h"
#include "host/estimate/spike.h"

/* Noise holds what rounding to coarse numbers makes. */
static void clean_baseline(struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	baseline_find(trace, scratch, baseline);
	trace->step_g = clip_resolution(trace, baseline->noise_g);
	baseline->noise_g = hypot(baseline->noise_g, trace->step_g / sqrt(12.0));
}

void clean_find(struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	struct settle settle = {0};
	bool marked;

	if (settle_find(trace, &settle))
		settle_remove(trace, &settle);
	clean_baseline(trace, scratch, baseline);
	marked = spike_mark(trace, baseline->noise_g > 0 ? baseline->noise_g : clip_step(trace) / sqrt(12.0));
	marked |= dropout_mark(trace, baseline->noise_g);
	if (marked) {
		trace_marked(trace);
		if (!baseline_holds(trace, baseline))
			clean_baseline(trace, scratch, baseline);
	}
	baseline->doubtful |= settle.extrapolated || settle.inexact;
	baseline->unsettled |= settle.inexact;
	clip_mark(trace, baseline->noise_g);
	doubt_plateau(trace, baseline->noise_g);
}
