/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/motion.h"

#include <math.h>
#include <stdbool.h>

#include "common/units.h"
#include "host/model/contact.h"

enum { UP, TURN, GRIP, V_ACROSS, V_UP, SPIN, OFF_ACROSS, OFF_UP, OFF_V_ACROSS, OFF_V_UP, STATES };

/* Below this angle from the touch on, series are exact to the last digit. */
#define SMALL_TURN 0.05

struct body {
	double mass, plate, inertia, gravity, speed;
	double lever_x, lever_y, cosine, sine, corner_up;
	double stiffness, damping, grip, friction;
	double mount_k, mount_c, softening, per_far2;
	double s2_offset, yaw_cosine, yaw_sine;
	bool released;
};

struct load {
	double cosine, sine, depth, normal;
	double box_across, box_up, spin_rate; /* accelerations as felt: without gravity */
	double plate_across, plate_up;
};

double motion_node_s(size_t node)
{
	return node <= MOTION_FINE_NODES ? (double)node * MOTION_FINE_S
	                                 : MOTION_FINE_NODES * MOTION_FINE_S +
	                                           (double)(node - MOTION_FINE_NODES) * MOTION_COARSE_S;
}

void motion_of_scene(const struct scene *s, double p[MOTION_PARAMETERS])
{
	p[MOTION_LN_STIFFNESS] = log(s->contact_stiffness_n_m15);
	p[MOTION_LOGIT_RESTITUTION] = log(s->contact_restitution / (1.0 - s->contact_restitution));
	p[MOTION_BALANCE_DEG] = s->product_balance_angle_deg;
	p[MOTION_LN_GRIP] = log(s->contact_tangential_ratio);
	p[MOTION_LN_MOUNT_K] = log(s->mount_stiffness_n_m);
	p[MOTION_SOFTENING] = s->mount_softening;
	p[MOTION_LN_STRAIN] = log(s->mount_softening_strain);
	p[MOTION_LN_MOUNT_C] = log(s->mount_damping_n_s_m);
	p[MOTION_YAW_DEG] = s->sensor_s1_yaw_deg;
	p[MOTION_GAMMA_DEG] = s->drop_angle_deg;
	p[MOTION_LN_SPEED] = 0.5 * log(2.0 * s->drop_gravity_m_s2 * s->drop_height_m);
}

double motion_value(enum motion_shared parameter, double p, double *slope)
{
	double value = p, by = 1.0;

	if (parameter == MOTION_LOGIT_RESTITUTION) {
		value = 1.0 / (1.0 + exp(-p));
		by = value * (1.0 - value);
	} else if (parameter != MOTION_BALANCE_DEG && parameter != MOTION_SOFTENING &&
	           parameter != MOTION_YAW_DEG) {
		value = by = exp(p);
	}
	if (slope)
		*slope = by;
	return value;
}

static void motion_mounts(const struct scene *s, const double p[], struct body *b)
{
	double far = exp(p[MOTION_LN_STRAIN]) * s->mount_cube_m;

	b->mount_k = exp(p[MOTION_LN_MOUNT_K]);
	b->mount_c = exp(p[MOTION_LN_MOUNT_C]);
	b->softening = p[MOTION_SOFTENING];
	b->per_far2 = 1.0 / (far * far);
}

