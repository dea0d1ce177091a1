/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/body.h"

#include <math.h>
#include <string.h>

/* Beyond the friction limit the mat's tangential deflection stops over this share of it: stopped at once, it
 * would chatter wherever the limit grows while the corner slips. */
#define SLIP_RAMP 0.02

/* Below this turn series of sine and cosine are exact to the last digit and cost less. */
#define SMALL_TURN 0.05

/* What acts on the box. */
struct load {
	double cosine, sine;           /* of the angle from the vertical to X */
	double normal, along, torque;  /* of the mat; the torque clockwise, as TURN is */
	double mount_across, mount_up; /* N */
	double depth;
	double creep[BODY_CORNERS]; /* rate of the tangential deflections */
};

struct corner {
	double across, up; /* from the centre of gravity, in the room's axes */
};

static const double side_x[BODY_CORNERS] = {-1.0, 1.0, 1.0, -1.0};
static const double side_y[BODY_CORNERS] = {-1.0, -1.0, 1.0, 1.0};

double body_wedge(double angle_rad)
{
	return sin(2.0 * BODY_WEDGE_RAD) / fmax(fabs(sin(2.0 * angle_rad)), sin(2.0 * BODY_WEDGE_MIN_RAD));
}

static struct corner body_corner(const struct body *b, int corner, double cosine, double sine)
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
	b->per_mass = b->plate_mass_kg > 0.0 ? 1.0 / b->plate_mass_kg + 1.0 / b->case_mass_kg : 0.0;
	memset(b->touch, 0, sizeof(b->touch));
	b->touch[0].speed_m_s = b->speed_m_s;
	b->touch[0].stiffness_n_m15 = b->stiffness_n_m15 * (b->wedge ? body_wedge(b->angle_rad) : 1.0);
}

void body_start(const struct body *b, double y[BODY_STATES])
{
	memset(y, 0, BODY_STATES * sizeof(*y));
	y[BODY_V_UP] = -b->speed_m_s;
}

/* Of the angle at the touch plus turn. */
static void body_turned(const struct body *b, double turn, double *cosine, double *sine)
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

static struct corner corner_now(const struct body *b, const double y[], int corner)
{
	double cosine = b->cosine, sine = b->sine;

	if (b->turns)
		body_turned(b, y[BODY_TURN], &cosine, &sine);
	return body_corner(b, corner, cosine, sine);
}

double body_depth(const struct body *b, const double y[], int corner)
{
	return b->corner_up_m - corner_now(b, y, corner).up - y[BODY_UP];
}

double body_closing(const struct body *b, const double y[], int corner)
{
	return (b->turns ? y[BODY_SPIN] * corner_now(b, y, corner).across : 0.0) - y[BODY_V_UP];
}

int body_grip(int corner)
{
	return corner == 0 ? BODY_GRIP : BODY_ONE_CORNER + corner - 1;
}

void body_touches(struct body *b, double y[], int corner)
{
	double angle = b->angle_rad + (b->turns ? y[BODY_TURN] : 0.0);

	b->touch[corner].speed_m_s = fmax(body_closing(b, y, corner), BODY_SPEED_MIN_M_S);
	b->touch[corner].stiffness_n_m15 = b->stiffness_n_m15 * (b->wedge ? body_wedge(angle) : 1.0);
	y[body_grip(corner)] = 0.0;
}

/* Adds the mat's force on one corner. */
static void press(const struct body *b, const double y[], int corner, struct load *l)
{
	const struct corner at = body_corner(b, corner, l->cosine, l->sine);
	double depth = b->corner_up_m - at.up - y[BODY_UP], root, normal, along = 0.0, grip, most, over;
	double stiffness = b->touch[corner].stiffness_n_m15, closing, sliding;

	if (!(depth > 0.0))
		return;
	l->depth = fmax(l->depth, depth);
	root = sqrt(depth);
	closing = (b->turns ? y[BODY_SPIN] * at.across : 0.0) - y[BODY_V_UP];
	normal = stiffness * depth * root * (1.0 + b->damping * closing / b->touch[corner].speed_m_s);
	if (!(normal > 0.0))
		return;
	if (b->grip > 0.0 && b->turns) {
		grip = y[body_grip(corner)];
		sliding = y[BODY_V_ACROSS] + y[BODY_SPIN] * at.up;
		most = b->friction * normal;
		along = -1.5 * b->grip * stiffness * root * grip;
		l->creep[corner] = sliding;
		over = fabs(along) / most - 1.0;
		if (over > 0.0) {
			along = along < 0.0 ? -most : most;
			if (sliding * grip > 0.0)
				l->creep[corner] =
				        over < SLIP_RAMP ? sliding * (1.0 - over / SLIP_RAMP) : 0.0;
		}
	}
	l->normal += normal;
	l->along += along;
	l->torque += at.up * along - at.across * normal;
}

