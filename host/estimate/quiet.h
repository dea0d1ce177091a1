/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_QUIET_H
#define DT_HOST_ESTIMATE_QUIET_H
/*
 * The quiet part of a trace: the samples before the largest pulse of its event window, the last 250 ms of
 * them that end one rise time before the pulse leaves 10 %; which of them are quiet indeed; and their mean,
 * deviation and means of blocks, values in g. No memory but the caller's; the trace is borrowed.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

/* As long as the study's pre-trigger and more: longer reaches into what happened before the fall. Means of a
 * block carry the mains nearly whole, and a slope. */
#define QUIET_S 0.25
#define QUIET_BLOCK_S 2e-3

enum {
	QUIET_SAMPLES_MIN = 32,
	QUIET_BLOCKS_MAX = 128, /* 250 ms of 2 ms each, and one that is not full */
};

struct quiet_block {
	double mean, weight;
	double place; /* -1..1 over the quiet part */
};

/* The quiet part in blocks. */
struct quiet {
	const struct trace *trace;
	const struct estimate_baseline *zero; /* is taken off each sample; NULL: nothing is */
	size_t from, until;                   /* [from, until) */
	size_t length;                        /* of a block */
	size_t count;
	bool doubtful;
	struct quiet_block block[QUIET_BLOCKS_MAX];
};

struct quiet_moments {
	double mean, deviation;
	size_t count, good; /* used, of so many */
};

/* The samples [from, until) of the quiet part before the largest. */
void quiet_find(const struct trace *trace, size_t *from, size_t *until);

/* Whether at least QUIET_SAMPLES_MIN of its samples are good. */
bool quiet_enough(const struct quiet *quiet);

/* Roughly where the middle of samples [from, until) is, from a few of them; *sigma_g, unless NULL, is the
 * standard deviation from their distances. */
double quiet_glance(const struct trace *trace, size_t from, size_t until, double *sigma_g);

/* Standard deviation of white noise in samples [from, until), from some of their second differences, in which
 * a smooth signal nearly vanishes; NAN of too few. */
double quiet_noise(const struct trace *trace, size_t from, size_t until);

/* Noise of means of 4 ms over what white noise of as many samples has: what estimators that look over a pulse
 * or a swing meet. 1 where samples side by side tremble as the whole does, or too few means tell. Zero is
 * taken off. */
double quiet_colour(const struct trace *trace, const struct estimate_baseline *baseline);

/* From its beginning on a quiet part decays: to the last piece of it that does not, or is as short as may be.
 * False, and unchanged, where it does not decay. */
bool quiet_settled(struct quiet *quiet);

/* Moments of what lies within reach of about, and the means of the blocks. */
struct quiet_moments quiet_take(struct quiet *quiet, double about, double reach);

/* Whether it holds more than noise: some of it is far quieter than the whole. */
bool quiet_restless(const struct quiet *quiet, double noise_g);

/* To the longest run of samples as quiet as the quietest, where others are not by far; false, and unchanged,
 * where there is none. */
bool quiet_narrow(struct quiet *quiet);

#endif
