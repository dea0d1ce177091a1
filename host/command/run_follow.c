/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One drop, from the first check to the last sample.
 */
#include <inttypes.h>
#include <stdio.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/release.h"
#include "host/command/run_private.h"
#include "host/session/tower_setup.h"

enum {
	DROP_STATUSES = 20 * SESSION_STATUSES_HZ, /* fall, capture and upload take about one second */
	STILL_MS = 1000,                          /* ten statuses */
	LEAVE_MS = 2000,                          /* a drop that was accepted leaves the tower at once */
};

/* ---- to the release ---- */

static void run_follow_say(void *user, const char *line)
{
	run_progress(user, "%s", line);
}

/* What will fall, for who is asked. */
static void tell_plan(const struct run *run)
{
	const struct scene *scene = &run->scene;
	char place[ARCHIVE_NAME_MAX + 32];

	if (run->series != NULL)
		snprintf(place, sizeof(place), "drop %u of series %s", run->recording.number, run->series);
	else
		snprintf(place, sizeof(place), "drop of no series");
	run_progress(run, "falls     %s, %.3g kg, from %.3f m at %.4g deg, %s", scene->name,
	             scene->product_case_mass_kg + scene->mount_plate_mass_kg, scene->drop_height_m,
	             scene->drop_angle_deg, place);
}

static int run_follow_let_fall(struct run *run)
{
	struct release release = {.session = run->session,
	                          .unattended = run->unattended || run->link == NULL,
	                          .say = run_follow_say,
	                          .user = run};
	int code;

	tell_plan(run);
	code = release_ask(&release);
	run->released = release.released;
	return code;
}

static void tell_state(const struct run *run, unsigned state, uint32_t *told)
{
	uint32_t bit = 1u << (state & 31u);

	/* once each: the last blocks on their way may still carry the state before */
	if ((*told & bit) == 0)
		run_progress(run, "%-9s %s", wire_state_name(state), wire_state_text(state));
	*told |= bit;
}

/* The status that names a fault comes after the blocks that have its state. */
static void tell_fault(const struct run *run, unsigned fault, unsigned *told)
{
	if (fault != WIRE_FAULT_NONE && fault != *told)
		run_progress(run, "fault     %s: %s", wire_fault_name(fault), wire_fault_text(fault));
	*told = fault;
}

/* 1 with the drop, 0 while it is not there. A log that can take no more: the drop is fetched without it. */
static int poll_and_take(struct run *run, struct record *record)
{
	int result = session_poll(run->session, 50);

	if (result == 0)
		result = session_take_drop(run->session, record);
	if (result != DT_E_SYSTEM || run->log_failed)
		return result;
	run->log_failed = true;
	session_log(run->session, NULL);
	run_progress(run, "log       cannot be written: %s", run->log);
	return 0;
}

/* After Ctrl-C: as long as something comes of the drop it is worth waiting for. */
struct patience {
	uint64_t heard;
	int64_t since_ms;
};

static bool stands_still(struct patience *patience, const struct session_view *view)
{
	uint64_t heard = view->blocks + view->statuses;

	if (heard != patience->heard)
		*patience = (struct patience){.heard = heard, .since_ms = session_now_ms()};
	return session_now_ms() - patience->since_ms > STILL_MS;
}

/* Follows the drop until it is collected. */
static int follow_to_end(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	uint64_t from_statuses = view->statuses;
	uint32_t told = 1u << WIRE_STATE_ARMED;
	unsigned told_fault = WIRE_FAULT_NONE;
	struct patience patience = {.since_ms = session_now_ms()};

	for (;;) {
		int result = poll_and_take(run, record);

		if (result >= 0)
			tell_fault(run, view->fault, &told_fault);
		if (result == 1)
			return COMMAND_DONE;
		if (result < 0)
			return command_link_failed("following the drop", result);
		tell_state(run, view->state, &told);
		if (run->aborted && session_at_rest(view->state))
			return command_stopped();
		if (view->state == WIRE_STATE_FAULT_HELD && view->fault != WIRE_FAULT_NONE) {
			command_error("nothing to capture, the frame did not move: %s",
			              wire_fault_text(view->fault));
			return COMMAND_REFUSED;
		}
		if (interrupt_came() && !run->aborted) {
			run->aborted = true;
			run_progress(run, "abort");
			result = session_command(run->session, WIRE_OP_ABORT);
			if (result != 0)
				return command_link_failed("abort", result);
		}
		if (run->aborted && stands_still(&patience, view)) {
			command_error("aborted, and nothing more comes of the drop; the tower may hold it");
			return COMMAND_REFUSED;
		}
		if (session_is_over(run->session, from_statuses + DROP_STATUSES)) {
			command_error("no capture within %d s of the release; state %s, fault %s%s",
			              DROP_STATUSES / SESSION_STATUSES_HZ, wire_state_name(view->state),
			              wire_fault_name(view->fault),
			              view->two_towers ? "; two towers on this bus, expected one" : "");
			return COMMAND_LINK;
		}
	}
}

