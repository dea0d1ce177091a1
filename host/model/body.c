/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/body.h"

#include <math.h>
#include <string.h>

/* A hold begins this share of the limit away from where it would end. */
#define HOLD_GAP 1e-9

/* Below this turn series of sine and cosine are exact to the last digit and cost less. */
#define SMALL_TURN 0.05

struct corner {
	double across, up; /* from the centre of gravity, in the room's axes */
};

/* What acts on the box. */
struct load {
	double cosine, sine;           /* of the angle from the vertical to X */
	double normal, along, torque;  /* of the mat; the torque clockwise, as TURN is */
	double mount_across, mount_up; /* N */
	double depth;
	double up_rate, spin_rate;  /* accelerations; up_rate without gravity */
	double creep[BODY_CORNERS]; /* rate of the tangential deflections */
};

/* A corner against the mat. */
struct foot {
	struct corner at;
	double depth, closing, sliding;
};

static const double side_x[BODY_CORNERS] = {-1.0, 1.0, 1.0, -1.0};
static const double side_y[BODY_CORNERS] = {-1.0, -1.0, 1.0, 1.0};

double body_wedge(double angle_rad)
{
	return sin(2.0 * BODY_WEDGE_RAD) / fmax(fabs(sin(2.0 * angle_rad)), sin(2.0 * BODY_WEDGE_MIN_RAD));
}

static inline struct corner body_corner(const struct body *b, int corner, double cosine, double sine)
{
	double x = side_x[corner] * b->lever_x_m, y = side_y[corner] * b->lever_y_m;

	return (struct corner){x * sine - y * cosine, x * cosine + y * sine};
}

void body_prepare(struct body *b)
{
	b->cosine = cos(b->angle_rad);
	b->sine = sin(b->angle_rad);
	b->corner_up_m = body_corner(b, 0, b->cosine, b->sine).up;
	b->yaw_cosine = cos(b->s1_yaw_rad);
	b->yaw_sine = sin(b->s1_yaw_rad);
	b->per_case = 1.0 / b->case_mass_kg;
	b->per_plate = b->plate_mass_kg > 0.0 ? 1.0 / b->plate_mass_kg : 0.0;
	b->per_inertia = b->turns || b->inertia_kg_m2 > 0.0 ? 1.0 / b->inertia_kg_m2 : 0.0;
	b->per_mass = b->plate_mass_kg > 0.0 ? b->per_plate + b->per_case : 0.0;
	memset(b->touch, 0, sizeof(b->touch));
	b->touch[0].damping_s_m = b->law.damping / b->speed_m_s;
	b->touch[0].stiffness_n_m15 = b->stiffness_n_m15 * (b->wedge ? body_wedge(b->angle_rad) : 1.0);
}

void body_start(const struct body *b, double y[BODY_STATES])
{
	memset(y, 0, BODY_STATES * sizeof(*y));
	y[BODY_V_UP] = -b->speed_m_s;
}

/* Of the angle at the touch plus turn. */
static inline void body_turned(const struct body *b, double turn, double *cosine, double *sine)
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

static inline struct foot foot_of(const struct body *b, const double y[], int i, double cosine, double sine)
{
	struct foot f = {body_corner(b, i, cosine, sine), 0.0, -y[BODY_V_UP], 0.0};

	f.depth = b->corner_up_m - f.at.up - y[BODY_UP];
	if (b->turns) {
		f.closing += y[BODY_SPIN] * f.at.across;
		f.sliding = y[BODY_V_ACROSS] + y[BODY_SPIN] * f.at.up;
	}
	return f;
}

static struct foot foot_now(const struct body *b, const double y[], int corner)
{
	double cosine = b->cosine, sine = b->sine;

	if (b->turns)
		body_turned(b, y[BODY_TURN], &cosine, &sine);
	return foot_of(b, y, corner, cosine, sine);
}

double body_depth(const struct body *b, const double y[], int corner)
{
	return foot_now(b, y, corner).depth;
}

double body_closing(const struct body *b, const double y[], int corner)
{
	return foot_now(b, y, corner).closing;
}

int body_grip(int corner)
{
	return corner == 0 ? BODY_GRIP : BODY_ONE_CORNER + corner - 1;
}

/* ---- along the mat ---- */

/* The normal force over K d^1.5, and the deflection at which friction gives way. */
static double damped(const struct body_touch *touch, const struct foot *f)
{
	return 1.0 + touch->damping_s_m * f->closing;
}

static double limit_of(const struct body *b, const struct body_touch *touch, const struct foot *f)
{
	return b->friction / (1.5 * b->grip) * f->depth * damped(touch, f);
}

/* How fast that grows. */
static double limit_rate(const struct body *b, const struct body_touch *touch, const struct foot *f,
                         const struct load *l, double spin)
{
	double closing_rate =
	        l->spin_rate * f->at.across + spin * spin * f->at.up - l->up_rate + b->gravity_m_s2;

	return b->friction / (1.5 * b->grip) *
	       (f->closing * damped(touch, f) + f->depth * touch->damping_s_m * closing_rate);
}

