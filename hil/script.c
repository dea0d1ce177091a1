/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/script.h"

#include <stdio.h>

#include "common/wire_table.h"

enum {
	HEARTBEAT_MS = 100,
	REPEAT_MS = 200, /* a command without effect is sent again */
	SETTLE_MS = 20,  /* frames still on their way when the capture end comes */
	RESEND_MS =
	        50, /* between two rounds of requests, and the time the firmware takes for the first ... */
	RESEND_PER_MS = 2, /* ... at this rate */
	RESEND_RUNS = 8,   /* requests in a round */
	RESEND_TICKS = 64, /* ticks in a request */
	GIVE_UP_MS = 3000, /* so long without a missing block coming */
	NMT_OPERATIONAL = 5,
	NMT_BOOT_UP = 0,
	SDO_WRITE = 0x23,
	SDO_WRITTEN = 0x60,
	GUARDS = WIRE_CHECK_ESTOP | WIRE_CHECK_DOOR | WIRE_CHECK_LATCH | WIRE_CHECK_PRODUCT,
};
_Static_assert(WIRE_PARAMETERS < 32, "has_value has a bit for each");

static void script_enter(struct script *script, enum script_phase phase, uint32_t send_ms)
{
	script->phase = phase;
	script->send_ms = send_ms;
}

static enum script_phase first_phase(const struct script *script)
{
	if (script->parameters_done < script->options.parameter_count)
		return SCRIPT_SET;
	return script->drops_done < script->options.drops ? SCRIPT_ARM : SCRIPT_DONE;
}

static void set_initial(struct script *script)
{
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		script->value[i] = wire_parameters[i].initial;
}

void script_init(struct script *script, const struct script_options *options)
{
	*script = (struct script){.options = *options};
	set_initial(script);
	script->phase = first_phase(script);
}

static bool script_due(uint32_t time_ms, uint32_t now_ms)
{
	return (int32_t)(now_ms - time_ms) >= 0;
}

/* ---- what the tower says ---- */

static bool in_capture(const struct script *script, uint32_t tick_ms)
{
	return tick_ms - script->capture.first_tick_ms <=
	       script->capture.last_tick_ms - script->capture.first_tick_ms;
}

static void script_feed_block(struct script *script, unsigned sensor, const struct frame *frame,
                              uint32_t now_ms)
{
	struct wire_block block;
	uint32_t *slot;

	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return;
	/* Once the window is known, later live blocks must not push its blocks out. */
	if (script->captured && !in_capture(script, block.tick_ms))
		return;
	slot = &script->held[sensor][block.tick_ms % SCRIPT_TICKS];
	if (*slot != block.tick_ms + 1)
		script->progress_ms = now_ms;
	*slot = block.tick_ms + 1;
}

static void feed_capture(struct script *script, const struct frame *frame, uint32_t now_ms)
{
	struct wire_capture_end end;

	if (wire_check_capture_end(frame) != 0 || wire_unpack_capture_end(frame, &end) != 0 ||
	    script->phase != SCRIPT_FETCH || script->captured ||
	    (end.drop_id == script->capture.drop_id && end.first_tick_ms == script->capture.first_tick_ms &&
	     end.crc32 == script->capture.crc32)) /* after a restart the tower's numbers begin anew */
		return;
	script->capture = end;
	script->captured = true;
	script->has_measured = false;
	script->has_value = 0;
	script->progress_ms = now_ms;
	script->send_ms = now_ms + SETTLE_MS;
	script->resend_at = 0;
}

static void script_feed_measured(struct script *script, const struct frame *frame, uint32_t now_ms)
{
	struct wire_measured measured;

	if (!script->captured || script->has_measured || wire_check_measured(frame) != 0 ||
	    wire_unpack_measured(frame, &measured) != 0 || measured.drop_id != script->capture.drop_id)
		return;
	script->has_measured = true;
	script->progress_ms = now_ms;
}

/* Index in wire_parameters, WIRE_PARAMETERS: none. */
static unsigned find_parameter(uint16_t index)
{
	unsigned i = 0;

	while (i < WIRE_PARAMETERS && wire_parameters[i].index != index)
		i++;
	return i;
}