/* What the link lost on its way; a tower's own losses are in its counters. */
static void tell_losses(const struct run *run)
{
	const struct link_counters *link = session_view(run->session)->link;

	if (link == NULL)
		return;
	if (link->receive_lost + link->send_lost + link->malformed + link->errors + link->restarts == 0)
		return;
	run_progress(run,
	             "link      %" PRIu64 " frames lost before us, %" PRIu64 " of ours lost, %" PRIu64
	             " malformed, %" PRIu64 " bus errors, %" PRIu64 " restarts",
	             link->receive_lost, link->send_lost, link->malformed, link->errors, link->restarts);
}

static int release_and_follow(struct run *run, struct record *record)
{
	char message[SESSION_MESSAGE_MAX];
	int result = tower_setup_write(run->session, &run->scene, message);
	int code = result == 0 ? run_keep_room(run) : command_tower_failed(result, message);

	if (code == COMMAND_DONE)
		code = run_follow_let_fall(run);
	return code == COMMAND_DONE ? follow_to_end(run, record) : code;
}

/* Until the tower has let go of what was accepted; a frame that did not come down keeps it. */
static void see_it_leave(struct run *run)
{
	const struct session_view *view = session_view(run->session);
	int64_t start_ms = session_now_ms();

	while (!run->log_failed && session_drops(view->state) && session_poll(run->session, 50) == 0 &&
	       !interrupt_came() && session_now_ms() - start_ms < LEAVE_MS)
		continue;
	if (view->state == WIRE_STATE_KEEP_OUT)
		command_error("%s", wire_state_text(view->state));
}

/* A host that died leaves its drop in the tower, which neither arms before it is fetched nor may have it
 * taken for the next one. */
static int drop(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	char message[SESSION_MESSAGE_MAX];
	int result = tower_setup_hear(run->session, message);
	int code = result == 0 ? COMMAND_DONE : command_tower_failed(result, message);
	int taken = result == 0 ? session_take_drop(run->session, record) : 0;

	run->earlier = code == COMMAND_DONE && (taken == 1 || session_drops(view->state));
	if (run->earlier)
		run_progress(run, "held      drop of an earlier run, to be fetched first");
	if (taken < 0)
		code = command_link_failed("an earlier drop", taken);
	else if (code == COMMAND_DONE && taken == 0)
		code = run->earlier ? follow_to_end(run, record) : release_and_follow(run, record);
	if (code == COMMAND_DONE)
		run_progress(run, "collected %" PRIu64 " blocks, %" PRIu64 " asked for again",
		             record->counters.blocks, session_view(run->session)->asked);
	if (code == COMMAND_DONE)
		see_it_leave(run);
	tell_losses(run);
	return code;
}

int run_follow(struct run *run, const char *url, struct record *record)
{
	struct session_options options = {
	        .key = run->key,
	        .program = run->link != NULL ? "run" : NULL, /* a simulated tower is nobody's business */
	        .operator_name = run->operator_name};
	char message[SESSION_MESSAGE_MAX];
	int code = COMMAND_LINK;

	options.log = link_open_log(run->log, LINK_WRITE, message, sizeof(message));
	if (options.log == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	run->session = session_open(url, &options, message);
	if (run->session != NULL)
		code = drop(run, record);
	else
		command_error("%s", message);
	run->kept = run->session != NULL && session_view(run->session)->kept;
	session_close(run->session);
	run->log_failed |= link_close(options.log) != 0;
	if (run->log_failed && code != COMMAND_DONE)
		command_error("%s: could not be written", run->log);
	return code;
}
