/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/command.h"

enum { /* CiA 301 network management */
       NMT_START = 1,
       NMT_STOP = 2,
       NMT_PRE_OPERATIONAL = 128,
       NMT_RESET_NODE = 129,
       NMT_RESET_COMMUNICATION = 130,
       NODE = 1,
};

enum { /* CiA 301 expedited SDO, four bytes */
       SDO_READ = 0x40,
       SDO_WRITE = 0x23,
       SDO_VALUE = 0x43,
       SDO_WRITTEN = 0x60,
       SDO_ABORT = 0x80,
};

enum { CAPTURE_ASKED = 1 }; /* beside 0 and DT_E_* */

static void count(const struct command_scope *scope, enum wire_counter_number counter)
{
	scope->counters[counter]++;
}

/* What takes long is done before control is kept off: it is main's alone. */
static struct sequence_order prepare(const struct command_scope *scope, const struct wire_command *command)
{
	struct sequence_order order = {
	        .command = *command, .hosts = scope->hosts, .capture_crc32 = scope->capture->crc32};

	if (command->op != WIRE_OP_ARM || sequence_moving(scope->sequence->state))
		return order;
	sequence_plan(scope->sequence);
	order.parameters_crc32 = wire_parameters_crc32(scope->parameters->value);
	order.dropout_us = measure_dropout_us(scope->measure);
	order.nonce_good = port_random(&order.nonce) == 0;
	return order;
}

/* What the next answer has to name; again, if need be. */
static void challenge(const struct command_scope *scope, const struct wire_challenge *message)
{
	struct frame frame;

	wire_pack_challenge(&frame, WIRE_ID_CHALLENGE, message);
	stream_send(scope->stream, &frame);
}

/* The window of the drop before goes. */
static void armed(const struct command_scope *scope)
{
	*scope->set = *scope->parameters;
	capture_release(scope->capture);
}

static void operate(const struct command_scope *scope, const struct wire_command *command)
{
	const struct sequence *sequence = scope->sequence;
	struct sequence_order order = prepare(scope, command);
	struct sequence_view view;
	struct wire_challenge message;
	struct wire_reply reply = {.op = command->op, .sequence = command->sequence};
	struct frame frame;
	bool was_armed;
	int result;

	port_lock();
	view = health_look(scope->health, scope->input, 0, scope->acquire, /* no command asks for outputs */
	                   hosts_here(scope->hosts, sequence->session));
	was_armed = sequence->state == WIRE_STATE_ARMED;
	result = sequence_command(scope->sequence, &view, &order);
	reply.state = sequence->state;
	message.drop_id = reply.state == WIRE_STATE_ARMED ? sequence_next_drop(sequence) : 0;
	message.host = command->host;
	message.nonce = sequence->nonce;
	reply.checks = sequence_checks(sequence, view.checks);
	port_unlock();
	if (!was_armed && reply.state == WIRE_STATE_ARMED)
		armed(scope);
	if (result != 0)
		count(scope, WIRE_COUNTER_commands_refused);
	else if (command->op == WIRE_OP_ARM)
		challenge(scope, &message);
	reply.result = (int8_t)result;
	wire_pack_reply(&frame, WIRE_ID_REPLY, &reply);
	stream_send(scope->stream, &frame);
}

static void reset(const struct command_scope *scope)
{
	uint8_t state;

	port_lock();
	state = scope->sequence->state;
	port_unlock();
	if (sequence_moving(state) || sequence_captured(state)) /* the only copy of a drop */
		count(scope, WIRE_COUNTER_commands_refused);
	else
		port_reset();
}

static int handle_nmt(const struct command_scope *scope, const struct frame *frame)
{
	struct wire_nmt nmt;
	int result = wire_unpack_nmt(frame, &nmt);

	if (result != 0 || (nmt.node != NODE && nmt.node != 0))
		return result;
	switch (nmt.command) {
	case NMT_STOP:
		operate(scope, &(struct wire_command){.op = WIRE_OP_ABORT});
		return 0;
	case NMT_RESET_NODE:
	case NMT_RESET_COMMUNICATION:
		reset(scope);
		return 0;
	case NMT_START:
	case NMT_PRE_OPERATIONAL:
		return 0; /* the tower always talks */
	default:
		return DT_E_UNKNOWN;
	}
}

static int handle_command(const struct command_scope *scope, const struct frame *frame)
{
	struct wire_command command;
	int result = wire_unpack_command(frame, &command);

	if (result == 0)
		operate(scope, &command);
	return result;
}

