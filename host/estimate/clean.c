/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/clean.h"

#include "host/estimate/clip.h"
#include "host/estimate/doubt.h"
#include "host/estimate/dropout.h"
#include "host/estimate/settle.h"
#include "host/estimate/spike.h"

void clean_find(struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	struct settle settle = {0};
	bool marked;

	if (settle_find(trace, &settle))
		settle_remove(trace, &settle);
	baseline_find(trace, scratch, baseline);
	marked = spike_mark(trace, baseline->noise_g);
	marked |= dropout_mark(trace, baseline->noise_g);
	if (marked) {
		trace_marked(trace);
		if (!baseline_holds(trace, baseline))
			baseline_find(trace, scratch, baseline);
	}
	baseline->doubtful |= settle.extrapolated || settle.inexact;
	baseline->unsettled |= settle.inexact;
	clip_judge_twins(trace, baseline->noise_g);
	doubt_plateau(trace, baseline->noise_g);
}
