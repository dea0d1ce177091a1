/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/crossings.h"
#include "host/estimate/modes.h"
#include "host/estimate/outlier.h"
#include "host/estimate/pencil.h"
#include "host/estimate/scan.h"
#include "host/estimate/series.h"
#include "host/estimate/spring.h"

/* The window: cycles, or time constants if that is longer, but no more cycles than the most, and
 * from a mere start no more than a start is good for. */
#define CYCLES 5.0
#define TIME_CONSTANTS 4.4
#define CYCLES_MOST 80.0
#define CYCLES_START 7.0

/* For two modes or a law. */
#define LONG_TIME_CONSTANTS 6.5
#define FINER 1.3

/* Fewer points per cycle would cost accuracy. */
#define POINTS_PER_CYCLE 13.0

/* Window and block are chosen anew when the fit's wish differs from them by more than this. */
#define WINDOW_CHANGE 0.1

/* What is no swing: this little of the peak; this little of the noise, per sample, as a threshold for zero
 * crossings; this little gain of the sum of squares in the noise's variance. */
#define SWING_LEVEL 0.02
#define SWING_NOISE 5.0
#define GAIN_MIN 64.0
#define EXPLAINED_MIN 0.5
#define DAMPING_MAX 0.95

/* A start by zero crossings that explains less than this of the variance is doubted. */
#define EXPLAINED_SURE 0.8

/* The residual test: standard deviations of chi-square, how well the noise itself is known, and what of the
 * swing is small enough not to matter whatever the noise. */
#define CHI_LIMIT 3.3
#define NOISE_KNOWN 0.05
#define SWING_MODEL 1e-4

#define CHI_GROSS 3.0

/* Every sample is this much more certain than blocks, at most. */
#define FULL_GAIN 1.05

#define F_LIMIT 7.0

/* B of a spring to start from. */
#define SPRING_SOFT 0.3
#define SPRING_STIFF -0.2

/* X and Y are not of one thing when they are this part apart, and by so many standard deviations. */
#define APART_MAX 0.05
#define AGREE 3.0

/* What exchange between the axes leaves of a law's damping in doubt, as part of it, and how far apart it may
 * lead them. */
#define LAW_DAMPING 0.01
#define LAW_APART 0.15

/* What the contact's last force leaves in a damping, as part of its uncertainty: both axes have it. */
#define COMMON 0.25

/* Samples before the window that lie this far from what the fit foretells, in standard deviations of one,
 * were still driven: one alone, two together, if the next earlier one is off too. */
#define BACK_ALONE 2.2
#define BACK_PAIR 2.0
#define BACK_AGAIN 1.5

/* Before the contact's end, where that is known, they count for so much more. */
#define BACK_BEFORE 0.7

/* Modes are apart when their frequencies are by this many standard deviations. */
#define SEPARATION 3.0

enum { MEAN_CYCLES = 3, SAMPLES_MIN = 10, WINDOWS = 4, OUTLIER_ROUNDS = 3, THIN_MIN = 48 };

/* One channel's decay on its way through the methods. */
struct job {
	const struct trace *trace;
	const struct ringdown_span *span;
	size_t first, last;              /* all there is */
	struct modes modes;              /* the best so far */
	struct modes single;             /* one mode, nothing else */
	double doubt_omega, doubt_decay; /* of the values beyond their scatter */
	unsigned flags;
	const char *path[ESTIMATE_PATH_MAX];
	unsigned tried;
	struct series series; /* what is fitted; large, so it is last and not cleared */
};

static void try_method(struct job *job, const char *method)
{
	if (job->tried < ESTIMATE_PATH_MAX)
		job->path[job->tried++] = method;
}

static unsigned freedom(const struct job *job, const struct modes *modes)
{
	return job->series.used - modes_size(modes);
}

static double swing_g(const struct modes *modes)
{
	return hypot(modes->p[MODES_COSINE], modes->p[MODES_SINE]);
}

/* Reduced chi-square; NAN without a noise to hold it against. */
static double chi_square(const struct job *job, const struct modes *modes)
{
	double noise = hypot(job->trace->noise_g, SWING_MODEL * swing_g(modes));

	return modes->fit.squares * job->series.block / (noise * noise * freedom(job, modes));
}

