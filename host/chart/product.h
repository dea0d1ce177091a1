/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_PRODUCT_H
#define DT_HOST_CHART_PRODUCT_H
/*
 * One call of each of the product's estimators on a drop whose traces stand ready, to be timed: what
 * estimate_record does for one quantity, without reading, cleaning and baseline, which all share.
 */
#include "host/estimate/estimate.h"

struct product;

/* NULL without memory. The record must stay as long. */
struct product *product_open(const struct record *record, double contact_end_s);
void product_close(struct product *product);

/* S1 X as a smooth curve has it. */
double product_plate_peak(struct product *product);

/* The results are thrown away: estimate_record's are the same. S2 X, or X and Y, or S1's. */
void product_peak(struct product *product, enum estimate_family family);
void product_pulse(struct product *product, enum estimate_family family);
void product_resultant(struct product *product);
void product_decay(struct product *product);
void product_decays(struct product *product);
void product_lag(struct product *product);

#endif
