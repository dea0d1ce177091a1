/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown_private.h"

#include <math.h>
#include <string.h>

#include "host/estimate/limits.h"
#include "host/estimate/outlier.h"

#define F_LIMIT 7.0

/* How much stiffer than at the largest swing a spring is to start from, or less stiff. */
#define SPRING_B 0.3

enum { OUTLIER_ROUNDS = 3, THIN_MIN = 48 };

/* All samples of the series into it, and a fit through all but so many outliers. */
static bool fit_inliers(struct ringdown_job *job, struct modes *modes, unsigned *out)
{
	struct block_means *series = &job->series;
	bool usable[BLOCK_MEANS_MAX];

	block_means_take(series, job->trace, job->first, job->first + (size_t)series->count * series->block,
	                 job->span->from_s, 1);
	memcpy(usable, series->good, series->count);
	*out = 0;
	if (!modes_fit(modes, series))
		return false;
	for (int i = 0; i < OUTLIER_ROUNDS; i++) {
		unsigned before = *out;

		*out = outlier_drop(series, modes, usable);
		if ((*out > 0 || before > 0) && !modes_fit(modes, series))
			return false;
		if (*out == before)
			break;
	}
	return true;
}

bool ringdown_full(struct ringdown_job *job)
{
	struct modes modes = job->single;
	struct block_means blocks = job->series;
	unsigned out;

	if (!fit_inliers(job, &modes, &out)) {
		job->series = blocks;
		return false;
	}
	if (out > 0)
		job->flags |= ESTIMATE_FLAG_SPIKE;
	if (out == 0 && !ringdown_passes(job, &modes)) {
		/* Nothing gained: what follows is cheaper on blocks. */
		job->series = blocks;
		modes = job->single;
		if (!modes_fit(&modes, &job->series))
			return false;
	}
	job->modes = modes;
	job->single = modes;
	return true;
}

/* By how much the richer fit is better than one mode, per unknown and in its own residual. */
static double f_test(const struct ringdown_job *job, const struct modes *richer)
{
	double more = modes_size(richer) - modes_size(&job->single);

	return (job->single.fit.squares - richer->fit.squares) / more /
	       (richer->fit.squares / ringdown_freedom(job, richer));
}

static double information(const struct ringdown_job *job, const struct modes *modes)
{
	double n = job->series.used;

	return n * log(modes->fit.squares) + modes_size(modes) * log(n);
}

/* Takes the candidate for the best so far if it is. */
static void consider(struct ringdown_job *job, const struct modes *candidate)
{
	if (f_test(job, candidate) > F_LIMIT && information(job, candidate) < information(job, &job->modes))
		job->modes = *candidate;
}

static void fit_hum(struct ringdown_job *job)
{
	const double mine = job->trace->hum_hz, hz[] = {50, 60, mine};
	const size_t count = mine > 0 && mine != 50 && mine != 60 ? 3 : 2;

	ringdown_try(job, "full+hum");
	for (size_t i = 0; i < count; i++) {
		struct modes modes = job->single;

		modes.hum_hz = hz[i];
		if (modes_linear(&modes, &job->series) && modes_fit(&modes, &job->series))
			consider(job, &modes);
	}
}

/* Returns k of the quadratic law; 0 when it cannot be fitted. */
static double try_square(struct ringdown_job *job)
{
	struct modes modes = job->single;

	modes.law = MODES_LAW_SQUARE;
	modes.p[MODES_LAW] = 0;
	if (!modes_fit(&modes, &job->series))
		return 0;
	consider(job, &modes);
	return modes.p[MODES_LAW];
}

static void try_spring(struct ringdown_job *job, const struct ringdown_law *law)
{
	struct modes modes = job->single;
	double swing = modes_swing_g(&modes, 0);

	modes.law = MODES_LAW_SPRING;
	modes.p[MODES_DECAY] = law->decay;
	modes.p[MODES_OMEGA] = law->omega;
	modes.p[MODES_COSINE] *= -1;
	modes.p[MODES_SINE] *= -1;
	modes.p[MODES_LAW] = law->q / (swing * swing);
	modes.p[MODES_LAW + 1] = law->d;
	if (modes_fit(&modes, &job->series))
		consider(job, &modes);
}

/* The mount that softens, or stiffens, as the quadratic law has it. */
static void try_spring_like(struct ringdown_job *job, double k)
{
	const double *p = job->single.p;

	try_spring(job, &(struct ringdown_law){
	                        .decay = p[MODES_DECAY],
	                        .omega = p[MODES_OMEGA] - k / 2,
	                        .q = 1,
	                        .d = (k < 0 ? SPRING_B / (1 + SPRING_B) : -SPRING_B / (1 - SPRING_B)) / 2});
}

/* A second mode's frequency over the first's, or the first's over it, to start from. */
#define ASIDE 1.15

