/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the tower promises, over a million random milliseconds: a world that falls, jams, bounces and lies, an
 * operator who knows every key and says the right thing at the wrong time, resets of every cause, and
 * interrupts wherever main may be interrupted. The judge keeps its own account of inputs, commands and
 * outputs; of the firmware it looks at the state alone, which is why app.c is included here.
 */
#include "firmware/app.c"

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdio.h>

#include "common/wire_table.h"
#include "tests/unit/fake_port.h"

#define STATE(NAME) WIRE_STATE_##NAME
#define BIT(state) (1u << (state))

enum {
	STEPS = 2000000,
	SEED = 20261123,
	SESSION = 0x7357C0DE,
	GUARDS = WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD | WIRE_IO_DOOR_CLOSED | WIRE_IO_ESTOP_CLEAR,
	NEEDED = GUARDS | WIRE_IO_DAMPERS_ENGAGED | WIRE_IO_SUPPLY_GOOD | WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2,
	AT_REST = WIRE_IO_LATCH_CLOSED | WIRE_IO_FRAME_DOWN,
	/* of the shipped parameters, us: 7/8 of the free fall to the gates, free fall to the dampers */
	UPPER_FIRST_US = 176686,
	LOWER_FIRST_US = 330549,
	RELIEF_US = 403855,
};

static uint32_t seed;

static bool one_in(uint32_t n)
{
	return fake_random(&seed) / 7 % n == 0;
}

static uint32_t up_to(uint32_t n)
{
	return fake_random(&seed) / 7 % (n + 1);
}

/* ---- the world ---- */

static struct {
	uint32_t ms;
	unsigned quarter; /* of the millisecond, to come next */
	bool control_wanted, in_control;
	uint32_t opened_us; /* the frame fell from then on; 0 it did not */
	uint32_t ordered_us, gate_us[2], down_us, keeper_us, hit_ms;
	bool latch_ordered, magnet_was_on;
	uint16_t wrong; /* inputs that lie ... */
	uint32_t wrong_until_ms;
	uint16_t inputs;
} world;

/* ---- the judge ---- */

static struct {
	uint32_t step;
	uint16_t agreed, before[2];
	unsigned readings;
	uint32_t red_ms; /* the last millisecond with an input that is not good */
	bool acknowledged;
	uint8_t state;
	uint16_t outputs;
	uint32_t warned_us, released_us, moving_ms, gate_us[2];
	bool released, gates[2];
	uint32_t nonce, set;
	uint16_t drop_id;
	bool asked, right_release; /* a RELEASE is under way, and it is the right one */
	bool right_arm; /* the last ARM answered a challenge that had been asked for, or one that waits before
	                   it */
	unsigned visited[WIRE_STATES], opened, let_go, ready, refused_early, resets_in_motion, kept_out;
} judge;

static void complain(const char *what)
{
	fail_msg("%s: seed %u step %u state %s fault %s outputs %#x inputs %#x", what, SEED, judge.step,
	         wire_state_name(app.sequence.state), wire_fault_name(app.sequence.fault), fake.outputs,
	         fake.inputs);
}

static bool moving(unsigned state)
{
	return BIT(state) & (BIT(STATE(FALLING)) | BIT(STATE(SEPARATED)) | BIT(STATE(BRAKED)) |
	                     BIT(STATE(FAULT_MOVING)) | BIT(STATE(KEEP_OUT)));
}

/* As the tick will read them. */
static void judge_inputs(void)
{
	uint16_t all = fake.inputs & judge.before[0] & judge.before[1];
	uint16_t any = fake.inputs | judge.before[0] | judge.before[1];
	uint16_t bad;

	judge.before[1] = judge.before[0];
	judge.before[0] = fake.inputs;
	if (++judge.readings >= 3)
		judge.agreed = (uint16_t)((judge.agreed | all) & any);
	bad = (uint16_t)((~judge.agreed & NEEDED) |
	                 (judge.agreed & (WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER | WIRE_IO_FRAME_DOWN)));
	if (bad)
		judge.red_ms = world.ms;
	if ((bad & (GUARDS | WIRE_IO_FRAME_DOWN)) && !moving(app.sequence.state))
		judge.acknowledged = false;
}

