/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/cholesky.h"

#define CYCLES 5.0
#define SWING_NOISE 5.0
#define SWING_LEVEL 0.02
#define EXPLAINED_MIN 0.5
#define DAMPING_START_MIN 0.005
#define DAMPING_START_MAX 0.5
#define DAMPING_MAX 0.95
#define STEP_MIN 1e-9
#define APART_MAX 0.05

enum {
	CROSSINGS = 7,       /* end to end three cycles */
	CROSSINGS_START = 3, /* one cycle, enough to start from */
	PARAMETERS = 5,
	ITERATIONS = 40,
	GROWING_MAX = 5, /* steps with a swing that grows: a drift, not a decay, and it will not come back */
};

enum { DECAY, OMEGA, COSINE, SINE, OFFSET };

/* Zero crossings between swings beyond a threshold to either side. */
struct crossings {
	unsigned count;
	double time_s[CROSSINGS];
	double swing_g[CROSSINGS]; /* largest magnitude after crossing i, before the next */
	double swing_s[CROSSINGS];
	bool ended; /* samples ran out, rather than the swings */
};

struct window {
	const struct trace *trace;
	size_t first, last; /* [first, last) */
	double from_s;
};

/* Clipped samples do not follow the decay. */
static bool usable(const struct trace *trace, size_t k)
{
	return !(trace->sample[k] & (SAMPLE_LOST | SAMPLE_BAD | SAMPLE_CLIPPED));
}

static double meet(const struct trace *trace, size_t before, size_t after, double offset)
{
	double a = trace->value_g[before] - offset, b = trace->value_g[after] - offset;
	double from = trace_time(trace, before);

	return from + (trace_time(trace, after) - from) * a / (a - b);
}

static void note_swing(struct crossings *found, double value, double time)
{
	unsigned i = found->count - 1;

	if (found->count == 0 || fabs(value) <= found->swing_g[i])
		return;
	found->swing_g[i] = fabs(value);
	found->swing_s[i] = time;
}

/* A crossing counts once the other side's threshold is passed. Noise may cross zero several times on the
 * way: the middle of the first and the last is taken. */
static void find_crossings(const struct window *window, double offset, double threshold,
                           struct crossings *found)
{
	const struct trace *trace = window->trace;
	double side = 0, first = NAN, last = NAN, value = 0, value_before = 0;
	size_t before = 0;

	memset(found, 0, sizeof(*found));
	for (size_t k = window->first; k < window->last && found->count < CROSSINGS; k++) {
		if (!usable(trace, k))
			continue;
		value = trace->value_g[k] - offset;
		if (value * value_before < 0) {
			last = meet(trace, before, k, offset);
			first = isnan(first) ? last : first;
		}
		/* An exact zero belongs to neither side. */
		if (fabs(value) > 0) {
			before = k;
			value_before = value;
		}
		if (fabs(value) < threshold)
			continue;
		if (value * side < 0)
			found->time_s[found->count++] = (first + last) / 2;
		side = value > 0 ? 1 : -1;
		first = NAN;
		note_swing(found, value, trace_time(trace, k));
	}
	/* Still under way when the samples ran out? */
	found->ended = fabs(value) >= threshold;
	if (found->count > 1) {
		double end = trace_time(trace, before), latest = found->time_s[found->count - 1];

		found->ended = end - latest < 1.5 * (latest - found->time_s[0]) / (found->count - 1);
	}
}

/* Decay rate from the first swing to the last one measured. */
static double start_decay(const struct crossings *found, double omega)
{
	unsigned last = found->count - 1;
	double a = 0;

	while (last > 0 && !(found->swing_g[last] > 0))
		last--;
	if (last > 0 && found->swing_s[last] > found->swing_s[0])
		a = log(found->swing_g[0] / found->swing_g[last]) /
		    (found->swing_s[last] - found->swing_s[0]);
	return fmin(fmax(a, DAMPING_START_MIN * omega), DAMPING_START_MAX * omega);
}

/* Normal equations and sum of squares of the residual at p; returns the samples used. Linear: only those of
 * the cosine, the sine and the offset. */
static size_t normal_equations(const struct window *window, const double p[PARAMETERS], bool linear,
                               double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX],
                               double *squares)
{
	const struct trace *trace = window->trace;
	double step = 1 / trace->rate_hz, time = trace_time(trace, window->first) - window->from_s;
	double turn_re = exp(-p[DECAY] * step) * cos(p[OMEGA] * step);
	double turn_im = exp(-p[DECAY] * step) * sin(p[OMEGA] * step);
	double re = exp(-p[DECAY] * time) * cos(p[OMEGA] * time);
	double im = exp(-p[DECAY] * time) * sin(p[OMEGA] * time);
	size_t used = 0;

	memset(normal, 0, sizeof(double[CHOLESKY_MAX][CHOLESKY_MAX]));
	memset(right, 0, sizeof(double[CHOLESKY_MAX]));
	*squares = 0;
	for (size_t k = window->first; k < window->last; k++, time += step) {
		double swing = p[COSINE] * re + p[SINE] * im;
		double row[PARAMETERS] = {-time * swing, time * (p[SINE] * re - p[COSINE] * im), re, im, 1};
		double residual = trace->value_g[k] - swing - p[OFFSET], next;
		unsigned first = linear ? COSINE : DECAY;

		next = re * turn_re - im * turn_im;
		im = re * turn_im + im * turn_re;
		re = next;
		if (!usable(trace, k))
			continue;
		used++;
		*squares += residual * residual;
		for (unsigned i = first; i < PARAMETERS; i++) {
			for (unsigned j = first; j <= i; j++)
				normal[i - first][j - first] += row[i] * row[j];
			right[i - first] += row[i] * residual;
		}
	}
	return used;
}

