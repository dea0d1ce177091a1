/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every call over the hardware boundary failed once, at every point of a drop.
 *
 * A whole drop, short because the gates are high and the window is small, runs in a simple world: a latch, a
 * frame that falls, two gates, a product that hits, and a host that arms, releases, collects with the join
 * and accepts. The waits before READY and before a release are made short, or they would be nearly all of it.
 * The calls of each kind are counted once; then the drop is done again for each call of each kind with that
 * one failed. Whatever fails, the tower must come to rest braked, and account for what happened exactly.
 *
 * The linker puts the __wrap_ functions between the firmware and the fake port (--wrap,
 * tests/fault/fault.mk).
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/segment.h"
#include "firmware/app.h"
#include "firmware/command.h"
#include "firmware/command.h"
#include "host/record/join.h"
#include "tests/unit/fake_port.h"

enum kind {
	NOTHING,
	TIME_JUMPS,      /* a time that is not */
	IO_ALL_OFF,      /* one look at inputs and outputs sees nothing */
	IO_INVERTED,     /* or the opposite of everything */
	IO_ONE_BIT,      /* or one bit wrong, another each time */
	BIAS_INVERTED,   /* open for short */
	OUTPUTS_LOST,    /* not carried out */
	OFF_AT_LATE,     /* carried out at once */
	OFF_AT_LOST,     /* never carried out */
	CANCEL_LOST,     /* not carried out */
	SETUP_REFUSED,   /* DT_E_ARGUMENT */
	SEND_FULL,       /* DT_E_FULL, once */
	SEND_FULL_LONG,  /* DT_E_FULL for 20 ms */
	SEND_LOST,       /* taken, but never on the bus */
	RECEIVE_NONE,    /* says there is none */
	RECEIVE_LOST,    /* what was there is gone */
	RECEIVE_GARBAGE, /* a frame that nobody sent */
	RECEIVE_STRANGE, /* returns neither 0 nor 1 */
	BUS_OFF,         /* for 5 ms */
	KICK_LOST,
	GATE_LOST, /* from here on the port does not call */
	GATE_TWICE,
	GATE_STRANGE, /* the other gate as well */
	X_NOT_READY,
	YZ_NOT_READY,
	X_LOST, /* not even called */
	YZ_LOST,
	MAIN_LATE, /* no app_poll for 30 ms: more than the queue of ticks holds */
	KINDS
};

static const char *const names[KINDS] = {
        "nothing",       "time jumps",      "io all off",      "io inverted", "io one bit",
        "bias inverted", "outputs lost",    "off_at late",     "off_at lost", "cancel lost",
        "setup refused", "send full",       "send full 20 ms", "send lost",   "receive none",
        "receive lost",  "receive garbage", "receive strange", "bus off",     "kick lost",
        "gate lost",     "gate twice",      "gate strange",    "x not ready", "yz not ready",
        "x lost",        "yz lost",         "main late",
};

enum {
	SESSION = 0x5A5A7001,
	WAIT_MS = 20,
	READY_MS = 230,        /* by then the tower is at rest and green */
	END_MS = 4000,         /* by then it is at rest again, whatever happens */
	LATCH_MS = 5,          /* from the latch's coil to the frame's first movement */
	GATE_UPPER_US = 45161, /* sqrt(2 s / g) for 10, 20 and 40 mm */
	GATE_LOWER_US = 63867,
	DOWN_US = 90322,
	IMPACT_MS = 110,
	BROKEN_US = 3000, /* a beam stays broken */
};

static struct {
	enum kind kind;
	unsigned at; /* which call of that kind */
	unsigned calls[KINDS];
	bool counting;
	uint32_t until_ms; /* a failure that lasts */
	bool happened;
} fault;

static struct {
	uint32_t now_ms, ordered_ms, opened_ms;
	bool latch_ordered, opened, product_gone, hit;
	int16_t s2x;
} world;

static struct {
	struct segment_join segments;
	uint8_t sequence;
	bool released, ended, complete, accepted;
	uint32_t sent, blocks[2], given, overruns, late_edges, bus_offs, lost, garbage;
	struct wire_capture_end end;
	struct wire_challenge challenge;
} host;

static struct join *the_join;               /* one for all drops: the tower's boot message parts them */
static const struct command_scope *the_app; /* its state, as the firmware hands it to command_handle */

/* True when this call is the one to fail. */
static bool fails(enum kind kind)
{
	bool now = fault.counting && fault.calls[kind]++ == fault.at && fault.kind == kind;

	fault.happened |= now;
	return now;
}

