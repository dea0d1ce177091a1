/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_DROPOUT_H
#define DT_HOST_ESTIMATE_DROPOUT_H
/*
 * Samples that were set to zero or held on their way. A run of three or more exact zeros between two readings
 * that both stand far off zero, in a signal that has noise (in numbers coarser than it: that do not lead to
 * zero): marked SAMPLE_BAD, and the trace RECORD_FLAG_ZEROED. A run of one value that stands off, where
 * samples tremble by so many steps of their numbers that chance makes none: marked but for its first, which
 * was read, and the trace RECORD_FLAG_STUCK. Not where it is higher than what is beside it: that is a limit
 * (clip.h). Where samples are repeated all along, as those of a slower sensor are, nothing is left out and
 * the trace is flagged: edges and peaks are late by part of what each is held. Before baseline_remove, which
 * moves zero. One or two zeros are a spike (spike.h).
 */
#include "host/estimate/trace.h"

/* True when something was marked. Nothing is where the noise is not known or none. */
bool dropout_mark(struct trace *trace, double noise_g);

#endif
