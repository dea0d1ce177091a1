/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_WINDOW_H
#define DT_HOST_SHOCK_WINDOW_H
/*
 * Every shock of a long record as a record of its own: a stretch of time around it, from the last quarter of
 * the pause before (250 ms at most) to that of the next shock (1 s at most). What several channels see within
 * a hold-off is one shock. Times stay those of the long record.
 */
#include "host/shock/events.h"

struct shock_window {
	struct event event; /* the largest of the channels that saw it */
	double from_s, to_s;
};

struct shock_windows {
	struct shock_window *window; /* in the order of time */
	size_t count;
};

/* All of them, however many. 0 or DT_E_MEMORY; freed by shock_windows_free after success. */
DT_MUST_USE int shock_windows_find(const struct record *record, const struct events_options *options,
                                   struct shock_windows *windows);
void shock_windows_free(struct shock_windows *windows);

/* The samples of [from_s, to_s] as a record; channels without one of them are left out. 0; DT_E_EMPTY where
 * no channel has two; DT_E_MEMORY. *cut is initialised by the call and freed by record_free after success. */
DT_MUST_USE int shock_window_cut(const struct record *record, double from_s, double to_s, struct record *cut);

#endif
