/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SENSOR_BUDGET_H
#define DT_HOST_SENSOR_BUDGET_H
/*
 * The uncertainty of each reported number by its parts (GUM), for the channels whose sensors have files.
 * Noise is what the estimate says of itself; the rest follows from the sensor's file and the value's
 * measurement equation:
 *
 *     peak         gain 1:1; what it reads of the other axes, as they stand at its instant; zero 1:1
 *     resultant    the axes' parts, those of one sensor correlated
 *     instant      filter, skew, clock; the supply
 *     lag          both sensors' filters and skews; the clock cancels
 *     width        zero over the slopes at its ends; what it reads of the other axes there
 *     velocity     gain 1:1; zero over the pulse; the supply
 *     frequency    clock; where it follows the swing, how far its definitions are apart
 *     damping      nothing more: gain cancels, a linear filter moves no pole
 *     rebound      as the velocity change, or the clock
 *     motion       what the fitted body leaves unexplained; filters, skews and clock of what is a time
 *
 * U covers 95.45 %: k u with Student's k of the effective degrees of freedom, or, where more than 30 % of the
 * variance is not normal, by the distribution of the sum (coverage.h).
 */
#include "host/estimate/estimate.h"
#include "host/sensor/coverage.h"
#include "host/sensor/sensors.h"

enum budget_part {
	BUDGET_NOISE,
	BUDGET_DEFINITION,
	BUDGET_SENSITIVITY, /* certificate, drift since, temperature, electronics */
	BUDGET_TRANSVERSE,
	BUDGET_LINEARITY,
	BUDGET_RESPONSE,
	BUDGET_ZERO,
	BUDGET_FILTER, /* low-pass and high-pass, skew */
	BUDGET_CLOCK,
	BUDGET_MOUNTING, /* and alignment */
	BUDGET_PARTS
};

struct budget_item {
	char what[80]; /* "S2X.peak.value_g" */
	const char *unit;
	double value;
	double part[BUDGET_PARTS]; /* standard uncertainties; u: of all */
	double u, degrees, k, expanded;
	const char *method; /* "linear" or "distribution" */
	char largest[96];   /* "transverse 68 %, sensitivity 16 %, linearity 5 %" */
	const char *largest_parts;
};

struct budget {
	size_t count, room;
	struct budget_item *item;
};

/* record: as corrected, with its analysis. 0 or DT_E_MEMORY; to be freed. */
DT_MUST_USE int budget_make(struct budget *budget, const struct sensors *sensors, const struct record *record,
                            const struct analysis *analysis);
void budget_free(struct budget *budget);

/* A number of several drops under one calibration: scatter becomes less with their number, and what they have
 * in common does not. That cancels in differences between them, in their standard deviation and in a trend.
 */
struct budget_mean {
	size_t count;
	double part[BUDGET_PARTS], expanded; /* sums */
	double noise;                        /* of the last one */
	bool distribution;                   /* U of one of them is by the distribution */
};
void budget_mean_add(struct budget_mean *mean, const struct budget_item *item);

/* sd: of a single drop. BUDGET_NOISE is the scatter's part then; of one drop its noise. */
void budget_mean_item(const struct budget_mean *mean, double value, double sd, struct budget_item *item);

/* NULL: that number has none. */
const struct budget_item *budget_find(const struct budget *budget, const char *what);

#endif
