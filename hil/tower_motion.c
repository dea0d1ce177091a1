/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "common/units.h"
#include "hil/tower_private.h"

#define BRAKE_SHARE 0.8     /* of the stroke, for a frame that fell freely down to the dampers */
#define RELIEVED_SHARE 0.25 /* of the braking that relieved dampers still give */
#define MAGNET_WEIGHTS 5.0  /* the magnet pulls this many times the product's weight */
#define JAM_WEIGHTS 3.0     /* a frame that jams is slowed down with so many g: the product stays on */
#define KNOCK_STEPS 100     /* of its one swing */
#define SPIN_STEPS 40       /* each takes a digit or more off when a spinning corner lands */

/* ---- uniform motion ---- */

static double motion_speed(const struct motion *m, double time_s)
{
	return m->speed_m_s + m->acceleration_m_s2 * (time_s - m->since_s);
}

double tower_motion_distance(const struct motion *m, double time_s)
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
	/* all have the same supply */
	const struct sensor_fading fading = sensor_fading(t->sensor[0].time_constant_s, step_s);
	struct product_reading r;

	product_read(&t->product, &r);
	for (int s = 0; s < SENSORS; s++) {
		const bool off = tower_sensor_cut_off(t, s);
		const double x = (s == 0 ? r.s1_x : r.s2_x) / UNITS_G_M_S2;
		const double y = (s == 0 ? r.s1_y : r.s2_y) / UNITS_G_M_S2;
		const double felt_x = off ? 0 : t->mix[s][0][0] * x + t->mix[s][0][1] * y;
		const double felt_y = off ? 0 : t->mix[s][1][0] * x + t->mix[s][1][1] * y;
		const double sign = t->fault[TOWER_S1_REVERSED + s] ? -1 : 1;
		struct sensor *sensor = &t->sensor[s * AXES];

		sensor_advance(&sensor[0], fading, sign * felt_x);
		sensor_advance(&sensor[1], fading, sign * felt_y);
		sensor_advance(&sensor[2], fading, z_ratio[s] * felt_x);
	}
}

static bool sensors_are_settled(const struct tower *t)
{
	double sum_g = 0;

	for (int i = 0; i < CHANNELS; i++)
		sum_g += fabs(t->sensor[i].output_g);
	return sum_g == 0;
}

/* The product does what it did. */
static void sensors_feel_the_same(struct tower *t, double step_s)
{
	struct sensor_fading fading;

	if (sensors_are_settled(t))
		return;
	fading = sensor_fading(t->sensor[0].time_constant_s, step_s);
	for (int i = 0; i < CHANNELS; i++)
		sensor_advance(&t->sensor[i], fading, t->sensor[i].input_g);
}

void tower_sensors_set_up(struct tower *t)
{
	for (int i = 0; i < CHANNELS; i++) {
		const bool off = tower_sensor_cut_off(t, i / AXES);

		t->sensor[i].time_constant_s = t->ideal ? 0 : t->scene.sensor_iepe_time_constant_s;
		t->sensor[i].noise_g = t->ideal || off ? 0 : t->scene.sensor_noise_g;
	}
}

void tower_sensors_settle(struct tower *t)
{
	tower_happened(t);
	for (int i = 0; i < CHANNELS; i++)
		sensor_settle(&t->sensor[i], t->sensor[i].input_g);
}

/* ---- frame and product ---- */

static bool product_on_frame(const struct tower *t)
{
	return t->place == PLACE_PIN || t->place == PLACE_MAGNET;
}

