/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/modes_private.h"

#include <complex.h>
#include <math.h>

#include "common/units.h"
#include "host/estimate/gram.h"
#include "host/estimate/phasor.h"
#include "host/estimate/spring.h"

enum { MEAN_ROUNDS = 6 }; /* each leaves a few hundredths of what the time of a law's cycles is off by */

unsigned modes_size(const struct modes *modes)
{
	return 1 + MODES_EACH * modes->count + (unsigned)modes->law + (modes->hum_hz > 0 ? 2 : 0);
}

bool modes_possible(const struct modes *modes, const double *p)
{
	for (unsigned m = 0; m < modes->count; m++) {
		double decay = p[MODES_DECAY + MODES_EACH * m], omega = p[MODES_OMEGA + MODES_EACH * m];

		if (!(omega > 0) || !(fabs(decay) < MODES_DAMPING_MAX * hypot(decay, omega)))
			return false;
	}
	return true;
}

/* h of the header and its derivative by a. */
struct law {
	double h, by_decay;
};

/* size: of the swing */
static struct law law_at(double decay, double time, double size)
{
	double left = size * size, h = (1 - left) / (2 * decay);

	return (struct law){h, (time * left - h) / decay};
}

/* One mode whose frequency hangs on its swing. */
static size_t bent(const void *context, double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares)
{
	const struct modes_problem *problem = context;
	const struct block_means *series = problem->series;
	double size = exp(-p[MODES_DECAY] * series->first_s), shrink = exp(-p[MODES_DECAY] * series->step_s);
	struct gram gram;

	if (!modes_possible(problem->modes, p) || !(p[MODES_DECAY] > 0))
		return 0;
	gram_start(&gram, MODES_LAW + 1);
	for (unsigned i = 0; i < series->count; i++, size *= shrink) {
		double time = series->first_s + i * series->step_s;
		struct law law = law_at(p[MODES_DECAY], time, size);
		double angle = p[MODES_OMEGA] * time + p[MODES_LAW] * law.h;
		double re = size * cos(angle), im = size * sin(angle);
		double swing = p[MODES_COSINE] * re + p[MODES_SINE] * im;
		double slope = p[MODES_SINE] * re - p[MODES_COSINE] * im;
		double residual = series->value_g[i] - swing - p[MODES_OFFSET];
		double row[] = {1,
		                -time * swing + slope * p[MODES_LAW] * law.by_decay,
		                slope * time,
		                re,
		                im,
		                slope * law.h,
		                residual,
		                0};

		if (series->good[i])
			gram_add(&gram, row);
	}
	return gram_finish(&gram, normal, right, squares);
}

static size_t spring(const void *context, double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	const struct modes_problem *problem = context;

	return spring_normal(problem->series, p, normal, right, squares);
}

static struct lm_problem make_problem(const struct modes *modes, const struct modes_problem *problem)
{
	struct lm_problem made = {.size = modes_size(modes), .model = problem, .normal = modes_undisturbed};

	if (modes->law != MODES_LAW_NONE)
		made.normal = modes->law == MODES_LAW_SQUARE ? bent : spring;
	return made;
}

/* Without a law: the offset, a mode's cosine and sine, the hum's. */
static bool is_linear(const struct modes *modes, unsigned i)
{
	if (i == MODES_OFFSET || i > MODES_EACH * modes->count)
		return true;
	return (i - MODES_DECAY) % MODES_EACH >= MODES_COSINE - MODES_DECAY;
}

bool modes_linear(struct modes *modes, const struct block_means *series)
{
	struct modes_problem problem = {modes, series};
	struct lm_problem lm = make_problem(modes, &problem);
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, squares = 0;
	double part[CHOLESKY_MAX][CHOLESKY_MAX];
	unsigned index[CHOLESKY_MAX], n = 0;
	struct cholesky factor;

	for (unsigned i = 0; i < lm.size; i++) {
		if (!is_linear(modes, i))
			continue;
		modes->p[i] = 0;
		index[n++] = i;
	}
	if (lm.normal(&problem, modes->p, normal, right, &squares) <= n)
		return false;
	for (unsigned i = 0; i < n; i++) {
		for (unsigned j = 0; j <= i; j++)
			part[i][j] = normal[index[i]][index[j]];
		right[i] = right[index[i]];
	}
	if (!cholesky_factor(&factor, n, part))
		return false;
	cholesky_solve(&factor, right, right);
	for (unsigned i = 0; i < n; i++)
		modes->p[index[i]] = right[i];
	return true;
}

