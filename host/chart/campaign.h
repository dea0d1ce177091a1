/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_CAMPAIGN_H
#define DT_HOST_CHART_CAMPAIGN_H
/*
 * Monte Carlo: many drops of each of many scenes, and what becomes of an estimate over them; the one trial
 * runner of `droptower chart` and of tests/accuracy. One process for each processor; a scene is
 * one process' business, so that its figures depend on its seed only.
 */
#include "host/chart/bound.h"

/* Of one estimate in one scene. */
struct tally {
	double bound; /* NAN: none is stated */
	double error, square;
	unsigned values, gross; /* drops with a value; with one far off */
	unsigned covered;       /* within two of the reported standard uncertainties */
	unsigned doubted;       /* the method itself flagged it */
};

/* value NAN: there is none; sigma NAN: none is reported. An error beyond gross is one. */
void tally_add(struct tally *tally, double value, double truth, double sigma, double gross);

double tally_bias(const struct tally *tally);
double tally_rms(const struct tally *tally);
double tally_ratio(const struct tally *tally); /* of error to bound */

struct campaign {
	size_t count; /* of scenes */
	unsigned drops;
	void *context; /* what the calls below keep must lie in memory of campaign_memory */
	const struct synthetic_scene *(*scene)(void *context, size_t i);
	int (*begin)(void *context, size_t i, struct synthetic *synthetic);
	int (*drop)(void *context, size_t i, const struct synthetic *synthetic, unsigned drop);
};

/* Zero, and shared by all processes; NULL without memory. */
void *campaign_memory(size_t bytes);
void campaign_free(void *memory, size_t bytes);

/* begin, then every drop, of each scene. DT_E_MEMORY, DT_E_SYSTEM when a process died, or what a call
 * returned. */
DT_MUST_USE int campaign_run(const struct campaign *campaign);

#endif
