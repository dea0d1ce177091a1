/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PHASOR_H
#define DT_HOST_ESTIMATE_PHASOR_H
/*
 * A cosine and its sine at evenly spaced instants, decaying or not, each by one turn of the last: no function
 * of libm per sample. Angles in rad; rounding grows with the turns, by one of the last digit each at most.
 */
#include <math.h>

#include "host/estimate/simd2.h"

struct phasor {
	double cosine, sine, step_cosine, step_sine;
};

/* At angle, to be turned by step. */
static inline struct phasor phasor_at(double angle, double step)
{
	return (struct phasor){cos(angle), sin(angle), cos(step), sin(step)};
}

/* e^{(-decay + i omega) t} at from_s, to be turned by step_s. */
static inline struct phasor phasor_decaying(double decay, double omega, double from_s, double step_s)
{
	double size = exp(-decay * from_s), turn = exp(-decay * step_s);

	return (struct phasor){size * cos(omega * from_s), size * sin(omega * from_s),
	                       turn * cos(omega * step_s), turn * sin(omega * step_s)};
}

static inline void phasor_turn(struct phasor *r)
{
	double cosine = r->cosine * r->step_cosine - r->sine * r->step_sine;

	r->sine = r->sine * r->step_cosine + r->cosine * r->step_sine;
	r->cosine = cosine;
}

/* At two instants side by side; a turn leads to the next two. */
struct phasor_pair {
	PAIR cosine, sine;
	double step_cosine, step_sine;
};

static inline struct phasor_pair phasor_two(struct phasor r)
{
	struct phasor next = r;

	phasor_turn(&next);
	return (struct phasor_pair){{r.cosine, next.cosine},
	                            {r.sine, next.sine},
	                            r.step_cosine * r.step_cosine - r.step_sine * r.step_sine,
	                            2 * r.step_cosine * r.step_sine};
}

static inline void phasor_pair_turn(struct phasor_pair *r)
{
	const PAIR cosine = r->cosine * r->step_cosine - r->sine * r->step_sine;

	r->sine = r->sine * r->step_cosine + r->cosine * r->step_sine;
	r->cosine = cosine;
}

#endif
