/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_MEDIAN_H
#define DT_HOST_ESTIMATE_MEDIAN_H
/*
 * The middle of n > 0 numbers, none of them NAN, exactly: the mean of the two middle ones when n is even. In
 * order n steps as a rule; value is left in another order.
 */
#include <stddef.h>

/* A Gaussian's standard deviation over its median absolute deviation. */
#define MAD_TO_SIGMA 1.482602218505602

double median_find(double *value, size_t n);

#endif
