/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CLIP_H
#define DT_HOST_ESTIMATE_CLIP_H
/*
 * A sensor at its limit repeats its extreme. Groups of samples that equal the trace's extreme are marked
 * SAMPLE_CLIPPED and TRACE_LIMIT: three, no further than three samples apart and at least half of what they
 * span, that fall off beside by more than a few steps of their numbers; two where chance does not make
 * samples equal; one at the channel's known range. Only extremes on the outside count: half the largest
 * magnitude or more, so that the small side of a one-sided shock is not taken for one. trace_open calls it.
 *
 * Others may be equal by chance (trace->twins): coarse numbers make a round top level. clip_judge_twins marks
 * them, once the noise is known, if the samples to either side foretell more than they show.
 */
#include "host/estimate/trace.h"

enum { CLIP_WINDOW = 256 }; /* samples the step of the numbers is looked for in, from the first on */

/* The step of the numbers that samples come in, in g: the least rise; 0 where none rises. */
double clip_step(const struct trace *trace);

void clip_mark(struct trace *trace);
void clip_judge_twins(struct trace *trace, double noise_g);

#endif
