/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/product.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "common/units.h"

#define CLEAR_M 1e-5 /* more than gravity and mounts move a box in a step */

/* Beyond this the imprint is no wedge any more and 1/sin would run away. */
#define WEDGE_ANGLE_MIN_RAD UNITS_RAD(10.0)

struct load { /* on the box, about its centre of gravity, counter-clockwise */
	double x_n, y_n, torque_n_m;
};

struct corner {
	double arm_x_m, arm_y_m; /* world axes, from the centre of gravity */
	double depth_m, closing_m_s, sliding_m_s;
};

static const double corner_side[PRODUCT_CORNERS][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};

/* The root D > 0 of ln(1 + D) - ln(1 - e D) = (1 + e) D; the difference is negative below it. */
static double hysteresis(double restitution)
{
	double low = 0, high = 1 / restitution;

	for (int i = 0; i < 100; i++) {
		const double mid = 0.5 * (low + high);

		if (log1p(mid) - log1p(-restitution * mid) < (1 + restitution) * mid)
			low = mid;
		else
			high = mid;
	}
	return low;
}

static double product_wedge(double angle_rad)
{
	return sin(UNITS_RAD(50.0)) / fmax(fabs(sin(2 * angle_rad)), sin(2 * WEDGE_ANGLE_MIN_RAD));
}

static inline struct product_turn turn_of(const double s[])
{
	return (struct product_turn){sin(s[PRODUCT_ANGLE]), cos(s[PRODUCT_ANGLE])};
}

static inline struct corner corner_at(const struct product *p, const double s[], int i,
                                      struct product_turn turn)
{
	const double along_x = corner_side[i][0] * p->lever_x_m, along_y = corner_side[i][1] * p->lever_y_m;
	struct corner c;

	c.arm_x_m = along_x * turn.sn - along_y * turn.cs;
	c.arm_y_m = along_x * turn.cs + along_y * turn.sn;
	c.depth_m = -(s[PRODUCT_Y] + c.arm_y_m);
	/* turning by +angle is clockwise */
	c.closing_m_s = -(s[PRODUCT_VY] - s[PRODUCT_SPIN] * c.arm_x_m);
	c.sliding_m_s = s[PRODUCT_VX] + s[PRODUCT_SPIN] * c.arm_y_m;
	return c;
}

/* Adds the mat's force on one corner; returns how fast its tangential deflection grows. */
static double product_contact_force(const struct product *p, int i, const struct corner *c, double grip_m,
                                    struct load *load)
{
	const double root = sqrt(c->depth_m), k = p->stiffness_n_m15[i];
	const double normal =
	        k * c->depth_m * root * (1 + p->hysteresis * c->closing_m_s / p->approach_m_s[i]);
	const double limit = p->friction * normal;
	double along = -p->tangential_ratio * 1.5 * k * root * grip_m;
	bool slips = false;

	if (normal <= 0)
		return 0;
	if (fabs(along) > limit) {
		along = copysign(limit, along);
		slips = c->sliding_m_s * grip_m > 0;
	}
	load->x_n += along;
	load->y_n += normal;
	load->torque_n_m += c->arm_x_m * normal - c->arm_y_m * along;
	return slips ? 0 : c->sliding_m_s;
}

/* The mounts' force on the box; the plate feels its opposite. */
static struct load product_mount_force(const struct product *p, const double s[])
{
	const double x = s[PRODUCT_PLATE_X] - s[PRODUCT_X], y = s[PRODUCT_PLATE_Y] - s[PRODUCT_Y];
	/* how the offset changes as seen from the turning box */
	const double vx = s[PRODUCT_PLATE_VX] - s[PRODUCT_VX] - s[PRODUCT_SPIN] * y;
	const double vy = s[PRODUCT_PLATE_VY] - s[PRODUCT_VY] + s[PRODUCT_SPIN] * x;
	const double k = p->mount_n_m * (1 + p->softening / (1 + (x * x + y * y) * p->softening_per_m2));

