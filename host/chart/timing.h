/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_TIMING_H
#define DT_HOST_CHART_TIMING_H
/* What one call costs, us: the least of several batches, on the clock. A call is repeated until a batch takes
 * about batch_us; these serve where a call is timed once. */
#define TIMING_BATCH_US 300.0
enum { TIMING_BATCHES = 7 };
double timing_us(void (*work)(const void *context), const void *context, double batch_us, int batches);
#endif
