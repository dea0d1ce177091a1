/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/tower.h"

#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include "common/units.h"
#include "common/wire.h"
#include "hil/product.h"
#include "hil/sensor.h"

#define FLAG_HEIGHT_M 0.020 /* what breaks the beams */
#define BRAKE_SHARE 0.8     /* of the stroke, for a frame that fell freely down to the dampers */
#define RELIEVED_SHARE 0.25 /* of the braking that relieved dampers still give */
#define MAGNET_WEIGHTS 5.0  /* the magnet pulls this many times the product's weight */

/* Standard deviations from drop to drop. */
#define SCATTER_ANGLE_DEG 1.0
#define SCATTER_CASE 0.01
#define SCATTER_PLATE 0.02

enum { SENSORS = 2, AXES = 3, CHANNELS = SENSORS * AXES };

enum frame_state { FRAME_LATCHED, FRAME_MOVING, FRAME_STOPPED };

enum place { PLACE_PIN, PLACE_MAGNET, PLACE_AIR, PLACE_MAT };

/* What the frame passes on its way down, in this order. */
enum mark { MARK_GATE_UPPER, MARK_GATE_LOWER, MARK_DAMPERS, MARK_END, MARKS };

enum event { EVENT_LATCH, EVENT_DROPOUT, EVENT_MARK, EVENT_STOP, EVENT_MAT, EVENTS };

/* Uniformly accelerated, downwards positive; distance from where the drop began. */
struct motion {
	double since_s, distance_m, speed_m_s, acceleration_m_s2;
};

struct tower {
	struct scene scene;
	bool ideal;
	gsl_rng *scatter, *noise; /* apart, so that how often one converts does not change the next drop */
	double now_s;

	unsigned outputs;
	bool fault[TOWER_FAULTS];
	double latch_opens_s, magnet_drops_s; /* INFINITY: not under way */

	enum frame_state frame_state;
	struct motion frame;
	unsigned passed; /* marks */
	bool captured[2];
	uint32_t capture_us[2];

	enum place place;
	struct motion fall; /* of the lowest corner, in PLACE_AIR */
	struct product product;
	double mix[SENSORS][2][2]; /* this drop's gain and cross-axis errors */
	struct sensor sensor[CHANNELS];

	struct tower_truth truth;
};

static const char *const fault_names[TOWER_FAULTS] = {
        [TOWER_DOOR_OPEN] = "door_open",
        [TOWER_ESTOP] = "estop",
        [TOWER_SUPPLY_LOW] = "supply_low",
        [TOWER_DAMPERS_OUT] = "dampers_out",
        [TOWER_GATE_UPPER_DEAD] = "gate_upper_dead",
        [TOWER_GATE_LOWER_DEAD] = "gate_lower_dead",
        [TOWER_LATCH_STUCK] = "latch_stuck",
        [TOWER_MAGNET_WEAK] = "magnet_weak",
        [TOWER_CABLE_S1] = "cable_s1",
        [TOWER_CABLE_S2] = "cable_s2",
};

/* ---- uniform motion ---- */

static double motion_speed(const struct motion *m, double time_s)
{
	return m->speed_m_s + m->acceleration_m_s2 * (time_s - m->since_s);
}

static double motion_distance(const struct motion *m, double time_s)
{
	const double t = time_s - m->since_s;

	return m->distance_m + t * (m->speed_m_s + 0.5 * m->acceleration_m_s2 * t);
}

/* When it first gets there, INFINITY if never. */
static double motion_reach(const struct motion *m, double distance_m)
{
	const double way = fmax(distance_m - m->distance_m, 0);
	const double square = m->speed_m_s * m->speed_m_s + 2 * m->acceleration_m_s2 * way;
	double sum;

	if (way <= 0)
		return m->since_s;
	if (square < 0)
		return INFINITY;
	sum = m->speed_m_s + sqrt(square);
	return sum > 0 ? m->since_s + 2 * way / sum : INFINITY;
}

static double motion_stop(const struct motion *m)
{
	return m->acceleration_m_s2 < 0 ? m->since_s - m->speed_m_s / m->acceleration_m_s2 : INFINITY;
}

/* ---- sensors ---- */

