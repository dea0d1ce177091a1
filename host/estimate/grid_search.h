/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_GRID_SEARCH_H
#define DT_HOST_ESTIMATE_GRID_SEARCH_H
/*
 * A decay's frequency and damping to start a fit from, where noise or spikes hide its zero crossings: of a
 * grid of damped swings, the one that explains most of the samples by linear least squares, offset among the
 * unknowns. The grid's frequencies are close enough that the fit finds its way from the nearest. Octave by
 * octave on block means, so that it costs the same for any rate and length.
 */
#include "host/estimate/trace.h"

/* A decay is looked at over so many of its cycles. */
#define GRID_CYCLES 5.0

struct grid_search {
	double omega;   /* rad/s */
	double decay;   /* 1/s */
	double squares; /* explained by it, of the samples' sum of squares about their mean; g^2 */
};

/* The usable samples [first, last). False when nothing can be fitted. */
bool grid_search_find(struct grid_search *scan, const struct trace *trace, size_t first, size_t last);

/* Whether there is more in the samples than noise_g explains. */
bool grid_search_worth(const struct trace *trace, size_t first, size_t last, double noise_g);

#endif