/* For failures that last, once a tick. */
static void begin(enum kind kind, uint32_t ms)
{
	if (fails(kind))
		fault.until_ms = world.now_ms + ms;
}

static bool lasts(enum kind kind)
{
	return fault.kind == kind && fault.happened && world.now_ms < fault.until_ms;
}

/* ---- between firmware and port ---- */

uint32_t __real_port_time_us(void);
uint16_t __real_port_io(void);
uint16_t __real_port_bias_high(void);
void __real_port_outputs(uint16_t on, uint16_t off);
int __real_port_off_at(uint16_t output, uint32_t time_us);
void __real_port_off_cancel(uint16_t output);
int __real_port_can_setup(bool classic, uint32_t data_kbit_s);
int __real_port_can_send(const struct frame *frame);
int __real_port_can_receive(struct frame *frame);
uint32_t __real_port_can_errors(enum port_bus *state);
void __real_port_watchdog_kick(void);
bool __real_command_handle(const struct command_scope *scope, const struct frame *frame);

uint32_t __wrap_port_time_us(void);
uint16_t __wrap_port_io(void);
uint16_t __wrap_port_bias_high(void);
void __wrap_port_outputs(uint16_t on, uint16_t off);
int __wrap_port_off_at(uint16_t output, uint32_t time_us);
void __wrap_port_off_cancel(uint16_t output);
int __wrap_port_can_setup(bool classic, uint32_t data_kbit_s);
int __wrap_port_can_send(const struct frame *frame);
int __wrap_port_can_receive(struct frame *frame);
uint32_t __wrap_port_can_errors(enum port_bus *state);
void __wrap_port_watchdog_kick(void);
bool __wrap_command_handle(const struct command_scope *scope, const struct frame *frame);

uint32_t __wrap_port_time_us(void)
{
	return __real_port_time_us() + (fails(TIME_JUMPS) ? 1000000 : 0);
}

uint16_t __wrap_port_io(void)
{
	uint16_t io = __real_port_io();

	if (fails(IO_ALL_OFF))
		return 0;
	if (fails(IO_INVERTED))
		return (uint16_t)(~io & 0x7FFF);
	if (fails(IO_ONE_BIT))
		return (uint16_t)(io ^ 1u << fault.at % 15);
	return io;
}

uint16_t __wrap_port_bias_high(void)
{
	return __real_port_bias_high() ^ (fails(BIAS_INVERTED) ? WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2 : 0);
}

void __wrap_port_outputs(uint16_t on, uint16_t off)
{
	if (!fails(OUTPUTS_LOST))
		__real_port_outputs(on, off);
}

int __wrap_port_off_at(uint16_t output, uint32_t time_us)
{
	int result;

	if (fails(OFF_AT_LOST))
		return 0;
	result = __real_port_off_at(output, fails(OFF_AT_LATE) ? fake.now_us - 1 : time_us);
	host.late_edges += result != 0;
	return result;
}

void __wrap_port_off_cancel(uint16_t output)
{
	if (!fails(CANCEL_LOST))
		__real_port_off_cancel(output);
}

int __wrap_port_can_setup(bool classic, uint32_t data_kbit_s)
{
	return fails(SETUP_REFUSED) ? DT_E_ARGUMENT : __real_port_can_setup(classic, data_kbit_s);
}

static void hear(const struct frame *frame)
{
	const struct frame *whole = segment_feed(&host.segments, frame);

	host.blocks[0] += frame->id == WIRE_ID_BLOCK_S1;
	host.blocks[1] += frame->id == WIRE_ID_BLOCK_S2;
	if (frame->id == WIRE_ID_CHALLENGE)
		assert_int_equal(wire_unpack_challenge(frame, &host.challenge), 0);
	if (whole == NULL)
		return;
	if (join_feed(the_join, whole) == 1 || (whole->id == WIRE_ID_CAPTURE_END && !host.ended)) {
		assert_int_equal(wire_unpack_capture_end(whole, &host.end), 0);
		host.ended = true;
	}
}

int __wrap_port_can_send(const struct frame *frame)
{
	if (fails(SEND_FULL) || lasts(SEND_FULL_LONG) || (fault.kind == BUS_OFF && fake.bus == PORT_BUS_OFF))
		return DT_E_FULL;
	host.sent++;
	if (fails(SEND_LOST)) {
		host.lost++;
		host.blocks[0] += frame->id == WIRE_ID_BLOCK_S1;
		host.blocks[1] += frame->id == WIRE_ID_BLOCK_S2;
	} else {
		hear(frame);
	}
	return 0;
}