/* A residual as large as chance makes it, or one nobody can judge. */
static bool passes(const struct job *job, const struct modes *modes)
{
	double spread = sqrt(2.0 / freedom(job, modes) + 2 * NOISE_KNOWN * NOISE_KNOWN);

	return !(chi_square(job, modes) > 1 + CHI_LIMIT * spread);
}

/* Standard deviation of a point: the larger of the noise and the residual. */
static double sigma_point(const struct job *job, const struct modes *modes)
{
	double residual = sqrt(modes->fit.squares / freedom(job, modes));

	return fmax(residual, job->trace->noise_g / sqrt(job->series.block));
}

/* ---- window and start ---- */

static size_t window_end(const struct job *job, double omega, double decay, double most_s)
{
	double cycle = 2 * UNITS_PI / omega, length = CYCLES * cycle;
	size_t end;

	if (decay * length < TIME_CONSTANTS)
		length = fmin(CYCLES_MOST * cycle, TIME_CONSTANTS / fmax(decay, 1e-9 * omega));
	end = trace_index(job->trace, job->span->from_s + fmin(length, most_s));
	return end < job->last ? end : job->last;
}

static unsigned block_for(const struct job *job, double omega)
{
	double samples = job->trace->rate_hz * 2 * UNITS_PI / (POINTS_PER_CYCLE * omega);

	return samples > 1 ? (unsigned)fmin(samples, 1e6) : 1;
}

/* Blocks, unless a sample is missing. */
static void take(struct job *job, size_t end, unsigned block)
{
	series_take(&job->series, job->trace, job->first, end, job->span->from_s, block);
	if (job->series.used < job->series.count && block > 1)
		series_take(&job->series, job->trace, job->first, end, job->span->from_s, 1);
}

/* One mode from a start, over a window that follows it: a start is good for a few cycles only. */
static bool settle(struct job *job, double omega, double decay)
{
	double most_s = CYCLES_START * 2 * UNITS_PI / omega;
	struct modes *modes = &job->modes;
	size_t end = window_end(job, omega, 0, most_s);
	unsigned block = block_for(job, omega);

	*modes = (struct modes){.count = 1, .p = {0, decay, omega}};
	for (int i = 0; i < WINDOWS; i++) {
		size_t wish;

		take(job, end, block);
		if (job->series.used < 2 * modes_size(modes) ||
		    (i == 0 && !modes_linear(modes, &job->series)) || !modes_fit(modes, &job->series))
			return false;
		most_s *= 4;
		wish = window_end(job, modes->p[MODES_OMEGA], modes->p[MODES_DECAY], most_s);
		if (fabs((double)wish - (double)end) < WINDOW_CHANGE * (double)(end - job->first) &&
		    block <= block_for(job, modes->p[MODES_OMEGA] * (1 - WINDOW_CHANGE)))
			break;
		end = wish;
		block = block_for(job, modes->p[MODES_OMEGA]);
	}
	job->single = *modes;
	return true;
}

/* Part of what is not noise that the fit explains. */
static double explained(const struct job *job)
{
	double noise = job->trace->noise_g, expected = 0, total = series_squares(&job->series);

	if (isfinite(noise))
		expected = noise * noise / job->series.block;
	total -= expected * (job->series.used - 1);
	return 1 - fmax(0, job->modes.fit.squares - expected * freedom(job, &job->modes)) / total;
}

/* What the fit takes from the sum of squares, in the noise's variance: how far it stands out. */
static double gain(const struct job *job)
{
	double noise = job->trace->noise_g;

	return (series_squares(&job->series) - job->modes.fit.squares) * job->series.block / (noise * noise);
}

static bool settle_by_scan(struct job *job)
{
	struct scan scan;

	return scan_find(&scan, job->trace, job->first, job->last) && settle(job, scan.omega, scan.decay);
}

/* One mode, from crossings, or where these are doubtful from a scan. */
static enum estimate_status start(struct job *job)
{
	double noise = isfinite(job->trace->noise_g) ? job->trace->noise_g : 0, omega, decay;
	double threshold = fmax(SWING_NOISE * noise, SWING_LEVEL * job->span->peak_g);
	struct crossings crossings;
	bool begun;