/* The set a capture was made with; its CRC-32 in the capture end is compared by who observes. */
static void script_feed_parameter(struct script *script, const struct frame *frame, uint32_t now_ms)
{
	struct wire_parameter parameter;
	unsigned i;

	if (!script->captured || wire_unpack_parameter(frame, &parameter) != 0 ||
	    parameter.drop_id != script->capture.drop_id)
		return;
	i = find_parameter(parameter.index);
	if (i == WIRE_PARAMETERS || script->has_value >> i & 1)
		return;
	script->has_value |= 1u << i;
	script->progress_ms = now_ms;
}

static void feed_challenge(struct script *script, const struct frame *frame, uint32_t now_ms)
{
	const struct wire_challenge *challenge = &script->challenge;

	if (wire_unpack_challenge(frame, &script->challenge) != 0)
		return;
	script->has_armed = challenge->host == (SCRIPT_SESSION & UINT16_MAX) && challenge->drop_id != 0;
	if (script->has_armed)
		script->status.state = WIRE_STATE_ARMED; /* the reply may be lost */
	else if (script->phase == SCRIPT_ARM && challenge->host == (SCRIPT_SESSION & UINT16_MAX))
		script->send_ms = now_ms; /* answered at once */
}

/* A tower that starts anew has forgotten what was written. */
static void script_feed_heartbeat(struct script *script, const struct frame *frame)
{
	struct wire_heartbeat heartbeat;

	if (wire_unpack_heartbeat(frame, &heartbeat) == 0 && heartbeat.nmt_state == NMT_BOOT_UP)
		set_initial(script);
}

static void feed_reply(struct script *script, const struct frame *frame)
{
	struct wire_reply reply;

	if (wire_unpack_reply(frame, &reply) != 0)
		return;
	script->status.state = reply.state;
	script->status.checks = reply.checks;
	if (reply.op == WIRE_OP_ARM && reply.result != 0 && reply.state != WIRE_STATE_ARMED)
		script->challenge = (struct wire_challenge){.nonce = 0}; /* it is used up */
}

/* Written or refused: who looks at the bus sees which. */
static void feed_sdo(struct script *script, const struct frame *frame, uint32_t now_ms)
{
	struct wire_sdo sdo;

	unsigned i;

	if (script->phase != SCRIPT_SET || wire_unpack_sdo(frame, &sdo) != 0 ||
	    sdo.index != script->options.parameters[script->parameters_done].index)
		return;
	i = find_parameter(sdo.index);
	if (sdo.specifier == SDO_WRITTEN && i < WIRE_PARAMETERS)
		script->value[i] = script->options.parameters[script->parameters_done].value;
	script->parameters_done++;
	script_enter(script, first_phase(script), now_ms);
}

void script_feed(struct script *script, const struct frame *part, uint32_t now_ms)
{
	const struct frame *frame = segment_feed(&script->segments, part);

	if (frame != part) {
		script->classic = true;
		script->segment_ms = now_ms;
	}
	if (frame == NULL)
		return;
	switch (frame->id) {
	case WIRE_ID_BLOCK_S1:
	case WIRE_ID_RESENT_S1:
		script_feed_block(script, 0, frame, now_ms);
		break;
	case WIRE_ID_BLOCK_S2:
	case WIRE_ID_RESENT_S2:
		script_feed_block(script, 1, frame, now_ms);
		break;
	case WIRE_ID_CAPTURE_END:
		feed_capture(script, frame, now_ms);
		break;
	case WIRE_ID_STATUS:
		if (wire_unpack_status(frame, &script->status) != 0)
			return; /* of another wire: the hash in the heartbeat tells */
		break;
	case WIRE_ID_MEASURED:
		script_feed_measured(script, frame, now_ms);
		break;
	case WIRE_ID_PARAMETER:
		script_feed_parameter(script, frame, now_ms);
		break;
	case WIRE_ID_CHALLENGE:
		feed_challenge(script, frame, now_ms);
		break;
	case WIRE_ID_HEARTBEAT_TOWER:
		script_feed_heartbeat(script, frame);
		break;
	case WIRE_ID_REPLY:
		feed_reply(script, frame);
		break;
	case WIRE_ID_SDO_REPLY:
		feed_sdo(script, frame, now_ms);
		break;
	default:
		break;
	}
}

