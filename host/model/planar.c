/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/planar.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/model/root.h"

/* Relative to where the drop began, in the room's axes. How far the box went across matters to nothing. */
enum {
	UP,
	TURN,
	GRIP,
	V_ACROSS,
	V_UP,
	SPIN,
	PLATE, /* the first of the plate's own */
};

/* The plate's, relative to the box. */
enum { OFF_ACROSS, OFF_UP, OFF_V_ACROSS, OFF_V_UP, OFF_STATES, STATES = PLATE + OFF_STATES };

/* A corner that has not left the mat after this many contact times will not. */
#define CONTACTS_MAX 3.0

/* First step, in times the box needs at impact speed for the largest depth. */
#define FIRST_STEP 1e-3
#define FIRST_STEP_ROUGH 0.1

/* The plate's first extreme after the release is not later than this share of its period. */
#define FLIGHT_SHARE 0.6

/* Beyond the friction limit the mat's tangential deflection stops over this share of it: stopped at once, it
 * would chatter wherever the limit grows while the corner slips. */
#define SLIP_RAMP 0.02

/* Plate over box up to which the box cannot be shaken harder by the plate than by the mat. */
#define LIGHT_PLATE 0.25

#define SMALL_TURN 0.05

/* A resultant that fell below this share of its peak does not rise above it again. */
#define PASSED_SHARE 0.7

/* What is followed only to count oscillations may be so much coarser. */
#define RING_COARSER 20.0

enum { RING_CROSSINGS = 6, RING_PERIODS = RING_CROSSINGS / 2 };

/* The drop and what is worked out once for it. */
struct body {
	const struct planar *in;
	double cosine, sine; /* of the angle at the touch */
	double corner_up_m;  /* of the contact corner from the centre of gravity at the touch */
	double yaw_cosine, yaw_sine;
	double softening_per_m2; /* 1/u_s^2 */
	double contact_end_s;    /* whoever has not left the mat by then will not */
	double per_mass;         /* 1/m_p + 1/m_B */
	double period_s;         /* of the plate */
};

/* What acts on the box. */
struct load {
	double cosine, sine;           /* of the angle from the vertical to X */
	double normal, along;          /* contact force, N */
	double mount_across, mount_up; /* N */
	double lever_across, lever_up; /* contact corner from the centre of gravity, m */
	double depth;
	double creep; /* rate of the tangential deflection */
};

static double planar_corner_up(const struct planar *p, double cosine, double sine)
{
	return -(p->lever_x_m * cosine + p->lever_y_m * sine);
}

static struct body body_of(const struct planar *p)
{
	struct body b = {
	        .in = p,
	        .cosine = cos(p->angle_rad),
	        .sine = sin(p->angle_rad),
	        .corner_up_m = planar_corner_up(p, cos(p->angle_rad), sin(p->angle_rad)),
	        .yaw_cosine = cos(p->s1_yaw_rad),
	        .yaw_sine = sin(p->s1_yaw_rad),
	};

	b.contact_end_s =
	        CONTACTS_MAX * contact_duration(&p->law, p->case_mass_kg, p->speed_m_s, p->stiffness_n_m15);
	if (p->softening > 0.0)
		b.softening_per_m2 = 1.0 / (p->softening_m * p->softening_m);
	if (p->plate_mass_kg > 0.0) {
		b.per_mass = 1.0 / p->plate_mass_kg + 1.0 / p->case_mass_kg;
		b.period_s = 2.0 * UNITS_PI / sqrt(p->mount_n_m * b.per_mass);
	}
	return b;
}

static void press(const struct planar *p, const double y[], struct load *l)
{
	double closing = y[SPIN] * l->lever_across - y[V_UP];
	double sliding = y[V_ACROSS] + y[SPIN] * l->lever_up;
	double root = sqrt(l->depth), most, over;

	l->normal = p->stiffness_n_m15 * l->depth * root * (1.0 + p->law.damping * closing / p->speed_m_s);
	if (!(l->normal > 0.0)) {
		l->normal = 0.0;
		return;
	}
	if (!(p->grip > 0.0))
		return;
	most = p->friction * l->normal;
	l->along = -1.5 * p->grip * p->stiffness_n_m15 * root * y[GRIP];
	l->creep = sliding;
	over = fabs(l->along) / most - 1.0;
	if (over > 0.0) {
		l->along = l->along < 0.0 ? -most : most;
		if (sliding * y[GRIP] > 0.0)
			l->creep = over < SLIP_RAMP ? sliding * (1.0 - over / SLIP_RAMP) : 0.0;
	}
}

