/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/planar.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/model/body.h"
#include "host/model/root.h"

/* The plate's states alone, in flight. */
enum { OFF_ACROSS, OFF_UP, OFF_V_ACROSS, OFF_V_UP, OFF_STATES };

/* A corner that has not left the mat after this many contact times will not. */
#define CONTACTS_MAX 3.0

/* First step, in times the box needs at impact speed for the largest depth. */
#define FIRST_STEP 1e-3
#define FIRST_STEP_ROUGH 0.1

/* The plate's first extreme after the release is not later than this share of its period. */
#define FLIGHT_SHARE 0.6

/* In one step of a flight a box turns no further: it might touch and leave unseen, rad. */
#define TURN_MAX 0.3

/* Plate over box up to which the box cannot be shaken harder by the plate than by the mat. */
#define LIGHT_PLATE 0.25

/* A resultant that fell below this share of its peak does not rise above it again. */
#define PASSED_SHARE 0.7

/* What is followed only to count oscillations may be so much coarser. */
#define RING_COARSER 20.0

enum { RING_CROSSINGS = 6, RING_PERIODS = RING_CROSSINGS / 2 };

/* The drop and where it has come to. */
struct course {
	const struct planar *in;
	struct body body;
	unsigned touching; /* mask of the corners */
	struct ode ode;
	double released_s; /* corner 0 left the mat first; NAN: not yet */
	double second_s;   /* the second touch of any corner; NAN: none yet */
	int second_corner;
	int event;            /* the corner that touches or leaves at the end of the last step; -1: none */
	double contact_end_s; /* whoever has not left the mat by then will not */
	double period_s;      /* of the plate, 0 without one */
};

static void planar_rates(const void *context, const double y[], double rate[])
{
	const struct course *c = context;

	body_rates(&c->body, c->touching, y, rate);
}

static void planar_signals(const void *context, const double y[], double value[])
{
	const struct course *c = context;
	struct body_reading r;

	body_read(&c->body, c->touching, y, &r);
	value[PLANAR_S1X] = r.s1_x;
	value[PLANAR_S1Y] = r.s1_y;
	value[PLANAR_S2X] = r.s2_x;
	value[PLANAR_S2Y] = r.s2_y;
	value[PLANAR_S1R] = sqrt(r.s1_x * r.s1_x + r.s1_y * r.s1_y);
	value[PLANAR_S2R] = sqrt(r.s2_x * r.s2_x + r.s2_y * r.s2_y);
	value[PLANAR_CENTRE_R] = sqrt(r.box_x * r.box_x + r.box_y * r.box_y);
	value[PLANAR_DEPTH] = r.depth_m;
	value[PLANAR_TRAVEL] = r.travel_m;
}

static struct body body_of(const struct planar *p)
{
	struct body b = {
	        .turns = true,
	        .case_mass_kg = p->case_mass_kg,
	        .plate_mass_kg = p->plate_mass_kg,
	        .inertia_kg_m2 = p->inertia_kg_m2,
	        .angle_rad = p->angle_rad,
	        .gravity_m_s2 = p->gravity_m_s2,
	        .speed_m_s = p->speed_m_s,
	        .lever_x_m = p->lever_x_m,
	        .lever_y_m = p->lever_y_m,
	        .stiffness_n_m15 = p->stiffness_n_m15,
	        .wedge = p->wedge,
	        .damping = p->law.damping,
	        .grip = p->grip,
	        .friction = p->friction,
	        .mount_n_m = p->mount_n_m,
	        .mount_damping_n_s_m = p->mount_damping_n_s_m,
	        .softening = p->softening,
	        .softening_per_m2 = p->softening > 0.0 ? 1.0 / (p->softening_m * p->softening_m) : 0.0,
	        .mounts_turn = p->mounts_turn,
	        .s2_offset_m = p->s2_offset_m,
	        .s1_yaw_rad = p->s1_yaw_rad,
	};

	body_prepare(&b);
	return b;
}

