/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_DROPOUT_H
#define DT_HOST_ESTIMATE_DROPOUT_H
/*
 * Samples that were set to zero on their way: a run of three or more exact zeros between two readings that
 * both stand far off zero, in a signal that has noise. Marked SAMPLE_BAD, and the trace RECORD_FLAG_ZEROED.
 * Before baseline_remove, which moves zero. One or two zeros are a spike (spike.h).
 */
#include "host/estimate/trace.h"

/* True when something was marked. Nothing is where the noise is not known or none. */
bool dropout_mark(struct trace *trace, double noise_g);

#endif
