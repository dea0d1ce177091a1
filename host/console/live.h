/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_LIVE_H
#define DT_HOST_CONSOLE_LIVE_H
/*
 * What goes on at the tower now, for the page: the envelope of every millisecond, and how the bus is. Fed by
 * the tower's thread with every frame, read by http; a lock inside, held for microseconds.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"

enum {
	LIVE_CHANNELS = 6, /* S1X S1Y S1Z S2X S2Y S2Z */
	LIVE_TICKS = 4096, /* kept */
};

/* Least and largest sample of each channel in one millisecond, counts of 1/32 g. Both are
 * WIRE_SAMPLE_NOT_TAKEN where the block did not come. */
struct live_tick {
	int16_t low[LIVE_CHANNELS], high[LIVE_CHANNELS];
};

struct live_view {
	double bus_load_percent; /* over the last second, worst-case stuffing, at the rates the tower was set
	                            to */
	double frames_s;
	double heartbeat_age_s;   /* NAN: none yet */
	uint64_t blocks, missing; /* live blocks that came, and that did not by their ticks */
	bool classic;             /* frames come in segments: nothing is live */
};

struct live;

struct live *live_create(void); /* NULL without memory */
void live_destroy(struct live *live);

/* A frame of the tower; now_us here and below is link_now_us. True when it says that the tower started anew:
 * the boot-up heartbeat, or a block whose tick is too far behind to be a late one. */
bool live_feed(struct live *live, const struct frame *frame, int64_t now_us);

/* The tower or the link started anew: the ticks begin again, counters stay. */
void live_restart(struct live *live);

void live_look(struct live *live, int64_t now_us, struct live_view *view);

/* Ticks from *next on, at most room and at most LIVE_TICKS old; *first is the first one's number and *next
 * that behind the last. Only ticks of which both sensors were heard, or that are 20 ms old. After a restart
 * it begins with the new ones. Returns how many. */
size_t live_read(struct live *live, uint64_t *next, uint64_t *first, struct live_tick *out, size_t room);

#endif
