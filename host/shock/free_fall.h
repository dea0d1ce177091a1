/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_FREE_FALL_H
#define DT_HOST_SHOCK_FREE_FALL_H
/*
 * Free falls and the heights they were from, g t^2 / 2, of sensors that feel gravity (DC-coupled). A sensor
 * behind a high-pass reads 0 at rest and in the fall, and shows none.
 *
 * A fall is a run of at least 50 ms in which the magnitude of the sensor's axes, or of a channel that stands
 * alone, stays below 0.35 g; the reading was steady within 15 % of 1 g in the second before, and goes above
 * 2 g within 30 ms after, as something ended it. Of what is not free of rotation, rotation included: the
 * limit is not near 0 because a sensor off the centre of mass feels it.
 *
 * It lasts from where the reading falls through 0.5 g to where it rises through it. The uncertainty of either
 * is that of an instant anywhere between leaving 0.9 g and being below 0.35 g, with the sampling's.
 */
#include "host/shock/axes.h"

enum { FREE_FALLS_MAX = 20 };

struct free_fall {
	char name[32]; /* of the sensor or channel */
	bool sensor;
	double start_s, end_s;
	double duration_s, sigma_duration_s;
	double height_m, sigma_height_m;
};

struct free_falls {
	struct free_fall fall[FREE_FALLS_MAX]; /* in the order of the record's sensors and of time */
	size_t count;
};

/* The first FREE_FALLS_MAX, heights by the gravity at the site. One that several channels show is told once,
 * by the sensor with the most axes. 0 or DT_E_MEMORY. */
DT_MUST_USE int free_fall_find(const struct record *record, double gravity_m_s2, struct free_falls *falls);

#endif
