/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include <gsl/gsl_blas.h>
#include <gsl/gsl_math.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "host/chart/reference.h"

enum { ITERATIONS = 50 };

struct fit {
	const struct reference_series *s;
	size_t from;
};

/* p in and out. */
static bool reference_fit_solve(gsl_multifit_nlinear_fdf *problem, double *p)
{
	gsl_multifit_nlinear_parameters how = gsl_multifit_nlinear_default_parameters();
	gsl_multifit_nlinear_workspace *work;
	gsl_vector_view start = gsl_vector_view_array(p, problem->p);
	bool done;
	int info;

	if (problem->n <= problem->p)
		return false;
	work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &how, problem->n, problem->p);
	if (!work)
		return false;
	done = gsl_multifit_nlinear_init(&start.vector, problem, work) == 0 &&
	       gsl_multifit_nlinear_driver(ITERATIONS, 1e-10, 1e-10, 0, NULL, NULL, &info, work) == 0;
	for (size_t i = 0; i < problem->p; i++)
		p[i] = gsl_vector_get(work->x, i);
	gsl_multifit_nlinear_free(work);
	return done;
}

/* ---- half-sine: A, middle, base in samples from `from` ----------------------------------------------- */

static int pulse_residual(const gsl_vector *p, void *data, gsl_vector *f)
{
	const struct fit *fit = data;
	double a = gsl_vector_get(p, 0), at = gsl_vector_get(p, 1), base = gsl_vector_get(p, 2);

	for (size_t k = 0; k < f->size; k++) {
		double x = ((double)k - at) / base;

		gsl_vector_set(f, k, (fabs(x) < 0.5 ? a * cos(M_PI * x) : 0) - fit->s->y[fit->from + k]);
	}
	return GSL_SUCCESS;
}

bool reference_fit_pulse(const struct reference_series *s, struct reference_pulse *pulse)
{
	struct reference_peak raw = reference_maximum(s);
	double base = 1.5 * reference_width(s) * s->rate_hz; /* of the window */
	struct fit fit = {s, 0};
	gsl_multifit_nlinear_fdf problem = {.f = pulse_residual, .p = 3, .params = &fit};
	double at = raw.time_s * s->rate_hz, p[3];

	if (!(base > 0) || at - base / 2 < 0 || at + base / 2 >= (double)s->count)
		return false;
	fit.from = (size_t)(at - base / 2);
	problem.n = (size_t)base;
	p[0] = raw.value, p[1] = at - (double)fit.from, p[2] = base / 1.5;
	if (!reference_fit_solve(&problem, p))
		return false;
	*pulse = (struct reference_pulse){p[0], (p[1] + (double)fit.from) / s->rate_hz, p[2] / s->rate_hz};
	return true;
}

/* ---- decay: c, s, a, w in samples, offset ----------------------------------------------------------------
 */

static int decay_residual(const gsl_vector *p, void *data, gsl_vector *f)
{
	const struct fit *fit = data;
	double c = gsl_vector_get(p, 0), s = gsl_vector_get(p, 1), a = gsl_vector_get(p, 2),
	       w = gsl_vector_get(p, 3), b = gsl_vector_get(p, 4);

	for (size_t k = 0; k < f->size; k++) {
		double t = (double)k;

		gsl_vector_set(f, k, exp(-a * t) * (c * cos(w * t) + s * sin(w * t)) + b - fit->s->y[k]);
	}
	return GSL_SUCCESS;
}

static int decay_jacobian(const gsl_vector *p, void *data, gsl_matrix *jacobian)
{
	double c = gsl_vector_get(p, 0), s = gsl_vector_get(p, 1), a = gsl_vector_get(p, 2),
	       w = gsl_vector_get(p, 3);

	(void)data;
	for (size_t k = 0; k < jacobian->size1; k++) {
		double t = (double)k, e = exp(-a * t), cosine = e * cos(w * t), sine = e * sin(w * t);

		gsl_matrix_set(jacobian, k, 0, cosine);
		gsl_matrix_set(jacobian, k, 1, sine);
		gsl_matrix_set(jacobian, k, 2, -t * (c * cosine + s * sine));
		gsl_matrix_set(jacobian, k, 3, t * (s * cosine - c * sine));
		gsl_matrix_set(jacobian, k, 4, 1);
	}
	return GSL_SUCCESS;
}

struct reference_decay reference_fit_decay(const struct reference_series *s)
{
	struct reference_decay start = reference_spectrum(s);
	struct fit fit = {s, 0};
	gsl_multifit_nlinear_fdf problem = {
	        .f = decay_residual, .df = decay_jacobian, .n = s->count, .p = 5, .params = &fit};
	double w = 2 * M_PI * start.hz / s->rate_hz, p[5] = {s->y[0], 0, 0.1 * w, w, 0};

	if (!isfinite(start.hz) || !reference_fit_solve(&problem, p))
		return (struct reference_decay){NAN, NAN};
	return (struct reference_decay){fabs(p[3]) * s->rate_hz / (2 * M_PI), p[2] / hypot(p[2], p[3])};
}
