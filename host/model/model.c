/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/model.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/units.h"
#include "host/model/sdof.h"

/* A scene in the terms of the sdof rung. The box is accelerated by one half-sine; each axis of each sensor
 * takes a share of it that does not change during the contact. */
struct drop {
	double impact_speed_m_s;
	double velocity_change_m_s;
	double pulse_s;
	double amplitude_g;       /* of the half-sine at the centre of gravity */
	double share[MODEL_AXES]; /* of S1 before, of S2 after the mounts' response */
	bool has_plate;
	struct sdof plate; /* valid with has_plate; answers to amplitude_g */
};

int model_fidelity_parse(const char *name, enum model_fidelity *fidelity)
{
	if (!strcmp(name, "auto"))
		*fidelity = MODEL_AUTO;
	else if (!strcmp(name, "sdof"))
		*fidelity = MODEL_SDOF;
	else
		return DT_E_UNKNOWN;
	return 0;
}

/* What S2, off the centre of gravity along X, reads less in Y because the box begins to turn: its offset
 * times the lever of the contact force over the squared radius of gyration. The lever follows from the
 * balance angle, at which it is zero. */
static double turning_share(const struct scene *scene)
{
	double angle = UNITS_RAD(scene->drop_angle_deg);
	double ly = scene->product_width_m / 2.0;
	double lx = ly / tan(UNITS_RAD(scene->product_balance_angle_deg));
	double lever = lx * sin(angle) - ly * cos(angle);
	double gyration2 = scene->product_inertia_ratio *
	                   (scene->product_length_m * scene->product_length_m +
	                    scene->product_width_m * scene->product_width_m) /
	                   12.0;

	return scene->sensor_s2_offset_m * lever / gyration2;
}

/* The plate against the box, both free: the mounts see the reduced mass. */
static double plate_frequency_hz(const struct scene *scene)
{
	double per_mass = 1.0 / scene->mount_plate_mass_kg + 1.0 / scene->product_case_mass_kg;

	return sqrt(scene->mount_stiffness_n_m * per_mass) / (2.0 * UNITS_PI);
}

static int drop_of_scene(const struct scene *scene, struct drop *drop)
{
	double angle = UNITS_RAD(scene->drop_angle_deg);
	double s1_angle = angle + UNITS_RAD(scene->sensor_s1_yaw_deg);
	struct drop d = {.has_plate = scene->mount_plate_mass_kg > 0.0, .pulse_s = scene->contact_duration_s};

	d.impact_speed_m_s = sqrt(2.0 * UNITS_G_M_S2 * scene->drop_height_m);
	d.velocity_change_m_s = (1.0 + scene->contact_restitution) * d.impact_speed_m_s;
	d.amplitude_g = UNITS_PI * d.velocity_change_m_s / (2.0 * d.pulse_s) / UNITS_G_M_S2;
	d.share[MODEL_S1X] = cos(s1_angle);
	d.share[MODEL_S1Y] = sin(s1_angle);
	d.share[MODEL_S2X] = cos(angle);
	d.share[MODEL_S2Y] = sin(angle) - turning_share(scene);
	for (enum model_axis axis = 0; axis < MODEL_AXES; axis++)
		if (!isfinite(d.share[axis]))
			return DT_E_NUMERIC;
	if (!isfinite(d.amplitude_g) || !(d.amplitude_g > 0.0) || !(d.pulse_s > 0.0))
		return DT_E_NUMERIC;
	if (d.has_plate && sdof_init(&d.plate, plate_frequency_hz(scene), scene->mount_damping_ratio,
	                             d.amplitude_g, d.pulse_s) < 0)
		return DT_E_NUMERIC;
	*drop = d;
	return 0;
}

static double pulse_g(const struct drop *drop, double time_s)
{
	if (!(time_s > 0.0) || time_s >= drop->pulse_s)
		return 0.0;
	return drop->amplitude_g * sin(UNITS_PI * time_s / drop->pulse_s);
}

static bool axis_on_plate(const struct drop *drop, enum model_axis axis)
{
	return drop->has_plate && (axis == MODEL_S1X || axis == MODEL_S1Y);
}

static void give_reason(const struct drop *drop, enum model_fidelity fidelity, char *reason, size_t size)
{
	const char *why = fidelity == MODEL_AUTO ? "the least rung, and today the only one" : "asked for";

	if (drop->has_plate)
		snprintf(reason, size,
		         "%s: explains the plate's peak, frequency and damping; understates the box's peak, "
		         "whose real pulse is no half-sine",
		         why);
	else
		snprintf(reason, size,
		         "%s: explains velocity change and direction; understates the box's peak, whose real "
		         "pulse is no half-sine",
		         why);
}

int model_predict(const struct scene *scene, enum model_fidelity fidelity,
                  struct model_prediction *prediction)
{
	struct model_prediction p = {.fidelity = "sdof"};
	struct model_peak box, s1;
	struct drop drop;
	int error = drop_of_scene(scene, &drop);

	if (error)
		return error;
	box = (struct model_peak){.value_g = drop.amplitude_g, .time_s = drop.pulse_s / 2.0};
	s1 = box;
	if (drop.has_plate) {
		error = sdof_peak(&drop.plate, &s1.value_g, &s1.time_s);
		if (error)
			return error;
		p.plate_frequency_hz = drop.plate.omega_d / (2.0 * UNITS_PI);
		p.plate_damping_ratio = drop.plate.zeta;
	}
	p.has_plate = drop.has_plate;
	p.impact_speed_m_s = drop.impact_speed_m_s;
	p.velocity_change_m_s = drop.velocity_change_m_s;
	p.contact_time_s = drop.pulse_s;
	for (enum model_axis axis = 0; axis < MODEL_AXES; axis++) {
		p.peak[axis] = axis_on_plate(&drop, axis) ? s1 : box;
		p.peak[axis].value_g *= drop.share[axis];
	}
	p.resultant[0] = (struct model_peak){fabs(s1.value_g), s1.time_s};
	p.resultant[1] = box;
	p.resultant[1].value_g *= hypot(drop.share[MODEL_S2X], drop.share[MODEL_S2Y]);
	p.lag_s = p.resultant[0].time_s - p.resultant[1].time_s;
	give_reason(&drop, fidelity, p.reason, sizeof(p.reason));
	*prediction = p;
	return 0;
}

int model_history(const struct scene *scene, enum model_fidelity fidelity, enum model_axis axis,
                  double start_s, double step_s, double *value_g, size_t count)
{
	struct drop drop;
	int error = drop_of_scene(scene, &drop);

	(void)fidelity; /* one rung so far: every name gives it */
	if (error)
		return error;
	for (size_t k = 0; k < count; k++) {
		double t = start_s + (double)k * step_s;
		double whole = axis_on_plate(&drop, axis) ? sdof_motion(&drop.plate, t).acceleration
		                                          : pulse_g(&drop, t);

		value_g[k] = drop.share[axis] * whole;
	}
	return 0;
}
