/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_ZERO_H
#define DT_HOST_ESTIMATE_ZERO_H
/*
 * Where a baseline puts zero, from two samples to the next two: offset, drift and hums, in g. A drift is
 * followed for two quiet parts of full length beyond its own; zero stays where it is from there on. No memory
 * but the caller's; the baseline is borrowed.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/phasor.h"
#include "host/estimate/trace.h"

/* The strongest has a place of its own in a baseline. */
enum { ZERO_HUMS_MAX = 1 + ESTIMATE_TONES_MAX };

struct zero {
	const struct estimate_baseline *baseline;
	struct phasor_pair hum[ZERO_HUMS_MAX];
	double hum_g[ZERO_HUMS_MAX];
	unsigned hums;
	PAIR after_s, reach_s; /* after the middle of the quiet part */
	double step_s;         /* to the next two samples */
};

/* Of a trace, from sample k on. */
struct zero zero_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k);

/* Zero of the next two samples. */
static inline PAIR zero_next(struct zero *w)
{
	PAIR zero = w->baseline->drift_g_s * pair_less(pair_more(w->after_s, -w->reach_s), w->reach_s) +
	            w->baseline->offset_g;

	w->after_s += w->step_s;
	for (unsigned i = 0; i < w->hums; i++) {
		zero += w->hum_g[i] * w->hum[i].cosine;
		phasor_pair_turn(&w->hum[i]);
	}
	return zero;
}

#endif
