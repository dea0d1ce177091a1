/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/outlier.h"

#include <math.h>
#include <string.h>

#include "host/estimate/limits.h"
#include "host/estimate/median.h"

enum { NEIGHBOURS = 7, LEAST = 16 };

/* Where the values about value i begin, itself among them. */
static size_t neighbours(size_t count, size_t i)
{
	size_t first = i > NEIGHBOURS / 2 ? i - NEIGHBOURS / 2 : 0;

	return first + NEIGHBOURS > count ? count - NEIGHBOURS : first;
}

/* The first value from there on that lies beyond limit. */
static size_t next_loud(const double *value, size_t count, size_t from, double limit)
{
	while (from < count && !(fabs(value[from]) > limit))
		from++;
	return from;
}

/* Whether value i lies within limit of the median of its neighbours, which begin at about. */
static bool is_near(const double *value, size_t i, const double *about, double limit)
{
	double sorted[NEIGHBOURS];

	memcpy(sorted, about, sizeof(sorted));
	return fabs(value[i] - median_find(sorted, NEIGHBOURS)) <= limit;
}

unsigned outlier_drop(struct block_means *series, const struct modes *modes, const bool *usable)
{
	double residual[BLOCK_MEANS_MAX], sorted[BLOCK_MEANS_MAX], limit;
	size_t count = 0, i = 0, loud;

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
	/* Hardly ever is there anything to sort: where all neighbours lie within half the limit, all are
	 * near. */
	loud = next_loud(residual, count, 0, limit / 2);
	series->used = 0;
	for (unsigned k = 0; k < series->count; k++) {
		const size_t about = neighbours(count, i);

		if (loud < about)
			loud = next_loud(residual, count, about, limit / 2);
		series->good[k] = usable[k] && (loud >= about + NEIGHBOURS ||
		                                is_near(residual, i, residual + about, limit));
		series->used += series->good[k];
		i += usable[k];
	}
	return (unsigned)count - series->used;
}
