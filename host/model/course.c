/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/course.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/model/body.h"
#include "host/model/root.h"

/* The plate's states alone, in flight. */
enum { OFF_ACROSS, OFF_UP, OFF_V_ACROSS, OFF_V_UP, OFF_STATES };

/* A corner that has not left the mat after this many contact times will not. */
#define CONTACTS_MAX 3.0
#define CONTACTS_USUAL 1.5

/* First step, in times the box needs at impact speed for the largest depth. */
#define FIRST_STEP 1e-3
#define FIRST_STEP_ROUGH 0.1

/* The plate's first extreme after the release is not later than this share of its period. */
#define FLIGHT_SHARE 0.6

/* In one step of a flight a box turns no further: it might touch and leave unseen, rad. */
#define TURN_MAX 0.3

/* Plate over box up to which the box cannot be shaken harder by the plate than by the mat. */
#define LIGHT_PLATE 0.25

/* A corner that comes this near the mat, in half widths of the box, may strike it. */
#define STRIKE_SHARE 0.05

/* A resultant that fell below this share of its peak does not rise above it again. */
#define PASSED_SHARE 0.7

/* What is followed only to count oscillations may be so much coarser. */
#define RING_COARSER 20.0

enum { RING_CROSSINGS = 6, RING_PERIODS = RING_CROSSINGS / 2 };

enum change { TOUCHES, LEAVES, LETS_GO };

/* What the last step ended with. */
struct event {
	int corner; /* -1: nothing */
	enum change change;
};

/* The drop and where it has come to. */
struct run {
	const struct course *in;
	struct body body;
	unsigned touching; /* mask of the corners */
	struct ode ode;
	double released_s; /* corner 0 left the mat first; NAN: not yet */
	double second_s;   /* the second touch of any corner; NAN: none yet */
	int second_corner;
	struct event event;
	double contact_end_s;          /* whoever has not left the mat in this time will not */
	double window_s;               /* the peaks of a box that leaves are looked for up to here, or so; */
	double begin_by_s;             /* touches are followed that begin by then, */
	double follow_s[BODY_CORNERS]; /* each while it lasts, up to here; 0: it is not; */
	double fly_s;                  /* then what flies, up to here */
	bool strikes;                  /* another touch may come before that */
	double period_s;               /* of the plate, 0 without one */
};

static void course_rates(const void *context, const double y[], double rate[])
{
	const struct run *c = context;

	body_rates(&c->body, c->touching, y, rate, NULL);
}

static void course_signals(const void *context, const double y[], double value[])
{
	const struct run *c = context;
	struct body_reading r;

	body_read(&c->body, c->touching, y, &r);
	value[COURSE_S1X] = r.s1_x;
	value[COURSE_S1Y] = r.s1_y;
	value[COURSE_S2X] = r.s2_x;
	value[COURSE_S2Y] = r.s2_y;
	value[COURSE_S1R] = sqrt(r.s1_x * r.s1_x + r.s1_y * r.s1_y);
	value[COURSE_S2R] = sqrt(r.s2_x * r.s2_x + r.s2_y * r.s2_y);
	value[COURSE_CENTRE_R] = sqrt(r.box_x * r.box_x + r.box_y * r.box_y);
	value[COURSE_DEPTH] = r.depth_m;
	value[COURSE_TRAVEL] = r.travel_m;
}

/* What counts as much in each state. */
static void course_scale(const struct run *c, double depth, double scale[])
{
	const struct body *p = &c->body;
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
	for (int i = 0; i < BODY_CORNERS; i++) /* friction lets it come no further */
		scale[body_grip(i)] =
		        depth * (p->grip > 0.0 ? fmin(1.0, p->friction / (1.5 * p->grip)) : 1.0);
}

