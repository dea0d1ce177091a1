/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/holdout.h"

#include <math.h>
#include <string.h>
#include <gsl/gsl_blas.h>
#include <gsl/gsl_multifit_nlinear.h>

/* What is fitted, in units of what the scenes have. */
enum { STIFFNESS, GRIP, BALANCE, SOFTENING, DAMPING, YAW, PARAMETERS };
#define ALL ((1u << PARAMETERS) - 1u)

static const struct {
	const char *what, *unit;
	double scale;
} parameters[PARAMETERS] = {
        [STIFFNESS] = {"contact's stiffness", "1e6 N/m^1.5", 1e-6},
        [GRIP] = {"tangential over normal stiffness", "", 1},
        [BALANCE] = {"balance angle", "deg", 1},
        [SOFTENING] = {"softening of the mounts", "", 1},
        [DAMPING] = {"damping over stiffness of the mounts", "1e-4 s", 1e4},
        [YAW] = {"S1's yaw in 2B", "deg", 1},
};

/* 60 means, and what the study says of contact and ringing, with the error of its reading. */
static const struct {
	size_t geometry;
	enum study_feature feature;
	double value, sigma;
} features[] = {
        {0, STUDY_CONTACT, 3.0e-3, 0.2e-3}, {1, STUDY_LAG, 2.0e-3, 0.1e-3}, {2, STUDY_LAG, 1.2e-3, 0.1e-3},
        {1, STUDY_FREQUENCY, 129, 3},       {2, STUDY_FREQUENCY, 177, 4},   {1, STUDY_DAMPING, 0.1, 0.02},
        {2, STUDY_DAMPING, 0.1, 0.02},
};
enum {
	FEATURES = sizeof(features) / sizeof(features[0]),
	AXES = 4, /* X and Y of S1 and S2 */
	MEANS = STUDY_GEOMETRIES * STUDY_ANGLES * AXES,
	DATA = MEANS + FEATURES,
	MIDDLE = STUDY_ANGLES / 2, /* features are told at 25 deg */
};
#define FLOOR 0.03
#define DROPS_OF_A_MEAN 5.0

/* A fit without one angle or one box, with some refinements and some numbers. */
struct trial {
	const struct study *study;
	unsigned refinements, free; /* bits of MODEL_... and of the parameters */
	bool sharp;                 /* balance: the box's own corner */
	int angle, geometry;        /* left out; -1: none */
	double value[PARAMETERS], sd[PARAMETERS];
	size_t data, fitted;
	double chi2, aicc;
	struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES];
};

static void holdout_scene(const struct trial *t, const double value[PARAMETERS], size_t g, size_t a,
                          struct scene *s)
{
	*s = t->study->scene[g];
	s->drop_angle_deg = study_angle_deg[a];
	s->contact_stiffness_n_m15 = value[STIFFNESS];
	s->contact_tangential_ratio = value[GRIP];
	s->product_balance_angle_deg =
	        t->sharp ? atan2(s->product_width_m, s->product_length_m) / M_PI * 180.0 : value[BALANCE];
	if (g == 0)
		return;
	s->mount_softening = value[SOFTENING];
	s->mount_damping_n_s_m = value[DAMPING] * s->mount_stiffness_n_m;
	s->sensor_s1_yaw_deg = g == 2 ? value[YAW] : 0.0;
}

static int holdout_solve(const struct trial *t, const double value[PARAMETERS],
                         struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES])
{
	struct model_options options = model_defaults;
	int status = 0;

	options.refinements = t->refinements;
	options.tolerance = 1e-6;
	for (size_t g = 0; g < STUDY_GEOMETRIES && status == 0; g++)
		for (size_t a = 0; a < STUDY_ANGLES && status == 0; a++) {
			struct scene s;

			holdout_scene(t, value, g, a, &s);
			options.ring = g > 0 && a == MIDDLE;
			status = model_solve(&s, MODEL_PLANAR, &options, &drop[g][a], NULL);
		}
	return status;
}

static double holdout_feature(const struct model_prediction *p, enum study_feature feature)
{
	switch (feature) {
	case STUDY_LAG:
		return p->lag_s;
	case STUDY_FREQUENCY:
		return p->plate_frequency_hz;
	case STUDY_DAMPING:
		return p->plate_damping_ratio;
	default:
		return p->contact_time_s;
	}
}

static bool left_out(const struct trial *t, size_t g, size_t a)
{
	return (int)g == t->geometry || (int)a == t->angle;
}

