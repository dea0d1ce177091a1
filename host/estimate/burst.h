/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_BURST_H
#define DT_HOST_ESTIMATE_BURST_H
/*
 * A pulse that noise hides from the eye: the stretch, of 8, 16, ... 128 samples, whose sum stands furthest
 * out of what noise sums to. Says where a contact was when no sample of it says so; no shape, no peak.
 */
#include "host/estimate/trace.h"

struct burst {
	double start_s, end_s;
	double sigmas; /* how far it stands out */
};

/* In the trace's event window; samples that are not good count as zero. False below LIMIT_SURE, or without
 * a noise to compare with. */
bool burst_find(const struct trace *trace, struct burst *burst);

#endif