bool modes_fit(struct modes *modes, const struct block_means *series)
{
	struct modes_problem problem = {modes, series};
	struct lm_problem lm = make_problem(modes, &problem);

	return lm_fit(&lm, modes->p, &modes->fit);
}

double modes_at(const struct modes *modes, double time_s)
{
	const double *p = modes->p;
	double value = p[MODES_OFFSET], bend = 0;
	unsigned hum = 1 + MODES_EACH * modes->count;

	if (modes->law == MODES_LAW_SPRING)
		return spring_at(p, time_s);
	if (modes->law == MODES_LAW_SQUARE)
		bend = p[MODES_LAW] * law_at(p[MODES_DECAY], time_s, exp(-p[MODES_DECAY] * time_s)).h;
	for (unsigned m = 0; m < modes->count; m++) {
		const double *q = p + MODES_EACH * m;
		double angle = q[MODES_OMEGA] * time_s + bend;

		value += exp(-q[MODES_DECAY] * time_s) *
		         (q[MODES_COSINE] * cos(angle) + q[MODES_SINE] * sin(angle));
	}
	if (modes->hum_hz > 0)
		value += p[hum] * cos(2 * UNITS_PI * modes->hum_hz * time_s) +
		         p[hum + 1] * sin(2 * UNITS_PI * modes->hum_hz * time_s);
	return value;
}

void modes_residual(const struct modes *modes, const struct block_means *series, double *residual_g)
{
	for (unsigned k = 0; k < series->count; k++)
		residual_g[k] = series->value_g[k] - modes->p[MODES_OFFSET];
	for (unsigned m = 0; m < modes->count; m++) {
		const double *p = modes->p + MODES_EACH * m;
		struct phasor r =
		        phasor_decaying(p[MODES_DECAY], p[MODES_OMEGA], series->first_s, series->step_s);

		for (unsigned k = 0; k < series->count; k++, phasor_turn(&r))
			residual_g[k] -= p[MODES_COSINE] * r.cosine + p[MODES_SINE] * r.sine;
	}
}

/* A mean of n samples of e^{q t} about its middle is sinh(n q / 2) / (n sinh(q / 2)) of it, q per sample. */
void modes_unblock(struct modes *modes, const struct block_means *series)
{
	if (series->block == 1 || modes->law == MODES_LAW_SPRING)
		return;
	for (unsigned m = 0; m < modes->count; m++) {
		double *p = modes->p + MODES_EACH * m;
		double complex half = (-p[MODES_DECAY] + p[MODES_OMEGA] * _Complex_I) * series->step_s / 2;
		double complex mean = csinh(half) / (series->block * csinh(half / series->block));
		double complex swing = (p[MODES_COSINE] - p[MODES_SINE] * _Complex_I) / mean;

		p[MODES_COSINE] = creal(swing);
		p[MODES_SINE] = -cimag(swing);
	}
}

double modes_swing_g(const struct modes *modes, unsigned m)
{
	return hypot(modes->p[MODES_COSINE + MODES_EACH * m], modes->p[MODES_SINE + MODES_EACH * m]);
}

unsigned modes_stronger(const struct modes *modes)
{
	return modes->count > 1 && modes_swing_g(modes, 1) > modes_swing_g(modes, 0);
}

double modes_mean_hz(const struct modes *modes, unsigned cycles, unsigned steps)
{
	double decay = modes->p[MODES_DECAY], omega = modes->p[MODES_OMEGA];
	double turns = 2 * UNITS_PI * cycles, span = turns / omega;

	if (modes->law == MODES_LAW_SPRING)
		return spring_mean_hz(modes->p, cycles, steps);
	for (int i = 0; i < MEAN_ROUNDS; i++)
		span *= turns /
		        (omega * span + modes->p[MODES_LAW] * (1 - exp(-2 * decay * span)) / (2 * decay));
	return cycles / span;
}
