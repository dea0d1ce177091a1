/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_FIT_BY_HAND_H
#define DT_TESTS_UNIT_FIT_BY_HAND_H
/*
 * Drops for fits, from the bench's product (hil/product.h), which shares no formula with the fit: scatter of
 * angle, speed, gains and cross-axis, the sensors' high-pass, noise, converter codes.
 */
#include <gsl/gsl_rng.h>

#include "host/fit/fit.h"

enum { BY_HAND_X = 1050, BY_HAND_Y = 1500, BY_HAND_BEFORE_MS = 100 };

struct by_hand {
	struct scene truth; /* at the set angle and height */
	double gain_sd[2];  /* of each drop */
	double common[4];   /* the same in all */
	double noise_g, colour /* share that the noise keeps from sample to sample */;
	double clip_g;              /* cut there and marked; 0: never */
	double mode_hz, mode_share; /* a case that rings: of S2Y */
	double late_s;              /* S2's channels read what was so long before */
};

struct by_hand_drop {
	struct fit_drop drop;
	double angle_deg, speed_m_s; /* true */
	double value[4][BY_HAND_Y];
	uint8_t sample[4][BY_HAND_Y];
};

void by_hand_drop(const struct by_hand *h, gsl_rng *random, struct by_hand_drop *d);

/* What is true of it: contact time, restitution of the centre of gravity, lags of resultants and of X, spin.
 */
struct by_hand_truth {
	double contact_s, restitution, lag_s, lag_x_s, spin_rad_s;
};
struct by_hand_truth by_hand_truth(const struct by_hand *h, const struct by_hand_drop *d);

#endif