	if (noise > 0 && !scan_worth(job->trace, job->first, job->last, noise))
		return ESTIMATE_NO_PEAK;
	crossings_find(&crossings, job->trace, job->first, job->last, 0, threshold);
	begun = crossings_start(&crossings, &omega, &decay);
	if (!begun && crossings.ended)
		return ESTIMATE_SHORT;
	if (!begun && !(noise > 0))
		return ESTIMATE_NO_PEAK;
	if (begun && settle(job, omega, decay) && explained(job) > EXPLAINED_SURE)
		return ESTIMATE_OK;
	return settle_by_scan(job) ? ESTIMATE_OK : begun ? ESTIMATE_NOT_CONVERGED : ESTIMATE_NO_PEAK;
}

static enum estimate_status judge(const struct job *job)
{
	const double *p = job->modes.p;

	if (explained(job) < EXPLAINED_MIN || gain(job) < GAIN_MIN ||
	    swing_g(&job->modes) < SWING_LEVEL * job->span->peak_g)
		return ESTIMATE_NO_PEAK;
	if (!(p[MODES_DECAY] > 0) || !(p[MODES_DECAY] < DAMPING_MAX * hypot(p[MODES_DECAY], p[MODES_OMEGA])))
		return ESTIMATE_NOT_CONVERGED;
	return ESTIMATE_OK;
}

/* ---- what the residual asks for ---- */

/* Every sample, outliers left out: who is one shows better each time they are gone. */
static bool full(struct job *job)
{
	struct modes modes = job->single;
	struct series *series = &job->series;
	struct series blocks = *series;
	bool usable[SERIES_MAX];
	unsigned out = 0;

	series_take(series, job->trace, job->first, job->first + (size_t)series->count * series->block,
	            job->span->from_s, 1);
	memcpy(usable, series->good, series->count);
	if (!modes_fit(&modes, series))
		return false;
	for (int i = 0; i < OUTLIER_ROUNDS; i++) {
		unsigned before = out;

		out = outlier_drop(series, &modes, usable);
		if ((out > 0 || before > 0) && !modes_fit(&modes, series))
			return false;
		if (out == before)
			break;
	}
	if (out > 0)
		job->flags |= ESTIMATE_FLAG_SPIKE;
	if (out == 0 && !passes(job, &modes)) {
		/* Nothing gained: what follows is cheaper on blocks. */
		*series = blocks;
		if (!modes_fit(&job->single, series))
			return false;
		modes = job->single;
	}
	job->modes = modes;
	job->single = modes;
	return true;
}

/* By how much the richer fit is better than one mode, per unknown and in its own residual. */
static double f_test(const struct job *job, const struct modes *richer)
{
	double more = modes_size(richer) - modes_size(&job->single);

	return (job->single.fit.squares - richer->fit.squares) / more /
	       (richer->fit.squares / freedom(job, richer));
}

static double information(const struct job *job, const struct modes *modes)
{
	double n = job->series.used;

	return n * log(modes->fit.squares) + modes_size(modes) * log(n);
}

/* Takes the candidate for the best so far if it is. */
static void consider(struct job *job, const struct modes *candidate)
{
	if (f_test(job, candidate) > F_LIMIT && information(job, candidate) < information(job, &job->modes))
		job->modes = *candidate;
}

static void try_hum(struct job *job)
{
	const double hz[] = {50, 60, job->trace->hum_hz};

	try_method(job, "full+hum");
	for (size_t i = 0; i < sizeof(hz) / sizeof(hz[0]); i++) {
		struct modes modes = job->single;

		modes.hum_hz = hz[i];
		if (hz[i] > 0 && modes_linear(&modes, &job->series) && modes_fit(&modes, &job->series))
			consider(job, &modes);
	}
}

/* Returns k of the quadratic law; 0 when it cannot be fitted. */
static double try_square(struct job *job)
{
	struct modes modes = job->single;

	modes.law = MODES_LAW_SQUARE;
	modes.p[MODES_LAW] = 0;
	if (!modes_fit(&modes, &job->series))
		return 0;
	consider(job, &modes);
	return modes.p[MODES_LAW];
}

/* The mount that softens, or stiffens, as the quadratic law has it. */
static void try_spring(struct job *job, double k)
{
	struct modes modes = job->single;
	double swing = swing_g(&modes);

	modes.law = MODES_LAW_SPRING;
	modes.p[MODES_OMEGA] -= k / 2;
	modes.p[MODES_COSINE] *= -1;
	modes.p[MODES_SINE] *= -1;
	modes.p[MODES_LAW] = 1 / (swing * swing);
	modes.p[MODES_LAW + 1] = k < 0 ? SPRING_SOFT : SPRING_STIFF;
	if (modes_fit(&modes, &job->series))
		consider(job, &modes);
}

