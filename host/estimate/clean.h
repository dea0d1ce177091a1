/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CLEAN_H
#define DT_HOST_ESTIMATE_CLEAN_H
/*
 * What is wrong with single samples, and where zero is without them: a settling supply taken off, spikes,
 * zeroed runs and equal extremes marked, the baseline found. Whoever needs a channel's zero takes it from
 * here, so that one channel has one.
 */
#include "host/estimate/baseline.h"

/* scratch holds trace->count doubles. The baseline is found, not taken off (baseline_remove). */
void clean_find(struct trace *trace, double *scratch, struct estimate_baseline *baseline);

#endif
