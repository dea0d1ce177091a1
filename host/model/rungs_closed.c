/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The rungs in closed form: paper, steady, sdof. The last two share the box: a half-sine of the contact time
 * with the velocity change (1 + e) v.
 */
#include "host/model/rung.h"

#include <math.h>

#include "common/units.h"
#include "host/model/paper.h"
#include "host/model/sdof.h"

/* ---- paper ---- */

static int paper_of(const struct drop *drop, const struct model_options *options, struct paper_input *in,
                    struct paper_result *r, char *message)
{
	const struct scene *s = drop->scene;
	int error;

	*in = (struct paper_input){
	        .mass_kg = s->product_case_mass_kg + s->mount_plate_mass_kg,
	        .length_m = s->product_length_m,
	        .width_m = s->product_width_m,
	        .angle_rad = drop->angle,
	        .speed_m_s = drop->speed_m_s,
	        .radius_m = s->contact_corner_radius_m,
	        .case_modulus_pa = s->contact_case_modulus_pa,
	        .case_poisson = s->contact_case_poisson,
	        .mat_modulus_pa = s->contact_mat_modulus_pa,
	        .mat_poisson = s->contact_mat_poisson,
	        .case_damping_ratio = s->product_case_damping_ratio,
	        .plate_omega = drop->has_plate ? sqrt(s->mount_stiffness_n_m / s->mount_plate_mass_kg) : 0.0,
	        .mount_damping_ratio = s->mount_damping_ratio,
	        .contact_time_s = options->paper_measured_time ? drop->duration_s : 0.0,
	        .speed_signed = options->paper_signed_speed,
	};
	error = paper_solve(in, r);
	if (error)
		return drop_refuse(message, error,
		                   "the printed equations have no value here: corner_radius_m, damping_ratio "
		                   "(below 1) or a modulus is out of their reach");
	return 0;
}

static int paper_predict(const struct drop *drop, const struct model_options *options,
                         struct model_prediction *p, char *message)
{
	struct paper_input in;
	struct paper_result r;
	int error = paper_of(drop, options, &in, &r, message);

	if (error)
		return error;
	p->velocity_change_m_s = (1.0 + drop->scene->contact_restitution) * drop->speed_m_s;
	p->contact_time_s = r.contact_time_s;
	p->stiffness_n_m15 = r.contact_modulus_pa * sqrt(in.radius_m);
	p->box = (struct model_peak){r.box_m_s2, r.box_time_s};
	p->resultant[0] = p->box;
	if (drop->has_plate) {
		p->resultant[0] = (struct model_peak){r.plate_m_s2, r.plate_time_s};
		rung_swing(in.plate_omega, in.mount_damping_ratio, p);
	}
	p->direction_deg[0] = drop->scene->drop_angle_deg;
	p->peak[MODEL_S1X] =
	        (struct model_peak){p->resultant[0].value_g * drop->cosine, p->resultant[0].time_s};
	p->peak[MODEL_S1Y] =
	        (struct model_peak){p->resultant[0].value_g * drop->sine, p->resultant[0].time_s};
	return 0;
}

static int paper_history(const struct drop *drop, const struct model_options *options, double start_s,
                         double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	struct paper_input in;
	struct paper_result r;
	int error = paper_of(drop, options, &in, &r, message);

	for (size_t k = 0; k < count && !error; k++) {
		double t = start_s + (double)k * step_s;
		double a = drop->has_plate ? paper_plate(&in, &r, t) : paper_box(&in, &r, t);

		value[k][MODEL_S1X] = a * drop->cosine;
		value[k][MODEL_S1Y] = a * drop->sine;
		value[k][MODEL_S2X] = value[k][MODEL_S2Y] = (double)NAN;
	}
	return error;
}

const struct rung rung_paper = {
        .name = "paper",
        .says = "the study's equations as printed, for comparison only: several are wrong, and none gives S2 "
                "or a lag",
        .says_without_plate = "the study's equations as printed, for comparison only: several are wrong",
        .predict = paper_predict,
        .history = paper_history,
};

/* ---- the half-sine of the box ---- */

static double half_sine(const struct drop *drop)
{
	return UNITS_PI * (1.0 + drop->scene->contact_restitution) * drop->speed_m_s /
	       (2.0 * drop->duration_s);
}

static double half_sine_at(const struct drop *drop, double t)
{
	double duration = drop->duration_s;

	return t > 0.0 && t < duration ? half_sine(drop) * sin(UNITS_PI * t / duration) : 0.0;
}

/* What both sensors read when the box takes a half-sine and S1 peaks like this. */
static void fill_half_sine(const struct drop *drop, struct model_peak s1, struct model_prediction *p)
{
	double share_y = drop->share[MODEL_S2Y] - drop->turning;
	struct model_peak box = {half_sine(drop), drop->duration_s / 2.0};

	p->velocity_change_m_s = (1.0 + drop->scene->contact_restitution) * drop->speed_m_s;
	p->contact_time_s = drop->duration_s;
	p->restitution = drop->scene->contact_restitution;
	p->box = box;
	p->peak[MODEL_S1X] = (struct model_peak){s1.value_g * drop->share[MODEL_S1X], s1.time_s};
	p->peak[MODEL_S1Y] = (struct model_peak){s1.value_g * drop->share[MODEL_S1Y], s1.time_s};
	p->peak[MODEL_S2X] = (struct model_peak){box.value_g * drop->share[MODEL_S2X], box.time_s};
	p->peak[MODEL_S2Y] = (struct model_peak){box.value_g * share_y, box.time_s};
	p->resultant[0] = (struct model_peak){fabs(s1.value_g), s1.time_s};
	p->resultant[1] =
	        (struct model_peak){box.value_g * hypot(drop->share[MODEL_S2X], share_y), box.time_s};
	p->direction_deg[0] = drop->scene->drop_angle_deg + drop->scene->sensor_s1_yaw_deg;
	p->direction_deg[1] = UNITS_DEG(atan2(share_y, drop->share[MODEL_S2X]));
}

