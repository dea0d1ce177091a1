/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown_private.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/crossings.h"
#include "host/estimate/grid_search.h"
#include "host/estimate/limits.h"

/* The window: GRID_CYCLES, or time constants if that is longer; from a mere start no more cycles than a start
 * is good for. */
#define TIME_CONSTANTS 4.4
#define CYCLES_START 7.0

/* Where the start is known, and for two modes or a law. */
#define SURE_TIME_CONSTANTS 5.2
#define LONG_TIME_CONSTANTS 6.5

/* Fewer points per cycle would cost accuracy. */
#define POINTS_PER_CYCLE 13.0

/* Samples before the window that lie this far from what the fit foretells, in standard deviations of one,
 * were still driven: one alone, or two together by LIMIT_HINT, if the next earlier one is off too. */
#define BACK_AGAIN 1.5

enum { WINDOWS = 4 };

static size_t window_end(const struct ringdown_job *job, double omega, double decay, double constants,
                         double most_s)
{
	double cycle = 2 * UNITS_PI / omega, length = GRID_CYCLES * cycle;
	size_t end;

	if (decay * length < constants)
		length = constants / fmax(decay, 1e-9 * omega);
	end = trace_index(job->trace, job->span->from_s + fmin(length, most_s));
	return end < job->last ? end : job->last;
}

unsigned ringdown_block(const struct ringdown_job *job, double omega)
{
	double samples = job->trace->rate_hz * 2 * UNITS_PI / (POINTS_PER_CYCLE * omega);

	return samples > 1 ? (unsigned)fmin(samples, 1e6) : 1;
}

/* Blocks, unless a sample is missing. */
static void ringdown_span_take(struct ringdown_job *job, size_t end, unsigned block)
{
	block_means_take(&job->series, job->trace, job->first, end, job->span->from_s, block);
	if (job->series.used < job->series.count && block > 1)
		block_means_take(&job->series, job->trace, job->first, end, job->span->from_s, 1);
}

/* One mode from a start, over a window that follows it: a start is good for a few cycles only. */
static bool ringdown_span_settle(struct ringdown_job *job, double omega, double decay)
{
	double most_s = CYCLES_START * 2 * UNITS_PI / omega;
	struct modes *modes = &job->modes;
	size_t end = window_end(job, omega, 0, TIME_CONSTANTS, most_s);
	unsigned block = ringdown_block(job, omega);

	*modes = (struct modes){.count = 1, .p = {0, decay, omega}};
	for (int i = 0; i < WINDOWS; i++) {
		size_t wish;

		ringdown_span_take(job, end, block);
		if (job->series.used < 2 * modes_size(modes) ||
		    (i == 0 && !modes_linear(modes, &job->series)) || !modes_fit(modes, &job->series))
			return false;
		most_s *= 4;
		wish = window_end(job, modes->p[MODES_OMEGA], modes->p[MODES_DECAY], TIME_CONSTANTS, most_s);
		if (fabs((double)wish - (double)end) < LIMIT_SLIGHT * (double)(end - job->first) &&
		    block <= ringdown_block(job, modes->p[MODES_OMEGA] * (1 - LIMIT_SLIGHT)))
			break;
		end = wish;
		block = ringdown_block(job, modes->p[MODES_OMEGA]);
	}
	job->single = *modes;
	job->total = block_means_squares(&job->series);
	return true;
}

static bool settle_by_grid_search(struct ringdown_job *job)
{
	struct grid_search scan;

	return grid_search_find(&scan, job->trace, job->first, job->last) &&
	       ringdown_span_settle(job, scan.omega, scan.decay);
}

enum estimate_status ringdown_start(struct ringdown_job *job)
{
	double noise = isfinite(job->trace->noise_g) ? job->trace->noise_g : 0, omega, decay;
	double threshold = fmax(LIMIT_SIGNIFICANT * noise, LIMIT_FADED * job->span->peak_g);
	struct crossings crossings;
	bool begun;