/* All residuals, those left out as 0; how many are in. */
static size_t holdout_residuals(const struct trial *t,
                                const struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES],
                                double residual[DATA])
{
	size_t in = 0;

	memset(residual, 0, DATA * sizeof(double));
	for (size_t i = 0; i < MEANS; i++) {
		size_t g = i / (STUDY_ANGLES * AXES), a = i / AXES % STUDY_ANGLES, axis = i % AXES;
		const struct study_value *v = t->study->series[g][a].published[axis / 2];
		double error = hypot(v[axis % 2].sd / sqrt(DROPS_OF_A_MEAN), FLOOR * v[STUDY_R].mean);

		if (left_out(t, g, a))
			continue;
		residual[i] = (drop[g][a].peak[axis].value_g - v[axis % 2].mean) / error;
		in++;
	}
	for (size_t i = 0; i < FEATURES; i++) {
		size_t g = features[i].geometry;

		if (left_out(t, g, MIDDLE))
			continue;
		residual[MEANS + i] =
		        (holdout_feature(&drop[g][MIDDLE], features[i].feature) - features[i].value) /
		        features[i].sigma;
		in++;
	}
	return in;
}

/* GSL's unknowns are shares of the scenes' values; of what cannot be negative, 1 and the share's logarithm.
 */
static void holdout_values(const struct trial *t, const gsl_vector *x, double value[PARAMETERS])
{
	size_t k = 0;

	for (size_t i = 0; i < PARAMETERS; i++) {
		double share = t->free >> i & 1u ? gsl_vector_get(x, k++) : 1.0;

		if (i == STIFFNESS || i == GRIP || i == DAMPING)
			share = exp(share - 1.0);
		value[i] = t->value[i] * share;
	}
	value[SOFTENING] = fmax(value[SOFTENING], 0.0);
}

static int holdout_function(const gsl_vector *x, void *context, gsl_vector *residual)
{
	const struct trial *t = context;
	struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES];
	double value[PARAMETERS], all[DATA];

	holdout_values(t, x, value);
	if (holdout_solve(t, value, drop) != 0)
		return GSL_EDOM;
	holdout_residuals(t, drop, all);
	for (size_t i = 0; i < DATA; i++) /* of a column of the Jacobian, too */
		gsl_vector_set(residual, i, all[i]);
	return GSL_SUCCESS;
}

static void holdout_bars(struct trial *t, gsl_multifit_nlinear_workspace *work)
{
	gsl_matrix *covariance = gsl_matrix_alloc(t->fitted, t->fitted);
	size_t k = 0;

	if (covariance == NULL)
		return;
	gsl_multifit_nlinear_covar(gsl_multifit_nlinear_jac(work), 0.0, covariance);
	for (size_t i = 0; i < PARAMETERS; i++)
		if (t->free >> i & 1u) {
			t->sd[i] = fabs(t->value[i]) * sqrt(gsl_matrix_get(covariance, k, k));
			k++;
		}
	gsl_matrix_free(covariance);
}

/* Starts at the scenes' values; a number that is not free stays there, and softening and yaw at 0. */
static int holdout_fit(struct trial *t)
{
	gsl_multifit_nlinear_parameters how = gsl_multifit_nlinear_default_parameters();
	gsl_multifit_nlinear_fdf problem = {.f = holdout_function, .n = DATA, .params = t};
	const struct scene *soft = &t->study->scene[1];
	gsl_multifit_nlinear_workspace *work;
	double start[PARAMETERS], residual[DATA];
	gsl_vector_view x;
	int info, status;

	t->value[STIFFNESS] = soft->contact_stiffness_n_m15;
	t->value[GRIP] = soft->contact_tangential_ratio;
	t->value[BALANCE] = soft->product_balance_angle_deg;
	t->value[SOFTENING] = t->free >> SOFTENING & 1u ? soft->mount_softening : 0.0;
	t->value[DAMPING] = soft->mount_damping_n_s_m / soft->mount_stiffness_n_m;
	t->value[YAW] = t->free >> YAW & 1u ? t->study->scene[2].sensor_s1_yaw_deg : 0.0;
	for (unsigned i = 0; i < PARAMETERS; i++) {
		start[i] = 1.0;
		t->fitted += t->free >> i & 1u;
	}
	problem.p = t->fitted;
	how.h_df = 1e-3;
	work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &how, DATA, t->fitted);
	if (work == NULL)
		return DT_E_MEMORY;
	x = gsl_vector_view_array(start, t->fitted);
	status = gsl_multifit_nlinear_init(&x.vector, &problem, work);
	if (status == GSL_SUCCESS)
		status = gsl_multifit_nlinear_driver(50, 1e-3, 1e-4, 0.0, NULL, NULL, &info, work);
	if (status == GSL_SUCCESS || status == GSL_ENOPROG) {
		holdout_values(t, gsl_multifit_nlinear_position(work), t->value);
		holdout_bars(t, work);
		status = holdout_solve(t, t->value, t->drop);
	}
	gsl_multifit_nlinear_free(work);
	if (status != 0)
		return DT_E_NUMERIC;
	t->data = holdout_residuals(t, (const struct model_prediction(*)[STUDY_ANGLES])t->drop, residual);
	for (size_t i = 0; i < DATA; i++)
		t->chi2 += residual[i] * residual[i];
	{
		double n = (double)t->data, k = (double)t->fitted;

		t->aicc = n * log(t->chi2 / n) + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0);
	}
	return 0;
}

