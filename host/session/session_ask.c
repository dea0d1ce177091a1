/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Commands and parameters: sent again until they are answered.
 */
#include "common/wire_table.h"
#include "host/session/session_can.h"

enum {
	REPLY_MS = 300, /* a reply takes a millisecond; then it or the command was lost */
	TRIES = 10,
	ROUNDS = 3, /* challenge and answer, when another's ARM comes between them or a second passes */
};

/* CiA 301, expedited transfer of four bytes: the first byte of a request and of its answer. */
enum { SDO_WRITE = 0x23, SDO_WRITTEN = 0x60, SDO_READ = 0x40, SDO_VALUE = 0x43, SDO_ABORT = 0x80 };

int can_send_op(struct session *session, enum wire_op op, uint32_t argument)
{
	struct can_way *way = session->way;
	struct wire_command command = {.op = (uint8_t)op,
	                               .sequence = way->sequence,
	                               .host = (uint16_t)session->view.session,
	                               .argument = argument};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	return can_way_send(session, &frame);
}

/* Another host on the bus may ask for the same. */
static bool session_ask_is_answer(const struct wire_sdo *answer, const struct wire_sdo *request)
{
	unsigned wanted = request->specifier == SDO_READ ? SDO_VALUE : SDO_WRITTEN;

	return answer->index == request->index &&
	       (answer->specifier == wanted || answer->specifier == SDO_ABORT);
}

/* To our ARM, or to another host's; or to the ARM before, late. */
static void hear_challenge(struct session *session, const struct wire_challenge *challenge)
{
	struct can_way *way = session->way;
	struct session_view *view = &session->view;
	bool armed = challenge->drop_id != 0;

	if (!way->challenge_awaited || challenge->host != (uint16_t)view->session || armed != way->answering)
		return;
	way->challenge_awaited = false;
	view->armed = armed;
	view->nonce = challenge->nonce;
	view->armed_drop_id = challenge->drop_id;
	view->release_from_ms = session_now_ms() + view->parameters[WIRE_PARAMETER_warning_ms];
}

void can_hear_answer(struct session *session, const struct frame *frame)
{
	struct can_way *way = session->way;
	struct wire_challenge challenge;
	struct wire_reply reply;
	struct wire_sdo sdo;

	if (frame->id == WIRE_ID_CHALLENGE && wire_unpack_challenge(frame, &challenge) == 0) {
		hear_challenge(session, &challenge);
	} else if (frame->id == WIRE_ID_REPLY && wire_unpack_reply(frame, &reply) == 0) {
		if (way->reply_awaited && reply.sequence == way->sequence) {
			way->reply = reply;
			way->reply_awaited = false;
		}
	} else if (frame->id == WIRE_ID_SDO_REPLY && wire_unpack_sdo(frame, &sdo) == 0) {
		if (way->sdo_awaited && session_ask_is_answer(&sdo, &way->sdo)) {
			way->sdo = sdo;
			way->sdo_awaited = false;
		}
	}
}