static void course_start(struct run *c, const struct course *in)
{
	const struct body *p = &in->body;
	double stiffness, depth, duration, y[BODY_STATES];

	*c = (struct run){.in = in,
	                  .body = *p,
	                  .touching = BODY_FIRST,
	                  .event = {.corner = -1},
	                  .released_s = (double)NAN,
	                  .second_s = (double)NAN};
	body_prepare(&c->body);
	stiffness = c->body.touch[0].stiffness_n_m15;
	depth = contact_depth(&p->law, p->case_mass_kg, p->speed_m_s, stiffness);
	if (p->plate_mass_kg > 0.0)
		c->period_s = 2.0 * UNITS_PI / sqrt(p->mount_n_m * c->body.per_mass);
	duration = contact_duration(&p->law, p->case_mass_kg, p->speed_m_s, stiffness);
	c->contact_end_s = CONTACTS_MAX * duration + FLIGHT_SHARE * c->period_s;
	c->window_s = CONTACTS_USUAL * duration + FLIGHT_SHARE * c->period_s;
	c->begin_by_s = c->follow_s[0] = c->contact_end_s;
	c->ode.count = p->turns ? BODY_ONE_CORNER : BODY_UPRIGHT;
	c->ode.rates = course_rates;
	c->ode.context = c;
	c->ode.tolerance = in->tolerance;
	course_scale(c, depth, c->ode.scale);
	body_start(&c->body, y);
	ode_start(&c->ode, y, (in->rough ? FIRST_STEP_ROUGH : FIRST_STEP) * depth / p->speed_m_s);
}

/* ---- touches, releases, slip ---- */

/* The shortest touch or hold, of a step: one that ends at the instant it began would begin again. */
#define GRAZE_SHARE 1e-6

struct change_of {
	const struct run *run;
	struct event event;
};

/* Above 0 from where the change happened. */
static double changed(const struct run *c, struct event e, const double y[])
{
	double depth;

	if (e.change == LETS_GO)
		return body_lets_go(&c->body, c->touching, y, e.corner);
	depth = body_depth(&c->body, y, e.corner);
	return e.change == TOUCHES ? depth : -depth;
}

static double changed_then(double t, void *context)
{
	const struct change_of *k = context;
	double y[BODY_STATES] = {0.0};

	ode_at(&k->run->ode, t, y);
	return changed(k->run, k->event, y);
}

/* Whether, and when, a change happens in the last step: by its end, or, of a touch or a hold, by half of it.
 * What began with the step does not end with its begin. */
static bool changes(const struct run *c, struct event e, const double half[], double *at)
{
	struct change_of k = {c, e};
	const struct ode_piece *p = &c->ode.last;
	bool early = changed(c, e, half) > 0.0;
	double middle = 0.5 * (p->from + p->end), low = p->from;

	if (!(changed(c, e, c->ode.y) > 0.0) && (!early || e.change == LEAVES))
		return false;
	if (e.change != TOUCHES)
		low = early ? p->from + GRAZE_SHARE * p->length : middle;
	if (changed_then(low, &k) > 0.0) {
		*at = low;
		return e.change != TOUCHES || body_closing(&c->body, p->term[0], e.corner) > 0.0;
	}
	return root_find(changed_then, &k, low, early ? middle : p->end, at) == 0;
}

/* The first change in the last step. */
static struct event first_change(const struct run *c, double *first)
{
	int corners = c->body.turns ? BODY_CORNERS : 1;
	bool grips = c->body.turns && c->body.grip > 0.0;
	double half[BODY_STATES] = {0.0}, at;
	struct event found = {.corner = -1};

	*first = INFINITY;
	ode_at(&c->ode, 0.5 * (c->ode.last.from + c->ode.last.end), half);
	for (int i = 0; i < corners; i++) {
		bool touches = c->touching >> i & 1u;
		struct event each[] = {{i, touches ? LEAVES : TOUCHES}, {i, LETS_GO}};

		for (int k = 0; k < (touches && grips ? 2 : 1); k++)
			if (changes(c, each[k], half, &at) && at < *first) {
				*first = at;
				found = each[k];
			}
	}
	return found;
}

