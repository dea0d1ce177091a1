/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A session through `droptower bridge`: the bridge keeps the heartbeat, collects and accepts; here the
 * state is followed, commands are sent and the finished drop is taken.
 *
 * With a key only what the bridge signed with it, and signed just now, is believed: whoever can send on LCM
 * can then neither tell a wrong state nor hand over a wrong drop. Without one everything is, for a look, and
 * nothing can be sent but ABORT.
 */
#include <droptower_command.h>
#include <droptower_drop.h>
#include <droptower_state.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/link.h"
#include "host/session/journal.h"
#include "host/session/publish.h"
#include "host/session/session_private.h"
#include "host/record/lcm_codec.h"
#include "host/record/write.h"

enum {
	STATE_MS = 3000,  /* a bridge says its state ten times a second */
	ANSWER_MS = 4000, /* the bridge tries for three seconds itself */
};

struct lcm_way {
	struct publisher *publisher;
	struct mac_key key;
	bool has_key;
	bool heard; /* a state, believed or not */
	droptower_state state;
	int64_t counter;    /* of the last command sent */
	bool armed_here;    /* the bridge's ARM is ours */
	int64_t drop_utime; /* of the last drop, or when the session began: none from before is taken */
	bool has_drop;
	struct record drop;
	int drop_error; /* the last DT_DROP was none */
};

/* Of the bridge whose key we have, and not sent by somebody again. */
static bool is_believed(const struct lcm_way *way, const char *channel, const lcm_recv_buf_t *buffer)
{
	return !way->has_key || mac_holds(&way->key, channel, buffer->data, buffer->data_size);
}

static bool is_news(const struct lcm_way *way, const droptower_state *state)
{
	int64_t age_us = link_clock_us() - state->utime;

	return !way->has_key ||
	       (state->utime > way->state.utime && age_us < MAC_AGE_US && age_us > -MAC_AGE_US);
}

static void session_lcm_follow(struct session *session, const droptower_state *state)
{
	struct session_view *view = &session->view;
	struct lcm_way *way = session->way;
	int64_t now_ms = session_now_ms();

	view->seen = true;
	view->statuses++;
	view->status_ms = now_ms;
	view->hash_known = true;
	view->hash_agrees = true; /* LCM types carry a fingerprint of their own */
	view->state = (uint8_t)state->state;
	view->fault = (uint8_t)state->fault;
	view->checks = (uint32_t)state->checks;
	view->drop_id = (uint16_t)state->drop_id;
	view->io = (uint16_t)state->io;
	if (!state->armed || (view->armed && state->nonce != view->nonce))
		way->armed_here = false;
	view->armed = way->armed_here;
	view->nonce = (uint32_t)state->nonce;
	view->armed_drop_id = (uint16_t)state->armed_drop_id;
	view->release_from_ms = now_ms + state->release_in_ms;
	view->armed_until_ms = now_ms + state->disarmed_in_ms;
}

static void session_lcm_on_state(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	struct session *session = user;
	struct lcm_way *way = session->way;
	droptower_state state;

	if (buffer->data_size > INT32_MAX ||
	    droptower_state_decode(buffer->data, 0, (int)buffer->data_size, &state) != (int)buffer->data_size)
		return;
	way->heard = true;
	if (!is_believed(way, channel, buffer) || !is_news(way, &state))
		return;
	way->state = state;
	session_lcm_follow(session, &state);
}

static void on_block(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	struct session *session = user;
	const struct lcm_way *way = session->way;
	droptower_block block;
	struct frame frame;

	(void)channel;
	if (lcm_codec_decode_block(buffer->data, buffer->data_size, &block) != 0 ||
	    lcm_codec_frame(&block, &frame) != 0)
		return;
	frame.time_us = block.utime;
	session->view.blocks++;
	if (!way->has_key) /* blocks are not signed */
		session->view.state = (uint8_t)(block.status & WIRE_STATUS_STATE);
	if (session->options.on_frame != NULL)
		session->options.on_frame(session->options.user, &frame);
}