	if (noise > 0 && !grid_search_worth(job->trace, job->first, job->last, noise))
		return ESTIMATE_NO_PEAK;
	crossings_find(&crossings, job->trace, job->first, job->last, 0, threshold);
	begun = crossings_start(&crossings, &omega, &decay);
	if (!begun && crossings.ended)
		return ESTIMATE_SHORT;
	if (!begun && !(noise > 0))
		return ESTIMATE_NO_PEAK;
	/* A start that explains less is doubted. */
	if (begun && ringdown_span_settle(job, omega, decay) && ringdown_explained(job) > LIMIT_MOST)
		return ESTIMATE_OK;
	return settle_by_grid_search(job) ? ESTIMATE_OK : begun ? ESTIMATE_NOT_CONVERGED : ESTIMATE_NO_PEAK;
}

bool ringdown_restart(struct ringdown_job *job, double omega, double decay)
{
	struct modes *modes = &job->modes;

	*modes = (struct modes){.count = 1, .p = {0, decay, omega}};
	ringdown_span_take(job, window_end(job, omega, decay, SURE_TIME_CONSTANTS, INFINITY),
	                   ringdown_block(job, omega * RINGDOWN_FINER));
	if (job->series.used < 2 * modes_size(modes) || !modes_linear(modes, &job->series) ||
	    !modes_fit(modes, &job->series))
		return false;
	job->single = *modes;
	return true;
}

bool ringdown_lengthen(struct ringdown_job *job)
{
	double decay = job->single.p[MODES_DECAY], omega = job->single.p[MODES_OMEGA];
	size_t end;

	if (job->flags & ESTIMATE_FLAG_SPIKE)
		return true;
	end = trace_index(job->trace, job->span->from_s + LONG_TIME_CONSTANTS / decay);
	ringdown_span_take(job, end < job->last ? end : job->last,
	                   ringdown_block(job, omega * RINGDOWN_FINER));
	if (!modes_fit(&job->single, &job->series))
		return false;
	job->modes = job->single;
	return true;
}

/* How far a sample lies from what the fit foretells, in noise; 0 where there is none. */
static double off_by(const struct ringdown_job *job, const struct modes *samples, size_t k, double noise)
{
	const struct trace *trace = job->trace;

	if (!trace_usable(trace, k))
		return 0;
	return (trace->value_g[k] - modes_at(samples, trace_time(trace, k) - job->span->from_s)) / noise;
}

/* Where the decay was free already: from first back to earliest, as long as the samples, one by one and each
 * with the one after it, lie where the fit foretells them. Chance strays and comes back; the contact's force
 * leads further astray the earlier it is. */
static size_t free_since(const struct ringdown_job *job, const struct modes *samples, size_t earliest,
                         double noise)
{
	double after = 0;
	size_t k;

	for (k = job->first; k > earliest; k--) {
		double off = off_by(job, samples, k - 1, noise);

		/* Beyond noise: an outlier, or a contact too short to show twice. */
		if (fabs(off) > LIMIT_NOISE ||
		    ((fabs(off) > LIMIT_HINT || fabs(off + after) > LIMIT_HINT) &&
		     (k - 1 == earliest || fabs(off_by(job, samples, k - 2, noise)) > BACK_AGAIN)))
			return k;
		after = off;
	}
	return k;
}

void ringdown_reach_back(struct ringdown_job *job)
{
	const struct trace *trace = job->trace;
	size_t end = job->first + (size_t)job->series.count * job->series.block, first;
	double noise = trace->noise_g;
	struct modes modes = job->modes;

	if (!(noise > 0))
		noise = ringdown_sigma_point(job, &job->modes) * sqrt(job->series.block);
	modes_unblock(&modes, &job->series);
	first = free_since(job, &modes, trace_index(trace, job->span->from_s - job->span->margin_s),
	                   hypot(noise, RINGDOWN_SWING_MODEL * modes_swing_g(&modes, 0)));
	if (first >= job->first)
		return;
	modes = job->modes;
	if (job->series.block > 1)
		block_means_take(&job->series, trace, first, end, job->span->from_s, job->series.block);
	else if (!block_means_lengthen(&job->series, trace, first, (unsigned)(job->first - first)))
		return;
	job->first = first;
	if (modes_fit(&modes, &job->series))
		job->modes = modes;
}
