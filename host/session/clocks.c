/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/clocks.h"

enum { DAY_MS = 86400000 };

void clocks_hear(struct clocks *clocks, uint32_t ms, uint16_t days)
{
	uint64_t time_ms = (uint64_t)days * DAY_MS + ms;

	if (time_ms + CLOCKS_APART_MS >
	    clocks->newest_ms) { /* the one that runs longer, or a frame held back */
		clocks->turns = clocks->other_last ? clocks->turns + 1 : 0;
		if (clocks->turns >= CLOCKS_TURNS)
			clocks->two = true;
		clocks->other_last = false;
		if (time_ms > clocks->newest_ms)
			clocks->newest_ms = time_ms;
		return;
	}
	if (clocks->other_last &&
	    time_ms > clocks->other_ms) { /* nothing came in between: it started again */
		clocks->newest_ms = time_ms;
		clocks->turns = 0;
		clocks->other_last = false;
		return;
	}
	clocks->other_last = true;
	clocks->other_ms = time_ms;
}
