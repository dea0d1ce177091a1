/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_TOWER_H
#define DT_HIL_TOWER_H
/*
 * The drop tower as the controller sees it: outputs in, inputs, gate captures and sensor codes out.
 *
 * The frame hangs in its latch, falls along rails with friction past two light gates into the dampers; the
 * product is on the frame's magnet until it separates, falls freely, meets the mat and bounces until it
 * lies still. What the frame does has closed forms, so every event has its exact time; the contact is
 * integrated (product_step). README.md says what was left out and decided.
 *
 * Time is virtual, in seconds since the reset of the firmware, and only goes forward: a time before the
 * present counts as the present. The result does not depend on the machine.
 *
 *     tower_output(tower, 1, true, 0.0105);       magnet on; outputs are off at the start
 *     tower_advance(tower, 0.011);
 *     tower_sample(tower, SENSORBUS_X, codes);
 *
 * A tower starts with the frame in the latch, the product under it and a technician's pin in place that
 * holds the product until the magnet has been on for the first time (a tower always has power before the
 * product is hung into it). tower_lift makes the same beginning again.
 *
 * One thread. tower_create takes memory, tower_destroy gives it back; the scene is copied and must have
 * passed scene_check. tower_create turns GSL's aborting error handler off.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/scenes/scene.h"
#include "common/sensorbus.h"

struct tower;

struct tower_options {
	uint64_t seed;
	bool ideal; /* no noise, no IEPE high-pass, no scatter from drop to drop */
};

/* What really happened in this drop. Times are NAN until it did; so are the values that belong to them. */
struct tower_truth {
	double latch_open_s;
	double magnet_off_s; /* the command */
	double separation_s;
	double impact_s;     /* the first */
	double frame_down_s; /* the frame meets the dampers */
	double impact_speed_m_s;
	double angle_deg; /* of this drop, from the start; from the impact on as it landed */
	double separation_travel_m;
	double frame_speed_at_separation_m_s;
	bool frame_away;   /* now: neither in its latch nor met by the dampers */
	bool frame_moving; /* now */
};

enum tower_fault {
	TOWER_DOOR_OPEN,
	TOWER_ESTOP,
	TOWER_SUPPLY_LOW,      /* the input only: the hold-up still feeds the magnet */
	TOWER_DAMPERS_OUT,     /* out of the rails: the frame meets the stop behind them */
	TOWER_GATE_UPPER_DEAD, /* never sees its beam broken */
	TOWER_GATE_LOWER_DEAD,
	TOWER_GATE_UPPER_WIRE, /* broken: reads as a broken beam, for ever */
	TOWER_GATE_LOWER_WIRE,
	TOWER_FRAME_DOWN_WIRE, /* broken: reads as a frame that is down */
	TOWER_FRAME_READS_UP,  /* its switch never sees it down */
	TOWER_LATCH_READS_CLOSED,
	TOWER_LATCH_READS_OPEN,
	TOWER_FRAME_JAMMED, /* on the rails: brakes, and stays where it then hangs until it is freed */
	TOWER_LATCH_STUCK,  /* does not open */
	TOWER_MAGNET_WEAK,  /* holds at rest, loses the product as soon as the frame moves */
	TOWER_MAGNET_STUCK, /* does not let go when it is switched off */
	TOWER_CABLE_S1,     /* open: bias too high, no acceleration, no noise */
	TOWER_CABLE_S2,
	TOWER_SHORT_S1, /* of the cable: bias too low, and the same */
	TOWER_SHORT_S2,
	TOWER_SENSORS_SWAPPED, /* each on the other's cable */
	TOWER_S1_REVERSED,     /* mounted turned by 180 deg about Z */
	TOWER_S2_REVERSED,
	TOWER_FAULTS
};

/* NULL: no memory. */
struct tower *tower_create(const struct scene *scene, const struct tower_options *options);
void tower_destroy(struct tower *tower);

/* An edge of output `bit` (0 to 4 of the io word) at time_s; the tower goes on to that time. Door and
 * emergency stop lie in series with the coils of latch and relief: while one is open neither is energised,
 * whatever the output. */
void tower_output(struct tower *tower, unsigned bit, bool on, double time_s);

/* Goes on to exactly time_s. */
void tower_advance(struct tower *tower, double time_s);

/* Converts now: codes are S1 X Y Z, S2 X Y Z; only those of the group (SENSORBUS_X, SENSORBUS_YZ) are
 * written. */
void tower_sample(struct tower *tower, unsigned group, int16_t codes[6]);

/* WIRE_IO_* input bits now. */
uint16_t tower_inputs(const struct tower *tower);

/* Bit 0 S1, 1 S2: its bias is above its window now. */
uint8_t tower_bias_high(const struct tower *tower);

/* True once after gate 0 (upper) or 1 (lower) saw its beam broken, or the keeper current (2) fell because the
 * product left, with the time in whole us, rounded down as a timer does, modulo 2^32. */
bool tower_capture(struct tower *tower, unsigned which, uint32_t *time_us);

/* The gate's line pulses without a beam being broken: so many captures, each when it is asked for next. */
void tower_glitch(struct tower *tower, unsigned gate, unsigned pulses);

/* Of the magnet, from its next switching off on. */
void tower_set_dropout(struct tower *tower, double dropout_s);

/* Of the rails, from now on. */
void tower_set_friction(struct tower *tower, double friction_n);

/* Each axis of sensor 0 or 1 reads so much more, when it is converted next. */
void tower_spike(struct tower *tower, unsigned sensor, double spike_g);

/* A hand lets the product go, wherever the frame is. */
void tower_let_go(struct tower *tower);

/* Valid as long as the tower; changes as it goes on. */
const struct tower_truth *tower_truth(const struct tower *tower);

/* The technician lifts the frame into the latch and hangs the product on: a new drop, new scatter,
 * settled sensors. Outputs and faults stay as they are; a latch that is energised does not catch. */
void tower_lift(struct tower *tower);

void tower_fault(struct tower *tower, enum tower_fault fault, bool on);
bool tower_has_fault(const struct tower *tower, enum tower_fault fault);

/* "door_open" and so on; NULL for what is no fault. */
const char *tower_fault_name(enum tower_fault fault);

#endif
