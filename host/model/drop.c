/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/drop.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "common/units.h"

int drop_refuse(char *message, int code, const char *format, ...)
{
	va_list arguments;

	if (message) {
		va_start(arguments, format);
		vsnprintf(message, MODEL_MESSAGE_MAX, format, arguments);
		va_end(arguments);
	}
	return code;
}

/* What every rung divides by or takes the root of. A scene that was checked on reading passes; one made or
 * changed in memory may not. */
static int model_drop_check(const struct scene *s, char *message)
{
	const struct {
		const char *key;
		double value, above, most;
	} keys[] = {
	        {"height_m", s->drop_height_m, 0.0, INFINITY},
	        {"gravity_m_s2", s->drop_gravity_m_s2, 0.0, INFINITY},
	        {"angle_deg", s->drop_angle_deg, 0.0, 90.0},
	        {"case_mass_kg", s->product_case_mass_kg, 0.0, INFINITY},
	        {"length_m", s->product_length_m, 0.0, INFINITY},
	        {"width_m", s->product_width_m, 0.0, INFINITY},
	        {"balance_angle_deg", s->product_balance_angle_deg, 0.0, 90.0},
	        {"inertia_ratio", s->product_inertia_ratio, 0.0, INFINITY},
	        {"duration_s", s->contact_duration_s, 0.0, INFINITY},
	        {"duration_height_m", s->contact_duration_height_m, 0.0, INFINITY},
	        {"mass_kg", s->contact_mass_kg, 0.0, INFINITY},
	        {"restitution", s->contact_restitution, 0.0, 1.0 + 1e-15},
	        {"s2_offset_m", s->sensor_s2_offset_m, -INFINITY, INFINITY},
	        {"s1_yaw_deg", s->sensor_s1_yaw_deg, -INFINITY, INFINITY},
	        {"plate_mass_kg", s->mount_plate_mass_kg, -1e-300, INFINITY},
	};

	for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++)
		if (!(keys[i].value > keys[i].above && keys[i].value < keys[i].most))
			return drop_refuse(message, DT_E_ARGUMENT, "%s is %g, expected above %g and below %g",
			                   keys[i].key, keys[i].value, keys[i].above, keys[i].most);
	if (!(s->mount_plate_mass_kg > 0.0))
		return 0;
	if (!(s->mount_stiffness_n_m > 0.0) || !isfinite(s->mount_stiffness_n_m))
		return drop_refuse(message, DT_E_ARGUMENT, "stiffness_n_m is %g, expected above 0",
		                   s->mount_stiffness_n_m);
	if (!(s->mount_damping_ratio >= 0.0) || !isfinite(s->mount_damping_ratio))
		return drop_refuse(message, DT_E_ARGUMENT, "damping_ratio is %g, expected 0 or above",
		                   s->mount_damping_ratio);
	return 0;
}

static double squared_gyration(const struct scene *s)
{
	return s->product_inertia_ratio *
	       (s->product_length_m * s->product_length_m + s->product_width_m * s->product_width_m) / 12.0;
}

/* T is as (m/k)^(2/5) v^(-1/5) for any restitution. Between the case alone and the case with its plate, what
 * of a plate on mounts counts as m is not known: there the measured time stands. */
static double duration_of(const struct scene *s)
{
	double measured_kg = s->contact_mass_kg, case_kg = s->product_case_mass_kg;
	double mass_kg = fmin(fmax(measured_kg, case_kg), case_kg + s->mount_plate_mass_kg);

	return s->contact_duration_s * pow(mass_kg / measured_kg, 0.4) *
	       pow(s->drop_height_m / s->contact_duration_height_m, -0.1);
}

