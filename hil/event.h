/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_EVENT_H
#define DT_HIL_EVENT_H
/*
 * Things that happen to the tower, its bus and its firmware in a run: what, and when. Plain data.
 */
#include <stdint.h>

#include "common/frame.h"

enum event_action {
	EVENT_FAULT,       /* of the tower: number is an enum tower_fault */
	EVENT_REPAIR,      /* the same, taken away */
	EVENT_SEND,        /* a frame of the host */
	EVENT_BUS_SILENT,  /* for duration_s nothing passes, and neither end notices */
	EVENT_BUS_BLOCKED, /* nobody acknowledges: nothing leaves the firmware, nothing reaches it */
	EVENT_BUS_OFF,     /* the firmware's controller is bus-off */
	EVENT_BUS_BABBLE,  /* a foreign node sends 8 frames a ms and takes every second ms for itself */
	EVENT_BUS_BURST,   /* the next `number` live blocks are lost */
	EVENT_HOST_SILENT, /* the host sends nothing */
	EVENT_RESET,       /* the firmware is started anew, number is its --reset-cause */
	EVENT_HANG,        /* the firmware's main loop hangs until the watchdog bites */
	EVENT_ACTIONS
};

enum {
	EVENTS_MAX = 64,
	EVENT_AT_TIME = -1, /* instead of a state */
};

struct event {
	enum event_action action;
	unsigned number;
	double duration_s;
	struct frame frame;
	int state; /* WIRE_STATE_*: seconds count from its entry; EVENT_AT_TIME: from the start */
	double time_s;
	int line; /* of the scenario file */
};

#endif