/* Levenberg-Marquardt from p; false without convergence. *factor is that of the normal equations at the
 * solution. */
static bool fit(const struct window *window, double p[PARAMETERS], double *squares, struct cholesky *factor)
{
	double normal[CHOLESKY_MAX][CHOLESKY_MAX], damped[CHOLESKY_MAX][CHOLESKY_MAX], right[CHOLESKY_MAX];
	double next_right[CHOLESKY_MAX], lambda = 1e-3, moved;
	int growing = 0;

	(void)normal_equations(window, p, false, normal, right, squares);
	for (int i = 0; i < ITERATIONS; i++) {
		double trial[PARAMETERS], change[CHOLESKY_MAX], trial_squares;

		memcpy(damped, normal, sizeof(damped));
		for (unsigned j = 0; j < PARAMETERS; j++)
			damped[j][j] *= 1 + lambda;
		if (!cholesky_factor(factor, PARAMETERS, damped))
			return false;
		cholesky_solve(factor, right, change);
		for (unsigned j = 0; j < PARAMETERS; j++)
			trial[j] = p[j] + change[j];
		moved = hypot(change[DECAY], change[OMEGA]) / p[OMEGA];
		(void)normal_equations(window, trial, false, damped, next_right, &trial_squares);
		if (!(trial_squares <= *squares)) {
			/* No step so small makes it better: this is the bottom. */
			if (moved < STEP_MIN)
				return cholesky_factor(factor, PARAMETERS, normal);
			lambda *= 10;
			continue;
		}
		memcpy(p, trial, sizeof(trial));
		memcpy(normal, damped, sizeof(normal));
		memcpy(right, next_right, sizeof(right));
		*squares = trial_squares;
		lambda *= 0.1;
		if (p[DECAY] < 0 && ++growing == GROWING_MAX)
			return false;
		if (moved < STEP_MIN)
			return cholesky_factor(factor, PARAMETERS, normal);
	}
	return false;
}

/* Values and uncertainties of the solution. */
static void express(const struct window *window, const double p[PARAMETERS], double squares, size_t used,
                    const struct cholesky *factor, struct ringdown *ringdown)
{
	struct estimate_ringdown *result = &ringdown->result;
	double natural = hypot(p[OMEGA], p[DECAY]), cube = natural * natural * natural;
	double omega_row[PARAMETERS] = {0, 1, 0, 0, 0};
	double damping_row[PARAMETERS] = {p[OMEGA] * p[OMEGA] / cube, -p[DECAY] * p[OMEGA] / cube, 0, 0, 0};
	double sigma = fmax(window->trace->noise_g, sqrt(squares / (double)(used - PARAMETERS)));

	result->frequency_hz = p[OMEGA] / (2 * UNITS_PI);
	result->natural_frequency_hz = natural / (2 * UNITS_PI);
	result->damping_ratio = p[DECAY] / natural;
	result->sigma_hz = sigma * sqrt(cholesky_variance(factor, omega_row)) / (2 * UNITS_PI);
	result->sigma_damping = sigma * sqrt(cholesky_variance(factor, damping_row));
	ringdown->amplitude_g = hypot(p[COSINE], p[SINE]);
	ringdown->offset_g = p[OFFSET];
}

/* Variance about the mean, the residual of a fit that knows nothing. */
static double total_squares(const struct window *window)
{
	double sum = 0, squares = 0, n = 0;

	for (size_t k = window->first; k < window->last; k++) {
		if (!usable(window->trace, k))
			continue;
		sum += window->trace->value_g[k];
		squares += window->trace->value_g[k] * window->trace->value_g[k];
		n++;
	}
	return n > 0 ? squares - sum * sum / n : 0;
}

static enum estimate_status solve(const struct window *window, const struct crossings *start,
                                  struct ringdown *ringdown)
{
	double cycles = (start->count - 1) / 2.0;
	double omega = 2 * UNITS_PI * cycles / (start->time_s[start->count - 1] - start->time_s[0]);
	double p[PARAMETERS] = {start_decay(start, omega), omega, 0, 0, 0}, squares;
	double normal[CHOLESKY_MAX][CHOLESKY_MAX], right[CHOLESKY_MAX];
	struct window five = *window;
	struct cholesky factor;
	size_t used;

