/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/chart/chart.h"
#include "host/chart/model_numerics.h"
#include "host/chart/model_study.h"
#include "host/chart/timing.h"
#include "host/chart/plot.h"
#include "host/model/course.h"

/* Readings of box and plate are compared at these instants: through the contact and on to 6 ms. */
#define EVERY_S 0.75e-3

enum { INSTANTS = 8, POINTS = 9, METHODS = 7, KINDS = 2 };

/* Tighter than any that is shown, by the highest order. */
#define REFERENCE_TOLERANCE 1e-14

struct readings {
	double box[INSTANTS], plate[INSTANTS];
};

/* The study's 2A at 25 deg, as both sides put it. */
struct problem {
	struct motion motion;
	struct course course;
	struct readings truth;
	double peak[2]; /* of ours at its tightest: box, plate */
};

enum way { RK4, RKF45, RKCK, RK8PD, MSADAMS, OURS, OURS_PEAKS };

static const struct {
	const char *name, *gsl;
	double coarsest, factor; /* step, s, or tolerance; each next one this much less */
	size_t points;
	int style;
} ways[METHODS] = {
        [RK4] = {"RK4, fixed step 750 to 3 us", NULL, 750e-6, 0.5, 9, 2},
        [RKF45] = {"GSL rkf45", "rkf45", 1e-2, 0.1, 9, 3},
        [RKCK] = {"GSL rkck", "rkck", 1e-2, 0.1, 9, 5},
        [RK8PD] = {"GSL rk8pd", "rk8pd", 1e-2, 0.1, 9, 4},
        [MSADAMS] = {"GSL msadams", "msadams", 1e-2, 0.1, 9, 6},
        [OURS] = {"droptower", NULL, 1e-2, 0.1, 9, 1},
        [OURS_PEAKS] = {"droptower, all peaks found", NULL, 1e-4, 0.1, 7, 0},
};

struct run {
	const struct problem *problem;
	enum way way;
	double setting;
	struct readings *readings;
	double *peak; /* [2] */
};

static int theirs(const struct problem *p, enum way way, double setting, struct readings *r)
{
	double y[INSTANTS][MOTION_STATES_MAX];

	if (way == RK4)
		motion_by_rk4(&p->motion, setting, EVERY_S, INSTANTS, y);
	else {
		int status = motion_by_gsl(&p->motion, ways[way].gsl, setting, EVERY_S, INSTANTS, y);

		if (status)
			return status;
	}
	for (size_t i = 0; i < INSTANTS; i++) {
		r->box[i] = motion_box(&p->motion, y[i]);
		r->plate[i] = motion_plate(&p->motion, y[i]);
	}
	return 0;
}

static int ours(const struct problem *p, double tolerance, struct readings *r)
{
	struct course_sample sample[INSTANTS];
	struct course course = p->course;
	int status;

	course.tolerance = tolerance;
	status = course_history(&course, EVERY_S, EVERY_S, sample, INSTANTS);
	for (size_t i = 0; i < INSTANTS && !status; i++) {
		r->box[i] = hypot(sample[i].axis[COURSE_S2X], sample[i].axis[COURSE_S2Y]);
		r->plate[i] = hypot(sample[i].axis[COURSE_S1X], sample[i].axis[COURSE_S1Y]);
	}
	return status;
}

static int our_peaks(const struct problem *p, double tolerance, double peak[2])
{
	struct course_result r = {0};
	struct course course = p->course;
	int status;

	course.tolerance = tolerance;
	status = course_solve(&course, &r);
	peak[0] = r.peak[COURSE_CENTRE_R].value;
	peak[1] = r.peak[COURSE_S1R].value;
	return status;
}

static void model_integrators_work(const void *context)
{
	const struct run *run = context;
	int status = run->way == OURS         ? ours(run->problem, run->setting, run->readings)
	             : run->way == OURS_PEAKS ? our_peaks(run->problem, run->setting, run->peak)
	                                      : theirs(run->problem, run->way, run->setting, run->readings);

	if (status)
		run->readings->box[0] = run->peak[0] = NAN;
}

/* The largest deviation, as a share of the peak. */
static double model_integrators_error_of(const struct run *run)
{
	const struct problem *p = run->problem;
	double worst = 0;

	if (run->way == OURS_PEAKS)
		return fmax(fabs(run->peak[0] / p->peak[0] - 1), fabs(run->peak[1] / p->peak[1] - 1));
	if (isnan(run->readings->box[0]))
		return NAN;
	for (size_t i = 0; i < INSTANTS; i++) {
		worst = fmax(worst, fabs(run->readings->box[i] - p->truth.box[i]) / p->peak[0]);
		worst = fmax(worst, fabs(run->readings->plate[i] - p->truth.plate[i]) / p->peak[1]);
	}
	return worst;
}