/* ---- what each refinement is worth ---- */

static const struct {
	const char *what;
	unsigned refinements, free; /* that are left */
	bool sharp;
} without[] = {
        {"all of them", MODEL_REFINEMENTS, ALL, false},
        {"without wedge", MODEL_REFINEMENTS & ~MODEL_WEDGE, ALL, false},
        {"without grip", MODEL_REFINEMENTS & ~MODEL_GRIP, ALL & ~(1u << GRIP), false},
        {"without mounts' softening", MODEL_REFINEMENTS, ALL & ~(1u << SOFTENING), false},
        {"stiffness from 3.0 ms", MODEL_REFINEMENTS & ~MODEL_STIFFNESS, ALL & ~(1u << STIFFNESS), false},
        {"balance of the box's own corner", MODEL_REFINEMENTS, ALL & ~(1u << BALANCE), true},
        {"without S1's yaw in 2B", MODEL_REFINEMENTS, ALL & ~(1u << YAW), false},
};
enum { WITHOUT = sizeof(without) / sizeof(without[0]) };

/* AICc by which a refinement must be better than its absence. */
#define PAYS 2.0

static bool tell_refinements(const struct study *study, struct sheet *sheet, struct trial *all)
{
	static const struct sheet_column columns[] = {{"", "", -34},   {"", "fitted", 8}, {"", "chi2", 9},
	                                              {"", "AICc", 8}, {"", "worth", 8},  {"", "", 14}};
	bool pays = true;

	sheet_heading(sheet, "What each refinement is worth");
	sheet_say(sheet,
	          "The planar model fitted to %d printed numbers (60 means, contact time, lags, frequencies, "
	          "dampings), and the same with one thing less. worth: by how much AICc rises without it; "
	          "below %.0f it does not pay.",
	          DATA, PAYS);
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < WITHOUT; i++) {
		struct trial t = {.study = study,
		                  .refinements = without[i].refinements,
		                  .free = without[i].free,
		                  .sharp = without[i].sharp,
		                  .angle = -1,
		                  .geometry = -1};
		bool fails = holdout_fit(&t) != 0;

		if (i == 0)
			*all = t;
		if (fails || all->data == 0) {
			sheet_row(sheet, "%s|-|-|-|-|%s", without[i].what, "no fit*");
			pays = pays && i > 0;
			continue;
		}
		if (i > 0 && !(t.aicc - all->aicc > PAYS))
			pays = false;
		sheet_row(sheet, "%s|%zu|%.1f|%.1f|%s%.1f|%s", without[i].what, t.fitted, t.chi2, t.aicc,
		          t.aicc < all->aicc ? "" : "+", t.aicc - all->aicc,
		          i == 0                      ? ""
		          : t.aicc - all->aicc > PAYS ? "pays"
		                                      : "does not pay*");
	}
	sheet_table_end(sheet);
	return pays;
}

static void tell_values(const struct trial *all, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "", -40}, {"", "", -13}, {"", "scenes", 8}, {"", "fitted", 8}, {"", "+-", 8}};
	const struct scene *soft = &all->study->scene[1];
	const double shipped[PARAMETERS] = {soft->contact_stiffness_n_m15,
	                                    soft->contact_tangential_ratio,
	                                    soft->product_balance_angle_deg,
	                                    soft->mount_softening,
	                                    soft->mount_damping_n_s_m / soft->mount_stiffness_n_m,
	                                    all->study->scene[2].sensor_s1_yaw_deg};

	sheet_say(sheet, "The numbers, fitted again, beside those of the scenes, which were rounded:");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < PARAMETERS; i++)
		sheet_row(sheet, "%s|%s|%.3f|%.3f|%.3f", parameters[i].what, parameters[i].unit,
		          shipped[i] * parameters[i].scale, all->value[i] * parameters[i].scale,
		          all->sd[i] * parameters[i].scale);
	sheet_table_end(sheet);
}

