/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/outlier.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/median.h"

enum { NEIGHBOURS = 7, LEAST = 16 };

/* The values about value i, itself among them. */
static const double *neighbours(const double *value, size_t count, size_t i)
{
	size_t first = i > NEIGHBOURS / 2 ? i - NEIGHBOURS / 2 : 0;

	return value + (first + NEIGHBOURS > count ? count - NEIGHBOURS : first);
}

/* Whether value i lies within limit of the median of its neighbours. */
static bool is_near(const double *value, size_t count, size_t i, double limit)
{
	const double *about = neighbours(value, count, i);
	double sorted[NEIGHBOURS];
	unsigned loud = 0;

	for (unsigned k = 0; k < NEIGHBOURS; k++) {
		sorted[k] = about[k];
		loud += fabs(about[k]) > limit / 2;
	}
	/* Hardly ever is there anything to sort. */
	return loud == 0 || fabs(value[i] - median_find(sorted, NEIGHBOURS)) <= limit;
}

unsigned outlier_drop(struct series *series, const struct modes *modes, const bool *usable)
{
	double residual[SERIES_MAX], sorted[SERIES_MAX], limit;
	size_t count = 0, i = 0;

	modes_residual(modes, series, residual);
	for (unsigned k = 0; k < series->count; k++) {
		residual[count] = residual[k];
		count += usable[k];
	}
	if (count < LEAST)
		return 0;
	for (size_t k = 0; k < count; k++)
		sorted[k] = fabs(residual[k]);
	limit = LIMIT_SIGNIFICANT * MAD_TO_SIGMA * median_find(sorted, count);
	series->used = 0;
	for (unsigned k = 0; k < series->count; k++) {
		series->good[k] = usable[k] && is_near(residual, count, i, limit);
		series->used += series->good[k];
		i += usable[k];
	}
	return (unsigned)count - series->used;
}