static int problem_of(bool planar, struct problem *p)
{
	const struct scene s = study_scene(STUDY_2A, 25);
	double speed = sqrt(2 * s.drop_gravity_m_s2 * s.drop_height_m), lever_y = s.product_width_m / 2;
	double lever_x = lever_y / tan(UNITS_RAD(s.product_balance_angle_deg));
	double mount_c = 2 * s.mount_damping_ratio * sqrt(s.mount_stiffness_n_m * s.mount_plate_mass_kg);
	double inertia = s.product_case_mass_kg *
	                 (s.product_length_m * s.product_length_m + s.product_width_m * s.product_width_m) /
	                 12;
	struct contact_law law;
	int status = contact_law_init(&law, s.contact_restitution);
	double k;

	if (status)
		return status;
	k = contact_stiffness(&law, s.contact_mass_kg, speed, s.contact_duration_s);
	p->motion = (struct motion){planar,
	                            s.product_case_mass_kg,
	                            s.mount_plate_mass_kg,
	                            inertia,
	                            s.drop_gravity_m_s2,
	                            speed,
	                            UNITS_RAD(s.drop_angle_deg),
	                            lever_x,
	                            lever_y,
	                            k,
	                            law.damping,
	                            s.mount_stiffness_n_m,
	                            mount_c};
	p->course = (struct course){.body = {.turns = planar,
	                                     .case_mass_kg = s.product_case_mass_kg,
	                                     .plate_mass_kg = s.mount_plate_mass_kg,
	                                     .inertia_kg_m2 = inertia,
	                                     .angle_rad = UNITS_RAD(s.drop_angle_deg),
	                                     .gravity_m_s2 = s.drop_gravity_m_s2,
	                                     .speed_m_s = speed,
	                                     .lever_x_m = lever_x,
	                                     .lever_y_m = lever_y,
	                                     .stiffness_n_m15 = k,
	                                     .law = law,
	                                     .mount_n_m = s.mount_stiffness_n_m,
	                                     .mount_damping_n_s_m = mount_c}};
	status = our_peaks(p, 1e-13, p->peak);
	return status ? status : theirs(p, RK8PD, REFERENCE_TOLERANCE, &p->truth);
}

/* ---- the picture ------------------------------------------------------------------------------------------
 */

struct curve {
	double cost_us[POINTS], error[POINTS];
};

static void model_integrators_measure(const struct problem *problem, enum way way, struct curve *curve)
{
	double setting = ways[way].coarsest;

	for (size_t i = 0; i < ways[way].points; i++, setting *= ways[way].factor) {
		struct readings readings = {{0}, {0}};
		double peak[2] = {0};
		const struct run run = {problem, way, setting, &readings, peak};

		model_integrators_work(&run);
		curve->error[i] = model_integrators_error_of(&run);
		curve->cost_us[i] = timing_us(model_integrators_work, &run, TIMING_BATCH_US, TIMING_BATCHES);
	}
}

/* The least cost on the curve's straight lines at which the error is 1e-5. */
static double cost_at(const struct curve *c, size_t points, double error)
{
	for (size_t i = 1; i < points; i++)
		if (c->error[i] <= error) {
			double part = log(c->error[i - 1] / error) / log(c->error[i - 1] / c->error[i]);

			return c->cost_us[i - 1] *
			       pow(c->cost_us[i] / c->cost_us[i - 1], fmin(fmax(part, 0), 1));
		}
	return NAN;
}

static void model_integrators_fill_panel(struct plot_panel *panel, struct curve curves[METHODS], bool planar)
{
	*panel = (struct plot_panel){
	        .title = planar ? "planar: 10 equations, frictionless" : "coupled: 4 equations",
	        .x = {"us a drop", "cost_us", 2, 3000, true, NULL},
	        .y = {"largest error of a reading, part of the peak", "error", 1e-19, 1, true, "1e%T"},
	        .region = {{2, 3000, 0.02, 1}},
	        .label = {{"worse than the model itself is", 200, 0.15, false, false}},
	        .key = planar ? NULL : "bottom right",
	};
	for (size_t i = 0; i < METHODS; i++)
		panel->series[i] = (struct plot_series){.name = ways[i].name,
		                                        .x = curves[i].cost_us,
		                                        .y = curves[i].error,
		                                        .count = ways[i].points,
		                                        .marks = true,
		                                        .judged = true,
		                                        .colour = ways[i].style};
}

static const struct plot frame = {
        .name = "integrators",
        .title = "How the equations of motion are best solved: error against cost",
        .note = {"Box and plate of 2A at 25 deg, read at eight instants to 6 ms, against GSL's rk8pd at "
                 "1e-14; from point to point steps are halved, tolerances divided by ten. Down and left is "
                 "better.",
                 "Down to 1e-7 droptower costs no more than GSL's best, RK4 and msadams several times that; "
                 "what these do not give, all peaks between the steps, is the black line."},
};

int chart_integrators(const struct chart_options *options, FILE *out, char *message)
{
	static struct curve curves[KINDS][METHODS];
	struct plot_panel panel[KINDS];
	struct plot plot = frame;

	for (int kind = 0; kind < KINDS; kind++) {
		struct problem problem;
		int status = problem_of(kind == 1, &problem);

		if (status) {
			snprintf(message, CHART_MESSAGE_MAX, "the motion could not be followed: %s",
			         error_text(status));
			return status;
		}
		for (int way = 0; way < METHODS; way++)
			model_integrators_measure(&problem, (enum way)way, &curves[kind][way]);
		model_integrators_fill_panel(&panel[kind], curves[kind], kind == 1);
	}
	fputs("\nus a drop at an error of 1e-5        coupled   planar\n", out);
	for (int way = 0; way < METHODS; way++)
		fprintf(out, "%-33s %10.1f%9.1f\n", ways[way].name,
		        cost_at(&curves[0][way], ways[way].points, 1e-5),
		        cost_at(&curves[1][way], ways[way].points, 1e-5));
	plot.panel = panel;
	plot.panels = KINDS;
	return plot_write(&plot, options->folder, "model", message);
}
