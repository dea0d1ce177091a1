/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/shape.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/gram.h"
#include "host/estimate/pair.h"

enum { PEAK, TIME, BASE, POWER, UNKNOWNS };

/* The fit looks this many half widths to either side: as far as the foot of a haversine and a fifth more. */
#define REACH_HALF_WIDTHS 1.2

#define CHI_REFUSED 6.0
#define SCORE_REFUSED 5.0

#define LOPSIDED_PART 0.125

/* Of a misfit that no power explains another power takes less than this part; told where chi-square is this
 * many times as far off as what is refused. */
#define POWER_PART 0.1
#define GROSS 3.0

#define POWER_START 1.4
#define POWER_MIN 0.3
#define POWER_MAX 12.0

/* The base may become this many times what it started with, or as little of it. */
#define BASE_RANGE 4.0

/* A limit this many sigma above the model: erfc has nothing left there. */
#define CENSORED_FAR 25.0

/* On the kink at a foot the fit may stop this far from its bottom, in squares of sigma. */
#define KINK_GAIN 1e-2

/* At a foot rounding must not lead below zero. */
#define COSINE_MIN 1e-12

/* Without noise a limit is sharp. */
#define SHARP 1e-6

struct problem {
	const struct trace *trace;
	enum estimate_family family;
	size_t first, last;              /* [first, last) */
	bool plain;                      /* none of these samples carries a mark */
	double near_s;                   /* time is counted from here */
	double base_s;                   /* at the start */
	double noise_g;                  /* of censored samples, positive */
	size_t limit_first, limit_count; /* samples that are as if at a limit */
};

/* Of the samples those under the pulse, [first, last), and phi of the first and from one to the next. */
struct under {
	size_t first, last;
	double phi, step;
};

static struct under under_pulse(const struct problem *m, const double *p)
{
	double rate = m->trace->rate_hz, peak_s = m->near_s + p[TIME], step = UNITS_PI / (p[BASE] * rate);
	double from = floor((peak_s - p[BASE] / 2 - trace_time(m->trace, m->first)) * rate) + 1;
	double until = ceil((peak_s + p[BASE] / 2 - trace_time(m->trace, m->first)) * rate);
	double count = (double)(m->last - m->first);
	struct under under;

	under.first = m->first + (size_t)fmin(fmax(from, 0), count);
	under.last = m->first + (size_t)fmin(fmax(until, 0), count);
	if (under.last < under.first)
		under.last = under.first;
	under.phi = UNITS_PI * (trace_time(m->trace, under.first) - peak_s) / p[BASE];
	under.step = step;
	return under;
}

/* The pulse of height 1, its derivative by phi, and by the power. */
static inline void unit_pulse(enum estimate_family family, double power, double cosine, double sine,
                              double out[3])
{
	double logarithm, rest;

	switch (family) {
	case ESTIMATE_FAMILY_HALF_SINE:
		out[0] = cosine;
		out[1] = -sine;
		out[2] = 0;
		return;
	case ESTIMATE_FAMILY_HAVERSINE:
		out[0] = cosine * cosine;
		out[1] = -2 * cosine * sine;
		out[2] = 0;
		return;
	default:
		logarithm = log(cosine);
		rest = exp((power - 1) * logarithm);
		out[0] = rest * cosine;
		out[1] = -power * rest * sine;
		out[2] = out[0] * logarithm;
	}
}

