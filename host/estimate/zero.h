/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_ZERO_H
#define DT_HOST_ESTIMATE_ZERO_H
/*
 * Where a baseline puts zero, from one sample to the next: offset, drift and hums, in g. A drift is followed
 * for DRIFT_REACH_S beyond the quiet part; zero stays where it is from there on. No memory but the caller's;
 * the baseline is borrowed.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/phasor.h"
#include "host/estimate/trace.h"

/* As far as a drift is believed. */
#define DRIFT_REACH_S 0.5

/* The strongest has a place of its own in a baseline. */
enum { ZERO_HUMS_MAX = 1 + ESTIMATE_TONES_MAX };

struct zero {
	const struct estimate_baseline *baseline;
	struct phasor hum[ZERO_HUMS_MAX];
	double hum_g[ZERO_HUMS_MAX];
	unsigned hums;
	double middle_s, reach_s, time_s, step_s;
};

/* Of a trace, from sample k on. */
struct zero zero_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k);

/* Zero of the next sample. */
static inline double zero_next(struct zero *w)
{
	double u = w->time_s - w->middle_s, zero = w->baseline->offset_g;

	u = u < -w->reach_s ? -w->reach_s : u;
	u = u > w->reach_s ? w->reach_s : u;
	w->time_s += w->step_s;
	for (unsigned i = 0; i < w->hums; i++) {
		zero += w->hum_g[i] * w->hum[i].cosine;
		phasor_turn(&w->hum[i]);
	}
	return zero + w->baseline->drift_g_s * u;
}

#endif
