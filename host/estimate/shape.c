/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/shape_private.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/phasor.h"
#include "host/estimate/simd2.h"

/* The fit looks this many half widths to either side: as far as the foot of a haversine and a fifth more. */
#define REACH_HALF_WIDTHS 1.2

#define POWER_START 1.4

/* The base may become this many times what it started with, or as little of it. */
#define BASE_RANGE 4.0

/* A limit this many sigma above the model: erfc has nothing left there. */
#define CENSORED_FAR 25.0

/* On the kink at a foot the fit may stop this far from its bottom, in squares of sigma. */
#define KINK_GAIN 1e-2

const enum estimate_family shape_ladder[SHAPE_LADDER] = {ESTIMATE_FAMILY_HALF_SINE, ESTIMATE_FAMILY_HAVERSINE,
                                                         ESTIMATE_FAMILY_SINE_POWER};

struct shape_under shape_under_pulse(const struct shape_problem *m, const double *p)
{
	double rate = m->trace->rate_hz, peak_s = m->near_s + p[SHAPE_TIME],
	       step = UNITS_PI / (p[SHAPE_BASE] * rate);
	double from = floor((peak_s - p[SHAPE_BASE] / 2 - trace_time(m->trace, m->first)) * rate) + 1;
	double until = ceil((peak_s + p[SHAPE_BASE] / 2 - trace_time(m->trace, m->first)) * rate);
	double count = (double)(m->last - m->first);
	struct shape_under under;

	under.first = m->first + (size_t)fmin(fmax(from, 0), count);
	under.last = m->first + (size_t)fmin(fmax(until, 0), count);
	if (under.last < under.first)
		under.last = under.first;
	under.phi = UNITS_PI * (trace_time(m->trace, under.first) - peak_s) / p[SHAPE_BASE];
	under.step = step;
	return under;
}

/* What a sample adds: value short of the truth by residual_g counts with this weight and residual, and adds
 * to the squares. */
struct share {
	double weight, residual_g, squares;
};

/* "At least value": -2 log of the probability, its slope and curvature, as a residual of a square would have
 * them. over is by how many sigma the limit lies above the model. */
static struct share censored(double over, double noise_g)
{
	double tail, ratio;

	if (over > CENSORED_FAR) {
		ratio = over + 1 / over;
		return (struct share){1, ratio * noise_g,
		                      noise_g * noise_g * (over * over + 2 * log(over * sqrt(2 * UNITS_PI)))};
	}
	tail = 0.5 * erfc(over / sqrt(2.0));
	ratio = exp(-over * over / 2) / (sqrt(2 * UNITS_PI) * tail);
	return (struct share){ratio * (ratio - over), ratio * noise_g, -2 * noise_g * noise_g * log(tail)};
}

static bool shape_possible(const struct shape_problem *m, const double *p)
{
	if (!(p[SHAPE_BASE] < BASE_RANGE * m->base_s && p[SHAPE_BASE] * BASE_RANGE > m->base_s) ||
	    !(fabs(p[SHAPE_TIME]) < m->base_s) || !isfinite(p[SHAPE_PEAK]))
		return false;
	return m->family != ESTIMATE_FAMILY_SINE_POWER ||
	       (p[SHAPE_POWER] > SHAPE_POWER_MIN && p[SHAPE_POWER] < SHAPE_POWER_MAX);
}

static void add_censored(unsigned size, const double *row, const struct share *share,
                         double matrix[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX])
{
	for (unsigned i = 0; i < size; i++) {
		for (unsigned j = 0; j <= i; j++)
			matrix[i][j] += share->weight * row[i] * row[j];
		right[i] += share->residual_g * row[i];
	}
}

/* Adds the samples that only say "at least". */
static void censor(const struct shape_problem *m, const double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares)
{
	const struct shape_under under = shape_under_pulse(m, p);

	for (size_t k = m->first; k < m->last; k++) {
		double phi = under.phi + ((double)k - (double)under.first) * under.step;
		double row[SHAPE_UNKNOWNS] = {0}, residual = m->trace->value_g[k];
		double sign = residual < 0 ? -1 : 1;
		struct share share;

		if (!trace_good(m->trace, k) || !shape_is_censored(m, k))
			continue;
		if (k >= under.first && k < under.last)
			residual -= shape_row(m, p, phi, fmax(cos(phi), LIMIT_ROUNDING), sin(phi), row);
		share = censored(sign * residual / m->noise_g, m->noise_g);
		share.residual_g *= sign;
		*squares += share.squares;
		add_censored(shape_unknowns(m->family), row, &share, matrix, right);
	}
}

