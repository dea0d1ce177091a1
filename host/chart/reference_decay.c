/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_fft_real.h>
#include <gsl/gsl_linalg.h>
#include <gsl/gsl_math.h>

#include "host/chart/reference.h"

/* Both from a pole's decrement and angle for one step of dt. */
static struct reference_decay of_pole(double decay, double angle, double dt)
{
	double a = -log(decay) / dt, w = angle / dt;

	return (struct reference_decay){w / (2 * M_PI), a / hypot(a, w)};
}

/* ---- zero crossings ------------------------------------------------------------------------------------ */

struct reference_decay reference_crossings(const struct reference_series *s)
{
	enum { CROSSINGS = 7 }; /* three cycles */
	double first = NAN, last = NAN;
	int seen = 0;

	for (size_t k = 1; k < s->count && seen < CROSSINGS; k++) {
		double before = s->y[k - 1], after = s->y[k];

		if ((before < 0) == (after < 0))
			continue;
		last = ((double)k - after / (after - before)) / s->rate_hz;
		if (seen++ == 0)
			first = last;
	}
	return (struct reference_decay){seen == CROSSINGS ? 3 / (last - first) : (double)NAN, NAN};
}

/* ---- logarithmic decrement ------------------------------------------------------------------------------
 */

/* The largest samples of positive and negative swings in turn; the mean decrement from first to fourth. */
struct reference_decay reference_decrement(const struct reference_series *s)
{
	enum { SWINGS = 5 };
	double height[SWINGS] = {0}, when[SWINGS] = {0}, decrement, w;
	int swing = 0;

	for (size_t k = 0; k < s->count && swing < SWINGS; k++) {
		if (k > 0 && (s->y[k] < 0) != (s->y[k - 1] < 0) && fabs(height[swing]) > 0)
			if (++swing == SWINGS)
				break;
		if (fabs(s->y[k]) > height[swing]) {
			height[swing] = fabs(s->y[k]);
			when[swing] = (double)k / s->rate_hz;
		}
	}
	if (swing < SWINGS)
		return (struct reference_decay){NAN, NAN};
	/* the first swing is cut by the contact's end: from the second to the fourth is one whole cycle */
	decrement = log(height[1] / height[3]);
	w = 2 * M_PI / (when[3] - when[1]);
	return (struct reference_decay){w / (2 * M_PI), decrement / hypot(2 * M_PI, decrement)};
}

/* ---- spectrum --------------------------------------------------------------------------------------------
 */

enum { FFT = 1 << 14 };

static double reference_decay_magnitude(const double *half_complex, size_t k)
{
	return k == 0 || k == FFT / 2 ? fabs(half_complex[k]) : hypot(half_complex[k], half_complex[FFT - k]);
}

/* Bin, with a part, where the magnitude falls to level from k on. */
static double falls(const double *f, size_t k, int step, double level)
{
	while (k > 0 && k < FFT / 2 && reference_decay_magnitude(f, k) > level)
		k = step > 0 ? k + 1 : k - 1;
	if (k == 0 || k == FFT / 2)
		return NAN;
	return (double)k - step * (level - reference_decay_magnitude(f, k)) /
	                           (reference_decay_magnitude(f, step > 0 ? k - 1 : k + 1) -
	                            reference_decay_magnitude(f, k));
}

struct reference_decay reference_spectrum(const struct reference_series *s)
{
	double *f = calloc(FFT, sizeof(*f)), bin = s->rate_hz / FFT, a, b, c, shift, width;
	struct reference_decay found = {NAN, NAN};
	size_t at = (size_t)(20 / bin) + 1;

	if (!f)
		return found;
	for (size_t k = 0; k < s->count && k < FFT; k++)
		f[k] = s->y[k];
	gsl_fft_real_radix2_transform(f, 1, FFT);
	for (size_t k = at; (double)k * bin < 600 && k < FFT / 2 - 1; k++)
		if (reference_decay_magnitude(f, k) > reference_decay_magnitude(f, at))
			at = k;
	a = reference_decay_magnitude(f, at - 1), b = reference_decay_magnitude(f, at),
	c = reference_decay_magnitude(f, at + 1);
	shift = a - 2 * b + c < 0 ? (a - c) / (2 * (a - 2 * b + c)) : 0;
	found.hz = ((double)at + shift) * bin;
	width = falls(f, at, 1, b * M_SQRT1_2) - falls(f, at, -1, b * M_SQRT1_2);
	found.damping = width * bin / (2 * found.hz);
	free(f);
	return found;
}

/* ---- matrix pencil ------------------------------------------------------------------------------------ */

enum { BLOCKS_MAX = 64 };

/* Means of blocks: they keep a damped exponential's pole. */
static size_t reference_decay_block_means(const struct reference_series *s, double mean[BLOCKS_MAX],
                                          size_t *block)
{
	size_t n;

	*block = (s->count + BLOCKS_MAX - 1) / BLOCKS_MAX;
	n = *block > 0 ? s->count / *block : 0;
	for (size_t i = 0; i < n; i++) {
		mean[i] = 0;
		for (size_t k = 0; k < *block; k++)
			mean[i] += s->y[i * *block + k] / (double)*block;
	}
	return n;
}

/* The poles are the eigenvalues of pinv(v0) v1 with v's columns the two strongest right singular vectors,
 * without their last and without their first row. */
static bool pencil(const gsl_matrix *v, size_t rows, double *decay, double *angle)
{
	double g[2][2] = {{0}}, h[2][2] = {{0}}, m[2][2], determinant, trace;

	for (size_t k = 0; k < rows; k++)
		for (size_t i = 0; i < 2; i++)
			for (size_t j = 0; j < 2; j++) {
				g[i][j] += gsl_matrix_get(v, k, i) * gsl_matrix_get(v, k, j);
				h[i][j] += gsl_matrix_get(v, k, i) * gsl_matrix_get(v, k + 1, j);
			}
	determinant = g[0][0] * g[1][1] - g[0][1] * g[1][0];
	for (size_t j = 0; j < 2; j++) {
		m[0][j] = (g[1][1] * h[0][j] - g[0][1] * h[1][j]) / determinant;
		m[1][j] = (g[0][0] * h[1][j] - g[1][0] * h[0][j]) / determinant;
	}
	trace = m[0][0] + m[1][1];
	determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
	if (!(determinant > trace * trace / 4)) /* two real poles: nothing swings */
		return false;
	*decay = sqrt(determinant);
	*angle = acos(trace / (2 * *decay));
	return true;
}

struct reference_decay reference_pencil(const struct reference_series *s)
{
	struct reference_decay found = {NAN, NAN};
	double mean[BLOCKS_MAX], decay, angle;
	size_t block, n = reference_decay_block_means(s, mean, &block), width = n / 3 + 1;
	gsl_matrix *y, *v;
	gsl_vector *singular, *work;

	if (n < 12)
		return found;
	y = gsl_matrix_alloc(n - width + 1, width);
	v = gsl_matrix_alloc(width, width);
	singular = gsl_vector_alloc(width);
	work = gsl_vector_alloc(width);
	if (y && v && singular && work) {
		for (size_t i = 0; i < y->size1; i++)
			for (size_t j = 0; j < width; j++)
				gsl_matrix_set(y, i, j, mean[i + j]);
		if (gsl_linalg_SV_decomp(y, v, singular, work) == 0 && pencil(v, width - 1, &decay, &angle))
			found = of_pole(decay, angle, (double)block / s->rate_hz);
	}
	gsl_matrix_free(y);
	gsl_matrix_free(v);
	gsl_vector_free(singular);
	gsl_vector_free(work);
	return found;
}
