/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CLIP_H
#define DT_HOST_ESTIMATE_CLIP_H
/*
 * A sensor at its limit repeats its extreme. Groups of samples that equal the trace's extreme are marked
 * SAMPLE_CLIPPED and TRACE_LIMIT: three, no further than three samples apart and at least half of what they
 * span; two where chance does not make samples equal; one at the channel's known range. Only extremes on the
 * outside count: half the largest magnitude or more, so that the small side of a one-sided shock is not taken
 * for one. Coarse numbers make two samples equal, or a round top level: those are marked once the noise is
 * known, if none between them is lower and the samples to either side foretell more than they show.
 * trace_open calls it without (NAN).
 */
#include "host/estimate/trace.h"

/* Where samples tremble by so many steps of their numbers three are not equal by chance. */
#define CLIP_TREMBLE 20.0

enum { CLIP_WINDOW = 256 }; /* samples the step of the numbers is looked for in, from the first on */

/* The step of the numbers that samples come in, in g: the least rise; 0 where none rises. */
double clip_step(const struct trace *trace);

/* The same where it is more than twice the noise and all of the event comes in it: readings that do not
 * average out. 0 elsewhere. */
double clip_resolution(const struct trace *trace, double noise_g);

void clip_mark(struct trace *trace, double noise_g);

#endif
