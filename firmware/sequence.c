/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/sequence.h"

#include "common/assert.h"
#include "common/memory.h"

/* Short names for the tables. */
enum {
#define WIRE_STATE(NAME, moving, doc) NAME = WIRE_STATE_##NAME,
#include "common/wire.def"
	STAY = SEQUENCE_STAY,
	NO = SEQUENCE_NO,
	HELD = FAULT_HELD,
	MOVING = FAULT_MOVING,
	OUT = KEEP_OUT,
	LATCH = WIRE_IO_LATCH_OPEN,
	MAGNET = WIRE_IO_MAGNET_HOLD,
	RELIEVE = WIRE_IO_DAMPERS_RELIEVE,
	CAMERA = WIRE_IO_CAMERA,
	WARN = WIRE_IO_WARNING,
	FRAME_SEEN = WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER | WIRE_IO_FRAME_DOWN,
	FRAME_AT_REST = WIRE_IO_LATCH_CLOSED | WIRE_IO_FRAME_DOWN,
	GUARDS = WIRE_CHECK_ESTOP | WIRE_CHECK_DOOR | WIRE_CHECK_LATCH | WIRE_CHECK_PRODUCT,
	KEPT_STATE = 0x0F, /* of the byte that outlives a reset; above it the fault */
	KEPT_FAULT = 4,
};
_Static_assert(WIRE_STATES <= 16 && WIRE_FAULTS <= 16, "both are kept in one byte");

/* clang-format off */
static const uint8_t table[WIRE_STATES][SEQUENCE_EVENTS] = {
/*                TESTED GREEN  RED   ARM    RELEASE  ABORT   CLEAR ACCEPT    DISCARD   EXPIRED FREE       BRAKE   FULL      JAMMED DOWN      DONE  STILL FAULT */
[BOOT]         = {SAFE,  NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,    NO,       NO,   NO,   HELD},
[SAFE]         = {NO,    READY, STAY, NO,    NO,      STAY,   STAY, NO,       NO,       NO,     NO,        NO,     NO,       NO,    NO,       NO,   NO,   HELD},
[READY]        = {NO,    STAY,  SAFE, ARMED, NO,      SAFE,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,    NO,       NO,   NO,   HELD},
[ARMED]        = {NO,    STAY,  SAFE, STAY,  FALLING, SAFE,   NO,   NO,       NO,       READY,  NO,        NO,     NO,       NO,    NO,       NO,   NO,   HELD},
[FALLING]      = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     SEPARATED, NO,     NO,       NO,    NO,       NO,   NO,   MOVING},
[SEPARATED]    = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     NO,        BRAKED, CAPTURED, OUT,   NO,       NO,   NO,   MOVING},
[BRAKED]       = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     NO,        NO,     CAPTURED, OUT,   NO,       NO,   NO,   MOVING},
[CAPTURED]     = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   UPLOADED, UPLOADED, NO,     NO,        NO,     NO,       NO,    NO,       NO,   NO,   STAY},
[UPLOADED]     = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,    NO,       SAFE, NO,   HELD},
[FAULT_HELD]   = {NO,    NO,    NO,   NO,    NO,      STAY,   SAFE, NO,       NO,       NO,     NO,        NO,     NO,       NO,    NO,       NO,   NO,   STAY},
[FAULT_MOVING] = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     CAPTURED, OUT,   NO,       NO,   HELD, STAY},
[KEEP_OUT]     = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,    CAPTURED, NO,   NO,   STAY},
};

/* What entering a state energises and de-energises. */
static const struct {
	uint8_t on, off;
} outputs[WIRE_STATES] = {
[BOOT]         = {MAGNET,                          LATCH | RELIEVE | CAMERA | WARN},
[SAFE]         = {MAGNET,                          LATCH | RELIEVE | CAMERA | WARN},
[READY]        = {0,                               LATCH | RELIEVE | CAMERA | WARN},
[ARMED]        = {WARN,                            LATCH | RELIEVE | CAMERA},
[FALLING]      = {LATCH | RELIEVE | CAMERA | WARN, 0},
[SEPARATED]    = {WARN,                            LATCH},
[BRAKED]       = {0,                               LATCH | RELIEVE | WARN},
[CAPTURED]     = {0,                               LATCH | RELIEVE | CAMERA | WARN},
[UPLOADED]     = {0,                               LATCH | RELIEVE | CAMERA | WARN},
[FAULT_HELD]   = {0,                               LATCH | RELIEVE | CAMERA | WARN},
[FAULT_MOVING] = {0,                               LATCH | RELIEVE | CAMERA | WARN},
[KEEP_OUT]     = {0,                               LATCH | RELIEVE | CAMERA | WARN},
};