static bool real_mode(const struct modes *modes, unsigned m)
{
	double decay = modes->p[MODES_DECAY + MODES_EACH * m], omega = modes->p[MODES_OMEGA + MODES_EACH * m];

	return decay > 0 && decay < DAMPING_MAX * hypot(decay, omega);
}

static double mode_swing_g(const struct modes *modes, unsigned m)
{
	return hypot(modes->p[MODES_COSINE + MODES_EACH * m], modes->p[MODES_SINE + MODES_EACH * m]);
}

static unsigned stronger(const struct modes *modes)
{
	return modes->count > 1 && mode_swing_g(modes, 1) > mode_swing_g(modes, 0);
}

/* Two modes from a start; false unless both come out as decays. */
static bool fit_two(struct modes *modes, const struct series *series, const struct pencil_pole pole[2])
{
	*modes = (struct modes){.count = 2};
	for (unsigned m = 0; m < 2; m++) {
		modes->p[MODES_DECAY + MODES_EACH * m] = pole[m].decay;
		modes->p[MODES_OMEGA + MODES_EACH * m] = pole[m].omega;
	}
	return modes_linear(modes, series) && modes_fit(modes, series) && real_mode(modes, 0) &&
	       real_mode(modes, 1);
}

static bool start_two(const struct job *job, struct pencil_pole pole[2])
{
	const struct series *series = &job->series;
	double filled[SERIES_MAX];

	for (unsigned k = 0; k < series->count; k++)
		filled[k] = series->good[k] ? series->value_g[k]
		                            : modes_at(&job->single, series->first_s + k * series->step_s);
	return pencil_find(pole, filled, series->count, series->step_s);
}

/* Two modes that are surely nearer than the stronger's width, or not surely apart, are one as far as anyone
 * can tell. */
static bool separable(const struct job *job, const struct modes *modes)
{
	const double *p = modes->p, *own = p + MODES_EACH * stronger(modes);
	double row[CHOLESKY_MAX] = {0}, apart, unsure;

	row[MODES_OMEGA] = 1;
	row[MODES_OMEGA + MODES_EACH] = -1;
	apart = fabs(p[MODES_OMEGA] - p[MODES_OMEGA + MODES_EACH]);
	unsure = sigma_point(job, modes) * sqrt(cholesky_variance(&modes->fit.factor, row));
	return apart + 2 * unsure >= own[MODES_DECAY] && apart >= SEPARATION * unsure;
}

/* The same minimum, as far as two fits of it agree. */
#define SAME 1e-3

/* By the pencil; where noise hides the weaker pole from it, from either side of the one mode. */
static void try_two(struct job *job)
{
	static const double aside[] = {0.85, 1.15};
	struct modes modes, best = job->single;
	struct pencil_pole pole[2];

	try_method(job, "two-modes");
	if (start_two(job, pole) && fit_two(&modes, &job->series, pole))
		best = modes;
	for (size_t i = 0; i < sizeof(aside) / sizeof(aside[0]) && !passes(job, &best); i++) {
		pole[0] = (struct pencil_pole){job->single.p[MODES_OMEGA], job->single.p[MODES_DECAY]};
		pole[1] = (struct pencil_pole){aside[i] * pole[0].omega, pole[0].decay};
		if (!fit_two(&modes, &job->series, pole))
			continue;
		/* Two starts that meet leave little hope for a third. */
		if (best.count == 2 && fabs(modes.fit.squares - best.fit.squares) < SAME * best.fit.squares)
			break;
		if (modes.fit.squares < best.fit.squares)
			best = modes;
	}
	if (best.count < 2)
		return;
	if (separable(job, &best))
		consider(job, &best);
	else if (!passes(job, &job->modes))
		job->flags |= ESTIMATE_FLAG_NOT_SEPARABLE;
}

/* Two modes or a law that are grossly refused are no ground to say where the frequency goes as the swing
 * vanishes, or what the modes are: the mean of the window stays, and how far the other would have led from it
 * is doubt. */
