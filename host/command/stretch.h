/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_STRETCH_H
#define DT_HOST_COMMAND_STRETCH_H
/*
 * Of a long record the stretches that --shock, --every-shock and --window name.
 */
#include <math.h>

#include "common/base/option.h"
#include "host/shock/window.h"

struct stretch {
	bool every_shock;
	unsigned shock;     /* by its number, from 1; 0: none */
	double window_s[2]; /* NAN: none */
	bool whole;         /* none of them means all of the record, however long */
};

/* None of them. */
#define STRETCH_ALL ((struct stretch){.window_s = {NAN, NAN}})

/* Their rows; in: the struct that is read into, at: its member. */
#define STRETCH_ROWS(in, at)                                                                                \
	OPTION_UNSIGNED("shock", "N", in, at.shock, 1, 1e9,                                                 \
	                "only the stretch about the N-th shock of a long record, in the order of time"),    \
	        OPTION_FLAG("every-shock", in, at.every_shock, "a result for each shock of a long record"), \
	        OPTION_TAKEN("window", "FROM:TO", in, at.window_s, stretch_take_window,                     \
	                     "only so much of the record, s")

option_take stretch_take_window;

/* Whether more than one is asked for. */
bool stretch_is_twofold(const struct stretch *stretch);

/* Calls each for every stretch that is named, a record of its own with its number, or for the record itself
 * where none is; of one that is very long, for each shock, and says so on stderr. The exit code of the last
 * that is not COMMAND_DONE, or COMMAND_INPUT where there is no such shock or no sample, errors printed. */
int stretch_each(struct record *record, const struct stretch *stretch, const struct events_options *events,
                 int (*each)(struct record *cut, void *context), void *context);

#endif