static void pull(const struct body *b, const double off[], double spin, struct load *l)
{
	double far2 = off[OFF_ACROSS] * off[OFF_ACROSS] + off[OFF_UP] * off[OFF_UP];
	double k = b->in->mount_n_m * (1.0 + b->in->softening / (1.0 + far2 * b->softening_per_m2));
	double c = b->in->mount_damping_n_s_m, turn = b->in->mounts_turn ? spin : 0.0;

	/* SPIN is clockwise: seen from the box, what stands still in the room turns the other way */
	l->mount_across = k * off[OFF_ACROSS] + c * (off[OFF_V_ACROSS] - turn * off[OFF_UP]);
	l->mount_up = k * off[OFF_UP] + c * (off[OFF_V_UP] + turn * off[OFF_ACROSS]);
}

/* Of the angle at the touch plus turn. A box turns little during a contact: series are exact to the last
 * digit below SMALL_TURN and cost less. */
static void planar_turned(const struct body *b, double turn, double *cosine, double *sine)
{
	double t2 = turn * turn, c, s;

	if (t2 < SMALL_TURN * SMALL_TURN) {
		c = 1.0 - t2 / 2.0 * (1.0 - t2 / 12.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0)));
		s = turn * (1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0)));
	} else {
		c = cos(turn);
		s = sin(turn);
	}
	*cosine = b->cosine * c - b->sine * s;
	*sine = b->sine * c + b->cosine * s;
}

static struct load load_of(const struct body *b, const double y[])
{
	const struct planar *p = b->in;
	struct load l = {.normal = 0.0};

	planar_turned(b, y[TURN], &l.cosine, &l.sine);
	l.lever_across = p->lever_y_m * l.cosine - p->lever_x_m * l.sine;
	l.lever_up = planar_corner_up(p, l.cosine, l.sine);
	l.depth = b->corner_up_m - l.lever_up - y[UP];
	if (l.depth > 0.0)
		press(p, y, &l);
	if (p->plate_mass_kg > 0.0)
		pull(b, y + PLATE, y[SPIN], &l);
	return l;
}

/* Clockwise, as TURN is. */
static double angular_acceleration(const struct planar *p, const struct load *l)
{
	return (l->lever_up * l->along - l->lever_across * l->normal) / p->inertia_kg_m2;
}

static void planar_rates(const void *context, const double y[], double rate[])
{
	const struct body *b = context;
	const struct planar *p = b->in;
	const struct load l = load_of(b, y);
	double across = (l.along + l.mount_across) / p->case_mass_kg;
	double up = (l.normal + l.mount_up) / p->case_mass_kg;

	rate[UP] = y[V_UP];
	rate[TURN] = y[SPIN];
	rate[GRIP] = l.creep;
	rate[V_ACROSS] = across;
	rate[V_UP] = up - p->gravity_m_s2;
	rate[SPIN] = angular_acceleration(p, &l);
	if (p->plate_mass_kg > 0.0) {
		rate[PLATE + OFF_ACROSS] = y[PLATE + OFF_V_ACROSS];
		rate[PLATE + OFF_UP] = y[PLATE + OFF_V_UP];
		rate[PLATE + OFF_V_ACROSS] = -l.mount_across / p->plate_mass_kg - across;
		rate[PLATE + OFF_V_UP] = -l.mount_up / p->plate_mass_kg - up;
	}
}

/* Of the plate once the corner has left the mat. */
static void swing(const struct body *b, const double off[], double spin, struct load *l, double rate[])
{
	pull(b, off, spin, l);
	rate[OFF_ACROSS] = off[OFF_V_ACROSS];
	rate[OFF_UP] = off[OFF_V_UP];
	rate[OFF_V_ACROSS] = -l->mount_across * b->per_mass;
	rate[OFF_V_UP] = -l->mount_up * b->per_mass;
}