/* What counts as much in each state. */
static void planar_scale(const struct course *c, double depth, double scale[])
{
	const struct planar *p = c->in;
	double stiff = 1.0, reach = sqrt(p->lever_x_m * p->lever_x_m + p->lever_y_m * p->lever_y_m);

	if (p->plate_mass_kg > 0.0) /* a stiff mount moves little */
		stiff = fmin(1.0,
		             p->speed_m_s * p->speed_m_s / (depth * depth * p->mount_n_m * c->body.per_mass));
	scale[BODY_UP] = depth;
	scale[BODY_V_UP] = scale[BODY_V_ACROSS] = p->speed_m_s;
	scale[BODY_OFF_UP] = scale[BODY_OFF_ACROSS] = depth * stiff;
	scale[BODY_OFF_V_UP] = scale[BODY_OFF_V_ACROSS] = p->speed_m_s * sqrt(stiff);
	scale[BODY_TURN] = depth / reach;
	scale[BODY_SPIN] = p->speed_m_s / reach;
	for (int i = 0; i < BODY_CORNERS; i++)
		scale[body_grip(i)] = depth;
}

static void planar_start(struct course *c, const struct planar *p)
{
	double stiffness, depth, y[BODY_STATES];

	*c = (struct course){.in = p,
	                     .body = body_of(p),
	                     .touching = BODY_FIRST,
	                     .event = -1,
	                     .released_s = (double)NAN,
	                     .second_s = (double)NAN};
	stiffness = c->body.touch[0].stiffness_n_m15;
	depth = contact_depth(&p->law, p->case_mass_kg, p->speed_m_s, stiffness);
	if (p->plate_mass_kg > 0.0)
		c->period_s = 2.0 * UNITS_PI / sqrt(p->mount_n_m * c->body.per_mass);
	c->contact_end_s =
	        CONTACTS_MAX * contact_duration(&p->law, p->case_mass_kg, p->speed_m_s, stiffness) +
	        FLIGHT_SHARE * c->period_s;
	c->ode.count = BODY_ONE_CORNER;
	c->ode.rates = planar_rates;
	c->ode.context = c;
	c->ode.tolerance = p->tolerance;
	planar_scale(c, depth, c->ode.scale);
	body_start(&c->body, y);
	ode_start(&c->ode, y, (p->rough ? FIRST_STEP_ROUGH : FIRST_STEP) * depth / p->speed_m_s);
}

/* ---- touches and releases ---- */

struct corner_of {
	const struct course *course;
	int corner;
};

static double depth_then(double t, void *context)
{
	const struct corner_of *k = context;
	double y[BODY_STATES] = {0.0};

	ode_at(&k->course->ode, t, y);
	return body_depth(&k->course->body, y, k->corner);
}

/* Whether the mat and a corner part or meet in the last step, and when: its depth, given half way and at the
 * end of it, then changes sign for good, or, of a corner above the mat, dips below within the step. */
static bool changes(const struct course *c, int corner, double half, double end, double *at)
{
	struct corner_of k = {c, corner};
	const struct ode_piece *p = &c->ode.last;
	bool touches = c->touching >> corner & 1u;
	double middle = 0.5 * (p->from + p->end), low = p->from, high = p->end;

	if (touches == (end > 0.0)) {
		if (touches || !(half > 0.0))
			return false;
		high = middle;
	} else if (touches == (half > 0.0)) {
		low = middle;
	}
	if (touches !=
	    (depth_then(low, &k) > 0.0)) { /* at the very start: just touched or left, but for rounding */
		*at = low;
		return !touches && body_closing(&c->body, p->term[0], corner) > 0.0;
	}
	return root_find(depth_then, &k, low, high, at) == 0;
}

/* The first corner that touches or leaves in the last step, -1: none. */
static int first_change(const struct course *c, double *first)
{
	double half[BODY_STATES] = {0.0}, at;
	int corner = -1;

	*first = INFINITY;
	ode_at(&c->ode, 0.5 * (c->ode.last.from + c->ode.last.end), half);
	for (int i = 0; i < BODY_CORNERS; i++)
		if (changes(c, i, body_depth(&c->body, half, i), body_depth(&c->body, c->ode.y, i), &at) &&
		    at < *first) {
			*first = at;
			corner = i;
		}
	return corner;
}

static void planar_touch(struct course *c, int corner)
{
	c->touching |= 1u << corner;
	if (isnan(c->second_s)) {
		c->second_s = c->ode.t;
		c->second_corner = corner;
	}
	if (corner > 0)
		c->ode.count = BODY_STATES;
	body_touches(&c->body, c->ode.y, corner);
}

