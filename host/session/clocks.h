/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_CLOCKS_H
#define DT_HOST_SESSION_CLOCKS_H
/*
 * Whether more than one tower talks on a bus: their identifiers are the same, but a tower's TIME messages
 * only grow, and those of two stand between each other. A tower that starts again begins anew once; a frame
 * that came twice is no second clock. Towers that were started within CLOCKS_APART_MS are not told apart.
 * Pure functions, one thread.
 */
#include <stdbool.h>
#include <stdint.h>

enum {
	CLOCKS_APART_MS = 3000,
	CLOCKS_TURNS = 3, /* so often from the newer clock to an older one and back */
};

struct clocks {
	uint64_t newest_ms, other_ms; /* since boot; 0: none yet */
	unsigned turns;
	bool other_last;
	bool two; /* stays */
};

/* A TIME message: ms of the day and days since boot. */
void clocks_hear(struct clocks *clocks, uint32_t ms, uint16_t days);

#endif
