/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A drop, from its ARM to its hand-over. It goes by what the tower says of its state, so that it ends well
 * whoever released or aborted it, and whether the link held or not.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/console/tower_private.h"

enum {
	DROP_MS = 20000,    /* fall, capture and upload take about one second */
	ARM_LATE_MS = 2000, /* after the tower should have disarmed by itself */
	SETTLED = 2, /* statuses: of what was on its way while the state changed there is one at most */
};

struct handover_drop *tower_drop_new(const struct tower *tower, const char *series)
{
	struct handover_drop *drop = calloc(1, sizeof(*drop));

	if (drop == NULL)
		return NULL;
	drop->recording.lock = -1;
	record_init(&drop->record);
	drop->simulated = tower->is_simulated;
	snprintf(drop->series, sizeof(drop->series), "%s", series);
	return drop;
}

/* To the archive, which has it from now on. */
static void tower_drop_send(struct tower *tower, struct handover_drop *drop, enum job_message message)
{
	drop->way = (struct job){.console = tower->console, .message = message, .maker = drop};
	if (job_put_first(&tower->console->work_queue, &drop->way) == 0)
		return;
	/* the program ends: what is on the disk shows up as interrupted */
	if (drop->recording.lock >= 0)
		archive_abandon(&drop->recording);
	record_free(&drop->record);
	free(drop);
}

void tower_drop_discard(struct tower *tower, struct handover_drop *drop)
{
	tower_drop_send(tower, drop, JOB_DISCARD);
}

/* ---- the log ---- */

static bool tower_drop_open_log(struct tower *tower)
{
	char message[SESSION_MESSAGE_MAX];

	tower->log = link_open_log(tower->drop->recording.log, LINK_WRITE, message, sizeof(message));
	if (tower->log == NULL)
		snprintf(tower->drop_trouble, sizeof(tower->drop_trouble), "%s", message);
	session_log(tower->session, tower->log);
	return tower->log != NULL;
}

/* Whether every frame is in it. */
static bool close_log(struct tower *tower)
{
	bool whole = tower->log != NULL;

	if (tower->session != NULL)
		session_log(tower->session, NULL);
	if (tower->log != NULL)
		whole = link_close(tower->log) == 0;
	tower->log = NULL;
	return whole;
}

void tower_drop_log_failed(struct tower *tower)
{
	(void)close_log(tower);
	snprintf(tower->drop_trouble, sizeof(tower->drop_trouble), "%.300s: could not be written",
	         tower->drop->recording.raw);
	if (tower->phase <= TOWER_ARMED)
		atomic_fetch_add(&tower->aborts, 1); /* nothing shall fall that is not recorded */
}

/* ---- its phases ---- */

static void tower_drop_enter(struct tower *tower, enum tower_phase phase)
{
	tower->phase = phase;
	tower->phase_ms = session_now_ms();
	tower->rest_ms = 0;
	if (phase != TOWER_ARMED)
		tower->armed_until_ms = 0;
}

static void tower_drop_take(struct tower *tower, struct handover_drop *drop)
{
	tower->drop = drop;
	tower->fault = WIRE_FAULT_NONE;
	tower->abort_moving = false;
	tower->drop_trouble[0] = '\0';
	tower->drop_name[0] = '\0';
	if (drop->recording.lock >= 0)
		snprintf(tower->drop_name, sizeof(tower->drop_name), "%s/%u", drop->series,
		         drop->recording.number);
}

bool tower_drop_begin(struct tower *tower, struct handover_drop *drop)
{
	tower_drop_take(tower, drop);
	if (!tower_drop_open_log(tower)) {
		tower_drop_end(tower);
		return false;
	}
	tower_drop_enter(tower, TOWER_ARMING);
	return true;
}

void tower_drop_armed(struct tower *tower)
{
	tower_drop_enter(tower, TOWER_ARMED);
	tower->armed_until_ms = session_view(tower->session)->armed_until_ms;
}

void tower_drop_released(struct tower *tower)
{
	tower->drop->released = true;
	tower_drop_enter(tower, TOWER_MOVING);
}

void tower_drop_end(struct tower *tower)
{
	(void)close_log(tower);
	if (tower->drop != NULL)
		tower_drop_discard(tower, tower->drop);
	tower->drop = NULL;
	tower->drop_name[0] = '\0';
	tower_drop_enter(tower, TOWER_IDLE);
}

static void add_note(struct handover_drop *drop, const char *text)
{
	size_t length = strlen(drop->note);

	snprintf(drop->note + length, sizeof(drop->note) - length, "%s%s", length > 0 ? "; " : "", text);
}

void tower_drop_leave(struct tower *tower)
{
	if (tower->phase == TOWER_ARMED) {
		atomic_fetch_add(&tower->aborts, 1);
		tower_obey_abort(tower);
	}
	if (tower->drop == NULL)
		return;
	add_note(tower->drop, "the console ended before it was collected");
	tower_drop_end(tower);
}

static void __attribute__((format(printf, 2, 3)))
tower_drop_give_up(struct tower *tower, const char *format, ...)
{
	char why[sizeof(tower->drop_trouble)];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(why, sizeof(why), format, arguments);
	va_end(arguments);
	tower->origin = "was given up before it was collected";
	if (tower->drop != NULL)
		add_note(tower->drop, why);
	tower_drop_end(tower);
	strcpy(tower->drop_trouble, why);
}

/* ---- collecting ---- */

/* A drop that we did not release. */
static struct handover_drop *without_recording(const struct tower *tower)
{
	struct handover_drop *drop = tower_drop_new(tower, tower->series);