	return (struct load){k * x + p->mount_damping_n_s_m * vx, k * y + p->mount_damping_n_s_m * vy, 0};
}

/* No corner can reach the mat within the step, turn and fall as they may. */
static bool product_clear(const struct product *p, double step_s)
{
	const double lowest_m =
	        p->state[PRODUCT_Y] - fabs(p->lever_x_m * p->turn.cs) - fabs(p->lever_y_m * p->turn.sn);
	const double speed_m_s = fabs(p->state[PRODUCT_VY]) + fabs(p->state[PRODUCT_SPIN]) * p->radius_m;

	return lowest_m > CLEAR_M + speed_m_s * step_s;
}

/* Of all corners, and how fast the deflection under each grows. */
static struct load product_contact_load(const struct product *p, const double s[], struct product_turn turn,
                                        double grip_rate[PRODUCT_CORNERS])
{
	struct load load = {0, 0, 0};

	for (int i = 0; i < PRODUCT_CORNERS; i++) {
		const struct corner c = corner_at(p, s, i, turn);

		grip_rate[i] =
		        c.depth_m > 0 ? product_contact_force(p, i, &c, s[PRODUCT_GRIP + i], &load) : 0;
	}
	return load;
}

/* All but those of PRODUCT_GRIP, which belong to the load. */
static void product_rates(const struct product *p, const double s[], struct load load, double rate[])
{
	struct load mount = {0, 0, 0};

	if (p->plate_mass_kg > 0)
		mount = product_mount_force(p, s);
	rate[PRODUCT_X] = s[PRODUCT_VX];
	rate[PRODUCT_Y] = s[PRODUCT_VY];
	rate[PRODUCT_ANGLE] = s[PRODUCT_SPIN];
	rate[PRODUCT_VX] = (load.x_n + mount.x_n) / p->case_mass_kg;
	rate[PRODUCT_VY] = (load.y_n + mount.y_n) / p->case_mass_kg - p->gravity_m_s2;
	rate[PRODUCT_SPIN] = -load.torque_n_m / p->inertia_kg_m2;
	rate[PRODUCT_PLATE_X] = s[PRODUCT_PLATE_VX];
	rate[PRODUCT_PLATE_Y] = s[PRODUCT_PLATE_VY];
	/* without a plate its place holders ride with the box */
	rate[PRODUCT_PLATE_VX] = p->plate_mass_kg > 0 ? -mount.x_n / p->plate_mass_kg : rate[PRODUCT_VX];
	rate[PRODUCT_PLATE_VY] =
	        p->plate_mass_kg > 0 ? -mount.y_n / p->plate_mass_kg - p->gravity_m_s2 : rate[PRODUCT_VY];
}

/* A corner clear of the mat forgets its last contact and is ready for the next. */
static void corners_renew(struct product *p)
{
	const double stiffness_n_m15 = p->stiffness25_n_m15 * product_wedge(p->state[PRODUCT_ANGLE]);

	for (int i = 0; i < PRODUCT_CORNERS; i++) {
		const struct corner c = corner_at(p, p->state, i, p->turn);

		if (c.depth_m > 0)
			continue;
		p->state[PRODUCT_GRIP + i] = 0;
		p->stiffness_n_m15[i] = stiffness_n_m15;
		p->approach_m_s[i] = fmax(c.closing_m_s, PRODUCT_APPROACH_MIN_M_S);
	}
}

/* What the state asks for: the angle's sine and cosine, and all rates. */
static inline void product_renew(struct product *p, bool clear)
{
	struct load load = {0, 0, 0};

	p->turn = turn_of(p->state);
	if (!clear)
		load = product_contact_load(p, p->state, p->turn, &p->rate[PRODUCT_GRIP]);
	product_rates(p, p->state, load, p->rate);
}

