/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/modes.h"

#include <complex.h>
#include <math.h>

#include "common/units.h"
#include "host/estimate/gram.h"
#include "host/estimate/pair.h"
#include "host/estimate/spring.h"

enum { MODES_MAX = 2 };

/* Damping beyond this part of the angular frequency is no swing. */
#define DECAY_MAX 3.0

struct problem {
	const struct modes *modes;
	const struct series *series;
};

/* e^{(-a + i w) t} and what turns it by one step. */
struct rotor {
	double re, im, turn_re, turn_im;
};

static struct rotor rotor_start(double decay, double omega, const struct series *series)
{
	double size = exp(-decay * series->first_s), turn = exp(-decay * series->step_s);

	return (struct rotor){size * cos(omega * series->first_s), size * sin(omega * series->first_s),
	                      turn * cos(omega * series->step_s), turn * sin(omega * series->step_s)};
}

static inline void rotor_turn(struct rotor *r)
{
	double re = r->re * r->turn_re - r->im * r->turn_im;

	r->im = r->re * r->turn_im + r->im * r->turn_re;
	r->re = re;
}

unsigned modes_size(const struct modes *modes)
{
	return 1 + MODES_EACH * modes->count + (unsigned)modes->law + (modes->hum_hz > 0 ? 2 : 0);
}

static bool possible(const struct modes *modes, const double *p)
{
	for (unsigned m = 0; m < modes->count; m++) {
		double decay = p[MODES_DECAY + MODES_EACH * m], omega = p[MODES_OMEGA + MODES_EACH * m];

		if (!(omega > 0) || !(fabs(decay) < DECAY_MAX * omega))
			return false;
	}
	return true;
}

/* Sums over the points of one mode, each with t^0, t^1, t^2 in it: e = (re, im) by itself, its products, the
 * residual r. Even and odd points apart. */
struct moments {
	PAIR re[2], im[2], re_re[3], re_im[3], im_im[3];
	PAIR r_re[2], r_im[2], r, rr;
};

static inline void moments_add(struct moments *m, PAIR re, PAIR im, PAIR r, PAIR time)
{
	const PAIR late_re = time * re, late_im = time * im;

	m->re[0] += re;
	m->im[0] += im;
	m->re[1] += late_re;
	m->im[1] += late_im;
	m->re_re[0] += re * re;
	m->re_im[0] += re * im;
	m->im_im[0] += im * im;
	m->re_re[1] += late_re * re;
	m->re_im[1] += late_re * im;
	m->im_im[1] += late_im * im;
	m->re_re[2] += late_re * late_re;
	m->re_im[2] += late_re * late_im;
	m->im_im[2] += late_im * late_im;
	m->r_re[0] += r * re;
	m->r_im[0] += r * im;
	m->r_re[1] += r * late_re;
	m->r_im[1] += r * late_im;
	m->r += r;
	m->rr += r * r;
}

static void moments_take(struct moments *sums, const struct series *series, const double *p)
{
	const bool whole = series->used == series->count;
	struct rotor r = rotor_start(p[MODES_DECAY], p[MODES_OMEGA], series), next = r;
	struct moments m = {.r = {0}};
	PAIR re, im, time = {series->first_s, series->first_s + series->step_s};
	double turn_re = r.turn_re * r.turn_re - r.turn_im * r.turn_im, turn_im = 2 * r.turn_re * r.turn_im;

	rotor_turn(&next);
	re = (PAIR){r.re, next.re};
	im = (PAIR){r.im, next.im};
	for (unsigned k = 0; k < series->count; k += 2) {
		const PAIR turned = re * turn_re - im * turn_im;
		PAIR model = p[MODES_COSINE] * re + p[MODES_SINE] * im + p[MODES_OFFSET];

		if (whole && k + 1 < series->count) {
			moments_add(&m, re, im, pair_load(series->value_g + k) - model, time);
		} else {
			const bool second = k + 1 < series->count && series->good[k + 1];
			const PAIR count = {series->good[k], second};
			const PAIR value = {series->value_g[k], second ? series->value_g[k + 1] : 0};

			moments_add(&m, count * re, count * im, count * (value - model), time);
		}
		time += 2 * series->step_s;
		im = re * turn_im + im * turn_re;
		re = turned;
	}
	*sums = m;
}

