/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/pencil.h"

#include <math.h>

#include <gsl/gsl_eigen.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_matrix.h>

#include "host/estimate/cholesky.h"

enum {
	LONGEST = 24, /* of the overlapping stretches */
	RANK = 5,     /* two pairs of poles and the offset */
	COUNT_MAX = 128,
};

/* Upper triangle of the covariance of all stretches of length n; the matrix is symmetric. */
static void covariance(gsl_matrix *r, const double *value, unsigned count, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		for (size_t j = 0; j <= i; j++) {
			double sum = 0;

			for (size_t k = 0; k + n <= count; k++)
				sum += value[k + i] * value[k + j];
			gsl_matrix_set(r, i, j, sum);
			gsl_matrix_set(r, j, i, sum);
		}
	}
}

/* The leading eigenvectors, as the columns of basis. */
static bool signal_space(double basis[LONGEST][RANK], const double *value, unsigned count, size_t n)
{
	gsl_matrix *r = gsl_matrix_alloc(n, n), *vectors = gsl_matrix_alloc(n, n);
	gsl_vector *values = gsl_vector_alloc(n);
	gsl_eigen_symmv_workspace *work = gsl_eigen_symmv_alloc(n);
	bool found = false;

	if (r && vectors && values && work) {
		covariance(r, value, count, n);
		found = gsl_eigen_symmv(r, values, vectors, work) == GSL_SUCCESS &&
		        gsl_eigen_symmv_sort(values, vectors, GSL_EIGEN_SORT_VAL_DESC) == GSL_SUCCESS;
		for (size_t i = 0; found && i < n; i++)
			for (size_t j = 0; j < RANK; j++)
				basis[i][j] = gsl_matrix_get(vectors, i, j);
	}
	gsl_matrix_free(r);
	gsl_matrix_free(vectors);
	gsl_vector_free(values);
	gsl_eigen_symmv_free(work);
	return found;
}

/* The turn that takes basis without its last row to basis without its first, by least squares. */
static bool turn_of(double turn[RANK][RANK], double basis[LONGEST][RANK], size_t n)
{
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}};
	struct cholesky factor;

	for (size_t k = 0; k + 1 < n; k++)
		for (size_t i = 0; i < RANK; i++)
			for (size_t j = 0; j <= i; j++)
				normal[i][j] += basis[k][i] * basis[k][j];
	if (!cholesky_factor(&factor, RANK, normal))
		return false;
	for (size_t j = 0; j < RANK; j++) {
		double column[RANK] = {0};

		for (size_t k = 0; k + 1 < n; k++)
			for (size_t i = 0; i < RANK; i++)
				column[i] += basis[k][i] * basis[k + 1][j];
		cholesky_solve(&factor, column, column);
		for (size_t i = 0; i < RANK; i++)
			turn[i][j] = column[i];
	}
	return true;
}

static bool poles_of(struct pencil_pole pole[2], double turn[RANK][RANK], double step_s)
{
	gsl_matrix_view matrix = gsl_matrix_view_array(&turn[0][0], RANK, RANK);
	gsl_vector_complex *values = gsl_vector_complex_alloc(RANK);
	gsl_eigen_nonsymm_workspace *work = gsl_eigen_nonsymm_alloc(RANK);
	unsigned found = 0;

	if (values && work && gsl_eigen_nonsymm(&matrix.matrix, values, work) == GSL_SUCCESS) {
		for (size_t i = 0; i < RANK && found < 2; i++) {
			gsl_complex z = gsl_vector_complex_get(values, i);

			if (GSL_IMAG(z) > 0)
				pole[found++] =
				        (struct pencil_pole){atan2(GSL_IMAG(z), GSL_REAL(z)) / step_s,
				                             -log(hypot(GSL_REAL(z), GSL_IMAG(z))) / step_s};
		}
	}
	gsl_vector_complex_free(values);
	gsl_eigen_nonsymm_free(work);
	return found == 2;
}

bool pencil_find(struct pencil_pole pole[2], const double *value, unsigned count, double step_s)
{
	double basis[LONGEST][RANK], turn[RANK][RANK];
	unsigned points = count < COUNT_MAX ? count : COUNT_MAX;
	size_t n = points / 3 < LONGEST ? points / 3 : LONGEST;

	gsl_set_error_handler_off();
	if (n < 2 * RANK)
		return false;
	return signal_space(basis, value, points, n) && turn_of(turn, basis, n) &&
	       poles_of(pole, turn, step_s);
}
