/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/model_timing.h"

#include <math.h>
#include <time.h>

/* A batch takes about this long. */
#define BATCH_US 300.0

enum { BATCHES = 7, REPEATS_MAX = 10000 };

static double batch_us(void (*work)(const void *context), const void *context, int repeats)
{
	struct timespec from, to;

	clock_gettime(CLOCK_MONOTONIC, &from);
	for (int i = 0; i < repeats; i++)
		work(context);
	clock_gettime(CLOCK_MONOTONIC, &to);
	return (double)(to.tv_sec - from.tv_sec) * 1e6 + (double)(to.tv_nsec - from.tv_nsec) * 1e-3;
}

double timing_us(void (*work)(const void *context), const void *context)
{
	double least = INFINITY, once = fmax(batch_us(work, context, 1), 0.02);
	int repeats = once < BATCH_US ? (int)fmin(BATCH_US / once, REPEATS_MAX) + 1 : 1;

	for (int i = 0; i < BATCHES; i++)
		least = fmin(least, batch_us(work, context, repeats) / repeats);
	return least;
}