/* One mode and the offset: what nearly every record needs, so it is the fast one. The derivative by decay is
 * -t (c re + s im), that by omega t (s re - c im): all sums follow from the moments. */
static size_t plain(const void *context, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                    double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *problem = context;
	const double c = p[MODES_COSINE], s = p[MODES_SINE];
	double re[2], im[2], re_re[3], re_im[3], im_im[3], r_re[2], r_im[2];
	struct moments m;

	if (!possible(problem->modes, p))
		return 0;
	moments_take(&m, problem->series, p);
	for (unsigned i = 0; i < 3; i++) {
		re_re[i] = m.re_re[i][0] + m.re_re[i][1];
		re_im[i] = m.re_im[i][0] + m.re_im[i][1];
		im_im[i] = m.im_im[i][0] + m.im_im[i][1];
	}
	for (unsigned i = 0; i < 2; i++) {
		re[i] = m.re[i][0] + m.re[i][1];
		im[i] = m.im[i][0] + m.im[i][1];
		r_re[i] = m.r_re[i][0] + m.r_re[i][1];
		r_im[i] = m.r_im[i][0] + m.r_im[i][1];
	}
	normal[MODES_OFFSET][MODES_OFFSET] = problem->series->used;
	normal[MODES_DECAY][MODES_OFFSET] = -c * re[1] - s * im[1];
	normal[MODES_DECAY][MODES_DECAY] = c * c * re_re[2] + 2 * c * s * re_im[2] + s * s * im_im[2];
	normal[MODES_OMEGA][MODES_OFFSET] = s * re[1] - c * im[1];
	normal[MODES_OMEGA][MODES_DECAY] = c * s * (im_im[2] - re_re[2]) + (c * c - s * s) * re_im[2];
	normal[MODES_OMEGA][MODES_OMEGA] = s * s * re_re[2] - 2 * c * s * re_im[2] + c * c * im_im[2];
	normal[MODES_COSINE][MODES_OFFSET] = re[0];
	normal[MODES_COSINE][MODES_DECAY] = -c * re_re[1] - s * re_im[1];
	normal[MODES_COSINE][MODES_OMEGA] = s * re_re[1] - c * re_im[1];
	normal[MODES_COSINE][MODES_COSINE] = re_re[0];
	normal[MODES_SINE][MODES_OFFSET] = im[0];
	normal[MODES_SINE][MODES_DECAY] = -c * re_im[1] - s * im_im[1];
	normal[MODES_SINE][MODES_OMEGA] = s * re_im[1] - c * im_im[1];
	normal[MODES_SINE][MODES_COSINE] = re_im[0];
	normal[MODES_SINE][MODES_SINE] = im_im[0];
	right[MODES_OFFSET] = m.r[0] + m.r[1];
	right[MODES_DECAY] = -c * r_re[1] - s * r_im[1];
	right[MODES_OMEGA] = s * r_re[1] - c * r_im[1];
	right[MODES_COSINE] = r_re[0];
	right[MODES_SINE] = r_im[0];
	*squares = m.rr[0] + m.rr[1];
	return problem->series->used;
}

/* Any number of modes, hum or none. */
static size_t general(const void *context, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                      double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *problem = context;
	const struct modes *modes = problem->modes;
	const struct series *series = problem->series;
	const unsigned size = modes_size(modes), hum = 1 + MODES_EACH * modes->count;
	struct rotor rotor[MODES_MAX + 1];
	double row[GRAM_MAX] = {1}, time = series->first_s;
	struct gram gram;

	if (!possible(modes, p))
		return 0;
	gram_start(&gram, size);
	for (unsigned m = 0; m < modes->count; m++)
		rotor[m] =
		        rotor_start(p[MODES_DECAY + MODES_EACH * m], p[MODES_OMEGA + MODES_EACH * m], series);
	rotor[modes->count] = rotor_start(0, 2 * UNITS_PI * modes->hum_hz, series);
	for (unsigned k = 0; k < series->count; k++, time += series->step_s) {
		double residual = series->value_g[k] - p[MODES_OFFSET];

		for (unsigned m = 0; m < modes->count; m++) {
			const double *q = p + MODES_EACH * m;
			double *mine = row + MODES_EACH * m, re = rotor[m].re, im = rotor[m].im;
			double swing = q[MODES_COSINE] * re + q[MODES_SINE] * im;

			mine[MODES_DECAY] = -time * swing;
			mine[MODES_OMEGA] = time * (q[MODES_SINE] * re - q[MODES_COSINE] * im);
			mine[MODES_COSINE] = re;
			mine[MODES_SINE] = im;
			residual -= swing;
			rotor_turn(&rotor[m]);
		}
		if (modes->hum_hz > 0) {
			row[hum] = rotor[modes->count].re;
			row[hum + 1] = rotor[modes->count].im;
			residual -= p[hum] * row[hum] + p[hum + 1] * row[hum + 1];
			rotor_turn(&rotor[modes->count]);
		}
		row[size] = residual;
		if (series->good[k])
			gram_add(&gram, row);
	}
	return gram_finish(&gram, normal, right, squares);
}