/* One instant: the plate's (or, without one, the box's) acceleration and the box's. */
static void share_out(const struct drop *drop, double s1, double box, double value[MODEL_AXES])
{
	value[MODEL_S1X] = s1 * drop->share[MODEL_S1X];
	value[MODEL_S1Y] = s1 * drop->share[MODEL_S1Y];
	value[MODEL_S2X] = box * drop->share[MODEL_S2X];
	value[MODEL_S2Y] = box * (drop->share[MODEL_S2Y] - drop->turning);
}

/* ---- steady ---- */

static int steady_of(const struct drop *drop, double *transmissibility, double *phase, char *message)
{
	double forcing = UNITS_PI / drop->duration_s;
	int error;

	*transmissibility = 1.0;
	*phase = 0.0;
	if (!drop->has_plate)
		return 0;
	error = oscillator_steady(forcing / drop->plate_omega, drop->plate_zeta, transmissibility, phase);
	if (error)
		return drop_refuse(
		        message, error,
		        "damping_ratio is 0 and the plate resonates with the pulse: no steady state");
	return 0;
}

static int steady_predict(const struct drop *drop, const struct model_options *options,
                          struct model_prediction *p, char *message)
{
	double duration = drop->duration_s, transmissibility, phase;
	int error = steady_of(drop, &transmissibility, &phase, message);

	(void)options;
	if (error)
		return error;
	fill_half_sine(drop,
	               (struct model_peak){half_sine(drop) * transmissibility,
	                                   duration / 2.0 + phase / (UNITS_PI / duration)},
	               p);
	if (drop->has_plate)
		rung_swing(drop->plate_omega, drop->plate_zeta, p);
	return 0;
}

/* A steady state lasts as long as what drives it: nothing is said of the plate after the contact. */
static int steady_history(const struct drop *drop, const struct model_options *options, double start_s,
                          double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	double duration = drop->duration_s, transmissibility, phase;
	int error = steady_of(drop, &transmissibility, &phase, message);

	(void)options;
	for (size_t k = 0; k < count && !error; k++) {
		double t = start_s + (double)k * step_s, box = half_sine_at(drop, t), s1 = box;

		if (drop->has_plate && t > 0.0)
			s1 = t <= duration ? half_sine(drop) * transmissibility *
			                             sin(UNITS_PI * t / duration - phase)
			                   : (double)NAN;
		share_out(drop, s1, box, value[k]);
	}
	return error;
}

const struct rung rung_steady = {
        .name = "steady",
        .says = "the plate as if the pulse had always gone on: right only by accident, as a drop lasts less "
                "than one cycle",
        .says_without_plate =
                "velocity change and direction; understates the box's peak, whose real pulse is no "
                "half-sine",
        .predict = steady_predict,
        .history = steady_history,
};

/* ---- sdof ---- */

static int sdof_of(const struct drop *drop, struct sdof *sdof, char *message)
{
	int error = 0;

	if (drop->has_plate)
		error = sdof_init(sdof, drop->plate_omega / (2.0 * UNITS_PI), drop->plate_zeta,
		                  half_sine(drop), drop->duration_s);
	return error ? drop_refuse(message, error == DT_E_MEMORY ? error : DT_E_NUMERIC,
	                           "the plate's response is beyond the range of numbers")
	             : 0;
}

static int sdof_predict(const struct drop *drop, const struct model_options *options,
                        struct model_prediction *p, char *message)
{
	struct model_peak s1 = {half_sine(drop), drop->duration_s / 2.0};
	struct sdof sdof;
	int error = sdof_of(drop, &sdof, message);

	(void)options;
	if (error)
		return error;
	if (drop->has_plate) {
		error = sdof_peak(&sdof, &s1.value_g, &s1.time_s);
		if (error)
			return drop_refuse(message, error,
			                   "stiffness_n_m: the plate swings over %d times within the contact",
			                   SDOF_CYCLES_MAX);
		rung_swing(drop->plate_omega, drop->plate_zeta, p);
	}
	fill_half_sine(drop, s1, p);
	return 0;
}

static int sdof_history(const struct drop *drop, const struct model_options *options, double start_s,
                        double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	struct sdof sdof;
	int error = sdof_of(drop, &sdof, message);

	(void)options;
	for (size_t k = 0; k < count && !error; k++) {
		double t = start_s + (double)k * step_s, box = half_sine_at(drop, t);

		share_out(drop, drop->has_plate ? sdof_motion(&sdof, t).acceleration : box, box, value[k]);
	}
	return error;
}

const struct rung rung_sdof = {
        .name = "sdof",
        .says = "explains the plate's peak, frequency and damping; understates the box's peak, whose real "
                "pulse is no half-sine",
        .says_without_plate =
                "explains velocity change and direction; understates the box's peak, whose real "
                "pulse is no half-sine",
        .predict = sdof_predict,
        .history = sdof_history,
};
