/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The rungs that integrate the contact: coupled and planar.
 */
#include "host/model/rung.h"

#include <math.h>
#include <stdlib.h>

#include "common/units.h"
#include "host/model/course.h"

/* What one step may miss, for all of them together to stay within the tolerance of peaks; of a body that
 * turns, whose axes are differences of larger terms, it is less. */
#define STEP_SHARE 0.05
#define STEP_SHARE_TURNING 0.025

/* From this tolerance of peaks on a parabola is as good as the steps are. */
#define ROUGH_TOLERANCE 2e-3

static double step_tolerance(const struct model_options *options, bool turns)
{
	return (turns ? STEP_SHARE_TURNING : STEP_SHARE) *
	       (options->tolerance > 0.0 ? options->tolerance : MODEL_TOLERANCE);
}

/* One that was not looked for is 0. */
static struct model_peak peak_of(struct peak_tracker_peak peak)
{
	if (peak.value == 0.0)
		return (struct model_peak){(double)NAN, (double)NAN};
	return (struct model_peak){peak.value, peak.time_s};
}

/* Signals that no question asks for; the dent is always looked at. */
static unsigned skipped_of(const struct model_options *options, bool turns)
{
	const unsigned wanted_by[COURSE_SIGNALS] = {
	        [COURSE_S1X] = MODEL_ASK_AXES,
	        [COURSE_S1Y] = MODEL_ASK_AXES,
	        [COURSE_S2X] = MODEL_ASK_S2,
	        [COURSE_S2Y] = MODEL_ASK_S2,
	        [COURSE_S1R] =
	                MODEL_ASK_PLATE | MODEL_ASK_LAG | MODEL_ASK_DIRECTION | (turns ? 0u : MODEL_ASK_AXES),
	        [COURSE_S2R] = MODEL_ASK_S2 | MODEL_ASK_LAG | MODEL_ASK_DIRECTION,
	        [COURSE_CENTRE_R] = MODEL_ASK_BOX | (turns ? 0u : MODEL_ASK_S2),
	        [COURSE_DEPTH] = MODEL_ASK_ALL,
	};
	unsigned skipped = 0;

	for (unsigned i = 0; i < COURSE_SIGNALS && options->asked; i++)
		if (!(wanted_by[i] & options->asked))
			skipped |= 1u << i;
	return skipped;
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
static unsigned refinements_of(const struct model_options *options, bool turns)
{
	unsigned known = turns ? MODEL_REFINEMENTS : MODEL_STIFFNESS | MODEL_WEDGE;

	if (options->refinements & MODEL_OF_RUNG)
		return turns ? known : 0;
	return options->refinements & known;
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

static int course_of(const struct drop *drop, const struct model_options *options, bool turns,
                     struct course *c, char *message)
{
	unsigned refinements = refinements_of(options, turns);
	int error = check_refinements(drop->scene, refinements, message);

	if (error)
		return error;
	*c = (struct course){
	        .tolerance = step_tolerance(options, turns),
	        .skipped = skipped_of(options, turns),
	        .rough = rough(options),
	};
	drop_body(drop, turns, refinements, &c->body);
	error = contact_of(drop, refinements, &c->body.law, &c->body.stiffness_n_m15, message);
	if (error)
		return error;
	c->count_ring = options->ring && c->body.softening > 0.0;
	return 0;
}

static void fill_peaks(const struct course_result *r, struct model_prediction *p)
{
	for (int i = 0; i < MODEL_AXES; i++)
		p->peak[i] = peak_of(r->peak[COURSE_S1X + i]);
	p->resultant[0] = peak_of(r->peak[COURSE_S1R]);
	p->resultant[1] = peak_of(r->peak[COURSE_S2R]);
	p->box = peak_of(r->peak[COURSE_CENTRE_R]);
	p->direction_deg[0] = direction_of(p->resultant[0], r->s1_direction_rad);
	p->direction_deg[1] = direction_of(p->resultant[1], r->s2_direction_rad);
}

static int course_predict(const struct drop *drop, const struct model_options *options, bool turns,
                          struct model_prediction *p, char *message)
{
	struct course course;
	struct course_result r;
	int error = course_of(drop, options, turns, &course, message);

	if (error)
		return error;
	error = course_solve(&course, &r);
	if (error)
		return not_solved(message, error);
	p->refinements = refinements_of(options, turns);
	p->velocity_change_m_s = r.velocity_change_m_s;
	p->contact_time_s = r.contact_time_s;
	p->restitution = r.restitution;
	p->stiffness_n_m15 =
	        course.body.stiffness_n_m15 * (course.body.wedge ? body_wedge(drop->angle) : 1.0);
	p->dent_m = r.peak[COURSE_DEPTH].value;
	p->notes = isnan(r.contact_time_s) && !r.cut_short ? MODEL_NOTE_STUCK : 0u;
	p->notes |= isnan(r.second_s) ? 0u : MODEL_NOTE_STRUCK;
	p->second_touch_s = r.second_s;
	p->second_corner = r.second_corner;
	p->until_s = r.until_s;
	if (turns)
		p->spin_rad_s = r.spin_rad_s;
	fill_peaks(&r, p);
	p->evaluations = r.evaluations;
	if (drop->has_plate) {
		p->plate_travel_m = fabs(peak_of(r.peak[COURSE_TRAVEL]).value_g);
		p->plate_frequency_hz = r.ring_hz;
		p->plate_damping_ratio = r.ring_damping;
		if (!(course.body.softening > 0.0)) /* linear, both masses free */
			rung_swing(drop->plate_omega,
			           0.5 * course.body.mount_damping_n_s_m * drop->plate_omega /
			                   drop->scene->mount_stiffness_n_m,
			           p);
	}
	return 0;
}

static int course_fill(const struct drop *drop, const struct model_options *options, bool turns,
                       double start_s, double step_s, double (*value)[MODEL_AXES], size_t count,
                       char *message)
{
	struct course_sample *samples = malloc((count ? count : 1) * sizeof(*samples));
	struct course course;
	int error = course_of(drop, options, turns, &course, message);

	if (!samples)
		return DT_E_MEMORY;
	if (!error && course_history(&course, start_s, step_s, samples, count) != 0)
		error = not_solved(message, DT_E_NUMERIC);
	for (size_t k = 0; k < count && !error; k++)
		for (int i = 0; i < MODEL_AXES; i++)
			value[k][i] = samples[k].axis[COURSE_S1X + i];
	free(samples);
	return error;
}

/* ---- coupled: the body that does not turn; planar: the one that does ---- */

static int coupled_predict(const struct drop *drop, const struct model_options *options,
                           struct model_prediction *p, char *message)
{
	return course_predict(drop, options, false, p, message);
}

static int coupled_fill(const struct drop *drop, const struct model_options *options, double start_s,
                        double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	return course_fill(drop, options, false, start_s, step_s, value, count, message);
}

const struct rung rung_coupled = {
        .name = "coupled",
        .says = "explains the plate's peak, the box's peak and the lag; directions only as the box falls",
        .says_without_plate = "explains the box's peak; directions only as the box falls",
        .predict = coupled_predict,
        .history = coupled_fill,
};

static int planar_predict(const struct drop *drop, const struct model_options *options,
                          struct model_prediction *p, char *message)
{
	return course_predict(drop, options, true, p, message);
}

static int planar_fill(const struct drop *drop, const struct model_options *options, double start_s,
                       double step_s, double (*value)[MODEL_AXES], size_t count, char *message)
{
	return course_fill(drop, options, true, start_s, step_s, value, count, message);
}

const struct rung rung_planar = {
        .name = "planar",
        .says = "explains peaks, lag and, as the box may turn, the directions and S2",
        .says_without_plate = "explains peaks and, as the box may turn, the directions and S2",
        .predict = planar_predict,
        .history = planar_fill,
};
