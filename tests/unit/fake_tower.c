/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/fake_tower.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "common/wire_table.h"
#include "host/session/session.h"

enum { BEAT_MS = 20 };

struct fake_tower fake_tower = {.lock = PTHREAD_MUTEX_INITIALIZER};

static void send(struct frame frame)
{
	if (link_send(fake_tower.link, &frame) != 0)
		return; /* nobody is there: the test waits in vain and says so */
}

static void send_status(void)
{
	struct frame frame;

	wire_pack_status(&frame, WIRE_ID_STATUS,
	                 &(struct wire_status){.state = fake_tower.state, .fault = fake_tower.fault});
	send(frame);
	wire_pack_heartbeat(
	        &frame, WIRE_ID_HEARTBEAT_TOWER,
	        &(struct wire_heartbeat){.nmt_state = fake_tower.boots ? 0 : 5, .wire_hash = wire_hash()});
	fake_tower.boots = false;
	send(frame);
}

static void send_capture_end(void)
{
	struct frame frame;

	hand_capture_end(&fake_tower.drop, &frame);
	send(frame);
	for (unsigned i = 0; i <= HAND_PARAMETERS; i++) {
		hand_told(&fake_tower.drop, i, &frame);
		send(frame);
	}
	atomic_fetch_add(&fake_tower.ends, 1);
}

static void fall(void)
{
	struct frame frame;

	fake_tower.fall_due = false;
	fake_tower.drop.drop_id++;
	fake_tower.drop.first_tick_ms += 3000;
	for (uint32_t i = 0; i < fake_tower.drop.ticks; i++)
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (sensor == 2 && i - 50 < fake_tower.hole)
				continue;
			hand_block(&fake_tower.drop, sensor, i, false, &frame);
			send(frame);
		}
	fake_tower.state = WIRE_STATE_CAPTURED;
	fake_tower.captured = true;
}

void fake_tower_fall_unseen(void)
{
	fake_tower.state = WIRE_STATE_CAPTURED;
	fake_tower.captured = true;
}

static void send_challenge(uint16_t host)
{
	bool armed = fake_tower.state == WIRE_STATE_ARMED;
	struct wire_challenge challenge = {.drop_id = (uint16_t)(armed ? fake_tower.drop.drop_id + 1 : 0),
	                                   .host = host,
	                                   .nonce = fake_tower.nonce};
	struct frame frame;

	wire_pack_challenge(&frame, WIRE_ID_CHALLENGE, &challenge);
	send(frame);
}

/* The first ARM asks, the second answers; the third of the same is the second again. */
static int be_armed(const struct wire_command *command)
{
	uint32_t set = wire_parameters_crc32(fake_tower.values.value);
	bool asks = command->argument == wire_answer(0, fake_tower.session, set);

	if (fake_tower.refusal != 0)
		return fake_tower.refusal;
	if (fake_tower.state != WIRE_STATE_ARMED && !asks &&
	    command->argument != wire_answer(fake_tower.nonce, fake_tower.session, set))
		return DT_E_PARAMETERS;
	if (fake_tower.state != WIRE_STATE_ARMED)
		fake_tower.nonce += 0x9E3779B9u;
	if (!asks)
		fake_tower.state = WIRE_STATE_ARMED;
	send_challenge(command->host);
	return 0;
}

static int obey(const struct wire_command *command)
{
	switch (command->op) {
	case WIRE_OP_ARM:
		return be_armed(command);
	case WIRE_OP_RELEASE:
		if (command->argument != wire_answer(fake_tower.nonce,
		                                     (uint16_t)(fake_tower.drop.drop_id + 1),
		                                     wire_parameters_crc32(fake_tower.values.value)))
			return DT_E_TOKEN;
		fake_tower.state = WIRE_STATE_FALLING;
		if (fake_tower.falls)
			fall();
		return 0;
	case WIRE_OP_ABORT:
		if (fake_tower.state == WIRE_STATE_FALLING)
			fall();
		else if (!fake_tower.captured)
			fake_tower.state = WIRE_STATE_READY;
		return 0;
	case WIRE_OP_ACCEPT:
		if (command->argument != hand_drop_crc32(&fake_tower.drop))
			return DT_E_CORRUPT;
		fake_tower.captured = false;
		fake_tower.fault = WIRE_FAULT_NONE;
		fake_tower.state = WIRE_STATE_READY;
		return 0;
	default:
		return DT_E_STATE;
	}
}

static void hear_command(const struct frame *frame)
{
	struct wire_command command;
	struct wire_reply reply;
	struct frame answer;

	if (wire_unpack_command(frame, &command) != 0)
		return;
	if (fake_tower.heard_count < FAKE_TOWER_HEARD_MAX)
		fake_tower.heard[fake_tower.heard_count++] = command.op;
	if ((fake_tower.deaf >> command.op & 1u) != 0)
		return;
	reply = (struct wire_reply){.op = command.op, .sequence = command.sequence};
	reply.result = (int8_t)obey(&command);
	reply.state = fake_tower.state;
	wire_pack_reply(&answer, WIRE_ID_REPLY, &reply);
	send(answer);
}