static bool product_rests(const struct product *p)
{
	static const enum product_state speeds[] = {PRODUCT_VY, PRODUCT_VX, PRODUCT_SPIN, PRODUCT_PLATE_VX,
	                                            PRODUCT_PLATE_VY};

	for (size_t i = 0; i < sizeof(speeds) / sizeof(speeds[0]); i++)
		if (fabs(p->state[speeds[i]]) >= PRODUCT_REST_SPEED ||
		    fabs(p->rate[speeds[i]]) >= PRODUCT_REST_RATE)
			return false;
	return true;
}

void product_init(struct product *p, const struct scene *scene, double angle_rad)
{
	const double yaw = UNITS_RAD(scene->sensor_s1_yaw_deg);
	const double strain_m = scene->mount_softening_strain * scene->mount_cube_m;

	memset(p, 0, sizeof(*p));
	p->gravity_m_s2 = scene->drop_gravity_m_s2;
	p->case_mass_kg = scene->product_case_mass_kg;
	p->plate_mass_kg = scene->mount_plate_mass_kg;
	p->inertia_kg_m2 = scene->product_inertia_ratio * scene->product_case_mass_kg *
	                   (scene->product_length_m * scene->product_length_m +
	                    scene->product_width_m * scene->product_width_m) /
	                   12;
	p->lever_y_m = scene->product_width_m / 2;
	p->lever_x_m = p->lever_y_m / tan(UNITS_RAD(scene->product_balance_angle_deg));
	p->radius_m = hypot(p->lever_x_m, p->lever_y_m);
	p->stiffness25_n_m15 = scene->contact_stiffness_n_m15;
	p->hysteresis = hysteresis(scene->contact_restitution);
	p->tangential_ratio = scene->contact_tangential_ratio;
	p->friction = scene->contact_friction;
	p->mount_n_m = scene->mount_stiffness_n_m;
	p->mount_damping_n_s_m = scene->mount_damping_n_s_m;
	p->softening = scene->mount_softening;
	p->softening_per_m2 = strain_m > 0 ? 1 / (strain_m * strain_m) : 0;
	p->s2_offset_m = scene->sensor_s2_offset_m;
	p->yaw_cos = cos(yaw);
	p->yaw_sin = sin(yaw);
	p->state[PRODUCT_ANGLE] = angle_rad;
	p->turn = turn_of(p->state);
}

void product_carry(struct product *p, double down_m_s2)
{
	memset(p->rate, 0, sizeof(p->rate));
	p->rate[PRODUCT_VY] = p->rate[PRODUCT_PLATE_VY] = -down_m_s2;
}

/* Steps of an elastic contact, and of a radian of the plate on its mounts. */
#define STEPS_A_CONTACT 80.0
#define STEPS_A_RADIAN 10.0

/* The whole box on the corner that strikes, as stiff as hysteresis makes it at first. */
static double contact_step_s(const struct product *p, double speed_m_s)
{
	const double k = p->stiffness_n_m15[0] * (1 + p->hysteresis);
	const double contact_s = 2.943 * pow(1.25 * p->case_mass_kg / k, 0.4) * pow(speed_m_s, -0.2);

	return fmin(PRODUCT_STEP_S, contact_s / STEPS_A_CONTACT);
}

static double mount_step_s(const struct product *p)
{
	const double per_mass = 1 / p->plate_mass_kg + 1 / p->case_mass_kg;
	const double swing = sqrt(p->mount_n_m * (1 + p->softening) * per_mass);

	return 1 / (STEPS_A_RADIAN * fmax(swing, p->mount_damping_n_s_m * per_mass));
}

/* While a corner touches or may touch: the slower it came, the lower is its acceleration, whose error then
 * stays what it is in the first contact. */
static double touching_step_s(const struct product *p)
{
	double approach_m_s = PRODUCT_APPROACH_MIN_M_S;

	for (int i = 0; i < PRODUCT_CORNERS; i++)
		approach_m_s = fmax(approach_m_s, p->approach_m_s[i]);
	return fmin(p->mount_step_s, p->contact_step_s * sqrt(p->strike_m_s / approach_m_s));
}

