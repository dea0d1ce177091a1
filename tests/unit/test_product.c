/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The product against numbers that other integrators gave for the same equations, against balances that
 * hold whatever the law, and against what the recorded drops showed.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdbool.h>
#include <stdlib.h>

#include "common/units.h"
#include "hil/product.h"
#include "tests/unit/near.h"
#include "tests/unit/shipped.h"

#define IMPACT_M_S 4.18811174636 /* from 0.894 m */
#define G 9.81                   /* as the reference values were computed */

static struct scene scene_of(const char *geometry)
{
	struct scene scene = shipped_scene(geometry);

	scene.drop_gravity_m_s2 = G;
	return scene;
}

/* The reference numbers were computed with this lever, rounded to 0.1 mm. */
static struct scene reference_scene(const char *geometry)
{
	struct scene scene = scene_of(geometry);

	scene.product_balance_angle_deg = UNITS_DEG(atan(0.0505 / 0.1083));
	return scene;
}

struct peak {
	double value, time_s;
};

/* The largest magnitude, by a parabola through the three samples around it. */
static struct peak peak_of(const double *v, size_t count, double step_s)
{
	size_t at = 1;
	double curve, slope;

	for (size_t i = 2; i + 1 < count; i++) {
		if (fabs(v[i]) > fabs(v[at]))
			at = i;
	}
	curve = fabs(v[at - 1]) - 2 * fabs(v[at]) + fabs(v[at + 1]);
	slope = (fabs(v[at + 1]) - fabs(v[at - 1])) / 2;
	return (struct peak){fabs(v[at]) - slope * slope / (2 * curve),
	                     ((double)at - slope / curve) * step_s};
}

enum { S1R, S2R, S1X, S1Y, S2X, S2Y, PEAKS };

static double part_of(const struct product_reading *r, int which)
{
	switch (which) {
	case S1R:
		return hypot(r->s1_x, r->s1_y);
	case S2R:
		return hypot(r->s2_x, r->s2_y);
	case S1X:
		return r->s1_x;
	case S1Y:
		return r->s1_y;
	case S2X:
		return r->s2_x;
	default:
		return r->s2_y;
	}
}

/* Own maxima within the first 12 ms. */
static void peaks_of(const struct scene *scene, double angle_deg, double step_s, struct peak peaks[PEAKS])
{
	const size_t count = (size_t)(0.012 / step_s);
	struct product_reading *r = calloc(count, sizeof(*r));
	double *v = calloc(count, sizeof(*v));
	struct product p;

	assert_non_null(r);
	assert_non_null(v);
	product_init(&p, scene, UNITS_RAD(angle_deg));
	product_strike(&p, IMPACT_M_S);
	for (size_t i = 0; i < count; i++) {
		product_read(&p, &r[i]);
		assert_true(product_step(&p, step_s) == step_s);
	}
	for (int which = 0; which < PEAKS; which++) {
		for (size_t i = 0; i < count; i++)
			v[i] = part_of(&r[i], which);
		peaks[which] = peak_of(v, count, step_s);
	}
	free(v);
	free(r);
}

/* m/s^2 and ms; DOP853 at 1e-9 over the same equations. */
static const struct {
	const char *geometry;
	double angle_deg, peak[PEAKS], lag_ms;
} reference[] = {
        {"1",
         15,
         {5987.48945799, 6135.75647227, 5579.02827177, 2480.92379101, 5577.90581053, 2557.97761214},
         0.023047226},
        {"1",
         25,
         {5140.30839919, 5140.30217022, 4658.71370968, 2172.36208120, 4658.71370968, 2172.34734157},
         -0.000001568},
        {"1",
         35,
         {4654.13368596, 4547.46991651, 4114.58946999, 2297.15218581, 4113.26894142, 1941.42219148},
         -0.049482323},
        {"2A",
         15,
         {3675.67976072, 6158.14460168, 3443.47760351, 1290.42001668, 5595.81623512, 2572.86976561},
         1.859860514},
        {"2A",
         25,
         {3625.54465602, 5146.87508770, 3285.86688414, 1532.20523187, 4664.67095759, 2175.12482994},
         1.902645589},
        {"2A",
         35,
         {3538.79041791, 4541.82117637, 3100.77001503, 1714.65654959, 4111.39746163, 1932.51278626},
         1.863328202},
        {"2B",
         15,
         {4666.25591128, 6136.60863045, 4182.89830873, 2088.47444578, 5574.74305856, 2567.28455061},
         1.359270542},
        {"2B",
         25,
         {4509.29407256, 5121.97554359, 3916.92923076, 2234.14378101, 4642.10430316, 2164.60183583},
         1.379915454},
        {"2B",
         35,
         {4384.44005383, 4513.49134279, 3731.09756015, 2308.29920363, 4087.64673727, 1916.63350751},
         1.339267594},
};

