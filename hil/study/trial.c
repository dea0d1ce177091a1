/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/trial.h"

#include <math.h>
#include <string.h>
#include <gsl/gsl_blas.h>
#include <gsl/gsl_multifit_nlinear.h>

const struct trial_parameter trial_parameters[TRIAL_PARAMETERS] = {
        [TRIAL_STIFFNESS] = {"contact's stiffness", "1e6 N/m^1.5", 1e-6, 1.2, true},
        [TRIAL_GRIP] = {"tangential over normal stiffness", "", 1, 1.2, true},
        [TRIAL_BALANCE] = {"balance angle", "deg", 1, 6.0, false},
        [TRIAL_SOFTENING] = {"softening of the mounts", "", 1, 0.35, false},
        [TRIAL_DAMPING] = {"damping over stiffness of the mounts", "1e-4 s", 1e4, 1.2, true},
        [TRIAL_YAW] = {"S1's yaw in 2B", "deg", 1, 6.0, false},
};

/* 60 means, and what the study says of contact and ringing, with the error of its reading. */
static const struct {
	size_t geometry;
	enum study_feature feature;
	double value, sigma;
} features[TRIAL_FEATURES] = {
        {0, STUDY_CONTACT, 3.0e-3, 0.2e-3}, {1, STUDY_LAG, 2.0e-3, 0.1e-3}, {2, STUDY_LAG, 1.2e-3, 0.1e-3},
        {1, STUDY_FREQUENCY, 129, 3},       {2, STUDY_FREQUENCY, 177, 4},   {1, STUDY_DAMPING, 0.1, 0.02},
        {2, STUDY_DAMPING, 0.1, 0.02},
};
enum {
	MEANS = TRIAL_DATA - TRIAL_FEATURES,
	ROWS = TRIAL_DATA + TRIAL_PARAMETERS, /* with what is known beforehand */
};
#define FLOOR 0.03
#define DROPS_OF_A_MEAN 5.0

static void trial_scene(const struct trial *t, const double value[TRIAL_PARAMETERS], size_t g, size_t a,
                        struct scene *s)
{
	*s = t->study->scene[g];
	s->drop_angle_deg = study_angle_deg[a];
	s->contact_stiffness_n_m15 = value[TRIAL_STIFFNESS];
	s->contact_tangential_ratio = value[TRIAL_GRIP];
	s->product_balance_angle_deg = t->sharp
	                                       ? atan2(s->product_width_m, s->product_length_m) / M_PI * 180.0
	                                       : value[TRIAL_BALANCE];
	if (g == 0)
		return;
	s->mount_softening = value[TRIAL_SOFTENING];
	s->mount_damping_n_s_m = value[TRIAL_DAMPING] * s->mount_stiffness_n_m;
	s->sensor_s1_yaw_deg = g == 2 ? value[TRIAL_YAW] : 0.0;
}

bool trial_left_out(const struct trial *t, size_t g, size_t a)
{
	return ((int)g == t->geometry) != t->alone || (t->angles >> a & 1u);
}

int trial_solve(const struct trial *t, const double value[TRIAL_PARAMETERS],
                struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES], bool every)
{
	struct model_options options = model_defaults;
	int status = 0;

	options.refinements = t->refinements;
	options.tolerance = 1e-6;
	for (size_t g = 0; g < STUDY_GEOMETRIES && status == 0; g++)
		for (size_t a = 0; a < STUDY_ANGLES && status == 0; a++) {
			struct scene s;

			if (every ? t->alone && (int)g != t->geometry : trial_left_out(t, g, a))
				continue;
			trial_scene(t, value, g, a, &s);
			options.ring = g > 0 && a == TRIAL_MIDDLE;
			status = model_solve(&s, MODEL_PLANAR, &options, &drop[g][a], NULL);
		}
	return status;
}

static double trial_feature(const struct model_prediction *p, enum study_feature feature)
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

double trial_error(const struct study_value v[STUDY_QUANTITIES], size_t quantity)
{
	double r = v[STUDY_R].mean;
	double sd = quantity == STUDY_R
	                    ? hypot(v[STUDY_X].sd * v[STUDY_X].mean, v[STUDY_Y].sd * v[STUDY_Y].mean) / r
	                    : v[quantity].sd;

	return hypot(sd / sqrt(DROPS_OF_A_MEAN), FLOOR * r);
}

/* All residuals, those left out as 0; how many are in. */
static size_t trial_residuals(const struct trial *t,
                              const struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES],
                              double residual[TRIAL_DATA])
{
	size_t in = 0;

	memset(residual, 0, TRIAL_DATA * sizeof(double));
	for (size_t i = 0; i < MEANS; i++) {
		size_t g = i / (STUDY_ANGLES * TRIAL_AXES), a = i / TRIAL_AXES % STUDY_ANGLES,
		       axis = i % TRIAL_AXES;
		const struct study_value *v = t->study->series[g][a].published[axis / 2];

		if (trial_left_out(t, g, a))
			continue;
		residual[i] = (drop[g][a].peak[axis].value_g - v[axis % 2].mean) / trial_error(v, axis % 2);
		in++;
	}
	for (size_t i = 0; i < TRIAL_FEATURES; i++) {
		size_t g = features[i].geometry;

		if (trial_left_out(t, g, TRIAL_MIDDLE))
			continue;
		residual[MEANS + i] =
		        (trial_feature(&drop[g][TRIAL_MIDDLE], features[i].feature) - features[i].value) /
		        features[i].sigma;
		in++;
	}
	return in;
}