static bool is_censored(const struct problem *m, size_t k)
{
	return k - m->limit_first < m->limit_count || m->trace->sample[k] & TRACE_LIMIT;
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

static bool possible(const struct problem *m, const double *p)
{
	if (!(p[BASE] < BASE_RANGE * m->base_s && p[BASE] * BASE_RANGE > m->base_s) ||
	    !(fabs(p[TIME]) < m->base_s) || !isfinite(p[PEAK]))
		return false;
	return m->family != ESTIMATE_FAMILY_SINE_POWER || (p[POWER] > POWER_MIN && p[POWER] < POWER_MAX);
}

static unsigned unknowns(enum estimate_family family)
{
	return family == ESTIMATE_FAMILY_SINE_POWER ? UNKNOWNS : UNKNOWNS - 1;
}

/* Value and derivatives by the unknowns. */
static inline double row_at(const struct problem *m, const double *p, double phi, double cosine, double sine,
                            double row[UNKNOWNS])
{
	double unit[3], slope;

	unit_pulse(m->family, p[POWER], cosine, sine, unit);
	slope = -p[PEAK] * unit[1] / p[BASE];
	row[PEAK] = unit[0];
	row[TIME] = UNITS_PI * slope;
	row[BASE] = phi * slope;
	row[POWER] = p[PEAK] * unit[2];
	return p[PEAK] * unit[0];
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
static void censor(const struct problem *m, const double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                   double right[CHOLESKY_MAX], double *squares)
{
	const struct under under = under_pulse(m, p);

	for (size_t k = m->first; k < m->last; k++) {
		double phi = under.phi + ((double)k - (double)under.first) * under.step;
		double row[UNKNOWNS] = {0}, residual = m->trace->value_g[k];
		double sign = residual < 0 ? -1 : 1;
		struct share share;

		if (!trace_good(m->trace, k) || !is_censored(m, k))
			continue;
		if (k >= under.first && k < under.last)
			residual -= row_at(m, p, phi, fmax(cos(phi), COSINE_MIN), sin(phi), row);
		share = censored(sign * residual / m->noise_g, m->noise_g);
		share.residual_g *= sign;
		*squares += share.squares;
		add_censored(unknowns(m->family), row, &share, matrix, right);
	}
}

/* Sums over the samples under the pulse: of its unit u, the unit's slope v by phi, the unit's derivative w by
 * the power, the residual r, and phi. Even and odd samples apart. */
struct sums {
	PAIR uu, uv, vv, phi_uv, phi_vv, phi2_vv, uw, vw, phi_vw, ww, ru, rv, phi_rv, rw, rr;
};

/* Two samples from k on, and which of them count: 1 or 0 each. */
static inline PAIR two_samples(const struct problem *m, size_t k, size_t last, PAIR *count)
{
	PAIR value = {0, 0};

	*count = (PAIR){1, 1};
	if (m->plain && k + 1 < last)
		return pair_load(m->trace->value_g + k);
	for (unsigned i = 0; i < 2; i++) {
		bool counts = k + i < last && trace_good(m->trace, k + i) && !is_censored(m, k + i);

		(*count)[i] = counts;
		value[i] = counts ? m->trace->value_g[k + i] : 0;
	}
	return value;
}

static inline void add_up(struct sums *sums, PAIR phi, PAIR u, PAIR v, PAIR r)
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

/* cos and sin of phi by recurrence. */
static struct sums sum_under(const struct problem *m, const double *p, const struct under *under)
{
	const double turn_c = cos(2 * under->step), turn_s = sin(2 * under->step);
	PAIR phi = {under->phi, under->phi + under->step};
	PAIR c = {cos(phi[0]), cos(phi[1])}, s = {sin(phi[0]), sin(phi[1])};
	struct sums sums = {.uu = {0}};

	for (size_t k = under->first; k < under->last; k += 2) {
		PAIR count, value = two_samples(m, k, under->last, &count), next = c * turn_c - s * turn_s;

		if (m->family == ESTIMATE_FAMILY_SINE_POWER) {
			const PAIR cosine = pair_more(c, (PAIR){COSINE_MIN, COSINE_MIN});
			const PAIR logarithm = {log(cosine[0]), log(cosine[1])},
			           less = (p[POWER] - 1) * logarithm;
			const PAIR rest = count * (PAIR){exp(less[0]), exp(less[1])};
			const PAIR u = rest * cosine, v = -p[POWER] * rest * s, w = u * logarithm;

			add_up(&sums, phi, u, v, value - p[PEAK] * u);
			add_power(&sums, phi, u, v, w, value - p[PEAK] * u);
		} else {
			PAIR u = m->family == ESTIMATE_FAMILY_HALF_SINE ? count * c : count * c * c;
			PAIR v = m->family == ESTIMATE_FAMILY_HALF_SINE ? -count * s : -2 * count * c * s;

			add_up(&sums, phi, u, v, value - p[PEAK] * u);
		}
		phi += 2 * under->step;
		s = s * turn_c + c * turn_s;
		c = next;
	}
	return sums;
}

static inline double both(PAIR pair)
{
	return pair[0] + pair[1];
}

static double squares_of(const struct problem *m, size_t from, size_t until)
{
	PAIR squares = {0, 0}, count;

	for (size_t k = from; k < until; k += 2) {
		PAIR value = two_samples(m, k, until, &count);

		squares += value * value;
	}
	return both(squares);
}

/* Of the samples beyond the pulse's feet. */
static double squares_beyond(const struct problem *m, const struct under *under)
{
	return squares_of(m, m->first, under->first) + squares_of(m, under->last, m->last);
}

static size_t count_used(const struct problem *m)
{
	size_t used = 0;

	if (m->plain)
		return m->last - m->first;
	for (size_t k = m->first; k < m->last; k++)
		used += trace_good(m->trace, k) && !is_censored(m, k);
	return used;
}

static size_t normal(const void *model, const double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *m = model;
	const double by_base = -p[PEAK] / p[BASE], by_time = UNITS_PI * by_base;
	struct under under;
	struct sums sums;

	if (!possible(m, p))
		return 0;
	under = under_pulse(m, p);
	sums = sum_under(m, p, &under);
	matrix[PEAK][PEAK] = both(sums.uu);
	matrix[TIME][PEAK] = by_time * both(sums.uv);
	matrix[TIME][TIME] = by_time * by_time * both(sums.vv);
	matrix[BASE][PEAK] = by_base * both(sums.phi_uv);
	matrix[BASE][TIME] = by_base * by_time * both(sums.phi_vv);
	matrix[BASE][BASE] = by_base * by_base * both(sums.phi2_vv);
	matrix[POWER][PEAK] = p[PEAK] * both(sums.uw);
	matrix[POWER][TIME] = p[PEAK] * by_time * both(sums.vw);
	matrix[POWER][BASE] = p[PEAK] * by_base * both(sums.phi_vw);
	matrix[POWER][POWER] = p[PEAK] * p[PEAK] * both(sums.ww);
	right[PEAK] = both(sums.ru);
	right[TIME] = by_time * both(sums.rv);
	right[BASE] = by_base * both(sums.phi_rv);
	right[POWER] = p[PEAK] * both(sums.rw);
	*squares = both(sums.rr) + squares_beyond(m, &under);
	if (!m->plain)
		censor(m, p, matrix, right, squares);
	return count_used(m);
}

/* How much the residual asks for a direction, in standard deviations: number q of the columns, against the
 * unknowns before. */
static double score(const struct shape *shape, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                    const double right[CHOLESKY_MAX], unsigned q)
{
	double square = matrix[q][q], rest = square - cholesky_variance(&shape->factor, matrix[q]);

	return rest > 1e-9 * square ? right[q] / (shape->noise_g * sqrt(rest)) : 0;
}

/* Chi-square of the samples that were read, and the scores. False when hardly one lies inside the base. */
static bool question(const struct problem *m, const double *p, struct shape *shape)
{
	double matrix[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0}, squares;
	const unsigned size = unknowns(m->family), skew = size, power = size + 1;
	const bool asks_power = size == POWER;
	struct under under = under_pulse(m, p);
	const double turn_c = cos(under.step), turn_s = sin(under.step);
	double phi = under.phi, c = cos(phi), s = sin(phi);
	struct gram gram;

	gram_start(&gram, asks_power ? size + 2 : size + 1);
	for (size_t k = under.first; k < under.last; k++, phi += under.step) {
		double row[GRAM_COMMON], residual = m->trace->value_g[k];
		double cosine = c > COSINE_MIN ? c : COSINE_MIN, sine = s;

		c = c * turn_c - s * turn_s;
		s = s * turn_c + cosine * turn_s;
		if (!trace_good(m->trace, k) || is_censored(m, k))
			continue;
		residual -= row_at(m, p, phi, cosine, sine, row);
		row[skew] = row[BASE] * phi;
		if (asks_power)
			row[power] = row[PEAK] * log(cosine);
		row[GRAM_COMMON - 1] = residual;
		gram_add(&gram, row);
	}
	squares = squares_beyond(m, &under);
	if (gram_finish(&gram, matrix, right, &squares) <= size)
		return false;
	shape->freedom = (unsigned)(count_used(m) - size);
	shape->noise_g = sqrt(squares / shape->freedom);
	if (!(m->trace->noise_g > 0))
		return true;
	shape->chi_square = squares / shape->freedom / (m->trace->noise_g * m->trace->noise_g);
	shape->noise_g = m->trace->noise_g;
	shape->skew_z = score(shape, matrix, right, skew);
	shape->power_z = asks_power ? score(shape, matrix, right, power) : 0;
	return true;
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

static void express(const struct problem *m, const double *p, struct shape *shape)
{
	double unit[UNKNOWNS][CHOLESKY_MAX] = {{1}, {0, 1}, {0, 0, 1}}, area[CHOLESKY_MAX] = {0};
	double height = unit_area(shape, p[POWER]), h = 1e-4;

	area[PEAK] = height * p[BASE];
	area[BASE] = height * p[PEAK];
	if (shape->family == ESTIMATE_FAMILY_SINE_POWER)
		area[POWER] = p[PEAK] * p[BASE] *
		              (unit_area(shape, p[POWER] + h) - unit_area(shape, p[POWER] - h)) / (2 * h);
	shape->peak_g = p[PEAK];
	shape->peak_s = m->near_s + p[TIME];
	shape->base_s = p[BASE];
	shape->power = p[POWER];
	shape->area_g_s = height * p[PEAK] * p[BASE];
	shape->sigma_peak_g = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[PEAK]));
	shape->sigma_peak_s = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[TIME]));
	shape->sigma_base_s = shape->noise_g * sqrt(cholesky_variance(&shape->factor, unit[BASE]));
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
	double p[UNKNOWNS] = {start->peak_g, 0, base, power};
	struct problem problem = {.trace = trace,
	                          .family = family,
	                          .first = trace_index(trace, start->peak_s - reach),
	                          .last = trace_index(trace, start->peak_s + reach),
	                          .near_s = start->peak_s,
	                          .base_s = base,
	                          .noise_g = fmax(trace->noise_g, SHARP * fabs(start->peak_g)),
	                          .limit_first = trace_index(trace, start->limit_from_s)};
	struct lm_problem lm = {unknowns(family), &problem, normal, KINK_GAIN};
	struct shape found = {
	        .family = family, .chi_square = NAN, .skew_z = NAN, .power_z = NAN, .noise_g = NAN};
	struct lm_result result;

	if (start->limit_from_s <= start->limit_until_s)
		problem.limit_count = trace_index(trace, start->limit_until_s) - problem.limit_first;
	problem.plain = problem.limit_count == 0 && !trace_any(trace, trace_time(trace, problem.first),
	                                                       trace_time(trace, problem.last - 1), ~0u);
	if (!(base > 0) || !lm_fit(&lm, p, &result) || !(p[PEAK] * start->peak_g > 0))
		return false;
	found.factor = result.factor;
	found.iterations = result.iterations;
	if (!question(&problem, p, &found))
		return false;
	express(&problem, p, &found);
	if (!isfinite(found.sigma_peak_g) || !isfinite(found.sigma_peak_s))
		return false;
	*shape = found;
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
		unit_pulse(shape->family, shape->power, cos(phi + (i - 1) * h), sin(phi + (i - 1) * h),
		           place[i]);
	derivative[0] = shape->peak_g * place[1][0];
	derivative[1] = shape->peak_g * turn * place[1][1];
	derivative[2] = shape->peak_g * turn * turn * (place[2][1] - place[0][1]) / (2 * h);
	if (!variance)
		return;
	value[PEAK] = place[1][0];
	value[TIME] = -derivative[1];
	value[BASE] = -phi / turn * derivative[1] / shape->base_s;
	value[POWER] = shape->peak_g * place[1][2];
	slope[PEAK] = turn * place[1][1];
	slope[TIME] = -derivative[2];
	slope[BASE] = -(derivative[1] + phi / turn * derivative[2]) / shape->base_s;
	slope[POWER] = shape->peak_g * turn * (place[2][2] - place[0][2]) / (2 * h);
	variance[0] = pow(shape->noise_g, 2) * cholesky_variance(&shape->factor, value);
	variance[1] = pow(shape->noise_g, 2) * cholesky_variance(&shape->factor, slope);
}
