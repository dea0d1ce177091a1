/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_TOWER_H
#define DT_HOST_CONSOLE_TOWER_H
/*
 * The console's end of the tower: one thread with the session, which keeps the heartbeat going, follows the
 * tower, sends the operator's commands and collects drops. Nothing else in the program makes it wait: no file
 * is synced and nothing is analysed here, and commands come by queue.
 *
 * A drop, step by step:
 *     arm       work makes the next drop of the series in the archive, tower opens its log and sends ARM
 *     release   with the token that arm gave, the tower's nonce, when its warning is over
 *     ...       every frame goes into the log
 *     collected the log is closed; work syncs it, notes it as recorded, analyses it
 * Armed and disarmed again without a release leaves no drop. A drop that the tower still holds from before is
 * collected as soon as the tower is heard, and kept in the series that is selected, with a note.
 *
 * A link that breaks is opened again every second; state, and why it broke, are in the view. A drop under way
 * goes on when the link is back.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/scenes/scene.h"
#include "host/archive/archive.h"
#include "host/session/session.h"
#include "host/console/job.h"
#include "host/console/live.h"

enum tower_phase {
	TOWER_IDLE, /* no drop under way */
	TOWER_ARMING,
	TOWER_ARMED,
	TOWER_MOVING,     /* released, until captured */
	TOWER_COLLECTING, /* fetching what is missing */
	TOWER_SAVING,     /* work has it: until it is recorded and analysed */
};
const char *tower_phase_name(enum tower_phase phase); /* "idle" */

enum { TOWER_SIMULATED_MAX = 32 };

struct tower_view {
	struct session_view session; /* its link pointer is NULL here ... */
	struct link_counters link;   /* ... and this a copy */
	char url[256];
	bool open;                      /* the link is */
	char trouble[ARCHIVE_TEXT_MAX]; /* one line: why no drop can be made now, or what became of one; "" */
	bool blocked;                   /* by it nothing can be armed */
	enum tower_phase phase;
	char series[ARCHIVE_NAME_MAX + 1]; /* selected; "" */
	struct scene scene;                /* of the series, when there is one */
	char drop[ARCHIVE_NAME_MAX + 16];  /* under way: SERIES/NUMBER; "" */
	int64_t armed_until_ms;            /* session_now_ms() at which the tower disarms by itself; 0 */
	bool simulated;                    /* there is a control socket */
	unsigned simulated_count;          /* faults that the simulated tower can have; 0 until it said so */
	char simulated_name[TOWER_SIMULATED_MAX][24];
	uint32_t simulated_faults; /* bit for each that is on */
};

struct tower;

struct tower_options {
	const char *link;    /* NULL: a simulated tower of our own, started with the scene of the series */
	const char *control; /* control socket of a simulated tower behind link; NULL: a real one */
	const char *scene;   /* file, for a simulated tower of our own until a series is selected */
	const char *const *bench_words; /* for it; NULL-terminated, or NULL */
};

/* NULL and one line in message. The console's live and queues must be there; work is first used when a series
 * is selected. */
struct tower *tower_start(struct console *console, const struct tower_options *options,
                          char message[SESSION_MESSAGE_MAX]);

/* Ends the thread and with it the simulated tower; to be called before work_stop. What is armed is aborted, a
 * drop in motion stays partial in the archive; a real tower holds it for the next start. Closes the tower's
 * queue; jobs in it are refused (503). Nothing of it may be looked at any more. */
void tower_stop(struct tower *tower);

/* A copy of what is known. */
void tower_look(struct tower *tower, struct tower_view *view);

/* The operator's verbs, as jobs, for http to call: they never wait, may be called on any thread, and put the
 * job into the queues it has to go through. Each is answered when the tower has replied, or at once when it
 * cannot be: 409 with the tower's own reason when it refuses, 504 when it does not answer, 503 when there
 * is no tower.
 *
 *   arm      {}              answers {"token": N, "warning_s": 1, "expires_s": 10}
 *   release  {"token": N}    answers {}; 425 before the warning is over: still armed
 *   clear    {}              also acknowledges that guards were open
 *   select   {"series": S}   at rest only: the scene's parameters are written to the tower, and a simulated
 *                            tower of our own is started anew with that scene
 *   simulate {"line": "fault estop"}   404 without a control socket
 */
void tower_arm(struct job *job);
void tower_release(struct job *job);
void tower_clear(struct job *job);
void tower_select(struct job *job);
void tower_simulate(struct job *job);

/* {}. Never waits behind another verb: one under way, or asked for before it, is given up (409). Sent also
 * when the link has just been opened and nothing is known of the tower. */
void tower_abort(struct job *job);

/* Aborts what is armed, or about to be, and does not wait for it; on any thread. The console ends, and other
 * requests may take a while yet. */
void tower_disarm(struct tower *tower);

#endif