static double frame_acceleration(const struct tower *t)
{
	const double product_kg =
	        product_on_frame(t) ? t->scene.product_case_mass_kg + t->scene.mount_plate_mass_kg : 0;
	double a = t->scene.drop_gravity_m_s2 -
	           t->scene.tower_frame_friction_n / (t->scene.tower_frame_mass_kg + product_kg);

	if (t->frame_state != FRAME_MOVING)
		return 0;
	if (t->passed > MARK_DAMPERS && !t->fault[TOWER_DAMPERS_OUT]) {
		a = -t->scene.drop_gravity_m_s2 * t->scene.tower_dampers_m /
		    (BRAKE_SHARE * t->scene.tower_damper_stroke_m);
		if (output_on(t, WIRE_IO_DAMPERS_RELIEVE))
			a *= RELIEVED_SHARE;
	} else if (t->fault[TOWER_FRAME_JAMMED]) {
		a = -JAM_WEIGHTS * UNITS_G_M_S2;
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
	return t->scene.drop_gravity_m_s2 - frame_acceleration(t) <=
	       MAGNET_WEIGHTS * t->scene.drop_gravity_m_s2;
}

void tower_product_leave(struct tower *t)
{
	t->place = PLACE_AIR;
	tower_stamp(t, KEEPER);
	t->magnet_drops_s = INFINITY;
	t->fall.since_s = t->now_s;
	t->fall.distance_m = tower_motion_distance(&t->frame, t->now_s);
	t->fall.speed_m_s = motion_speed(&t->frame, t->now_s);
	t->fall.acceleration_m_s2 = t->scene.drop_gravity_m_s2;
	t->taut = false;
	t->spin_rad_s = 0;
	product_carry(&t->product, t->scene.drop_gravity_m_s2);
	t->truth.separation_s = t->now_s;
	t->truth.separation_travel_m = t->fall.distance_m;
	t->truth.frame_speed_at_separation_m_s = t->fall.speed_m_s;
}

void tower_motion_renew(struct tower *t)
{
	struct motion *f = &t->frame;
	const double distance_m = tower_motion_distance(f, t->now_s), speed_m_s = motion_speed(f, t->now_s);

	*f = (struct motion){t->now_s, distance_m, speed_m_s, 0};
	if (product_on_frame(t) && !product_carried(t))
		tower_product_leave(t);
	f->acceleration_m_s2 = frame_acceleration(t);
	if (product_on_frame(t))
		product_carry(&t->product, f->acceleration_m_s2);
}

static void frame_stop(struct tower *t, double distance_m)
{
	t->frame_state = FRAME_STOPPED;
	t->truth.frame_moving = false;
	t->frame = (struct motion){t->now_s, distance_m, 0, 0};
}

/* What the frame's swing, as the latch opens, adds to what its product feels. */
static double frame_knock(const struct tower *t, double time_s)
{
	const double hz = t->scene.tower_knock_hz;

	return -t->scene.tower_knock_g * UNITS_G_M_S2 * sin(2 * UNITS_PI * hz * (t->calm_s - time_s));
}

/* When the wires have no slack left: the product runs ahead of the frame. */
static double product_taut(const struct tower *t)
{
	const struct motion *a = &t->fall, *b = &t->frame;
	const struct motion ahead = {
	        t->now_s,
	        tower_motion_distance(a, t->now_s) - tower_motion_distance(b, t->now_s),
	        motion_speed(a, t->now_s) - motion_speed(b, t->now_s),
	        a->acceleration_m_s2 - b->acceleration_m_s2,
	};

	return t->taut || t->scene.tower_wire_pull_ratio <= 0
	               ? INFINITY
	               : motion_reach(&ahead, t->scene.tower_wire_slack_m);
}

/* How far the lowest corner is below the centre of gravity. */
static double product_reach(const struct tower *t, double time_s)
{
	const double turned = t->spin_rad_s * (time_s - t->truth.separation_s);
	const double angle = t->product.state[PRODUCT_ANGLE] + turned;

	return fabs(t->product.lever_x_m * cos(angle)) + fabs(t->product.lever_y_m * sin(angle));
}

/* When the lowest corner is at the mat. */
static double product_landing(const struct tower *t)
{
	const double height_m = t->scene.drop_height_m;
	double time_s;

	if (t->place == PLACE_MAT)
		return INFINITY;
	time_s = motion_reach(t->place == PLACE_AIR ? &t->fall : &t->frame, height_m);
	if (t->place != PLACE_AIR || t->spin_rad_s == 0)
		return time_s;
	for (int i = 0; i < SPIN_STEPS; i++)
		time_s = motion_reach(&t->fall, height_m + product_reach(t, t->truth.separation_s) -
		                                        product_reach(t, time_s));
	return time_s;
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

static void event_plan(struct tower *t)
{
	const bool moving = t->frame_state == FRAME_MOVING;
	const double when[EVENTS] = {
	        [EVENT_LATCH] = t->latch_opens_s,
	        [EVENT_DROPOUT] = t->magnet_drops_s,
	        [EVENT_MARK] = moving ? motion_reach(&t->frame, mark_travel(t, t->passed)) : INFINITY,
	        [EVENT_STOP] = moving ? motion_stop(&t->frame) : INFINITY,
	        [EVENT_CALM] = t->calm_s,
	        [EVENT_TAUT] = t->place == PLACE_AIR ? product_taut(t) : INFINITY,
	        [EVENT_MAT] = product_landing(t),
	};

	t->next = 0;
	for (enum event e = 1; e < EVENTS; e++) {
		if (when[e] < when[t->next])
			t->next = e;
	}
	t->next_s = fmax(when[t->next], t->now_s);
}

void tower_happened(struct tower *t)
{
	sensors_feel(t, 0);
	event_plan(t);
	t->inputs = tower_inputs_but_gates(t);
}

static void latch_opens(struct tower *t)
{
	t->latch_opens_s = INFINITY;
	if (t->frame_state != FRAME_LATCHED || t->fault[TOWER_LATCH_STUCK])
		return;
	t->frame_state = FRAME_MOVING;
	t->truth.latch_open_s = t->now_s;
	t->truth.frame_away = t->truth.frame_moving = true;
	if (t->scene.tower_knock_g > 0)
		t->calm_s = t->now_s + 1 / t->scene.tower_knock_hz;
	tower_motion_renew(t);
}

static void gate_sees(struct tower *t, unsigned gate)
{
	if (!t->fault[TOWER_GATE_UPPER_DEAD + gate] && !t->fault[TOWER_GATE_UPPER_WIRE + gate])
		tower_stamp(t, gate);
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
		t->truth.frame_away = false;
		tower_motion_renew(t);
		break;
	case MARK_END: /* the hard stop: nothing but the pin holds on */
		if (t->place == PLACE_MAGNET)
			tower_product_leave(t);
		frame_stop(t, travel_m);
		tower_motion_renew(t);
		break;
	case MARKS:
		break;
	}
}

static void product_lands(struct tower *t)
{
	if (product_on_frame(t)) { /* the mat knocks it off */
		tower_product_leave(t);
		tower_motion_renew(t);
	}
	t->place = PLACE_MAT;
	t->product.state[PRODUCT_ANGLE] += t->spin_rad_s * (t->now_s - t->truth.separation_s);
	if (t->spin_rad_s != 0)
		t->truth.angle_deg = UNITS_DEG(t->product.state[PRODUCT_ANGLE]);
	t->truth.impact_s = t->now_s;
	t->truth.impact_speed_m_s = motion_speed(&t->fall, t->now_s);
	product_strike(&t->product, t->truth.impact_speed_m_s);
}

static void wires_pull(struct tower *t)
{
	const double a = (1 - t->scene.tower_wire_pull_ratio) * t->scene.drop_gravity_m_s2;
	const double distance_m = tower_motion_distance(&t->fall, t->now_s);

	t->fall = (struct motion){t->now_s, distance_m, motion_speed(&t->fall, t->now_s), a};
	t->taut = true;
	product_carry(&t->product, a);
}

static void event_happen(struct tower *t, enum event event)
{
	switch (event) {
	case EVENT_LATCH:
		latch_opens(t);
		break;
	case EVENT_DROPOUT:
		tower_product_leave(t);
		t->spin_rad_s = t->product.state[PRODUCT_SPIN] = UNITS_RAD(t->scene.tower_magnet_kick_deg_s);
		tower_motion_renew(t);
		break;
	case EVENT_MARK:
		frame_passes(t);
		break;
	case EVENT_STOP:
		frame_stop(t, tower_motion_distance(&t->frame, t->now_s));
		tower_motion_renew(t);
		break;
	case EVENT_CALM:
		t->calm_s = INFINITY;
		tower_motion_renew(t);
		break;
	case EVENT_TAUT:
		wires_pull(t);
		break;
	case EVENT_MAT:
		product_lands(t);
		break;
	case EVENTS:
		break;
	}
	tower_happened(t);
}

static bool knocked(const struct tower *t)
{
	return product_on_frame(t) && isfinite(t->calm_s);
}

/* One step, to that time at most; returns its length. */
static double step_on(struct tower *t, double time_s)
{
	const double span_s = time_s - t->now_s;
	double step_s = span_s;

	if (knocked(t)) {
		step_s = fmin(span_s, 1 / (KNOCK_STEPS * t->scene.tower_knock_hz));
		product_carry(&t->product, t->frame.acceleration_m_s2 - frame_knock(t, t->now_s + step_s));
	} else {
		step_s = product_step(&t->product, span_s);
	}
	sensors_feel(t, step_s);
	return step_s;
}

/* No event until then. */
static void go_on(struct tower *t, double time_s)
{
	while (t->now_s < time_s && (knocked(t) || (t->place == PLACE_MAT && !t->product.at_rest)))
		t->now_s = fmin(t->now_s + step_on(t, time_s), time_s);
	if (t->now_s < time_s)
		sensors_feel_the_same(t, time_s - t->now_s);
	t->now_s = time_s;
}

void tower_advance(struct tower *t, double time_s)
{
	while (t->next_s <= time_s) {
		go_on(t, t->next_s);
		event_happen(t, t->next);
	}
	if (time_s > t->now_s)
		go_on(t, time_s);
}