static int motion_body(const struct scene *s, const double p[], struct body *b)
{
	double angle = UNITS_RAD(p[MOTION_GAMMA_DEG]), balance = UNITS_RAD(p[MOTION_BALANCE_DEG]);
	double yaw = UNITS_RAD(p[MOTION_YAW_DEG]);
	struct contact_law law;

	if (!(angle > 0.0 && angle < UNITS_PI / 2.0 && balance > 0.0 && balance < UNITS_PI / 2.0) ||
	    contact_law_begin(&law, 1.0 / (1.0 + exp(-p[MOTION_LOGIT_RESTITUTION]))) != 0)
		return DT_E_NUMERIC;
	*b = (struct body){.mass = s->product_case_mass_kg,
	                   .plate = s->mount_plate_mass_kg,
	                   .gravity = s->drop_gravity_m_s2,
	                   .speed = exp(p[MOTION_LN_SPEED]),
	                   .lever_y = s->product_width_m / 2.0,
	                   .cosine = cos(angle),
	                   .sine = sin(angle),
	                   .damping = law.damping,
	                   .grip = exp(p[MOTION_LN_GRIP]),
	                   .friction = s->contact_friction,
	                   .s2_offset = s->sensor_s2_offset_m,
	                   .yaw_cosine = cos(yaw),
	                   .yaw_sine = sin(yaw)};
	b->inertia = s->product_inertia_ratio * b->mass *
	             (s->product_length_m * s->product_length_m + s->product_width_m * s->product_width_m) /
	             12.0;
	b->lever_x = b->lever_y / tan(balance);
	b->corner_up = -(b->lever_x * b->cosine + b->lever_y * b->sine);
	b->stiffness = exp(p[MOTION_LN_STIFFNESS]) * sin(UNITS_RAD(50.0)) / sin(2.0 * angle);
	if (b->plate > 0.0)
		motion_mounts(s, p, b);
	return 0;
}

static void motion_turned(const struct body *b, double turn, struct load *l)
{
	double t2 = turn * turn, c, s;

	if (t2 < SMALL_TURN * SMALL_TURN) {
		c = 1.0 - t2 / 2.0 * (1.0 - t2 / 12.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0)));
		s = turn * (1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0)));
	} else {
		c = cos(turn);
		s = sin(turn);
	}
	l->cosine = b->cosine * c - b->sine * s;
	l->sine = b->sine * c + b->cosine * s;
}

/* along: force along the mat; rate: of the tangential deflection */
static void motion_press(const struct body *b, const double y[], const double arm[2], struct load *l,
                         double *along, double *rate)
{
	double root = sqrt(l->depth), closing = y[SPIN] * arm[0] - y[V_UP],
	       sliding = y[V_ACROSS] + y[SPIN] * arm[1];
	double most;

	l->normal = b->stiffness * l->depth * root * (1.0 + b->damping * closing / b->speed);
	if (!(l->normal > 0.0)) {
		l->normal = 0.0;
		return;
	}
	most = b->friction * l->normal;
	*along = -1.5 * b->grip * b->stiffness * root * y[GRIP];
	*rate = sliding;
	if (fabs(*along) > most) {
		*along = copysign(most, *along);
		if (sliding * y[GRIP] > 0.0)
			*rate = 0.0;
	}
}

static struct load motion_rates(const struct body *b, const double y[], double rate[])
{
	struct load l = {.normal = 0.0};
	double arm[2], along = 0.0, pull[2] = {0.0, 0.0};

	motion_turned(b, y[TURN], &l);
	arm[0] = b->lever_y * l.cosine - b->lever_x * l.sine;
	arm[1] = -(b->lever_x * l.cosine + b->lever_y * l.sine);
	l.depth = b->corner_up - arm[1] - y[UP];
	rate[GRIP] = 0.0;
	if (l.depth > 0.0 && !b->released)
		motion_press(b, y, arm, &l, &along, &rate[GRIP]);
	if (b->plate > 0.0) {
		const double *off = y + OFF_ACROSS;
		double k = b->mount_k *
		           (1.0 + b->softening / (1.0 + (off[0] * off[0] + off[1] * off[1]) * b->per_far2));

		pull[0] = k * off[0] + b->mount_c * (y[OFF_V_ACROSS] - y[SPIN] * off[1]);
		pull[1] = k * off[1] + b->mount_c * (y[OFF_V_UP] + y[SPIN] * off[0]);
		l.plate_across = -pull[0] / b->plate;
		l.plate_up = -pull[1] / b->plate;
	}
	l.box_across = (along + pull[0]) / b->mass;
	l.box_up = (l.normal + pull[1]) / b->mass;
	l.spin_rate = (arm[1] * along - arm[0] * l.normal) / b->inertia;
	rate[UP] = y[V_UP];
	rate[TURN] = y[SPIN];
	rate[V_ACROSS] = l.box_across;
	rate[V_UP] = l.box_up - b->gravity;
	rate[SPIN] = l.spin_rate;
	rate[OFF_ACROSS] = y[OFF_V_ACROSS];
	rate[OFF_UP] = y[OFF_V_UP];
	rate[OFF_V_ACROSS] = l.plate_across - l.box_across;
	rate[OFF_V_UP] = l.plate_up - l.box_up;
	return l;
}