int drop_of_scene(const struct scene *scene, struct drop *drop, char *message)
{
	double angle = UNITS_RAD(scene->drop_angle_deg), s1 = angle + UNITS_RAD(scene->sensor_s1_yaw_deg);
	struct drop d = {.scene = scene, .angle = angle, .cosine = cos(angle), .sine = sin(angle)};
	int error = model_drop_check(scene, message);

	if (error)
		return error;
	d.gravity_m_s2 = scene->drop_gravity_m_s2;
	d.speed_m_s = sqrt(2.0 * d.gravity_m_s2 * scene->drop_height_m);
	d.duration_s = duration_of(scene);
	d.has_plate = scene->mount_plate_mass_kg > 0.0;
	d.lever_y_m = scene->product_width_m / 2.0;
	d.lever_x_m = d.lever_y_m / tan(UNITS_RAD(scene->product_balance_angle_deg));
	d.inertia_kg_m2 = scene->product_case_mass_kg * squared_gyration(scene);
	d.turning = scene->sensor_s2_offset_m * (d.lever_x_m * d.sine - d.lever_y_m * d.cosine) /
	            squared_gyration(scene);
	d.share[MODEL_S1X] = cos(s1);
	d.share[MODEL_S1Y] = sin(s1);
	d.share[MODEL_S2X] = d.cosine;
	d.share[MODEL_S2Y] = d.sine;
	if (d.has_plate) {
		d.plate_omega = sqrt(scene->mount_stiffness_n_m *
		                     (1.0 / scene->mount_plate_mass_kg + 1.0 / scene->product_case_mass_kg));
		d.plate_zeta = scene->mount_damping_ratio;
		d.mount_damping_n_s_m = 2.0 * scene->mount_damping_ratio *
		                        sqrt(scene->mount_stiffness_n_m * scene->mount_plate_mass_kg);
	}
	*drop = d;
	return 0;
}

static int no_law(const struct scene *s, int error, char *message)
{
	return drop_refuse(message, error, "restitution is %g, expected %g to 1", s->contact_restitution,
	                   CONTACT_RESTITUTION_MIN);
}

int drop_contact_law(const struct drop *drop, struct contact_law *law, char *message)
{
	int error = contact_law_begin(law, drop->scene->contact_restitution);

	return error ? no_law(drop->scene, error, message) : 0;
}

int drop_contact(const struct drop *drop, struct contact_law *law, double *stiffness_n_m15, char *message)
{
	const struct scene *s = drop->scene;
	double speed_m_s = sqrt(2.0 * drop->gravity_m_s2 * s->contact_duration_height_m);
	int error = contact_law_init(law, s->contact_restitution);

	if (error)
		return no_law(s, error, message);
	*stiffness_n_m15 = contact_stiffness(law, s->contact_mass_kg, speed_m_s, s->contact_duration_s);
	return 0;
}

static void drop_refine(const struct drop *drop, unsigned refinements, struct body *b)
{
	const struct scene *s = drop->scene;

	if (refinements & MODEL_GRIP) {
		b->grip = s->contact_tangential_ratio;
		b->friction = s->contact_friction;
	}
	if (!drop->has_plate || !(refinements & MODEL_MOUNTS))
		return;
	b->mounts_turn = true;
	b->softening = s->mount_softening;
	if (b->softening > 0.0)
		b->softening_per_m2 = 1.0 / pow(s->mount_softening_strain * s->mount_cube_m, 2.0);
	if (s->mount_damping_n_s_m > 0.0)
		b->mount_damping_n_s_m = s->mount_damping_n_s_m;
}

void drop_body(const struct drop *drop, bool turns, unsigned refinements, struct body *body)
{
	const struct scene *s = drop->scene;

	*body = (struct body){.turns = turns,
	                      .case_mass_kg = s->product_case_mass_kg,
	                      .plate_mass_kg = s->mount_plate_mass_kg,
	                      .inertia_kg_m2 = drop->inertia_kg_m2,
	                      .angle_rad = drop->angle,
	                      .gravity_m_s2 = drop->gravity_m_s2,
	                      .speed_m_s = drop->speed_m_s,
	                      .lever_x_m = drop->lever_x_m,
	                      .lever_y_m = drop->lever_y_m,
	                      .wedge = refinements & MODEL_WEDGE,
	                      .mount_n_m = s->mount_stiffness_n_m,
	                      .mount_damping_n_s_m = drop->mount_damping_n_s_m,
	                      .s2_offset_m = s->sensor_s2_offset_m,
	                      .s1_yaw_rad = UNITS_RAD(s->sensor_s1_yaw_deg)};
	drop_refine(drop, refinements, body);
}