static void compare_with_reference(double step_s, double part, double lag_tolerance_ms)
{
	for (size_t c = 0; c < sizeof(reference) / sizeof(reference[0]); c++) {
		const struct scene scene = reference_scene(reference[c].geometry);
		struct peak peaks[PEAKS];

		peaks_of(&scene, reference[c].angle_deg, step_s, peaks);
		for (int which = 0; which < PEAKS; which++)
			assert_near_part(peaks[which].value, reference[c].peak[which], part);
		assert_near((peaks[S1R].time_s - peaks[S2R].time_s) * 1e3, reference[c].lag_ms,
		            lag_tolerance_ms);
	}
}

static void peaks_agree_with_reference(void **state)
{
	(void)state;
	compare_with_reference(5e-6, 1e-6, 1e-4);
	compare_with_reference(PRODUCT_STEP_S, 2e-5, 1e-3);
}

/* Ten times as short a contact, on mounts ten times as fast. */
static void short_contacts_get_short_steps(void **state)
{
	struct scene scene = scene_of("2A");
	struct peak coarse[PEAKS], fine[PEAKS];
	struct product p;

	(void)state;
	for (int angle = 15; angle <= 35; angle += 5) {
		product_init(&p, &scene, UNITS_RAD(angle));
		product_strike(&p, IMPACT_M_S);
		assert_true(p.contact_step_s == PRODUCT_STEP_S);
	}
	scene.contact_stiffness_n_m15 *= pow(10, 2.5);
	scene.mount_stiffness_n_m *= 100;
	scene.mount_damping_n_s_m *= 10;
	product_init(&p, &scene, UNITS_RAD(25));
	product_strike(&p, IMPACT_M_S);
	peaks_of(&scene, 25, p.contact_step_s, coarse);
	peaks_of(&scene, 25, p.contact_step_s / 20, fine);
	for (int which = 0; which < PEAKS; which++)
		assert_near_part(coarse[which].value, fine[which].value, 1e-3);
}

/* A sharp nominal corner, no tangential force, linear mounts, stiffness the same at every angle. */
static struct scene plain_scene(const char *geometry, double angle_deg)
{
	struct scene scene = scene_of(geometry);

	scene.product_balance_angle_deg = UNITS_DEG(atan(0.101 / 0.289));
	scene.contact_tangential_ratio = 0;
	scene.contact_stiffness_n_m15 = 4227303.27134 * sin(UNITS_RAD(2 * angle_deg)) / sin(UNITS_RAD(50.0));
	scene.mount_softening = 0;
	scene.mount_damping_n_s_m = 2 * 0.1 * sqrt(scene.mount_stiffness_n_m * scene.mount_plate_mass_kg);
	scene.sensor_s1_yaw_deg = 0;
	return scene;
}

