/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/sequence.h"

#include "common/memory.h"
#include "common/units.h"

#define STANDARD_GRAVITY_MM_S2 ((uint32_t)(UNITS_G_M_S2 * 1000.0))

/* Short names for the tables. */
enum {
#define WIRE_STATE(NAME, moving, doc) NAME = WIRE_STATE_##NAME,
#include "common/wire.def"
	STAY = SEQUENCE_STAY,
	NO = SEQUENCE_NO,
	HELD = FAULT_HELD,
	MOVING = FAULT_MOVING,
	LATCH = WIRE_IO_LATCH_OPEN,
	MAGNET = WIRE_IO_MAGNET_HOLD,
	RELIEVE = WIRE_IO_DAMPERS_RELIEVE,
	CAMERA = WIRE_IO_CAMERA,
	FRAME_SEEN = WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER | WIRE_IO_FRAME_DOWN,
};

/* clang-format off */
static const uint8_t table[WIRE_STATES][SEQUENCE_EVENTS] = {
/*                TESTED GREEN  RED   ARM    RELEASE  ABORT   CLEAR ACCEPT    DISCARD   EXPIRED FREE       BRAKE   FULL      DONE  STILL FAULT */
[BOOT]         = {SAFE,  NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,   NO,   HELD},
[SAFE]         = {NO,    READY, STAY, NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,   NO,   HELD},
[READY]        = {NO,    STAY,  SAFE, ARMED, NO,      SAFE,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       NO,   NO,   HELD},
[ARMED]        = {NO,    STAY,  SAFE, NO,    FALLING, SAFE,   NO,   NO,       NO,       READY,  NO,        NO,     NO,       NO,   NO,   HELD},
[FALLING]      = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     SEPARATED, NO,     NO,       NO,   NO,   MOVING},
[SEPARATED]    = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     NO,        BRAKED, CAPTURED, NO,   NO,   MOVING},
[BRAKED]       = {NO,    NO,    NO,   NO,    NO,      MOVING, NO,   NO,       NO,       NO,     NO,        NO,     CAPTURED, NO,   NO,   MOVING},
[CAPTURED]     = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   UPLOADED, UPLOADED, NO,     NO,        NO,     NO,       NO,   NO,   STAY},
[UPLOADED]     = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     NO,       SAFE, NO,   HELD},
[FAULT_HELD]   = {NO,    NO,    NO,   NO,    NO,      STAY,   SAFE, NO,       NO,       NO,     NO,        NO,     NO,       NO,   NO,   STAY},
[FAULT_MOVING] = {NO,    NO,    NO,   NO,    NO,      STAY,   NO,   NO,       NO,       NO,     NO,        NO,     CAPTURED, NO,   HELD, STAY},
};

/* What entering a state energises and de-energises. */
static const struct {
	uint8_t on, off;
} outputs[WIRE_STATES] = {
[BOOT]         = {MAGNET,                   LATCH | RELIEVE | CAMERA},
[SAFE]         = {MAGNET,                   LATCH | RELIEVE | CAMERA},
[READY]        = {0,                        LATCH | RELIEVE | CAMERA},
[ARMED]        = {0,                        LATCH | RELIEVE | CAMERA},
[FALLING]      = {LATCH | RELIEVE | CAMERA, 0},
[SEPARATED]    = {0,                        LATCH},
[BRAKED]       = {0,                        LATCH | RELIEVE},
[CAPTURED]     = {0,                        LATCH | RELIEVE | CAMERA},
[UPLOADED]     = {0,                        LATCH | RELIEVE | CAMERA},
[FAULT_HELD]   = {0,                        LATCH | RELIEVE | CAMERA},
[FAULT_MOVING] = {0,                        LATCH | RELIEVE | CAMERA},
};

/* The fault that a check lost while armed, or also in motion, leads to; the first that fits. The sensors are
 * missing here: a touched product disarms without a fault. */
