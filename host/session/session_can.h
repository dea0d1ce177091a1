/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_SESSION_CAN_H
#define DT_HOST_SESSION_SESSION_CAN_H
/*
 * What the files of a session over CAN share: session_can.c has the link and follows the tower, session_ask.c
 * sends commands and parameters and waits for the answers, session_collect.c fetches a drop.
 */
#include "common/segment.h"
#include "host/session/clocks.h"
#include "host/session/session_private.h"
#include "host/record/join.h"

struct can_way {
	struct link *link;
	struct segment_join segments;
	bool classic; /* they come in segments: the tower uploads by itself */
	int64_t heartbeat_due_ms;
	int64_t heard_ms;
	struct clocks clocks;

	/* what is waited for */
	uint8_t sequence;
	bool reply_awaited;
	struct wire_reply reply; /* valid once reply_awaited fell */
	bool challenge_awaited;  /* ARM was sent: a challenge is news to the view ... */
	bool answering;          /* ... that of an ARM which answered one */
	bool sdo_awaited;
	struct wire_sdo sdo;

	/* collecting */
	struct join *join;
	bool collecting; /* a capture end came and its drop is not finished */
	bool finished;   /* the drop waits for session_take_drop */
	struct wire_capture_end end;
	enum wire_op verdict; /* ACCEPT or DISCARD, of the last drop; repeated while the tower asks */
	bool judged;
	int64_t ask_due_ms;
	unsigned rounds; /* since the last resent block */
	int64_t told_due_ms;
	unsigned told_rounds; /* what follows the capture end was asked for so often */
	unsigned forgotten;
	bool progress;
};

/* ---- session_can.c ---- */

/* Now, into the log too. A full link loses it, as the bus might. */
DT_MUST_USE int can_way_send(struct session *session, struct frame *frame);
DT_MUST_USE int can_poll(struct session *session, int timeout_ms);

/* ---- session_ask.c ---- */

DT_MUST_USE int can_send_op(struct session *session, enum wire_op op, uint32_t argument);
DT_MUST_USE int can_command(struct session *session, enum wire_op op);
DT_MUST_USE int can_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value);
DT_MUST_USE int can_get_parameter(struct session *session, enum wire_parameter_number number,
                                  uint32_t *value);
/* Takes an answer that is waited for. */
void can_hear_answer(struct session *session, const struct frame *frame);

/* ---- session_collect.c ---- */

/* Takes a frame of a capture. */
DT_MUST_USE int can_collect(struct session *session, const struct frame *frame);
/* Moves the collection on: ask, wait, ask again, until complete or hopeless. */
DT_MUST_USE int can_drive_collection(struct session *session);
DT_MUST_USE int can_take_drop(struct session *session, struct record *record);
DT_MUST_USE int can_accept(struct session *session);

enum { CAN_RESEND_PATIENCE_MS = 60 }; /* without a resent block: ask again */

#endif