/* Another derivation and other programs: rigid body in the plane without friction, and two masses. */
static void peaks_agree_with_plain_models(void **state)
{
	static const struct {
		double angle_deg, peak[PEAKS], spin_end;
	} rigid[] = {
	        /* 183 g */
	        {15,
	         {5186.97608470, 5336.08611517, 5011.33406966, 1338.39815067, 5010.63407682, 1835.03820353},
	         -9.33178230430},
	        {25,
	         {5145.82784583, 4900.96803473, 4661.34973707, 2179.78508601, 4660.12193083, 1517.48246061},
	         12.3522299841},
	        {35,
	         {4642.45243699, 3934.36006034, 3796.75129430, 2671.59329070, 3790.41486040, 1054.48814178},
	         27.6471033442},
	};
	struct peak peaks[PEAKS];
	struct product p;
	struct scene scene;

	(void)state;
	for (size_t c = 0; c < sizeof(rigid) / sizeof(rigid[0]); c++) {
		scene = plain_scene("1", rigid[c].angle_deg);
		scene.product_case_mass_kg = 0.183;
		peaks_of(&scene, rigid[c].angle_deg, 5e-6, peaks);
		for (int which = 0; which < PEAKS; which++)
			assert_near_part(peaks[which].value, rigid[c].peak[which], 1e-6);
		product_init(&p, &scene, UNITS_RAD(rigid[c].angle_deg));
		product_strike(&p, IMPACT_M_S);
		for (int i = 0; i < 1000; i++)
			assert_true(product_step(&p, 5e-6) == 5e-6);
		assert_near_part(p.state[PRODUCT_SPIN], rigid[c].spin_end, 1e-7);
	}
	/* with a plate; that reference damped the plate's speed without minding the box's turning */
	scene = plain_scene("2A", 25);
	peaks_of(&scene, 25, 5e-6, peaks);
	assert_near_part(peaks[S1R].value, 3577.26434552, 2e-5);
	assert_near_part(peaks[S2X].value, 4779.54489157, 2e-5);
	assert_near_part(peaks[S2Y].value, 1550.30496102, 2e-5);
	/* struck in line with its centre the box does not turn: two masses on a line */
	scene = plain_scene("2A", 25);
	scene.product_balance_angle_deg = 25;
	peaks_of(&scene, 25, 5e-6, peaks);
	assert_near_part(peaks[S2R].value, 5373.05617, 1e-6);
	assert_near(peaks[S2R].time_s * 1e3, 0.744308, 1e-4);
	assert_near_part(peaks[S1R].value, 3691.88490, 1e-6);
	assert_near(peaks[S1R].time_s * 1e3, 2.69475824, 1e-4);
	scene = plain_scene("2B", 25);
	scene.product_balance_angle_deg = 25;
	peaks_of(&scene, 25, 5e-6, peaks);
	assert_near_part(peaks[S2R].value, 5357.37183, 1e-6);
	assert_near_part(peaks[S1R].value, 4540.28204, 1e-6);
	assert_near((peaks[S1R].time_s - peaks[S2R].time_s) * 1e3, 1.56917, 1e-4);
}

static void hysteresis_follows_restitution(void **state)
{
	static const double known[][2] = {
	        {0.25, 3.84080603978}, {0.5, 1.43275053327}, {0.75, 0.495911318234}, {0.9, 0.166481950685}};
	struct scene scene = scene_of("1");
	struct product p;

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
		scene.contact_restitution = known[i][0];
		product_init(&p, &scene, UNITS_RAD(25));
		assert_near_part(p.hysteresis, known[i][1], 1e-11);
	}
	/* the ends of the range: e near 1 and near 0 have their own asymptotes */
	scene.contact_restitution = 0.999;
	product_init(&p, &scene, UNITS_RAD(25));
	assert_near_part(p.hysteresis, 1.5 * (1 - 0.999 * 0.999) / (1 + 0.999 * 0.999 * 0.999), 1e-5);
	scene.contact_restitution = 0.01;
	product_init(&p, &scene, UNITS_RAD(25));
	assert_near_part(p.hysteresis, 100.0, 1e-6);
}

struct balance {
	double momentum_x, momentum_y, spin; /* gained, as the forces' integrals */
};