/* ---- what is left out ---- */

/* Sums of absolute deviations in percent of S1 on the plate and of the sensors on the box. */
struct apart {
	double sum[2][2]; /* of the resultant, of X and Y */
	size_t count[2];
};

static void apart_add(struct apart *d, size_t g,
                      const struct study_value published[STUDY_SENSORS][STUDY_QUANTITIES],
                      const double value[STUDY_SENSORS][STUDY_R + 1])
{
	for (size_t s = 0; s < STUDY_SENSORS; s++) {
		size_t on = g == 0 || s == 1;
		double off[STUDY_R + 1];

		for (size_t q = 0; q <= STUDY_R; q++)
			off[q] = 100.0 * fabs(value[s][q] / published[s][q].mean - 1.0);
		d->sum[on][0] += off[STUDY_R];
		d->sum[on][1] += 0.5 * (off[STUDY_X] + off[STUDY_Y]);
		d->count[on]++;
	}
}

/* Of the drops that a fit left out, or of all. */
static void apart_of(const struct trial *t, struct apart *d)
{
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		for (size_t a = 0; a < STUDY_ANGLES; a++) {
			const struct model_prediction *p = &t->drop[g][a];
			const double value[STUDY_SENSORS][STUDY_R + 1] = {
			        {p->peak[0].value_g, p->peak[1].value_g, p->resultant[0].value_g},
			        {p->peak[2].value_g, p->peak[3].value_g, p->resultant[1].value_g}};

			if ((t->angle < 0 && t->geometry < 0) || left_out(t, g, a))
				apart_add(d, g, t->study->series[g][a].published, value);
		}
}

/* A constant for each box: the mean of the other angles stands for the one left out. */
static void apart_of_constants(const struct study *study, struct apart *d)
{
	for (size_t i = 0; i < STUDY_GEOMETRIES * STUDY_ANGLES; i++) {
		const struct study_series *box = study->series[i / STUDY_ANGLES];
		double value[STUDY_SENSORS][STUDY_R + 1] = {{0}};

		for (size_t k = 0; k < STUDY_ANGLES * STUDY_SENSORS * (STUDY_R + 1); k++) {
			size_t a = k % STUDY_ANGLES, s = k / STUDY_ANGLES % STUDY_SENSORS,
			       q = k / (STUDY_ANGLES * STUDY_SENSORS);

			if (a != i % STUDY_ANGLES)
				value[s][q] += box[a].published[s][q].mean / (STUDY_ANGLES - 1);
		}
		apart_add(d, i / STUDY_ANGLES, box[i % STUDY_ANGLES].published, value);
	}
}

/* Percent of the plate's resultant; of the box's where there is no plate. */
static double apart_tell(const struct apart *d, const char *what, const char *how, const struct trial *box,
                         struct sheet *sheet)
{
	char cells[128];
	size_t at = 0;

	for (size_t on = 0; on < 2; on++)
		for (size_t k = 0; k < 2; k++)
			at += (size_t)(d->count[on] > 0 ? snprintf(cells + at, sizeof(cells) - at, "%.1f|",
			                                           d->sum[on][k] / (double)d->count[on])
			                                : snprintf(cells + at, sizeof(cells) - at, "-|"));
	if (box != NULL && box->geometry > 0)
		snprintf(cells + at, sizeof(cells) - at, "%.0f|%.2f",
		         box->drop[box->geometry][MIDDLE].plate_frequency_hz,
		         1e3 * box->drop[box->geometry][MIDDLE].lag_s);
	else
		snprintf(cells + at, sizeof(cells) - at, "-|-");
	sheet_row(sheet, "%s|%s|%s", what, how, cells);
	return d->sum[d->count[0] == 0][0] / (double)d->count[d->count[0] == 0];
}

