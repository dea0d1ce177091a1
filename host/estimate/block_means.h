/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_BLOCK_MEANS_H
#define DT_HOST_ESTIMATE_BLOCK_MEANS_H
/*
 * A stretch of a trace as evenly spaced points, each the mean of a block of samples. The mean of a block of a
 * damped exponential is that exponential again, smaller, with the same pole: frequency and damping may be
 * fitted to means as to samples, in a fraction of the time. A point with an unusable sample in its block is
 * unusable, so blocks longer than one suit a stretch without holes.
 */
#include <stdbool.h>

#include "host/estimate/trace.h"

enum { BLOCK_MEANS_MAX = 2048 };

struct block_means {
	double first_s; /* time of point 0 after the instant asked for: its block's middle */
	double step_s;
	unsigned block; /* samples per point */
	unsigned count;
	unsigned used; /* good points */
	double value_g[BLOCK_MEANS_MAX];
	bool good[BLOCK_MEANS_MAX];
};

/* Samples [first, last) of the trace in blocks, times counted from from_s. The block grows as needed to
 * stay within BLOCK_MEANS_MAX points. */
void block_means_take(struct block_means *series, const struct trace *trace, size_t first, size_t last,
                      double from_s, unsigned block);

/* The same stretch with so many points in one, those that are whole. */
void block_means_thin(struct block_means *thin, const struct block_means *series, unsigned points);

/* Makes a series of single samples start more samples earlier, at sample first; what is known of the others
 * stays. False, and unchanged, when there is no room. */
bool block_means_lengthen(struct block_means *series, const struct trace *trace, size_t first, unsigned more);

/* Sum of squares of the good points about their mean: the residual of a fit that knows nothing. */
double block_means_squares(const struct block_means *series);

#endif