/* Adds the mat's force on one corner. */
static void press(const struct body *b, const double y[], int corner, struct load *l)
{
	const struct body_touch *touch = &b->touch[corner];
	const struct foot f = foot_of(b, y, corner, l->cosine, l->sine);
	double root, normal, along = 0.0, most;

	if (!(f.depth > 0.0))
		return;
	l->depth = f.depth > l->depth ? f.depth : l->depth; /* fmax is a call, here and below */
	root = sqrt(f.depth);
	normal = touch->stiffness_n_m15 * f.depth * root * damped(touch, &f);
	if (!(normal > 0.0))
		return;
	if (b->grip > 0.0 && b->turns) {
		most = b->friction * normal;
		along = -1.5 * b->grip * touch->stiffness_n_m15 * root * y[body_grip(corner)];
		l->creep[corner] = f.sliding;
		if (touch->hold != BODY_STICKS) {
			along = -touch->side * most;
			l->creep[corner] = touch->side * f.sliding < 0.0 ? f.sliding : 0.0;
		} else if (b->clips && fabs(along) > most) {
			along = copysign(most, along);
			if (f.sliding * y[body_grip(corner)] > 0.0)
				l->creep[corner] = 0.0;
		}
	}
	l->normal += normal;
	l->along += along;
	l->torque += f.at.up * along - f.at.across * normal;
}

static void pull(const struct body *b, const double off[4], double spin, struct load *l)
{
	double k = b->mount_n_m, c = b->mount_damping_n_s_m, turn = b->mounts_turn ? spin : 0.0;

	if (b->softening > 0.0)
		k *= 1.0 + b->softening / (1.0 + (off[0] * off[0] + off[1] * off[1]) * b->softening_per_m2);

	/* SPIN is clockwise: seen from the box, what stands still in the room turns the other way */
	l->mount_across = k * off[0] + c * (off[2] - turn * off[1]);
	l->mount_up = k * off[1] + c * (off[3] + turn * off[0]);
}

/* Of a body that does not turn. */
static void load_upright(const struct body *b, unsigned touching, const double y[], struct load *l)
{
	double depth = touching ? -y[BODY_UP] : 0.0, normal;

	if (depth > 0.0) {
		normal = b->touch[0].stiffness_n_m15 * depth * sqrt(depth) *
		         (1.0 - b->touch[0].damping_s_m * y[BODY_V_UP]);
		l->depth = depth;
		l->normal = normal > 0.0 ? normal : 0.0;
	}
	l->torque = -body_corner(b, 0, b->cosine, b->sine).across * l->normal;
	l->mount_up = b->mount_n_m * y[BODY_OFF_UP] + b->mount_damping_n_s_m * y[BODY_OFF_V_UP];
}

static void load_turning(const struct body *b, unsigned touching, const double y[], bool angle,
                         struct load *l)
{
	const double off[4] = {y[BODY_OFF_ACROSS], y[BODY_OFF_UP], y[BODY_OFF_V_ACROSS], y[BODY_OFF_V_UP]};

	if (touching || angle)
		body_turned(b, y[BODY_TURN], &l->cosine, &l->sine);
	for (int i = 0; touching >> i; i++)
		if (touching >> i & 1u)
			press(b, y, i, l);
	if (b->per_plate > 0.0)
		pull(b, off, y[BODY_SPIN], l);
}

static void load_of(const struct body *b, unsigned touching, const double y[], bool angle, struct load *l)
{
	/* one by one: a whole struct cleared at once costs a fifth of all */
	l->cosine = b->cosine;
	l->sine = b->sine;
	l->normal = l->along = l->torque = l->depth = 0.0;
	l->mount_across = l->mount_up = 0.0;
	l->creep[0] = 0.0;
	for (int i = 1; touching >> i; i++)
		l->creep[i] = 0.0;
	if (b->turns)
		load_turning(b, touching, y, angle, l);
	else
		load_upright(b, touching, y, l);
	l->up_rate = (l->normal + l->mount_up) * b->per_case;
	l->spin_rate = l->torque * b->per_inertia;
	for (int i = 0; touching >> i; i++)
		if (b->touch[i].hold == BODY_SLIPS) {
			struct foot f = foot_of(b, y, i, l->cosine, l->sine);

			l->creep[i] = b->touch[i].side * limit_rate(b, &b->touch[i], &f, l, y[BODY_SPIN]);
		}
}

double body_lets_go(const struct body *b, unsigned touching, const double y[], int corner)
{
	const struct body_touch *touch = &b->touch[corner];
	struct foot f = foot_now(b, y, corner);
	struct load l;
	double rate;

	if (touch->hold == BODY_STICKS)
		return fabs(y[body_grip(corner)]) - limit_of(b, touch, &f);
	if (touch->hold == BODY_LAGS) /* of its own side: one step may carry it through to the other limit */
		return limit_of(b, touch, &f) - touch->side * y[body_grip(corner)];
	load_of(b, touching, y, true, &l);
	rate = limit_rate(b, touch, &f, &l, y[BODY_SPIN]);
	return fmax(rate - touch->side * f.sliding, -rate);
}