/* A command that was lost and sent again may be refused only because the first one worked. */
static bool worked(enum wire_op op, unsigned state)
{
	switch (op) {
	case WIRE_OP_ARM: /* repeated it is answered as the first time */
		return false;
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

static int send_stop(struct session *session)
{
	struct wire_nmt stop = {.command = 2, .node = 1};
	struct frame frame;

	wire_pack_nmt(&frame, WIRE_ID_NMT, &stop);
	return can_way_send(session, &frame);
}

/* Once: 0 when it was carried out, DT_E_TIMEOUT when the reply, or what goes before that of ARM, was lost. */
static int try_op(struct session *session, enum wire_op op, uint32_t argument)
{
	struct can_way *way = session->way;
	int result = op == WIRE_OP_ABORT ? send_stop(session) : 0; /* any tool's, besides ours with a reply */

	way->reply_awaited = true;
	if (result == 0)
		result = can_send_op(session, op, argument);
	if (result == 0)
		result = await(session, &way->reply_awaited, op == WIRE_OP_ABORT);
	if (result == 0)
		result = way->reply.result;
	return result == 0 && way->challenge_awaited ? DT_E_TIMEOUT : result;
}

static int ask_op(struct session *session, enum wire_op op, uint32_t argument)
{
	struct can_way *way = session->way;
	bool always = op == WIRE_OP_ABORT;
	int result = DT_E_TIMEOUT;

	way->sequence++;
	for (int attempt = 0;
	     attempt < TRIES && result == DT_E_TIMEOUT && (always || !session_cancelled(session));
	     attempt++) {
		result = try_op(session, op, argument);
		if (attempt > 0 && !way->reply_awaited && result == DT_E_STATE &&
		    worked(op, way->reply.state))
			result = 0;
	}
	way->reply_awaited = false;
	return result;
}

/* With nonce 0 asks for a challenge, else answers it; 0: the next one is in view. */
static int ask_arm(struct session *session, uint32_t nonce)
{
	struct can_way *way = session->way;
	struct session_view *view = &session->view;
	int result;

	way->challenge_awaited = true;
	way->answering = nonce != 0;
	result = ask_op(session, WIRE_OP_ARM,
	                wire_answer(nonce, view->session, wire_parameters_crc32(view->parameters)));
	way->challenge_awaited = false;
	return result;
}

/* That an answer came too late, or after another's ARM, looks as if the parameters were not the tower's.
 * Whether they are says the next challenge, which is asked for with them. */
static int session_ask_arm(struct session *session)
{
	struct session_view *view = &session->view;
	int result = view->parameters_known ? 0 : session_read_parameters(session);

	if (result != 0)
		return result;
	view->armed = false;
	for (unsigned round = 0; round < ROUNDS; round++) {
		result = ask_arm(session, 0);
		if (result != 0)
			return result;
		view->armed_until_ms = session_now_ms() + view->parameters[WIRE_PARAMETER_arm_timeout_ms];
		result = ask_arm(session, view->nonce);
		if (result != DT_E_PARAMETERS)
			return result;
	}
	return result;
}

static int session_ask_release(struct session *session)
{
	struct session_view *view = &session->view;
	int result = DT_E_TOKEN;

	if (view->armed)
		result = ask_op(session, WIRE_OP_RELEASE,
		                wire_answer(view->nonce, view->armed_drop_id,
		                            wire_parameters_crc32(view->parameters)));
	if (result == 0)
		view->armed = false;
	return result;
}

int can_command(struct session *session, enum wire_op op)
{
	switch (op) {
	case WIRE_OP_ARM:
		return session_ask_arm(session);
	case WIRE_OP_RELEASE:
		return session_ask_release(session);
	case WIRE_OP_ABORT: /* before a state says so: nothing is released after it */
		session->view.armed = false;
		return ask_op(session, op, 0);
	case WIRE_OP_CLEAR:
		return ask_op(session, op, 0);
	case WIRE_OP_ACCEPT:
	case WIRE_OP_DISCARD:
		break; /* the collection's */
	}
	return DT_E_ARGUMENT;
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
		result = can_way_send(session, &frame);
		if (result == 0)
			result = await(session, &way->sdo_awaited, false);
	}
	way->sdo_awaited = false;
	return result;
}

int can_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	const struct can_way *way = session->way;
	struct wire_sdo write = {
	        .specifier = SDO_WRITE, .index = wire_parameters[number].index, .value = value};
	int result = ask_sdo(session, &write);

	if (result == 0 && way->sdo.specifier != SDO_WRITTEN)
		result = way->sdo.value == 0x08000022u ? DT_E_STATE : DT_E_RANGE; /* CiA 301 abort codes */
	return result;
}

int can_get_parameter(struct session *session, enum wire_parameter_number number, uint32_t *value)
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