static void distrust(struct job *job)
{
	const double *other = job->modes.p + MODES_EACH * stronger(&job->modes);

	job->doubt_omega = fabs(other[MODES_OMEGA] - job->single.p[MODES_OMEGA]);
	job->doubt_decay = fabs(other[MODES_DECAY] - job->single.p[MODES_DECAY]);
	job->modes = job->single;
}

/* More unknowns need a longer look and finer blocks. Not once outliers are out: they would be back. */
static bool look_longer(struct job *job)
{
	double decay = job->single.p[MODES_DECAY], omega = job->single.p[MODES_OMEGA];
	size_t end;

	if (job->flags & ESTIMATE_FLAG_SPIKE)
		return true;
	end = trace_index(job->trace, job->span->from_s + fmin(LONG_TIME_CONSTANTS / decay,
	                                                       CYCLES_MOST * 2 * UNITS_PI / omega));
	take(job, end < job->last ? end : job->last, block_for(job, omega * FINER));
	if (!modes_fit(&job->single, &job->series))
		return false;
	job->modes = job->single;
	return true;
}

/* What was found before, but the path that has been gone since. */
static void restore(struct job *job, const struct job *before)
{
	const char *path[ESTIMATE_PATH_MAX];
	unsigned tried = job->tried;

	memcpy(path, job->path, sizeof(path));
	*job = *before;
	memcpy(job->path, path, sizeof(path));
	job->tried = tried;
}

/* Whatever is more than one mode; into job->modes if it is better. */
static void search(struct job *job)
{
	double k;

	try_method(job, "amplitude");
	k = try_square(job);
	try_two(job);
	if (!passes(job, &job->modes) && fabs(k) > 0)
		try_spring(job, k);
}

/* Where holes leave no blocks but many whole ones, these are enough to look for more than one mode, and what
 * is found is a start for all samples. */
static void look_on_blocks(struct job *job, void (*look)(struct job *job))
{
	const unsigned points = block_for(job, job->single.p[MODES_OMEGA] * FINER) / job->series.block;
	const struct modes single = job->single;
	struct series all;
	struct modes found;

	if (points < 2) {
		look(job);
		return;
	}
	all = job->series;
	series_thin(&job->series, &all, points);
	if (job->series.used < THIN_MIN || !modes_fit(&job->single, &job->series)) {
		job->series = all;
		job->single = single;
		look(job);
		return;
	}
	job->modes = job->single;
	look(job);
	found = job->modes;
	modes_unblock(&found, &job->series);
	job->series = all;
	job->single = job->modes = single;
	if (modes_size(&found) > modes_size(&single) && modes_fit(&found, &all))
		job->modes = found;
}

static void try_richer(struct job *job)
{
	const struct job before = *job;

	if (!look_longer(job))
		return;
	look_on_blocks(job, search);
	if (passes(job, &job->modes))
		job->flags &= ~(unsigned)ESTIMATE_FLAG_NOT_SEPARABLE;
	else if (chi_square(&before, &before.modes) < chi_square(job, &job->modes))
		restore(job, &before);
	else if (chi_square(job, &job->modes) > CHI_GROSS)
		distrust(job);
}

/* From the block fit to whatever the residual needs. */
static void escalate(struct job *job)
{
	try_method(job, job->series.block > 1 ? "block" : "full");
	if (passes(job, &job->modes))
		return;
	if (job->series.block > 1)
		try_method(job, "full");
	if (!full(job) || passes(job, &job->modes))
		return;
	look_on_blocks(job, try_hum);
	if (!passes(job, &job->modes))
		try_richer(job);
}

/* How far a sample lies from what the fit foretells, in noise; 0 where there is none. */
static double off_by(const struct job *job, const struct modes *samples, size_t k, double noise)
{
	const struct trace *trace = job->trace;
	double time = trace_time(trace, k), foot = job->span->foot_s;

	if (!series_usable(trace, k))
		return 0;
	if (foot > 0 && time < foot)
		noise *= BACK_BEFORE;
	return (trace->value_g[k] - modes_at(samples, time - job->span->from_s)) / noise;
}

/* Where the decay was free already: from first back to earliest, as long as the samples, one by one and each
 * with the one after it, lie where the fit foretells them. Chance strays and comes back; the contact's force
 * leads further astray the earlier it is. */
