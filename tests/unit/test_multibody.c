/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The planar rung against bodies that ODE (Open Dynamics Engine) moves: box and plate are its rigid bodies in
 * space, it finds which corners are in the mat and how deep, and integrates. The mat's and the mounts' forces
 * are written here anew from their definitions; ODE's own contacts are constraints, which have no pulse. Not
 * shown by it: whether a mat follows Hunt and Crossley's law.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <ode/ode.h>
#include <stdio.h>
#include <stdlib.h>

#include "host/model/model.h"
#include "tests/unit/drawn_scene.h"
#include "tests/unit/near.h"

/* ODE's steps are of the first order: what half of them are off by is taken away once. */
enum { STEPS = 16000, DROPS = 30, CORNERS = 4 };
#define PEAK_SHARE 2e-4
#define TIME_SHARE 2e-4
#define APPROACH_MIN_M_S 0.1
#define POINT_M 1e-9 /* radius of a corner, which ODE must see as a ball */

static int drops = DROPS;

enum { S1, S2, BOX, PEAKS };

struct corner {
	dGeomID geom;
	bool touched; /* in the step before */
	double k, approach_m_s, grip_m;
};

struct tower {
	const struct scene *s;
	dWorldID world;
	dSpaceID space;
	dBodyID box, plate;
	dGeomID mat;
	double gravity_m_s2, case_mass_kg, plate_mass_kg, hysteresis;
	struct corner corner[CORNERS];
	dVector3 plate_n; /* the mounts' force on the plate in this step */
};

/* The root of ln((1 + D)/(1 - e D)) = D (1 + e), by halving. */
static double hysteresis_of(double e)
{
	double low = 1e-9, high = 1.0 / e * (1.0 - 1e-15);

	for (int i = 0; i < 200; i++) {
		double d = 0.5 * (low + high);

		if (log((1.0 + d) / (1.0 - e * d)) < d * (1.0 + e))
			low = d;
		else
			high = d;
	}
	return low;
}

static dBodyID rigid_body(dWorldID world, double mass_kg, double inertia_kg_m2)
{
	dBodyID body = dBodyCreate(world);
	dMass mass;

	dMassSetParameters(&mass, mass_kg, 0, 0, 0, inertia_kg_m2, inertia_kg_m2, inertia_kg_m2, 0, 0, 0);
	dBodySetMass(body, &mass);
	dBodySetFiniteRotationMode(body, 1);
	dBodySetGyroscopicMode(body, 0);
	return body;
}

/* x to the side, y up, the mat's face at y = 0; the body's X stands at the angle from the vertical,
 * clockwise. */
static void tower_open(struct tower *t, const struct scene *s)
{
	double angle = UNITS_RAD(s->drop_angle_deg), sn = sin(angle), cs = cos(angle);
	double half_y = 0.5 * s->product_width_m,
	       half_x = half_y / tan(UNITS_RAD(s->product_balance_angle_deg));
	double sides = s->product_length_m * s->product_length_m + s->product_width_m * s->product_width_m;
	double speed = sqrt(2.0 * s->drop_gravity_m_s2 * s->drop_height_m), up = half_x * cs + half_y * sn;
	const dMatrix3 turned = {sn, -cs, 0, 0, cs, sn, 0, 0, 0, 0, 1, 0};

	*t = (struct tower){.s = s,
	                    .world = dWorldCreate(),
	                    .space = dSimpleSpaceCreate(NULL),
	                    .gravity_m_s2 = s->drop_gravity_m_s2,
	                    .case_mass_kg = s->product_case_mass_kg,
	                    .plate_mass_kg = s->mount_plate_mass_kg,
	                    .hysteresis = hysteresis_of(s->contact_restitution)};
	dWorldSetGravity(t->world, 0, -t->gravity_m_s2, 0);
	t->box = rigid_body(t->world, t->case_mass_kg,
	                    s->product_inertia_ratio * t->case_mass_kg * sides / 12.0);
	t->plate = rigid_body(t->world, t->plate_mass_kg, 1.0);
	t->mat = dCreatePlane(t->space, 0, 1, 0, 0);
	for (int i = 0; i < CORNERS; i++) {
		t->corner[i].geom = dCreateSphere(t->space, POINT_M);
		dGeomSetBody(t->corner[i].geom, t->box);
		dGeomSetOffsetPosition(t->corner[i].geom, i & 1 ? half_x : -half_x, i & 2 ? half_y : -half_y,
		                       0);
	}
	dBodySetRotation(t->box, turned);
	dBodySetPosition(t->box, 0, up, 0);
	dBodySetPosition(t->plate, 0, up, 0);
	dBodySetLinearVel(t->box, 0, -speed, 0);
	dBodySetLinearVel(t->plate, 0, -speed, 0);
}

