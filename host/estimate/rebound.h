/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_REBOUND_H
#define DT_HOST_ESTIMATE_REBOUND_H
/*
 * How fast the product leaves, over how fast it came, in two ways that share no error:
 *
 *   velocity   the velocity changes of the case's axes, added as a vector: dv / v - 1. Gain and cross talk of
 *              the sensor go into it whole, and its sigma knows nothing of them.
 *   flight     g t / (2 v) for a flight of t from the end of the contact to the second impact, where the
 *              record has it: a clock is far better than a gain, as long as the product comes back to the
 *              height it left, on the corner it left with.
 *
 * The second impact is where the case reads as much again as rebound_again_g says. Status: short without a
 * velocity change, clipped when an axis is; ambiguous when the two differ by more than a tenth and by
 * more than three sigma.
 */
#include "host/estimate/peak.h"

enum { REBOUND_AXES = 3 };

/* The axes of the case that there are; an axis without a velocity change counts as none. */
struct rebound_axes {
	unsigned count;
	const struct trace *trace[REBOUND_AXES];
	const struct peak *peak[REBOUND_AXES];
	const struct estimate_pulse *pulse[REBOUND_AXES];
};

/* What a channel reads when it is hit again, at least: this part of the first peak, peak_g, and so much noise
 * that chance does not in a whole record. */
double rebound_again_g(const struct trace *trace, double peak_g);

/* impact_speed_m_s and gravity_m_s2, with which it flies, must be positive. */
void rebound_find(const struct rebound_axes *axes, double impact_speed_m_s, double gravity_m_s2,
                  struct estimate_rebound *rebound);

#endif