/* The fault that a check lost while armed, or also in motion, leads to; the first that fits. The sensors are
 * missing here: a touched product disarms without a fault. */
static const struct {
	uint32_t check;
	uint8_t fault;
	bool in_motion;
} interlocks[] = {
	{WIRE_CHECK_ESTOP,   WIRE_FAULT_ESTOP,     true},
	{WIRE_CHECK_DOOR,    WIRE_FAULT_DOOR,      true},
	{WIRE_CHECK_SUPPLY,  WIRE_FAULT_BROWN_OUT, true},
	{WIRE_CHECK_DAMPERS, WIRE_FAULT_DAMPERS,   true},
	{WIRE_CHECK_LATCH,   WIRE_FAULT_LATCH,     false},
	{WIRE_CHECK_PRODUCT, WIRE_FAULT_MAGNET,    false},
	{WIRE_CHECK_GATES,   WIRE_FAULT_GATES,     false},
	{WIRE_CHECK_HOST,    WIRE_FAULT_HOST_LOST, false},
};

/* The check that must be green before a fault may be cleared. */
static const uint32_t causes[WIRE_FAULTS] = {
	[WIRE_FAULT_ESTOP] = WIRE_CHECK_ESTOP,
	[WIRE_FAULT_DOOR] = WIRE_CHECK_DOOR,
	[WIRE_FAULT_HOST_LOST] = WIRE_CHECK_HOST,
	[WIRE_FAULT_BROWN_OUT] = WIRE_CHECK_SUPPLY,
	[WIRE_FAULT_GATES] = WIRE_CHECK_GATES,
	[WIRE_FAULT_DAMPERS] = WIRE_CHECK_DAMPERS,
};
/* clang-format on */

uint8_t sequence_next(unsigned state, enum sequence_event event)
{
	return table[state][event];
}

bool sequence_moving(unsigned state)
{
	static const bool moving[WIRE_STATES] = {
#define WIRE_STATE(NAME, moving, doc) moving,
#include "common/wire.def"
	};

	return state < WIRE_STATES && moving[state];
}

bool sequence_separated(unsigned state)
{
	return sequence_moving(state) && state != FALLING && state != KEEP_OUT;
}

bool sequence_captured(unsigned state)
{
	return state == CAPTURED || state == KEEP_OUT;
}

void sequence_replan(struct sequence *sequence)
{
	sequence->planned = false;
}

void sequence_plan(struct sequence *sequence)
{
	if (!sequence->planned)
		fall_plan(&sequence->plan, sequence->parameters);
	sequence->planned = true;
}

/* ---- going from state to state ---- */

static void enter(struct sequence *sequence, uint8_t state)
{
	DT_ASSERT(state < WIRE_STATES);
	sequence->state = state;
	sequence->entered_ms = sequence->tick_ms;
	if (state != ARMED)
		sequence->session = sequence->arm_key = sequence->nonce = sequence->release_key = 0;
	if (state != FALLING && state != SEPARATED) {
		port_off_cancel(MAGNET);
		port_off_cancel(RELIEVE);
	}
	if (state == SEPARATED)
		sequence->no_impact_ms = sequence->tick_ms + SEQUENCE_NO_IMPACT_MS;
	if (state == FAULT_MOVING && sequence->fault != WIRE_FAULT_NO_IMPACT)
		sequence->no_impact_ms = sequence->tick_ms + SEQUENCE_NO_IMPACT_MS;
	port_outputs(outputs[state].on, outputs[state].off);
	if (state != BOOT) /* a reset in BOOT shall still know of what was before */
		port_keep((uint8_t)(state | sequence->fault << KEPT_FAULT));
}

/* 0, or DT_E_STATE if the event has no place here. */
static int step(struct sequence *sequence, enum sequence_event event)
{
	uint8_t next;

	DT_ASSERT(sequence->state < WIRE_STATES && event < SEQUENCE_EVENTS);
	next = sequence_next(sequence->state, event);
	if (next == NO)
		return DT_E_STATE;
	if (next != STAY)
		enter(sequence, next);
	return 0;
}