static const struct {
	const char *what;
	int geometry;
	unsigned free;
} boxes[] = {
        {"2B from 1 and 2A", 2, ALL & ~(1u << YAW)},
        {"2B from 1 and 2A, linear mounts", 2, ALL & ~(1u << YAW | 1u << SOFTENING)},
        {"2A from 1 and 2B", 1, ALL},
        {"1 from 2A and 2B", 0, ALL},
};
enum { BOXES = sizeof(boxes) / sizeof(boxes[0]) };

/* Percent of S1's resultant: of an angle left out, of a box left out. */
#define LIMIT_ANGLE 4.0
#define LIMIT_BOX 5.0

/* Percent of the plate's resultant; NAN where a fit fails. */
static double tell_angles(const struct study *study, struct sheet *sheet)
{
	struct apart d = {.count = {0}};

	for (int a = 0; a < STUDY_ANGLES; a++) {
		struct trial t = {.study = study,
		                  .refinements = MODEL_REFINEMENTS,
		                  .free = ALL,
		                  .angle = a,
		                  .geometry = -1};

		if (holdout_fit(&t) != 0)
			return (double)NAN;
		apart_of(&t, &d);
	}
	return apart_tell(&d, "one angle left out, five times", "predicted", NULL, sheet);
}

static bool tell_left_out(const struct study *study, struct sheet *sheet, const struct trial *all)
{
	static const struct sheet_column columns[] = {
	        {"", "", -34},    {"", "", -11},         {"plate", "XY", 7}, {"plate", "X and Y", 9},
	        {"box", "XY", 7}, {"box", "X and Y", 9}, {"", "ring Hz", 9}, {"", "lag ms", 8},
	};
	struct apart fitted = {.count = {0}}, constant = {.count = {0}};
	double error[BOXES], angle_percent;
	bool holds;

	sheet_heading(sheet, "What was left out of the fit, predicted");
	sheet_say(sheet,
	          "Mean absolute deviation from the printed means, percent; XY is the resultant. fitted: "
	          "these means were in the fit; predicted: they were not. The study's rings: 129 Hz in 2A, "
	          "177 in 2B; its lags: 2.0 and 1.2 ms. Of 2B nothing is known but its cubes' size, so that "
	          "S1's yaw in it, and with it Y, cannot be predicted.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	apart_of(all, &fitted);
	apart_tell(&fitted, "all angles, all boxes", "fitted", NULL, sheet);
	angle_percent = tell_angles(study, sheet);
	holds = angle_percent < LIMIT_ANGLE;
	apart_of_constants(study, &constant);
	apart_tell(&constant, "a constant: mean of the other angles", "no model", NULL, sheet);
	for (size_t i = 0; i < BOXES; i++) {
		struct trial t = {.study = study,
		                  .refinements = MODEL_REFINEMENTS,
		                  .free = boxes[i].free,
		                  .angle = -1,
		                  .geometry = boxes[i].geometry};
		struct apart d = {.count = {0}};

		if (holdout_fit(&t) != 0)
			return false;
		apart_of(&t, &d);
		error[i] = apart_tell(&d, boxes[i].what, "predicted", &t, sheet);
		holds = holds && error[i] < LIMIT_BOX;
	}
	sheet_table_end(sheet);
	sheet_say(sheet, "On the plate's resultant a constant is off by %.1f %%, the model by %.1f %%%s.",
	          constant.sum[0][0] / (double)constant.count[0], angle_percent,
	          constant.sum[0][0] / (double)constant.count[0] < angle_percent
	                  ? ": that number ranks no model; X, Y and the box do"
	                  : "");
	sheet_say(
	        sheet,
	        "The softening of the mounts, found in 2A, predicts the other cubes: %.1f %% of the plate's "
	        "resultant in 2B, %.1f %% with linear mounts.",
	        error[0], error[1]);
	return holds && error[0] < error[1];
}

bool holdout_tell(const struct study *study, struct sheet *sheet)
{
	struct trial all;
	bool pays = tell_refinements(study, sheet, &all), predicts;

	if (all.data == 0)
		return false;
	tell_values(&all, sheet);
	predicts = tell_left_out(study, sheet, &all);
	if (!pays)
		sheet_say(sheet, "A REFINEMENT DOES NOT PAY: it asks for more numbers than it explains.");
	if (!predicts)
		sheet_say(sheet,
		          "WHAT WAS LEFT OUT IS NOT PREDICTED: within %.0f %% of an angle's resultant on S1, "
		          "%.0f %% of a box's, and better than with linear mounts.",
		          LIMIT_ANGLE, LIMIT_BOX);
	return pays && predicts;
}
