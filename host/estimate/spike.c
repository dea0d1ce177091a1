/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spike.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/simd2.h"

enum {
	SIDE = 4,   /* neighbours looked at on each side */
	RUN = 8,    /* samples looked at together */
	REACH = 10, /* how far for them, where some are missing */
};

/* A spike of one sample stands off by LIMIT_OVER times its neighbours' bends, and noise; of two, or where
 * some of the neighbours are missing, by twice as many. */

/* Deviation over mean magnitude: a Gaussian's, and its standard deviation times the root of how many samples;
 * Laplace has 1.41, Student's with five degrees of freedom 1.36. Asked where samples of the quiet part reach
 * so far, which a Gaussian's hardly do. */
#define TAIL_RATIO 1.2533
#define TAIL_SPREAD 0.334

/* |second difference| about sample k */
static double spike_bend(const double *v)
{
	return fabs(v[-1] - 2 * v[0] + v[1]);
}

/* The largest bend among the neighbours of wide samples from v on, those bridged by a straight line. */
static double bends_around(const double *v, int wide)
{
	double bridge = (v[wide] - v[-1]) / (wide + 1);
	double before = fabs(v[-1] - v[-2] - bridge), after = fabs(v[wide + 1] - v[wide] - bridge);
	double far = fmax(fmax(spike_bend(v - 2), spike_bend(v - 3)),
	                  fmax(spike_bend(v + wide + 1), spike_bend(v + wide + 2)));

	return fmax(far, fmax(before, after));
}

static bool stands_alone(const double *v, double noise_g)
{
	double off = fabs(v[0] - (v[-1] + v[1]) / 2);

	return off > LIMIT_NOISE * noise_g && off > LIMIT_OVER * bends_around(v, 1) + LIMIT_NOISE * noise_g;
}