static void tower_close(struct tower *t)
{
	dSpaceDestroy(t->space);
	dWorldDestroy(t->world);
}

/* The angle of the body's X from the vertical. */
static double angle_of(dBodyID box)
{
	const dReal *r = dBodyGetRotation(box);

	return atan2(r[0], r[4]);
}

static void corner_touches(const struct tower *t, struct corner *c, double closing_m_s)
{
	double wedge = fmax(fabs(sin(2.0 * angle_of(t->box))), sin(2.0 * UNITS_RAD(10.0)));

	c->k = t->s->contact_stiffness_n_m15 * sin(UNITS_RAD(50.0)) / wedge;
	c->approach_m_s = fmax(closing_m_s, APPROACH_MIN_M_S);
	c->grip_m = 0.0;
}

/* The mat's force on a corner that ODE found in it. */
static void mat_pushes(struct tower *t, struct corner *c, const dContactGeom *found, double step_s)
{
	double normal, along, limit, gradient;
	dVector3 v;

	dBodyGetPointVel(t->box, found->pos[0], found->pos[1], found->pos[2], v);
	if (!c->touched)
		corner_touches(t, c, -v[1]);
	gradient = c->k * sqrt(found->depth);
	normal = gradient * found->depth * (1.0 - t->hysteresis * v[1] / c->approach_m_s);
	if (normal <= 0.0)
		return;
	along = -t->s->contact_tangential_ratio * 1.5 * gradient * c->grip_m;
	limit = t->s->contact_friction * normal;
	if (fabs(along) <= limit || v[0] * c->grip_m <= 0.0)
		c->grip_m += step_s * v[0];
	along = fmax(-limit, fmin(limit, along));
	dBodyAddForceAtPos(t->box, along, normal, 0, found->pos[0], found->pos[1], found->pos[2]);
}

static void mounts_pull(struct tower *t)
{
	const dReal *a = dBodyGetPosition(t->box), *b = dBodyGetPosition(t->plate);
	double x = b[0] - a[0], y = b[1] - a[1], strain_m = t->s->mount_softening_strain * t->s->mount_cube_m;
	double k = t->s->mount_stiffness_n_m *
	           (1.0 + t->s->mount_softening / (1.0 + (x * x + y * y) / (strain_m * strain_m)));
	const dReal *v = dBodyGetLinearVel(t->plate);
	dVector3 seen; /* the velocity of the box's point where the plate is */

	dBodyGetPointVel(t->box, b[0], b[1], b[2], seen);
	t->plate_n[0] = -k * x - t->s->mount_damping_n_s_m * (v[0] - seen[0]);
	t->plate_n[1] = -k * y - t->s->mount_damping_n_s_m * (v[1] - seen[1]);
	dBodyAddForce(t->plate, t->plate_n[0], t->plate_n[1], 0);
	dBodyAddForce(t->box, -t->plate_n[0], -t->plate_n[1], 0);
}

