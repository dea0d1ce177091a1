/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_UNCERTAINTY_H
#define DT_HOST_RESULT_UNCERTAINTY_H
/*
 * Numbers with their expanded uncertainties, as a table for people: value, U, k, unit, the three largest
 * parts.
 */
#include "host/base/table.h"
#include "host/sensor/budget.h"

/* What it is of goes by each item's name; seconds are shown in ms. 0 or DT_E_MEMORY. */
int uncertainty_table(const struct budget_item *item, size_t count, enum table_format format, FILE *out);

#endif
