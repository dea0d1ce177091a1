/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/shape.h"

#include <math.h>

#include "common/units.h"

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

/* Without noise a limit is sharp. */
#define SHARP 1e-6

struct problem {
	const struct trace *trace;
	enum estimate_family family;
	size_t first, last;              /* [first, last) */
	double near_s;                   /* time is counted from here */
	double base_s;                   /* at the start */
	double noise_g;                  /* of censored samples, positive */
	size_t limit_first, limit_count; /* samples that are as if at a limit */
};

/* The model along the samples: cos and sin of phi by recurrence. */
struct run {
	double phi, cosine, sine, step, turn_cosine, turn_sine;
};

static struct run run_start(const struct problem *m, const double *p)
{
	double step = UNITS_PI / (p[BASE] * m->trace->rate_hz);
	double phi = UNITS_PI * (trace_time(m->trace, m->first) - m->near_s - p[TIME]) / p[BASE];

	return (struct run){phi, cos(phi), sin(phi), step, cos(step), sin(step)};
}

static inline void run_on(struct run *run)
{
	double cosine = run->cosine * run->turn_cosine - run->sine * run->turn_sine;

	run->sine = run->cosine * run->turn_sine + run->sine * run->turn_cosine;
	run->cosine = cosine;
	run->phi += run->step;
}

/* Inside the base; the test on the cosine is for rounding at its ends. */
static inline bool run_inside(const struct run *run)
{
	return fabs(run->phi) < UNITS_PI / 2 && run->cosine > 0;
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
static inline double row_at(const struct problem *m, const double *p, const struct run *run,
                            double row[UNKNOWNS])
{
	double unit[3], slope;

	unit_pulse(m->family, p[POWER], run->cosine, run->sine, unit);
	slope = -p[PEAK] * unit[1] / p[BASE];
	row[PEAK] = unit[0];
	row[TIME] = UNITS_PI * slope;
	row[BASE] = run->phi * slope;
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

/* Sums over the rows, square and of one even size whatever the family: such loops run in pairs. */
struct sums {
	double product[UNKNOWNS][UNKNOWNS], right[UNKNOWNS];
};

static inline void add_row(struct sums *sums, const double row[UNKNOWNS], double residual)
{
	for (unsigned i = 0; i < UNKNOWNS; i++)
		for (unsigned j = 0; j < UNKNOWNS; j++)
			sums->product[i][j] += row[i] * row[j];
	for (unsigned i = 0; i < UNKNOWNS; i++)
		sums->right[i] += row[i] * residual;
}

static size_t normal(const void *model, const double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	const struct problem *m = model;
	const unsigned size = unknowns(m->family);
	struct sums sums = {{{0}}, {0}};
	size_t used = 0;
	struct run run;

	if (!possible(m, p))
		return 0;
	run = run_start(m, p);
	for (size_t k = m->first; k < m->last; k++, run_on(&run)) {
		const bool inside = run_inside(&run);
		double row[UNKNOWNS] = {0}, residual = m->trace->value_g[k];

		if (!trace_good(m->trace, k))
			continue;
		if (inside)
			residual -= row_at(m, p, &run, row);
		if (is_censored(m, k)) {
			double sign = m->trace->value_g[k] < 0 ? -1 : 1;
			struct share share = censored(sign * residual / m->noise_g, m->noise_g);

			share.residual_g *= sign;
			*squares += share.squares;
			add_censored(size, row, &share, matrix, right);
			continue;
		}
		used++;
		*squares += residual * residual;
		if (inside)
			add_row(&sums, row, residual);
	}
	for (unsigned i = 0; i < size; i++) {
		for (unsigned j = 0; j <= i; j++)
			matrix[i][j] += sums.product[i][j];
		right[i] += sums.right[i];
	}
	return used;
}

/* Sums for one question: direction d against the residual, itself and the unknowns. */
struct score {
	double residual, square, cross[CHOLESKY_MAX];
};

static void score_add(struct score *score, unsigned size, double d, double residual, const double *row)
{
	score->residual += d * residual;
	score->square += d * d;
	for (unsigned i = 0; i < size; i++)
		score->cross[i] += d * row[i];
}

static double score_z(const struct score *score, const struct cholesky *factor, double noise_g)
{
	double rest = score->square - cholesky_variance(factor, score->cross);

	return rest > 1e-9 * score->square ? score->residual / (noise_g * sqrt(rest)) : 0;
}

/* Chi-square of the samples that were read, and the scores. False when hardly one lies inside the base. */
static bool question(const struct problem *m, const double *p, struct shape *shape)
{
	struct score skew = {0, 0, {0}}, power = {0, 0, {0}};
	struct run run = run_start(m, p);
	unsigned size = unknowns(m->family);
	double squares = 0;
	size_t used = 0, inside = 0;

	for (size_t k = m->first; k < m->last; k++, run_on(&run)) {
		double row[UNKNOWNS] = {0}, residual = m->trace->value_g[k];

		if (!trace_good(m->trace, k) || is_censored(m, k))
			continue;
		used++;
		if (run_inside(&run)) {
			inside++;
			residual -= row_at(m, p, &run, row);
			score_add(&skew, size, row[BASE] * run.phi, residual, row);
			if (size == POWER)
				score_add(&power, size, row[PEAK] * log(run.cosine), residual, row);
		}
		squares += residual * residual;
	}
	if (inside <= size)
		return false;
	shape->freedom = (unsigned)(used - size);
	shape->noise_g = sqrt(squares / shape->freedom);
	if (!(m->trace->noise_g > 0))
		return true;
	shape->chi_square = squares / shape->freedom / (m->trace->noise_g * m->trace->noise_g);
	shape->noise_g = m->trace->noise_g;
	shape->skew_z = score_z(&skew, &shape->factor, shape->noise_g);
	shape->power_z = score_z(&power, &shape->factor, shape->noise_g);
	return true;
}

/* Of a pulse of height and base 1. */
static double unit_area(const struct shape *shape, double power)
{
	if (shape->family == ESTIMATE_FAMILY_HALF_SINE)
		return 2 / UNITS_PI;
	if (shape->family == ESTIMATE_FAMILY_HAVERSINE)
		return 0.5;
	return exp(lgamma((power + 1) / 2) - lgamma(power / 2 + 1)) / sqrt(UNITS_PI);
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
