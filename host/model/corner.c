/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/corner.h"

#include <math.h>
#include <stddef.h>

#include "common/units.h"
#include "host/model/body.h"
#include "host/model/contact.h"
#include "host/model/drop.h"

struct point {
	double angle_deg, radius;
	double force[CORNER_DEPTHS];
	double mesh_percent[CORNER_DEPTHS];
};

#define LIST(...)           \
	{                   \
		__VA_ARGS__ \
	}
#define CORNER_POINT(angle, radius, force, mesh) {angle, radius, force, mesh},
#define CORNER_APART(angle, radius, force, mesh)
static const struct point points[] = {
#include "host/model/corner.def"
};
#undef CORNER_APART
#undef CORNER_POINT
#undef LIST

/* The table's grid: three angles, of three radii each. */
enum { SIDE = 3 };
_Static_assert(sizeof(points) / sizeof(points[0]) == SIDE * SIDE, "corner.def is another grid");

/* Relative standard uncertainties that are the same for all: what interpolation misses of the points apart,
 * and what the head of corner.def tells of its assumptions. Most of that is the floor: were it smooth, the
 * mat would give twice as much; it is taken to lie anywhere between, the same chance for all. */
#define INTERPOLATION_U 0.03
#define ASSUMPTIONS_U 0.15

/* Dents shallower than this share of the table's first depth are not reached. */
#define SHALLOW 0.5

/* Weights of the parabola through three points. */
static void corner_weights(const double at[SIDE], double x, double weight[SIDE])
{
	for (int i = 0; i < SIDE; i++) {
		weight[i] = 1.0;
		for (int j = 0; j < SIDE; j++)
			weight[i] *= i == j ? 1.0 : (x - at[j]) / (at[i] - at[j]);
	}
}

/* Both faces matter alike at 45 deg and as at the complement anywhere: a function of sin 2 angle. */
static double corner_turned(double angle_deg)
{
	return log(sin(2.0 * UNITS_RAD(angle_deg)));
}

void corner_forces(double angle_deg, double radius, double force[CORNER_DEPTHS])
{
	double turned[SIDE], size[SIDE], by_angle[SIDE], by_radius[SIDE];

	for (int i = 0; i < SIDE; i++) {
		turned[i] = corner_turned(points[i * SIDE].angle_deg);
		size[i] = log(points[i].radius);
	}
	corner_weights(turned, corner_turned(angle_deg), by_angle);
	corner_weights(size, log(radius), by_radius);
	for (int k = 0; k < CORNER_DEPTHS; k++) {
		double sum = 0.0;

		for (int i = 0; i < SIDE * SIDE; i++)
			sum += by_angle[i / SIDE] * by_radius[i % SIDE] * log(points[i].force[k]);
		force[k] = exp(sum);
	}
}

/* The two meshes, where they differ most down to depth k. */
static double mesh_u(int k)
{
	double worst = 0.0;

	for (int i = 0; i < SIDE * SIDE; i++)
		for (int j = 0; j <= k; j++)
			worst = fmax(worst, points[i].mesh_percent[j] / 100.0);
	return worst;
}

/* Where the dent has stored `energy` (over E* length thickness^2), between the depths as a power: its depth
 * over the thickness, the force, and which depth of the table ends that stretch. false: beyond them. */
static bool corner_dent(const double force[CORNER_DEPTHS], double energy, double *depth, double *at_depth,
                        int *last)
{
	double stored = 0.0;

	for (int k = 1; k < CORNER_DEPTHS; k++) {
		double from = k * CORNER_DEPTH_STEP,
		       power = log(force[k] / force[k - 1]) / log((k + 1.0) / k) + 1.0;
		double scale =
		        force[k - 1] * from / power; /* stored = scale (d/from)^power, but for a constant */
		double below = k == 1 ? 0.0 : stored - scale;

		stored = below + scale * pow((k + 1.0) / k, power);
		if (!(energy <= stored))
			continue;
		*depth = from * pow((energy - below) / scale, 1.0 / power);
		*at_depth = force[k - 1] * pow(*depth / from, power - 1.0);
		*last = k;
		return *depth >= SHALLOW * CORNER_DEPTH_STEP;
	}
	return false;
}

static int corner_check(const struct scene *s, char *message)
{
	double radius = s->contact_corner_radius_m / s->contact_mat_thickness_m;

	if (!(radius >= CORNER_RADIUS_MIN && radius <= CORNER_RADIUS_MAX))
		return drop_refuse(
		        message, DT_E_RANGE,
		        "stiffness of a corner: corner_radius_m is %g, expected %g to %g of mat_thickness_m",
		        s->contact_corner_radius_m, CORNER_RADIUS_MIN, CORNER_RADIUS_MAX);
	if (!(s->contact_mat_poisson >= CORNER_POISSON_MIN))
		return drop_refuse(message, DT_E_RANGE,
		                   "stiffness of a corner: mat_poisson is %g, expected %g to 0.5: rubber",
		                   s->contact_mat_poisson, CORNER_POISSON_MIN);
	return 0;
}

