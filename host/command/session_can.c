/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/segment.h"
#include "common/wire_table.h"
#include "host/command/session_private.h"
#include "host/record/join.h"

enum {
	HEARTBEAT_MS = 100,
	SILENCE_MS = 2000, /* a tower that spoke and is not heard for so long is gone */
	REPLY_MS = 300,    /* a reply takes a millisecond; then it or the command was lost */
	TRIES = 10,
	RESEND_TICKS = 32,       /* asked for in one frame */
	RESEND_FRAMES = 6,       /* on their way at once */
	RESEND_PATIENCE_MS = 60, /* without a resent block: ask again */
	RESEND_ROUNDS = 25,      /* without progress: give up */
	FORGET_MAX = 3,          /* whole captures fetched again because of a wrong CRC-32 */
	FRAMES_AT_ONCE = 64,     /* handled before anything else is done */
};

/* CiA 301, expedited transfer of four bytes: the first byte of a request and of its answer. */
enum { SDO_WRITE = 0x23, SDO_WRITTEN = 0x60, SDO_READ = 0x40, SDO_VALUE = 0x43, SDO_ABORT = 0x80 };

struct can_way {
	struct link *link;
	struct join *join;
	struct segment_join segments;
	bool classic; /* they come in segments: the tower uploads by itself */
	int64_t heartbeat_due_ms;
	int64_t heard_ms;
	uint8_t sequence;
	bool reply_awaited;
	struct wire_reply reply; /* valid once reply_awaited fell */
	bool sdo_awaited;
	struct wire_sdo sdo;
	/* collecting */
	bool collecting; /* a capture end came and its drop is not finished */
	bool finished;   /* the drop waits for session_take_drop */
	struct wire_capture_end end;
	enum wire_op verdict; /* ACCEPT or DISCARD, of the last drop; repeated while the tower asks */
	bool judged;
	int64_t ask_due_ms;
	unsigned rounds; /* since the last resent block */
	unsigned forgotten;
	bool progress;
};

static int send(struct session *session, struct frame *frame)
{
	struct can_way *way = session->way;
	int result;

	frame->time_us = session_utime();
	result = link_send(way->link, frame);
	if (result == DT_E_FULL)
		return 0; /* as one lost on the bus: the link counts it, what matters is sent again */
	if (result == 0 && session->options.log != NULL)
		result = link_send(session->options.log, frame);
	return result;
}

static int send_heartbeat(struct session *session)
{
	struct can_way *way = session->way;
	struct wire_heartbeat heartbeat = {.nmt_state = 5, .wire_hash = wire_hash()};
	struct frame frame;
	int64_t now_ms = session_now_ms();

	if (session->options.passive || now_ms < way->heartbeat_due_ms)
		return 0;
	way->heartbeat_due_ms = now_ms + HEARTBEAT_MS;
	wire_pack_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST, &heartbeat);
	return send(session, &frame);
}

static int send_op(struct session *session, enum wire_op op, uint16_t token, uint32_t argument)
{
	struct can_way *way = session->way;
	struct wire_command command = {
	        .op = (uint8_t)op, .sequence = way->sequence, .token = token, .argument = argument};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	return send(session, &frame);
}

static int send_verdict(struct session *session)
{
	struct can_way *way = session->way;

	return send_op(session, way->verdict, 0, way->verdict == WIRE_OP_ACCEPT ? way->end.crc32 : 0);
}

/* After it the tower forgets: a host that is killed then must have the samples in its log. */
static int judge(struct session *session, enum wire_op verdict)
{
	struct can_way *way = session->way;
	int result = session->options.log != NULL ? link_flush(session->options.log) : 0;

	if (result != 0)
		return result;
	way->sequence++;
	way->verdict = verdict;
	way->judged = true;
	way->finished = true;
	return send_verdict(session);
}

static bool same_capture(const struct wire_capture_end *a, const struct wire_capture_end *b)
{
	return a->drop_id == b->drop_id && a->crc32 == b->crc32 && a->first_tick_ms == b->first_tick_ms;
}

static void follow_tower(struct session *session, const struct frame *frame)
{
	struct session_view *view = &session->view;
	struct wire_status status;
	struct wire_counter counter;
	struct wire_heartbeat heartbeat;

	if (frame->id == WIRE_ID_STATUS && wire_unpack_status(frame, &status) == 0) {
		view->seen = true;
		view->statuses++;
		view->state = status.state;
		view->fault = status.fault;
		view->checks = status.checks;
		view->drop_id = status.drop_id;
		view->io = status.io;
	} else if (frame->id == WIRE_ID_COUNTER && wire_unpack_counter(frame, &counter) == 0) {
		if (counter.index < WIRE_COUNTERS) {
			view->counters[counter.index] = counter.value;
			view->counter_known[counter.index] = true;
		}
	} else if (frame->id == WIRE_ID_HEARTBEAT_TOWER && wire_unpack_heartbeat(frame, &heartbeat) == 0) {
		view->hash_known = true;
		view->wire_hash = heartbeat.wire_hash;
		view->hash_agrees = heartbeat.wire_hash == wire_hash();
	} else if (frame->id == WIRE_ID_BLOCK_S1 || frame->id == WIRE_ID_BLOCK_S2) {
		view->blocks++;
		if (wire_check_block(frame) == 0)
			view->state = frame->data[6] & WIRE_STATUS_STATE; /* two thousand times a second */
	}
}