/* Of everything then, when nothing depends on the angle any more. */
static void rates_in_flight(const void *context, const double y[], double rate[])
{
	const struct body *b = context;
	const struct planar *p = b->in;
	struct load l = {.normal = 0.0};

	swing(b, y + PLATE, y[SPIN], &l, rate + PLATE);
	rate[UP] = y[V_UP];
	rate[TURN] = y[SPIN];
	rate[GRIP] = rate[SPIN] = 0.0;
	rate[V_ACROSS] = l.mount_across / p->case_mass_kg;
	rate[V_UP] = l.mount_up / p->case_mass_kg - p->gravity_m_s2;
}

/* A box whose spin stays, for the plate alone. */
struct spinning {
	const struct body *body;
	double spin;
};

static void rates_of_plate(const void *context, const double off[], double rate[])
{
	const struct spinning *s = context;
	struct load l = {.normal = 0.0};

	swing(s->body, off, s->spin, &l, rate);
}

/* An acceleration in the room's axes seen along X and Y. */
static void along_body(const struct load *l, double across, double up, double *x, double *y)
{
	*x = across * l->sine + up * l->cosine;
	*y = up * l->sine - across * l->cosine;
}

static void planar_signals(const void *context, const double y[], double value[])
{
	const struct body *b = context;
	const struct planar *p = b->in;
	const struct load l = load_of(b, y);
	double box_x, box_y, x, side;

	along_body(&l, (l.along + l.mount_across) / p->case_mass_kg,
	           (l.normal + l.mount_up) / p->case_mass_kg, &box_x, &box_y);
	x = box_x;
	side = box_y;
	if (p->plate_mass_kg > 0.0)
		along_body(&l, -l.mount_across / p->plate_mass_kg, -l.mount_up / p->plate_mass_kg, &x, &side);
	value[PLANAR_S1X] = x * b->yaw_cosine - side * b->yaw_sine;
	value[PLANAR_S1Y] = x * b->yaw_sine + side * b->yaw_cosine;
	value[PLANAR_S2X] = box_x - y[SPIN] * y[SPIN] * p->s2_offset_m;
	value[PLANAR_S2Y] = box_y - angular_acceleration(p, &l) * p->s2_offset_m;
	value[PLANAR_S1R] = sqrt(x * x + side * side);
	value[PLANAR_S2R] =
	        sqrt(value[PLANAR_S2X] * value[PLANAR_S2X] + value[PLANAR_S2Y] * value[PLANAR_S2Y]);
	value[PLANAR_CENTRE_R] = sqrt(box_x * box_x + box_y * box_y);
	value[PLANAR_DEPTH] = l.depth > 0.0 ? l.depth : 0.0;
	value[PLANAR_TRAVEL] = 0.0;
	if (p->plate_mass_kg > 0.0) {
		const double *off = y + PLATE;

		value[PLANAR_TRAVEL] = sqrt(off[OFF_ACROSS] * off[OFF_ACROSS] + off[OFF_UP] * off[OFF_UP]);
	}
}

static void planar_start(const struct body *b, struct ode *ode)
{
	const struct planar *p = b->in;
	const double y[STATES] = {[V_UP] = -p->speed_m_s};
	double depth = contact_depth(&p->law, p->case_mass_kg, p->speed_m_s, p->stiffness_n_m15);
	double stiff = 1.0, reach = sqrt(p->lever_x_m * p->lever_x_m + p->lever_y_m * p->lever_y_m);

	ode->count = p->plate_mass_kg > 0.0 ? STATES : PLATE;
	ode->rates = planar_rates;
	ode->context = b;
	ode->tolerance = p->tolerance;
	ode->scale[UP] = ode->scale[GRIP] = depth;
	ode->scale[V_ACROSS] = ode->scale[V_UP] = p->speed_m_s;
	if (p->plate_mass_kg > 0.0) /* a stiff mount moves little */
		stiff = fmin(1.0, p->speed_m_s * p->speed_m_s / (depth * depth * p->mount_n_m * b->per_mass));
	ode->scale[PLATE + OFF_ACROSS] = ode->scale[PLATE + OFF_UP] = depth * stiff;
	ode->scale[PLATE + OFF_V_ACROSS] = ode->scale[PLATE + OFF_V_UP] = p->speed_m_s * sqrt(stiff);
	ode->scale[TURN] = depth / reach;
	ode->scale[SPIN] = p->speed_m_s / reach;
	ode_start(ode, y, (p->rough ? FIRST_STEP_ROUGH : FIRST_STEP) * depth / p->speed_m_s);
}

