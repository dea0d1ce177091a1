/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_MEDIAN_H
#define DT_HOST_ESTIMATE_MEDIAN_H
/*
 * The middle of n > 0 numbers, none of them NAN, exactly: the mean of the two middle ones when n is even. In
 * order n steps as a rule; value is left in another order.
 */
#include <stddef.h>

double median_find(double *value, size_t n);

#endif