static void judge_outputs(uint8_t state)
{
	uint16_t on = fake.outputs & (uint16_t)~judge.outputs;
	uint32_t fallen_us;

	if (on & WIRE_IO_WARNING)
		judge.warned_us = fake.now_us;
	if (on & WIRE_IO_LATCH_OPEN) {
		judge.opened++;
		if (!judge.right_release)
			complain("the latch opened without the right answer");
		if (!(judge.outputs & WIRE_IO_WARNING) || fake.now_us - judge.warned_us < 999000)
			complain("the latch opened before the warning was over");
		if ((judge.agreed & NEEDED) != NEEDED)
			complain("the latch opened with an input red");
		judge.released_us = fake.now_us;
		judge.released = true;
		judge.gates[0] = judge.gates[1] = false;
	}
	fallen_us = fake.now_us - judge.released_us;
	if ((fake.outputs & WIRE_IO_LATCH_OPEN) && state != STATE(FALLING))
		complain("latch open outside FALLING");
	if ((fake.outputs & WIRE_IO_DAMPERS_RELIEVE) &&
	    (!judge.released || fallen_us > (judge.gates[1] ? 2 * RELIEF_US : RELIEF_US)))
		complain("dampers relieved when the frame may meet them");
	if ((fake.outputs & WIRE_IO_DAMPERS_RELIEVE) && state != STATE(FALLING) && state != STATE(SEPARATED))
		complain("dampers relieved outside FALLING and SEPARATED");
	if (!(fake.outputs & WIRE_IO_MAGNET_HOLD) && !(judge.released && judge.gates[0] && judge.gates[1]))
		complain("magnet off without a release and two gates that a fall can make");
	judge.let_go += (judge.outputs & ~fake.outputs & WIRE_IO_MAGNET_HOLD) != 0;
	judge.outputs = fake.outputs;
}

static void judge_state(uint8_t state)
{
	uint8_t before = judge.state;

	judge.state = state;
	judge.visited[state]++;
	if (((fake.outputs & WIRE_IO_WARNING) != 0) !=
	    (state == STATE(ARMED) || state == STATE(FALLING) || state == STATE(SEPARATED)))
		complain("the warning does not go with the state");
	if (state <= STATE(ARMED) && !(fake.outputs & WIRE_IO_MAGNET_HOLD))
		complain("magnet off before a drop");
	if (state != STATE(FALLING) && state != STATE(SEPARATED) && fake.planned != 0)
		complain("an edge is left to come");
	if (state == before)
		return;
	if (state == STATE(READY) && before != STATE(ARMED)) {
		judge.ready++;
		if (!judge.acknowledged)
			complain("READY without an acknowledgement");
		if (world.ms - judge.red_ms < 1000)
			complain("READY before all was green for a second");
	}
	if (state == STATE(ARMED) && (before != STATE(READY) || !judge.right_arm))
		complain("ARMED, but not from READY by the answer to a challenge");
	if (state == STATE(FALLING) && before != STATE(ARMED))
		complain("FALLING, but not from ARMED");
	if (moving(before) && state == STATE(CAPTURED) && !(judge.agreed & AT_REST))
		complain("motion ended, but the frame is neither down nor latched");
	if (before == STATE(FAULT_HELD) && !(judge.agreed & AT_REST))
		complain("a fault is cleared, but the frame is neither down nor latched");
	if (before == STATE(KEEP_OUT) && state != STATE(CAPTURED))
		complain("KEEP_OUT left for something else");
	if (!moving(before) && !(BIT(state) & (BIT(STATE(FALLING)))) && moving(state))
		complain("motion out of nothing");
	judge.kept_out += state == STATE(KEEP_OUT);
	if (state == STATE(SAFE) || state == STATE(FALLING))
		judge.acknowledged &= state == STATE(SAFE) && before != STATE(UPLOADED);
	if (state == STATE(SAFE))
		judge.released = false;
}

