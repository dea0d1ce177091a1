/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_RINGDOWN_PRIVATE_H
#define DT_HOST_ESTIMATE_RINGDOWN_PRIVATE_H
/*
 * What the parts of ringdown share: one channel's decay on its way through the methods.
 *   ringdown.c           the order of attempts, and what the last of them says
 *   ringdown_span.c      where the decay begins and ends: window, block, the start of the fit
 *   ringdown_residual.c  what the residual says of a fit
 *   ringdown_models.c    what a residual that is refused asks for
 *   ringdown_combine.c   two axes as one
 */
#include "host/estimate/block_means.h"
#include "host/estimate/modes.h"
#include "host/estimate/ringdown.h"

/* What of the swing is small enough not to matter whatever the noise. */
#define RINGDOWN_SWING_MODEL 1e-4

/* So many blocks more to a cycle where the start is known, and for two modes or a law. */
#define RINGDOWN_FINER 1.3

struct ringdown_job {
	const struct trace *trace;
	const struct ringdown_span *span;
	size_t first, last;              /* all there is */
	struct modes modes;              /* the best so far */
	struct modes single;             /* one mode, nothing else */
	double total;                    /* squares of the series it began with, about its mean */
	double doubt_omega, doubt_decay; /* of the values beyond their scatter */
	unsigned flags;
	const char *path[ESTIMATE_PATH_MAX];
	unsigned tried;
	struct block_means series; /* what is fitted; large, so it is last and not cleared */
};

/* ---- ringdown.c ---- */

/* Notes a method in the path. */
void ringdown_try(struct ringdown_job *job, const char *method);

/* Whether mode m loses its swing, and is damped less than the most. */
bool ringdown_decays(const struct modes *modes, unsigned m);

/* ---- ringdown_span.c ---- */

/* Samples of a block where a cycle needs no more points. */
unsigned ringdown_block(const struct ringdown_job *job, double omega);

/* One mode, from crossings, or where these are doubtful from a scan. */
enum estimate_status ringdown_start(struct ringdown_job *job);

/* One mode from where the span says, where the decay is known to begin; the window a little longer, the
 * blocks finer. */
bool ringdown_restart(struct ringdown_job *job, double omega, double decay);

/* More unknowns need a longer look and finer blocks. Not once outliers are out: they would be back. False
 * when one mode does not fit there. */
bool ringdown_lengthen(struct ringdown_job *job);

/* The decay may have been free before from_s. */
void ringdown_reach_back(struct ringdown_job *job);

/* ---- ringdown_residual.c ---- */

unsigned ringdown_freedom(const struct ringdown_job *job, const struct modes *modes);

/* Reduced chi-square; NAN without a noise to hold it against. */
double ringdown_chi_square(const struct ringdown_job *job, const struct modes *modes);

/* A residual as large as chance makes it, or one nobody can judge. */
bool ringdown_passes(const struct ringdown_job *job, const struct modes *modes);

/* Standard deviation of a point: the larger of the noise and the residual. */
double ringdown_sigma_point(const struct ringdown_job *job, const struct modes *modes);

/* Of the fit it began with: the part of what is not noise that it explains. */
double ringdown_explained(const struct ringdown_job *job);

/* What it takes from the sum of squares, in the noise's variance: how far it stands out. */
double ringdown_gain(const struct ringdown_job *job);

/* ---- ringdown_models.c ---- */

/* Every sample, outliers left out: who is one shows better each time they are gone. False, and nothing
 * changed, when that fails. */
bool ringdown_full(struct ringdown_job *job);

/* Mains terms. */
void ringdown_try_hum(struct ringdown_job *job);

/* A law or two modes; nothing changes when one mode no longer fits. */
void ringdown_try_richer(struct ringdown_job *job);

#endif