/* Two modes from the one and another beside it; false unless both come out as decays. */
static bool ringdown_models_fit_two(struct modes *modes, const struct ringdown_job *job, double aside)
{
	*modes = (struct modes){.count = 2};
	for (unsigned m = 0; m < 2; m++) {
		modes->p[MODES_DECAY + MODES_EACH * m] = job->single.p[MODES_DECAY];
		modes->p[MODES_OMEGA + MODES_EACH * m] = (m ? aside : 1) * job->single.p[MODES_OMEGA];
	}
	return modes_fit(modes, &job->series) && ringdown_decays(modes, 0) && ringdown_decays(modes, 1);
}

/* Two modes that are surely nearer than the stronger's width, or not surely apart, are one as far as anyone
 * can tell. */
static bool separable(const struct ringdown_job *job, const struct modes *modes)
{
	const double *p = modes->p, *own = p + MODES_EACH * modes_stronger(modes);
	double row[CHOLESKY_MAX] = {0}, apart, unsure;

	row[MODES_OMEGA] = 1;
	row[MODES_OMEGA + MODES_EACH] = -1;
	apart = fabs(p[MODES_OMEGA] - p[MODES_OMEGA + MODES_EACH]);
	unsure = ringdown_sigma_point(job, modes) * sqrt(cholesky_variance(&modes->fit.factor, row));
	return apart + 2 * unsure >= own[MODES_DECAY] && apart >= LIMIT_AGREE * unsure;
}

/* From either side of the one mode, the second only where the first does not pass. */
static void try_two(struct ringdown_job *job)
{
	static const double aside[] = {1 / ASIDE, ASIDE};
	struct modes modes, best = job->single;

	ringdown_try(job, "two-modes");
	for (size_t i = 0; i < sizeof(aside) / sizeof(aside[0]) && !ringdown_passes(job, &best); i++)
		if (ringdown_models_fit_two(&modes, job, aside[i]) && modes.fit.squares < best.fit.squares)
			best = modes;
	if (best.count < 2)
		return;
	if (separable(job, &best))
		consider(job, &best);
	else if (!ringdown_passes(job, &job->modes))
		job->flags |= ESTIMATE_FLAG_NOT_SEPARABLE;
}

/* Two modes or a law that are grossly refused are no ground to say where the frequency goes as the swing
 * vanishes, or what the modes are: the mean of the window stays, and how far the other would have led from it
 * is doubt. */
static void distrust(struct ringdown_job *job)
{
	const double *other = job->modes.p + MODES_EACH * modes_stronger(&job->modes);

	job->doubt_omega = fabs(other[MODES_OMEGA] - job->single.p[MODES_OMEGA]);
	job->doubt_decay = fabs(other[MODES_DECAY] - job->single.p[MODES_DECAY]);
	job->modes = job->single;
}

/* What was found before, but the path that has been gone since. */
static void ringdown_models_restore(struct ringdown_job *job, const struct ringdown_job *before)
{
	const char *path[ESTIMATE_PATH_MAX];
	unsigned tried = job->tried;

	memcpy(path, job->path, sizeof(path));
	*job = *before;
	memcpy(job->path, path, sizeof(path));
	job->tried = tried;
}

/* Whatever is more than one mode; into job->modes if it is better. */
static void search(struct ringdown_job *job)
{
	double k;

	ringdown_try(job, "amplitude");
	k = try_square(job);
	try_two(job);
	if (!ringdown_passes(job, &job->modes) && fabs(k) > 0)
		try_spring_like(job, k);
}

/* Where holes leave no blocks but many whole ones, these are enough to look for more than one mode, and what
 * is found is a start for all samples. */
static void look_on_blocks(struct ringdown_job *job, void (*look)(struct ringdown_job *job))
{
	const unsigned points =
	        ringdown_block(job, job->single.p[MODES_OMEGA] * RINGDOWN_FINER) / job->series.block;
	const struct modes single = job->single;
	struct block_means all;
	struct modes found;

	if (points < 2) {
		look(job);
		return;
	}
	all = job->series;
	block_means_thin(&job->series, &all, points);
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

void ringdown_try_hum(struct ringdown_job *job)
{
	look_on_blocks(job, fit_hum);
}

static void search_law(struct ringdown_job *job)
{
	try_spring(job, job->span->law);
}

/* Whether what another axis needed passes here; if not, nothing has changed. */
static bool is_like_another(struct ringdown_job *job)
{
	if (job->span->law == NULL)
		return false;
	look_on_blocks(job, search_law);
	if (ringdown_passes(job, &job->modes)) {
		ringdown_try(job, "amplitude");
		return true;
	}
	job->modes = job->single;
	return false;
}

void ringdown_try_richer(struct ringdown_job *job)
{
	const struct ringdown_job before = *job;

	if (!ringdown_lengthen(job)) {
		ringdown_models_restore(job, &before);
		return;
	}
	if (!is_like_another(job))
		look_on_blocks(job, search);
	if (ringdown_passes(job, &job->modes))
		job->flags &= ~(unsigned)ESTIMATE_FLAG_NOT_SEPARABLE;
	else if (ringdown_chi_square(&before, &before.modes) < ringdown_chi_square(job, &job->modes))
		ringdown_models_restore(job, &before);
	else if (ringdown_chi_square(job, &job->modes) > LIMIT_GROSS)
		distrust(job);
}