int __wrap_port_can_receive(struct frame *frame)
{
	int result;

	if (fails(RECEIVE_NONE))
		return 0;
	if (fails(RECEIVE_GARBAGE)) {
		*frame = (struct frame){
		        .id = fault.at % 2048, .length = (uint8_t)(fault.at % 9), .flags = FRAME_REMOTE};
		host.garbage++;
		host.given++;
		return 1;
	}
	if (fails(RECEIVE_STRANGE)) {
		memset(frame, 0xFF, sizeof(*frame));
		return fault.at % 2 ? -1 : 2;
	}
	result = __real_port_can_receive(frame);
	if (fails(RECEIVE_LOST))
		result = __real_port_can_receive(frame);
	host.given += result == 1;
	return result;
}

uint32_t __wrap_port_can_errors(enum port_bus *state)
{
	bool off = lasts(BUS_OFF);

	host.bus_offs += off && fake.bus != PORT_BUS_OFF;
	fake.bus = off ? PORT_BUS_OFF : PORT_BUS_ACTIVE;
	return __real_port_can_errors(state);
}

void __wrap_port_watchdog_kick(void)
{
	if (!fails(KICK_LOST))
		__real_port_watchdog_kick();
}

bool __wrap_command_handle(const struct command_scope *scope, const struct frame *frame)
{
	the_app = scope;
	return __real_command_handle(scope, frame);
}

/* ---- the world ---- */

static void gate(unsigned which, uint32_t fallen_us, uint32_t at_us, uint16_t beam)
{
	fake.inputs &= (uint16_t)~beam;
	if (fallen_us >= at_us && fallen_us < at_us + BROKEN_US)
		fake.inputs |= beam;
	if (fallen_us < at_us || fallen_us >= at_us + 1000)
		return;
	if (!fails(GATE_LOST))
		app_on_gate(which, world.opened_ms * 1000 + at_us);
	if (fails(GATE_TWICE))
		app_on_gate(which, world.opened_ms * 1000 + at_us + 200);
	if (fails(GATE_STRANGE))
		app_on_gate(!which, world.opened_ms * 1000 + at_us + 300);
}

static void fall(void)
{
	uint32_t fallen_us = (world.now_ms - world.opened_ms) * 1000;

	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	gate(0, fallen_us, GATE_UPPER_US, WIRE_IO_GATE_UPPER);
	gate(1, fallen_us, GATE_LOWER_US, WIRE_IO_GATE_LOWER);
	if (fallen_us >= DOWN_US)
		fake.inputs |= WIRE_IO_FRAME_DOWN;
	if (!(fake.outputs & WIRE_IO_MAGNET_HOLD))
		world.product_gone = true;
	if (world.product_gone)
		fake.inputs &= (uint16_t)~WIRE_IO_PRODUCT_HELD;
	world.s2x = 0;
	if (world.product_gone && !world.hit && fallen_us >= IMPACT_MS * 1000) {
		world.s2x = 3000;
		world.hit = true;
	}
}

static void move(void)
{
	bool ordered = fake.outputs & WIRE_IO_LATCH_OPEN;

	if (ordered && !world.latch_ordered)
		world.ordered_ms = world.now_ms;
	world.latch_ordered = ordered;
	if (!world.opened && ordered && world.now_ms - world.ordered_ms >= LATCH_MS) {
		world.opened = true;
		world.opened_ms = world.now_ms;
	}
	if (world.opened)
		fall();
}

static void sample(void)
{
	for (unsigned k = 0; k < 10; k++) {
		bool now = k == world.now_ms % 7; /* one of each a tick is enough to fail */

		if (k < 7 && !(now && fails(X_LOST))) {
			bool ready = !(now && fails(X_NOT_READY));

			app_on_x((int16_t)k, world.s2x, ready);
			host.overruns += ready ? 0 : 2;
		} else if (k < 7) {
			host.overruns += 2;
		}
		if (!(now && fails(YZ_LOST))) {
			bool ready = !(now && fails(YZ_NOT_READY));

			app_on_yz(1, (int16_t)-k, 2, 3, ready);
			host.overruns += ready ? 0 : 4;
		} else {
			host.overruns += 4;
		}
	}
}

/* ---- the host ---- */

static void say(unsigned op, uint32_t argument)
{
	struct wire_command command = {.op = (uint8_t)op,
	                               .sequence = ++host.sequence,
	                               .host = (uint16_t)SESSION,
	                               .argument = argument};
	struct frame frame;

	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	fake_receive(&frame);
}

static void set(unsigned index, uint32_t value)
{
	struct frame frame;

	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST,
	              &(struct wire_sdo){.specifier = 0x23, .index = (uint16_t)index, .value = value});
	fake_receive(&frame);
}

