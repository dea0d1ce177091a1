/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_BASELINE_H
#define DT_HOST_ESTIMATE_BASELINE_H
/*
 * Where zero is, how it moves and how much it trembles, from the quiet part before the largest pulse of the
 * trace's event window: the last 250 ms of it that end one rise time before the pulse leaves 10 %. A record
 * that starts inside its event has no quiet part: offset 0, samples 0, and the noise from second differences
 * over the whole trace (a smooth signal nearly vanishes in them). Noise NAN: too few samples even for that.
 *
 * Drift and hum are fitted to means of 2 ms and taken off (hum.h), where what is left then is as white as the
 * samples' noise asks: motion before the pulse is neither.
 *
 * Doubtful is a zero without a quiet part, and one whose quiet part holds more than all this: means that are
 * coloured still, or runs of samples far quieter than the whole. Of these the longest is then taken for the
 * quiet part. Flagged RECORD_FLAG_ZERO_UNSURE where there is one.
 *
 * Unsettled is a doubtful zero that decays to the end of the quiet part, is another in its last samples, or
 * of a record that begins on something else than the rise of its pulse: peak and pulse are ambiguous then.
 *
 * Outliers are what lies beyond six standard deviations: told at first from the median and the median
 * deviation of a few samples, then from those inside. Offset and noise are mean and deviation of all the
 * rest, which are nearly twice as certain as medians.
 *
 * The noise is that of the samples as read. A low-pass comes later and hides noise from the eye, not
 * from an estimator whose own bandwidth is lower still.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

/* scratch holds trace->count doubles. */
void baseline_find(const struct trace *trace, double *scratch, struct estimate_baseline *baseline);

/* Whether a baseline that was found before samples were marked spikes or bad would come out as it did: the
 * quiet part is the same and none of it is marked. */
bool baseline_holds(const struct trace *trace, const struct estimate_baseline *baseline);

/* Takes offset, drift and hum off every sample (zero.h), flags them, and notes noise and the hum's frequency
 * in the trace. */
void baseline_remove(struct trace *trace, const struct estimate_baseline *baseline);

#endif
