/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Fetches a drop: asks again for what is missing until its CRC-32 agrees, then judges it.
 */
#include <stdio.h>

#include "host/session/session_can.h"

enum {
	RESEND_TICKS = 32,  /* asked for in one frame */
	RESEND_FRAMES = 6,  /* on their way at once */
	RESEND_ROUNDS = 25, /* without progress: give up */
	TOLD_ROUNDS = 25,   /* for what follows the capture end: then without it */
	FORGET_MAX = 3,     /* whole captures fetched again because of a wrong CRC-32 */
};

static int send_verdict(struct session *session)
{
	struct can_way *way = session->way;

	return can_send_op(session, way->verdict,
	                   way->verdict == WIRE_OP_ACCEPT ? way->end.crc32 : way->end.drop_id);
}

/* After it the tower forgets: a host that is killed then must have the samples in its log. */
static int session_collect_judge(struct session *session, enum wire_op verdict)
{
	struct can_way *way = session->way;
	struct link *log = session->options.log;

	session->log_failed |= log != NULL && link_flush(log) != 0;
	way->finished = true;
	way->verdict = verdict;
	session->view.collected = true;
	session->view.kept = true;
	return log != NULL && !session->log_failed ? can_accept(session) : 0;
}

int can_accept(struct session *session)
{
	struct can_way *way = session->way;

	if (!session->view.kept)
		return 0;
	session->view.kept = false;
	way->sequence++;
	way->judged = true;
	return send_verdict(session);
}

static bool same_capture(const struct wire_capture_end *a, const struct wire_capture_end *b)
{
	return a->drop_id == b->drop_id && a->crc32 == b->crc32 && a->first_tick_ms == b->first_tick_ms;
}

static void begin_collecting(struct can_way *way, const struct wire_capture_end *end)
{
	way->collecting = true;
	way->judged = false;
	way->end = *end;
	way->rounds = 0;
	way->forgotten = 0;
	way->ask_due_ms = way->classic ? session_now_ms() + CAN_RESEND_PATIENCE_MS : 0;
	way->told_due_ms = session_now_ms() + CAN_RESEND_PATIENCE_MS;
	way->told_rounds = 0;
}

int can_collect(struct session *session, const struct frame *frame)
{
	struct can_way *way = session->way;
	struct wire_capture_end end;

	if (session->options.passive)
		return 0;
	if (frame->id == WIRE_ID_CAPTURE_END && wire_check_capture_end(frame) == 0 &&
	    wire_unpack_capture_end(frame, &end) == 0) {
		session->view.drop_id = end.drop_id;
		if (way->judged && same_capture(&end, &way->end))
			return send_verdict(session); /* it was lost on its way */
		if (session->hold || (session->view.kept && same_capture(&end, &way->end)))
			return 0; /* it comes again */
		if (!way->collecting) {
			begin_collecting(way, &end);
			session->view.collected = false;
			session->view.kept = false;
		}
	}
	if (way->finished)
		return 0; /* the join holds a drop that nobody took yet */
	if (frame->id == WIRE_ID_RESENT_S1 || frame->id == WIRE_ID_RESENT_S2) {
		way->progress = true;
		way->ask_due_ms = session_now_ms() + CAN_RESEND_PATIENCE_MS;
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
		result = can_way_send(session, &frame);
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

/* The capture end again, and all that follows it. */
static int ask_end(struct session *session)
{
	struct wire_resend resend = {.sensor = 1};
	struct frame frame;

	wire_pack_resend(&frame, WIRE_ID_RESEND, &resend);
	return can_way_send(session, &frame);
}

/* What the drop has measured and its parameters follow the capture end; a drop is a drop without them. */
static int session_collect_finish(struct session *session)
{
	struct can_way *way = session->way;
	int64_t now_ms = session_now_ms();

	if (join_told(way->join) || way->told_rounds > TOLD_ROUNDS)
		return session_collect_judge(session, WIRE_OP_ACCEPT);
	if (now_ms < way->told_due_ms)
		return 0;
	way->told_due_ms = now_ms + CAN_RESEND_PATIENCE_MS;
	way->told_rounds++;
	return ask_end(session);
}

int can_drive_collection(struct session *session)
{
	struct can_way *way = session->way;
	int64_t now_ms = session_now_ms();

	if (!way->collecting || way->finished)
		return 0;
	if (join_complete(way->join))
		return session_collect_finish(session);
	if (now_ms < way->ask_due_ms)
		return 0;
	way->rounds = way->progress ? 0 : way->rounds + 1;
	way->progress = false;
	if (way->rounds > RESEND_ROUNDS)
		return session_collect_judge(session, WIRE_OP_DISCARD);
	way->ask_due_ms = now_ms + CAN_RESEND_PATIENCE_MS;
	return ask_again(session);
}

int can_take_drop(struct session *session, struct record *record)
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
