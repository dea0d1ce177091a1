/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/hazard.h"

#include <math.h>

#include "common/wire_table.h"

#define G_M_S2 9.80665
#define WARNING_MIN_S 0.999 /* horn and lamp before the latch opens */
#define CHAIN_LATE_S                                                                                       \
	0.005              /* outputs may stay on so long when a contact has opened: debouncing and a tick \
	                    */
#define GUARD_LOST_S 0.008 /* shorter than this a guard may not have been seen open */
#define READY_LATE_S 0.020 /* READY so long after a guard was lost is wrong */
#define BRAKE_LATE_S 0.001 /* after the frame met the dampers, or could have at the earliest */
#define UNWARNED_BLOCKS 3  /* state and outputs change within a tick of each other */

#define SUPPLIES (WIRE_IO_SUPPLY_GOOD | WIRE_IO_DAMPERS_ENGAGED)
#define CHAIN (WIRE_IO_DOOR_CLOSED | WIRE_IO_ESTOP_CLEAR)
#define HELD (WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD)
#define COILS (WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE)
#define GATES 3u

static void hazard_note(struct hazard *hazard, const char *what, double tower_s)
{
	if (hazard->count++ > 0)
		return;
	hazard->first = what;
	hazard->first_s = tower_s;
}

void hazard_init(struct hazard *hazard, double dampers_m)
{
	*hazard = (struct hazard){.free_fall_s = sqrt(2 * dampers_m / G_M_S2), .latch_open_s = NAN};
	hazard_reset(hazard);
}

void hazard_reset(struct hazard *hazard)
{
	hazard->state = UINT8_MAX;
	hazard->warning_s = hazard->latch_s = hazard->chain_s = hazard->guard_s = NAN;
	hazard->loss_s = -INFINITY; /* nothing has been acknowledged */
	hazard->chain_told = hazard->ready_told = hazard->relief_told = hazard->unbraked_told = false;
}

void hazard_acknowledged(struct hazard *hazard)
{
	if (isnan(hazard->guard_s))
		hazard->loss_s = NAN;
}

void hazard_let_go(struct hazard *hazard)
{
	hazard->dropping = true; /* as if it had been seen */
}

/* ---- outputs ---- */

static void latch_energised(struct hazard *hazard, bool asked, double tower_s)
{
	if (!asked)
		hazard_note(hazard, "latch opened unasked", tower_s);
	if ((hazard->inputs & (SUPPLIES | CHAIN)) != (SUPPLIES | CHAIN))
		hazard_note(hazard, "latch opened with a guard open", tower_s);
	if (!(tower_s - hazard->warning_s >= WARNING_MIN_S)) /* NAN fails too */
		hazard_note(hazard, "latch opened before the warning was over", tower_s);
	hazard->latch_s = tower_s;
	hazard->asked |= asked;
	hazard->captures = 0;
	hazard->relief_told = false;
}

void hazard_edge(struct hazard *hazard, uint16_t mask, bool on, bool asked, double tower_s)
{
	if (mask == WIRE_IO_MAGNET_HOLD && !on && isnan(hazard->latch_open_s))
		hazard_note(hazard, "magnet off with the frame at height", tower_s);
	if (mask == WIRE_IO_DAMPERS_RELIEVE && on && !asked)
		hazard_note(hazard, "dampers relieved unasked", tower_s);
	if (mask == WIRE_IO_LATCH_OPEN && on)
		latch_energised(hazard, asked, tower_s);
	if (mask == WIRE_IO_WARNING)
		hazard->warning_s = on ? tower_s : (double)NAN;
	hazard->outputs = (uint16_t)(on ? hazard->outputs | mask : hazard->outputs & ~mask);
}

/* ---- the tower ---- */

/* Since when a condition holds; NAN while it does not. */
static void hazard_follow(double *since_s, bool holds, double tower_s)
{
	if (!holds)
		*since_s = NAN;
	else if (isnan(*since_s))
		*since_s = tower_s;
}

static void hazard_watch_guards(struct hazard *hazard, uint16_t inputs, double tower_s)
{
	const bool at_rest = hazard->state == WIRE_STATE_SAFE || hazard->state == WIRE_STATE_READY;
	const bool closed = (inputs & (CHAIN | HELD)) == (CHAIN | HELD) && !(inputs & WIRE_IO_FRAME_DOWN);

	hazard_follow(&hazard->guard_s, !closed, tower_s);
	if (at_rest && tower_s - hazard->guard_s >= GUARD_LOST_S && isnan(hazard->loss_s)) {
		hazard->loss_s = tower_s;
		hazard->ready_told = false;
	}
	hazard_follow(&hazard->chain_s, (inputs & CHAIN) != CHAIN, tower_s);
	if (isnan(hazard->chain_s) || !(hazard->outputs & COILS))
		hazard->chain_told = false;
	else if (tower_s - hazard->chain_s > CHAIN_LATE_S && !hazard->chain_told) {
		hazard->chain_told = true;
		hazard_note(hazard, "latch or relief energised with door or emergency stop open", tower_s);
	}
}

