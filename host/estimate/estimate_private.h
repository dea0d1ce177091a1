/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_ESTIMATE_PRIVATE_H
#define DT_HOST_ESTIMATE_ESTIMATE_PRIVATE_H
/*
 * What the parts of estimate share: one record while it is analysed.
 *   estimate.c          the order of it all; each channel by itself
 *   estimate_decay.c    where a channel's decay begins and ends; the plate's of two axes
 *   estimate_sensors.c  S1 on S2, and what that says of S1's peaks and decays; resultants and lag
 *   estimate_tolerance.c  what of a channel is less certain than asked
 *   estimate_name.c     words for status, flags and families
 */
#include "host/estimate/estimate.h"
#include "host/estimate/peak.h"
#include "host/estimate/ringdown.h"
#include "host/estimate/trace.h"

struct work {
	struct trace trace;
	bool first_of_two; /* contacts, the second of which is larger and left out */
	struct peak peak;
	const struct peak *strong; /* whose shape peak has (peak_weak); NULL: its own */
	struct ringdown_span span;
	struct ringdown ringdown;
};

/* Channels in the record's order. */
struct desk {
	const struct record *record;
	const struct estimate_options *options;
	struct work *work;
	double *scratch;
};

/* Index of the channel of that sensor of the tower, "S1" or "S2", and axis; the record's channel_count if
 * there is none. */
size_t estimate_find(const struct desk *desk, const char *sensor, char axis);

/* Every channel's ring-down, from the peaks and pulses. */
void estimate_decays(const struct desk *desk, struct analysis *analysis);

/* The resultants of the sensors that have X and Y, and where both have the lag; before them S1's peaks and
 * decays, by the oscillator that S2 drives. */
void estimate_sensors(const struct desk *desk, struct analysis *analysis);

/* X's and Y's ring-down of S1 as one, where it rings on its own. */
void estimate_plate(const struct desk *desk, struct analysis *analysis);

/* Flags peaks, pulses and contact times that are less certain than asked. Last: every check has widened its
 * bars. */
void estimate_tolerance(const struct desk *desk, struct analysis *analysis);

#endif