/* Another host on the bus may ask for the same. */
static bool is_answer(const struct wire_sdo *answer, const struct wire_sdo *request)
{
	unsigned wanted = request->specifier == SDO_READ ? SDO_VALUE : SDO_WRITTEN;

	return answer->index == request->index &&
	       (answer->specifier == wanted || answer->specifier == SDO_ABORT);
}

static void hear_answers(struct can_way *way, const struct frame *frame)
{
	struct wire_reply reply;
	struct wire_sdo sdo;

	if (frame->id == WIRE_ID_REPLY && wire_unpack_reply(frame, &reply) == 0) {
		if (way->reply_awaited && reply.sequence == way->sequence) {
			way->reply = reply;
			way->reply_awaited = false;
		}
	} else if (frame->id == WIRE_ID_SDO_REPLY && wire_unpack_sdo(frame, &sdo) == 0) {
		if (way->sdo_awaited && is_answer(&sdo, &way->sdo)) {
			way->sdo = sdo;
			way->sdo_awaited = false;
		}
	}
}

static void begin_collecting(struct can_way *way, const struct wire_capture_end *end)
{
	way->collecting = true;
	way->judged = false;
	way->end = *end;
	way->rounds = 0;
	way->forgotten = 0;
	way->ask_due_ms = way->classic ? session_now_ms() + RESEND_PATIENCE_MS : 0;
}

static int collect(struct session *session, const struct frame *frame)
{
	struct can_way *way = session->way;
	struct wire_capture_end end;

	if (session->options.passive)
		return 0;
	if (frame->id == WIRE_ID_CAPTURE_END && wire_unpack_capture_end(frame, &end) == 0) {
		if (way->judged && same_capture(&end, &way->end))
			return send_verdict(session); /* it was lost on its way */
		if (session->hold)
			return 0; /* it comes again */
		if (!way->collecting)
			begin_collecting(way, &end);
	}
	if (way->finished)
		return 0; /* the join holds a drop that nobody took yet */
	if (frame->id == WIRE_ID_RESENT_S1 || frame->id == WIRE_ID_RESENT_S2) {
		way->progress = true;
		way->ask_due_ms = session_now_ms() + RESEND_PATIENCE_MS;
	}
	(void)join_feed(way->join, frame);
	return 0;
}

static int ask_again(struct session *session)
{
	struct can_way *way = session->way;
	struct record_gap gap;
	unsigned sensor = 1, asked = 0;
	uint32_t tick_ms = way->end.first_tick_ms;

	while (asked < RESEND_FRAMES && join_next_gap(way->join, sensor, tick_ms, RESEND_TICKS, &gap)) {
		struct wire_resend resend = {.sensor = (uint8_t)gap.sensor,
		                             .count = (uint16_t)(gap.last_tick_ms - gap.first_tick_ms + 1),
		                             .first_tick_ms = gap.first_tick_ms};
		struct frame frame;
		int result;

		wire_pack_resend(&frame, WIRE_ID_RESEND, &resend);
		result = send(session, &frame);
		if (result != 0)
			return result;
		session->view.asked += resend.count;
		sensor = gap.sensor;
		tick_ms = gap.last_tick_ms + 1;
		asked++;
	}
	if (asked == 0 && way->forgotten < FORGET_MAX) { /* all there, and yet the CRC-32 disagrees */
		way->forgotten++;
		join_forget(way->join);
	}
	return 0;
}

/* Moves the collection on: ask, wait, ask again, until complete or hopeless. */
static int drive_collection(struct session *session)
{
	struct can_way *way = session->way;
	int64_t now_ms = session_now_ms();

	if (!way->collecting || way->finished)
		return 0;
	if (join_complete(way->join))
		return judge(session, WIRE_OP_ACCEPT);
	if (now_ms < way->ask_due_ms)
		return 0;
	way->rounds = way->progress ? 0 : way->rounds + 1;
	way->progress = false;
	if (way->rounds > RESEND_ROUNDS)
		return judge(session, WIRE_OP_DISCARD);
	way->ask_due_ms = now_ms + RESEND_PATIENCE_MS;
	return ask_again(session);
}

/* The message that the frame is or completes; NULL while more of it must come. */
static const struct frame *put_together(struct can_way *way, const struct frame *frame)
{
	const struct frame *whole = segment_feed(&way->segments, frame);

	if (whole == frame)
		return frame;
	way->classic = true;
	if (frame->id != WIRE_ID_CAPTURE_END) /* as long as blocks come none is asked for */
		way->ask_due_ms = session_now_ms() + RESEND_PATIENCE_MS;
	return whole;
}