void body_holds(struct body *b, unsigned touching, double y[], int corner)
{
	struct body_touch *touch = &b->touch[corner];
	struct foot f = foot_now(b, y, corner);
	double *grip = &y[body_grip(corner)], limit = limit_of(b, touch, &f), rate;
	struct load l;

	load_of(b, touching, y, true, &l);
	rate = limit_rate(b, touch, &f, &l, y[BODY_SPIN]);
	touch->side = copysign(1.0, *grip != 0.0 ? *grip : f.sliding);
	touch->hold = !(touch->side * f.sliding > rate) ? BODY_STICKS : rate > 0.0 ? BODY_SLIPS : BODY_LAGS;
	if (touch->hold == BODY_LAGS)
		*grip = touch->side * fmax(fabs(*grip), limit * (1.0 + HOLD_GAP));
	else
		*grip = touch->side * fmax(limit, 0.0) * (touch->hold == BODY_STICKS ? 1.0 - HOLD_GAP : 1.0);
}

void body_touches(struct body *b, double y[], int corner)
{
	struct body_touch *touch = &b->touch[corner];

	touch->damping_s_m = b->law.damping / fmax(body_closing(b, y, corner), BODY_SPEED_MIN_M_S);
	touch->stiffness_n_m15 =
	        b->stiffness_n_m15 *
	        (b->wedge ? body_wedge(b->angle_rad + (b->turns ? y[BODY_TURN] : 0.0)) : 1.0);
	touch->hold = BODY_STICKS;
	y[body_grip(corner)] = 0.0;
	if (b->turns && b->grip > 0.0)
		body_holds(b, 1u << corner, y, corner);
}

/* An acceleration in the room's axes seen along X and Y. */
static void along_body(const struct load *l, double across, double up, double *x, double *y)
{
	*x = across * l->sine + up * l->cosine;
	*y = up * l->sine - across * l->cosine;
}

static void read_load(const struct body *b, const struct load *l, const double y[], struct body_reading *r)
{
	double spin = b->turns ? y[BODY_SPIN] : 0.0, x, side;

	along_body(l, (l->along + l->mount_across) * b->per_case, l->up_rate, &r->box_x, &r->box_y);
	x = r->box_x;
	side = r->box_y;
	r->travel_m = 0.0;
	if (b->plate_mass_kg > 0.0) {
		along_body(l, -l->mount_across * b->per_plate, -l->mount_up * b->per_plate, &x, &side);
		r->travel_m = b->turns ? sqrt(y[BODY_OFF_ACROSS] * y[BODY_OFF_ACROSS] +
		                              y[BODY_OFF_UP] * y[BODY_OFF_UP])
		                       : y[BODY_OFF_UP];
	}
	r->s1_x = x * b->yaw_cosine - side * b->yaw_sine;
	r->s1_y = x * b->yaw_sine + side * b->yaw_cosine;
	r->s2_x = r->box_x - spin * spin * b->s2_offset_m;
	r->s2_y = r->box_y - l->spin_rate * b->s2_offset_m;
	r->normal_n = l->normal;
	r->depth_m = l->depth;
	r->lowest_m =
	        b->corner_up_m + b->lever_x_m * fabs(l->cosine) + b->lever_y_m * fabs(l->sine) - y[BODY_UP];
}

void body_read(const struct body *b, unsigned touching, const double y[], struct body_reading *r)
{
	struct load l;

	load_of(b, touching, y, true, &l);
	read_load(b, &l, y, r);
}

void body_rates(const struct body *b, unsigned touching, const double y[], double rate[],
                struct body_reading *reading)
{
	struct load l;
	double across, up;

	load_of(b, touching, y, reading, &l);
	if (reading)
		read_load(b, &l, y, reading);
	up = l.up_rate;
	rate[BODY_UP] = y[BODY_V_UP];
	rate[BODY_V_UP] = up - b->gravity_m_s2;
	rate[BODY_OFF_UP] = y[BODY_OFF_V_UP];
	rate[BODY_OFF_V_UP] = b->plate_mass_kg > 0.0 ? -l.mount_up * b->per_plate - up : 0.0;
	if (!b->turns)
		return;
	across = (l.along + l.mount_across) * b->per_case;
	rate[BODY_TURN] = y[BODY_SPIN];
	rate[BODY_SPIN] = l.spin_rate;
	rate[BODY_V_ACROSS] = across;
	rate[BODY_OFF_ACROSS] = y[BODY_OFF_V_ACROSS];
	rate[BODY_OFF_V_ACROSS] = b->plate_mass_kg > 0.0 ? -l.mount_across * b->per_plate - across : 0.0;
	rate[BODY_GRIP] = l.creep[0];
	for (int i = 1; i < BODY_CORNERS && touching > BODY_FIRST; i++)
		rate[body_grip(i)] = touching >> i & 1u ? l.creep[i] : 0.0;
}

void body_swing(const struct body *b, double spin, const double off[4], double rate[4])
{
	struct load l;

	pull(b, off, spin, &l);
	rate[0] = off[2];
	rate[1] = off[3];
	rate[2] = -l.mount_across * b->per_mass;
	rate[3] = -l.mount_up * b->per_mass;
}
