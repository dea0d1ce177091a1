/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_METHOD_H
#define DT_HOST_CHART_METHOD_H
/*
 * The ways to a quantity that the charts compare: the product's own, through host/estimate, and those of
 * others (reference.h). A trial is one synthetic drop made ready for all of them.
 */
#include "host/chart/bound.h"
#include "host/chart/reference.h"
#include "host/estimate/estimate.h"

enum quantity {
	QUANTITY_PEAK,
	QUANTITY_PEAK_TIME,
	QUANTITY_RESULTANT,
	QUANTITY_PLATE_PEAK,
	QUANTITY_LAG,
	QUANTITY_FREQUENCY,
	QUANTITY_DAMPING,
	QUANTITY_CONTACT,
	QUANTITY_VELOCITY,
	QUANTITIES
};

struct quantity_text {
	const char *name;  /* of files: "peak-time" */
	const char *title; /* "Instant of one axis' peak" */
	const char *unit;  /* as shown */
	double shown;      /* times the SI value */
	double fails;      /* ratio from which a method counts as failing */
	bool of_plate;     /* it needs a plate on mounts */
};

const struct quantity_text *quantity_text(enum quantity quantity);

/* What estimate_record is told. */
enum telling { TELL_NOTHING, TELL_HALF_SINE, TELL_SINE_POWER, TELLINGS };

struct product; /* product.c: traces and what stands before each estimator */

struct trial {
	const struct synthetic *synthetic;
	struct synthetic_truth truth;
	struct reference_series series[SYNTHETIC_CHANNELS], decay; /* decay: S1 X from the contact's end */
	double *memory;
	struct analysis analysis[TELLINGS];
	struct product *product;
};

/* Of the synthetic's present drop; it must stay as long. DT_E_*. */
DT_MUST_USE int trial_open(struct trial *trial, const struct synthetic *synthetic);
void trial_close(struct trial *trial);

struct method {
	const char *name;
	enum quantity quantity;
	bool ours;
	bool told;    /* it is told the family, half-sine */
	size_t bound; /* offset in struct bound */
	double (*value)(const struct trial *trial);
	void (*work)(const struct trial *trial);                      /* its cost; NULL: value's */
	const struct estimate_how *(*how)(const struct trial *trial); /* NULL: it never doubts */
};

/* All of them, a quantity's in a row. */
const struct method *method_table(size_t *count);

double method_truth(const struct method *method, const struct trial *trial);
/* An error beyond this is gross. */
double method_gross(const struct method *method, const struct trial *trial);

#endif