	five.last = trace_index(window->trace, window->from_s + CYCLES * 2 * UNITS_PI / omega);
	if (five.last > window->last)
		five.last = window->last;
	used = normal_equations(&five, p, true, normal, right, &squares);
	if (used < 2 * PARAMETERS)
		return ESTIMATE_SHORT;
	if (!cholesky_factor(&factor, 3, normal))
		return ESTIMATE_NOT_CONVERGED;
	cholesky_solve(&factor, right, right);
	memcpy(p + COSINE, right, 3 * sizeof(*p));
	if (!fit(&five, p, &squares, &factor))
		return ESTIMATE_NOT_CONVERGED;
	if (squares > (1 - EXPLAINED_MIN) * total_squares(&five))
		return ESTIMATE_NO_PEAK;
	if (!(p[DECAY] > 0) || !(p[OMEGA] > 0.5 * omega) || !(p[OMEGA] < 2 * omega) ||
	    !(p[DECAY] < DAMPING_MAX * hypot(p[DECAY], p[OMEGA])))
		return ESTIMATE_NOT_CONVERGED;
	express(&five, p, squares, used, &factor, ringdown);
	return ESTIMATE_OK;
}

void ringdown_find(const struct trace *trace, double from_s, double until_s, double peak_g,
                   struct ringdown *ringdown)
{
	struct ringdown found = {
	        .result = {.frequency_hz = NAN,
	                   .sigma_hz = NAN,
	                   .natural_frequency_hz = NAN,
	                   .sigma_natural_hz = NAN,
	                   .damping_ratio = NAN,
	                   .sigma_damping = NAN,
	                   .amplitude_g = NAN,
	                   .second_frequency_hz = NAN,
	                   .second_damping_ratio = NAN,
	                   .three_cycle_frequency_hz = NAN,
	                   .how = {.method = "least_squares", .chi_square = NAN, .status = ESTIMATE_SHORT}}};
	struct window window = {trace, trace_index(trace, from_s), trace_index(trace, until_s), from_s};
	double threshold = fmax(SWING_NOISE * trace->noise_g, SWING_LEVEL * peak_g);
	struct crossings crossings;

	*ringdown = found;
	if (!isfinite(from_s) || window.first >= window.last || !(threshold > 0))
		return;
	find_crossings(&window, 0, threshold, &crossings);
	if (crossings.count < CROSSINGS_START) {
		ringdown->result.how.status = crossings.ended ? ESTIMATE_SHORT : ESTIMATE_NO_PEAK;
		return;
	}
	found.result.how.status = solve(&window, &crossings, &found);
	if (found.result.how.status == ESTIMATE_OK) {
		find_crossings(&window, found.offset_g, threshold, &crossings);
		if (crossings.count == CROSSINGS)
			found.result.three_cycle_frequency_hz =
			        3 / (crossings.time_s[CROSSINGS - 1] - crossings.time_s[0]);
	}
	*ringdown = found;
}

struct value {
	double value, sigma;
};

/* Where the two disagree by more than their uncertainties say, that of the mean is widened. */
static struct value weighted_mean(struct value a, struct value b)
{
	/* Data without noise must not divide by zero. */
	double sa = fmax(a.sigma, 1e-12 * fabs(a.value)), sb = fmax(b.sigma, 1e-12 * fabs(b.value));
	double wa = 1 / (sa * sa), wb = 1 / (sb * sb);
	struct value mean = {(wa * a.value + wb * b.value) / (wa + wb), 0};
	double chi2 = wa * pow(a.value - mean.value, 2) + wb * pow(b.value - mean.value, 2);

	mean.sigma = sqrt(fmax(1, chi2) / (wa + wb));
	return mean;
}

void ringdown_combine(const struct ringdown *x, const struct ringdown *y, struct estimate_ringdown *combined)
{
	const struct estimate_ringdown *a = &x->result, *b = &y->result;
	struct estimate_ringdown found = *a;
	struct value hz, damping;

	if (a->how.status != ESTIMATE_OK || b->how.status != ESTIMATE_OK) {
		*combined = b->how.status == ESTIMATE_OK ? *b : *a;
		return;
	}
	hz = weighted_mean((struct value){a->frequency_hz, a->sigma_hz},
	                   (struct value){b->frequency_hz, b->sigma_hz});
	damping = weighted_mean((struct value){a->damping_ratio, a->sigma_damping},
	                        (struct value){b->damping_ratio, b->sigma_damping});
	found.frequency_hz = hz.value;
	found.sigma_hz = hz.sigma;
	found.damping_ratio = damping.value;
	found.sigma_damping = damping.sigma;
	found.natural_frequency_hz = hz.value / sqrt(1 - damping.value * damping.value);
	found.three_cycle_frequency_hz = (a->three_cycle_frequency_hz + b->three_cycle_frequency_hz) / 2;
	if (fabs(a->frequency_hz - b->frequency_hz) > APART_MAX * hz.value)
		found.how.status = ESTIMATE_AMBIGUOUS;
	*combined = found;
}
