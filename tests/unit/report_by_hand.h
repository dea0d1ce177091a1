/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_REPORT_BY_HAND_H
#define DT_TESTS_UNIT_REPORT_BY_HAND_H
/*
 * A record and an analysis made by hand, for the tests of what is told of them.
 */
#include "host/report/facts.h"

enum { HAND_CHANNELS = 6 };

struct report_hand {
	struct record record;
	struct analysis analysis;
	struct estimate_channel estimates[HAND_CHANNELS];
	struct scene scene;
	struct model_prediction prediction;
	struct report report;
};

/* *state is a struct report_hand: half-sines of 3 ms at 100 ms, S1 later and smaller. */
int report_set_up(void **state);
int report_tear_down(void **state);

/* Takes ticks 104 and 105 of S1 away and marks an S2 sample as clipped. */
void report_make_holes(struct report_hand *f);

/* The report as text, to be freed. No line of it is too long, and none has a "nan". */
char *report_print(const struct report *report);

void report_check_has(const char *text, const char *piece);
size_t report_count_of(const char *text, const char *piece);

#endif
