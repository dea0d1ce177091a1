/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/pencil.h"

#include <math.h>
#include <string.h>

#include <gsl/gsl_eigen.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_matrix.h>

#include "host/estimate/cholesky.h"

enum {
	LONGEST = 24, /* of the overlapping stretches */
	RANK = 5,     /* two pairs of poles and the offset */
	COUNT_MAX = 128,
	ROUNDS = 5,
};

/* Of all stretches of length n. One element along a diagonal differs from the last by its ends. */
static void covariance(double r[LONGEST][LONGEST], const double *value, unsigned count, size_t n)
{
	const size_t stretches = count - n + 1;

	for (size_t j = 0; j < n; j++) {
		double sum = 0;

		for (size_t k = 0; k < stretches; k++)
			sum += value[k] * value[k + j];
		r[0][j] = r[j][0] = sum;
		for (size_t i = 1; i + j < n; i++) {
			sum += value[stretches + i - 1] * value[stretches + i - 1 + j] -
			       value[i - 1] * value[i - 1 + j];
			r[i][i + j] = r[i + j][i] = sum;
		}
	}
}

/* Makes columns perpendicular to those before and of length 1; false where one is none of its own. */
static bool straighten(double basis[LONGEST][RANK], size_t n)
{
	for (size_t j = 0; j < RANK; j++) {
		double square = 0;

		for (size_t before = 0; before < j; before++) {
			double along = 0;

			for (size_t i = 0; i < n; i++)
				along += basis[i][before] * basis[i][j];
			for (size_t i = 0; i < n; i++)
				basis[i][j] -= along * basis[i][before];
		}
		for (size_t i = 0; i < n; i++)
			square += basis[i][j] * basis[i][j];
		if (!(square > 0) || !isfinite(square))
			return false;
		for (size_t i = 0; i < n; i++)
			basis[i][j] /= sqrt(square);
	}
	return true;
}

/* The leading eigenvectors, as the columns of basis, by orthogonal iteration. */
static bool signal_space(double basis[LONGEST][RANK], const double *value, unsigned count, size_t n)
{
	double r[LONGEST][LONGEST];

	covariance(r, value, count, n);
	for (size_t i = 0; i < n; i++)
		for (size_t j = 0; j < RANK; j++)
			basis[i][j] = r[i][j * n / RANK];
	for (unsigned round = 0; round < ROUNDS; round++) {
		double turned[LONGEST][RANK] = {{0}};

		if (!straighten(basis, n))
			return false;
		for (size_t i = 0; i < n; i++)
			for (size_t k = 0; k < n; k++)
				for (size_t j = 0; j < RANK; j++)
					turned[i][j] += r[i][k] * basis[k][j];
		memcpy(basis, turned, sizeof(turned));
	}
	return straighten(basis, n);
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