/* What of the fall's energy the mat stores in the deepest dent: the rest is lost, or goes into turning. */
static double stored_energy(const struct drop *drop, const struct contact_law *law)
{
	double arm = drop->lever_x_m * drop->sine - drop->lever_y_m * drop->cosine;
	double mass = drop->scene->product_case_mass_kg;
	double felt_kg = mass / (1.0 + mass * arm * arm / drop->inertia_kg_m2);

	return 0.4 * pow(law->depth, 2.5) * felt_kg * drop->speed_m_s * drop->speed_m_s;
}

int corner_predict(const struct scene *scene, struct corner *corner, char *message)
{
	double thickness = scene->contact_mat_thickness_m, force[CORNER_DEPTHS], depth, at_depth, energy;
	double plane = scene->contact_mat_modulus_pa /
	               (1.0 - scene->contact_mat_poisson * scene->contact_mat_poisson);
	double unit = plane * scene->product_thickness_m * thickness;
	struct scene s = *scene;
	struct contact_law law;
	struct drop drop;
	struct corner c;
	int last, error = corner_check(scene, message);

	s.contact_duration_s = 1.0; /* plays no part, but no drop is without */
	if (!error)
		error = drop_of_scene(&s, &drop, message);
	if (!error)
		error = drop_contact_law(&drop, &law, message);
	if (error)
		return error;
	corner_forces(scene->drop_angle_deg, scene->contact_corner_radius_m / thickness, force);
	energy = stored_energy(&drop, &law);
	if (!corner_dent(force, energy / (unit * thickness), &depth, &at_depth, &last))
		return drop_refuse(
		        message, DT_E_RANGE,
		        "stiffness of a corner: mat_modulus_pa is %g, for which the dent is not %.2g to %.2g "
		        "of mat_thickness_m",
		        scene->contact_mat_modulus_pa, SHALLOW * CORNER_DEPTH_STEP,
		        CORNER_DEPTHS * CORNER_DEPTH_STEP);
	c.depth_m = depth * thickness;
	c.stiffness_n_m15 = 2.5 * energy / pow(c.depth_m, 2.5);
	c.misfit = unit * at_depth / (c.stiffness_n_m15 * pow(c.depth_m, 1.5)) - 1.0;
	c.table_u = sqrt(c.misfit * c.misfit + mesh_u(last) * mesh_u(last) +
	                 INTERPOLATION_U * INTERPOLATION_U + ASSUMPTIONS_U * ASSUMPTIONS_U);
	c.relative_u = hypot(c.table_u, scene->contact_mat_modulus_u);
	*corner = c;
	return 0;
}

int corner_fill(struct scene *scene, char *message)
{
	double speed = sqrt(2.0 * scene->drop_gravity_m_s2 * scene->contact_duration_height_m);
	struct contact_law law;
	struct corner corner;
	int error;

	if (!isnan(scene->contact_stiffness_n_m15))
		return 0;
	error = corner_predict(scene, &corner, message);
	if (error)
		return error;
	if (contact_law_init(&law, scene->contact_restitution) != 0)
		return drop_refuse(message, DT_E_ARGUMENT, "restitution is %g", scene->contact_restitution);
	scene->contact_stiffness_n_m15 =
	        corner.stiffness_n_m15 / body_wedge(UNITS_RAD(scene->drop_angle_deg));
	scene->contact_duration_s =
	        contact_duration(&law, scene->contact_mass_kg, speed, corner.stiffness_n_m15);
	scene->predicted_u = scene->fitted_u[0] = corner.relative_u;
	scene->fitted_correlation[0][0] = 1.0;
	return 0;
}

bool corner_predicted(const struct scene *scene)
{
	for (int i = 1; i < SCENE_FITTED; i++)
		if (scene->fitted_u[i] > 0.0)
			return false;
	return scene->fitted_u[0] > 0.0;
}

void corner_follow(struct scene *scene, double *number, double value)
{
	struct corner before, now;
	double wedge = body_wedge(UNITS_RAD(scene->drop_angle_deg)), times = (double)NAN;
	bool known = corner_predict(scene, &before, NULL) == 0;

	*number = value;
	if (known && corner_predict(scene, &now, NULL) == 0)
		times = now.stiffness_n_m15 / before.stiffness_n_m15;
	scene->contact_stiffness_n_m15 *= times * wedge / body_wedge(UNITS_RAD(scene->drop_angle_deg));
	scene->contact_duration_s *= pow(times, -0.4);
}