/* rate: at y */
static void motion_step(const struct body *b, double y[], const double rate[], size_t states, double h)
{
	double k2[STATES], k3[STATES], k4[STATES], mid[STATES];

	for (size_t i = 0; i < STATES; i++)
		mid[i] = y[i] + 0.5 * h * rate[i];
	motion_rates(b, mid, k2);
	for (size_t i = 0; i < STATES; i++)
		mid[i] = y[i] + 0.5 * h * k2[i];
	motion_rates(b, mid, k3);
	for (size_t i = 0; i < STATES; i++)
		mid[i] = y[i] + h * k3[i];
	motion_rates(b, mid, k4);
	for (size_t i = 0; i < states; i++)
		y[i] += h / 6.0 * (rate[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
}

static void motion_read(const struct body *b, const struct load *l, double spin, double axis[MOTION_AXES])
{
	double box_x = l->box_across * l->sine + l->box_up * l->cosine;
	double box_y = l->box_up * l->sine - l->box_across * l->cosine;
	double x = box_x, y = box_y;

	if (b->plate > 0.0) {
		x = l->plate_across * l->sine + l->plate_up * l->cosine;
		y = l->plate_up * l->sine - l->plate_across * l->cosine;
	}
	axis[MOTION_S1X] = (x * b->yaw_cosine - y * b->yaw_sine) / UNITS_G_M_S2;
	axis[MOTION_S1Y] = (x * b->yaw_sine + y * b->yaw_cosine) / UNITS_G_M_S2;
	axis[MOTION_S2X] = (box_x - spin * spin * b->s2_offset) / UNITS_G_M_S2;
	axis[MOTION_S2Y] = (box_y - l->spin_rate * b->s2_offset) / UNITS_G_M_S2;
}

/* The deepest of the other three corners is in the mat. */
static bool motion_other_touches(const struct body *b, const struct load *l, const double y[])
{
	double x = b->lever_x * l->cosine, side = b->lever_y * l->sine, up = y[UP] - b->corner_up;

	return up - x - side + 2.0 * fmin(x, side) <= 0.0;
}

/* ---- what is derived ---- */

struct peak {
	double at_s, value, before, last;
};

/* The largest value so far, by the parabola through three nodes of one step. */
static void motion_peak(struct peak *k, size_t node, double value)
{
	double bend = k->before - 2.0 * k->last + value, lean = 0.5 * (value - k->before), most, step;

	if (node >= 2 && node != MOTION_FINE_NODES + 1 && bend != 0.0 &&
	    (fabs(k->last) >= fabs(k->before) && fabs(k->last) >= fabs(value))) {
		most = k->last - 0.5 * lean * lean / bend;
		step = node <= MOTION_FINE_NODES ? MOTION_FINE_S : MOTION_COARSE_S;
		if (fabs(most) > fabs(k->value)) {
			k->value = most;
			k->at_s = motion_node_s(node - 1) - lean / bend * step;
		}
	}
	k->before = k->last;
	k->last = value;
}

struct derived {
	double *into;
	struct peak axis[MOTION_AXES], resultant[2];
	double depth, up, spin; /* at the node before */
};

static void derived_release(struct derived *d, const struct body *b, size_t node, double depth, double up,
                            double spin)
{
	double share = d->depth / (d->depth - depth), from = motion_node_s(node - 1);

	d->into[MOTION_CONTACT_S] = from + share * (motion_node_s(node) - from);
	d->into[MOTION_RESTITUTION] = (d->up + share * (up - d->up)) / b->speed;
	d->into[MOTION_SPIN_RAD_S] = d->spin + share * (spin - d->spin);
}

static void derived_node(struct derived *d, const struct body *b, size_t node, const double y[],
                         const struct load *l, const double axis[])
{
	double up = y[V_UP] + y[OFF_V_UP] * b->plate / (b->plate + b->mass);

	for (int i = 0; i < MOTION_AXES; i++)
		motion_peak(&d->axis[i], node, axis[i]);
	for (int s = 0; s < 2; s++)
		motion_peak(&d->resultant[s], node, hypot(axis[2 * s], axis[2 * s + 1]));
	if (node > 0 && !b->released && l->depth <= 0.0)
		derived_release(d, b, node, l->depth, up, y[SPIN]);
	d->depth = l->depth;
	d->up = up;
	d->spin = y[SPIN];
}

static void derived_end(struct derived *d)
{
	d->into[MOTION_LAG_S] = d->resultant[0].at_s - d->resultant[1].at_s;
	d->into[MOTION_S1R_G] = d->resultant[0].value;
	d->into[MOTION_S2R_G] = d->resultant[1].value;
	for (int i = 0; i < MOTION_AXES; i++)
		d->into[MOTION_PEAK_S1X_G + i] = d->axis[i].value;
}

/* ---- the sensors' high-pass: exact for what goes straight between nodes ---- */

struct high_pass {
	double keep, gain;
};

static struct high_pass high_pass_of(double time_constant_s, double step_s)
{
	double keep;

	if (!(time_constant_s > 0.0))
		return (struct high_pass){0.0, 0.0};
	keep = exp(-step_s / time_constant_s);
	return (struct high_pass){keep, time_constant_s / step_s * (1.0 - keep)};
}

static void motion_sense(const struct high_pass *pass, const double before[], const double now[],
                         const double last[], double out[])
{
	for (int i = 0; i < MOTION_AXES; i++)
		out[i] = pass->gain > 0.0 ? pass->keep * last[i] + pass->gain * (now[i] - before[i]) : now[i];
}

int motion_solve(const struct scene *scene, const double p[MOTION_PARAMETERS], size_t most,
                 struct motion *motion, double into[MOTION_DERIVED])
{
	const double zero[MOTION_AXES] = {0.0};
	const struct high_pass pass[2] = {high_pass_of(scene->sensor_iepe_time_constant_s, MOTION_FINE_S),
	                                  high_pass_of(scene->sensor_iepe_time_constant_s, MOTION_COARSE_S)};
	struct derived derived = {.into = into};
	double y[STATES] = {0.0}, rate[STATES], raw[2][MOTION_AXES];
	struct body b;
	int error = motion_body(scene, p, &b);

	if (error)
		return error;
	if (into)
		for (int i = 0; i < MOTION_DERIVED; i++)
			into[i] = (double)NAN;
	y[V_UP] = -b.speed;
	for (size_t n = 0; n < most; n++) {
		struct load l = motion_rates(&b, y, rate);

		if (b.released && motion_other_touches(&b, &l, y))
			break;
		motion_read(&b, &l, y[SPIN], raw[n & 1]);
		motion_sense(&pass[n > MOTION_FINE_NODES], n ? raw[~n & 1] : zero, raw[n & 1],
		             n ? motion->axis[n - 1] : zero, motion->axis[n]);
		if (into)
			derived_node(&derived, &b, n, y, &l, raw[n & 1]);
		b.released = b.released || (n > 0 && l.depth <= 0.0);
		motion->nodes = n + 1;
		motion_step(&b, y, rate, b.plate > 0.0 ? STATES : OFF_ACROSS,
		            n < MOTION_FINE_NODES ? MOTION_FINE_S : MOTION_COARSE_S);
	}
	motion->end_s = motion_node_s(motion->nodes - 1);
	if (into)
		derived_end(&derived);
	for (int i = 0; i < STATES; i++)
		if (!isfinite(y[i]))
			return DT_E_NUMERIC;
	return 0;
}