/* Sums over the samples under the pulse: of its unit u, the unit's slope v by phi, the unit's derivative w by
 * the power, the residual r, and phi. Even and odd samples apart. */
struct sums {
	PAIR uu, uv, vv, phi_uv, phi_vv, phi2_vv, uw, vw, phi_vw, ww, ru, rv, phi_rv, rw, rr;
};

/* Two samples from k on, and which of them count: 1 or 0 each. */
static inline PAIR two_samples(const struct shape_problem *m, size_t k, size_t last, PAIR *count)
{
	PAIR value = {0, 0};

	*count = (PAIR){1, 1};
	if (m->plain && k + 1 < last)
		return pair_load(m->trace->value_g + k);
	for (unsigned i = 0; i < 2; i++) {
		bool counts = k + i < last && trace_good(m->trace, k + i) && !shape_is_censored(m, k + i);

		(*count)[i] = counts;
		value[i] = counts ? m->trace->value_g[k + i] : 0;
	}
	return value;
}

static inline void shape_add_up(struct sums *sums, PAIR phi, PAIR u, PAIR v, PAIR r)
{
	const PAIR late = phi * v;

	sums->uu += u * u;
	sums->uv += u * v;
	sums->vv += v * v;
	sums->phi_uv += u * late;
	sums->phi_vv += v * late;
	sums->phi2_vv += late * late;
	sums->ru += r * u;
	sums->rv += r * v;
	sums->phi_rv += r * late;
	sums->rr += r * r;
}

static inline void add_power(struct sums *sums, PAIR phi, PAIR u, PAIR v, PAIR w, PAIR r)
{
	sums->uw += u * w;
	sums->vw += v * w;
	sums->phi_vw += phi * v * w;
	sums->ww += w * w;
	sums->rw += r * w;
}

static struct sums sum_under(const struct shape_problem *m, const double *p, const struct shape_under *under)
{
	struct phasor_pair at = phasor_two(phasor_at(under->phi, under->step));
	PAIR phi = {under->phi, under->phi + under->step};
	struct sums sums = {.uu = {0}};

	for (size_t k = under->first; k < under->last; k += 2) {
		const PAIR c = at.cosine, s = at.sine;
		PAIR count, value = two_samples(m, k, under->last, &count);

		if (m->family == ESTIMATE_FAMILY_SINE_POWER) {
			const PAIR cosine = pair_more(c, (PAIR){LIMIT_ROUNDING, LIMIT_ROUNDING});
			const PAIR logarithm = {log(cosine[0]), log(cosine[1])},
			           less = (p[SHAPE_POWER] - 1) * logarithm;
			const PAIR rest = count * (PAIR){exp(less[0]), exp(less[1])};
			const PAIR u = rest * cosine, v = -p[SHAPE_POWER] * rest * s, w = u * logarithm;

			shape_add_up(&sums, phi, u, v, value - p[SHAPE_PEAK] * u);
			add_power(&sums, phi, u, v, w, value - p[SHAPE_PEAK] * u);
		} else {
			PAIR u = m->family == ESTIMATE_FAMILY_HALF_SINE ? count * c : count * c * c;
			PAIR v = m->family == ESTIMATE_FAMILY_HALF_SINE ? -count * s : -2 * count * c * s;

			shape_add_up(&sums, phi, u, v, value - p[SHAPE_PEAK] * u);
		}
		phi += 2 * under->step;
		phasor_pair_turn(&at);
	}
	return sums;
}

static inline double shape_both(PAIR pair)
{
	return pair[0] + pair[1];
}

static double shape_squares_of(const struct shape_problem *m, size_t from, size_t until)
{
	PAIR squares = {0, 0}, count;

	for (size_t k = from; k < until; k += 2) {
		PAIR value = two_samples(m, k, until, &count);

		squares += value * value;
	}
	return shape_both(squares);
}

double shape_squares_beyond(const struct shape_problem *m, const struct shape_under *under)
{
	return shape_squares_of(m, m->first, under->first) + shape_squares_of(m, under->last, m->last);
}