static const struct {
	uint16_t check;
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
static const uint16_t causes[WIRE_FAULTS] = {
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
	return sequence_moving(state) && state != FALLING;
}

/* ---- the plan of a fall ---- */

/* Bit by bit, rounded down. */
static uint32_t square_root(uint64_t value)
{
	uint64_t root = 0;

	for (uint64_t bit = (uint64_t)1 << 31; bit != 0; bit >>= 1)
		if ((root + bit) * (root + bit) <= value)
			root += bit;
	return (uint32_t)root;
}

/* Time to fall travel_um from rest with g less permille. */
static uint32_t fall_us(uint32_t travel_um, uint32_t permille)
{
	uint64_t um_s2 = (uint64_t)STANDARD_GRAVITY_MM_S2 * (1000u - permille);

	return square_root(2u * travel_um * 1000000000000u / um_s2);
}

void sequence_plan(struct sequence *sequence)
{
	const uint32_t *value = sequence->parameters->value;
	struct sequence_plan *plan = &sequence->plan;
	uint32_t upper_um = value[WIRE_PARAMETER_gate_upper_um],
	         lower_um = value[WIRE_PARAMETER_gate_lower_um];
	uint32_t slow = value[WIRE_PARAMETER_slow_permille];
	/* sqrt(um) with 16 fractional bits */
	uint32_t upper = square_root((uint64_t)upper_um << 32);
	uint32_t lower = square_root((uint64_t)lower_um << 32);
	uint32_t separation = square_root((uint64_t)value[WIRE_PARAMETER_separation_um] << 32);
	uint32_t dampers = square_root((uint64_t)value[WIRE_PARAMETER_dampers_um] << 32);

	/* At most 120, with the gates PARAMETER_GATE_DISTANCE_UM apart and travels to 2.4 m. */
	plan->separation_q24 = (uint32_t)(((uint64_t)(separation - lower) << 24) / (lower - upper));
	plan->dampers_q24 = (uint32_t)(((uint64_t)(dampers - lower) << 24) / (lower - upper));
	plan->gate_limit_us[0] = 2u * fall_us(upper_um, 0);
	plan->gate_limit_us[1] = 2u * fall_us(lower_um, 0);
	plan->fast_us = (fall_us(lower_um, 0) - fall_us(upper_um, 0)) / 8u * 7u;
	plan->slow_us = fall_us(lower_um, slow) - fall_us(upper_um, slow);
	plan->gate_distance_um = lower_um - upper_um;
}

/* ---- going from state to state ---- */

static void enter(struct sequence *sequence, uint8_t state)
{
	sequence->state = state;
	sequence->entered_ms = sequence->tick_ms;
	if (state != ARMED)
		sequence->token = 0;
	if (state != FALLING && state != SEPARATED) {
		port_off_cancel(MAGNET);
		port_off_cancel(RELIEVE);
	}
	if (state == SEPARATED)
		sequence->no_impact_ms = sequence->tick_ms + SEQUENCE_NO_IMPACT_MS;
	if (state == FAULT_MOVING && sequence->fault != WIRE_FAULT_NO_IMPACT)
		sequence->no_impact_ms = sequence->tick_ms + SEQUENCE_NO_IMPACT_MS;
	port_outputs(outputs[state].on, outputs[state].off);
}

/* 0, or DT_E_STATE if the event has no place here. */
static int step(struct sequence *sequence, enum sequence_event event)
{
	uint8_t next = table[sequence->state][event];

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
	if (table[sequence->state][SEQUENCE_ABORT] == FAULT_MOVING)
		latch(sequence, WIRE_FAULT_ABORTED);
	happen(sequence, SEQUENCE_ABORT);
}

void sequence_triggered(struct sequence *sequence)
{
	sequence->triggered = true;
}

void sequence_full(struct sequence *sequence)
{
	happen(sequence, SEQUENCE_FULL);
}

void sequence_init(struct sequence *sequence, const struct parameters *parameters,
                   volatile uint32_t *counters, enum port_reset cause)
{
	memset(sequence, 0, sizeof(*sequence));
	sequence->parameters = parameters;
	sequence->counters = counters;
	sequence_plan(sequence);
	enter(sequence, BOOT);
	if (cause == PORT_RESET_WATCHDOG)
		sequence_fault(sequence, WIRE_FAULT_WATCHDOG);
	if (cause == PORT_RESET_BROWN_OUT)
		sequence_fault(sequence, WIRE_FAULT_BROWN_OUT);
}

/* ---- commands ---- */

static int arm(struct sequence *sequence, const struct sequence_view *view, uint16_t token)
{
	if (sequence->state != SAFE && sequence->state != READY)
		return DT_E_STATE;
	if (view->hash_differs)
		return DT_E_HASH;
	if (sequence->state == SAFE || view->checks != 0)
		return DT_E_CHECKS;
	if (token == 0)
		return DT_E_TOKEN;
	sequence->token = token;
	return step(sequence, SEQUENCE_ARM);
}

static int release(struct sequence *sequence, const struct sequence_view *view, uint16_t token)
{
	if (sequence->state != ARMED)
		return DT_E_STATE;
	if (token != sequence->token)
		return DT_E_TOKEN;
	if (view->checks != 0)
		return DT_E_CHECKS;
	sequence->drop_id = (uint16_t)(sequence->drop_id == UINT16_MAX ? 1 : sequence->drop_id + 1);
	sequence->marks = 0;
	sequence->frame_speed_mm_s = 0;
	sequence->gates_seen = 0;
	sequence->triggered = false;
	sequence->moved = false;
	sequence->released_ms = sequence->tick_ms;
	sequence->released_us = view->now_us;
	return step(sequence, SEQUENCE_RELEASE);
}

static int clear(struct sequence *sequence, const struct sequence_view *view)
{
	if (sequence->state != FAULT_HELD)
		return DT_E_STATE;
	if (!view->clocks_good || (view->checks & causes[sequence->fault]) != 0)
		return DT_E_CHECKS;
	sequence->fault = WIRE_FAULT_NONE;
	return step(sequence, SEQUENCE_CLEAR);
}

int sequence_command(struct sequence *sequence, const struct sequence_view *view,
                     const struct wire_command *command, uint32_t capture_crc32)
{
	switch (command->op) {
	case WIRE_OP_ARM:
		return arm(sequence, view, command->token);
	case WIRE_OP_RELEASE:
		return release(sequence, view, command->token);
	case WIRE_OP_ABORT:
		sequence_abort(sequence);
		return 0;
	case WIRE_OP_CLEAR:
		return clear(sequence, view);
	case WIRE_OP_ACCEPT:
		if (sequence->state == CAPTURED && command->argument != capture_crc32)
			return DT_E_CORRUPT;
		return step(sequence, SEQUENCE_ACCEPT);
	case WIRE_OP_DISCARD:
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

static uint32_t part_of(uint32_t time_us, uint32_t factor_q24)
{
	return (uint32_t)(((uint64_t)time_us * factor_q24 + (1u << 23)) >> 24);
}

static void switch_off(struct sequence *sequence, uint16_t output, uint32_t time_us)
{
	if (port_off_at(output, time_us) != 0)
		sequence->counters[WIRE_COUNTER_edges_late]++;
}

static void plan_edges(struct sequence *sequence, uint32_t lower_us)
{
	const struct sequence_plan *plan = &sequence->plan;
	uint32_t between_us = lower_us - sequence->upper_us;
	uint32_t speed_mm_s;

	if (between_us < plan->fast_us) {
		fail_gates(sequence);
		return;
	}
	speed_mm_s = plan->gate_distance_um * 1000u / between_us;
	sequence->frame_speed_mm_s = (uint16_t)(speed_mm_s > UINT16_MAX ? UINT16_MAX : speed_mm_s);
	if (between_us > plan->slow_us)
		sequence->marks |= WIRE_MARK_SLOW_FRAME;
	switch_off(sequence, MAGNET,
	           lower_us + part_of(between_us, plan->separation_q24) -
	                   sequence->parameters->value[WIRE_PARAMETER_dropout_us]);
	switch_off(sequence, RELIEVE, lower_us + part_of(between_us, plan->dampers_q24));
}

void sequence_gate(struct sequence *sequence, unsigned gate, uint32_t time_us)
{
	sequence->moved = true;
	if (sequence->state != FALLING || gate < sequence->gates_seen)
		return; /* not a fall, or the beam again */
	if (gate > sequence->gates_seen) {
		fail_gates(sequence);
		return;
	}
	sequence->gates_seen++;
	if (gate == 0)
		sequence->upper_us = time_us;
	else
		plan_edges(sequence, time_us);
}

static void tick_falling(struct sequence *sequence, const struct sequence_view *view)
{
	uint32_t fallen_us = view->now_us - sequence->released_us;
	unsigned gate = sequence->gates_seen;

	if ((view->io & MAGNET) == 0)
		happen(sequence, SEQUENCE_FREE);
	else if ((view->io & WIRE_IO_PRODUCT_HELD) == 0)
		sequence_fault(sequence, WIRE_FAULT_MAGNET);
	else if ((gate < 2 && fallen_us > sequence->plan.gate_limit_us[gate]) ||
	         (view->io & WIRE_IO_FRAME_DOWN))
		fail_gates(sequence);
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

static void tick_interlocks(struct sequence *sequence, uint16_t checks)
{
	bool in_motion = sequence->state != ARMED;

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
	    view->now_us - sequence->released_us > sequence->plan.gate_limit_us[1])
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

static void tick_rest(struct sequence *sequence, const struct sequence_view *view)
{
	uint32_t since_ms = sequence->tick_ms - sequence->entered_ms;

	if (sequence->state == BOOT && since_ms >= SEQUENCE_SELF_TEST_MS) {
		if (view->clocks_good)
			happen(sequence, SEQUENCE_TESTED);
		else
			sequence_fault(sequence, WIRE_FAULT_SELF_TEST);
	}
	if (sequence->state == ARMED)
		tick_interlocks(sequence, view->checks);
	if (sequence->state == ARMED &&
	    since_ms >= sequence->parameters->value[WIRE_PARAMETER_arm_timeout_ms])
		happen(sequence, SEQUENCE_EXPIRED);
	if (sequence->state == UPLOADED && since_ms >= SEQUENCE_UPLOADED_MS)
		happen(sequence, sequence->fault == WIRE_FAULT_NONE ? SEQUENCE_DONE : SEQUENCE_FAULT);
	happen(sequence, view->checks == 0 ? SEQUENCE_GREEN : SEQUENCE_RED);
}

void sequence_tick(struct sequence *sequence, const struct sequence_view *view, uint32_t tick_ms)
{
	sequence->tick_ms = tick_ms;
	if (sequence_moving(sequence->state))
		tick_moving(sequence, view);
	else
		tick_rest(sequence, view);
}
