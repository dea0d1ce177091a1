/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The rungs that integrate the contact: coupled and planar.
 */
#include "host/model/rung.h"

#include <math.h>
#include <stdlib.h>

#include "common/units.h"
#include "host/model/coupled.h"
#include "host/model/planar.h"

/* What one step may miss, for all of them together to stay within the tolerance of peaks. */
#define STEP_SHARE 0.05

/* From this tolerance of peaks on a parabola is as good as the steps are. */
#define ROUGH_TOLERANCE 2e-3

static double step_tolerance(const struct model_options *options)
{
	return STEP_SHARE * (options->tolerance > 0.0 ? options->tolerance : MODEL_TOLERANCE);
}

/* One that was not looked for is 0. */
static struct model_peak peak_of(struct watch_peak peak)
{
	if (peak.value == 0.0)
		return (struct model_peak){(double)NAN, (double)NAN};
	return (struct model_peak){peak.value, peak.time_s};
}

/* Signals that no question asks for; the dent is always looked at. */
static unsigned skipped_of(const struct model_options *options, const unsigned wanted_by[], unsigned signals)
{
	unsigned skipped = 0;

	for (unsigned i = 0; i < signals && options->asked; i++)
		if (!(wanted_by[i] & options->asked))
			skipped |= 1u << i;
	return skipped;
}

static struct model_peak scaled(struct watch_peak peak, double share)
{
	return (struct model_peak){peak_of(peak).value_g * share, peak_of(peak).time_s};
}

/* Whoever asks for little, and that not to many digits. */
static bool rough(const struct model_options *options)
{
	return options->asked && options->tolerance >= ROUGH_TOLERANCE;
}

static double direction_of(struct model_peak resultant, double direction_rad)
{
	return isnan(resultant.value_g) ? (double)NAN : UNITS_DEG(direction_rad);
}

static int not_solved(char *message, int error)
{
	return drop_refuse(
	        message, error,
	        "the motion could not be followed: restitution, stiffness_n_m or damping_ratio is too "
	        "extreme");
}

/* Those asked for, of those the rung knows. */
static unsigned refinements_of(const struct model_options *options, unsigned known, unsigned own)
{
	return options->refinements & MODEL_OF_RUNG ? own : options->refinements & known;
}

/* The contact's law and its stiffness. */
static int contact_of(const struct drop *drop, unsigned refinements, struct contact_law *law,
                      double *stiffness_n_m15, char *message)
{
	double given = drop->scene->contact_stiffness_n_m15;
	bool by_time = !(refinements & MODEL_STIFFNESS);
	int error = by_time ? drop_contact(drop, law, stiffness_n_m15, message)
	                    : drop_contact_law(drop, law, message);

	if (error)
		return error;
	if (!by_time) {
		if (!(given > 0.0) || !isfinite(given))
			return drop_refuse(message, DT_E_ARGUMENT, "stiffness_n_m15 is %g, expected above 0",
			                   given);
		*stiffness_n_m15 = given;
	}
	return 0;
}

/* ---- coupled ---- */

#define COUPLED_KNOWS (MODEL_STIFFNESS | MODEL_WEDGE)