/* For events that may come at any time and mean nothing in some states. */
static void happen(struct sequence *sequence, enum sequence_event event)
{
	int result = step(sequence, event);

	(void)result;
}

static void latch(struct sequence *sequence, uint8_t fault)
{
	if (sequence->fault == WIRE_FAULT_NONE)
		sequence->fault = fault;
	if (sequence_moving(sequence->state))
		sequence->marks |= WIRE_MARK_FAULT;
}

void sequence_fault(struct sequence *sequence, enum wire_fault fault)
{
	latch(sequence, (uint8_t)fault);
	happen(sequence, SEQUENCE_FAULT);
}

void sequence_abort(struct sequence *sequence)
{
	if (sequence_next(sequence->state, SEQUENCE_ABORT) == FAULT_MOVING)
		latch(sequence, WIRE_FAULT_ABORTED);
	happen(sequence, SEQUENCE_ABORT);
}

void sequence_triggered(struct sequence *sequence)
{
	sequence->triggered = true;
}

void sequence_full(struct sequence *sequence)
{
	if ((sequence->io & FRAME_AT_REST) != 0)
		happen(sequence, SEQUENCE_FULL);
	else if (step(sequence, SEQUENCE_JAMMED) == 0)
		sequence->marks |= WIRE_MARK_FRAME_NOT_DOWN;
}

void sequence_init(struct sequence *sequence, const struct parameters *parameters,
                   volatile uint32_t *counters, enum port_reset cause)
{
	uint8_t state = port_kept() & KEPT_STATE, fault = port_kept() >> KEPT_FAULT;

	memset(sequence, 0, sizeof(*sequence));
	sequence->parameters = parameters;
	sequence->counters = counters;
	enter(sequence, BOOT);
	if (cause == PORT_RESET_WATCHDOG)
		sequence_fault(sequence, WIRE_FAULT_WATCHDOG);
	else if (cause == PORT_RESET_BROWN_OUT)
		sequence_fault(sequence, WIRE_FAULT_BROWN_OUT);
	else if (sequence_moving(state))
		sequence_fault(sequence, WIRE_FAULT_RESET);
	else if (state < WIRE_STATES && fault != WIRE_FAULT_NONE) /* nobody has cleared it */
		sequence_fault(sequence, (enum wire_fault)fault);
}

/* ---- commands ---- */

uint16_t sequence_next_drop(const struct sequence *sequence)
{
	return (uint16_t)(sequence->drop_id == UINT16_MAX ? 1 : sequence->drop_id + 1);
}

uint32_t sequence_checks(const struct sequence *sequence, uint32_t checks)
{
	if (!sequence->acknowledged)
		checks |= WIRE_CHECK_ACKNOWLEDGE;
	return checks == 0 && !sequence->settled ? WIRE_CHECK_SETTLE : checks;
}

/* The host that has armed has not heard the answer. */
static bool armed_by(const struct sequence *sequence, const struct wire_command *command)
{
	return sequence->state == ARMED && command->host == (uint16_t)sequence->session &&
	       command->argument == sequence->arm_key;
}

/* The challenge that may be answered now, 0: none. It is good for one ARM, taken or refused. */
static uint32_t take_nonce(struct sequence *sequence)
{
	bool late = sequence->tick_ms - sequence->challenged_ms > SEQUENCE_ANSWER_MS;
	uint32_t nonce = late ? 0 : sequence->nonce;

	sequence->nonce = 0;
	return nonce;
}

static int arm(struct sequence *sequence, uint32_t checks, const struct sequence_order *order)
{
	const struct wire_command *command = &order->command;
	uint32_t nonce, session;
	bool answered = false;
	int result;

	if (armed_by(sequence, command))
		return step(sequence, SEQUENCE_ARM);
	if (sequence->state != SAFE && sequence->state != READY)
		return DT_E_STATE;
	nonce = take_nonce(sequence);
	if (hosts_hash_differs(order->hosts, command->host))
		return DT_E_HASH;
	if (sequence->state == SAFE || checks != 0)
		return DT_E_CHECKS;
	result = hosts_find(order->hosts, command->host, command->argument, 0, order->parameters_crc32,
	                    &session);
	if (result != 0)
		answered = hosts_find(order->hosts, command->host, command->argument, nonce,
		                      order->parameters_crc32, &session) == 0;
	if (result != 0 && !answered)
		return result;
	if (!order->nonce_good)
		return DT_E_SYSTEM;
	sequence->nonce = order->nonce;
	sequence->challenged_ms = sequence->tick_ms;
	if (!answered)
		return 0;
	sequence->session = session;
	sequence->arm_key = command->argument;
	sequence->parameters_crc32 = order->parameters_crc32;
	sequence->release_key =
	        wire_answer(order->nonce, sequence_next_drop(sequence), order->parameters_crc32);
	sequence->times = (struct fall_times){.dropout_us = order->dropout_us};
	return step(sequence, SEQUENCE_ARM);
}

