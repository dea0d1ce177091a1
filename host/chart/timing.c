/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/timing.h"

#include <math.h>
#include <time.h>

enum { REPEATS_MAX = 10000 };

static double batch(void (*work)(const void *context), const void *context, int repeats)
{
	struct timespec from, to;

	clock_gettime(CLOCK_MONOTONIC, &from);
	for (int i = 0; i < repeats; i++)
		work(context);
	clock_gettime(CLOCK_MONOTONIC, &to);
	return (double)(to.tv_sec - from.tv_sec) * 1e6 + (double)(to.tv_nsec - from.tv_nsec) * 1e-3;
}

double timing_us(void (*work)(const void *context), const void *context, double batch_us, int batches)
{
	double least = INFINITY, once = fmax(batch(work, context, 1), 0.02);
	int repeats = once < batch_us ? (int)fmin(batch_us / once, REPEATS_MAX) + 1 : 1;

	for (int i = 0; i < batches; i++)
		least = fmin(least, batch(work, context, repeats) / repeats);
	return least;
}
