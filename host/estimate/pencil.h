/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PENCIL_H
#define DT_HOST_ESTIMATE_PENCIL_H
/*
 * Two modes to start a fit from: the poles of two decays and an offset in a series, by the matrix pencil
 * (Hua and Sarkar 1990) in its subspace form. The leading eigenvectors of the covariance of overlapping
 * stretches span what the poles span; one step along turns that space into itself, and the eigenvalues of
 * the turn are the poles. Eigenvalues by GSL, which takes memory for them.
 */
#include <stdbool.h>

struct pencil_pole {
	double omega; /* rad/s, > 0 */
	double decay; /* 1/s */
};

/* count values step_s apart, none missing. False unless they hold two swinging poles. */
bool pencil_find(struct pencil_pole pole[2], const double *value, unsigned count, double step_s);

#endif