/* ---- what the operator does ---- */

static void script_fail(struct script *script, const char *what)
{
	char checks[160] = "";

	for (unsigned i = 0, used = 0; i < WIRE_CHECKS && used < sizeof(checks) - 16; i++)
		if (script->status.checks & 1u << i)
			used += (unsigned)snprintf(checks + used, sizeof(checks) - used, " %s",
			                           wire_check_name(i));
	snprintf(script->why, sizeof(script->why), "drop %u: %s in state %s, fault %s, checks not green:%s",
	         script->drops_done + 1, what, wire_state_name(script->status.state),
	         wire_fault_name(script->status.fault), checks[0] ? checks : " none");
	script->phase = SCRIPT_FAILED;
}

void script_verb(const struct script *script, uint32_t session, struct wire_command *message)
{
	const struct wire_challenge *challenge = &script->challenge;
	uint32_t parameters = wire_parameters_crc32(script->value);

	message->host = (uint16_t)session;
	switch (message->op) {
	case WIRE_OP_ARM:
		message->argument =
		        wire_answer(challenge->drop_id == 0 ? challenge->nonce : 0, session, parameters);
		break;
	case WIRE_OP_RELEASE:
		message->argument = wire_answer(challenge->nonce, challenge->drop_id, parameters);
		break;
	case WIRE_OP_ACCEPT:
		message->argument = script->capture.crc32;
		break;
	case WIRE_OP_DISCARD:
		message->argument = script->capture.drop_id;
		break;
	default:
		message->argument = 0;
	}
}

static unsigned command(struct script *script, uint8_t op, uint32_t now_ms, struct frame *out)
{
	struct wire_command message = {.op = op, .sequence = script->sequence++};

	script_verb(script, SCRIPT_SESSION, &message);
	wire_pack_command(out, WIRE_ID_COMMAND, &message);
	script->send_ms = now_ms + REPEAT_MS;
	return 1;
}

/* The capture's blocks are numbered: those of S1 by tick, then those of S2. */
static uint32_t capture_ticks(const struct script *script)
{
	return script->capture.last_tick_ms - script->capture.first_tick_ms + 1;
}

static bool script_missing(const struct script *script, uint32_t block)
{
	uint32_t ticks = capture_ticks(script);
	uint32_t tick_ms = script->capture.first_tick_ms + block % ticks;

	return script->held[block / ticks][tick_ms % SCRIPT_TICKS] != tick_ms + 1;
}

static unsigned count_missing(const struct script *script)
{
	unsigned count = 0;

	for (uint32_t block = 0; block < WIRE_SENSORS * capture_ticks(script); block++)
		count += script_missing(script, block);
	return count;
}

/* One round goes on where the one before ended, so that all runs get their turn. */
static unsigned request_missing(struct script *script, uint32_t now_ms, struct frame *out)
{
	uint32_t ticks = capture_ticks(script), block = script->resend_at, asked = 0;
	unsigned count = 0;

	while (block < WIRE_SENSORS * ticks && count < RESEND_RUNS) {
		uint32_t sensor = block / ticks, first = block;

		while (block < (sensor + 1) * ticks && block - first < RESEND_TICKS &&
		       script_missing(script, block))
			block++;
		if (block == first) {
			block++;
			continue;
		}
		asked += block - first;
		wire_pack_resend(&out[count++], WIRE_ID_RESEND,
		                 &(struct wire_resend){.sensor = (uint8_t)(sensor + 1),
		                                       .count = (uint16_t)(block - first),
		                                       .first_tick_ms = script->capture.first_tick_ms +
		                                                        first % ticks});
	}
	script->resend_at = block < WIRE_SENSORS * ticks ? block : 0;
	script->send_ms = now_ms + RESEND_MS + asked / RESEND_PER_MS;
	return count;
}