static double depth_then(double t, void *context)
{
	const struct ode *ode = context;
	double y[ODE_STATES_MAX];

	ode_at(ode, t, y);
	return load_of(ode->context, y).depth;
}

/* One step; *released when the corner leaves the mat in it, which then ends there. */
static int planar_step(struct ode *ode, double until, bool *released)
{
	double at;
	int error = ode_step(ode, until);

	*released = !error && ode->last.from > 0.0 && load_of(ode->context, ode->y).depth <= 0.0;
	if (*released) {
		error = root_find(depth_then, ode, ode->last.from, ode->t, &at);
		if (!error)
			ode_cut(ode, at);
	}
	return error;
}

static void conclude_contact(const struct body *b, const struct ode *ode, bool released,
                             struct planar_result *r)
{
	const struct planar *p = b->in;
	const struct load l = load_of(b, ode->y);
	double plate = p->plate_mass_kg > 0.0 ? ode->y[PLATE + OFF_V_UP] : 0.0;

	r->contact_time_s = released ? ode->t : (double)NAN;
	r->restitution =
	        released ? (ode->y[V_UP] - ode->y[SPIN] * l.lever_across) / p->speed_m_s : (double)NAN;
	r->velocity_change_m_s = p->speed_m_s + ode->y[V_UP] +
	                         plate * p->plate_mass_kg / (p->plate_mass_kg + p->case_mass_kg) +
	                         p->gravity_m_s2 * ode->t;
	r->spin_rad_s = ode->y[SPIN];
}

/* The plate's height against the box crosses zero twice an oscillation. */
struct ring {
	int crossings;
	double first_s, first_m_s;
};

/* first: of the plate's states in ode. */
static void ring_step(struct ring *ring, const struct ode *ode, size_t first, struct planar_result *r)
{
	double t, fall, y[ODE_STATES_MAX], *off = y + first;

	if ((ode->last.term[0][first + OFF_UP] < 0.0) == (ode->y[first + OFF_UP] < 0.0))
		return;
	t = watch_crossing(ode, first + OFF_UP);
	ode_at(ode, t, y);
	if (ring->crossings == 0) {
		ring->first_s = t;
		ring->first_m_s = off[OFF_V_UP];
	} else if (ring->crossings == RING_CROSSINGS) {
		fall = log(ring->first_m_s / off[OFF_V_UP]) / RING_PERIODS;
		r->ring_hz = RING_PERIODS / (t - ring->first_s);
		r->ring_damping = fall / sqrt(fall * fall + 4.0 * UNITS_PI * UNITS_PI);
	}
	ring->crossings++;
}

/* Whether all peaks asked for are behind; an axis may have a second one, the other way. */
static bool all_passed(const struct planar *p, const struct watch *watch)
{
	const unsigned axes = 1u << PLANAR_S1X | 1u << PLANAR_S1Y | 1u << PLANAR_S2X | 1u << PLANAR_S2Y;

	if (p->count_ring || (axes & ~p->skipped))
		return false;
	for (size_t i = 0; i < PLANAR_SIGNALS; i++)
		if (!(p->skipped >> i & 1u) && i != PLANAR_DEPTH && !watch_passed(watch, i, PASSED_SHARE))
			return false;
	return true;
}

/* The plate after the release: its first extremes. */
static int fly(const struct body *b, struct ode *ode, struct watch *watch, struct ring *ring,
               struct planar_result *r)
{
	double end = ode->t + FLIGHT_SHARE * b->period_s;
	int error = 0;

	ode->rates = rates_in_flight;
	while (!error && ode->t < end) {
		error = ode_step(ode, end);
		if (error)
			break;
		watch_step(watch, ode);
		ring_step(ring, ode, PLATE, r);
		if (b->in->rough && all_passed(b->in, watch))
			break;
	}
	return error;
}

/* And on, the plate alone, until three oscillations are counted. */
static int fly_on(const struct body *b, struct ode *ode, struct ring *ring, struct planar_result *r)
{
	const struct spinning context = {b, ode->y[SPIN]};
	struct ode plate = {.count = OFF_STATES,
	                    .rates = rates_of_plate,
	                    .context = &context,
	                    .tolerance = RING_COARSER * ode->tolerance};
	double end = ode->t + 2.0 * RING_PERIODS * b->period_s;
	int error = 0;

	memcpy(plate.scale, ode->scale + PLATE, OFF_STATES * sizeof(*plate.scale));
	ode_start(&plate, ode->y + PLATE, ode->next);
	plate.t = ode->t;
	while (!error && plate.t < end && ring->crossings <= RING_CROSSINGS) {
		error = ode_step(&plate, end);
		if (!error)
			ring_step(ring, &plate, 0, r);
	}
	ode->evaluations += plate.evaluations;
	return error;
}

