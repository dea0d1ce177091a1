/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A session through `droptower bridge`: the bridge keeps the heartbeat, collects and accepts; here the
 * state is followed, commands are sent and the finished drop is taken.
 */
#include <droptower_command.h>
#include <droptower_drop.h>
#include <droptower_state.h>
#include <stdio.h>
#include <stdlib.h>

#include "host/command/publish.h"
#include "host/command/session_private.h"
#include "host/record/lcm_codec.h"
#include "host/record/write.h"

enum { ANSWER_MS = 4000 }; /* the bridge tries for three seconds itself */

struct lcm_way {
	struct publisher *publisher;
	int64_t command_utime; /* of the last command answered, as the bridge says */
	int command_result;
	bool has_drop;
	struct record drop;
	int drop_error; /* the last DT_DROP was none */
};

static void on_state(const lcm_recv_buf_t *buffer, const char *channel, const droptower_state *state,
                     void *user)
{
	struct session *session = user;
	struct lcm_way *way = session->way;

	(void)buffer;
	(void)channel;
	session->view.seen = true;
	session->view.statuses++;
	session->view.hash_known = true;
	session->view.hash_agrees = true; /* LCM types carry a fingerprint of their own */
	session->view.state = (uint8_t)state->state;
	session->view.fault = (uint8_t)state->fault;
	session->view.checks = (uint16_t)state->checks;
	session->view.drop_id = (uint16_t)state->drop_id;
	session->view.io = (uint16_t)state->io;
	way->command_utime = state->command_utime;
	way->command_result = state->command_result;
}

static void on_block(const lcm_recv_buf_t *buffer, const char *channel, const droptower_block *block,
                     void *user)
{
	struct session *session = user;
	struct frame frame;

	(void)buffer;
	(void)channel;
	if (lcm_codec_frame(block, &frame) != 0)
		return;
	frame.time_us = block->utime;
	session->view.blocks++;
	session->view.state = (uint8_t)(block->status & WIRE_STATUS_STATE);
	if (session->options.on_frame != NULL)
		session->options.on_frame(session->options.user, &frame);
}

static void on_drop(const lcm_recv_buf_t *buffer, const char *channel, const droptower_drop *drop, void *user)
{
	struct session *session = user;
	struct lcm_way *way = session->way;

	(void)buffer;
	(void)channel;
	if (way->has_drop)
		record_free(&way->drop);
	way->drop_error = lcm_codec_record(drop, &way->drop);
	way->has_drop = way->drop_error == 0;
}

static int lcm_way_poll(struct session *session, int timeout_ms)
{
	struct lcm_way *way = session->way;
	int result = lcm_handle_timeout(way->publisher->lcm, timeout_ms);

	return result < 0 ? DT_E_LINK : 0;
}

static int lcm_way_command(struct session *session, enum wire_op op, uint16_t token)
{
	struct lcm_way *way = session->way;
	droptower_command command = {.utime = session_utime(), .op = (int16_t)op, .token = token};
	int64_t deadline_ms = session_now_ms() + ANSWER_MS;

	if (droptower_command_publish(way->publisher->lcm, PUBLISH_COMMAND, &command) != 0)
		return DT_E_LINK;
	while (way->command_utime != command.utime) {
		int result = lcm_way_poll(session, 20);

		if (result != 0)
			return result;
		if (session_now_ms() > deadline_ms || (op != WIRE_OP_ABORT && session_cancelled(session)))
			return DT_E_TIMEOUT;
	}
	return way->command_result;
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

static int log_frame(void *user, const struct frame *frame)
{
	return link_send(user, frame);
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
	if (session->options.log != NULL && write_frames(record, log_frame, session->options.log) != 0) {
		record_free(record);
		return DT_E_SYSTEM;
	}
	snprintf(record->format, sizeof(record->format), "live");
	return 1;
}

static void lcm_way_close(struct session *session)
{
	struct lcm_way *way = session->way;

	if (way->has_drop)
		record_free(&way->drop);
	publisher_close(way->publisher);
	free(way);
}

static int lcm_way_open(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX])
{
	struct lcm_way *way = calloc(1, sizeof(*way));
	lcm_t *lcm;

	if (way == NULL) {
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	way->publisher = publisher_open(url, message);
	if (way->publisher == NULL) {
		free(way);
		return DT_E_LINK;
	}
	session->way = way;
	lcm = way->publisher->lcm;
	droptower_state_subscription_set_queue_capacity(
	        droptower_state_subscribe(lcm, PUBLISH_STATE, on_state, session), 0);
	droptower_block_subscription_set_queue_capacity(
	        droptower_block_subscribe(lcm, LCM_CODEC_BLOCK, on_block, session), 0);
	droptower_drop_subscription_set_queue_capacity(
	        droptower_drop_subscribe(lcm, LCM_CODEC_DROP, on_drop, session), 0);
	return 0;
}

const struct session_way session_lcm = {
        .open = lcm_way_open,
        .close = lcm_way_close,
        .poll = lcm_way_poll,
        .command = lcm_way_command,
        .set_parameter = lcm_way_set_parameter,
        .get_parameter = lcm_way_get_parameter,
        .take_drop = lcm_way_take_drop,
};