static unsigned do_set(struct script *script, uint32_t now_ms, struct frame *out)
{
	const struct scenario_parameter *parameter = &script->options.parameters[script->parameters_done];
	unsigned state = script->status.state;

	if ((state != WIRE_STATE_SAFE && state != WIRE_STATE_READY) || !script_due(script->send_ms, now_ms))
		return 0;
	wire_pack_sdo(out, WIRE_ID_SDO_REQUEST,
	              &(struct wire_sdo){SDO_WRITE, parameter->index, 0, parameter->value});
	script->send_ms = now_ms + REPEAT_MS;
	return 1;
}

/* Armed without the tower's challenge, which was lost: the same ARM once more brings the same again. */
static unsigned do_arm(struct script *script, uint32_t now_ms, struct frame *out)
{
	bool armed = script->status.state == WIRE_STATE_ARMED;

	if (armed && script->has_armed) {
		script_enter(script, SCRIPT_RELEASE, now_ms + script->options.release_ms);
		return 0;
	}
	if ((!armed && script->status.state != WIRE_STATE_READY) || !script_due(script->send_ms, now_ms))
		return 0;
	script->has_armed = false;
	return command(script, WIRE_OP_ARM, now_ms, out);
}

static unsigned do_release(struct script *script, uint32_t now_ms, struct frame *out)
{
	unsigned state = script->status.state;

	if (state == WIRE_STATE_SAFE || state == WIRE_STATE_READY) { /* disarmed */
		script->has_armed = false;
		script_enter(script, SCRIPT_ARM, now_ms);
		return 0;
	}
	if (state != WIRE_STATE_ARMED) {
		script_enter(script, SCRIPT_FETCH, now_ms);
		return 0;
	}
	return script_due(script->send_ms, now_ms) ? command(script, WIRE_OP_RELEASE, now_ms, out) : 0;
}

/* What was measured and the parameters come behind the capture end, and again with it. */
static bool tail_missing(const struct script *script)
{
	return !script->has_measured || script->has_value != (UINT32_C(1) << WIRE_PARAMETERS) - 1;
}

static unsigned request_end(struct script *script, uint32_t now_ms, struct frame *out)
{
	script->send_ms = now_ms + REPEAT_MS;
	wire_pack_resend(out, WIRE_ID_RESEND, &(struct wire_resend){.sensor = 1});
	return 1;
}

static unsigned do_fetch(struct script *script, uint32_t now_ms, struct frame *out)
{
	unsigned state = script->status.state;
	bool patient;
	unsigned lacking;

	if (!script_due(script->send_ms, now_ms))
		return 0;
	if (script->classic && !script_due(script->segment_ms + SETTLE_MS, now_ms))
		return 0; /* the upload goes on */
	if (!script->captured) {
		script->send_ms = now_ms + REPEAT_MS;
		if (state != WIRE_STATE_CAPTURED && state != WIRE_STATE_KEEP_OUT)
			return 0;
		return request_end(script, now_ms, out); /* it was lost */
	}
	if (capture_ticks(script) > SCRIPT_TICKS) {
		script_fail(script, "capture longer than the script remembers");
		return 0;
	}
	lacking = count_missing(script);
	patient = !script_due(script->progress_ms + GIVE_UP_MS, now_ms);
	if (lacking > 0 && patient)
		return request_missing(script, now_ms, out);
	if (tail_missing(script) && patient)
		return request_end(script, now_ms, out);
	if (lacking > 0) {
		snprintf(script->why, sizeof(script->why), "drop %u: discarded with %u blocks missing",
		         script->drops_done + 1, lacking);
		script->incomplete++;
	}
	script->accept_op = lacking > 0 ? WIRE_OP_DISCARD : WIRE_OP_ACCEPT;
	script_enter(script, SCRIPT_ACCEPT, now_ms);
	return 0;
}

static unsigned do_accept(struct script *script, uint32_t now_ms, struct frame *out)
{
	unsigned state = script->status.state;

	if (state == WIRE_STATE_UPLOADED || state == WIRE_STATE_SAFE || state == WIRE_STATE_READY ||
	    state == WIRE_STATE_FAULT_HELD) {
		script_enter(script, SCRIPT_RETURN, now_ms);
		return 0;
	}
	if (state != WIRE_STATE_CAPTURED || !script_due(script->send_ms, now_ms))
		return 0;
	return command(script, script->accept_op, now_ms, out);
}