static int take_frame(struct session *session, const struct frame *frame)
{
	struct can_way *way = session->way;
	const struct frame *whole;
	int result = 0;

	if (session->options.log != NULL)
		result = link_send(session->options.log, frame);
	whole = put_together(way, frame);
	if (whole == NULL)
		return result;
	follow_tower(session, whole);
	hear_answers(way, whole);
	if (result == 0)
		result = collect(session, whole);
	if (session->options.on_frame != NULL)
		session->options.on_frame(session->options.user, whole);
	return result;
}

static int can_poll(struct session *session, int timeout_ms)
{
	struct can_way *way = session->way;
	int result = send_heartbeat(session);

	if (result == 0)
		result = drive_collection(session);
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
			result = take_frame(session, &frame);
		}
	}
	return result;
}

/* A command that was lost and sent again may be refused only because the first one worked. */
static bool worked(enum wire_op op, unsigned state)
{
	switch (op) {
	case WIRE_OP_ARM:
		return state == WIRE_STATE_ARMED;
	case WIRE_OP_RELEASE:
		return session_drops(state);
	case WIRE_OP_ABORT:
		return true;
	case WIRE_OP_CLEAR:
		return state == WIRE_STATE_SAFE || state == WIRE_STATE_READY;
	case WIRE_OP_ACCEPT:
	case WIRE_OP_DISCARD:
		return state != WIRE_STATE_CAPTURED;
	}
	return false;
}

static int await(struct session *session, const bool *awaited, bool always)
{
	int64_t deadline_ms = session_now_ms() + REPLY_MS;

	while (*awaited && session_now_ms() < deadline_ms && (always || !session_cancelled(session))) {
		int result = can_poll(session, 10);

		if (result != 0)
			return result;
	}
	return *awaited ? DT_E_TIMEOUT : 0;
}

static int can_command(struct session *session, enum wire_op op, uint16_t token)
{
	struct can_way *way = session->way;
	bool always = op == WIRE_OP_ABORT;
	int result = DT_E_TIMEOUT;

	way->sequence++;
	for (int attempt = 0;
	     attempt < TRIES && result == DT_E_TIMEOUT && (always || !session_cancelled(session));
	     attempt++) {
		if (op == WIRE_OP_ABORT) { /* both ways to stop: any tool's, and ours with a reply */
			struct wire_nmt stop = {.command = 2, .node = 1};
			struct frame frame;

			wire_pack_nmt(&frame, WIRE_ID_NMT, &stop);
			result = send(session, &frame);
			if (result != 0)
				return result;
		}
		way->reply_awaited = true;
		result = send_op(session, op, token, 0);
		if (result == 0)
			result = await(session, &way->reply_awaited, always);
		if (result == 0 && way->reply.result != 0 && !(attempt > 0 && worked(op, way->reply.state)))
			result = way->reply.result;
	}
	way->reply_awaited = false;
	return result;
}

/* Sends request until it is answered; 0 with the answer in way->sdo. */
static int ask_sdo(struct session *session, const struct wire_sdo *request)
{
	struct can_way *way = session->way;
	struct frame frame;
	int result = DT_E_TIMEOUT;

	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, request);
	for (int attempt = 0; attempt < TRIES && result == DT_E_TIMEOUT && !session_cancelled(session);
	     attempt++) {
		way->sdo = *request;
		way->sdo_awaited = true;
		result = send(session, &frame);
		if (result == 0)
			result = await(session, &way->sdo_awaited, false);
	}
	way->sdo_awaited = false;
	return result;
}

static int can_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	const struct can_way *way = session->way;
	struct wire_sdo write = {
	        .specifier = SDO_WRITE, .index = wire_parameters[number].index, .value = value};
	int result = ask_sdo(session, &write);

	if (result == 0 && way->sdo.specifier != SDO_WRITTEN)
		result = way->sdo.value == 0x08000022u ? DT_E_STATE : DT_E_RANGE; /* CiA 301 abort codes */
	return result;
}

static int can_get_parameter(struct session *session, enum wire_parameter_number number, uint32_t *value)
{
	const struct can_way *way = session->way;
	struct wire_sdo read = {.specifier = SDO_READ, .index = wire_parameters[number].index};
	int result = ask_sdo(session, &read);

	if (result == 0 && way->sdo.specifier != SDO_VALUE)
		result = DT_E_EMPTY;
	if (result == 0)
		*value = way->sdo.value;
	return result;
}

static int can_take_drop(struct session *session, struct record *record)
{
	struct can_way *way = session->way;
	int result;

	if (!way->finished)
		return 0;
	result = join_take(way->join, record);
	way->finished = false;
	way->collecting = false;
	if (result != 0)
		return result;
	snprintf(record->file, sizeof(record->file), "%s", link_url(way->link));
	snprintf(record->format, sizeof(record->format), "live");
	return 1;
}

static void can_close(struct session *session)
{
	struct can_way *way = session->way;

	join_destroy(way->join);
	(void)link_close(way->link);
	free(way);
}

static int can_open(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX])
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
        .open = can_open,
        .close = can_close,
        .poll = can_poll,
        .command = can_command,
        .set_parameter = can_set_parameter,
        .get_parameter = can_get_parameter,
        .take_drop = can_take_drop,
};