/* What falls, whatever the outputs say. */
static void watch_fall(struct hazard *hazard, const struct tower_truth *truth, double tower_s)
{
	const bool dropping = isfinite(truth->latch_open_s) || isfinite(truth->separation_s);

	if (dropping && !hazard->dropping && !hazard->asked)
		hazard_note(hazard, "frame or product fell and nobody had released", tower_s);
	hazard->dropping = dropping;
}

static void watch_brakes(struct hazard *hazard, const struct tower_truth *truth, double tower_s)
{
	const bool below = truth->frame_moving && tower_s >= truth->frame_down_s;
	const bool relieved = hazard->outputs & WIRE_IO_DAMPERS_RELIEVE &&
	                      (hazard->inputs & CHAIN) == CHAIN &&
	                      tower_s >= truth->frame_down_s + BRAKE_LATE_S;
	const bool free_running = below && (relieved || !(hazard->inputs & WIRE_IO_DAMPERS_ENGAGED));

	hazard->unbraked += free_running && !hazard->free_running;
	hazard->free_running = free_running;
}

static void watch_relief(struct hazard *hazard, const struct tower_truth *truth, double tower_s)
{
	const bool on = hazard->outputs & WIRE_IO_DAMPERS_RELIEVE;

	if (on && !hazard->unbraked_told && tower_s >= truth->frame_down_s + BRAKE_LATE_S) {
		hazard->unbraked_told = true;
		hazard_note(hazard, "dampers relieved after the frame met them", tower_s);
	}
	if (on && !hazard->relief_told && hazard->captures != GATES &&
	    tower_s >= hazard->latch_s + hazard->free_fall_s + BRAKE_LATE_S) {
		hazard->relief_told = true;
		hazard_note(hazard, "dampers relieved beyond the free fall to them", tower_s);
	}
}

void hazard_sample(struct hazard *hazard, uint16_t inputs, unsigned captures, const struct tower_truth *truth,
                   double tower_s)
{
	hazard->inputs = inputs;
	hazard->captures |= captures & GATES;
	if (isnan(truth->latch_open_s)) /* a new drop */
		hazard->unbraked_told = false;
	hazard->latch_open_s = truth->latch_open_s;
	hazard_watch_guards(hazard, inputs, tower_s);
	watch_relief(hazard, truth, tower_s);
	watch_fall(hazard, truth, tower_s);
	watch_brakes(hazard, truth, tower_s);
}

/* ---- what it says ---- */

void hazard_block(struct hazard *hazard, uint8_t state, uint16_t io)
{
	const bool needed =
	        state == WIRE_STATE_ARMED || state == WIRE_STATE_FALLING || state == WIRE_STATE_SEPARATED;

	hazard->unwarned = needed && !(io & WIRE_IO_WARNING) ? hazard->unwarned + 1 : 0;
	if (hazard->unwarned == UNWARNED_BLOCKS)
		hazard_note(hazard, "no warning while armed or falling", NAN);
}

void hazard_state(struct hazard *hazard, uint8_t state, const struct tower_truth *truth, double tower_s)
{
	if (hazard->state != UINT8_MAX && wire_state_moving(hazard->state) && !wire_state_moving(state) &&
	    truth->frame_away)
		hazard_note(hazard, "motion ended with the frame in the rails", tower_s);
	if (state == WIRE_STATE_READY && !hazard->ready_told && tower_s - hazard->loss_s > READY_LATE_S) {
		hazard->ready_told = true;
		hazard_note(hazard, "READY with a guard lost and not acknowledged", tower_s);
	}
	hazard->asked &= wire_state_moving(state) || state == WIRE_STATE_ARMED;
	hazard->state = state;
}

unsigned hazard_count(const struct hazard *hazard)
{
	const bool at_rest = !wire_state_moving(hazard->state);
	const bool warns = hazard->outputs & WIRE_IO_WARNING && hazard->state != WIRE_STATE_ARMED;

	return hazard->count + (at_rest && (hazard->outputs & COILS || warns));
}