/* Until when the peaks are looked for. */
static double course_end(const struct run *c)
{
	double end = c->fly_s;

	for (int i = 0; i < BODY_CORNERS; i++)
		if (c->touching >> i & 1u)
			end = fmax(end, c->follow_s[i]);
	return end;
}

/* What begins while another touch is followed is followed likewise: neither is cut. */
static bool course_follows(const struct run *c)
{
	bool follows = c->ode.t <= c->begin_by_s;

	for (int i = 0; i < BODY_CORNERS; i++)
		follows = follows || ((c->touching >> i & 1u) && c->ode.t < c->follow_s[i]);
	return follows;
}

static void course_touch(struct run *c, int corner)
{
	bool follows = course_follows(c);

	c->follow_s[corner] = follows ? c->ode.t + c->contact_end_s : 0.0;
	c->fly_s = follows ? c->fly_s : 0.0;
	c->touching |= 1u << corner;
	if (isnan(c->second_s)) {
		c->second_s = c->ode.t;
		c->second_corner = corner;
	}
	if (corner > 0)
		c->ode.count = BODY_STATES;
	body_touches(&c->body, c->ode.y, corner);
}

static void course_leave(struct run *c, int corner)
{
	c->touching &= ~(1u << corner);
	c->fly_s = fmax(c->fly_s, c->ode.t + FLIGHT_SHARE * c->period_s);
	if (corner == 0 && isnan(c->released_s))
		c->released_s = c->ode.t;
	c->body.touch[corner].hold = BODY_STICKS;
	if (!c->body.turns)
		return;
	c->ode.y[body_grip(corner)] = 0.0;
	if (c->touching <= BODY_FIRST)
		c->ode.count = BODY_ONE_CORNER;
}

/* One step, which ends where something changes. */
static int course_step(struct run *c, double until)
{
	double at;
	int error;

	if (!c->touching && c->body.turns)
		c->ode.next = fmin(c->ode.next, TURN_MAX / fabs(c->ode.y[BODY_SPIN]));
	error = ode_step(&c->ode, until);
	if (error || !(c->ode.last.from > 0.0))
		return error;
	c->event = first_change(c, &at);
	if (c->event.corner >= 0)
		ode_cut(&c->ode, at);
	return 0;
}

/* What the last step ended with takes effect; true at corner 0's first release. */
static bool course_turn_over(struct run *c)
{
	bool held = isnan(c->released_s);
	struct event e = c->event;

	if (e.corner < 0)
		return false;
	c->event.corner = -1;
	if (e.change == LETS_GO)
		body_holds(&c->body, c->touching, c->ode.y, e.corner);
	else if (e.change == LEAVES)
		course_leave(c, e.corner);
	else
		course_touch(c, e.corner);
	ode_renew(&c->ode);
	return held && !isnan(c->released_s);
}

