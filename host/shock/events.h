/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_EVENTS_H
#define DT_HOST_SHOCK_EVENTS_H
/*
 * The shocks of a long record, ordered by their peak: of every sensor by its magnitude, of every channel that
 * stands alone by its value (axes.h). One pass over the samples whatever their number, no memory but the
 * list, and the list is the same for a record as for one that goes on quietly.
 *
 * A shock begins when the reading leaves +-level about its rest, and is over when it has been inside for the
 * hold-off, so that what rings on after an impact belongs to it. Level: 8 sigma of the noise, and no less
 * than a fiftieth of the largest reading. Rest and noise are median and median deviation of at most 256
 * samples spread over the record. Samples that are missing begin and end nothing; what a hole hides is not
 * found.
 *
 * Peak and time by a parabola through three samples; width at a tenth of the peak; velocity change over that
 * width, of a sensor the magnitude of the vector.
 */
#include "host/shock/axes.h"

enum { EVENTS_MAX = 20 };

#define EVENTS_HOLD_OFF_S 0.02

struct event {
	char name[32]; /* of the sensor or channel */
	bool sensor;
	double time_s;
	double peak_g; /* signed for a channel */
	double duration_s;
	double velocity_change_m_s;
};

struct events {
	struct event event[EVENTS_MAX]; /* largest first */
	size_t count;
	size_t found; /* count and those that were smaller */
};

/* Every one, in the order in which they end, channel by channel; to be freed by who asks for it. */
struct event_list {
	struct event *event;
	size_t count, room;
	bool failed; /* for want of memory */
};

/* level_g 0: as said above; hold_off_s 0: EVENTS_HOLD_OFF_S; all NULL: the largest are enough. */
struct events_options {
	double level_g, hold_off_s;
	struct event_list *all;
};

/* 0 or DT_E_MEMORY. */
DT_MUST_USE int events_find(const struct record *record, const struct events_options *options,
                            struct events *events);

#endif