static int coupled_of(const struct drop *drop, const struct model_options *options, struct coupled *c,
                      char *message)
{
	const struct scene *s = drop->scene;
	unsigned refinements = refinements_of(options, COUPLED_KNOWS, 0);
	int error;

	static const unsigned wanted_by[COUPLED_SIGNALS] = {
	        [COUPLED_BOX] = MODEL_ASK_BOX | MODEL_ASK_S2,
	        [COUPLED_PLATE] = MODEL_ASK_PLATE | MODEL_ASK_AXES | MODEL_ASK_LAG,
	        [COUPLED_TURNED] = MODEL_ASK_S2,
	        [COUPLED_TURNED_R] = MODEL_ASK_S2 | MODEL_ASK_LAG | MODEL_ASK_DIRECTION,
	        [COUPLED_DENT] = MODEL_ASK_ALL,
	};

	*c = (struct coupled){
	        .case_mass_kg = s->product_case_mass_kg,
	        .plate_mass_kg = s->mount_plate_mass_kg,
	        .gravity_m_s2 = drop->gravity_m_s2,
	        .speed_m_s = drop->speed_m_s,
	        .mount_n_m = s->mount_stiffness_n_m,
	        .mount_damping_n_s_m = drop->mount_damping_n_s_m,
	        .turning = drop->turning,
	        .share_x = drop->share[MODEL_S2X],
	        .share_y = drop->share[MODEL_S2Y],
	        .tolerance = step_tolerance(options),
	        .skipped = skipped_of(options, wanted_by, COUPLED_SIGNALS),
	        .rough = rough(options),
	};
	error = contact_of(drop, refinements, &c->law, &c->stiffness_n_m15, message);
	if (refinements & MODEL_WEDGE)
		c->stiffness_n_m15 *= body_wedge(drop->angle);
	return error;
}

/* Two masses on a linear mount, both free: their damping ratio against each other. */
static void fill_linear_plate(const struct drop *drop, double damping_n_s_m, struct model_prediction *p)
{
	double zeta = 0.5 * damping_n_s_m * drop->plate_omega / drop->scene->mount_stiffness_n_m;

	p->plate_damping_ratio = zeta;
	p->plate_frequency_hz =
	        zeta < 1.0 ? drop->plate_omega * sqrt((1.0 - zeta) * (1.0 + zeta)) / (2.0 * UNITS_PI)
	                   : (double)NAN;
}

static int coupled_predict(const struct drop *drop, const struct model_options *options,
                           struct model_prediction *p, char *message)
{
	struct coupled c;
	struct coupled_result r;
	int error = coupled_of(drop, options, &c, message);

	if (error)
		return error;
	error = coupled_solve(&c, &r);
	if (error)
		return not_solved(message, error);
	p->refinements = refinements_of(options, COUPLED_KNOWS, 0);
	p->velocity_change_m_s = r.velocity_change_m_s;
	p->contact_time_s = r.contact_time_s;
	p->restitution = r.restitution;
	p->stiffness_n_m15 = c.stiffness_n_m15;
	p->dent_m = r.depth_m;
	p->notes = isnan(r.contact_time_s) ? MODEL_NOTE_STUCK : 0u;
	p->box = peak_of(r.box);
	p->peak[MODEL_S1X] = scaled(r.plate, drop->share[MODEL_S1X]);
	p->peak[MODEL_S1Y] = scaled(r.plate, drop->share[MODEL_S1Y]);
	p->peak[MODEL_S2X] = scaled(r.box, drop->share[MODEL_S2X]);
	p->peak[MODEL_S2Y] = peak_of(r.turned);
	p->resultant[0] = scaled(r.plate, copysign(1.0, r.plate.value));
	p->resultant[1] = peak_of(r.turned_r);
	p->direction_deg[0] = drop->scene->drop_angle_deg + drop->scene->sensor_s1_yaw_deg;
	p->direction_deg[1] = direction_of(p->resultant[1], r.turned_direction_rad);
	p->evaluations = r.evaluations;
	if (drop->has_plate) {
		p->plate_travel_m = c.skipped >> COUPLED_TRAVEL & 1u ? (double)NAN : r.travel_m;
		fill_linear_plate(drop, c.mount_damping_n_s_m, p);
	}
	return 0;
}

static int coupled_fill(const struct drop *drop, const struct model_options *options, double start_s,
                        double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	struct coupled_sample *samples = malloc((count ? count : 1) * sizeof(*samples));
	struct coupled c;
	int error = coupled_of(drop, options, &c, message);

	if (!samples)
		return DT_E_MEMORY;
	if (!error && coupled_history(&c, start_s, step_s, samples, count) != 0)
		error = not_solved(message, DT_E_NUMERIC);
	for (size_t k = 0; k < count && !error; k++) {
		value[k][MODEL_S1X] = samples[k].plate * drop->share[MODEL_S1X];
		value[k][MODEL_S1Y] = samples[k].plate * drop->share[MODEL_S1Y];
		value[k][MODEL_S2X] = samples[k].box * drop->share[MODEL_S2X];
		value[k][MODEL_S2Y] = samples[k].box * drop->share[MODEL_S2Y] -
		                      drop->turning * samples[k].force_n / c.case_mass_kg;
	}
	free(samples);
	return error;
}