static void hear_resend(const struct frame *frame)
{
	struct wire_resend resend;
	struct frame block;

	if (wire_unpack_resend(frame, &resend) != 0)
		return;
	fake_tower.resends++;
	for (uint32_t i = 0; i < resend.count; i++) {
		uint32_t tick = resend.first_tick_ms - fake_tower.drop.first_tick_ms + i;

		if (tick >= fake_tower.drop.ticks)
			continue; /* of the drop before */
		hand_block(&fake_tower.drop, resend.sensor, tick, true, &block);
		send(block);
	}
}

static void hear_parameter(const struct frame *frame)
{
	struct wire_sdo sdo;
	struct frame answer;

	if (wire_unpack_sdo(frame, &sdo) != 0)
		return;
	if (sdo.specifier == 0x40) {
		sdo.specifier = parameters_get(&fake_tower.values, sdo.index, &sdo.value) == 0 ? 0x43 : 0x80;
		wire_pack_sdo(&answer, WIRE_ID_SDO_REPLY, &sdo);
		send(answer);
		return;
	}
	fake_tower.parameters++;
	sdo.specifier = 0x60;
	if (parameters_set(&fake_tower.values, sdo.index, sdo.value) != 0) {
		sdo.specifier = 0x80;
		sdo.value = PARAMETER_INCOMPATIBLE;
	}
	wire_pack_sdo(&answer, WIRE_ID_SDO_REPLY, &sdo);
	send(answer);
}

static void hear_heartbeat(const struct frame *frame)
{
	struct wire_host_heartbeat heartbeat;

	if (wire_unpack_host_heartbeat(frame, &heartbeat) == 0)
		fake_tower.session = heartbeat.session;
}

static void beat(void)
{
	if (fake_tower.dumb)
		return;
	if (fake_tower.fall_due)
		fall();
	send_status();
	if (fake_tower.captured)
		send_capture_end();
}

static void *play(void *unused)
{
	int64_t due_ms = 0;

	(void)unused;
	pthread_mutex_lock(&fake_tower.lock);
	while (!fake_tower.stop) {
		struct frame frame;
		int got;

		pthread_mutex_unlock(&fake_tower.lock);
		got = link_receive(fake_tower.link, &frame, 2);
		pthread_mutex_lock(&fake_tower.lock);
		if (got == 1 && frame.id == WIRE_ID_COMMAND)
			hear_command(&frame);
		else if (got == 1 && frame.id == WIRE_ID_RESEND)
			hear_resend(&frame);
		else if (got == 1 && frame.id == WIRE_ID_HEARTBEAT_HOST)
			hear_heartbeat(&frame);
		else if (got == 1 && frame.id == WIRE_ID_SDO_REQUEST)
			hear_parameter(&frame);
		if (session_now_ms() >= due_ms) {
			due_ms = session_now_ms() + BEAT_MS;
			beat();
		}
	}
	pthread_mutex_unlock(&fake_tower.lock);
	return NULL;
}

void fake_tower_join(const char *url)
{
	char message[SESSION_MESSAGE_MAX];

	fake_tower.stop = false;
	fake_tower.link = link_open(url, LINK_READ_WRITE, message, sizeof(message));
	assert_non_null(fake_tower.link);
	assert_int_equal(pthread_create(&fake_tower.thread, NULL, play, NULL), 0);
}

void fake_tower_leave(void)
{
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.stop = true;
	pthread_mutex_unlock(&fake_tower.lock);
	pthread_join(fake_tower.thread, NULL);
	(void)link_close(fake_tower.link);
}

void fake_tower_reset(void)
{
	fake_tower.dumb = fake_tower.captured = false;
	fake_tower.deaf = fake_tower.hole = fake_tower.heard_count = fake_tower.parameters =
	        fake_tower.resends = 0;
	fake_tower.refusal = 0;
	parameters_init(&fake_tower.values);
	fake_tower.falls = true;
	fake_tower.fault = WIRE_FAULT_NONE;
	fake_tower.state = WIRE_STATE_READY;
	hand_fill(&fake_tower.drop, 5000, 500, 0xD401);
}

unsigned fake_tower_heard(unsigned op)
{
	unsigned found = 0;

	pthread_mutex_lock(&fake_tower.lock);
	for (unsigned i = 0; i < fake_tower.heard_count; i++)
		found += fake_tower.heard[i] == op;
	pthread_mutex_unlock(&fake_tower.lock);
	return found;
}

void fake_tower_behave(unsigned deaf, int8_t refusal, bool falls)
{
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.deaf = deaf;
	fake_tower.refusal = refusal;
	fake_tower.falls = falls;
	pthread_mutex_unlock(&fake_tower.lock);
}