size_t shape_count_used(const struct shape_problem *m)
{
	size_t used = 0;

	if (m->plain)
		return m->last - m->first;
	for (size_t k = m->first; k < m->last; k++)
		used += trace_good(m->trace, k) && !shape_is_censored(m, k);
	return used;
}

static size_t shape_normal(const void *model, double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                           double right[CHOLESKY_MAX], double *squares)
{
	const struct shape_problem *m = model;
	const double by_base = -p[SHAPE_PEAK] / p[SHAPE_BASE], by_time = UNITS_PI * by_base;
	struct shape_under under;
	struct sums sums;

	if (!shape_possible(m, p))
		return 0;
	under = shape_under_pulse(m, p);
	sums = sum_under(m, p, &under);
	matrix[SHAPE_PEAK][SHAPE_PEAK] = shape_both(sums.uu);
	matrix[SHAPE_TIME][SHAPE_PEAK] = by_time * shape_both(sums.uv);
	matrix[SHAPE_TIME][SHAPE_TIME] = by_time * by_time * shape_both(sums.vv);
	matrix[SHAPE_BASE][SHAPE_PEAK] = by_base * shape_both(sums.phi_uv);
	matrix[SHAPE_BASE][SHAPE_TIME] = by_base * by_time * shape_both(sums.phi_vv);
	matrix[SHAPE_BASE][SHAPE_BASE] = by_base * by_base * shape_both(sums.phi2_vv);
	matrix[SHAPE_POWER][SHAPE_PEAK] = p[SHAPE_PEAK] * shape_both(sums.uw);
	matrix[SHAPE_POWER][SHAPE_TIME] = p[SHAPE_PEAK] * by_time * shape_both(sums.vw);
	matrix[SHAPE_POWER][SHAPE_BASE] = p[SHAPE_PEAK] * by_base * shape_both(sums.phi_vw);
	matrix[SHAPE_POWER][SHAPE_POWER] = p[SHAPE_PEAK] * p[SHAPE_PEAK] * shape_both(sums.ww);
	right[SHAPE_PEAK] = shape_both(sums.ru);
	right[SHAPE_TIME] = by_time * shape_both(sums.rv);
	right[SHAPE_BASE] = by_base * shape_both(sums.phi_rv);
	right[SHAPE_POWER] = p[SHAPE_PEAK] * shape_both(sums.rw);
	*squares = shape_both(sums.rr) + shape_squares_beyond(m, &under);
	if (!m->plain)
		censor(m, p, matrix, right, squares);
	return shape_count_used(m);
}

double shape_mean_cosine(double power)
{
	return tgamma((power + 1) / 2) / tgamma(power / 2 + 1) / sqrt(UNITS_PI);
}

/* Of a pulse of height and base 1. */
static double unit_area(const struct shape *shape, double power)
{
	if (shape->family == ESTIMATE_FAMILY_HALF_SINE)
		return 2 / UNITS_PI;
	if (shape->family == ESTIMATE_FAMILY_HAVERSINE)
		return 0.5;
	return shape_mean_cosine(power);
}

static void shape_express(const struct shape_problem *m, const double *p, struct shape *shape)
{
	double unit[SHAPE_UNKNOWNS][CHOLESKY_MAX] = {{1}, {0, 1}, {0, 0, 1}}, area[CHOLESKY_MAX] = {0};
	double height = unit_area(shape, p[SHAPE_POWER]), h = 1e-4;

	area[SHAPE_PEAK] = height * p[SHAPE_BASE];
	area[SHAPE_BASE] = height * p[SHAPE_PEAK];
	if (shape->family == ESTIMATE_FAMILY_SINE_POWER)
		area[SHAPE_POWER] =
		        p[SHAPE_PEAK] * p[SHAPE_BASE] *
		        (unit_area(shape, p[SHAPE_POWER] + h) - unit_area(shape, p[SHAPE_POWER] - h)) /
		        (2 * h);
	shape->peak_g = p[SHAPE_PEAK];
	shape->peak_s = m->near_s + p[SHAPE_TIME];
	shape->base_s = p[SHAPE_BASE];
	shape->power = p[SHAPE_POWER];
	shape->area_g_s = height * p[SHAPE_PEAK] * p[SHAPE_BASE];
	shape->sigma_peak_g = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[SHAPE_PEAK]));
	shape->sigma_peak_s = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[SHAPE_TIME]));
	shape->sigma_base_s = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[SHAPE_BASE]));
	shape->sigma_area_g_s = shape->noise_g * sqrt(cholesky_variance(&shape->factor, area));
}