const struct rung rung_coupled = {
        .name = "coupled",
        .says = "explains the plate's peak, the box's peak and the lag; directions only as the box falls",
        .says_without_plate = "explains the box's peak; directions only as the box falls",
        .predict = coupled_predict,
        .history = coupled_fill,
};

/* ---- planar ---- */

static int check_refinements(const struct scene *s, unsigned refinements, char *message)
{
	const struct {
		unsigned refinement;
		const char *key;
		double value;
	} keys[] = {
	        {MODEL_GRIP, "tangential_ratio", s->contact_tangential_ratio},
	        {MODEL_GRIP, "friction", s->contact_friction},
	        {MODEL_MOUNTS, "softening", s->mount_softening},
	        {MODEL_MOUNTS, "damping_n_s_m", s->mount_damping_n_s_m},
	};

	for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++)
		if ((refinements & keys[i].refinement) && !(keys[i].value >= 0.0 && isfinite(keys[i].value)))
			return drop_refuse(message, DT_E_ARGUMENT, "%s is %g, expected 0 or above",
			                   keys[i].key, keys[i].value);
	if ((refinements & MODEL_MOUNTS) && s->mount_softening > 0.0 &&
	    !(s->mount_cube_m * s->mount_softening_strain > 0.0))
		return drop_refuse(
		        message, DT_E_ARGUMENT,
		        "softening needs mounts of a size, expected cube_m and softening_strain above 0");
	return 0;
}

static void rungs_contact_refine(const struct drop *drop, unsigned refinements, struct planar *p)
{
	const struct scene *s = drop->scene;

	if (refinements & MODEL_GRIP) {
		p->grip = s->contact_tangential_ratio;
		p->friction = s->contact_friction;
	}
	if (!drop->has_plate || !(refinements & MODEL_MOUNTS))
		return;
	p->mounts_turn = true;
	p->softening = s->mount_softening;
	p->softening_m = s->mount_softening_strain * s->mount_cube_m;
	if (s->mount_damping_n_s_m > 0.0)
		p->mount_damping_n_s_m = s->mount_damping_n_s_m;
}

static int planar_of(const struct drop *drop, const struct model_options *options, struct planar *p,
                     char *message)
{
	static const unsigned wanted_by[PLANAR_SIGNALS] = {
	        [PLANAR_S1X] = MODEL_ASK_AXES,
	        [PLANAR_S1Y] = MODEL_ASK_AXES,
	        [PLANAR_S2X] = MODEL_ASK_S2,
	        [PLANAR_S2Y] = MODEL_ASK_S2,
	        [PLANAR_S1R] = MODEL_ASK_PLATE | MODEL_ASK_LAG | MODEL_ASK_DIRECTION,
	        [PLANAR_S2R] = MODEL_ASK_S2 | MODEL_ASK_LAG | MODEL_ASK_DIRECTION,
	        [PLANAR_CENTRE_R] = MODEL_ASK_BOX,
	        [PLANAR_DEPTH] = MODEL_ASK_ALL,
	};
	const struct scene *s = drop->scene;
	unsigned refinements = refinements_of(options, MODEL_REFINEMENTS, MODEL_REFINEMENTS);
	int error = check_refinements(s, refinements, message);

	if (error)
		return error;
	*p = (struct planar){
	        .case_mass_kg = s->product_case_mass_kg,
	        .plate_mass_kg = s->mount_plate_mass_kg,
	        .inertia_kg_m2 = drop->inertia_kg_m2,
	        .angle_rad = drop->angle,
	        .gravity_m_s2 = drop->gravity_m_s2,
	        .speed_m_s = drop->speed_m_s,
	        .lever_x_m = drop->lever_x_m,
	        .lever_y_m = drop->lever_y_m,
	        .mount_n_m = s->mount_stiffness_n_m,
	        .mount_damping_n_s_m = drop->mount_damping_n_s_m,
	        .s2_offset_m = s->sensor_s2_offset_m,
	        .s1_yaw_rad = UNITS_RAD(s->sensor_s1_yaw_deg),
	        .tolerance = step_tolerance(options),
	        .skipped = skipped_of(options, wanted_by, PLANAR_SIGNALS),
	        .rough = rough(options),
	};
	error = contact_of(drop, refinements, &p->law, &p->stiffness_n_m15, message);
	if (error)
		return error;
	p->wedge = refinements & MODEL_WEDGE;
	rungs_contact_refine(drop, refinements, p);
	p->count_ring = options->ring && p->softening > 0.0;
	return 0;
}

