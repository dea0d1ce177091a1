/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CROSSINGS_H
#define DT_HOST_ESTIMATE_CROSSINGS_H
/*
 * Zero crossings of a swing: where a decay's fit starts from, and the frequency as the study has it. One
 * counts once the swing has passed a threshold on the other side; noise may cross zero several times on the
 * way, and the middle of the first and the last is taken. Ends with the swings: when none has passed the
 * threshold for longer than two and a half half-cycles.
 */
#include "host/estimate/trace.h"

enum { CROSSINGS_MAX = 7 }; /* end to end three cycles */

struct crossings {
	unsigned count;
	double time_s[CROSSINGS_MAX];
	double swing_g[CROSSINGS_MAX]; /* largest magnitude after crossing i, before the next */
	double swing_s[CROSSINGS_MAX];
	bool ended; /* samples ran out, rather than the swings */
};

/* Among the usable samples [first, last), offset_g taken off. */
void crossings_find(struct crossings *found, const struct trace *trace, size_t first, size_t last,
                    double offset_g, double threshold_g);

/* Angular frequency and decay rate per s of the swings; false unless they are three: one cycle. */
bool crossings_start(const struct crossings *found, double *omega, double *decay);

#endif