/* What S1, S2 and one at the box's centre would read, in m/s^2. */
static void sensors_read(const struct tower *t, double reading[PEAKS])
{
	const dReal *force = dBodyGetForce(t->box), *torque = dBodyGetTorque(t->box);
	double spin = dBodyGetAngularVel(t->box)[2], offset = t->s->sensor_s2_offset_m;
	dVector3 own;
	dMass mass;

	dBodyGetMass(t->box, &mass);
	dBodyVectorFromWorld(t->box, force[0], force[1], 0, own);
	reading[S1] = hypot(t->plate_n[0], t->plate_n[1]) / t->plate_mass_kg;
	reading[BOX] = hypot(force[0], force[1]) / t->case_mass_kg;
	reading[S2] = hypot(own[0] / t->case_mass_kg - spin * spin * offset,
	                    own[1] / t->case_mass_kg + torque[2] / mass.I[10] * offset);
}

static void tower_step(struct tower *t, double step_s, double reading[PEAKS])
{
	dContactGeom found;

	for (struct corner *c = t->corner; c < t->corner + CORNERS; c++) {
		int touches = dCollide(c->geom, t->mat, 1, &found, sizeof(found));

		if (touches)
			mat_pushes(t, c, &found, step_s);
		c->touched = touches != 0;
	}
	mounts_pull(t);
	sensors_read(t, reading);
	dWorldStep(t->world, step_s);
}

static void ode_peaks(const struct scene *s, int steps, double until_s, double peak[PEAKS],
                      double when[PEAKS])
{
	double step_s = s->contact_duration_s / steps, reading[PEAKS];
	struct tower t;

	tower_open(&t, s);
	for (int i = 0; i < PEAKS; i++)
		peak[i] = when[i] = 0.0;
	for (size_t k = 0; (double)k * step_s <= until_s; k++) {
		tower_step(&t, step_s, reading);
		for (int i = 0; i < PEAKS; i++)
			if (reading[i] > peak[i]) {
				peak[i] = reading[i];
				when[i] = (double)k * step_s;
			}
	}
	tower_close(&t);
}

static void falls_as_in_ode(void **state)
{
	double worst = 0.0, worst_s = 0.0;
	uint64_t seed = 19;
	int struck = 0;

	(void)state;
	print_message("seed %d\n", (int)seed);
	for (int drop = 0; drop < drops; drop++) {
		struct scene s = drawn_scene(&seed);
		double peak[PEAKS], when[PEAKS], coarse[PEAKS], coarse_when[PEAKS];
		struct model_prediction p;

		assert_int_equal(model_solve(&s, MODEL_PLANAR, NULL, &p, NULL), 0);
		ode_peaks(&s, STEPS / 2, p.until_s, coarse, coarse_when);
		ode_peaks(&s, STEPS, p.until_s, peak, when);
		struck += (p.notes & MODEL_NOTE_STRUCK) != 0;
		for (int i = 0; i < PEAKS; i++) {
			struct model_peak mine = i == BOX ? p.box : p.resultant[i];
			double expected = 2.0 * peak[i] - coarse[i];
			double off = fabs(mine.value_g * UNITS_G_M_S2 / expected - 1.0);
			double late =
			        fabs(mine.time_s - (2.0 * when[i] - coarse_when[i])) / s.contact_duration_s;

			if (off > PEAK_SHARE || late > TIME_SHARE)
				print_message("%d: peak %d is %g g at %g s, in ODE %g g at %g s; notes %x\n",
				              drop, i, mine.value_g, mine.time_s, peak[i] / UNITS_G_M_S2,
				              when[i], p.notes);
			worst = fmax(worst, off);
			worst_s = fmax(worst_s, late);
		}
	}
	print_message("%d drops, %d with a second touch: worst peak off by %.2g, worst time by %.2g of the "
	              "contact\n",
	              drops, struck, worst, worst_s);
	assert_true(struck > 0);
	assert_true(worst <= PEAK_SHARE);
	assert_true(worst_s <= TIME_SHARE);
}

int main(int argc, char **argv)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(falls_as_in_ode)};
	int result;

	if (argc > 3) /* after the builds */
		drops = atoi(argv[3]);
	dInitODE();
	result = cmocka_run_group_tests(tests, NULL, NULL);
	dCloseODE();
	return result;
}