static int planar_predict(const struct drop *drop, const struct model_options *options,
                          struct model_prediction *p, char *message)
{
	struct planar planar;
	struct planar_result r;
	int error = planar_of(drop, options, &planar, message);

	if (error)
		return error;
	error = planar_solve(&planar, &r);
	if (error)
		return not_solved(message, error);
	p->refinements = refinements_of(options, MODEL_REFINEMENTS, MODEL_REFINEMENTS);
	p->velocity_change_m_s = r.velocity_change_m_s;
	p->contact_time_s = r.contact_time_s;
	p->restitution = r.restitution;
	p->stiffness_n_m15 = planar.stiffness_n_m15 * (planar.wedge ? body_wedge(drop->angle) : 1.0);
	p->dent_m = r.peak[PLANAR_DEPTH].value;
	p->notes = isnan(r.contact_time_s) && !r.cut_short ? MODEL_NOTE_STUCK : 0u;
	p->notes |= isnan(r.second_s) ? 0u : MODEL_NOTE_STRUCK;
	p->second_touch_s = r.second_s;
	p->second_corner = r.second_corner;
	p->until_s = r.until_s;
	p->spin_rad_s = r.spin_rad_s;
	for (int i = 0; i < MODEL_AXES; i++)
		p->peak[i] = peak_of(r.peak[PLANAR_S1X + i]);
	p->resultant[0] = peak_of(r.peak[PLANAR_S1R]);
	p->resultant[1] = peak_of(r.peak[PLANAR_S2R]);
	p->box = peak_of(r.peak[PLANAR_CENTRE_R]);
	p->direction_deg[0] = direction_of(p->resultant[0], r.s1_direction_rad);
	p->direction_deg[1] = direction_of(p->resultant[1], r.s2_direction_rad);
	p->evaluations = r.evaluations;
	if (drop->has_plate) {
		p->plate_travel_m = peak_of(r.peak[PLANAR_TRAVEL]).value_g;
		p->plate_frequency_hz = r.ring_hz;
		p->plate_damping_ratio = r.ring_damping;
		if (!(planar.softening > 0.0))
			fill_linear_plate(drop, planar.mount_damping_n_s_m, p);
	}
	return 0;
}

static int planar_fill(const struct drop *drop, const struct model_options *options, double start_s,
                       double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	struct planar_sample *samples = malloc((count ? count : 1) * sizeof(*samples));
	struct planar planar;
	int error = planar_of(drop, options, &planar, message);

	if (!samples)
		return DT_E_MEMORY;
	if (!error && planar_history(&planar, start_s, step_s, samples, count) != 0)
		error = not_solved(message, DT_E_NUMERIC);
	for (size_t k = 0; k < count && !error; k++)
		for (int i = 0; i < MODEL_AXES; i++)
			value[k][i] = samples[k].axis[PLANAR_S1X + i];
	free(samples);
	return error;
}

const struct rung rung_planar = {
        .name = "planar",
        .says = "explains peaks, lag and, as the box may turn, the directions and S2",
        .says_without_plate = "explains peaks and, as the box may turn, the directions and S2",
        .predict = planar_predict,
        .history = planar_fill,
};
