/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PHASOR_H
#define DT_HOST_ESTIMATE_PHASOR_H
/*
 * A cosine and its sine at evenly spaced instants, each by one turn of the last: no function of libm per
 * sample. Angles in rad; rounding grows with the turns, by one of the last digit each at most.
 */
#include <math.h>

struct phasor {
	double cosine, sine, step_cosine, step_sine;
};

/* At angle, to be turned by step. */
static inline struct phasor phasor_at(double angle, double step)
{
	return (struct phasor){cos(angle), sin(angle), cos(step), sin(step)};
}

static inline void phasor_turn(struct phasor *r)
{
	double cosine = r->cosine * r->step_cosine - r->sine * r->step_sine;

	r->sine = r->sine * r->step_cosine + r->cosine * r->step_sine;
	r->cosine = cosine;
}

#endif
