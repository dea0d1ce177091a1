/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/shape_private.h"

#include <math.h>

#include "host/estimate/gram.h"
#include "host/estimate/phasor.h"

#define CHI_REFUSED 6.0
#define SCORE_REFUSED 5.0

#define LOPSIDED_PART 0.125

/* Of a misfit that no power explains another power takes less than this part; told where chi-square is this
 * many times as far off as what is refused. */
#define POWER_PART 0.1
#define GROSS 3.0

/* How much the residual asks for a direction, in standard deviations: number q of the columns, against the
 * unknowns before. */
static double score(const struct shape *shape, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                    const double right[CHOLESKY_MAX], unsigned q)
{
	double square = matrix[q][q], rest = square - cholesky_variance(&shape->factor, matrix[q]);

	return rest > 1e-9 * square ? right[q] / (shape->noise_g * sqrt(rest)) : 0;
}

bool shape_question(const struct shape_problem *m, const double *p, struct shape *shape)
{
	double matrix[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, squares;
	const unsigned size = shape_unknowns(m->family), skew = size, power = size + 1;
	const bool asks_power = size == SHAPE_POWER;
	struct shape_under under = shape_under_pulse(m, p);
	struct phasor at = phasor_at(under.phi, under.step);
	double phi = under.phi;
	struct gram gram;

	gram_start(&gram, asks_power ? size + 2 : size + 1);
	for (size_t k = under.first; k < under.last; k++, phi += under.step) {
		double row[GRAM_COMMON], residual = m->trace->value_g[k];
		double cosine = at.cosine > SHAPE_COSINE_MIN ? at.cosine : SHAPE_COSINE_MIN, sine = at.sine;

		phasor_turn(&at);
		if (!trace_good(m->trace, k) || shape_is_censored(m, k))
			continue;
		residual -= shape_row(m, p, phi, cosine, sine, row);
		row[skew] = row[SHAPE_BASE] * phi;
		if (asks_power)
			row[power] = row[SHAPE_PEAK] * log(cosine);
		row[GRAM_COMMON - 1] = residual;
		gram_add(&gram, row);
	}
	squares = shape_squares_beyond(m, &under);
	if (gram_finish(&gram, matrix, right, &squares) <= size)
		return false;
	shape->freedom = (unsigned)(shape_count_used(m) - size);
	shape->noise_g = sqrt(squares / shape->freedom);
	if (!(m->trace->noise_g > 0))
		return true;
	shape->chi_square = squares / shape->freedom / (m->trace->noise_g * m->trace->noise_g);
	shape->noise_g = m->trace->noise_g;
	shape->skew_z = score(shape, matrix, right, skew);
	shape->power_z = asks_power ? score(shape, matrix, right, power) : 0;
	return true;
}

enum shape_verdict shape_judge(const struct shape *shape)
{
	double chi = (shape->chi_square - 1) / sqrt(2.0 / shape->freedom);
	double score = fmax(fabs(shape->skew_z), fabs(shape->power_z));

	if (chi > CHI_REFUSED || score > SCORE_REFUSED)
		return SHAPE_REFUSED;
	return chi > SHAPE_CHI_MAX || score > SHAPE_SCORE_MAX ? SHAPE_DOUBTFUL : SHAPE_FITS;
}

bool shape_hopeless(const struct shape *shape)
{
	double misfit = (shape->chi_square - 1) * shape->freedom;

	if (shape_lopsided(shape))
		return true;
	return shape->family != ESTIMATE_FAMILY_SINE_POWER &&
	       shape->chi_square - 1 > GROSS * CHI_REFUSED * sqrt(2.0 / shape->freedom) &&
	       shape->power_z * shape->power_z < POWER_PART * misfit;
}

bool shape_lopsided(const struct shape *shape)
{
	double square = shape->skew_z * shape->skew_z;

	return square > SCORE_REFUSED * SCORE_REFUSED &&
	       square > LOPSIDED_PART * shape->chi_square * shape->freedom;
}