static size_t free_since(const struct job *job, const struct modes *samples, size_t earliest, double noise)
{
	double after = 0;
	size_t k;

	for (k = job->first; k > earliest; k--) {
		double off = off_by(job, samples, k - 1, noise);

		if ((fabs(off) > BACK_ALONE || fabs(off + after) > BACK_PAIR) &&
		    (k - 1 == earliest || fabs(off_by(job, samples, k - 2, noise)) > BACK_AGAIN))
			return k;
		after = off;
	}
	return k;
}

/* The decay may have been free before from_s. */
static void walk_back(struct job *job)
{
	const struct trace *trace = job->trace;
	size_t end = job->first + (size_t)job->series.count * job->series.block, first;
	double noise = trace->noise_g;
	struct modes modes = job->modes;

	if (!(noise > 0))
		noise = sigma_point(job, &job->modes) * sqrt(job->series.block);
	modes_unblock(&modes, &job->series);
	first = free_since(job, &modes, trace_index(trace, job->span->from_s - job->span->margin_s),
	                   hypot(noise, SWING_MODEL * swing_g(&modes)));
	if (first >= job->first)
		return;
	modes = job->modes;
	if (job->series.block > 1)
		series_take(&job->series, trace, first, end, job->span->from_s, job->series.block);
	else if (!series_lengthen(&job->series, trace, first, (unsigned)(job->first - first)))
		return;
	job->first = first;
	if (modes_fit(&modes, &job->series))
		job->modes = modes;
}

/* ---- expression ---- */

/* Of the samples, where the series starts. A soft spring pushes less than its deflection says. */
static double start_swing_g(const struct job *job, unsigned m)
{
	struct modes samples = job->modes;
	double swing;

	modes_unblock(&samples, &job->series);
	swing = mode_swing_g(&samples, m);
	if (samples.law == MODES_LAW_SPRING)
		swing *= spring_softness(samples.p);
	return swing * exp(samples.p[MODES_DECAY + MODES_EACH * m] *
	                   (job->span->from_s - trace_time(job->trace, job->first)));
}

static double spread(const struct job *job, unsigned m, double by_decay, double by_omega, double sigma)
{
	double row[CHOLESKY_MAX] = {0};

	row[MODES_DECAY + MODES_EACH * m] = by_decay;
	row[MODES_OMEGA + MODES_EACH * m] = by_omega;
	return hypot(sigma * sqrt(cholesky_variance(&job->modes.fit.factor, row)),
	             hypot(by_decay * job->doubt_decay, by_omega * job->doubt_omega));
}

/* A frequency that follows the swing has a value only for a swing: that of the first three cycles, as the
 * study counts them. */
static void express_mean(const struct job *job, struct estimate_ringdown *result)
{
	double share = modes_mean_hz(&job->modes, MEAN_CYCLES) / result->frequency_hz;

	result->small_swing_hz = result->frequency_hz;
	result->frequency_hz *= share;
	result->sigma_hz *= share;
	result->natural_frequency_hz *= share;
	result->sigma_natural_hz *= share;
	result->damping_ratio /= share;
	result->sigma_damping /= share;
}

/* Values and uncertainties of the stronger mode, and the other's values. */
static void express(const struct job *job, struct ringdown *ringdown)
{
	struct estimate_ringdown *result = &ringdown->result;
	const unsigned m = stronger(&job->modes);
	const double decay = job->modes.p[MODES_DECAY + MODES_EACH * m],
	             omega = job->modes.p[MODES_OMEGA + MODES_EACH * m];
	double natural = hypot(omega, decay), cube = natural * natural * natural;
	double sigma = sigma_point(job, &job->modes);

	result->frequency_hz = omega / (2 * UNITS_PI);
	result->sigma_hz = spread(job, m, 0, 1, sigma) / (2 * UNITS_PI);
	result->natural_frequency_hz = natural / (2 * UNITS_PI);
	result->sigma_natural_hz = spread(job, m, decay / natural, omega / natural, sigma) / (2 * UNITS_PI);
	result->damping_ratio = decay / natural;
	result->sigma_damping = spread(job, m, omega * omega / cube, -decay * omega / cube, sigma);
	result->amplitude_g = start_swing_g(job, m);
	if (job->modes.count > 1) {
		const double *other = job->modes.p + (m ? 0 : MODES_EACH);

		result->second_frequency_hz = other[MODES_OMEGA] / (2 * UNITS_PI);
		result->second_damping_ratio =
		        other[MODES_DECAY] / hypot(other[MODES_OMEGA], other[MODES_DECAY]);
	}
	if (job->modes.law != MODES_LAW_NONE)
		express_mean(job, result);
	ringdown->amplitude_g = result->amplitude_g;
	ringdown->offset_g = job->modes.p[MODES_OFFSET];
	ringdown->start_s = trace_time(job->trace, job->first);
}

