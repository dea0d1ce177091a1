/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_JOIN_BY_HAND_H
#define DT_TESTS_UNIT_JOIN_BY_HAND_H
/*
 * A join and the drop by hand that is fed to it: what the tests of the join share.
 */
#include "host/record/join.h"
#include "tests/unit/drop_by_hand.h"

extern struct hand_drop drop; /* too large for the stack */
extern struct join *join;

/* For cmocka: a new join, and its end. */
int join_by_hand_begin(void **state);
int join_by_hand_end(void **state);

/* One block, both live blocks of some ticks, which are counted from the drop's first. */
void join_by_hand_feed(unsigned sensor, uint32_t tick, bool resent);
void join_by_hand_feed_both(uint32_t first, uint32_t last);

/* What join_feed says to the capture end. */
int join_by_hand_feed_end(void);

/* A message in segments of seven bytes, laid out by hand, but for segment `lost`. */
int join_by_hand_feed_segments(const struct frame *whole, unsigned lost);

/* Serves every gap the join tells, as the tower would; returns the blocks sent. */
uint64_t join_by_hand_serve_gaps(uint32_t limit);
void join_by_hand_check_next(unsigned sensor, uint32_t tick_ms, uint32_t limit, struct record_gap expected);

/* The drop's record; its counters; its gaps, those of the blocks that are not held. */
struct record join_by_hand_take(void);
void join_by_hand_check_counters(const struct record *record, struct record_counters expected);
void join_by_hand_check_gap_list(const struct record *record, bool held[2][HAND_TICKS_MAX]);

#endif
