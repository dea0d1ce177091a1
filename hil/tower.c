/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_randist.h>

#include "common/units.h"
#include "hil/tower_private.h"

#define FLAG_HEIGHT_M 0.020 /* what breaks the beams */

/* Standard deviations from drop to drop. */
#define SCATTER_ANGLE_DEG 1.0
#define SCATTER_CASE 0.01
#define SCATTER_PLATE 0.02

static const char *const fault_names[TOWER_FAULTS] = {
        [TOWER_DOOR_OPEN] = "door_open",
        [TOWER_ESTOP] = "estop",
        [TOWER_SUPPLY_LOW] = "supply_low",
        [TOWER_DAMPERS_OUT] = "dampers_out",
        [TOWER_GATE_UPPER_DEAD] = "gate_upper_dead",
        [TOWER_GATE_LOWER_DEAD] = "gate_lower_dead",
        [TOWER_GATE_UPPER_WIRE] = "gate_upper_wire",
        [TOWER_GATE_LOWER_WIRE] = "gate_lower_wire",
        [TOWER_FRAME_DOWN_WIRE] = "frame_down_wire",
        [TOWER_FRAME_READS_UP] = "frame_reads_up",
        [TOWER_LATCH_READS_CLOSED] = "latch_reads_closed",
        [TOWER_LATCH_READS_OPEN] = "latch_reads_open",
        [TOWER_FRAME_JAMMED] = "frame_jammed",
        [TOWER_LATCH_STUCK] = "latch_stuck",
        [TOWER_MAGNET_WEAK] = "magnet_weak",
        [TOWER_MAGNET_STUCK] = "magnet_stuck",
        [TOWER_CABLE_S1] = "cable_s1",
        [TOWER_CABLE_S2] = "cable_s2",
        [TOWER_SHORT_S1] = "short_s1",
        [TOWER_SHORT_S2] = "short_s2",
        [TOWER_SENSORS_SWAPPED] = "sensors_swapped",
        [TOWER_S1_REVERSED] = "s1_reversed",
        [TOWER_S2_REVERSED] = "s2_reversed",
};

/* ---- what the bench calls ---- */

static void magnet_switch(struct tower *t, bool on)
{
	if (on && t->place == PLACE_PIN)
		t->place = PLACE_MAGNET;
	if (t->place != PLACE_MAGNET)
		return;
	t->magnet_drops_s =
	        on || t->fault[TOWER_MAGNET_STUCK] ? INFINITY : t->now_s + t->scene.tower_magnet_dropout_s;
	t->truth.magnet_off_s = on ? NAN : t->now_s;
	tower_motion_renew(t);
}

/* The latch's coil follows its output as long as the contacts in series with it are closed. */
static void latch_switch(struct tower *t)
{
	const bool on = output_on(t, WIRE_IO_LATCH_OPEN);

	if (on == t->latch_energised)
		return;
	t->latch_energised = on;
	t->latch_opens_s = on ? t->now_s + t->scene.tower_latch_delay_s : INFINITY;
}

void tower_output(struct tower *t, unsigned bit, bool on, double time_s)
{
	const unsigned mask = bit < SENSORBUS_OUTPUTS ? 1u << bit : 0;

	tower_advance(t, time_s);
	if (mask == 0 || ((t->outputs & mask) != 0) == on)
		return;
	t->outputs ^= mask;
	latch_switch(t);
	if (mask == WIRE_IO_MAGNET_HOLD)
		magnet_switch(t, on);
	if (mask == WIRE_IO_DAMPERS_RELIEVE)
		tower_motion_renew(t);
	tower_happened(t);
}

/* The sensor on a cable. */
static int plugged(const struct tower *t, int cable)
{
	return t->fault[TOWER_SENSORS_SWAPPED] ? SENSORS - 1 - cable : cable;
}

void tower_sample(struct tower *t, unsigned group, int16_t codes[CHANNELS])
{
	const int first = group & SENSORBUS_X ? 0 : 1, end = group & SENSORBUS_YZ ? AXES : 1;

	for (int cable = 0; cable < SENSORS; cable++) {
		const int from = plugged(t, cable) * AXES;

		for (int axis = first; axis < end; axis++) {
			codes[cable * AXES + axis] =
			        sensor_convert(&t->sensor[from + axis], t->spike_g[from + axis], t->noise);
			t->spike_g[from + axis] = 0;
		}
	}
}

