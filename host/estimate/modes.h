/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_MODES_H
#define DT_HOST_ESTIMATE_MODES_H
/*
 * Least squares of a free decay through a series, offset always among the unknowns (the sensor's high-pass
 * leaves one). Of the shapes below, each with one more trouble than the plain one:
 *
 *   plain      b + e^{-a t} (c cos w t + s sin w t)
 *   hum        the same + mains terms of a known frequency
 *   two modes  b + two such decays
 *   amplitude  the angle runs as w t + k h(t) instead of w t, because the frequency hangs on the swing
 *              A = A0 e^{-a t}: w + k (A / A0)^2, whose integral is h = (1 - e^{-2 a t}) / 2a; or the decay
 *              on a softening spring (spring.h). w is the frequency as the swing vanishes.
 *
 * By lm.h, the functions by recurrence. Two modes are searched for by their decays and frequencies alone, the
 * linear unknowns always being the best for these (variable projection): a third of the steps. One mode is
 * not, since a swing that is free to follow ends on a spike more often. Times in s from the series' zero,
 * values in g, w and k in rad/s.
 */
#include "host/estimate/block_means.h"
#include "host/estimate/lm.h"

/* Where the unknowns of a fit stand: offset, four of each mode, then the law's two or the hum's two. */
enum {
	MODES_OFFSET,
	MODES_DECAY, /* of the first mode; the second's are MODES_EACH further */
	MODES_OMEGA,
	MODES_COSINE,
	MODES_SINE,
	MODES_LAW, /* k; of a spring Q and D */
	MODES_EACH = 4,
};

/* No decay is damped more, as a ratio. */
#define MODES_DAMPING_MAX 0.95

enum modes_law {
	MODES_LAW_NONE,
	MODES_LAW_SQUARE, /* one unknown more */
	MODES_LAW_SPRING, /* two */
};

struct modes {
	unsigned count; /* 1, or 2 without a law */
	enum modes_law law;
	double hum_hz; /* 0: none; not with a law */
	double p[CHOLESKY_MAX];
	struct lm_result fit;
};

/* Unknowns of that shape. */
unsigned modes_size(const struct modes *modes);

/* Fills in the linear unknowns (offset, cosines, sines) for the nonlinear ones in p by linear least squares;
 * not with a law. False when the series does not determine them. */
bool modes_linear(struct modes *modes, const struct block_means *series);

/* Fits from p on. False when it does not converge; modes is then undefined. */
bool modes_fit(struct modes *modes, const struct block_means *series);

/* The model at time_s, what the series' points are compared with. */
double modes_at(const struct modes *modes, double time_s);

/* What the points of the series, good or not, lie off plain modes by, without a law or hum. */
void modes_residual(const struct modes *modes, const struct block_means *series, double *residual_g);

/* How far mode m, 0 or 1, swings where times begin, and which swings more. */
double modes_swing_g(const struct modes *modes, unsigned m);
unsigned modes_stronger(const struct modes *modes);

/* Mean damped frequency of a law's first cycles; a spring's in so many steps a cycle. */
double modes_mean_hz(const struct modes *modes, unsigned cycles, unsigned steps);

/* From block means, which a fit to them describes, to the samples themselves: each mode's cosine and sine. */
void modes_unblock(struct modes *modes, const struct block_means *series);

#endif