static const char *method_of(const struct job *job)
{
	if (job->modes.count > 1)
		return "two-modes";
	if (job->modes.law != MODES_LAW_NONE)
		return "amplitude";
	if (job->modes.hum_hz > 0)
		return "full+hum";
	return job->series.block > 1 ? "block" : "full";
}

/* Values that their residual allows may still be less certain than slack times what was asked for. */
static bool certain(const struct job *job, const struct estimate_ringdown *result, double slack)
{
	double tolerance = slack * (job->span->tolerance > 0 ? job->span->tolerance : ESTIMATE_TOLERANCE);

	return result->sigma_hz <= tolerance * result->frequency_hz &&
	       result->sigma_damping <= tolerance * result->damping_ratio;
}

static void meet_tolerance(struct job *job, struct ringdown *ringdown)
{
	if (certain(job, &ringdown->result, 1))
		return;
	if (certain(job, &ringdown->result, FULL_GAIN) && job->series.block > 1 && job->modes.count == 1 &&
	    job->modes.law == MODES_LAW_NONE) {
		try_method(job, "full");
		if (full(job))
			express(job, ringdown);
	}
	if (!certain(job, &ringdown->result, 1))
		job->flags |= ESTIMATE_FLAG_TOLERANCE;
}

static unsigned shape_flags(const struct job *job)
{
	unsigned flags = job->flags;

	if (job->modes.count > 1)
		flags |= ESTIMATE_FLAG_TWO_MODES;
	if (job->modes.law != MODES_LAW_NONE)
		flags |= ESTIMATE_FLAG_AMPLITUDE;
	if (job->modes.hum_hz > 0)
		flags |= ESTIMATE_FLAG_HUM;
	for (unsigned k = 0; k < job->series.count * job->series.block; k++)
		if (!series_usable(job->trace, job->first + k))
			return flags | ESTIMATE_FLAG_GAPS;
	return flags;
}

/* The frequency as the study has it. */
static double three_cycles(const struct job *job)
{
	double noise = isfinite(job->trace->noise_g) ? job->trace->noise_g : 0;
	struct crossings crossings;

	crossings_find(&crossings, job->trace, job->first, job->last, job->modes.p[MODES_OFFSET],
	               fmax(SWING_NOISE * noise, SWING_LEVEL * job->span->peak_g));
	if (crossings.count < CROSSINGS_MAX)
		return NAN;
	return 3 / (crossings.time_s[CROSSINGS_MAX - 1] - crossings.time_s[0]);
}

static void conclude(struct job *job, struct ringdown *ringdown)
{
	struct estimate_how *how = &ringdown->result.how;

	express(job, ringdown);
	if (passes(job, &job->modes))
		meet_tolerance(job, ringdown);
	else
		job->flags |= ESTIMATE_FLAG_MODEL;
	how->method = method_of(job);
	how->chi_square = chi_square(job, &job->modes);
	how->flags = shape_flags(job);
	how->status = ESTIMATE_OK;
	memcpy(how->path, job->path, sizeof(how->path));
	ringdown->result.three_cycle_frequency_hz = three_cycles(job);
}

void ringdown_find(const struct trace *trace, const struct ringdown_span *span, struct ringdown *ringdown)
{
	struct ringdown found = {.result = {.frequency_hz = NAN,
	                                    .sigma_hz = NAN,
	                                    .natural_frequency_hz = NAN,
	                                    .sigma_natural_hz = NAN,
	                                    .damping_ratio = NAN,
	                                    .sigma_damping = NAN,
	                                    .small_swing_hz = NAN,
	                                    .amplitude_g = NAN,
	                                    .second_frequency_hz = NAN,
	                                    .second_damping_ratio = NAN,
	                                    .three_cycle_frequency_hz = NAN,
	                                    .how = {.method = "", .chi_square = NAN}}};
	struct job job;
	enum estimate_status *status = &found.result.how.status;

	memset(&job, 0, offsetof(struct job, series));
	job.trace = trace;
	job.span = span;
	job.first = trace_index(trace, span->from_s);
	job.last = trace_index(trace, span->until_s);
	*status = ESTIMATE_SHORT;
	if (isfinite(span->from_s) && job.first + SAMPLES_MIN <= job.last &&
	    (span->peak_g > 0 || trace->noise_g > 0)) {
		*status = start(&job);
		if (*status == ESTIMATE_OK)
			*status = judge(&job);
		if (*status == ESTIMATE_OK) {
			escalate(&job);
			walk_back(&job);
			conclude(&job, &found);
		}
	}
	*ringdown = found;
}