static int refuse_release(const struct sequence *sequence, uint32_t checks,
                          const struct wire_command *command)
{
	uint32_t warned_ms = sequence->tick_ms - sequence->entered_ms;

	if (sequence->state != ARMED)
		return DT_E_STATE;
	if (command->host != (uint16_t)sequence->session)
		return DT_E_SESSION;
	if (command->argument != sequence->release_key)
		return DT_E_TOKEN;
	if (warned_ms < sequence->parameters->value[WIRE_PARAMETER_warning_ms])
		return DT_E_EARLY;
	return checks != 0 ? DT_E_CHECKS : 0;
}

/* When it is made: at its time, or at once and counted. */
static uint32_t switch_off(struct sequence *sequence, uint16_t output, uint32_t time_us)
{
	if (port_off_at(output, time_us) == 0)
		return time_us;
	sequence->counters[WIRE_COUNTER_edges_late]++;
	return port_time_us();
}

static int release(struct sequence *sequence, uint32_t checks, uint32_t now_us,
                   const struct wire_command *command)
{
	int result = refuse_release(sequence, checks, command);

	if (result != 0)
		return result;
	sequence->drop_id = sequence_next_drop(sequence);
	sequence->marks = 0;
	sequence->frame_speed_mm_s = 0;
	sequence->triggered = false;
	sequence->moved = false;
	sequence->acknowledged = false;
	sequence->released_ms = sequence->tick_ms;
	sequence->times.released_us = now_us;
	result = step(sequence, SEQUENCE_RELEASE);
	DT_ASSERT(result == 0 && sequence->state == FALLING);
	/* The relief ends in time, whatever the gates say later or do not say. */
	(void)switch_off(sequence, RELIEVE, now_us + sequence->plan.relief_us);
	return result;
}

/* While the frame is neither down nor latched keep out: also what was a fault before a reset. */
static int clear(struct sequence *sequence, const struct sequence_view *view)
{
	uint32_t checks = view->checks;

	if (sequence->state != SAFE && sequence->state != FAULT_HELD)
		return DT_E_STATE;
	if (sequence->state == SAFE && (checks & GUARDS) != 0)
		return DT_E_CHECKS;
	DT_ASSERT(sequence->fault < WIRE_FAULTS);
	if (sequence->state == FAULT_HELD && ((checks & (WIRE_CHECK_CLOCKS | causes[sequence->fault])) != 0 ||
	                                      (view->io & FRAME_AT_REST) == 0))
		return DT_E_CHECKS;
	sequence->acknowledged = (checks & GUARDS) == 0;
	sequence->fault = WIRE_FAULT_NONE;
	return step(sequence, SEQUENCE_CLEAR);
}

int sequence_command(struct sequence *sequence, const struct sequence_view *view,
                     const struct sequence_order *order)
{
	const struct wire_command *command = &order->command;
	uint32_t checks = sequence_checks(sequence, view->checks);

	switch (command->op) {
	case WIRE_OP_ARM:
		return arm(sequence, checks, order);
	case WIRE_OP_RELEASE:
		return release(sequence, checks, view->now_us, command);
	case WIRE_OP_ABORT:
		sequence_abort(sequence);
		return 0;
	case WIRE_OP_CLEAR:
		return clear(sequence, view);
	case WIRE_OP_ACCEPT:
		if (sequence->state == CAPTURED && command->argument != order->capture_crc32)
			return DT_E_CORRUPT;
		return step(sequence, SEQUENCE_ACCEPT);
	case WIRE_OP_DISCARD:
		if (sequence->state == CAPTURED && command->argument != sequence->drop_id)
			return DT_E_CORRUPT;
		return step(sequence, SEQUENCE_DISCARD);
	default:
		return DT_E_UNKNOWN;
	}
}