	if (drop == NULL)
		return NULL;
	drop->released = true;
	snprintf(drop->note, sizeof(drop->note), "%s", tower->origin);
	return drop;
}

/* The drop that the record belongs to, no longer the tower's; NULL without memory. */
static struct handover_drop *tower_drop_hand_over(struct tower *tower)
{
	struct handover_drop *drop = tower->drop;

	if (drop == NULL)
		drop = without_recording(tower);
	if (!close_log(tower) && drop != NULL && drop->recording.lock >= 0)
		add_note(drop, "the log could not be written while it fell");
	tower->drop = NULL;
	return drop;
}

static void collected(struct tower *tower, struct record *record)
{
	struct handover_drop *drop = tower_drop_hand_over(tower);

	if (drop == NULL) {
		record_free(record);
		tower_drop_give_up(tower, "the drop is lost: %s", error_text(DT_E_MEMORY));
		return;
	}
	if (tower->abort_moving)
		add_note(drop, "aborted in motion");
	else if (tower->fault != WIRE_FAULT_NONE)
		add_note(drop, wire_fault_text(tower->fault));
	drop->record = *record;
	tower_drop_enter(tower, TOWER_SAVING);
	tower_drop_send(tower, drop, JOB_KEEP);
}

void tower_drop_saved(struct tower *tower, struct handover_drop *drop)
{
	snprintf(tower->drop_trouble, sizeof(tower->drop_trouble), "%.*s",
	         (int)sizeof(tower->drop_trouble) - 1, drop->trouble);
	/* a link that fails here is told by its next poll; the tower then still has the drop */
	if (drop->on_disk && tower->session != NULL)
		(void)!session_accept(tower->session);
	free(drop);
	if (tower->phase != TOWER_SAVING)
		return;
	tower->drop_name[0] = '\0';
	tower_drop_enter(tower, TOWER_IDLE);
}

/* ---- following ---- */

/* Whether what is there of the tower's state has been so for long enough to be believed: by what was heard
 * since, as a link that is silent for a while says nothing. */
static bool settled(struct tower *tower, bool now)
{
	uint64_t statuses = session_view(tower->session)->statuses;

	if (!now) {
		tower->rest_ms = 0;
	} else if (tower->rest_ms == 0) {
		tower->rest_ms = session_now_ms();
		tower->rest_statuses = statuses;
	}
	return now && statuses - tower->rest_statuses >= SETTLED;
}

static void follow_idle(struct tower *tower, unsigned state)
{
	struct handover_drop *drop;

	if (session_at_rest(state))
		tower->origin = "was not released from the console";
	/* one that we have may stay in the tower, until its frame is down */
	if (!settled(tower, session_drops(state) && !session_view(tower->session)->collected &&
	                            tower->series[0] != '\0'))
		return;
	drop = without_recording(tower);
	if (drop == NULL)
		return;
	tower_drop_take(tower, drop);
	tower_drop_enter(tower, TOWER_MOVING);
}

static void follow_armed(struct tower *tower, unsigned state)
{
	if (session_drops(state))
		tower_drop_released(tower);
	else if (settled(tower, session_at_rest(state)))
		tower_drop_end(tower);
}

static void follow_drop(struct tower *tower, const struct session_view *view)
{
	if (view->fault != WIRE_FAULT_NONE)
		tower->fault = view->fault;
	if (tower->phase == TOWER_MOVING &&
	    (view->state == WIRE_STATE_CAPTURED || view->state == WIRE_STATE_KEEP_OUT))
		tower_drop_enter(tower, TOWER_COLLECTING);
	if (settled(tower, session_at_rest(view->state)))
		tower_drop_give_up(tower, "nothing was captured: %s",
		                   tower->fault != WIRE_FAULT_NONE ? wire_fault_text(tower->fault)
		                                                   : "the frame did not move");
}

static void follow_phase(struct tower *tower, const struct session_view *view)
{
	switch (tower->phase) {
	case TOWER_IDLE:
		follow_idle(tower, view->state);
		break;
	case TOWER_ARMED:
		follow_armed(tower, view->state);
		break;
	case TOWER_MOVING:
	case TOWER_COLLECTING:
		follow_drop(tower, view);
		break;
	case TOWER_ARMING:
	case TOWER_SAVING:
		break;
	}
}

/* Whether the link is there or not. */
static void watch_time(struct tower *tower)
{
	int64_t now_ms = session_now_ms();
	/* after a stall of this machine it may just be heard again, at rest, and not be believed yet */
	bool heard = tower->rest_ms != 0 && now_ms - tower->rest_ms < ARM_LATE_MS;

	if (tower->phase == TOWER_ARMED && !heard && now_ms > tower->armed_until_ms + ARM_LATE_MS)
		tower_drop_give_up(tower, "armed, and then nothing was heard of the tower");
	else if ((tower->phase == TOWER_MOVING || tower->phase == TOWER_COLLECTING) &&
	         now_ms > tower->phase_ms + DROP_MS)
		tower_drop_give_up(tower, "no capture within %d s of the release", DROP_MS / 1000);
}

void tower_drop_follow(struct tower *tower)
{
	struct record record;
	int taken = 0;

	if (tower->session != NULL && session_view(tower->session)->seen) {
		if (tower->phase != TOWER_SAVING)
			taken = session_take_drop(tower->session, &record);
		if (taken > 0)
			collected(tower, &record);
		else if (taken < 0)
			tower_drop_give_up(tower, "the drop could not be collected: %s", error_text(taken));
		else
			follow_phase(tower, session_view(tower->session));
	}
	watch_time(tower);
}
