/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_command.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/link.h"
#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/session/journal.h"
#include "host/command/notify.h"
#include "host/session/mac.h"
#include "host/session/publish.h"
#include "host/session/session.h"
#include "host/session/tower_setup.h"

enum {
	SAY_EVERY_MS = 1000,
	ABORT_EVERY_MS = 100, /* those that prove nothing */
};

struct bridge {
	const char *link, *lcm, *scene_file, *key_file;
	double angle_deg;
	struct scene scene;
	struct session *session;
	struct publisher *publisher;
	int publish_error;
	struct mac_key key;
	struct mac_taker taker;
	bool commanded; /* a command that was taken waits */
	droptower_command command;
	bool abort_asked, abort_proven;
	droptower_command abort;      /* the proven one */
	int64_t aborted_ms, noted_ms; /* the last ABORT; the last without proof in the journal */
	enum mac_refusal refusal;     /* the last */
	unsigned unsaid;              /* refusals */
	int64_t said_ms;
};

static const struct option_row rows[] = {
        OPTION_TEXT("link", "URL", struct bridge, link, "unix:PATH, can:IF or slcan:DEV"),
        OPTION_TEXT("lcm", "URL", struct bridge, lcm,
                    "default " PUBLISH_URL
                    "; with ttl=1 or more it sends to, and takes from, other machines"),
        OPTION_TEXT("commands", "KEYFILE", struct bridge, key_file,
                    "takes DT_COMMAND from whoever has this key, and signs what it publishes: a file of at "
                    "least 32 bytes, mode 0600 (head -c 32 /dev/urandom)"),
        OPTION_TEXT("scene", "FILE", struct bridge, scene_file,
                    "sets the tower's parameters and adds the model to the results"),
        OPTION_TAKEN("angle", "DEG", struct bridge, angle_deg, command_angle,
                     "contact angle, instead of the scene's"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "bridge",
        .head = "usage: droptower bridge --link URL [--lcm URL] [--commands KEYFILE] [--scene FILE [--angle "
                "DEG]]\n"
                "\n"
                "CAN to LCM: publishes DT_BLOCK, DT_STATE, DT_DROP and DT_RESULT, keeps the host's heartbeat "
                "going,\n"
                "collects every drop until its CRC-32 agrees, accepts and analyses it. Takes ABORT from "
                "anybody on "
                "this\n"
                "machine, and other commands only with --commands.\n"
                "\n",
        OPTION_ROWS(rows),
};

/* What does not go together. */
static int bridge_check(const struct bridge *bridge)
{
	if (bridge->link == NULL)
		return command_usage("bridge", "no --link given");
	if (!isnan(bridge->angle_deg) && bridge->scene_file == NULL)
		return command_usage("bridge", "--angle needs a --scene to lay it over");
	return COMMAND_DONE;
}

/* ---- what is told ---- */

static int32_t ms_until(int64_t at_ms)
{
	int64_t left_ms = at_ms - session_now_ms();

	return left_ms < 0 ? 0 : left_ms > INT32_MAX ? INT32_MAX : (int32_t)left_ms;
}

/* What DT_STATE says of commands, as it is now. */
static void bridge_tell(struct bridge *bridge)
{
	const struct session_view *view = session_view(bridge->session);
	droptower_state *state = &bridge->publisher->state;

	state->session = view->session;
	state->refused = 0;
	for (unsigned i = MAC_TAKEN + 1; i < MAC_REFUSALS; i++)
		state->refused += (int64_t)bridge->taker.refused[i];
	state->refusal = (int16_t)bridge->refusal;
	state->armed = view->armed;
	state->nonce = view->armed ? view->nonce : 0;
	state->armed_drop_id = view->armed ? view->armed_drop_id : 0;
	state->release_in_ms = view->armed ? ms_until(view->release_from_ms) : 0;
	state->disarmed_in_ms = view->armed ? ms_until(view->armed_until_ms) : 0;
}

static void bridge_on_frame(void *user, const struct frame *frame)
{
	struct bridge *bridge = user;
	int result;

	if (bridge->session != NULL && frame->id == WIRE_ID_STATUS)
		bridge_tell(bridge);
	result = publisher_frame(bridge->publisher, frame);
	if (result != 0)
		bridge->publish_error = result;
}

/* What is refused, at most once a second: a flood fills neither terminal nor disk. */
static void say_refused(struct bridge *bridge)
{
	int64_t now_ms = session_now_ms();
	char text[128];

	if (bridge->unsaid == 0 || (bridge->said_ms != 0 && now_ms - bridge->said_ms < SAY_EVERY_MS))
		return;
	snprintf(text, sizeof(text), "%u without proof, the last %s", bridge->unsaid,
	         mac_text(bridge->refusal));
	command_error("bridge: DT_COMMAND: %s", text);
	journal_write(&(struct journal_line){.program = "bridge",
	                                     .who = "unknown",
	                                     .session = session_view(bridge->session)->session,
	                                     .verb = "DT_COMMAND",
	                                     .refusal = text});
	bridge->unsaid = 0;
	bridge->said_ms = now_ms;
}

static void keep_record(const struct bridge *bridge, const droptower_command *command, int result)
{
	char who[sizeof(command->sender) + 1];

	snprintf(who, sizeof(who), "%.*s", (int)sizeof(command->sender), (const char *)command->sender);
	journal_write(&(struct journal_line){.program = "bridge",
	                                     .who = who,
	                                     .session = session_view(bridge->session)->session,
	                                     .verb = wire_op_name((unsigned)command->op),
	                                     .refusal = result != 0 ? error_text(result) : NULL});
}

/* ---- commands ---- */

static void bridge_take(struct bridge *bridge, const droptower_command *command)
{
	if (command->op == WIRE_OP_ABORT) {
		bridge->abort_asked = true;
		bridge->abort_proven = true;
		bridge->abort = *command;
		bridge->commanded = false; /* what waits is not carried out any more */
	} else if (!bridge->abort_asked) {
		bridge->commanded = true;
		bridge->command = *command;
	}
}

static void on_command(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	struct bridge *bridge = user;
	droptower_command command;
	enum mac_refusal refusal;

	(void)channel;
	refusal = mac_judge(&bridge->taker, buffer->data, buffer->data_size, link_clock_us(), &command);
	if (refusal == MAC_TAKEN && bridge->commanded && command.op != WIRE_OP_ABORT) {
		refusal = MAC_BUSY;
		bridge->taker.refused[MAC_BUSY]++;
	}
	if (refusal == MAC_TAKEN) {
		bridge_take(bridge, &command);
		return;
	}
	bridge->refusal = refusal;
	bridge->unsaid++;
	if (refusal != MAC_FORM && command.op == WIRE_OP_ABORT) { /* ABORT never asks */
		bridge->abort_asked = true;
		bridge->commanded = false;
	}
}

static int bridge_answer(struct bridge *bridge, int64_t counter, int result)
{
	bridge->publisher->state.counter = counter;
	bridge->publisher->state.result = (int16_t)result;
	bridge_tell(bridge);
	return publisher_state(bridge->publisher);
}

/* One that proves nothing waits its turn: at rest it changes nothing, in motion it brakes what is braked. */
static int obey_abort(struct bridge *bridge)
{
	int64_t now_ms = session_now_ms();
	bool proven = bridge->abort_proven;
	int result;

	if (!proven && bridge->aborted_ms != 0 && now_ms - bridge->aborted_ms < ABORT_EVERY_MS)
		return 0;
	bridge->abort_asked = false;
	bridge->abort_proven = false;
	bridge->aborted_ms = now_ms;
	result = session_command(bridge->session, WIRE_OP_ABORT);
	if (result == 0)
		bridge->publisher->state.aborted_utime = link_clock_us();
	if (proven) {
		keep_record(bridge, &bridge->abort, result);
		return bridge_answer(bridge, bridge->abort.counter, result);
	}
	if (bridge->noted_ms == 0 || now_ms - bridge->noted_ms >= SAY_EVERY_MS) {
		keep_record(bridge, &(droptower_command){.op = WIRE_OP_ABORT, .sender = "unknown"}, result);
		bridge->noted_ms = now_ms;
	}
	say_refused(bridge);
	bridge_tell(bridge);
	return publisher_state(bridge->publisher);
}

static int bridge_carry_out(struct bridge *bridge, const droptower_command *command)
{
	const struct session_view *view = session_view(bridge->session);

	switch (command->op) {
	case WIRE_OP_RELEASE: /* of this ARM, whatever has been armed since it was sent */
		if (!view->armed || command->nonce != view->nonce || command->argument != view->armed_drop_id)
			return DT_E_TOKEN;
		return session_command(bridge->session, WIRE_OP_RELEASE);
	case WIRE_OP_ARM:
	case WIRE_OP_CLEAR:
		return session_command(bridge->session, (enum wire_op)command->op);
	default:
		return DT_E_ARGUMENT;
	}
}

/* Carries out what came in; its outcome goes with the next state. */
static int obey(struct bridge *bridge)
{
	droptower_command command;
	int result;

	if (bridge->abort_asked)
		return obey_abort(bridge);
	say_refused(bridge);
	if (!bridge->commanded)
		return 0;
	command = bridge->command;
	bridge->commanded = false;
	result = bridge_carry_out(bridge, &command);
	if (result == DT_E_PARAMETERS)
		command_error(
		        "bridge: somebody has changed the tower's parameters since they were read: look "
		        "at them with 'droptower ctl get', then start the bridge again");
	keep_record(bridge, &command, result);
	return bridge_answer(bridge, command.counter, result);
}

/* While a command waits for its reply an ABORT must not wait for it. */
static bool bridge_cancelled(void *user)
{
	struct bridge *bridge = user;

	while (lcm_handle_timeout(bridge->publisher->lcm, 0) > 0)
		continue;
	return bridge->abort_asked;
}

/* ---- drops ---- */

static int hand_on_drop(struct bridge *bridge)
{
	struct record record;
	struct evaluated e;
	char *json;
	int taken = session_take_drop(bridge->session, &record);
	int result;

	if (taken <= 0)
		return taken;
	result = publisher_drop(bridge->publisher, &record);
	if (result == 0)
		result = session_accept(bridge->session);
	json = evaluate_json(&e, &record, bridge->scene_file != NULL ? &bridge->scene : NULL, NULL);
	if (json == NULL)
		command_error("drop %u: no result, it cannot be analysed", record.drop_id);
	else if (result == 0)
		result = publisher_result(bridge->publisher, record.drop_id, json);
	fprintf(stderr,
	        "droptower: drop %u: %" PRIu64 " samples lost; %" PRIu64 " blocks, %" PRIu64
	        " states published\n",
	        record.drop_id, record.lost_samples, bridge->publisher->blocks, bridge->publisher->states);
	if (json != NULL)
		evaluate_close(&e);
	free(json);
	record_free(&record);
	return result;
}

static int bridge_serve(struct bridge *bridge)
{
	int result = 0;

	notify("READY=1");
	while (result == 0 && !interrupt_came()) {
		notify_alive();
		result = session_poll(bridge->session, 5);
		while (result == 0 && lcm_handle_timeout(bridge->publisher->lcm, 0) > 0)
			continue;
		if (result == 0)
			result = obey(bridge);
		if (result == 0)
			result = hand_on_drop(bridge);
		if (result == 0)
			result = bridge->publish_error;
	}
	notify("STOPPING=1");
	return result == 0 ? COMMAND_DONE : command_link_failed("bridge", result);
}

static int bridge_session(struct bridge *bridge)
{
	struct session_options options = {
	        .on_frame = bridge_on_frame, .cancelled = bridge_cancelled, .user = bridge};
	char message[SESSION_MESSAGE_MAX];
	int code = COMMAND_DONE;

	bridge->session = session_open(bridge->link, &options, message);
	if (bridge->session == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	bridge->taker.session = session_view(bridge->session)->session;
	if (publisher_listen(bridge->publisher, PUBLISH_COMMAND, on_command, bridge) != 0) {
		command_error("%s: LCM does not receive, or cannot be kept to this machine", bridge->lcm);
		code = COMMAND_LINK;
	}
	if (code == COMMAND_DONE && bridge->scene_file != NULL) {
		int result = tower_setup_hear(bridge->session, message);

		if (result == 0)
			result = tower_setup_write(bridge->session, &bridge->scene, message);
		if (result != 0)
			code = command_tower_failed(result, message);
	}
	if (code == COMMAND_DONE)
		code = bridge_serve(bridge);
	session_close(bridge->session);
	return code;
}

static int bridge_read_key(struct bridge *bridge)
{
	char message[MAC_MESSAGE_MAX];

	if (mac_read_key(bridge->key_file, &bridge->key, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	bridge->taker.key = &bridge->key;
	return COMMAND_DONE;
}

int command_bridge(int argc, char **argv)
{
	static struct bridge bridge; /* a key of 4 KiB is no stack's business */
	char message[PUBLISH_MESSAGE_MAX];
	int code;

	bridge = (struct bridge){.lcm = PUBLISH_URL, .angle_deg = NAN};
	code = option_read(&known_options, &bridge, argc, argv);
	if (code != OPTIONS_READ)
		return code;
	code = bridge_check(&bridge);
	if (code == COMMAND_DONE && bridge.scene_file != NULL)
		code = evaluate_read_scene(&bridge.scene, bridge.scene_file, bridge.angle_deg);
	if (code == COMMAND_DONE && bridge.scene_file != NULL)
		code = evaluate_check_tower(&bridge.scene, bridge.scene_file);
	if (code == COMMAND_DONE && bridge.key_file != NULL)
		code = bridge_read_key(&bridge);
	if (code != COMMAND_DONE)
		return code;
	interrupt_catch();
	bridge.publisher = publisher_open(bridge.lcm, message);
	if (bridge.publisher == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	bridge.publisher->key = bridge.taker.key;
	code = bridge_session(&bridge);
	publisher_close(bridge.publisher);
	return code;
}
