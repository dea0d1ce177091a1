/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_MODEL_TIMING_H
#define DT_HOST_CHART_MODEL_TIMING_H
/* What one call costs, us: the least of several batches of repeated calls, on the clock. */
double timing_us(void (*work)(const void *context), const void *context);
#endif
