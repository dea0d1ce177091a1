/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spike.h"

#include <math.h>

#include "host/estimate/pair.h"

enum {
	SIDE = 4,   /* neighbours looked at on each side */
	RUN = 8,    /* samples looked at together */
	REACH = 10, /* how far for them, where some are missing */
};

/* A spike of one sample, of two, stands off by so many times its neighbours' bends, and sigmas of noise. */
#define ONE_BENDS 2.0
#define TWO_BENDS 3.0
#define HOLE_BENDS 4.0
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

/* A few good samples about one, at their own times: where others are missing. */
struct around {
	double time[2 * SIDE + 1]; /* in samples, of the one in the middle 0 */
	double value[2 * SIDE + 1];
};

static bool gather(const struct trace *trace, size_t k, struct around *around)
{
	for (int side = -1; side <= 1; side += 2) {
		int found = 0;

		for (int away = 1; away <= REACH && found < SIDE; away++) {
			size_t at = side < 0 ? k - (size_t)away : k + (size_t)away;

			if (at >= trace->count) /* below 0 too */
				break;
			if (!trace_good(trace, at))
				continue;
			found++;
			around->time[SIDE + side * found] = side * away;
			around->value[SIDE + side * found] = trace->value_g[at];
		}
		if (found < SIDE)
			return false;
	}
	around->time[SIDE] = 0;
	around->value[SIDE] = trace->value_g[k];
	return true;
}

/* |second derivative| through three of them, in g per sample squared. */
static double curvature(const struct around *a, int before, int at, int after)
{
	double rise = (a->value[after] - a->value[at]) / (a->time[after] - a->time[at]);
	double run = (a->value[at] - a->value[before]) / (a->time[at] - a->time[before]);

	return 2 * fabs(rise - run) / (a->time[after] - a->time[before]);
}

/* The rule of stands_alone for samples that are not evenly spaced: by curvatures instead of bends. */
static bool stands_alone_by_hole(const struct trace *trace, size_t k, double noise_g)
{
	const int m = SIDE;
	struct around a;
	double span, near, far;

	if (!gather(trace, k, &a))
		return false;
	span = -a.time[m - 1] * a.time[m + 1] / 2;
	near = fmax(curvature(&a, m - 2, m - 1, m + 1), curvature(&a, m - 1, m + 1, m + 2));
	far = fmax(fmax(curvature(&a, m - 3, m - 2, m - 1), curvature(&a, m - 4, m - 3, m - 2)),
	           fmax(curvature(&a, m + 1, m + 2, m + 3), curvature(&a, m + 2, m + 3, m + 4)));
	return curvature(&a, m - 1, m, m + 1) * span >
	       (HOLE_BENDS * fmax(near, far) * span) + 2 * SIGMAS * noise_g;
}

/* How many samples from k on are a spike. */
static size_t spike_at(const struct trace *trace, size_t k, double noise_g)
{
	const double *v = trace->value_g + k;

	if (!trace_good(trace, k))
		return 0;
	if (!all_good(trace, k - SIDE, k + SIDE + 1))
		return stands_alone_by_hole(trace, k, noise_g) ? 1 : 0;
	if (stands_alone(v, noise_g))
		return 1;
	if (k + SIDE + 1 < trace->count && trace_good(trace, k + SIDE + 1) && stand_alone(v, noise_g))
		return 2;
	return 0;
}

static bool is_whole(const struct trace *trace, size_t i)
{
	return i >= trace_blocks(trace) || trace->block[i].whole;
}

/* Whether none of RUN samples from v on bends by more. */
static bool is_calm(const double *v, double bend_g)
{
	PAIR most = {0, 0};

	for (unsigned i = 0; i < RUN; i += 2) {
		PAIR off = pair_load(v - 1 + i) - 2 * pair_load(v + i) + pair_load(v + i + 1);

		most = pair_more(most, off * off);
	}
	return !(most[0] > bend_g * bend_g) && !(most[1] > bend_g * bend_g);
}

/* In block i. */
static bool mark_in(struct trace *trace, size_t i, double noise_g)
{
	const size_t from = i * TRACE_BLOCK;
	const size_t until =
	        from + TRACE_BLOCK + SIDE < trace->count ? from + TRACE_BLOCK : trace->count - SIDE;
	const bool whole = is_whole(trace, i - 1) && is_whole(trace, i) && is_whole(trace, i + 1);
	const double *value = trace->value_g, calm_g = SIGMAS * noise_g;
	bool marked = false;

	for (size_t k = from < SIDE ? SIDE : from; k < until; k++) {
		size_t wide;

		if (whole && k % RUN == 0 && k + RUN <= until && is_calm(value + k, calm_g)) {
			k += RUN - 1;
			continue;
		}
		/* A spike bends by no less than it stands off. */
		if ((whole || (trace_good(trace, k - 1) && trace_good(trace, k + 1))) &&
		    !(bend(value + k) > calm_g))
			continue;
		wide = spike_at(trace, k, noise_g);
		if (wide == 0)
			continue;
		trace->sample[k] |= SAMPLE_SPIKE;
		trace->sample[k + wide - 1] |= SAMPLE_SPIKE;
		marked = true;
		k += wide - 1;
	}
	return marked;
}

bool spike_mark(struct trace *trace, double noise_g)
{
	bool marked = false;

	if (!isfinite(noise_g) || trace->count < SIDE)
		return false;
	for (size_t i = 0; i < trace_blocks(trace); i++) {
		const struct trace_block *block = &trace->block[i];

		if (block->high_g - block->low_g > SIGMAS * noise_g)
			marked |= mark_in(trace, i, noise_g);
	}
	if (marked)
		trace->flags |= RECORD_FLAG_SPIKE;
	return marked;
}