/* Base of the family's pulse of that width at half height. */
static double base_of(enum estimate_family family, double power, double half_width_s)
{
	if (family == ESTIMATE_FAMILY_HALF_SINE)
		return 1.5 * half_width_s;
	if (family == ESTIMATE_FAMILY_HAVERSINE)
		return 2 * half_width_s;
	return UNITS_PI * half_width_s / (2 * acos(pow(0.5, 1 / power)));
}

bool shape_fit(struct shape *shape, const struct trace *trace, enum estimate_family family,
               const struct shape_start *start)
{
	double power = family == ESTIMATE_FAMILY_HALF_SINE   ? 1
	               : family == ESTIMATE_FAMILY_HAVERSINE ? 2
	                                                     : POWER_START;
	double reach = REACH_HALF_WIDTHS * start->half_width_s;
	double base = base_of(family, power, start->half_width_s);
	double p[SHAPE_UNKNOWNS] = {start->peak_g, 0, base, power};
	struct shape_problem problem = {.trace = trace,
	                                .family = family,
	                                .first = trace_index(trace, start->peak_s - reach),
	                                .last = trace_index(trace, start->peak_s + reach),
	                                .near_s = start->peak_s,
	                                .base_s = base,
	                                .noise_g = fmax(trace->noise_g, LIMIT_SMALL * fabs(start->peak_g)),
	                                .limit_first = trace_index(trace, start->limit_from_s)};
	struct lm_problem lm = {shape_unknowns(family), &problem, shape_normal, KINK_GAIN};
	struct shape found = {
	        .family = family, .chi_square = NAN, .skew_z = NAN, .power_z = NAN, .noise_g = NAN};
	struct lm_result result;

	if (start->limit_from_s <= start->limit_until_s)
		problem.limit_count = trace_index(trace, start->limit_until_s) - problem.limit_first;
	problem.plain = problem.limit_count == 0 && !trace_any(trace, trace_time(trace, problem.first),
	                                                       trace_time(trace, problem.last - 1), ~0u);
	if (!(base > 0) || !lm_fit(&lm, p, &result) || !(p[SHAPE_PEAK] * start->peak_g > 0))
		return false;
	found.factor = result.factor;
	if (!shape_question(&problem, p, &found))
		return false;
	shape_express(&problem, p, &found);
	if (!isfinite(found.sigma_peak_g) || !isfinite(found.sigma_peak_s))
		return false;
	*shape = found;
	return true;
}

void shape_at(const struct shape *shape, double time_s, double derivative[3], double variance[2])
{
	double turn = UNITS_PI / shape->base_s, phi = turn * (time_s - shape->peak_s), h = 1e-3;
	double place[3][3], value[CHOLESKY_MAX], slope[CHOLESKY_MAX];

	derivative[0] = derivative[1] = derivative[2] = 0;
	if (variance)
		variance[0] = variance[1] = 0;
	if (!(fabs(phi) < UNITS_PI / 2 - h))
		return;
	for (int i = 0; i < 3; i++)
		shape_unit(shape->family, shape->power, cos(phi + (i - 1) * h), sin(phi + (i - 1) * h),
		           place[i]);
	derivative[0] = shape->peak_g * place[1][0];
	derivative[1] = shape->peak_g * turn * place[1][1];
	derivative[2] = shape->peak_g * turn * turn * (place[2][1] - place[0][1]) / (2 * h);
	if (!variance)
		return;
	value[SHAPE_PEAK] = place[1][0];
	value[SHAPE_TIME] = -derivative[1];
	value[SHAPE_BASE] = -phi / turn * derivative[1] / shape->base_s;
	value[SHAPE_POWER] = shape->peak_g * place[1][2];
	slope[SHAPE_PEAK] = turn * place[1][1];
	slope[SHAPE_TIME] = -derivative[2];
	slope[SHAPE_BASE] = -(derivative[1] + phi / turn * derivative[2]) / shape->base_s;
	slope[SHAPE_POWER] = shape->peak_g * turn * (place[2][2] - place[0][2]) / (2 * h);
	variance[0] = pow(shape->noise_g, 2) * cholesky_variance(&shape->factor, value);
	variance[1] = pow(shape->noise_g, 2) * cholesky_variance(&shape->factor, slope);
}
