/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/motion.h"

#include <math.h>
#include <stdbool.h>

#include "common/units.h"
#include "host/model/drop.h"

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

void motion_to_scene(const double p[MOTION_SHARED], struct scene *s)
{
	double value[MOTION_SHARED];

	for (size_t i = 0; i < MOTION_SHARED; i++)
		value[i] = motion_value((enum motion_shared)i, p[i], NULL);
	s->contact_stiffness_n_m15 = value[MOTION_LN_STIFFNESS];
	s->contact_restitution = value[MOTION_LOGIT_RESTITUTION];
	s->product_balance_angle_deg = value[MOTION_BALANCE_DEG];
	s->contact_tangential_ratio = value[MOTION_LN_GRIP];
	if (!(s->mount_plate_mass_kg > 0.0))
		return;
	s->mount_stiffness_n_m = value[MOTION_LN_MOUNT_K];
	s->mount_softening = value[MOTION_SOFTENING];
	s->mount_softening_strain = value[MOTION_LN_STRAIN];
	s->mount_damping_n_s_m = value[MOTION_LN_MOUNT_C];
	s->sensor_s1_yaw_deg = value[MOTION_YAW_DEG];
}

static int motion_body(const struct scene *scene, const double p[], struct body *b)
{
	struct scene s = *scene;
	struct contact_law law;
	struct drop drop;

	motion_to_scene(p, &s);
	s.drop_angle_deg = p[MOTION_GAMMA_DEG];
	if (drop_of_scene(&s, &drop, NULL) != 0 || drop_contact_law(&drop, &law, NULL) != 0)
		return DT_E_NUMERIC;
	drop.speed_m_s = exp(p[MOTION_LN_SPEED]);
	drop_body(&drop, true, MODEL_REFINEMENTS, b);
	b->law = law;
	b->stiffness_n_m15 = s.contact_stiffness_n_m15;
	b->clips = true;
	body_prepare(b);
	return 0;
}

/* rate: at y */
static void motion_step(const struct body *b, unsigned touching, double y[], const double rate[], double h)
{
	double k2[BODY_ONE_CORNER], k3[BODY_ONE_CORNER], k4[BODY_ONE_CORNER], mid[BODY_ONE_CORNER];

	for (size_t i = 0; i < BODY_ONE_CORNER; i++)
		mid[i] = y[i] + 0.5 * h * rate[i];
	body_rates(b, touching, mid, k2, NULL);
	for (size_t i = 0; i < BODY_ONE_CORNER; i++)
		mid[i] = y[i] + 0.5 * h * k2[i];
	body_rates(b, touching, mid, k3, NULL);
	for (size_t i = 0; i < BODY_ONE_CORNER; i++)
		mid[i] = y[i] + h * k3[i];
	body_rates(b, touching, mid, k4, NULL);
	for (size_t i = 0; i < BODY_ONE_CORNER; i++)
		y[i] += h / 6.0 * (rate[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
}

/* ---- what is derived ---- */

struct peak {
	double at_s, value, before, last;
};

/* The largest value so far, by the parabola through three nodes of one step, which rises above the middle one
 * by less than the half of it. */
static void motion_peak(struct peak *k, size_t node, double value)
{
	double middle = fabs(k->last), bend, lean, most, step;

	if (middle >= fabs(k->before) && middle >= fabs(value) && 1.5 * middle > fabs(k->value) &&
	    node >= 2 && node != MOTION_FINE_NODES + 1) {
		bend = k->before - 2.0 * k->last + value;
		lean = 0.5 * (value - k->before);
		most = k->last - (bend != 0.0 ? 0.5 * lean * lean / bend : 0.0);
		step = node <= MOTION_FINE_NODES ? MOTION_FINE_S : MOTION_COARSE_S;
		if (bend != 0.0 && fabs(most) > fabs(k->value)) {
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
	d->into[MOTION_RESTITUTION] = (d->up + share * (up - d->up)) / b->speed_m_s;
	d->into[MOTION_SPIN_RAD_S] = d->spin + share * (spin - d->spin);
}

static void derived_node(struct derived *d, const struct body *b, size_t node, const double y[], double depth,
                         bool released, const double axis[])
{
	double up = y[BODY_V_UP] + y[BODY_OFF_V_UP] * b->plate_mass_kg / (b->plate_mass_kg + b->case_mass_kg);

	for (int i = 0; i < MOTION_AXES; i++)
		motion_peak(&d->axis[i], node, axis[i]);
	for (int s = 0; s < 2; s++)
		motion_peak(&d->resultant[s], node,
		            sqrt(axis[2 * s] * axis[2 * s] + axis[2 * s + 1] * axis[2 * s + 1]));
	if (node > 0 && !released && depth <= 0.0)
		derived_release(d, b, node, depth, up, y[BODY_SPIN]);
	d->depth = depth;
	d->up = up;
	d->spin = y[BODY_SPIN];
}

static void derived_end(struct derived *d)
{
	d->into[MOTION_LAG_S] = d->resultant[0].at_s - d->resultant[1].at_s;
	d->into[MOTION_LAG_X_S] = d->axis[MOTION_S1X].at_s - d->axis[MOTION_S2X].at_s;
	d->into[MOTION_S1R_G] = d->resultant[0].value;
	d->into[MOTION_S2R_G] = d->resultant[1].value;
	for (int i = 0; i < MOTION_AXES; i++)
		d->into[MOTION_PEAK_S1X_G + i] = d->axis[i].value;
}

static void motion_read(const struct body_reading *r, double axis[MOTION_AXES])
{
	axis[MOTION_S1X] = r->s1_x / UNITS_G_M_S2;
	axis[MOTION_S1Y] = r->s1_y / UNITS_G_M_S2;
	axis[MOTION_S2X] = r->s2_x / UNITS_G_M_S2;
	axis[MOTION_S2Y] = r->s2_y / UNITS_G_M_S2;
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
	double y[BODY_STATES], rate[BODY_STATES], raw[2][MOTION_AXES];
	bool released = false;
	struct body b;
	int error = motion_body(scene, p, &b);

	if (error)
		return error;
	if (into)
		for (int i = 0; i < MOTION_DERIVED; i++)
			into[i] = (double)NAN;
	body_start(&b, y);
	for (size_t n = 0; n < most; n++) {
		struct body_reading r;
		double depth;

		body_rates(&b, released ? 0u : BODY_FIRST, y, rate, &r);
		if (released && r.lowest_m > 0.0)
			break;
		motion_read(&r, raw[n & 1]);
		motion_sense(&pass[n > MOTION_FINE_NODES], n ? raw[~n & 1] : zero, raw[n & 1],
		             n ? motion->axis[n - 1] : zero, motion->axis[n]);
		depth = released || r.depth_m > 0.0 ? r.depth_m : body_depth(&b, y, 0);
		if (into)
			derived_node(&derived, &b, n, y, depth, released, raw[n & 1]);
		released = released || (n > 0 && depth <= 0.0);
		motion->nodes = n + 1;
		motion_step(&b, released ? 0u : BODY_FIRST, y, rate,
		            n < MOTION_FINE_NODES ? MOTION_FINE_S : MOTION_COARSE_S);
	}
	motion->end_s = motion_node_s(motion->nodes - 1);
	if (into)
		derived_end(&derived);
	for (int i = 0; i < BODY_ONE_CORNER; i++)
		if (!isfinite(y[i]))
			return DT_E_NUMERIC;
	return 0;
}
