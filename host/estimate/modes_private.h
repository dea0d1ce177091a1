/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_MODES_PRIVATE_H
#define DT_HOST_ESTIMATE_MODES_PRIVATE_H
/*
 * What the parts of modes share.
 *   modes.c       the shapes, their fits, what a fit says
 *   modes_normal.c  normal equations of undisturbed decays
 */
#include "host/estimate/modes.h"

struct modes_problem {
	const struct modes *modes;
	const struct block_means *series;
};

/* Whether p is a swing. */
bool modes_possible(const struct modes *modes, const double *p);

/* lm_problem's normal, of a modes_problem: any number of modes, hum or none, no law. */
size_t modes_undisturbed(const void *context, double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                         double right[CHOLESKY_MAX], double *squares);

#endif