/* ---- the fall ---- */

static void fail_gates(struct sequence *sequence)
{
	sequence->counters[WIRE_COUNTER_gates_missed]++;
	sequence_fault(sequence, WIRE_FAULT_GATES);
}

static void plan_edges(struct sequence *sequence)
{
	const struct fall_plan *plan = &sequence->plan;
	struct fall_times *times = &sequence->times;
	uint32_t between_us = times->lower_us - times->upper_us;
	uint32_t speed_mm_s;

	if (between_us < plan->fast_us) {
		fail_gates(sequence);
		return;
	}
	speed_mm_s = plan->gate_distance_um * 1000u / between_us;
	sequence->frame_speed_mm_s = (uint16_t)(speed_mm_s > UINT16_MAX ? UINT16_MAX : speed_mm_s);
	if (between_us > plan->slow_us)
		sequence->marks |= WIRE_MARK_SLOW_FRAME;
	times->magnet_off_us =
	        switch_off(sequence, MAGNET,
	                   times->lower_us + fall_part(between_us, plan->separation_q24) - times->dropout_us);
	times->magnet_planned = true;
	if (port_io() & RELIEVE)
		(void)switch_off(sequence, RELIEVE,
		                 times->lower_us + fall_part(between_us, plan->dampers_q24));
}

static bool plausible(const struct sequence *sequence, unsigned gate, uint32_t time_us)
{
	uint32_t fallen_us = time_us - sequence->times.released_us;

	return sequence->state == FALLING && (sequence->io & WIRE_IO_LATCH_CLOSED) == 0 &&
	       sequence->times.gates < 2 && (int32_t)fallen_us >= (int32_t)sequence->plan.gate_first_us[gate];
}

void sequence_gate(struct sequence *sequence, unsigned gate, uint32_t time_us)
{
	struct fall_times *times = &sequence->times;

	sequence->moved = true;
	if (!plausible(sequence, gate, time_us)) {
		sequence->counters[WIRE_COUNTER_gates_ignored]++;
		return;
	}
	if (gate == 0) {
		times->upper_us = time_us;
		times->gates = 1;
	} else if (times->gates == 0) {
		fail_gates(sequence);
	} else {
		times->lower_us = time_us;
		times->gates = 2;
		plan_edges(sequence);
	}
}

void sequence_keeper(struct sequence *sequence, uint32_t time_us)
{
	struct fall_times *times = &sequence->times;

	if (!sequence_moving(sequence->state) || !times->magnet_planned || times->keeper_fell ||
	    (port_io() & MAGNET) != 0 || (int32_t)(time_us - times->magnet_off_us) < 0)
		return;
	times->keeper_us = time_us;
	times->keeper_fell = true;
}

static void tick_falling(struct sequence *sequence, const struct sequence_view *view)
{
	uint32_t fallen_us = view->now_us - sequence->times.released_us;
	unsigned gate = sequence->times.gates;

	if ((view->io & MAGNET) == 0 && sequence->times.magnet_planned)
		happen(sequence, SEQUENCE_FREE);
	else if ((gate < 2 && fallen_us > sequence->plan.gate_last_us[gate]) ||
	         fallen_us > sequence->plan.end_us || (view->io & WIRE_IO_FRAME_DOWN))
		fail_gates(sequence); /* also where the dampers then tear the product off */
	else if ((view->io & WIRE_IO_PRODUCT_HELD) == 0)
		sequence_fault(sequence, WIRE_FAULT_MAGNET);
	else if (sequence->tick_ms - sequence->released_ms > SEQUENCE_LATCH_MS &&
	         (view->io & WIRE_IO_LATCH_CLOSED))
		sequence_fault(sequence, WIRE_FAULT_LATCH);
}

static bool impact_overdue(const struct sequence *sequence)
{
	return sequence_separated(sequence->state) && sequence->moved && !sequence->triggered &&
	       (int32_t)(sequence->tick_ms - sequence->no_impact_ms) >= 0;
}

uint16_t sequence_tick_marks(const struct sequence *sequence)
{
	return impact_overdue(sequence) ? WIRE_MARK_NO_IMPACT : 0;
}

static void tick_interlocks(struct sequence *sequence, uint32_t checks)
{
	bool in_motion = sequence->state != ARMED;

#pragma GCC unroll 8
	for (unsigned i = 0; i < sizeof(interlocks) / sizeof(interlocks[0]); i++)
		if ((checks & interlocks[i].check) && (interlocks[i].in_motion || !in_motion)) {
			sequence_fault(sequence, interlocks[i].fault);
			return;
		}
}