static void planar_leave(struct course *c, int corner)
{
	c->touching &= ~(1u << corner);
	if (corner == 0 && isnan(c->released_s))
		c->released_s = c->ode.t;
	c->ode.y[body_grip(corner)] = 0.0;
	if (c->touching <= BODY_FIRST)
		c->ode.count = BODY_ONE_CORNER;
}

/* One step, which ends where a corner touches or leaves the mat. */
static int planar_step(struct course *c, double until)
{
	double at;
	int error;

	if (!c->touching)
		c->ode.next = fmin(c->ode.next, TURN_MAX / fabs(c->ode.y[BODY_SPIN]));
	error = ode_step(&c->ode, until);
	if (error || !(c->ode.last.from > 0.0))
		return error;
	c->event = first_change(c, &at);
	if (c->event >= 0)
		ode_cut(&c->ode, at);
	return 0;
}

/* What the last step ended with takes effect; true at corner 0's first release. */
static bool planar_turn_over(struct course *c)
{
	bool held = isnan(c->released_s);
	int corner = c->event;

	if (corner < 0)
		return false;
	c->event = -1;
	if (c->touching >> corner & 1u)
		planar_leave(c, corner);
	else
		planar_touch(c, corner);
	ode_renew(&c->ode);
	return held && !isnan(c->released_s);
}

/* At corner 0's first release, or at the end of a drop without one. */
static void conclude_contact(const struct course *c, struct planar_result *r)
{
	const struct planar *p = c->in;
	const double *y = c->ode.y;
	bool released = !isnan(c->released_s);

	r->contact_time_s = c->released_s;
	r->restitution = released ? -body_closing(&c->body, y, 0) / p->speed_m_s : (double)NAN;
	r->velocity_change_m_s = p->speed_m_s + y[BODY_V_UP] +
	                         y[BODY_OFF_V_UP] * p->plate_mass_kg / (p->plate_mass_kg + p->case_mass_kg) +
	                         p->gravity_m_s2 * c->ode.t;
	r->spin_rad_s = y[BODY_SPIN];
}

/* A box whose spin stays, for the plate alone. */
struct spinning {
	const struct body *body;
	double spin;
};

static void rates_of_plate(const void *context, const double off[], double rate[])
{
	const struct spinning *s = context;

	body_swing(s->body, s->spin, off, rate);
}

/* The plate's height against the box crosses zero twice an oscillation. */
struct ring {
	int crossings;
	double first_s, first_m_s;
};