static int handle_resend(const struct command_scope *scope, const struct frame *frame)
{
	struct wire_resend request;
	int result = wire_unpack_resend(frame, &request);

	if (result != 0)
		return result;
	if (request.sensor < 1 || request.sensor > WIRE_SENSORS)
		return DT_E_RANGE;
	if (request.count > 0)
		stream_request(scope->stream, scope->capture, &request);
	else if (scope->capture->phase == CAPTURE_COMPLETE)
		return CAPTURE_ASKED;
	else
		count(scope, WIRE_COUNTER_resends_out_of_range);
	return 0;
}

static bool bus_differs(const struct parameters *a, const struct parameters *b)
{
	return a->value[WIRE_PARAMETER_bus_mode] != b->value[WIRE_PARAMETER_bus_mode] ||
	       a->value[WIRE_PARAMETER_data_kbit_s] != b->value[WIRE_PARAMETER_data_kbit_s];
}

static uint32_t write_parameter(const struct command_scope *scope, uint16_t index, uint32_t value)
{
	struct sequence *sequence = scope->sequence;
	struct parameters before = *scope->parameters;
	uint32_t abort_code = PARAMETER_WRONG_STATE;

	port_lock();
	if (sequence->state == WIRE_STATE_SAFE || sequence->state == WIRE_STATE_READY ||
	    sequence->state == WIRE_STATE_FAULT_HELD) {
		abort_code = parameters_set(scope->parameters, index, value);
		sequence_replan(sequence);
	}
	port_unlock();
	if (scope->parameters->value[WIRE_PARAMETER_dropout_us] != before.value[WIRE_PARAMETER_dropout_us])
		measure_forget(scope->measure); /* calibrated anew; written again as it is it stays learned */
	if (!bus_differs(&before, scope->parameters) || stream_set_up(scope->stream, scope->parameters) == 0)
		return abort_code;
	port_lock();
	*scope->parameters = before;
	port_unlock();
	return PARAMETER_HARDWARE;
}

static int handle_sdo(const struct command_scope *scope, const struct frame *frame)
{
	struct wire_sdo sdo;
	struct frame answer;
	uint32_t abort_code;
	int result = wire_unpack_sdo(frame, &sdo);

	if (result != 0 || sdo.specifier == SDO_ABORT) /* the host's abort needs no answer */
		return result;
	if (sdo.specifier != SDO_READ && sdo.specifier != SDO_WRITE)
		abort_code = PARAMETER_BAD_SPECIFIER;
	else if (sdo.subindex != 0)
		abort_code = PARAMETER_NO_SUBINDEX;
	else if (sdo.specifier == SDO_READ)
		abort_code = parameters_get(scope->parameters, sdo.index, &sdo.value);
	else
		abort_code = write_parameter(scope, sdo.index, sdo.value);
	if (abort_code != 0) {
		sdo.specifier = SDO_ABORT;
		sdo.value = abort_code;
	} else if (sdo.specifier == SDO_WRITE) {
		sdo.specifier = SDO_WRITTEN;
		sdo.value = 0;
	} else {
		sdo.specifier = SDO_VALUE;
	}
	wire_pack_sdo(&answer, WIRE_ID_SDO_REPLY, &sdo);
	stream_send(scope->stream, &answer);
	return 0;
}

static int handle_heartbeat(const struct command_scope *scope, const struct frame *frame)
{
	struct wire_host_heartbeat heartbeat;
	int result = wire_unpack_host_heartbeat(frame, &heartbeat);

	if (result != 0)
		return result;
	if (heartbeat.session == 0)
		return DT_E_RANGE;
	port_lock();
	hosts_heard(scope->hosts, *scope->tick_ms, heartbeat.session,
	            heartbeat.wire_hash_low == (uint16_t)*scope->wire_hash);
	port_unlock();
	return 0;
}

static int dispatch(const struct command_scope *scope, const struct frame *frame)
{
	switch (frame->id) {
	case WIRE_ID_NMT:
		return handle_nmt(scope, frame);
	case WIRE_ID_COMMAND:
		return handle_command(scope, frame);
	case WIRE_ID_RESEND:
		return handle_resend(scope, frame);
	case WIRE_ID_SDO_REQUEST:
		return handle_sdo(scope, frame);
	case WIRE_ID_HEARTBEAT_HOST:
		return handle_heartbeat(scope, frame);
	default:
		count(scope, WIRE_COUNTER_frames_unknown);
		return 0;
	}
}

bool command_handle(const struct command_scope *scope, const struct frame *frame)
{
	int result = 0;

	count(scope, WIRE_COUNTER_frames_received);
	if (frame->flags & FRAME_EXTENDED)
		count(scope, WIRE_COUNTER_frames_unknown);
	else
		result = dispatch(scope, frame);
	if (result < 0)
		count(scope, WIRE_COUNTER_frames_malformed);
	return result == CAPTURE_ASKED;
}