/* Time went on by step_s; the sensors feel what the product now does. */
static void sensors_feel(struct tower *t, double step_s)
{
	const double z_ratio[SENSORS] = {t->scene.sensor_s1_z_ratio, t->scene.sensor_s2_z_ratio};
	struct product_reading r;

	product_read(&t->product, &r);
	for (int s = 0; s < SENSORS; s++) {
		const bool open = t->fault[s == 0 ? TOWER_CABLE_S1 : TOWER_CABLE_S2];
		const double x = (s == 0 ? r.s1_x : r.s2_x) / UNITS_G_M_S2;
		const double y = (s == 0 ? r.s1_y : r.s2_y) / UNITS_G_M_S2;
		const double felt_x = open ? 0 : t->mix[s][0][0] * x + t->mix[s][0][1] * y;
		const double felt_y = open ? 0 : t->mix[s][1][0] * x + t->mix[s][1][1] * y;
		struct sensor *sensor = &t->sensor[s * AXES];

		sensor_advance(&sensor[0], step_s, felt_x);
		sensor_advance(&sensor[1], step_s, felt_y);
		sensor_advance(&sensor[2], step_s, z_ratio[s] * felt_x);
	}
}

static void sensors_set_up(struct tower *t)
{
	for (int i = 0; i < CHANNELS; i++) {
		const bool open = t->fault[i < AXES ? TOWER_CABLE_S1 : TOWER_CABLE_S2];

		t->sensor[i].time_constant_s = t->ideal ? 0 : t->scene.sensor_iepe_time_constant_s;
		t->sensor[i].noise_g = t->ideal || open ? 0 : t->scene.sensor_noise_g;
	}
}

static void sensors_settle(struct tower *t)
{
	sensors_feel(t, 0);
	for (int i = 0; i < CHANNELS; i++)
		sensor_settle(&t->sensor[i], t->sensor[i].input_g);
}

/* ---- frame and product ---- */

static bool product_on_frame(const struct tower *t)
{
	return t->place == PLACE_PIN || t->place == PLACE_MAGNET;
}

static bool output_on(const struct tower *t, unsigned mask)
{
	return (t->outputs & mask) != 0;
}

static double frame_acceleration(const struct tower *t)
{
	const double product_kg =
	        product_on_frame(t) ? t->scene.product_case_mass_kg + t->scene.mount_plate_mass_kg : 0;
	double a =
	        UNITS_G_M_S2 - t->scene.tower_frame_friction_n / (t->scene.tower_frame_mass_kg + product_kg);

	if (t->frame_state != FRAME_MOVING)
		return 0;
	if (t->passed > MARK_DAMPERS && !t->fault[TOWER_DAMPERS_OUT]) {
		a = -UNITS_G_M_S2 * t->scene.tower_dampers_m / (BRAKE_SHARE * t->scene.tower_damper_stroke_m);
		if (output_on(t, WIRE_IO_DAMPERS_RELIEVE))
			a *= RELIEVED_SHARE;
	}
	return t->frame.speed_m_s > 0 ? a : fmax(a, 0); /* friction stops a frame but does not lift it */
}

/* Whether pin or magnet can give the product the frame's acceleration. */
static bool product_carried(const struct tower *t)
{
	if (t->place == PLACE_PIN)
		return true;
	if (t->fault[TOWER_MAGNET_WEAK] && t->frame_state == FRAME_MOVING)
		return false;
	return UNITS_G_M_S2 - frame_acceleration(t) <= MAGNET_WEIGHTS * UNITS_G_M_S2;
}

static void product_leave(struct tower *t)
{
	t->place = PLACE_AIR;
	t->magnet_drops_s = INFINITY;
	t->fall.since_s = t->now_s;
	t->fall.distance_m = motion_distance(&t->frame, t->now_s);
	t->fall.speed_m_s = motion_speed(&t->frame, t->now_s);
	t->fall.acceleration_m_s2 = UNITS_G_M_S2;
	product_carry(&t->product, UNITS_G_M_S2);
	t->truth.separation_s = t->now_s;
	t->truth.separation_travel_m = t->fall.distance_m;
	t->truth.frame_speed_at_separation_m_s = t->fall.speed_m_s;
}

/* To be called when something that moves the frame or holds the product has changed. */
static void motion_renew(struct tower *t)
{
	struct motion *f = &t->frame;
	const double distance_m = motion_distance(f, t->now_s), speed_m_s = motion_speed(f, t->now_s);

	*f = (struct motion){t->now_s, distance_m, speed_m_s, 0};
	if (product_on_frame(t) && !product_carried(t))
		product_leave(t);
	f->acceleration_m_s2 = frame_acceleration(t);
	if (product_on_frame(t))
		product_carry(&t->product, f->acceleration_m_s2);
}

static void frame_stop(struct tower *t, double distance_m)
{
	t->frame_state = FRAME_STOPPED;
	t->frame = (struct motion){t->now_s, distance_m, 0, 0};
}

/* ---- events ---- */

