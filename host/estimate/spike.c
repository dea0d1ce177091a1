/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spike.h"

#include <math.h>

enum { SIDE = 4 }; /* neighbours looked at on each side */

/* A spike of one sample, of two, stands off by so many times its neighbours' bends, and sigmas of noise. */
#define ONE_BENDS 2.0
#define TWO_BENDS 3.0
#define SIGMAS 6.0

/* |second difference| about sample k */
static double bend(const double *v)
{
	return fabs(v[-1] - 2 * v[0] + v[1]);
}

/* The largest bend among the neighbours of wide samples from v on, those bridged by a straight line. */
static double bends_around(const double *v, int wide)
{
	double bridge = (v[wide] - v[-1]) / (wide + 1);
	double before = fabs(v[-1] - v[-2] - bridge), after = fabs(v[wide + 1] - v[wide] - bridge);
	double far = fmax(fmax(bend(v - 2), bend(v - 3)), fmax(bend(v + wide + 1), bend(v + wide + 2)));

	return fmax(far, fmax(before, after));
}

static bool stands_alone(const double *v, double noise_g)
{
	double off = fabs(v[0] - (v[-1] + v[1]) / 2);

	return off > SIGMAS * noise_g && off > ONE_BENDS * bends_around(v, 1) + SIGMAS * noise_g;
}

/* Two side by side, to the same side. */
static bool stand_alone(const double *v, double noise_g)
{
	double a = v[0] - (2 * v[-1] + v[2]) / 3, b = v[1] - (v[-1] + 2 * v[2]) / 3;
	double off = fmin(fabs(a), fabs(b));

	return a * b > 0 && off > SIGMAS * noise_g && off > TWO_BENDS * bends_around(v, 2) + SIGMAS * noise_g;
}

static bool all_good(const struct trace *trace, size_t from, size_t until)
{
	for (size_t k = from; k < until; k++)
		if (!trace_good(trace, k))
			return false;
	return true;
}

/* How many samples from k on are a spike. */
static size_t spike_at(const struct trace *trace, size_t k, double noise_g)
{
	const double *v = trace->value_g + k;

	/* A spike bends by no less than it stands off. */
	if (!(bend(v) > SIGMAS * noise_g) || k + SIDE >= trace->count ||
	    !all_good(trace, k - SIDE, k + SIDE + 1))
		return 0;
	if (stands_alone(v, noise_g))
		return 1;
	if (k + SIDE + 1 < trace->count && trace_good(trace, k + SIDE + 1) && stand_alone(v, noise_g))
		return 2;
	return 0;
}

bool spike_mark(struct trace *trace, double noise_g)
{
	bool marked = false;

	if (!isfinite(noise_g))
		return false;
	for (size_t k = SIDE; k + SIDE < trace->count; k++) {
		const struct trace_block *block = &trace->block[k / TRACE_BLOCK];
		size_t wide;

		if (!(block->high_g - block->low_g > SIGMAS * noise_g)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		wide = spike_at(trace, k, noise_g);
		if (wide == 0)
			continue;
		trace->sample[k] |= SAMPLE_SPIKE;
		trace->sample[k + wide - 1] |= SAMPLE_SPIKE;
		marked = true;
		k += wide - 1;
	}
	if (marked)
		trace->flags |= RECORD_FLAG_SPIKE;
	return marked;
}