static void make_it_short(void)
{
	set(0x2000, 10000);
	set(0x2001, 20000);
	set(0x2002, 30000);
	set(0x2003, 40000);
	set(0x2005, 20);
	set(0x2006, 20);
	the_app->parameters->value[WIRE_PARAMETER_settle_ms] = WAIT_MS; /* less than anybody may set */
	the_app->parameters->value[WIRE_PARAMETER_warning_ms] = WAIT_MS;
}

static void ask_again(void)
{
	struct record_gap gap;
	struct frame frame;

	if (!join_next_gap(the_join, 0, 0, 64, &gap)) {
		join_forget(the_join);
		return;
	}
	wire_pack_resend(&frame, WIRE_ID_RESEND,
	                 &(struct wire_resend){
	                         .sensor = (uint8_t)gap.sensor,
	                         .count = (uint16_t)(gap.last_tick_ms - gap.first_tick_ms + 1),
	                         .first_tick_ms = gap.first_tick_ms,
	                 });
	fake_receive(&frame);
}

/* Every 10 ms it says what the state it has been told calls for; what gets lost is said again. */
static void operate(void)
{
	uint8_t state = the_app->sequence->state;
	uint32_t set_crc32 = wire_parameters_crc32(the_app->parameters->value);
	const struct wire_challenge *challenge = &host.challenge;

	host.complete |= host.ended && join_complete(the_join);
	if (state == WIRE_STATE_READY && challenge->nonce == 0 && !world.opened)
		say(WIRE_OP_ARM, wire_answer(0, SESSION, set_crc32));
	if (challenge->nonce != 0 && challenge->drop_id == 0) /* again when the next did not come */
		say(WIRE_OP_ARM, wire_answer(challenge->nonce, SESSION, set_crc32));
	if (state == WIRE_STATE_ARMED && challenge->drop_id != 0) {
		host.released = true;
		say(WIRE_OP_RELEASE, wire_answer(challenge->nonce, challenge->drop_id, set_crc32));
	}
	if (state != WIRE_STATE_ARMED && (state != WIRE_STATE_READY || world.now_ms % 50 == 0))
		host.challenge = (struct wire_challenge){.nonce = 0}; /* the answer was lost */
	if ((state == WIRE_STATE_FAULT_HELD ||
	     (state == WIRE_STATE_SAFE && !the_app->sequence->acknowledged)) &&
	    !world.opened)
		say(WIRE_OP_CLEAR, 0);
	if (state != WIRE_STATE_CAPTURED || !host.ended)
		return;
	if (join_complete(the_join)) {
		host.accepted = true;
		say(WIRE_OP_ACCEPT, host.end.crc32);
	} else if (world.now_ms % 100 == 0) {
		ask_again();
	}
}

static void hosts_part(void)
{
	struct frame frame;

	if (world.now_ms % 100 == 5) {
		wire_pack_host_heartbeat(
		        &frame, WIRE_ID_HEARTBEAT_HOST,
		        &(struct wire_host_heartbeat){
		                .nmt_state = 5, .session = SESSION, .wire_hash_low = (uint16_t)wire_hash()});
		fake_receive(&frame);
	}
	if (world.now_ms == READY_MS)
		make_it_short();
	if (world.now_ms > READY_MS + 5 && world.now_ms % 10 == 0)
		operate();
}

/* ---- what must hold ---- */

static bool at_rest(void)
{
	return !sequence_moving(the_app->sequence->state);
}

static void check_now(void)
{
	uint8_t state = the_app->sequence->state;

	if (!world.opened)
		assert_true(fake.outputs & WIRE_IO_MAGNET_HOLD);
	if (!host.released) {
		assert_false(fake.outputs & WIRE_IO_LATCH_OPEN);
		assert_int_equal(fake.planned, 0);
	}
	if (fake.outputs & WIRE_IO_LATCH_OPEN && fault.kind != OUTPUTS_LOST)
		assert_true(state == WIRE_STATE_FALLING);
	if (at_rest() && fault.kind != OUTPUTS_LOST)
		assert_false(fake.outputs & (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_CAMERA));
	if (at_rest() && fault.kind != CANCEL_LOST)
		assert_int_equal(fake.planned, 0);
	assert_int_equal(fake.locks, 0);
}

static uint32_t counted(enum wire_counter_number counter)
{
	return the_app->counters[counter];
}