static void look(void)
{
	judge_outputs(app.sequence.state);
	judge_state(app.sequence.state);
}

/* ---- interrupts ---- */

static void gate(unsigned which, uint32_t time_us)
{
	uint32_t fallen_us = time_us - judge.released_us;
	bool plausible = app.sequence.state == STATE(FALLING) && !(judge.agreed & WIRE_IO_LATCH_CLOSED) &&
	                 (int32_t)fallen_us >= (which ? LOWER_FIRST_US : UPPER_FIRST_US);

	judge.gates[which] |= plausible;
	app_on_gate(which, time_us);
}

static void spike(void)
{
	uint32_t time_us = fake.now_us - up_to(900);

	gate(up_to(1), time_us);
}

static bool due_us(uint32_t *time_us)
{
	bool now = *time_us != 0 && (int32_t)(fake.now_us - *time_us) >= 0;

	return now;
}

static void control(void)
{
	if (!world.control_wanted || world.in_control || fake.locks != 0)
		return;
	world.in_control = true;
	world.control_wanted = false;
	for (unsigned which = 0; which < 2; which++)
		if (due_us(&world.gate_us[which])) {
			gate(which, world.gate_us[which]);
			world.gate_us[which] = 0;
		}
	if (one_in(moving(app.sequence.state) ? 300 : 3000))
		spike();
	if (due_us(&world.keeper_us)) {
		app_on_keeper(world.keeper_us);
		world.keeper_us = 0;
	}
	judge_inputs();
	app_on_tick();
	look();
	world.in_control = false;
}

static void fall_begins(void)
{
	uint32_t slow = up_to(400); /* us in 10 ms */

	world.opened_us = fake.now_us;
	world.gate_us[0] = one_in(12) ? 0 : world.opened_us + 201928 + 20 * slow;
	world.gate_us[1] = one_in(12) ? 0 : world.opened_us + 377773 + 38 * slow;
	world.down_us = world.opened_us + 404000 + 40 * slow + (one_in(8) ? 3000000 : 0);
	world.hit_ms = world.ms + 430 + up_to(100);
}

/* A new millisecond: the frame, the product, and what lies. */
static void move(void)
{
	bool ordered = fake.outputs & WIRE_IO_LATCH_OPEN, on = fake.outputs & WIRE_IO_MAGNET_HOLD;

	if (ordered && !world.latch_ordered)
		world.ordered_us = one_in(12) ? 0 : fake.now_us + 1000 * up_to(20); /* 0: it is stuck */
	world.latch_ordered = ordered;
	if (ordered && world.opened_us == 0 && due_us(&world.ordered_us))
		fall_begins();
	if (world.opened_us != 0)
		world.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	if (world.opened_us != 0 && due_us(&world.down_us))
		world.inputs |= WIRE_IO_FRAME_DOWN;
	if (!on && world.magnet_was_on)
		world.keeper_us = fake.now_us + 2000 + up_to(18000);
	if (!on && world.keeper_us == 0)
		world.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
	world.magnet_was_on = on;
	/* a technician lifts the frame and puts the product on */
	if (!moving(app.sequence.state) && app.sequence.state != STATE(ARMED) && one_in(150)) {
		world.inputs = FAKE_ALL_GOOD;
		world.opened_us = 0;
	}
	if (world.wrong == 0 && one_in(moving(app.sequence.state) ? 600 : 1500)) {
		world.wrong = (uint16_t)(32u << up_to(10));
		world.wrong_until_ms = world.ms + (one_in(2) ? 1 + up_to(2) : up_to(60));
	}
	if ((int32_t)(world.ms - world.wrong_until_ms) >= 0)
		world.wrong = 0;
	fake.inputs = world.inputs ^ world.wrong;
}