void tower_spike(struct tower *t, unsigned sensor, double spike_g)
{
	for (unsigned axis = 0; sensor < SENSORS && axis < AXES; axis++)
		t->spike_g[sensor * AXES + axis] += spike_g;
}

static bool gate_broken(const struct tower *t, double below_m, unsigned gate)
{
	return t->fault[TOWER_GATE_UPPER_WIRE + gate] ||
	       (!t->fault[TOWER_GATE_UPPER_DEAD + gate] && below_m >= 0 && below_m < FLAG_HEIGHT_M);
}

static bool latch_reads_closed(const struct tower *t)
{
	return t->fault[TOWER_LATCH_READS_CLOSED] ||
	       (t->frame_state == FRAME_LATCHED && !t->fault[TOWER_LATCH_READS_OPEN]);
}

static bool frame_reads_down(const struct tower *t)
{
	return t->fault[TOWER_FRAME_DOWN_WIRE] ||
	       (t->passed > MARK_DAMPERS && !t->fault[TOWER_FRAME_READS_UP]);
}

unsigned tower_inputs_but_gates(const struct tower *t)
{
	const bool *fault = t->fault;
	const bool held = t->place == PLACE_PIN || t->place == PLACE_MAGNET;
	unsigned inputs = 0;

	inputs |= latch_reads_closed(t) ? WIRE_IO_LATCH_CLOSED : 0;
	inputs |= held ? WIRE_IO_PRODUCT_HELD : 0;
	inputs |= fault[TOWER_DAMPERS_OUT] ? 0 : WIRE_IO_DAMPERS_ENGAGED;
	inputs |= fault[TOWER_DOOR_OPEN] ? 0 : WIRE_IO_DOOR_CLOSED;
	inputs |= fault[TOWER_ESTOP] ? 0 : WIRE_IO_ESTOP_CLEAR;
	inputs |= fault[TOWER_SUPPLY_LOW] ? 0 : WIRE_IO_SUPPLY_GOOD;
	inputs |= frame_reads_down(t) ? WIRE_IO_FRAME_DOWN : 0;
	inputs |= tower_sensor_cut_off(t, plugged(t, 0)) ? 0 : WIRE_IO_IEPE_S1;
	inputs |= tower_sensor_cut_off(t, plugged(t, 1)) ? 0 : WIRE_IO_IEPE_S2;
	return inputs;
}

uint16_t tower_inputs(const struct tower *t)
{
	const double travel_m = tower_motion_distance(&t->frame, t->now_s);
	unsigned inputs = t->inputs;

	inputs |= gate_broken(t, travel_m - t->scene.tower_gate_upper_m, 0) ? WIRE_IO_GATE_UPPER : 0;
	inputs |= gate_broken(t, travel_m - t->scene.tower_gate_lower_m, 1) ? WIRE_IO_GATE_LOWER : 0;
	return (uint16_t)inputs;
}

uint8_t tower_bias_high(const struct tower *t)
{
	const bool *open = &t->fault[TOWER_CABLE_S1];

	return (uint8_t)(open[plugged(t, 0)] | open[plugged(t, 1)] << 1);
}

void tower_stamp(struct tower *t, unsigned which)
{
	t->captured[which] = true;
	t->capture_us[which] = (uint32_t)(uint64_t)floor(t->now_s * 1e6);
}

bool tower_capture(struct tower *t, unsigned which, uint32_t *time_us)
{
	if (which >= SENSORBUS_CAPTURES)
		return false;
	if (which < KEEPER && !t->captured[which] && t->glitches[which] > 0) {
		t->glitches[which]--;
		tower_stamp(t, which);
	}
	if (!t->captured[which])
		return false;
	t->captured[which] = false;
	*time_us = t->capture_us[which];
	return true;
}

void tower_glitch(struct tower *t, unsigned gate, unsigned pulses)
{
	if (gate < KEEPER)
		t->glitches[gate] += pulses;
}

void tower_set_dropout(struct tower *t, double dropout_s)
{
	t->scene.tower_magnet_dropout_s = dropout_s;
}

void tower_set_friction(struct tower *t, double friction_n)
{
	t->scene.tower_frame_friction_n = friction_n;
	tower_motion_renew(t);
	tower_happened(t);
}

void tower_let_go(struct tower *t)
{
	if (t->place != PLACE_PIN && t->place != PLACE_MAGNET)
		return;
	tower_product_leave(t);
	tower_motion_renew(t);
	tower_happened(t);
}

const struct tower_truth *tower_truth(const struct tower *t)
{
	return &t->truth;
}

