/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_ROOT_H
#define DT_HOST_MODEL_ROOT_H
/*
 * The zero of a function between two points where it has different signs, by Brent's method (GSL), to the
 * last digits. The program switches GSL's error handler off once, at its start; nothing is asked here that
 * would call it. Any thread; no memory kept.
 */
#include "common/error.h"

/* 0, or DT_E_NUMERIC: no change of sign, a value that is no number, or no convergence. A zero at an end is
 * found. */
DT_MUST_USE int root_find(double (*function)(double, void *), void *context, double low, double high,
                          double *root);

#endif