static double mark_travel(const struct tower *t, unsigned mark)
{
	switch (mark) {
	case MARK_GATE_UPPER:
		return t->scene.tower_gate_upper_m;
	case MARK_GATE_LOWER:
		return t->scene.tower_gate_lower_m;
	case MARK_DAMPERS:
		return t->scene.tower_dampers_m;
	case MARK_END:
		return t->scene.tower_dampers_m + t->scene.tower_damper_stroke_m;
	default:
		return INFINITY;
	}
}

/* The next event and its time, INFINITY if none is to come. */
static enum event event_next(const struct tower *t, double *time_s)
{
	const bool moving = t->frame_state == FRAME_MOVING;
	const double when[EVENTS] = {
	        [EVENT_LATCH] = t->latch_opens_s,
	        [EVENT_DROPOUT] = t->magnet_drops_s,
	        [EVENT_MARK] = moving ? motion_reach(&t->frame, mark_travel(t, t->passed)) : INFINITY,
	        [EVENT_STOP] = moving ? motion_stop(&t->frame) : INFINITY,
	        [EVENT_MAT] = t->place == PLACE_MAT
	                              ? INFINITY
	                              : motion_reach(t->place == PLACE_AIR ? &t->fall : &t->frame,
	                                             t->scene.drop_height_m),
	};
	enum event next = 0;

	for (enum event e = 1; e < EVENTS; e++) {
		if (when[e] < when[next])
			next = e;
	}
	*time_s = fmax(when[next], t->now_s);
	return next;
}

static void latch_opens(struct tower *t)
{
	t->latch_opens_s = INFINITY;
	if (t->frame_state != FRAME_LATCHED || t->fault[TOWER_LATCH_STUCK])
		return;
	t->frame_state = FRAME_MOVING;
	t->truth.latch_open_s = t->now_s;
	motion_renew(t);
}

static void gate_sees(struct tower *t, unsigned gate)
{
	if (t->fault[gate == 0 ? TOWER_GATE_UPPER_DEAD : TOWER_GATE_LOWER_DEAD])
		return;
	t->captured[gate] = true;
	t->capture_us[gate] = (uint32_t)(uint64_t)floor(t->now_s * 1e6);
}

static void frame_passes(struct tower *t)
{
	const double travel_m = mark_travel(t, t->passed);

	switch ((enum mark)t->passed++) {
	case MARK_GATE_UPPER:
		gate_sees(t, 0);
		break;
	case MARK_GATE_LOWER:
		gate_sees(t, 1);
		break;
	case MARK_DAMPERS:
		t->truth.frame_down_s = t->now_s;
		motion_renew(t);
		break;
	case MARK_END: /* the hard stop: nothing but the pin holds on */
		if (t->place == PLACE_MAGNET)
			product_leave(t);
		frame_stop(t, travel_m);
		motion_renew(t);
		break;
	case MARKS:
		break;
	}
}

static void product_lands(struct tower *t)
{
	if (product_on_frame(t)) { /* the mat knocks it off */
		product_leave(t);
		motion_renew(t);
	}
	t->place = PLACE_MAT;
	t->truth.impact_s = t->now_s;
	t->truth.impact_speed_m_s = motion_speed(&t->fall, t->now_s);
	product_strike(&t->product, t->truth.impact_speed_m_s);
}

static void event_happen(struct tower *t, enum event event)
{
	switch (event) {
	case EVENT_LATCH:
		latch_opens(t);
		break;
	case EVENT_DROPOUT:
		product_leave(t);
		motion_renew(t);
		break;
	case EVENT_MARK:
		frame_passes(t);
		break;
	case EVENT_STOP:
		frame_stop(t, motion_distance(&t->frame, t->now_s));
		motion_renew(t);
		break;
	case EVENT_MAT:
		product_lands(t);
		break;
	case EVENTS:
		break;
	}
	sensors_feel(t, 0);
}

/* No event until then. */
static void go_on(struct tower *t, double time_s)
{
	const double span_s = time_s - t->now_s;
	const bool contact = t->place == PLACE_MAT;
	const long steps = contact ? (long)ceil(span_s / PRODUCT_STEP_S) : 1;

	for (long i = 0; i < steps; i++) {
		if (contact)
			product_step(&t->product, span_s / (double)steps);
		sensors_feel(t, span_s / (double)steps);
	}
	t->now_s = time_s;
}

/* ---- what the bench calls ---- */

void tower_advance(struct tower *t, double time_s)
{
	double next_s;
	enum event next = event_next(t, &next_s);

	while (next_s <= time_s) {
		go_on(t, next_s);
		event_happen(t, next);
		next = event_next(t, &next_s);
	}
	if (time_s > t->now_s)
		go_on(t, time_s);
}

