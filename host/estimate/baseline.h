/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_BASELINE_H
#define DT_HOST_ESTIMATE_BASELINE_H
/*
 * Where zero is and how much it trembles, from the quiet part before the largest pulse of the trace's
 * event window: the last 250 ms of it that end one rise time before the pulse leaves 10 %. A record that
 * starts inside its event has no quiet part: offset 0, samples 0, and the noise from second differences
 * over the whole trace (a smooth signal nearly vanishes in them). Noise NAN: too few samples even for that.
 *
 * The noise is that of the samples as read. A low-pass comes later and hides noise from the eye, not
 * from an estimator whose own bandwidth is lower still.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

/* scratch holds 2 * trace->count doubles. */
void baseline_find(const struct trace *trace, double *scratch, struct estimate_baseline *baseline);

/* Takes the offset off every sample and notes the noise in the trace. */
void baseline_remove(struct trace *trace, const struct estimate_baseline *baseline);

#endif
