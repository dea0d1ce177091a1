/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_BRIDGE_H
#define DT_HOST_ESTIMATE_BRIDGE_H
/*
 * A trace as a function of time where one is needed between the samples: the cubic through the four around,
 * holes of up to BRIDGE_MAX samples bridged by straight lines, longer ones and what lies outside taken as 0.
 * Leaving holes out instead would favour the shift at which the hole costs least.
 */
#include "host/estimate/trace.h"

enum { BRIDGE_MAX = 64 };

/* Sample k, or the straight line across the hole it lies in. */
double bridge_sample(const struct trace *trace, ptrdiff_t k);

double bridge_at(const struct trace *trace, double time_s);

#endif
