/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SENSOR_BUDGET_SUM_H
#define DT_HOST_SENSOR_BUDGET_SUM_H
/*
 * One number's parts put together. Of the budget alone.
 */
#include <stdbool.h>

#include "host/sensor/budget.h"

struct budget_sum {
	double part[BUDGET_PARTS];
	struct coverage coverage; /* without noise */
	double degrees;           /* of the noise */
	bool unknown;             /* a part cannot be told: there is no budget */
};

const char *budget_part_name(enum budget_part part);

void budget_collect(struct budget_sum *sum, enum budget_part part, enum coverage_law law, double u);

/* Half of what is anywhere within +-half. */
void budget_within(struct budget_sum *sum, enum budget_part part, double half);

/* u, degrees of freedom, k and U of it. noise_name: what that part is called; in the distribution it counts
 * by student times its u. */
void budget_settle(struct budget_item *item, const struct budget_sum *sum, const char *noise_name,
                   double student);

#endif