static void quarter(void)
{
	int16_t noise = (int16_t)(world.ms & 1), hit = 0;

	if (world.quarter == 0) {
		world.ms++;
		fake_time(world.ms * 1000);
		move();
		app_on_turn();
		world.control_wanted = true;
	} else {
		fake_time(world.ms * 1000 + 250 * world.quarter);
	}
	if (world.opened_us != 0 && world.ms == world.hit_ms)
		hit = 3000;
	for (unsigned k = 0; k < (world.quarter < 3 ? 2u : 1u); k++)
		app_on_x(noise, (int16_t)(noise + hit), true);
	for (unsigned k = 0; k < (world.quarter < 2 ? 3u : 2u); k++)
		app_on_yz(noise, noise, noise, noise, true);
	world.quarter = (world.quarter + 1) % 4;
}

/* Anywhere in main. Samples interrupt control, too, and the lock keeps control off, not samples. */
static void interrupt(void)
{
	if (one_in(16))
		quarter();
	control();
}

/* ---- the operator ---- */

static void say(unsigned op, uint32_t host, uint32_t argument)
{
	struct frame frame;

	wire_pack_command(
	        &frame, WIRE_ID_COMMAND,
	        &(struct wire_command){.op = (uint8_t)op, .host = (uint16_t)host, .argument = argument});
	fake_receive(&frame);
}

static void host_beats(uint32_t session)
{
	struct frame frame;

	wire_pack_host_heartbeat(&frame, WIRE_ID_HEARTBEAT_HOST,
	                         &(struct wire_host_heartbeat){.nmt_state = 5,
	                                                       .session = session,
	                                                       .wire_hash_low = (uint16_t)wire_hash()});
	fake_receive(&frame);
}

static void say_release(void)
{
	uint32_t nonce = one_in(3) ? judge.nonce + up_to(2) - 1 : judge.nonce;
	uint32_t host = one_in(8) ? SESSION + up_to(2) : SESSION;
	uint16_t drop = (uint16_t)(judge.drop_id + (one_in(8) ? up_to(2) : 0));

	if (judge.asked)
		return;
	judge.asked = true;
	judge.right_release = nonce == judge.nonce && host == SESSION && drop == judge.drop_id &&
	                      app.sequence.state == STATE(ARMED);
	say(WIRE_OP_RELEASE, host, wire_answer(nonce, drop, judge.set));
}

static void say_arm(void)
{
	uint32_t nonce = judge.drop_id == 0 && !one_in(3) ? judge.nonce : up_to(1);

	bool waits = fake.received_next < fake.received_count; /* the ARM before this one perhaps */

	judge.right_arm = (nonce != 0 && nonce == judge.nonce) || (waits && judge.right_arm);
	say(WIRE_OP_ARM, SESSION, wire_answer(nonce, SESSION, judge.set));
}

static void operate(void)
{
	uint8_t state = app.sequence.state;
	struct frame frame;

	if (world.ms % 100 == 7 && !one_in(100))
		host_beats(SESSION);
	if (one_in(150))
		host_beats(SESSION + up_to(6));
	if (world.ms / 4096 % 4 && one_in(state == STATE(SAFE) || state == STATE(FAULT_HELD) ? 60 : 3000))
		say(WIRE_OP_CLEAR, SESSION, 0);
	if (one_in(state == STATE(READY) ? 60 : 3000))
		say_arm();
	if (one_in(state == STATE(ARMED) ? 60 : 3000))
		say_release();
	if (one_in(20000))
		say(WIRE_OP_ABORT, SESSION, 0);
	if (one_in(state == STATE(CAPTURED) ? 30 : 3000))
		say(WIRE_OP_DISCARD, SESSION, app.sequence.drop_id);
	if (one_in(2000)) {
		wire_pack_nmt(&frame, WIRE_ID_NMT,
		              &(struct wire_nmt){.command = (uint8_t)(129 + up_to(1)), .node = 1});
		fake_receive(&frame);
	}
}