/* Two side by side, to the same side. */
static bool stand_alone(const double *v, double noise_g)
{
	double a = v[0] - (2 * v[-1] + v[2]) / 3, b = v[1] - (v[-1] + 2 * v[2]) / 3;
	double off = fmin(fabs(a), fabs(b));

	return a * b > 0 && off > LIMIT_NOISE * noise_g &&
	       off > 2 * LIMIT_OVER * bends_around(v, 2) + LIMIT_NOISE * noise_g;
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

/* Sample skip is left out; k itself where none is. */
static bool spike_gather(const struct trace *trace, size_t k, size_t skip, struct around *around)
{
	for (int side = -1; side <= 1; side += 2) {
		int found = 0;

		for (int away = 1; away <= REACH && found < SIDE; away++) {
			size_t at = side < 0 ? k - (size_t)away : k + (size_t)away;

			if (at >= trace->count) /* below 0 too */
				break;
			if (!trace_good(trace, at) || at == skip)
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
static bool stands_alone_by_hole(const struct trace *trace, size_t k, size_t skip, double noise_g)
{
	const int m = SIDE;
	/* Between two spikes there is no hole wide enough for noise to hide a bend. */
	const double calm = skip == k ? 0 : LIMIT_NOISE * noise_g;
	struct around a;
	double span, near, far;

	if (!spike_gather(trace, k, skip, &a))
		return false;
	span = -a.time[m - 1] * a.time[m + 1] / 2;
	near = fmax(curvature(&a, m - 2, m - 1, m + 1), curvature(&a, m - 1, m + 1, m + 2));
	far = fmax(fmax(curvature(&a, m - 3, m - 2, m - 1), curvature(&a, m - 4, m - 3, m - 2)),
	           fmax(curvature(&a, m + 1, m + 2, m + 3), curvature(&a, m + 2, m + 3, m + 4)));
	return curvature(&a, m - 1, m, m + 1) * span >
	       2 * LIMIT_OVER * fmax(fmax(near, far) - calm, 0) * span + 2 * LIMIT_NOISE * noise_g;
}

/* How far v[0] stands off the straight line between its neighbours so many samples before and after. */
static double off_line(const double *v, int before, int after)
{
	return v[0] - (after * v[-before] + before * v[after]) / (before + after);
}

/* Hardly a good sample of its block lies further from zero. */
static bool is_extreme(const struct trace *trace, size_t k)
{
	return fabs(trace->value_g[k]) >= LIMIT_MOST * trace_most(trace, k);
}

/* Whether two that stand off by off_g are spikes by what is beside them: of a step each is as high as what is
 * outside of it, and of a vibration what is between them stands off too. */
static bool spike_apart(const double *v, size_t behind, double off_g)
{
	if (behind == 1)
		return fmin(fabs(v[0] - v[-1]), fabs(v[1] - v[2])) > LIMIT_EXPLAINS * off_g;
	return behind > 2 || fabs(v[1] - (v[-1] + v[3]) / 2) < LIMIT_EXPLAINS * off_g;
}

/* Two so near that each is the other's neighbour: how far behind k the second one is; 0 if there is none.
 * Side by side to the same side they are spike_at's, or a kink. Lower ones than what is around them do no
 * harm, and may be a vibration. */
static size_t second_spike(const struct trace *trace, size_t k, double noise_g)
{
	const double *v = trace->value_g + k, least = 2 * LIMIT_NOISE * noise_g;

	/* Nearly always nothing stands off. */
	if (!(fabs(off_line(v, 1, 1)) > least) && !(fabs(off_line(v, 1, 2)) > least))
		return 0;
	for (size_t behind = 1; behind <= SIDE && k + behind + 1 < trace->count; behind++) {
		int between = behind == 1 ? 2 : 1;
		double one = off_line(v, 1, between), other = off_line(v + behind, between, 1);

		if (fabs(one) > least && fabs(other) > least && (behind > 1 || one * other < 0) &&
		    spike_apart(v, behind, fmin(fabs(one), fabs(other))) &&
		    (is_extreme(trace, k) || is_extreme(trace, k + behind)) &&
		    all_good(trace, k - SIDE, k + SIDE + 1) &&
		    stands_alone_by_hole(trace, k, k + behind, noise_g) &&
		    stands_alone_by_hole(trace, k + behind, k, noise_g))
			return behind;
	}
	return 0;
}

/* How many samples from k on are a spike. */
static size_t spike_at(const struct trace *trace, size_t k, double noise_g)
{
	const double *v = trace->value_g + k;

	if (!trace_good(trace, k))
		return 0;
	if (!all_good(trace, k - SIDE, k + SIDE + 1))
		return stands_alone_by_hole(trace, k, k, noise_g) ? 1 : 0;
	if (stands_alone(v, noise_g))
		return 1;
	if (k + SIDE + 1 < trace->count && trace_good(trace, k + SIDE + 1) && stand_alone(v, noise_g))
		return 2;
	return 0;
}

static bool spike_is_whole(const struct trace *trace, size_t i)
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
static bool spike_mark_in(struct trace *trace, size_t i, double noise_g)
{
	const size_t from = i * TRACE_BLOCK;
	const size_t until =
	        from + TRACE_BLOCK + SIDE < trace->count ? from + TRACE_BLOCK : trace->count - SIDE;
	const bool whole =
	        spike_is_whole(trace, i - 1) && spike_is_whole(trace, i) && spike_is_whole(trace, i + 1);
	const double *value = trace->value_g, calm_g = LIMIT_NOISE * noise_g;
	bool marked = false;

	for (size_t k = from < SIDE ? SIDE : from; k < until; k++) {
		size_t wide, second;

		if (whole && k % RUN == 0 && k + RUN <= until && is_calm(value + k, calm_g)) {
			k += RUN - 1;
			continue;
		}
		/* A spike bends by no less than it stands off. */
		if ((whole || (trace_good(trace, k - 1) && trace_good(trace, k + 1))) &&
		    !(spike_bend(value + k) > calm_g))
			continue;
		wide = spike_at(trace, k, noise_g);
		second = wide > 0 ? wide - 1 : second_spike(trace, k, noise_g);
		if (wide == 0 && second == 0)
			continue;
		trace->sample[k] |= SAMPLE_SPIKE;
		trace->sample[k + second] |= SAMPLE_SPIKE;
		marked = true;
	}
	return marked;
}

/* One of the SIDE samples at an end, which one side has not enough neighbours of: the rule of stands_alone by
 * those it has, and by the wider margin. */
static bool stands_at_end(const struct trace *trace, size_t k, double noise_g)
{
	const bool first = k < SIDE;
	const size_t beyond = first ? k : trace->count - 1 - k;
	const ptrdiff_t in = first ? 1 : -1;
	const double *v = trace->value_g + k;
	double bridge, around;

	if (!(first ? all_good(trace, 0, k + SIDE + 2) : all_good(trace, k - SIDE - 1, trace->count)) ||
	    !is_extreme(trace, k))
		return false;
	bridge = (v[in] - v[-in]) / 2;
	around = fabs(v[2 * in] - v[in] - bridge);
	if (beyond > 1)
		around = fmax(around, fabs(v[-in] - v[-2 * in] - bridge));
	for (ptrdiff_t away = 2; away <= SIDE; away++)
		around = fmax(around, spike_bend(v + away * in));
	return spike_bend(v) / 2 > 2 * LIMIT_OVER * around + 2 * LIMIT_NOISE * noise_g;
}

/* All but the very first and last: a pulse that is cut off there looks the same. */
static bool mark_ends(struct trace *trace, double noise_g)
{
	bool marked = false;

	for (size_t i = 1; i < SIDE && trace->count > 2 * SIDE + 1; i++) {
		const size_t ends[] = {i, trace->count - 1 - i};

		for (size_t side = 0; side < 2; side++) {
			if (!stands_at_end(trace, ends[side], noise_g))
				continue;
			trace->sample[ends[side]] |= SAMPLE_SPIKE;
			marked = true;
		}
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

		if (block->high_g - block->low_g > LIMIT_NOISE * noise_g)
			marked |= spike_mark_in(trace, i, noise_g);
	}
	marked |= mark_ends(trace, noise_g);
	if (marked)
		trace->flags |= RECORD_FLAG_SPIKE;
	return marked;
}

/* The largest of the samples in the quiet part, marked ones too; how far those that are not reach. */
struct reach {
	double most, ratio, count;
};

static struct reach spike_reach(const struct trace *trace, size_t from, size_t until)
{
	struct reach reach = {0, 0, 0};
	double sum = 0, square = 0;

	for (size_t k = from; k < until; k++) {
		double value = fabs(trace->value_g[k]);

		if (trace->sample[k] & (SAMPLE_LOST | SAMPLE_BAD))
			continue;
		reach.most = fmax(reach.most, value);
		if (!trace_good(trace, k))
			continue;
		sum += value;
		square += value * value;
		reach.count++;
	}
	reach.ratio = sum > 0 ? sqrt(square * reach.count) / sum : 0;
	return reach;
}

/* Whether some block of the quiet part, or a sample that was marked, reaches so far. */
static bool reaches_far(const struct trace *trace, size_t from, size_t until)
{
	for (size_t i = from / TRACE_BLOCK; i < until / TRACE_BLOCK; i++)
		if (fmax(trace->block[i].high_g, -trace->block[i].low_g) > LIMIT_SIGNIFICANT * trace->noise_g)
			return true;
	return trace->flags & RECORD_FLAG_SPIKE;
}

void spike_of_noise(struct trace *trace, const struct estimate_baseline *baseline)
{
	size_t from, until;
	struct reach reach;

	if (baseline->samples == 0 || baseline->doubtful || !(trace->noise_g > 0))
		return;
	from = trace_index(trace, baseline->from_s);
	until = trace_index(trace, baseline->until_s);
	if (!reaches_far(trace, from, until))
		return;
	reach = spike_reach(trace, from, until);
	if (!(reach.ratio > TAIL_RATIO + LIMIT_HINT * TAIL_SPREAD / sqrt(reach.count)))
		return;
	for (size_t k = 1; k + 1 < trace->count; k++)
		if (trace->sample[k] & SAMPLE_SPIKE &&
		    !(fabs(off_line(trace->value_g + k, 1, 1)) < LIMIT_NOISE * reach.most))
			return;
	trace->flags &= ~(unsigned)RECORD_FLAG_SPIKE;
}
