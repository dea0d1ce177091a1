/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/link.h"
#include "host/session/session_can.h"

enum {
	HEARTBEAT_MS = 100,
	SILENCE_MS = 5000,   /* a tower that spoke and is not heard for so long is gone */
	FRAMES_AT_ONCE = 64, /* handled before anything else is done */
};

int can_way_send(struct session *session, struct frame *frame)
{
	struct can_way *way = session->way;
	int result;

	frame->time_us = link_clock_us();
	result = link_send(way->link, frame);
	if (result == DT_E_FULL)
		return 0; /* as one lost on the bus: the link counts it, what matters is sent again */
	if (result == 0)
		session_log_frame(session, frame);
	return result;
}

static int session_can_send_heartbeat(struct session *session)
{
	struct can_way *way = session->way;
	struct wire_host_heartbeat heartbeat = {
	        .nmt_state = 5, .session = session->view.session, .wire_hash_low = (uint16_t)wire_hash()};
	struct frame frame;
	int64_t now_ms = session_now_ms();

	if (session->options.passive || now_ms < way->heartbeat_due_ms)
		return 0;
	way->heartbeat_due_ms = now_ms + HEARTBEAT_MS;
	wire_pack_host_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST, &heartbeat);
	return can_way_send(session, &frame);
}

/* What leaves ARMED forgets its nonce. */
static void follow_state(struct session_view *view, uint8_t state)
{
	if (view->state == WIRE_STATE_ARMED && state != WIRE_STATE_ARMED)
		view->armed = false;
	if (state == WIRE_STATE_FALLING)
		view->collected = false;
	view->state = state;
}

static void follow_status(struct session_view *view, const struct wire_status *status)
{
	view->seen = true;
	view->statuses++;
	view->status_ms = session_now_ms();
	follow_state(view, status->state);
	view->fault = status->fault;
	view->checks = status->checks;
	view->io = status->io;
}

static void follow_block(struct session_view *view, const struct frame *frame)
{
	struct wire_block block;

	view->blocks++;
	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return;
	view->drop_id = block.drop_id;
	follow_state(view, block.status & WIRE_STATUS_STATE); /* two thousand times a second */
}

static void follow_tower(struct session *session, const struct frame *frame)
{
	struct session_view *view = &session->view;
	struct wire_status status;
	struct wire_counter counter;
	struct wire_heartbeat heartbeat;
	struct wire_time time;

	if (frame->id == WIRE_ID_STATUS && wire_unpack_status(frame, &status) == 0) {
		follow_status(view, &status);
	} else if (frame->id == WIRE_ID_COUNTER && wire_unpack_counter(frame, &counter) == 0) {
		if (counter.index < WIRE_COUNTERS) {
			view->counters[counter.index] = counter.value;
			view->counter_known[counter.index] = true;
		}
	} else if (frame->id == WIRE_ID_HEARTBEAT_TOWER && wire_unpack_heartbeat(frame, &heartbeat) == 0) {
		view->hash_known = true;
		view->wire_hash = heartbeat.wire_hash;
		view->hash_agrees = heartbeat.wire_hash == wire_hash();
	} else if (frame->id == WIRE_ID_TIME && wire_unpack_time(frame, &time) == 0) {
		struct can_way *way = session->way;

		clocks_hear(&way->clocks, time.ms, time.days);
		view->two_towers = way->clocks.two;
	} else if (frame->id == WIRE_ID_BLOCK_S1 || frame->id == WIRE_ID_BLOCK_S2) {
		follow_block(view, frame);
	} else if (frame->id == WIRE_ID_MEASURED) {
		if (wire_check_measured(frame) == 0 && wire_unpack_measured(frame, &view->measured) == 0)
			view->measured_known = true;
	}
}

/* The message that the frame is or completes; NULL while more of it must come. */
static const struct frame *put_together(struct can_way *way, const struct frame *frame)
{
	const struct frame *whole = segment_feed(&way->segments, frame);

	if (whole == frame)
		return frame;
	way->classic = true;
	if (frame->id != WIRE_ID_CAPTURE_END) /* as long as blocks come none is asked for */
		way->ask_due_ms = session_now_ms() + CAN_RESEND_PATIENCE_MS;
	return whole;
}

static int session_can_take_frame(struct session *session, const struct frame *frame)
{
	struct can_way *way = session->way;
	const struct frame *whole;
	int result;

	session_log_frame(session, frame);
	whole = put_together(way, frame);
	if (whole == NULL)
		return 0;
	follow_tower(session, whole);
	can_hear_answer(session, whole);
	result = can_collect(session, whole);
	if (session->options.on_frame != NULL)
		session->options.on_frame(session->options.user, whole);
	return result;
}

int can_poll(struct session *session, int timeout_ms)
{
	struct can_way *way = session->way;
	int result = session_can_send_heartbeat(session);

	if (result == 0)
		result = can_drive_collection(session);
	if (timeout_ms > HEARTBEAT_MS / 2)
		timeout_ms = HEARTBEAT_MS / 2;
	for (unsigned count = 0; result == 0 && count < FRAMES_AT_ONCE; count++) {
		struct frame frame;

		result = link_receive(way->link, &frame, count == 0 ? timeout_ms : 0);
		if (result == 0) {
			if (count == 0 && session->view.seen && session_now_ms() - way->heard_ms > SILENCE_MS)
				result = DT_E_CLOSED;
			return result;
		}
		if (result > 0) {
			way->heard_ms = session_now_ms();
			result = session_can_take_frame(session, &frame);
		}
	}
	return result;
}

static void session_can_close(struct session *session)
{
	struct can_way *way = session->way;

	join_destroy(way->join);
	(void)link_close(way->link);
	free(way);
}

static int session_can_open(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX])
{
	struct can_way *way = calloc(1, sizeof(*way));

	if (way != NULL)
		way->join = join_create();
	if (way == NULL || way->join == NULL) {
		free(way);
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	session->way = way;
	way->link = link_open(url, LINK_READ_WRITE, message, SESSION_MESSAGE_MAX);
	if (way->link == NULL) {
		join_destroy(way->join);
		free(way);
		return DT_E_LINK;
	}
	session->view.link = link_counters(way->link);
	return 0;
}

const struct session_way session_can = {
        .open = session_can_open,
        .close = session_can_close,
        .poll = can_poll,
        .command = can_command,
        .set_parameter = can_set_parameter,
        .get_parameter = can_get_parameter,
        .take_drop = can_take_drop,
        .accept = can_accept,
};
