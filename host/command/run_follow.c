/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One drop, from the first check to the last sample.
 */
#include <inttypes.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/run_private.h"
#include "host/command/tower_setup.h"

enum {
	READY_MS = 60000, /* a person may have to close a door */
	DROP_MS = 20000,  /* fall, capture and upload take about one second */
};

/* ---- to the release ---- */

static void tell_checks(const struct run *run, uint16_t checks)
{
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((checks >> i & 1u) != 0)
			run_progress(run, "check     %-10s %s", wire_check_name(i), wire_check_text(i));
}

static int wait_until_ready(struct run *run)
{
	const struct session_view *view = session_view(run->session);
	int64_t start_ms = session_now_ms();
	uint16_t told = 0;

	while (view->state != WIRE_STATE_READY) {
		int result = session_poll(run->session, 50);

		if (result != 0)
			return command_link_failed("waiting for the checks", result);
		if (command_interrupted())
			return command_stopped();
		if (view->state == WIRE_STATE_FAULT_HELD) {
			command_error(
			        "the tower holds a fault: %s; 'droptower ctl clear' when its cause is gone",
			        wire_fault_text(view->fault));
			return COMMAND_REFUSED;
		}
		if (view->checks != told && session_now_ms() - start_ms > 1000) {
			told = view->checks;
			tell_checks(run, told);
		}
		if (session_now_ms() - start_ms > READY_MS) {
			command_error("checks not green within %d s", READY_MS / 1000);
			return COMMAND_REFUSED;
		}
	}
	run_progress(run, "ready     all checks green");
	return COMMAND_DONE;
}

static bool unanswered(int result)
{
	return result == DT_E_TIMEOUT || result == DT_E_CLOSED || result == DT_E_LINK;
}

static int arm_and_release(struct run *run)
{
	uint16_t token = session_token();
	int result;

	result = session_command(run->session, WIRE_OP_ARM, token);
	if (command_interrupted()) {
		result = session_command(run->session, WIRE_OP_ABORT, 0);
		return result == 0 ? command_stopped() : command_link_failed("abort", result);
	}
	if (result == 0) {
		run_progress(run, "armed");
		result = session_command(run->session, WIRE_OP_RELEASE, token);
		run->released = result == 0 || unanswered(result); /* it may have worked */
	}
	/* an interrupted release may have worked: what follows aborts it and looks */
	if (result == 0 || command_interrupted()) {
		run_progress(run, "released");
		return COMMAND_DONE;
	}
	command_error("the tower refuses: %s", error_text(result));
	tell_checks(run, session_view(run->session)->checks);
	return unanswered(result) ? COMMAND_LINK : COMMAND_REFUSED;
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

/* Follows the drop until it is collected. */
static int follow_to_end(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	int64_t start_ms = session_now_ms();
	uint32_t told = 1u << WIRE_STATE_ARMED;
	unsigned told_fault = WIRE_FAULT_NONE;

	for (;;) {
		int result = session_poll(run->session, 50);
		int taken = result == 0 ? session_take_drop(run->session, record) : result;

		if (result == 0)
			tell_fault(run, view->fault, &told_fault);
		if (taken == 1)
			return COMMAND_DONE;
		if (taken < 0)
			return command_link_failed("following the drop", taken);
		tell_state(run, view->state, &told);
		if (run->aborted && session_at_rest(view->state))
			return command_stopped();
		if (view->state == WIRE_STATE_FAULT_HELD && view->fault != WIRE_FAULT_NONE) {
			command_error("nothing to capture, the frame did not move: %s",
			              wire_fault_text(view->fault));
			return COMMAND_REFUSED;
		}
		if (command_interrupted() && !run->aborted) {
			run->aborted = true;
			run_progress(run, "abort");
			result = session_command(run->session, WIRE_OP_ABORT, 0);
			if (result != 0)
				return command_link_failed("abort", result);
		}
		if (session_now_ms() - start_ms > DROP_MS) {
			command_error("no capture within %d s of the release; state %s, fault %s",
			              DROP_MS / 1000, wire_state_name(view->state),
			              wire_fault_name(view->fault));
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
	int code = tower_setup_write(run->session, &run->scene, message);

	if (code != COMMAND_DONE)
		command_error("%s", message);
	if (code == COMMAND_DONE)
		code = wait_until_ready(run);
	if (code == COMMAND_DONE)
		code = arm_and_release(run);
	run->released |= code == COMMAND_DONE;
	return code == COMMAND_DONE ? follow_to_end(run, record) : code;
}

/* A host that died leaves its drop in the tower, which neither arms before it is fetched nor may have it
 * taken for the next one. */
static int drop(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	char message[SESSION_MESSAGE_MAX];
	int code = tower_setup_hear(run->session, message);
	int taken = code == COMMAND_DONE ? session_take_drop(run->session, record) : 0;

	if (code != COMMAND_DONE)
		command_error("%s", message);
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
	tell_losses(run);
	return code;
}

int run_follow(struct run *run, const char *url, struct record *record)
{
	struct session_options options = {0};
	char log[ARCHIVE_PATH_MAX + 8], message[SESSION_MESSAGE_MAX];
	int code = COMMAND_LINK;

	snprintf(log, sizeof(log), "log:%s", run->log);
	options.log = link_open(log, LINK_WRITE, message, sizeof(message));
	if (options.log == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	run->session = session_open(url, &options, message);
	if (run->session != NULL)
		code = drop(run, record);
	else
		command_error("%s", message);
	session_close(run->session);
	if (link_close(options.log) != 0) {
		command_error("%s: could not be written", run->log);
		code = COMMAND_INPUT;
	}
	return code;
}