static void check_counters(void)
{
	const struct stream *stream = the_app->stream;

	assert_int_equal(stream->waiting, false);
	assert_int_equal(counted(WIRE_COUNTER_frames_sent), host.sent);
	assert_int_equal(counted(WIRE_COUNTER_frames_received), host.given);
	assert_int_equal(counted(WIRE_COUNTER_frames_malformed) + counted(WIRE_COUNTER_frames_unknown),
	                 host.garbage);
	assert_int_equal(counted(WIRE_COUNTER_edges_late), host.late_edges);
	assert_int_equal(counted(WIRE_COUNTER_bus_offs), host.bus_offs);
	assert_int_equal(counted(WIRE_COUNTER_resends_overflowed), 0);
	if (fault.kind != MAIN_LATE) {
		assert_int_equal(counted(WIRE_COUNTER_samples_overrun), host.overruns);
		assert_int_equal(counted(WIRE_COUNTER_ticks_late), 0);
	}
	if (fault.kind == MAIN_LATE && fault.happened)
		assert_int_equal(counted(WIRE_COUNTER_ticks_late), 30);
	if (the_app->stream->classic)
		return;
	/* Blocks: every tick that is finished and was not lost before, or counted as dropped. */
	assert_int_equal(host.blocks[0] + host.blocks[1] + counted(WIRE_COUNTER_frames_dropped) +
	                         2 * (counted(WIRE_COUNTER_samples_overrun) - host.overruns) / 54,
	                 2 * (world.now_ms - 1)); /* the last is open */
}

static void check_end(void)
{
	uint8_t state = the_app->sequence->state;

	assert_true(at_rest());
	assert_false(fake.outputs & (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_CAMERA));
	assert_int_equal(state, WIRE_STATE_UPLOADED);
	assert_true(world.opened); /* the host went on until it had its drop */
	assert_true(host.ended && host.complete && host.accepted);
	assert_int_equal(host.end.last_tick_ms - host.end.first_tick_ms, 39);
	if (the_app->sequence->fault != WIRE_FAULT_NONE)
		assert_true(host.end.marks & WIRE_MARK_FAULT);
	check_counters();
}

/* ---- a drop ---- */

static void one_ms(void)
{
	fake_time(world.now_ms * 1000);
	move();
	app_on_turn();
	app_on_tick();
	sample();
	begin(SEND_FULL_LONG, 20);
	begin(BUS_OFF, 5);
	begin(MAIN_LATE, 30);
	if (!lasts(MAIN_LATE)) {
		hosts_part();
		app_poll();
	}
	fake.sent_count = 0;
	world.now_ms++;
	if (the_app != NULL)
		check_now();
}

static bool over(void)
{
	return world.opened && host.accepted && at_rest() && the_app->sequence->state != WIRE_STATE_CAPTURED;
}

static void drop(enum kind kind, unsigned at)
{
	memset(&fault, 0, sizeof(fault));
	memset(&world, 0, sizeof(world));
	memset(&host, 0, sizeof(host));
	fault.kind = kind;
	fault.at = at;
	fake_init();
	the_app = NULL;
	fault.counting = true; /* the bus is set up here, and only here */
	app_init(PORT_RESET_POWER_ON);
	fault.counting = false;
	while (world.now_ms < END_MS && !(the_app != NULL && over())) {
		fault.counting |= world.now_ms == READY_MS + 5;
		one_ms();
	}
	fault.counting = false;
	for (unsigned i = 0; i < 60; i++) /* what waits gets out, what lasts is over */
		one_ms();
	check_end();
}

static void each_call(void **state)
{
	enum kind kind = *(const enum kind *)*state;
	unsigned count;

	drop(NOTHING, 0);
	count = fault.calls[kind];
	assert_true(kind == NOTHING || count > 0);
	for (unsigned at = 0; at < count; at++) {
		drop(kind, at);
		assert_true(fault.happened);
	}
}

static int say_where(void **state)
{
	(void)state;
	print_message("# %s: the last was call %u, at %u ms\n", names[fault.kind], fault.at, world.now_ms);
	return 0;
}

static int open_join(void **state)
{
	(void)state;
	the_join = join_create();
	return the_join == NULL ? -1 : 0;
}

static int close_join(void **state)
{
	(void)state;
	join_destroy(the_join);
	return 0;
}

int main(void)
{
	static enum kind kinds[KINDS];
	struct CMUnitTest tests[KINDS];

	for (unsigned k = 0; k < KINDS; k++) {
		kinds[k] = (enum kind)k;
		tests[k] = (struct CMUnitTest){names[k], each_call, NULL, say_where, &kinds[k]};
	}
	return cmocka_run_group_tests(tests, open_join, close_join);
}