void product_strike(struct product *p, double speed_m_s)
{
	const double angle = p->state[PRODUCT_ANGLE], spin = p->state[PRODUCT_SPIN];
	double height_m = 0;

	memset(p->state, 0, sizeof(p->state));
	p->state[PRODUCT_ANGLE] = angle;
	p->state[PRODUCT_SPIN] = spin;
	p->turn = turn_of(p->state);
	for (int i = 0; i < PRODUCT_CORNERS; i++)
		height_m = fmax(height_m, -corner_at(p, p->state, i, p->turn).arm_y_m);
	p->state[PRODUCT_Y] = p->state[PRODUCT_PLATE_Y] = height_m;
	p->state[PRODUCT_VY] = p->state[PRODUCT_PLATE_VY] = -speed_m_s;
	corners_renew(p);
	product_renew(p, false);
	p->at_rest = false;
	p->strike_m_s = fmax(speed_m_s, PRODUCT_APPROACH_MIN_M_S);
	p->contact_step_s = contact_step_s(p, speed_m_s);
	p->mount_step_s = p->plate_mass_kg > 0 ? mount_step_s(p) : INFINITY;
}

/* Classical Runge-Kutta. */
static inline void product_integrate(struct product *p, double step_s, bool clear)
{
	static const double reach[3] = {0.5, 0.5, 1.0};
	const int states = clear ? PRODUCT_GRIP : PRODUCT_STATES;
	double at[PRODUCT_STATES], slope[PRODUCT_STATES], sum[PRODUCT_STATES];

	memcpy(slope, p->rate, sizeof(slope));
	memcpy(sum, p->rate, sizeof(sum));
	for (int stage = 0; stage < 3; stage++) {
		const double weight = stage < 2 ? 2 : 1;
		struct load load = {0, 0, 0};

		for (int i = 0; i < states; i++)
			at[i] = p->state[i] + reach[stage] * step_s * slope[i];
		if (!clear)
			load = product_contact_load(p, at, turn_of(at), &slope[PRODUCT_GRIP]);
		product_rates(p, at, load, slope);
		for (int i = 0; i < states; i++)
			sum[i] += weight * slope[i];
	}
	for (int i = 0; i < states; i++)
		p->state[i] += step_s / 6 * sum[i];
	product_renew(p, clear);
}

/* The first of so many equal steps that none is longer, but for rounding. */
static double part_s(double span_s, double longest_s)
{
	return span_s > longest_s ? span_s / ceil(span_s / longest_s - 1e-6) : span_s;
}

double product_step(struct product *p, double span_s)
{
	double step_s;

	if (p->at_rest)
		return span_s;
	if (product_clear(p, fmin(span_s, p->mount_step_s))) {
		step_s = part_s(span_s, p->mount_step_s);
		product_integrate(p, step_s, true);
	} else {
		corners_renew(p);
		step_s = part_s(span_s, touching_step_s(p));
		product_integrate(p, step_s, false);
	}
	p->at_rest = product_rests(p);
	return step_s;
}

void product_read(const struct product *p, struct product_reading *reading)
{
	const double sn = p->turn.sn, cs = p->turn.cs;
	const double x = p->rate[PRODUCT_PLATE_VX], y = p->rate[PRODUCT_PLATE_VY] + p->gravity_m_s2;
	const double box_x = p->rate[PRODUCT_VX], box_y = p->rate[PRODUCT_VY] + p->gravity_m_s2;
	const double spin = p->state[PRODUCT_SPIN];
	const double body_x = x * sn + y * cs, body_y = -x * cs + y * sn;

	reading->s1_x = body_x * p->yaw_cos - body_y * p->yaw_sin;
	reading->s1_y = body_x * p->yaw_sin + body_y * p->yaw_cos;
	reading->s2_x = box_x * sn + box_y * cs - spin * spin * p->s2_offset_m;
	reading->s2_y = -box_x * cs + box_y * sn - p->rate[PRODUCT_SPIN] * p->s2_offset_m;
}