struct value {
	double value, sigma;
	bool agree;
};

/* By the inverse squares of their own uncertainties. Where the two disagree, half of what they are apart is
 * added. One difference says little of its own size, so chance does not widen. */
static struct value weighted_mean(double a, double sigma_a, double b, double sigma_b)
{
	/* Data without noise must not divide by zero. */
	double sa = fmax(sigma_a, 1e-12 * fabs(a)), sb = fmax(sigma_b, 1e-12 * fabs(b));
	double wa = 1 / (sa * sa), wb = 1 / (sb * sb);
	struct value mean = {(wa * a + wb * b) / (wa + wb), 0, fabs(a - b) < AGREE * hypot(sa, sb)};

	mean.sigma = hypot(sqrt(1 / (wa + wb)), mean.agree ? 0 : (a - b) / 2);
	return mean;
}

/* Mounts that stiffen or soften hand swing from one axis to the other: what one seems to lose the other seems
 * to keep. The weights go as the swings' squares, as their energy does, so that the mean is hardly touched.
 */
static struct value mean_of_laws(double a, double sigma_a, double b, double sigma_b)
{
	struct value mean = weighted_mean(a, sigma_a, b, sigma_b);

	mean.agree = mean.agree || fabs(a - b) < LAW_APART * mean.value;
	if (mean.agree)
		mean.sigma = hypot(1 / hypot(1 / sigma_a, 1 / sigma_b), LAW_DAMPING * mean.value);
	return mean;
}

static double mean_of(double a, double b)
{
	return isnan(a) ? b : isnan(b) ? a : (a + b) / 2;
}

void ringdown_combine(const struct ringdown *x, const struct ringdown *y, struct estimate_ringdown *combined)
{
	const struct estimate_ringdown *a = &x->result, *b = &y->result;
	struct estimate_ringdown found = b->sigma_hz < a->sigma_hz ? *b : *a;
	struct value mean;
	unsigned flags = a->how.flags | b->how.flags;
	bool agree;

	if (a->how.status != ESTIMATE_OK || b->how.status != ESTIMATE_OK) {
		*combined = b->how.status == ESTIMATE_OK ? *b : *a;
		return;
	}
	mean = weighted_mean(a->frequency_hz, a->sigma_hz, b->frequency_hz, b->sigma_hz);
	found.frequency_hz = mean.value;
	found.sigma_hz = mean.sigma;
	agree = mean.agree;
	if (!mean.agree && fabs(a->frequency_hz - b->frequency_hz) > APART_MAX * mean.value)
		found.how.status = ESTIMATE_AMBIGUOUS;
	mean = weighted_mean(a->natural_frequency_hz, a->sigma_natural_hz, b->natural_frequency_hz,
	                     b->sigma_natural_hz);
	found.natural_frequency_hz = mean.value;
	found.sigma_natural_hz = mean.sigma;
	mean = (flags & ESTIMATE_FLAG_AMPLITUDE ? mean_of_laws : weighted_mean)(
	        a->damping_ratio, a->sigma_damping, b->damping_ratio, b->sigma_damping);
	found.damping_ratio = mean.value;
	found.sigma_damping = hypot(mean.sigma, COMMON * fmin(a->sigma_damping, b->sigma_damping));
	agree = agree && mean.agree;
	found.small_swing_hz = mean_of(a->small_swing_hz, b->small_swing_hz);
	found.amplitude_g = hypot(a->amplitude_g, b->amplitude_g);
	found.three_cycle_frequency_hz = mean_of(a->three_cycle_frequency_hz, b->three_cycle_frequency_hz);
	found.how.flags = flags | (agree ? 0u : ESTIMATE_FLAG_MODEL);
	*combined = found;
}