/* The forces on the whole product, from its motion by the law as published. */
static void forces_now(const struct product *p, const struct scene *scene, double angle0, struct balance *f)
{
	const double *s = p->state, lx = 0.0505 / tan(UNITS_RAD(25)), ly = 0.0505;
	const double rx = -lx * sin(s[PRODUCT_ANGLE]) + ly * cos(s[PRODUCT_ANGLE]);
	const double ry = -lx * cos(s[PRODUCT_ANGLE]) - ly * sin(s[PRODUCT_ANGLE]);
	const double d = -(s[PRODUCT_Y] + ry), dd = -(s[PRODUCT_VY] - s[PRODUCT_SPIN] * rx);
	const double k = 3.81e6 * sin(UNITS_RAD(50)) / sin(2 * angle0);
	double n = 0, t = 0;

	if (d > 0)
		n = fmax(0, k * pow(d, 1.5) * (1 + 1.43275053327 * dd / IMPACT_M_S));
	if (n > 0)
		t = fmax(-0.8 * n, fmin(0.8 * n, -2.5 * 1.5 * k * sqrt(d) * s[PRODUCT_GRIP]));
	f->momentum_x = t;
	f->momentum_y = n - (scene->product_case_mass_kg + scene->mount_plate_mass_kg) * G;
	f->spin = -(rx * n - ry * t) / (scene->product_case_mass_kg * (0.289 * 0.289 + 0.101 * 0.101) / 12);
}

/* Simpson's sum of the forces is the change of momentum, for the box with and without a plate. */
static void momentum_balances(void **state)
{
	static const char *const geometry[] = {"1", "2A", "2B"};
	const double step_s = 2e-6;

	(void)state;
	for (int c = 0; c < 9; c++) {
		const struct scene scene = scene_of(geometry[c / 3]);
		const double angle0 = UNITS_RAD(15 + 10 * (c % 3)), mp = scene.mount_plate_mass_kg;
		const double mass = scene.product_case_mass_kg + mp;
		struct balance sum = {0, 0, 0}, f;
		struct product p;

		product_init(&p, &scene, angle0);
		product_strike(&p, IMPACT_M_S);
		for (int i = 0; i <= 2500; i++) {
			const double weight = (i == 0 || i == 2500 ? 1 : i % 2 ? 4 : 2) * step_s / 3;

			forces_now(&p, &scene, angle0, &f);
			sum.momentum_x += weight * f.momentum_x;
			sum.momentum_y += weight * f.momentum_y;
			sum.spin += weight * f.spin;
			if (i < 2500)
				assert_true(product_step(&p, step_s) == step_s);
		}
		assert_near(scene.product_case_mass_kg * p.state[PRODUCT_VX] + mp * p.state[PRODUCT_PLATE_VX],
		            sum.momentum_x, 1e-6);
		assert_near(scene.product_case_mass_kg * p.state[PRODUCT_VY] + mp * p.state[PRODUCT_PLATE_VY],
		            sum.momentum_y - mass * IMPACT_M_S, 1e-6);
		assert_near(p.state[PRODUCT_SPIN], sum.spin, 2e-5);
	}
}

static double clearance(const struct product *p)
{
	const double *s = p->state;

	return s[PRODUCT_Y] - fabs(p->lever_x_m * cos(s[PRODUCT_ANGLE])) -
	       fabs(p->lever_y_m * sin(s[PRODUCT_ANGLE]));
}

/* Motion, weight and what the mounts store; the plate's softening spring by its integral. */
static double energy(const struct product *p)
{
	const double *s = p->state, g = G;
	const double u2 =
	        pow(s[PRODUCT_PLATE_X] - s[PRODUCT_X], 2) + pow(s[PRODUCT_PLATE_Y] - s[PRODUCT_Y], 2);
	const double box =
	        0.5 * (s[PRODUCT_VX] * s[PRODUCT_VX] + s[PRODUCT_VY] * s[PRODUCT_VY]) + g * s[PRODUCT_Y];
	const double plate = 0.5 * (s[PRODUCT_PLATE_VX] * s[PRODUCT_PLATE_VX] +
	                            s[PRODUCT_PLATE_VY] * s[PRODUCT_PLATE_VY]) +
	                     g * s[PRODUCT_PLATE_Y];
	const double soft = p->softening > 0 ? p->softening / p->softening_per_m2 : 0;

	return p->case_mass_kg * box + 0.5 * p->inertia_kg_m2 * s[PRODUCT_SPIN] * s[PRODUCT_SPIN] +
	       p->plate_mass_kg * plate + 0.5 * p->mount_n_m * (u2 + soft * log1p(u2 * p->softening_per_m2));
}