static unsigned do_return(struct script *script, uint32_t now_ms, struct frame *out)
{
	unsigned state = script->status.state;

	if (state == WIRE_STATE_FAULT_HELD) /* the fault was in motion, the drop is uploaded */
		return script_due(script->send_ms, now_ms) ? command(script, WIRE_OP_CLEAR, now_ms, out) : 0;
	if (state != WIRE_STATE_SAFE && state != WIRE_STATE_READY)
		return 0;
	script->drops_done++;
	script->captured = false;
	script->drop_ms = now_ms;
	script_enter(script, first_phase(script), now_ms);
	return 0;
}

static unsigned do_phase(struct script *script, uint32_t now_ms, struct frame *out)
{
	switch (script->phase) {
	case SCRIPT_SET:
		return do_set(script, now_ms, out);
	case SCRIPT_ARM:
		return do_arm(script, now_ms, out);
	case SCRIPT_RELEASE:
		return do_release(script, now_ms, out);
	case SCRIPT_FETCH:
		return do_fetch(script, now_ms, out);
	case SCRIPT_ACCEPT:
		return do_accept(script, now_ms, out);
	case SCRIPT_RETURN:
		return do_return(script, now_ms, out);
	case SCRIPT_DONE:
	case SCRIPT_FAILED:
		return 0;
	}
	return 0;
}

/* A fault at rest before the drop, or a tower that knows nothing of the drop any more. */
static bool drop_is_off(const struct script *script)
{
	unsigned state = script->status.state;

	if (script->phase == SCRIPT_FETCH && !script->captured)
		return state == WIRE_STATE_FAULT_HELD || state == WIRE_STATE_SAFE ||
		       state == WIRE_STATE_READY;
	return state == WIRE_STATE_FAULT_HELD && script->phase < SCRIPT_ACCEPT;
}

static void script_stopped(struct script *script, uint32_t now_ms)
{
	if (!script->options.patient)
		script_fail(script, "stopped");
	else if (script->phase != SCRIPT_SET && script->phase != SCRIPT_ARM)
		script_enter(script, SCRIPT_ARM, now_ms);
}

/* The technician has looked: guards that were open are closed again. */
static unsigned script_acknowledge(struct script *script, uint32_t now_ms, struct frame *out)
{
	struct wire_command message = {.op = WIRE_OP_CLEAR, .sequence = script->sequence};
	uint32_t checks = script->status.checks;
	bool waiting = script->status.state == WIRE_STATE_SAFE && checks & WIRE_CHECK_ACKNOWLEDGE &&
	               !(checks & GUARDS);

	if (!waiting || script->options.passive || !script_due(script->clear_ms, now_ms))
		return 0;
	script->clear_ms = now_ms + REPEAT_MS;
	script->sequence++;
	script_verb(script, SCRIPT_SESSION, &message);
	wire_pack_command(out, WIRE_ID_COMMAND, &message);
	return 1;
}

void script_heartbeat(struct frame *frame, uint32_t session, uint32_t hash)
{
	wire_pack_host_heartbeat(frame, WIRE_ID_HEARTBEAT_HOST,
	                         &(struct wire_host_heartbeat){NMT_OPERATIONAL, session, (uint16_t)hash});
}

unsigned script_poll(struct script *script, uint32_t now_ms, struct frame out[SCRIPT_SEND_MAX])
{
	unsigned count = 0;

	if (script_due(script->heartbeat_ms, now_ms)) {
		script->heartbeat_ms = now_ms + HEARTBEAT_MS;
		script_heartbeat(&out[count++], SCRIPT_SESSION, wire_hash() ^ script->options.wrong_hash);
	}
	if (script->phase == SCRIPT_ARM || script->phase == SCRIPT_DONE)
		count += script_acknowledge(script, now_ms, out + count);
	if (script->phase == SCRIPT_DONE || script->phase == SCRIPT_FAILED)
		return count;
	if (drop_is_off(script))
		script_stopped(script, now_ms);
	else if (!script->options.patient && script_due(script->drop_ms + SCRIPT_LIMIT_MS, now_ms))
		script_fail(script, "not done in time");
	return count + do_phase(script, now_ms, out + count);
}