/* The latch's switch, both gates and the dampers' switch must all be silent for twice the fall to the lower
 * gate before a release that went wrong counts as none. Then there is nothing to record. */
static void tick_still(struct sequence *sequence, const struct sequence_view *view)
{
	if ((view->io & WIRE_IO_LATCH_CLOSED) == 0 || (view->io & FRAME_SEEN) != 0)
		sequence->moved = true;
	if (!sequence->moved && !sequence->triggered &&
	    view->now_us - sequence->times.released_us > sequence->plan.gate_last_us[1])
		happen(sequence, SEQUENCE_STILL);
}

static void tick_moving(struct sequence *sequence, const struct sequence_view *view)
{
	tick_still(sequence, view);
	if (sequence->tick_ms - sequence->released_ms >= SEQUENCE_CAMERA_MS)
		port_outputs(0, CAMERA);
	if (sequence->state == FALLING)
		tick_falling(sequence, view);
	if (sequence->state == SEPARATED && ((view->io & RELIEVE) == 0 || (view->io & WIRE_IO_FRAME_DOWN)))
		happen(sequence, SEQUENCE_BRAKE);
	if (sequence->state != FAULT_MOVING && impact_overdue(sequence))
		sequence_fault(sequence, WIRE_FAULT_NO_IMPACT);
	tick_interlocks(sequence, view->checks);
}

static void tick_keep_out(struct sequence *sequence, const struct sequence_view *view)
{
	if ((view->io & FRAME_AT_REST) != 0)
		happen(sequence, SEQUENCE_DOWN);
}

static void tick_boot(struct sequence *sequence, const struct sequence_view *view, uint32_t since_ms)
{
	if ((view->known & FRAME_AT_REST) == FRAME_AT_REST && (view->io & FRAME_AT_REST) == 0)
		sequence_fault(sequence, WIRE_FAULT_RESET); /* the frame is on its way */
	else if (since_ms >= SEQUENCE_SELF_TEST_MS && (view->checks & WIRE_CHECK_CLOCKS) != 0)
		sequence_fault(sequence, WIRE_FAULT_SELF_TEST);
	else if (since_ms >= SEQUENCE_SELF_TEST_MS)
		happen(sequence, SEQUENCE_TESTED);
}

static void tick_rest(struct sequence *sequence, const struct sequence_view *view)
{
	uint32_t since_ms = sequence->tick_ms - sequence->entered_ms;

	if (sequence->state == BOOT)
		tick_boot(sequence, view, since_ms);
	if (sequence->state == ARMED)
		tick_interlocks(sequence, view->checks);
	if (sequence->state == ARMED &&
	    since_ms >= sequence->parameters->value[WIRE_PARAMETER_arm_timeout_ms])
		happen(sequence, SEQUENCE_EXPIRED);
	if (sequence->state == UPLOADED && since_ms >= SEQUENCE_UPLOADED_MS)
		happen(sequence, sequence->fault == WIRE_FAULT_NONE ? SEQUENCE_DONE : SEQUENCE_FAULT);
	happen(sequence, sequence_checks(sequence, view->checks) == 0 ? SEQUENCE_GREEN : SEQUENCE_RED);
}

/* A guard lost wants to be acknowledged; after that all checks have to stay green for a while. */
static void watch_guards(struct sequence *sequence, uint32_t checks)
{
	if ((checks & GUARDS) != 0)
		sequence->acknowledged = false;
	if (checks != 0 || !sequence->acknowledged) {
		sequence->settled = false;
		sequence->green_ms = sequence->tick_ms;
	} else if (sequence->tick_ms - sequence->green_ms >
	           sequence->parameters->value[WIRE_PARAMETER_settle_ms]) {
		sequence->settled = true;
	}
}

void sequence_tick(struct sequence *sequence, const struct sequence_view *view, uint32_t tick_ms)
{
	sequence->tick_ms = tick_ms;
	sequence->io = view->io;
	watch_guards(sequence, view->checks);
	if (sequence->state == KEEP_OUT)
		tick_keep_out(sequence, view);
	else if (sequence_moving(sequence->state))
		tick_moving(sequence, view);
	else
		tick_rest(sequence, view);
}
