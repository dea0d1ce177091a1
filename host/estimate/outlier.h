/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_OUTLIER_H
#define DT_HOST_ESTIMATE_OUTLIER_H
/*
 * Single samples that no decay explains. A point is left out when its residual lies further than
 * LIMIT_SIGNIFICANT from the median of its neighbours' residuals, in the standard deviation that the median
 * of all residuals' magnitudes gives. Neighbours, because the residual of a model that is wrong is smooth: it
 * must not be taken for spikes, or the fit would leave out what refutes it.
 */
#include "host/estimate/modes.h"

/* Modes without a law or hum. Of the usable points of the series, [series->count], makes the outliers not
 * good and all others good again; returns how many are out. */
unsigned outlier_drop(struct block_means *series, const struct modes *modes, const bool *usable);

#endif
