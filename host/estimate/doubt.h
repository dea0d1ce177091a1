/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_DOUBT_H
#define DT_HOST_ESTIMATE_DOUBT_H
/*
 * What a record itself says against the numbers that are taken from it. Each check looks at one thing that no
 * intact sensor on a shock does; what it touches is clipped, flagged or widened.
 *
 * doubt_plateau: a top that falls off on both sides and trembles less than the noise is a cut of unknown
 * range.
 *
 * doubt_channel: a fall to rest within one sample, or a step under the pulse, is "step". A zero after the
 * pulse that is not the one before is "tail", and widens peak and velocity change. A force that fades on is
 * "tail", and widens the velocity change. A top that trembles as the noise about a level is "flat_top". What
 * rings on after the pulse faster than a plate is "rough". The width of a pulse of fewer than twelve samples
 * is widened.
 *
 * doubt_share: what an axis' noise hides its sensor's strongest axis shows: flags, and widened bars.
 *
 * doubt_axes: what two sensors of two axes say against each other is "axes_disagree".
 */
#include "host/estimate/estimate.h"
#include "host/estimate/peak.h"
#include "host/estimate/trace.h"

/* Marks the samples of a cut top as at the limit. Zero is not taken off yet; noise_g is per sample. */
void doubt_plateau(struct trace *trace, double noise_g);

/* After pulse_measure: the channel's peak and pulse. Of a plate, which swings on by its nature, what fades is
 * no "tail". */
void doubt_channel(const struct trace *trace, const struct estimate_baseline *baseline, bool swings,
                   struct peak *peak, struct estimate_pulse *pulse);

/* After doubt_channel. What the chain leaves: noise that is gone at the record's end is a cable's, flagged
 * "cable"; a zero there that is not the one before is "tail" and widens; a sample left out or repeated on a
 * flank is "step". */
void doubt_chain(struct trace *trace, const struct estimate_baseline *baseline, struct peak *peak,
                 struct estimate_pulse *pulse);

/* Of an axis of S2 as read, in its event: the largest of two samples side by side, from its middle. */
double doubt_height_g(const struct trace *trace);

/* Of an axis of S2 as read, in its event: until when it was quiet before its first contact; INFINITY where
 * noise hides that, or it begins so. */
double doubt_touch_s(const struct trace *trace);

/* Of an axis of S2 as read, in its event: when a contact larger than the first begins; INFINITY: none does.
 */
double doubt_slap_s(const struct trace *trace);

/* What the sensor's strongest axis shows of their one pulse where another one's noise hides it: a flat top,
 * an unsure time, that no family is it; near noise, that its time, width or velocity change is another. */
void doubt_share(const struct trace *const trace[2], struct peak *const peak[2],
                 struct estimate_pulse *const pulse[2]);

/* X and Y of S1, then of S2; all four are there. Flags that any of them got: their resultants have them too.
 */
unsigned doubt_axes(const struct trace *const trace[2][2], struct estimate_channel *const channel[2][2]);

#endif