static void magnet_switch(struct tower *t, bool on)
{
	if (on && t->place == PLACE_PIN)
		t->place = PLACE_MAGNET;
	if (t->place != PLACE_MAGNET)
		return;
	t->magnet_drops_s = on ? INFINITY : t->now_s + t->scene.tower_magnet_dropout_s;
	t->truth.magnet_off_s = on ? NAN : t->now_s;
	motion_renew(t);
}

void tower_output(struct tower *t, unsigned bit, bool on, double time_s)
{
	const unsigned mask = bit < SENSORBUS_OUTPUTS ? 1u << bit : 0;

	tower_advance(t, time_s);
	if (mask == 0 || output_on(t, mask) == on)
		return;
	t->outputs ^= mask;
	if (mask == WIRE_IO_LATCH_OPEN)
		t->latch_opens_s = on ? t->now_s + t->scene.tower_latch_delay_s : INFINITY;
	if (mask == WIRE_IO_MAGNET_HOLD)
		magnet_switch(t, on);
	if (mask == WIRE_IO_DAMPERS_RELIEVE)
		motion_renew(t);
	sensors_feel(t, 0);
}

void tower_sample(struct tower *t, unsigned group, int16_t codes[CHANNELS])
{
	for (int i = 0; i < CHANNELS; i++) {
		const unsigned member = i % AXES == 0 ? SENSORBUS_X : SENSORBUS_YZ;

		if (group & member)
			codes[i] = sensor_convert(&t->sensor[i], t->noise);
	}
}

static bool gate_broken(const struct tower *t, enum mark mark, enum tower_fault dead)
{
	const double below_m = motion_distance(&t->frame, t->now_s) - mark_travel(t, mark);

	return !t->fault[dead] && below_m >= 0 && below_m < FLAG_HEIGHT_M;
}

uint16_t tower_inputs(const struct tower *t)
{
	const bool *fault = t->fault;
	const bool held = t->place == PLACE_MAGNET && output_on(t, WIRE_IO_MAGNET_HOLD);
	unsigned inputs = 0;

	inputs |= t->frame_state == FRAME_LATCHED ? WIRE_IO_LATCH_CLOSED : 0;
	inputs |= held ? WIRE_IO_PRODUCT_HELD : 0;
	inputs |= fault[TOWER_DAMPERS_OUT] ? 0 : WIRE_IO_DAMPERS_ENGAGED;
	inputs |= fault[TOWER_DOOR_OPEN] ? 0 : WIRE_IO_DOOR_CLOSED;
	inputs |= fault[TOWER_ESTOP] ? 0 : WIRE_IO_ESTOP_CLEAR;
	inputs |= fault[TOWER_SUPPLY_LOW] ? 0 : WIRE_IO_SUPPLY_GOOD;
	inputs |= gate_broken(t, MARK_GATE_UPPER, TOWER_GATE_UPPER_DEAD) ? WIRE_IO_GATE_UPPER : 0;
	inputs |= gate_broken(t, MARK_GATE_LOWER, TOWER_GATE_LOWER_DEAD) ? WIRE_IO_GATE_LOWER : 0;
	inputs |= t->passed > MARK_DAMPERS ? WIRE_IO_FRAME_DOWN : 0;
	inputs |= fault[TOWER_CABLE_S1] ? 0 : WIRE_IO_IEPE_S1;
	inputs |= fault[TOWER_CABLE_S2] ? 0 : WIRE_IO_IEPE_S2;
	return (uint16_t)inputs;
}

bool tower_capture(struct tower *t, unsigned gate, uint32_t *time_us)
{
	if (gate > 1 || !t->captured[gate])
		return false;
	t->captured[gate] = false;
	*time_us = t->capture_us[gate];
	return true;
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
	if (fault == TOWER_LATCH_STUCK && !on && output_on(t, WIRE_IO_LATCH_OPEN))
		t->latch_opens_s = t->now_s;
	sensors_set_up(t);
	motion_renew(t);
	sensors_feel(t, 0);
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
	t->captured[0] = t->captured[1] = false;
	t->place = output_on(t, WIRE_IO_MAGNET_HOLD) ? PLACE_MAGNET : PLACE_PIN;
	t->magnet_drops_s = INFINITY;
	t->truth = (struct tower_truth){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
	scatter_draw(t);
	product_init(&t->product, &t->scene, UNITS_RAD(t->truth.angle_deg));
	product_carry(&t->product, 0);
	sensors_settle(t);
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
	sensors_set_up(t);
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
