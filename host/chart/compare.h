/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_COMPARE_H
#define DT_HOST_CHART_COMPARE_H
/*
 * A campaign of every method of method.h. Its figures repeat with the seed; times do not: the least of
 * several calls, median over drops.
 */
#include "host/chart/campaign.h"
#include "host/chart/method.h"

enum { COMPARE_METHODS_MAX = 64, COMPARE_TIMED = 25 };

struct compare_cell {
	struct synthetic_scene scene;
	struct tally tally[COMPARE_METHODS_MAX]; /* as method_table */
	double cost_us[COMPARE_METHODS_MAX];     /* NAN unless timed */
	double drop_us[COMPARE_METHODS_MAX][COMPARE_TIMED];
};

struct compare {
	unsigned drops;
	bool timed;
	struct compare_cell *cells; /* [count], from compare_cells */
	size_t count;
};

/* Room for count cells, all zero; NULL without memory. */
struct compare_cell *compare_cells(size_t count);
void compare_free(struct compare_cell *cells, size_t count);

/* As campaign_run, or what a scene's bound or analysis returned. */
DT_MUST_USE int compare_run(struct compare *compare);

/* Drops without a value, or with one far off. */
unsigned compare_gross(const struct compare *compare, const struct tally *tally);

#endif