void tower_fault(struct tower *t, enum tower_fault fault, bool on)
{
	if (fault >= TOWER_FAULTS || t->fault[fault] == on)
		return;
	t->fault[fault] = on;
	latch_switch(t);
	if (fault == TOWER_LATCH_STUCK && !on && output_on(t, WIRE_IO_LATCH_OPEN))
		t->latch_opens_s = t->now_s;
	if (on && (fault == TOWER_GATE_UPPER_WIRE || fault == TOWER_GATE_LOWER_WIRE))
		tower_stamp(t, fault - TOWER_GATE_UPPER_WIRE); /* the line's edge */
	if (fault == TOWER_MAGNET_STUCK && t->place == PLACE_MAGNET && !output_on(t, WIRE_IO_MAGNET_HOLD))
		t->magnet_drops_s = on ? INFINITY : t->now_s + t->scene.tower_magnet_dropout_s;
	if (fault == TOWER_FRAME_JAMMED && !on && t->frame_state == FRAME_STOPPED &&
	    t->passed <= MARK_DAMPERS) {
		t->frame_state = FRAME_MOVING;
		t->truth.frame_moving = true;
	}
	tower_sensors_set_up(t);
	tower_motion_renew(t);
	tower_happened(t);
}

bool tower_has_fault(const struct tower *t, enum tower_fault fault)
{
	return fault < TOWER_FAULTS && t->fault[fault];
}

const char *tower_fault_name(enum tower_fault fault)
{
	return fault < TOWER_FAULTS ? fault_names[fault] : NULL;
}

/* An error of each component in proportion to the resultant, the two independent of each other. */
static void scatter_draw(struct tower *t)
{
	const double s1 = t->scene.mount_plate_mass_kg > 0 ? SCATTER_PLATE : SCATTER_CASE;
	const double sigma[SENSORS] = {t->ideal ? 0 : s1, t->ideal ? 0 : SCATTER_CASE};

	t->truth.angle_deg = t->scene.drop_angle_deg +
	                     gsl_ran_gaussian_ziggurat(t->scatter, t->ideal ? 0 : SCATTER_ANGLE_DEG);
	for (int s = 0; s < SENSORS; s++) {
		for (int i = 0; i < 4; i++)
			t->mix[s][i / 2][i % 2] =
			        (i % 3 == 0 ? 1 : 0) + gsl_ran_gaussian_ziggurat(t->scatter, sigma[s]);
	}
}

void tower_lift(struct tower *t)
{
	t->frame_state = FRAME_LATCHED;
	t->frame = (struct motion){t->now_s, 0, 0, 0};
	t->latch_opens_s = output_on(t, WIRE_IO_LATCH_OPEN) ? t->now_s : INFINITY;
	t->passed = 0;
	for (unsigned i = 0; i < SENSORBUS_CAPTURES; i++)
		t->captured[i] = false;
	t->place = output_on(t, WIRE_IO_MAGNET_HOLD) ? PLACE_MAGNET : PLACE_PIN;
	t->magnet_drops_s = t->calm_s = INFINITY;
	t->truth = (struct tower_truth){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, false, false};
	scatter_draw(t);
	product_init(&t->product, &t->scene, UNITS_RAD(t->truth.angle_deg));
	product_carry(&t->product, 0);
	tower_sensors_settle(t);
}

/* The generator takes 32 bits: the halves of the seed together, and which stream it is. */
static gsl_rng *generator(uint64_t seed, uint32_t stream)
{
	gsl_rng *rng = gsl_rng_alloc(gsl_rng_mt19937);

	if (rng)
		gsl_rng_set(rng, (uint32_t)(seed ^ seed >> 32) ^ stream);
	return rng;
}

struct tower *tower_create(const struct scene *scene, const struct tower_options *options)
{
	struct tower *t = calloc(1, sizeof(*t));

	if (!t)
		return NULL;
	gsl_set_error_handler_off();
	t->scene = *scene;
	t->ideal = options->ideal;
	t->scatter = generator(options->seed, 0);
	t->noise = generator(options->seed, 0x6E6F6973);
	if (!t->scatter || !t->noise) {
		tower_destroy(t);
		return NULL;
	}
	tower_sensors_set_up(t);
	tower_lift(t);
	return t;
}

void tower_destroy(struct tower *t)
{
	if (!t)
		return;
	gsl_rng_free(t->scatter);
	gsl_rng_free(t->noise);
	free(t);
}