/* What the tower has said since. */
static void listen(void)
{
	struct wire_challenge armed;
	struct wire_reply reply;

	for (unsigned i = 0; i < fake.sent_count; i++) {
		const struct frame *frame = &fake.sent[i];

		if (frame->id == WIRE_ID_CHALLENGE && wire_unpack_challenge(frame, &armed) == 0) {
			judge.nonce = armed.nonce;
			judge.drop_id = armed.drop_id;
		}
		if (frame->id != WIRE_ID_REPLY || wire_unpack_reply(frame, &reply) != 0)
			continue;
		judge.acknowledged |= reply.op == WIRE_OP_CLEAR && reply.result == 0 &&
		                      !(reply.checks & WIRE_CHECK_ACKNOWLEDGE);
		if (reply.op == WIRE_OP_RELEASE)
			judge.asked = judge.right_release = false;
		judge.refused_early += reply.result == DT_E_EARLY;
	}
	fake.sent_count = 0;
}

/* ---- resets ---- */

static void reset(enum port_reset cause)
{
	bool was_moving = moving(app.sequence.state);
	uint8_t expected = cause == PORT_RESET_WATCHDOG    ? WIRE_FAULT_WATCHDOG
	                   : cause == PORT_RESET_BROWN_OUT ? WIRE_FAULT_BROWN_OUT
	                   : was_moving                    ? WIRE_FAULT_RESET
	                                                   : app.sequence.fault; /* outlives it */

	fake.outputs = WIRE_IO_MAGNET_HOLD; /* as the drivers hold it in reset */
	fake.planned = 0;
	fake.resets = 0;
	fake.received_count = fake.received_next = 0;
	world.control_wanted = false;
	world.quarter = 0;
	app_init(cause);
	if (app.sequence.fault != expected)
		complain("the reset is not the fault it should be");
	judge.resets_in_motion += was_moving;
	judge.acknowledged = judge.released = judge.asked = judge.right_release = false;
	judge.state = app.sequence.state;
	judge.outputs = fake.outputs;
	judge.agreed = 0;
	judge.readings = 0;
	judge.before[0] = judge.before[1] = 0;
}

static void random_reset(void)
{
	static const enum port_reset causes[] = {PORT_RESET_PIN, PORT_RESET_WATCHDOG, PORT_RESET_BROWN_OUT};

	if (fake.resets != 0) { /* the core asked for it */
		if (moving(app.sequence.state) || app.sequence.state == STATE(CAPTURED))
			complain("a reset was taken in motion, or with a drop that nobody has");
		reset(PORT_RESET_COMMAND);
	} else if (one_in(moving(app.sequence.state) ? 3000 : 20000)) {
		reset(causes[up_to(2)]);
	}
}

static void a_step(void)
{
	uint32_t ms = world.ms;

	operate();
	while (world.ms == ms) {
		quarter();
		control();
		if (!one_in(4)) {
			app_poll();
			look();
		}
		listen();
	}
	if (fake.locks != 0)
		complain("left locked");
	judge.moving_ms =
	        moving(app.sequence.state) && app.sequence.state != STATE(KEEP_OUT) ? judge.moving_ms + 1 : 0;
	if (judge.moving_ms > 2500)
		complain("motion does not end");
	random_reset();
}

static void promises_are_kept(void **state)
{
	(void)state;
	print_message("# seed %u\n", SEED);
	seed = SEED;
	fake_init();
	fake.interrupt = interrupt;
	world.inputs = FAKE_ALL_GOOD;
	app_init(PORT_RESET_POWER_ON);
	judge.set = wire_parameters_crc32(app.parameters.value);
	for (judge.step = 0; judge.step < STEPS; judge.step++)
		a_step();
	print_message(
	        "# %u steps: READY %u times, %u releases, %u early, %u products let go, %u times kept out, "
	        "%u resets in motion\n",
	        judge.step, judge.ready, judge.opened, judge.refused_early, judge.let_go, judge.kept_out,
	        judge.resets_in_motion);
	for (unsigned s = 0; s < WIRE_STATES; s++)
		if (judge.visited[s] < 1000)
			fail_msg("%s seen %u times only, seed %u", wire_state_name(s), judge.visited[s],
			         SEED);
	assert_true(judge.ready > 100 && judge.opened > 50 && judge.let_go > 25 && judge.refused_early > 100);
	assert_true(judge.kept_out > 3 && judge.resets_in_motion > 10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(promises_are_kept),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
