/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/shape_private.h"

#include <math.h>

#include "host/estimate/gram.h"
#include "host/estimate/limits.h"
#include "host/estimate/phasor.h"

/* Of a misfit one more unknown explains less than this part, or it is what the misfit is. */
#define EXPLAINS_PART 0.125

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
		double cosine = at.cosine > LIMIT_ROUNDING ? at.cosine : LIMIT_ROUNDING, sine = at.sine;

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

	if (chi > LIMIT_CHI_REFUSED || score > LIMIT_SIGNIFICANT)
		return SHAPE_REFUSED;
	return chi > LIMIT_CHI || score > LIMIT_AGREE ? SHAPE_DOUBTFUL : SHAPE_FITS;
}

bool shape_hopeless(const struct shape *shape)
{
	double misfit = (shape->chi_square - 1) * shape->freedom;

	if (shape_lopsided(shape))
		return true;
	return shape->family != ESTIMATE_FAMILY_SINE_POWER &&
	       shape->chi_square - 1 > LIMIT_GROSS * LIMIT_CHI_REFUSED * sqrt(2.0 / shape->freedom) &&
	       shape->power_z * shape->power_z < EXPLAINS_PART * misfit;
}

bool shape_lopsided(const struct shape *shape)
{
	double square = shape->skew_z * shape->skew_z;

	return square > LIMIT_SIGNIFICANT * LIMIT_SIGNIFICANT &&
	       square > EXPLAINS_PART * shape->chi_square * shape->freedom;
}