static void pull(const struct body *b, const double off[4], double spin, struct load *l)
{
	double far2 = off[0] * off[0] + off[1] * off[1];
	double k = b->mount_n_m * (1.0 + b->softening / (1.0 + far2 * b->softening_per_m2));
	double c = b->mount_damping_n_s_m, turn = b->mounts_turn ? spin : 0.0;

	/* SPIN is clockwise: seen from the box, what stands still in the room turns the other way */
	l->mount_across = k * off[0] + c * (off[2] - turn * off[1]);
	l->mount_up = k * off[1] + c * (off[3] + turn * off[0]);
}

static void load_of(const struct body *b, unsigned touching, const double y[], bool angle, struct load *l)
{
	double off[4] = {0.0, y[BODY_OFF_UP], 0.0, y[BODY_OFF_V_UP]}, spin = 0.0;

	*l = (struct load){.cosine = b->cosine, .sine = b->sine};
	if (b->turns) {
		off[0] = y[BODY_OFF_ACROSS];
		off[2] = y[BODY_OFF_V_ACROSS];
		spin = y[BODY_SPIN];
		if (touching || angle)
			body_turned(b, y[BODY_TURN], &l->cosine, &l->sine);
	}
	for (int i = 0; touching >> i; i++)
		if (touching >> i & 1u)
			press(b, y, i, l);
	if (b->plate_mass_kg > 0.0)
		pull(b, off, spin, l);
}

void body_rates(const struct body *b, unsigned touching, const double y[], double rate[])
{
	struct load l;
	double across, up;

	load_of(b, touching, y, false, &l);
	up = (l.normal + l.mount_up) / b->case_mass_kg;
	rate[BODY_UP] = y[BODY_V_UP];
	rate[BODY_V_UP] = up - b->gravity_m_s2;
	rate[BODY_OFF_UP] = y[BODY_OFF_V_UP];
	rate[BODY_OFF_V_UP] = b->plate_mass_kg > 0.0 ? -l.mount_up / b->plate_mass_kg - up : 0.0;
	if (!b->turns)
		return;
	across = (l.along + l.mount_across) / b->case_mass_kg;
	rate[BODY_TURN] = y[BODY_SPIN];
	rate[BODY_SPIN] = l.torque / b->inertia_kg_m2;
	rate[BODY_V_ACROSS] = across;
	rate[BODY_OFF_ACROSS] = y[BODY_OFF_V_ACROSS];
	rate[BODY_OFF_V_ACROSS] = b->plate_mass_kg > 0.0 ? -l.mount_across / b->plate_mass_kg - across : 0.0;
	rate[BODY_GRIP] = l.creep[0];
	for (int i = 1; i < BODY_CORNERS && touching > BODY_FIRST; i++)
		rate[body_grip(i)] = l.creep[i];
}

/* An acceleration in the room's axes seen along X and Y. */
static void along_body(const struct load *l, double across, double up, double *x, double *y)
{
	*x = across * l->sine + up * l->cosine;
	*y = up * l->sine - across * l->cosine;
}

void body_read(const struct body *b, unsigned touching, const double y[], struct body_reading *r)
{
	double spin = b->turns ? y[BODY_SPIN] : 0.0, x, side;
	struct load l;

	load_of(b, touching, y, true, &l);
	along_body(&l, (l.along + l.mount_across) / b->case_mass_kg,
	           (l.normal + l.mount_up) / b->case_mass_kg, &r->box_x, &r->box_y);
	x = r->box_x;
	side = r->box_y;
	r->travel_m = 0.0;
	if (b->plate_mass_kg > 0.0) {
		along_body(&l, -l.mount_across / b->plate_mass_kg, -l.mount_up / b->plate_mass_kg, &x, &side);
		r->travel_m = b->turns ? sqrt(y[BODY_OFF_ACROSS] * y[BODY_OFF_ACROSS] +
		                              y[BODY_OFF_UP] * y[BODY_OFF_UP])
		                       : y[BODY_OFF_UP];
	}
	r->s1_x = x * b->yaw_cosine - side * b->yaw_sine;
	r->s1_y = x * b->yaw_sine + side * b->yaw_cosine;
	r->s2_x = r->box_x - spin * spin * b->s2_offset_m;
	r->s2_y = r->box_y - l.torque / b->inertia_kg_m2 * b->s2_offset_m;
	r->normal_n = l.normal;
	r->depth_m = l.depth;
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