/* h of the header and its derivative by a. */
struct law {
	double h, by_decay;
};

static struct law law_at(double decay, double time)
{
	double left = exp(-2 * decay * time), h = (1 - left) / (2 * decay);

	return (struct law){h, (time * left - h) / decay};
}

/* One mode whose frequency hangs on its swing. */
static size_t bent(const void *context, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *problem = context;
	const struct series *series = problem->series;
	struct gram gram;

	if (!possible(problem->modes, p) || !(p[MODES_DECAY] > 0))
		return 0;
	gram_start(&gram, MODES_LAW + 1);
	for (unsigned i = 0; i < series->count; i++) {
		double time = series->first_s + i * series->step_s, size = exp(-p[MODES_DECAY] * time);
		struct law law = law_at(p[MODES_DECAY], time);
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

static size_t spring(const void *context, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *problem = context;

	return spring_normal(problem->series, p, normal, right, squares);
}

static struct lm_problem make_problem(const struct modes *modes, const struct problem *problem)
{
	struct lm_problem made = {.size = modes_size(modes), .model = problem, .normal = general};

	if (modes->law != MODES_LAW_NONE)
		made.normal = modes->law == MODES_LAW_SQUARE ? bent : spring;
	else if (modes->count == 1 && !(modes->hum_hz > 0))
		made.normal = plain;
	return made;
}

static bool is_linear(const struct modes *modes, unsigned i)
{
	if (i == MODES_OFFSET || i > MODES_EACH * modes->count)
		return modes->law == MODES_LAW_NONE || i == MODES_OFFSET;
	return (i - MODES_DECAY) % MODES_EACH >= MODES_COSINE - MODES_DECAY;
}

bool modes_linear(struct modes *modes, const struct series *series)
{
	struct problem problem = {modes, series};
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

bool modes_fit(struct modes *modes, const struct series *series)
{
	struct problem problem = {modes, series};
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
		bend = p[MODES_LAW] * law_at(p[MODES_DECAY], time_s).h;
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

void modes_residual(const struct modes *modes, const struct series *series, double *residual_g)
{
	for (unsigned k = 0; k < series->count; k++)
		residual_g[k] = series->value_g[k] - modes->p[MODES_OFFSET];
	for (unsigned m = 0; m < modes->count; m++) {
		const double *p = modes->p + MODES_EACH * m;
		struct rotor r = rotor_start(p[MODES_DECAY], p[MODES_OMEGA], series);

		for (unsigned k = 0; k < series->count; k++, rotor_turn(&r))
			residual_g[k] -= p[MODES_COSINE] * r.re + p[MODES_SINE] * r.im;
	}
}

/* A mean of n samples of e^{q t} about its middle is sinh(n q / 2) / (n sinh(q / 2)) of it, q per sample. */
void modes_unblock(struct modes *modes, const struct series *series)
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

double modes_mean_hz(const struct modes *modes, unsigned cycles)
{
	double decay = modes->p[MODES_DECAY], omega = modes->p[MODES_OMEGA], span, turned;

	if (modes->law == MODES_LAW_SPRING)
		return spring_mean_hz(modes->p, cycles);
	span = 2 * UNITS_PI * cycles / omega;
	turned = omega * span + modes->p[MODES_LAW] * (1 - exp(-2 * decay * span)) / (2 * decay);
	return turned / (2 * UNITS_PI * span);
}