static void free_flight_keeps_energy(void **state)
{
	const struct scene scene = scene_of("1");
	struct product p;
	double start, spin, x_m_s;

	(void)state;
	product_init(&p, &scene, UNITS_RAD(35));
	product_strike(&p, IMPACT_M_S);
	for (int i = 0; i < 250; i++)
		assert_true(product_step(&p, PRODUCT_STEP_S) == PRODUCT_STEP_S);
	assert_true(clearance(&p) > 0);
	start = energy(&p);
	spin = p.state[PRODUCT_SPIN];
	x_m_s = p.state[PRODUCT_VX];
	for (int i = 0; i < 5000; i++)
		assert_true(product_step(&p, PRODUCT_STEP_S) == PRODUCT_STEP_S);
	assert_true(clearance(&p) > 0.05);
	assert_near_part(energy(&p), start, 1e-11);
	assert_near(p.state[PRODUCT_SPIN], spin, 0);
	assert_near(p.state[PRODUCT_VX], x_m_s, 0);
}

/* What the drops showed: half the speed comes back, contact of about 3 ms. */
static void rebound_and_contact_time(void **state)
{
	const struct scene scene = scene_of("1");
	struct product p;
	int steps = 0;

	(void)state;
	product_init(&p, &scene, UNITS_RAD(25));
	product_strike(&p, IMPACT_M_S);
	do
		assert_true(product_step(&p, 1e-6) == 1e-6);
	while (++steps < 10000 && p.rate[PRODUCT_VY] > -G);
	assert_near(p.state[PRODUCT_VY] / IMPACT_M_S, 0.498, 0.001);
	assert_near(steps * 1e-6, 3.13e-3, 0.02e-3);
	assert_near(p.state[PRODUCT_SPIN], 0, 1e-9); /* struck in line with its centre */
}

/* Times and values of the first seven turning points of S1 X, 1 us apart. */
static void turning_points(const char *geometry, double time_s[], double value[], int count)
{
	const struct scene scene = reference_scene(geometry);
	struct product p;
	struct product_reading r;
	double before = 0, last = 0;
	int found = 0;

	product_init(&p, &scene, UNITS_RAD(25));
	product_strike(&p, IMPACT_M_S);
	for (int i = 0; i < 60000 && found < count; i++) {
		product_read(&p, &r);
		if ((last - before) * (r.s1_x - last) < 0) {
			time_s[found] = (i - 1) * 1e-6;
			value[found++] = last;
		}
		before = last;
		last = r.s1_x;
		assert_true(product_step(&p, 1e-6) == 1e-6);
	}
	assert_int_equal(found, count);
}

static void ring_down_stiffens_as_it_fades(void **state)
{
	static const struct {
		const char *geometry;
		double period_ms[3], hz, damping, late_hz;
	} known[] = {
	        {"2A", {7.88, 7.60, 7.36}, 131.4, 0.089, 139.9},
	        {"2B", {5.84, 5.63, 5.57}, 176.0, 0.115, 180.0},
	};
	double t[15], v[15];

	(void)state;
	for (size_t c = 0; c < 2; c++) {
		turning_points(known[c].geometry, t, v, 15);
		for (int i = 0; i < 3; i++)
			assert_near((t[2 * i + 2] - t[2 * i]) * 1e3, known[c].period_ms[i], 0.01);
		assert_near(3 / (t[6] - t[0]), known[c].hz, 0.1);
		assert_near(log(v[0] / v[6]) / 3 / (2 * UNITS_PI), known[c].damping, 0.001);
		/* small strain: k (1 + 1/3) between two free masses, damped by c/k = 0.276 ms */
		assert_near(1 / (t[14] - t[12]), known[c].late_hz, 1.0);
	}
}