/* Of one of GSL's unknowns, in what the covariance is of. */
static double unit_of(const struct trial *t, size_t parameter)
{
	return trial_parameters[parameter].logarithm ? 1.0 : t->value[parameter];
}

/* GSL's unknowns are shares of the scenes' values; of what cannot be negative, 1 and the share's logarithm.
 * weak, if there: how far each is from there, over what is known of it beforehand. */
static void trial_values(const struct trial *t, const gsl_vector *x, double value[TRIAL_PARAMETERS],
                         double weak[TRIAL_PARAMETERS])
{
	size_t k = 0;

	for (size_t i = 0; i < TRIAL_PARAMETERS; i++) {
		double share = t->free >> i & 1u ? gsl_vector_get(x, k++) : 1.0;

		if (weak)
			weak[i] = (share - 1.0) * unit_of(t, i) / trial_parameters[i].weak_sd;
		value[i] = t->value[i] * (trial_parameters[i].logarithm ? exp(share - 1.0) : share);
	}
	value[TRIAL_SOFTENING] = fmax(value[TRIAL_SOFTENING], 0.0);
}

static int trial_function(const gsl_vector *x, void *context, gsl_vector *residual)
{
	const struct trial *t = context;
	struct model_prediction drop[STUDY_GEOMETRIES][STUDY_ANGLES];
	double value[TRIAL_PARAMETERS], all[ROWS];

	trial_values(t, x, value, &all[TRIAL_DATA]);
	if (trial_solve(t, value, drop, false) != 0)
		return GSL_EDOM;
	trial_residuals(t, drop, all);
	for (size_t i = 0; i < ROWS; i++) /* of a column of the Jacobian, too */
		gsl_vector_set(residual, i, i < TRIAL_DATA || t->alone ? all[i] : 0.0);
	return GSL_SUCCESS;
}

static void trial_bars(struct trial *t, gsl_multifit_nlinear_workspace *work)
{
	gsl_matrix *covariance = gsl_matrix_alloc(t->fitted, t->fitted);
	size_t of[TRIAL_PARAMETERS], count = 0;

	if (covariance == NULL)
		return;
	gsl_multifit_nlinear_covar(gsl_multifit_nlinear_jac(work), 0.0, covariance);
	for (size_t i = 0; i < TRIAL_PARAMETERS; i++)
		if (t->free >> i & 1u)
			of[count++] = i;
	for (size_t j = 0; j < count; j++)
		for (size_t k = 0; k < count; k++)
			t->covariance[of[j]][of[k]] =
			        unit_of(t, of[j]) * unit_of(t, of[k]) * gsl_matrix_get(covariance, j, k);
	gsl_matrix_free(covariance);
}

int trial_fit(struct trial *t)
{
	gsl_multifit_nlinear_parameters how = gsl_multifit_nlinear_default_parameters();
	gsl_multifit_nlinear_fdf problem = {.f = trial_function, .n = ROWS, .params = t};
	const struct scene *soft = &t->study->scene[1];
	gsl_multifit_nlinear_workspace *work;
	double start[TRIAL_PARAMETERS], residual[TRIAL_DATA];
	gsl_vector_view x;
	int info, status;

	t->value[TRIAL_STIFFNESS] = soft->contact_stiffness_n_m15;
	t->value[TRIAL_GRIP] = soft->contact_tangential_ratio;
	t->value[TRIAL_BALANCE] = soft->product_balance_angle_deg;
	t->value[TRIAL_SOFTENING] = t->free >> TRIAL_SOFTENING & 1u ? soft->mount_softening : 0.0;
	t->value[TRIAL_DAMPING] = soft->mount_damping_n_s_m / soft->mount_stiffness_n_m;
	t->value[TRIAL_YAW] = t->free >> TRIAL_YAW & 1u ? t->study->scene[2].sensor_s1_yaw_deg : 0.0;
	for (unsigned i = 0; i < TRIAL_PARAMETERS; i++) {
		start[i] = 1.0;
		t->fitted += t->free >> i & 1u;
	}
	problem.p = t->fitted;
	how.h_df = 1e-3;
	work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &how, ROWS, t->fitted);
	if (work == NULL)
		return DT_E_MEMORY;
	x = gsl_vector_view_array(start, t->fitted);
	status = gsl_multifit_nlinear_init(&x.vector, &problem, work);
	if (status == GSL_SUCCESS)
		status = gsl_multifit_nlinear_driver(50, 1e-3, 1e-4, 0.0, NULL, NULL, &info, work);
	if (status == GSL_SUCCESS || status == GSL_ENOPROG) {
		trial_bars(t, work);
		trial_values(t, gsl_multifit_nlinear_position(work), t->value, NULL);
		for (size_t i = 0; i < TRIAL_PARAMETERS; i++)
			t->sd[i] = sqrt(t->covariance[i][i]) *
			           (trial_parameters[i].logarithm ? t->value[i] : 1.0);
		status = trial_solve(t, t->value, t->drop, true);
	}
	gsl_multifit_nlinear_free(work);
	if (status != 0)
		return DT_E_NUMERIC;
	t->data = trial_residuals(t, (const struct model_prediction(*)[STUDY_ANGLES])t->drop, residual);
	for (size_t i = 0; i < TRIAL_DATA; i++)
		t->chi2 += residual[i] * residual[i];
	{
		double n = (double)t->data, k = (double)t->fitted;

		t->aicc = n * log(t->chi2 / n) + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0);
	}
	return 0;
}