static void ring_step(struct ring *ring, const struct ode *ode, struct planar_result *r)
{
	double t, fall, off[ODE_STATES_MAX];

	if ((ode->last.term[0][OFF_UP] < 0.0) == (ode->y[OFF_UP] < 0.0))
		return;
	t = watch_crossing(ode, OFF_UP);
	ode_at(ode, t, off);
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

/* The plate alone in undisturbed flight from here on, until three oscillations are counted. */
static int ring_down(struct course *c, struct planar_result *r)
{
	const double *y = c->ode.y, *scale = c->ode.scale;
	const double off[OFF_STATES] = {y[BODY_OFF_ACROSS], y[BODY_OFF_UP], y[BODY_OFF_V_ACROSS],
	                                y[BODY_OFF_V_UP]};
	const struct spinning context = {&c->body, y[BODY_SPIN]};
	struct ode plate = {.count = OFF_STATES,
	                    .rates = rates_of_plate,
	                    .context = &context,
	                    .tolerance = RING_COARSER * c->ode.tolerance,
	                    .scale = {scale[BODY_OFF_ACROSS], scale[BODY_OFF_UP], scale[BODY_OFF_V_ACROSS],
	                              scale[BODY_OFF_V_UP]}};
	double end = (FLIGHT_SHARE + 2.0 * RING_PERIODS) * c->period_s;
	struct ring ring = {.crossings = 0};
	int error = 0;

	ode_start(&plate, off, c->ode.next);
	while (!error && plate.t < end && ring.crossings <= RING_CROSSINGS) {
		error = ode_step(&plate, end);
		if (!error)
			ring_step(&ring, &plate, r);
	}
	c->ode.evaluations += plate.evaluations;
	return error;
}

/* Whether anything asked for may peak after the release. Of the box's signals none does above a light plate
 * that leaves it alone. */
static bool planar_peaks_in_flight(const struct planar *p)
{
	const unsigned plate = 1u << PLANAR_S1X | 1u << PLANAR_S1Y | 1u << PLANAR_S1R | 1u << PLANAR_TRAVEL;

	return p->plate_mass_kg > LIGHT_PLATE * p->case_mass_kg ||
	       (p->plate_mass_kg > 0.0 && (p->count_ring || (plate & ~p->skipped)));
}

/* Steps until the window of peaks ends: the release and, if anything may peak then, a share of the plate's
 * period after it. */
static int follow(struct course *c, struct watch *watch, struct planar_result *r)
{
	const struct planar *p = c->in;
	bool flies = planar_peaks_in_flight(p);
	double end = c->contact_end_s;
	int error = 0;

	while (!error && c->ode.t < end) {
		error = planar_step(c, end);
		if (error)
			break;
		watch_step(watch, &c->ode);
		if (p->rough && watch_passed(watch, PLANAR_DEPTH, 1.0) && all_passed(p, watch)) {
			r->cut_short = isnan(c->released_s);
			break;
		}
		if (c->event < 0)
			continue;
		watch_end(watch, &c->ode);
		if (planar_turn_over(c)) {
			conclude_contact(c, r);
			end = flies ? c->ode.t + FLIGHT_SHARE * c->period_s : c->ode.t;
			if (p->count_ring)
				error = ring_down(c, r);
		}
		watch_resume(watch, &c->ode);
	}
	watch_end(watch, &c->ode);
	return error;
}

int planar_solve(const struct planar *planar, struct planar_result *result)
{
	struct planar_result r = {.ring_hz = (double)NAN, .ring_damping = (double)NAN};
	struct course course;
	struct watch watch = {.count = PLANAR_SIGNALS,
	                      .signals = planar_signals,
	                      .context = &course,
	                      .skipped = planar->skipped,
	                      .rough = planar->rough};
	int error;

	planar_start(&course, planar);
	watch_start(&watch, &course.ode);
	error = follow(&course, &watch, &r);
	if (error)
		return error;
	if (isnan(course.released_s))
		conclude_contact(&course, &r);
	for (int i = 0; i < PLANAR_SIGNALS; i++)
		r.peak[i] = watch.peak[i];
	r.s1_direction_rad = atan2(watch.with[PLANAR_S1R][PLANAR_S1Y], watch.with[PLANAR_S1R][PLANAR_S1X]);
	r.s2_direction_rad = atan2(watch.with[PLANAR_S2R][PLANAR_S2Y], watch.with[PLANAR_S2R][PLANAR_S2X]);
	if (r.cut_short)
		r.velocity_change_m_s = r.spin_rad_s = (double)NAN;
	r.second_s = course.second_s;
	r.second_corner = course.second_corner;
	r.until_s = course.ode.t;
	r.evaluations = course.ode.evaluations;
	*result = r;
	return 0;
}

/* ---- the history ---- */

static struct planar_sample planar_sample_of(const struct course *c, const double y[])
{
	struct body_reading r;

	body_read(&c->body, c->touching, y, &r);
	return (struct planar_sample){
	        .axis = {r.s1_x, r.s1_y, r.s2_x, r.s2_y},
	        .force_n = r.normal_n,
	        .depth_m = r.depth_m,
	        .travel_m = r.travel_m,
	        .angle_rad = c->in->angle_rad + y[BODY_TURN],
	};
}

int planar_history(const struct planar *planar, double start_s, double step_s, struct planar_sample *samples,
                   size_t count)
{
	double end = start_s + step_s * (double)count;
	struct course course;
	int error = 0;

	planar_start(&course, planar);
	for (size_t i = 0; i < count && !error; i++) {
		double t = start_s + (double)i * step_s, y[BODY_STATES] = {0.0};

		if (!(t > 0.0)) {
			samples[i] = (struct planar_sample){.angle_rad = planar->angle_rad};
			continue;
		}
		while (!error && course.ode.t < t) {
			planar_turn_over(&course);
			error = planar_step(&course, end);
		}
		if (error)
			break;
		ode_at(&course.ode, t, y);
		samples[i] = planar_sample_of(&course, y);
	}
	return error;
}