/* Bouncing on any corner, the product loses energy every time and comes to lie still. */
static void later_impacts_come_to_rest(void **state)
{
	static const char *const geometry[] = {"1", "2A", "2B"};
	int rests = 0;

	(void)state;
	for (int c = 0; c < 15; c++) {
		const struct scene scene = scene_of(geometry[c % 3]);
		struct product p;
		struct product_reading r;
		bool down = true;
		double last;
		int hits = 1;

		product_init(&p, &scene, UNITS_RAD(10.5 + 4.9 * c));
		product_strike(&p, IMPACT_M_S);
		last = energy(&p);
		for (int i = 0; i < 30000; i++) {
			for (double left_s = 100e-6; left_s > 0;)
				left_s -= product_step(&p, left_s);
			product_read(&p, &r);
			assert_true(hypot(r.s2_x, r.s2_y) < 1100 * G);
			if (down != (clearance(&p) <= 0)) {
				down = !down;
				hits += down;
				if (!down) {
					assert_true(energy(&p) < last * 1.0001);
					last = energy(&p);
				}
			}
		}
		assert_in_range(hits, 3, 60);
		assert_near(hypot(p.state[PRODUCT_VX], p.state[PRODUCT_VY]), 0, 1e-3);
		assert_near(clearance(&p), 0, 1e-3);
		assert_near(hypot(r.s1_x, r.s1_y), G, 0.05);
		assert_near(hypot(r.s2_x, r.s2_y), G, 0.05);
		rests += p.at_rest; /* one that rocks on its short side takes longer */
		for (int i = 0; i < 10000 && p.at_rest; i++) { /* it would not have moved */
			struct product_reading later;

			p.at_rest = false;
			assert_true(product_step(&p, PRODUCT_STEP_S) == PRODUCT_STEP_S);
			p.at_rest = true;
			product_read(&p, &later);
			assert_near(hypot(later.s1_x - r.s1_x, later.s1_y - r.s1_y), 0, 1e-6);
			assert_near(hypot(later.s2_x - r.s2_x, later.s2_y - r.s2_y), 0, 1e-6);
		}
	}
	assert_in_range(rests, 12, 15);
}

/* Set down without speed it sinks in a little and stays; and the mat never pulls. */
static void gentle_touch_and_quick_lift(void **state)
{
	const struct scene scene = scene_of("1");
	struct product p;

	(void)state;
	product_init(&p, &scene, UNITS_RAD(25));
	product_strike(&p, 0);
	for (int i = 0; i < 5000; i++)
		assert_true(product_step(&p, PRODUCT_STEP_S) == PRODUCT_STEP_S);
	/* weight = K d^1.5 */
	assert_near(clearance(&p), -pow(0.173 * G / 3.81e6, 2.0 / 3), 1e-6);
	assert_near(p.state[PRODUCT_VY], 0, 1e-4);
	p.state[PRODUCT_VY] = 50;
	assert_true(product_step(&p, 1e-9) == 1e-9);
	assert_near(p.rate[PRODUCT_VY], -G, 1e-12);
}

static void carried_product_reads_the_reaction(void **state)
{
	const struct scene scene = scene_of("2B");
	struct product p;
	struct product_reading r;

	(void)state;
	product_init(&p, &scene, UNITS_RAD(25));
	product_carry(&p, 0);
	product_read(&p, &r);
	assert_near(r.s2_x, G * 0.906307787037, 1e-10);
	assert_near(r.s2_y, G * 0.422618261741, 1e-10);
	assert_near(r.s1_x, G * 0.868631514438, 1e-10); /* S1 is turned by 4.7 deg: cos, sin of 29.7 deg */
	assert_near(r.s1_y, G * 0.495458668432, 1e-10);
	product_carry(&p, G);
	product_read(&p, &r);
	assert_near(hypot(r.s1_x, r.s1_y) + hypot(r.s2_x, r.s2_y), 0, 1e-12);
	product_carry(&p, -10 * G);
	product_read(&p, &r);
	assert_near(hypot(r.s1_x, r.s1_y), 11 * G, 1e-10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(peaks_agree_with_reference),
	        cmocka_unit_test(short_contacts_get_short_steps),
	        cmocka_unit_test(peaks_agree_with_plain_models),
	        cmocka_unit_test(hysteresis_follows_restitution),
	        cmocka_unit_test(momentum_balances),
	        cmocka_unit_test(free_flight_keeps_energy),
	        cmocka_unit_test(rebound_and_contact_time),
	        cmocka_unit_test(ring_down_stiffens_as_it_fades),
	        cmocka_unit_test(later_impacts_come_to_rest),
	        cmocka_unit_test(gentle_touch_and_quick_lift),
	        cmocka_unit_test(carried_product_reads_the_reaction),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