static void session_lcm_take_drop(struct lcm_way *way, const droptower_drop *drop)
{
	if (way->has_key && drop->utime <= way->drop_utime)
		return;
	way->drop_utime = drop->utime;
	if (way->has_drop)
		record_free(&way->drop);
	way->drop_error = lcm_codec_record(drop, &way->drop);
	way->has_drop = way->drop_error == 0;
}

static void on_drop(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	struct session *session = user;
	struct lcm_way *way = session->way;
	droptower_drop drop;
	int result;

	if (!is_believed(way, channel, buffer))
		return;
	result = lcm_codec_decode_drop(buffer->data, buffer->data_size, false, &drop);
	if (result == DT_E_FORMAT && !way->has_key)
		return; /* what is no drop, anybody may have sent */
	if (result != 0) {
		way->drop_error = result;
		return;
	}
	session_lcm_take_drop(way, &drop);
	lcm_codec_free_drop(&drop);
}

static int lcm_way_poll(struct session *session, int timeout_ms)
{
	struct lcm_way *way = session->way;
	int result = lcm_handle_timeout(way->publisher->lcm, timeout_ms);

	return result < 0 ? DT_E_LINK : 0;
}

/* ---- commands ---- */

/* Session and counter stand in the bridge's state. ABORT needs neither, and does not wait for them. */
static int await_bridge(struct session *session)
{
	const struct lcm_way *way = session->way;
	int64_t deadline_ms = session_now_ms() + STATE_MS;

	while (!session->view.seen && session_now_ms() < deadline_ms) {
		int result = lcm_way_poll(session, 20);

		if (result != 0)
			return result;
	}
	if (session->view.seen)
		return 0;
	return way->heard ? DT_E_KEY : DT_E_TIMEOUT;
}

static int send_command(struct session *session, droptower_command *command)
{
	struct lcm_way *way = session->way;
	uint8_t bytes[256];
	int size;

	if (way->counter < way->state.counter)
		way->counter = way->state.counter;
	command->counter = ++way->counter;
	command->session = way->state.session;
	command->utime = link_clock_us();
	journal_sender(session->options.program != NULL ? session->options.program : "?",
	               (char *)command->sender, sizeof(command->sender));
	size = droptower_command_encode(bytes, 0, sizeof(bytes), command);
	if (size < MAC_BYTES)
		return DT_E_MEMORY;
	if (way->has_key)
		mac_seal(&way->key, PUBLISH_COMMAND, bytes, (size_t)size);
	return lcm_publish(way->publisher->lcm, PUBLISH_COMMAND, bytes, (unsigned)size) == 0 ? 0 : DT_E_LINK;
}

static bool is_answered(const struct lcm_way *way, const droptower_command *command)
{
	if (command->op == WIRE_OP_ABORT && way->state.aborted_utime >= command->utime)
		return true;
	return way->has_key && way->state.session == command->session &&
	       way->state.counter >= command->counter;
}

static int await_answer(struct session *session, const droptower_command *command)
{
	const struct lcm_way *way = session->way;
	int64_t deadline_ms = session_now_ms() + ANSWER_MS;

	while (!is_answered(way, command)) {
		int result = lcm_way_poll(session, 20);

		if (result != 0)
			return result;
		if (session_now_ms() > deadline_ms)
			return way->heard && !session->view.seen ? DT_E_KEY : DT_E_TIMEOUT;
		if (command->op != WIRE_OP_ABORT && session_cancelled(session))
			return DT_E_TIMEOUT;
	}
	if (command->op == WIRE_OP_ABORT && way->state.aborted_utime >= command->utime)
		return 0;
	return way->state.counter == command->counter ? way->state.result : DT_E_STATE; /* another's came */
}

