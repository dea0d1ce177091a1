/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_EVENT_H
#define DT_HIL_EVENT_H
/*
 * Things that happen to the tower, its bus and its firmware in a run: what, and when. Plain data.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/wire.h"

enum event_action {
	EVENT_FAULT,       /* of the tower: number is an enum tower_fault */
	EVENT_REPAIR,      /* the same, taken away */
	EVENT_DROPOUT,     /* the magnet's, from now on duration_s */
	EVENT_FRICTION,    /* the rails', from now on `value` N */
	EVENT_SPIKE,       /* `value` g on top of the next conversions of sensor `number` */
	EVENT_LET_GO,      /* a hand lets the product go */
	EVENT_GLITCH,      /* of gate `number`: `pulses` of them, one with each sample */
	EVENT_SEND,        /* a frame of whoever */
	EVENT_VERB,        /* a command: of the scripted operator, or `second` of the second host */
	EVENT_BUS_SILENT,  /* for duration_s nothing passes, and neither end notices */
	EVENT_BUS_BLOCKED, /* nobody acknowledges: nothing leaves the firmware, nothing reaches it */
	EVENT_BUS_OFF,     /* the firmware's controller is bus-off */
	EVENT_BUS_PASSIVE, /* it is error-passive */
	EVENT_BUS_BABBLE,  /* a foreign node sends 8 frames a ms and takes every second ms for itself */
	EVENT_BUS_BURST,   /* the next `number` live blocks are lost */
	EVENT_HOST_SILENT, /* the host sends nothing */
	EVENT_HOST_SECOND, /* a second host beats too */
	EVENT_HOST_REPLAY, /* what hosts sent from the first ARM until now comes again, as far apart */
	EVENT_HOST_FORGE,  /* two forged commands a ms */
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
	unsigned number, pulses;
	double duration_s, value;
	struct frame frame;
	struct wire_command
	        command; /* host, and the argument if not `forged`, are filled in when it is sent */
	bool second, forged;
	int state; /* WIRE_STATE_*: seconds count from its entry; EVENT_AT_TIME: from the start */
	double time_s;
	int line; /* of the scenario file */
};

#endif