/* Whether anything asked for may peak after the release. Of the box's signals none does above a light plate.
 */
static bool planar_peaks_in_flight(const struct planar *p)
{
	const unsigned plate = 1u << PLANAR_S1X | 1u << PLANAR_S1Y | 1u << PLANAR_S1R | 1u << PLANAR_TRAVEL;

	return p->plate_mass_kg > LIGHT_PLATE * p->case_mass_kg ||
	       (p->plate_mass_kg > 0.0 && (p->count_ring || (plate & ~p->skipped)));
}

int planar_solve(const struct planar *planar, struct planar_result *result)
{
	const struct body body = body_of(planar);
	struct planar_result r = {.ring_hz = (double)NAN, .ring_damping = (double)NAN};
	struct watch watch = {.count = PLANAR_SIGNALS,
	                      .signals = planar_signals,
	                      .context = &body,
	                      .skipped = planar->skipped,
	                      .rough = planar->rough};
	struct ring ring = {.crossings = 0};
	struct ode ode;
	bool released = false, flies;
	int error = 0;

	planar_start(&body, &ode);
	watch_start(&watch, &ode);
	while (!released && !r.cut_short && ode.t < body.contact_end_s) {
		error = planar_step(&ode, body.contact_end_s, &released);
		if (error)
			return error;
		watch_step(&watch, &ode);
		r.cut_short = planar->rough && watch_passed(&watch, PLANAR_DEPTH, 1.0) &&
		              all_passed(planar, &watch);
	}
	conclude_contact(&body, &ode, released, &r);
	flies = released && planar_peaks_in_flight(planar);
	if (flies)
		error = fly(&body, &ode, &watch, &ring, &r);
	watch_end(&watch, &ode);
	if (!error && flies && planar->count_ring)
		error = fly_on(&body, &ode, &ring, &r);
	if (error)
		return error;
	for (int i = 0; i < PLANAR_SIGNALS; i++)
		r.peak[i] = watch.peak[i];
	r.s1_direction_rad = atan2(watch.with[PLANAR_S1R][PLANAR_S1Y], watch.with[PLANAR_S1R][PLANAR_S1X]);
	r.s2_direction_rad = atan2(watch.with[PLANAR_S2R][PLANAR_S2Y], watch.with[PLANAR_S2R][PLANAR_S2X]);
	if (r.cut_short)
		r.velocity_change_m_s = r.spin_rad_s = (double)NAN;
	r.evaluations = ode.evaluations;
	*result = r;
	return 0;
}

/* ---- the history ---- */

static struct planar_sample planar_sample_of(const struct body *b, const double y[])
{
	double value[PLANAR_SIGNALS];
	struct planar_sample s;

	planar_signals(b, y, value);
	for (int i = 0; i < PLANAR_AXES; i++)
		s.axis[i] = value[i];
	s.force_n = load_of(b, y).normal;
	s.depth_m = value[PLANAR_DEPTH];
	s.travel_m = value[PLANAR_TRAVEL];
	s.angle_rad = b->in->angle_rad + y[TURN];
	return s;
}

int planar_history(const struct planar *planar, double start_s, double step_s, struct planar_sample *samples,
                   size_t count)
{
	const struct body body = body_of(planar);
	double end = start_s + step_s * (double)count;
	struct ode ode;
	bool released = false;
	int error = 0;

	planar_start(&body, &ode);
	for (size_t i = 0; i < count && !error; i++) {
		double t = start_s + (double)i * step_s, y[ODE_STATES_MAX];

		if (!(t > 0.0)) {
			samples[i] = (struct planar_sample){.angle_rad = planar->angle_rad};
			continue;
		}
		while (!error && ode.t < t)
			error = released ? ode_step(&ode, end) : planar_step(&ode, end, &released);
		if (error)
			break;
		ode_at(&ode, t, y);
		samples[i] = planar_sample_of(&body, y);
	}
	return error;
}