static int lcm_way_command(struct session *session, enum wire_op op)
{
	struct lcm_way *way = session->way;
	droptower_command command = {.op = (int16_t)op};
	int result;

	if (op != WIRE_OP_ABORT && !way->has_key)
		return DT_E_KEY;
	result = op == WIRE_OP_ABORT ? 0 : await_bridge(session);
	if (result != 0)
		return result;
	if (op == WIRE_OP_RELEASE) {
		if (!session->view.armed)
			return DT_E_TOKEN;
		command.nonce = session->view.nonce;
		command.argument = session->view.armed_drop_id;
	}
	result = send_command(session, &command);
	if (result == 0)
		result = await_answer(session, &command);
	if (result == 0 && op == WIRE_OP_ARM) {
		way->armed_here = true;
		session_lcm_follow(session, &way->state);
	}
	return result;
}

static int lcm_way_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	(void)session;
	(void)number;
	(void)value;
	return DT_E_UNKNOWN;
}

static int lcm_way_get_parameter(struct session *session, enum wire_parameter_number number, uint32_t *value)
{
	(void)session;
	(void)number;
	(void)value;
	return DT_E_UNKNOWN;
}

static int session_lcm_log_frame(void *user, const struct frame *frame)
{
	session_log_frame(user, frame);
	return 0;
}

/* The log gets the drop's own frames: what else came over the bus is in the bridge's. */
static int lcm_way_take_drop(struct session *session, struct record *record)
{
	struct lcm_way *way = session->way;

	if (!way->has_drop) {
		int error = way->drop_error;

		way->drop_error = 0;
		return error;
	}
	*record = way->drop;
	way->has_drop = false;
	if (session->options.log != NULL && write_frames(record, session_lcm_log_frame, session) != 0)
		session->log_failed = true;
	snprintf(record->format, sizeof(record->format), "live");
	return 1;
}

/* The bridge has. */
static int lcm_way_accept(struct session *session)
{
	(void)session;
	return 0;
}

static void lcm_way_close(struct session *session)
{
	struct lcm_way *way = session->way;

	if (way->has_drop)
		record_free(&way->drop);
	publisher_close(way->publisher);
	free(way);
}

static int listen(struct session *session)
{
	struct lcm_way *way = session->way;
	int result = publisher_listen(way->publisher, PUBLISH_STATE, session_lcm_on_state, session);

	if (result == 0)
		result = publisher_listen(way->publisher, LCM_CODEC_BLOCK, on_block, session);
	if (result == 0)
		result = publisher_listen(way->publisher, LCM_CODEC_DROP, on_drop, session);
	return result;
}

static int open_way(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX])
{
	struct lcm_way *way = session->way;

	way->drop_utime = link_clock_us();
	if (session->options.key != NULL) {
		if (mac_read_key(session->options.key, &way->key, message) != 0)
			return DT_E_ARGUMENT;
		way->has_key = true;
	}
	way->publisher = publisher_open(url, message);
	if (way->publisher == NULL)
		return DT_E_LINK;
	if (listen(session) == 0)
		return 0;
	snprintf(message, SESSION_MESSAGE_MAX,
	         "%.160s: LCM does not receive, or cannot be kept to this machine", url);
	publisher_close(way->publisher);
	return DT_E_LINK;
}

static int lcm_way_open(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX])
{
	int result;

	session->way = calloc(1, sizeof(struct lcm_way));
	if (session->way == NULL) {
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	result = open_way(session, url, message);
	if (result != 0)
		free(session->way);
	return result;
}

const struct session_way session_lcm = {
        .open = lcm_way_open,
        .close = lcm_way_close,
        .poll = lcm_way_poll,
        .command = lcm_way_command,
        .set_parameter = lcm_way_set_parameter,
        .get_parameter = lcm_way_get_parameter,
        .take_drop = lcm_way_take_drop,
        .accept = lcm_way_accept,
};