/* At corner 0's first release, or at the end of a drop without one. */
static void conclude_contact(const struct run *c, struct course_result *r)
{
	const struct body *p = &c->body;
	const double *y = c->ode.y;
	bool released = !isnan(c->released_s);

	r->contact_time_s = c->released_s;
	r->restitution = released ? -body_closing(&c->body, y, 0) / p->speed_m_s : (double)NAN;
	r->velocity_change_m_s = p->speed_m_s + y[BODY_V_UP] +
	                         y[BODY_OFF_V_UP] * p->plate_mass_kg / (p->plate_mass_kg + p->case_mass_kg) +
	                         p->gravity_m_s2 * c->ode.t;
	r->spin_rad_s = p->turns ? y[BODY_SPIN] : 0.0;
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

static void ring_step(struct ring *ring, const struct ode *ode, struct course_result *r)
{
	double t, fall, off[ODE_STATES_MAX];

	if ((ode->last.term[0][OFF_UP] < 0.0) == (ode->y[OFF_UP] < 0.0))
		return;
	t = peak_tracker_crossing(ode, OFF_UP);
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
static bool all_passed(const struct course *p, const struct peak_tracker *tracker)
{
	const unsigned axes = 1u << COURSE_S1X | 1u << COURSE_S1Y | 1u << COURSE_S2X | 1u << COURSE_S2Y;

	if (p->count_ring || (axes & ~p->skipped))
		return false;
	for (size_t i = 0; i < COURSE_SIGNALS; i++)
		if (!(p->skipped >> i & 1u) && i != COURSE_DEPTH &&
		    !peak_tracker_passed(tracker, i, PASSED_SHARE))
			return false;
	return true;
}

/* The plate alone in undisturbed flight from here on, until three oscillations are counted. */
static int ring_down(struct run *c, struct course_result *r)
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

/* Whether a corner that is above the mat may come down on it within a time. What still presses lifts the box
 * and can at most double its spin. */
static bool course_may_strike(const struct run *c, double within_s)
{
	double most = (c->touching ? 2.0 : 1.0) * c->ode.y[BODY_SPIN] * within_s, y[BODY_STATES];
	int count = 8 + (int)fmin(fabs(most) / TURN_MAX, 100.0);

	memcpy(y, c->ode.y, sizeof(y));
	for (int i = 1; i <= count && c->body.turns; i++) {
		double t = within_s * i / count;

		y[BODY_UP] = c->ode.y[BODY_UP] + (c->ode.y[BODY_V_UP] - 0.5 * c->body.gravity_m_s2 * t) * t;
		y[BODY_TURN] = c->ode.y[BODY_TURN] + most * i / count;
		for (int k = 0; k < BODY_CORNERS; k++)
			if (!(c->touching >> k & 1u) &&
			    body_depth(&c->body, y, k) > -STRIKE_SHARE * c->body.lever_y_m)
				return true;
	}
	return false;
}

/* Whether anything asked for may peak after the release. Of the box's signals none does above a light plate
 * that leaves it alone. */
static bool course_peaks_in_flight(const struct course *in)
{
	const struct body *p = &in->body;
	const unsigned plate = 1u << COURSE_S1X | 1u << COURSE_S1Y | 1u << COURSE_S1R | 1u << COURSE_TRAVEL;

	return p->plate_mass_kg > LIGHT_PLATE * p->case_mass_kg ||
	       (p->plate_mass_kg > 0.0 && (in->count_ring || (plate & ~in->skipped)));
}

/* Steps until the window of peaks ends: the release and, if anything may peak then, a share of the plate's
 * period after it. What touches by then is followed likewise, whichever touch it is; the next one ends it. */
static int follow(struct run *c, struct peak_tracker *tracker, struct course_result *r)
{
	const struct course *in = c->in;
	bool flies = course_peaks_in_flight(in);
	/* such a plate may throw the box down once more */
	bool heavy = in->body.plate_mass_kg > LIGHT_PLATE * in->body.case_mass_kg;
	double flight = FLIGHT_SHARE * c->period_s;
	int error = 0;

	while (!error && c->ode.t < course_end(c)) {
		error = course_step(c, course_end(c));
		if (error)
			break;
		peak_tracker_step(tracker, &c->ode);
		if (in->rough && !heavy && !c->strikes && peak_tracker_passed(tracker, COURSE_DEPTH, 1.0) &&
		    all_passed(in, tracker)) {
			c->strikes = c->touching > BODY_FIRST || course_may_strike(c, c->window_s - c->ode.t);
			r->cut_short = !c->strikes && isnan(c->released_s);
			if (!c->strikes)
				break;
		}
		if (c->event.corner < 0)
			continue;
		peak_tracker_end(tracker, &c->ode);
		if (course_turn_over(c)) {
			conclude_contact(c, r);
			flies = flies || course_may_strike(c, flight);
			c->begin_by_s = c->fly_s = c->ode.t + (flies ? flight : 0.0);
			if (in->count_ring)
				error = ring_down(c, r);
		}
		peak_tracker_resume(tracker, &c->ode);
	}
	peak_tracker_end(tracker, &c->ode);
	return error;
}

/* Of a body that does not turn these are shares of S1R and CENTRE_R. */
#define UPRIGHT_SKIPS (1u << COURSE_S1X | 1u << COURSE_S1Y | 1u << COURSE_S2X)

static void peaks_upright(struct peak_tracker *w)
{
	const enum course_signal of[] = {
	        [COURSE_S1X] = COURSE_S1R, [COURSE_S1Y] = COURSE_S1R, [COURSE_S2X] = COURSE_CENTRE_R};

	for (int i = COURSE_S1X; i <= COURSE_S2X; i++)
		w->peak[i] = (struct peak_tracker_peak){w->with[of[i]][i], w->peak[of[i]].time_s};
}

int course_solve(const struct course *in, struct course_result *result)
{
	struct course_result r = {.ring_hz = (double)NAN, .ring_damping = (double)NAN};
	struct run run;
	struct peak_tracker tracker = {.count = COURSE_SIGNALS,
	                               .signals = course_signals,
	                               .context = &run,
	                               .skipped = in->skipped | (in->body.turns ? 0u : UPRIGHT_SKIPS),
	                               .rough = in->rough};
	int error;

	course_start(&run, in);
	peak_tracker_start(&tracker, &run.ode);
	error = follow(&run, &tracker, &r);
	if (error)
		return error;
	if (isnan(run.released_s))
		conclude_contact(&run, &r);
	if (!in->body.turns)
		peaks_upright(&tracker);
	for (int i = 0; i < COURSE_SIGNALS; i++)
		r.peak[i] = tracker.peak[i];
	r.s1_direction_rad =
	        atan2(tracker.with[COURSE_S1R][COURSE_S1Y], tracker.with[COURSE_S1R][COURSE_S1X]);
	r.s2_direction_rad =
	        atan2(tracker.with[COURSE_S2R][COURSE_S2Y], tracker.with[COURSE_S2R][COURSE_S2X]);
	if (r.cut_short)
		r.velocity_change_m_s = r.spin_rad_s = (double)NAN;
	r.second_s = run.second_s;
	r.second_corner = run.second_corner;
	r.until_s = run.ode.t;
	r.evaluations = run.ode.evaluations;
	*result = r;
	return 0;
}

/* ---- the history ---- */

static struct course_sample course_sample_of(const struct run *c, const double y[])
{
	struct body_reading r;

	body_read(&c->body, c->touching, y, &r);
	return (struct course_sample){
	        .axis = {r.s1_x, r.s1_y, r.s2_x, r.s2_y},
	        .force_n = r.normal_n,
	        .depth_m = r.depth_m,
	        .travel_m = r.travel_m,
	        .angle_rad = c->body.angle_rad + (c->body.turns ? y[BODY_TURN] : 0.0),
	};
}

int course_history(const struct course *in, double start_s, double step_s, struct course_sample *samples,
                   size_t count)
{
	double end = start_s + step_s * (double)count;
	struct run run;
	int error = 0;

	course_start(&run, in);
	for (size_t i = 0; i < count && !error; i++) {
		double t = start_s + (double)i * step_s, y[BODY_STATES] = {0.0};

		if (!(t > 0.0)) {
			samples[i] = (struct course_sample){.angle_rad = in->body.angle_rad};
			continue;
		}
		while (!error && run.ode.t < t) {
			course_turn_over(&run);
			error = course_step(&run, end);
		}
		if (error)
			break;
		ode_at(&run.ode, t, y);
		samples[i] = course_sample_of(&run, y);
	}
	return error;
}
