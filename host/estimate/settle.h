/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SETTLE_H
#define DT_HOST_ESTIMATE_SETTLE_H
/*
 * A record that begins before its sensor's supply has settled: an offset that decays, larger than the pulse
 * at times. Where it is an exponential, that is fitted to the samples before the pulse and taken off; the
 * rest of it, a constant, is the baseline's.
 *
 * The exponential's samples are the most from the record's beginning on that it fits, found by letting them
 * grow until something else begins. It counts only where it moves by six times what it leaves, explains what
 * neither a constant nor a slope does, leaves little more than the samples' noise, and is followed to its end
 * or most of the way to the largest sample that is left. Other decays are the baseline's to doubt.
 *
 * No memory but the caller's.
 */
#include <stdbool.h>

#include "host/estimate/trace.h"

struct settle {
	double amplitude_g; /* at the trace's first sample */
	double time_constant_s;
	double until_s;    /* after the first sample, the end of what it was fitted to */
	double leaves_g;   /* root mean square of block means */
	bool extrapolated; /* seen for less than two time constants */
	bool inexact;      /* what it leaves is no noise */
};

/* False, and nothing changed, where there is none. */
bool settle_find(const struct trace *trace, struct settle *settle);

/* Takes it off and flags it. */
void settle_remove(struct trace *trace, const struct settle *settle);

#endif
