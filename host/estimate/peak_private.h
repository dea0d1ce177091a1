/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PEAK_PRIVATE_H
#define DT_HOST_ESTIMATE_PEAK_PRIVATE_H
/*
 * What the parts of peak share: one channel's peak, its width measured, on its way through the methods.
 *   peak.c          the highest sample, the order of methods, the model at an instant
 *   peak_top.c      what the samples at the top say against the value
 *   peak_clipped.c  samples at a limit or beyond the range: from the flanks
 *   peak_weak.c     an axis by the shape of its sensor's strongest one
 *   peak_driven.c   S1's by the oscillator that S2 drives (driven.h)
 */
#include "host/estimate/peak.h"

/* Below this many sigma an axis is weak. */
#define PEAK_WEAK_SIGMAS 10.0

/* One more method on the path. */
void peak_tried(struct estimate_how *how, const char *name);

/* What the samples at the top say against the curve that gave the value, into its bars. */
void peak_top_doubt(const struct trace *trace, struct peak *peak);

/* The family's fit into peak->shape; false when there is none. */
bool peak_fit(const struct trace *trace, enum estimate_family family, struct peak *peak);

/* That fit as the value. */
void peak_take_shape(struct peak *peak);

/* The family that is given, or polynomials, and families from there. */
void peak_climb(const struct trace *trace, const struct estimate_options *options, struct peak *peak);

/* The same where samples under the pulse are clipped; false where none is. */
bool peak_unclip(const struct trace *trace, const struct estimate_options *options, struct peak *peak);

#endif
