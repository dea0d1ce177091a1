/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_TOWER_PRIVATE_H
#define DT_HIL_TOWER_PRIVATE_H
/*
 * What the tower's two files share: tower_motion.c is how frame, product and sensors go on in time, tower.c
 * what the controller and the technician do to them and see.
 */
#include <gsl/gsl_rng.h>

#include "common/wire.h"
#include "hil/product.h"
#include "hil/sensor.h"
#include "hil/tower.h"

enum { SENSORS = 2, AXES = 3, CHANNELS = SENSORS * AXES };

enum frame_state { FRAME_LATCHED, FRAME_MOVING, FRAME_STOPPED };

enum place { PLACE_PIN, PLACE_MAGNET, PLACE_AIR, PLACE_MAT };

/* What the frame passes on its way down, in this order. */
enum mark { MARK_GATE_UPPER, MARK_GATE_LOWER, MARK_DAMPERS, MARK_END, MARKS };

enum event { EVENT_LATCH, EVENT_DROPOUT, EVENT_MARK, EVENT_STOP, EVENT_CALM, EVENT_TAUT, EVENT_MAT, EVENTS };

/* Uniformly accelerated, downwards positive; distance from where the drop began. */
struct motion {
	double since_s, distance_m, speed_m_s, acceleration_m_s2;
};

struct tower {
	struct scene scene;
	bool ideal;
	gsl_rng *scatter, *noise; /* apart, so that how often one converts does not change the next drop */
	double now_s;
	enum event next; /* and its time, INFINITY if none is to come */
	double next_s;

	unsigned outputs;
	unsigned inputs; /* all but the gates, which see the frame move */
	bool fault[TOWER_FAULTS];
	double latch_opens_s, magnet_drops_s; /* INFINITY: not under way */
	bool latch_energised;                 /* its coil */
	double calm_s; /* when the knock of the latch is over, INFINITY: there is none */

	enum frame_state frame_state;
	struct motion frame;
	unsigned passed; /* marks */
	bool captured[SENSORBUS_CAPTURES];
	uint32_t capture_us[SENSORBUS_CAPTURES];
	unsigned glitches[2]; /* of the gates, to come */

	enum place place;
	struct motion fall; /* in PLACE_AIR, of where the lowest corner was as it left */
	bool taut;          /* the wires pull */
	double spin_rad_s;  /* in PLACE_AIR */
	struct product product;
	double mix[SENSORS][2][2]; /* this drop's gain and cross-axis errors */
	struct sensor sensor[CHANNELS];
	double spike_g[CHANNELS]; /* on top of the next conversion */

	struct tower_truth truth;
};

/* What the output drives: the coils of latch and relief have the contacts of door and emergency stop in
 * series with them. */
static inline bool output_on(const struct tower *t, unsigned mask)
{
	const bool open = t->fault[TOWER_DOOR_OPEN] || t->fault[TOWER_ESTOP];
	const unsigned guarded = WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE;

	return (t->outputs & mask) != 0 && !(open && mask & guarded);
}

enum { KEEPER = 2 }; /* the capture behind those of the gates */

void tower_stamp(struct tower *t, unsigned which);

double tower_motion_distance(const struct motion *m, double time_s);

/* To be called when something that moves the frame or holds the product has changed. */
void tower_motion_renew(struct tower *t);

unsigned tower_inputs_but_gates(const struct tower *t);

/* To be called when anything has happened: sensors and inputs feel it, and the next event may be another. */
void tower_happened(struct tower *t);

void tower_sensors_set_up(struct tower *t);

void tower_sensors_settle(struct tower *t);

static inline bool tower_sensor_cut_off(const struct tower *t, int sensor)
{
	return sensor == 0 ? t->fault[TOWER_CABLE_S1] || t->fault[TOWER_SHORT_S1]
	                   : t->fault[TOWER_CABLE_S2] || t->fault[TOWER_SHORT_S2];
}

void tower_product_leave(struct tower *t);

#endif
