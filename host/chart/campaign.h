/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_CAMPAIGN_H
#define DT_HOST_CHART_CAMPAIGN_H
/*
 * Monte Carlo: many drops of each scene through every method. One process for each processor; a scene is one
 * process' business, so that its figures depend on the seed only. Times do not: the least of several calls,
 * median over drops.
 */
#include "host/chart/method.h"

enum { CAMPAIGN_METHODS_MAX = 64 };

struct campaign_tally {
	double bound;
	unsigned values, gross; /* gross: no value, or far off */
	unsigned doubted;       /* the method itself flagged it */
	double error, square;
	double cost_us; /* NAN unless timed */
};

struct campaign_cell {
	struct synthetic_scene scene;
	struct campaign_tally tally[CAMPAIGN_METHODS_MAX]; /* as method_table */
};

struct campaign {
	unsigned drops;
	unsigned long seed;
	bool timed;
	struct campaign_cell *cells; /* [count], in memory that campaign_cells gave */
	size_t count;
};

/* Room for count cells, all zero; NULL without memory. */
struct campaign_cell *campaign_cells(size_t count);
void campaign_free(struct campaign_cell *cells, size_t count);

/* DT_E_MEMORY, DT_E_SYSTEM when a process died, or what a scene's bound or analysis returned. */
DT_MUST_USE int campaign_run(struct campaign *campaign);

double campaign_bias(const struct campaign_tally *tally);
double campaign_rms(const struct campaign_tally *tally);
double campaign_ratio(const struct campaign_tally *tally);

#endif
