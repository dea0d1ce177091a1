/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/driven.h"

#include <math.h>
#include <stddef.h>

#include "common/units.h"
#include "host/estimate/complex_product.h"
#include "host/estimate/cosine_pulse.h"
#include "host/estimate/gram.h"
#include "host/estimate/interpolate.h"
#include "host/estimate/limits.h"
#include "host/estimate/lm.h"

/* After the contact S1 is followed this long. A mount that stiffens as it swings out is one oscillator only
 * as long as the swing stays large: where the long window is refused the short one is tried. */
#define CYCLES 4.0
#define CYCLES_SHORT 0.5

/* Samples per cycle that are averaged away: a block of the decay is an eighth of one or less. */
#define BLOCKS_PER_CYCLE 8.0

/* S2's samples as input reach this part of the pulse's length before its foot, and by as much more than a
 * length beyond its peak: a skewed pulse has a long tail. Blocks begin this part of the input's length after
 * its end, so that a fitted delay cannot undercut it. */
#define MARGIN 0.1

/* A decay is free when what still drives it moves it by less than this part of its noise. */
#define DRIVE_LEFT 0.2

enum {
	COSINE_STEPS = 16,
	SINGLES = 512,
	BLOCKS = 128,
	CONTACT_SAMPLES = 256, /* at higher rates every second one, or fewer */
};

enum { DECAY, OMEGA, DELAY, GAIN, OFFSET, PARAMETERS, RESIDUAL = PARAMETERS, COLUMNS };

struct single {
	double time_s, value_g, ramp;
};

/* What one fit looks at. Blocks are means of block_size samples; where one has a hole, its samples stand
 * alone instead. */
struct scene {
	struct respond_input *input;
	unsigned single_count, block_count;
	size_t block_size;
	double sample_s, block_from_s; /* middle of the first block */
	double squares;                /* of all values */
	struct single single[SINGLES];
	double block_g[BLOCKS]; /* NAN: has a hole */
};

/* Mean of e^(pole u) over a block's samples, u from its middle, and its derivative by the pole: a block mean
 * of a damped oscillation is one, only smaller. */
static void block_mean(const struct scene *scene, double complex pole, double complex *mean,
                       double complex *by_pole)
{
	double from = -0.5 * (double)(scene->block_size - 1) * scene->sample_s;
	double complex turn = cexp(pole * scene->sample_s), here = cexp(pole * from);

	*mean = *by_pole = 0;
	for (size_t i = 0; i < scene->block_size; i++) {
		*mean += here;
		*by_pole += (from + (double)i * scene->sample_s) * here;
		here = product(here, turn);
	}
	*mean /= (double)scene->block_size;
	*by_pole /= (double)scene->block_size;
}

/* Blocks count as often as they have samples. */
static void driven_add_blocks(const struct scene *scene, const struct respond *respond, const double *p,
                              struct gram *gram)
{
	double weight = sqrt((double)scene->block_size), step = (double)scene->block_size * scene->sample_s;
	double past = scene->block_from_s - p[DELAY] - respond->end_s, gain = p[GAIN];
	double complex pole = respond->pole, here = weight * cexp(pole * past), turn = cexp(pole * step);
	double complex mean, by_pole, swing, by_decay, by_omega;

	block_mean(scene, pole, &mean, &by_pole);
	swing = respond->swing * mean;
	by_decay = respond->swing_by_decay * mean - respond->swing * by_pole;
	by_omega = respond->swing_by_omega * mean + I * respond->swing * by_pole;
	for (unsigned i = 0; i < scene->block_count; i++, past += step, here = product(here, turn)) {
		double complex value;
		double row[COLUMNS];

		if (isnan(scene->block_g[i]))
			continue;
		value = product(swing, here);
		row[DECAY] = gain * (product_real(by_decay, here) - past * creal(value));
		row[OMEGA] = gain * (product_real(by_omega, here) - past * cimag(value));
		row[DELAY] = -gain * product_real(pole, value);
		row[GAIN] = creal(value);
		row[OFFSET] = weight;
		row[RESIDUAL] = weight * (scene->block_g[i] - p[OFFSET]) - gain * row[GAIN];
		gram_add(gram, row);
	}
}

static size_t driven_normal(const void *model, double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                            double right[CHOLESKY_MAX], double *squares)
{
	const struct scene *scene = model;
	struct respond respond;
	struct gram gram;
	double first = scene->block_from_s - 0.5 * (double)scene->block_size * scene->sample_s;

	if (!(p[DECAY] > 0) || !(p[OMEGA] > 0) ||
	    !(first - p[DELAY] > scene->input->from_s + scene->input->count * scene->input->step_s))
		return 0;
	respond_make(&respond, scene->input, p[DECAY], p[OMEGA]);
	gram_start(&gram, PARAMETERS);
	for (unsigned i = 0; i < scene->single_count; i++) {
		const struct single *single = &scene->single[i];
		struct respond_point point;
		double row[COLUMNS];

		respond_at(&respond, single->time_s - p[DELAY], &point);
		row[DECAY] = p[GAIN] * point.by_decay;
		row[OMEGA] = p[GAIN] * point.by_omega;
		row[DELAY] = -p[GAIN] * point.slope;
		row[GAIN] = point.value;
		row[OFFSET] = single->ramp;
		row[RESIDUAL] = single->value_g - p[GAIN] * point.value - p[OFFSET] * single->ramp;
		gram_add(&gram, row);
	}
	driven_add_blocks(scene, &respond, p, &gram);
	return gram_finish(&gram, matrix, right, squares);
}

static void input_from_cosine_pulse(const struct cosine_pulse *cosine, struct respond_input *input)
{
	input->count = COSINE_STEPS;
	input->step_s = cosine->base_s / COSINE_STEPS;
	input->from_s = cosine->centre_s - cosine->base_s / 2;
	for (unsigned i = 0; i <= COSINE_STEPS; i++)
		input->value[i] = input->value[2 * COSINE_STEPS - i] =
		        cosine_pulse_at(cosine, input->from_s + i * input->step_s / 2);
}

static void input_from_samples(const struct trace *trace, const struct peak *peak,
                               struct respond_input *input)
{
	double length = peak->span.until_s - peak->span.from_s;
	double from = peak->span.from_s - MARGIN * length;
	double until = fmax(peak->result.time_s + (1 + MARGIN) * length, peak->span.until_s);
	size_t first = trace_index(trace, from), last = trace_index(trace, until), stride;

	stride = (last - first) / RESPOND_STEPS + 1;
	input->count = (unsigned)((last - first) / stride);
	input->step_s = (double)stride / trace->rate_hz;
	input->from_s = trace_time(trace, first);
	for (unsigned i = 0; i <= 2 * input->count; i++)
		input->value[i] = interpolate_at(trace, input->from_s + i * input->step_s / 2);
	/* No jump where it ends: a crest there would be none. */
	input->value[2 * input->count] = 0;
}

static void add_single(struct scene *scene, const struct trace *trace, size_t k, double ramp)
{
	if (!trace_usable(trace, k) || scene->single_count == SINGLES)
		return;
	scene->single[scene->single_count++] =
	        (struct single){trace_time(trace, k), trace->value_g[k], fmin(fmax(ramp, 0), 1)};
	scene->squares += trace->value_g[k] * trace->value_g[k];
}

static void add_block(struct scene *scene, const struct trace *trace, size_t first)
{
	double sum = 0;
	bool whole = true;

	for (size_t k = first; k < first + scene->block_size; k++) {
		whole = whole && trace_usable(trace, k);
		sum += trace->value_g[k];
	}
	for (size_t k = first; !whole && k < first + scene->block_size; k++)
		add_single(scene, trace, k, 1);
	sum /= (double)scene->block_size;
	scene->block_g[scene->block_count++] = whole ? sum : NAN;
	if (whole)
		scene->squares += sum * sum * (double)scene->block_size;
}

/* From the input's beginning, or the response's, to some cycles after its end or the next contact. */
static void driven_collect(const struct driven_axis *axis, double delay_s, double window_s, double omega,
                           struct scene *scene)
{
	const struct trace *s1 = axis->trace[0], *s2 = axis->trace[1];
	double length = scene->input->count * scene->input->step_s, end = scene->input->from_s + length;
	double free = end + delay_s + MARGIN * length;
	double level = LIMIT_AGAIN * fabs(axis->peak[1]->result.value_g);
	size_t first = trace_index(s1, scene->input->from_s + fmin(delay_s, 0)), middle, last, stride;
	size_t again =
	        trace_reaches(s2, trace_index(s2, end), trace_index(s2, fmax(free + window_s, end)), level);

	middle = trace_index(s1, free);
	last = trace_index(s1, trace_time(s2, again));
	stride = (middle - first) / CONTACT_SAMPLES + 1;
	scene->single_count = scene->block_count = 0;
	scene->squares = 0;
	scene->sample_s = 1 / s1->rate_hz;
	scene->block_size = (size_t)fmax(s1->rate_hz * 2 * UNITS_PI / (omega * BLOCKS_PER_CYCLE), 1);
	scene->block_from_s =
	        trace_time(s1, middle) + 0.5 * (double)(scene->block_size - 1) * scene->sample_s;
	for (size_t k = first; k < middle; k += stride)
		add_single(scene, s1, k, (trace_time(s1, k) - scene->input->from_s - delay_s) / length);
	for (size_t k = middle; k + scene->block_size <= last && scene->block_count < BLOCKS;
	     k += scene->block_size)
		add_block(scene, s1, k);
}

/* How much S2's noise as input moves the response's peak: through the phase of what is left at the end of
 * the input, in s for unit noise. */
static double input_spread(const struct respond *respond, double sample_s)
{
	const struct respond_input *input = respond->input;
	double complex turn = cexp(respond->pole * input->step_s), weight;
	double squares = 0;

	weight = 1 / respond->knot[input->count].state;
	for (unsigned k = 0; k <= input->count; k++, weight *= turn)
		squares += cimag(weight) * cimag(weight);
	return sqrt(squares * input->step_s * sample_s) / respond->omega;
}

struct solution {
	double p[PARAMETERS];
	double peak_s, spread_s; /* of S1, spread for unit noise */
	double input_spread_s;
	double peak_g, peak_spread_g; /* likewise */
	double chi_square;            /* reduced */
	double noise_g;
	double free_s; /* S1's decay, from then on */
	unsigned late; /* half cycles from where S1 would peak without a delay to its peak */
	bool refused;
};

/* What S1 is later by than an oscillator is no more than the contact and a swing. */
static bool driven_same_contact(const struct driven_axis *axis, const struct solution *solution)
{
	return fabs(solution->p[DELAY]) < axis->peak[1]->width_s + 2 * UNITS_PI / solution->p[OMEGA];
}

static bool driven_judge(const struct driven_axis *axis, const struct scene *scene,
                         const struct respond *respond, const struct lm_result *result,
                         struct solution *solution)
{
	double row[PARAMETERS] = {0, 0, 1, 0, 0}, freedom = (double)(result->used - PARAMETERS);
	double noise = fmax(axis->trace[0]->noise_g, LIMIT_MISFIT * fabs(axis->peak[0]->result.value_g));
	double height[PARAMETERS] = {0};
	struct respond_crest crest;
	struct respond_point top;

	if (result->squares > LIMIT_KNOWN * scene->squares || !driven_same_contact(axis, solution) ||
	    !respond_crest(respond, axis->peak[1]->sign, &crest))
		return false;
	row[DECAY] = crest.time_by_decay;
	row[OMEGA] = crest.time_by_omega;
	solution->peak_s = crest.time_s + solution->p[DELAY];
	solution->spread_s = sqrt(cholesky_variance(&result->factor, row));
	solution->input_spread_s = input_spread(respond, 1 / axis->trace[1]->rate_hz);
	respond_at(respond, crest.time_s, &top);
	height[DECAY] = solution->p[GAIN] * top.by_decay;
	height[OMEGA] = solution->p[GAIN] * top.by_omega;
	height[GAIN] = top.value;
	solution->peak_g = solution->p[GAIN] * top.value;
	solution->peak_spread_g = sqrt(cholesky_variance(&result->factor, height));
	solution->noise_g = noise;
	solution->free_s = respond_free_since(respond, DRIVE_LEFT * noise / fabs(solution->p[GAIN])) +
	                   solution->p[DELAY];
	solution->chi_square = result->squares / freedom / (noise * noise);
	solution->refused = solution->chi_square > 1 + LIMIT_SIGNIFICANT * sqrt(2 / freedom);
	return isfinite(solution->spread_s);
}

/* From the ring-down's frequency and damping, and S1's peak or, when that is of a later swing, from so many
 * half cycles before it. */
static bool driven_solve(const struct driven_axis *axis, struct scene *scene, double cycles, unsigned back,
                         struct solution *solution)
{
	const struct estimate_ringdown *ring = &axis->ringdown->result;
	const struct estimate_peak *peak = &axis->peak[0]->result;
	double *p = solution->p, part = ring->damping_ratio, half_s;
	struct lm_problem problem = {.size = PARAMETERS, .model = scene, .normal = driven_normal};
	struct lm_result result;
	struct respond respond;
	struct respond_crest crest;

	solution->late = 0;
	p[OMEGA] = 2 * UNITS_PI * ring->frequency_hz;
	p[DECAY] = p[OMEGA] * part / sqrt(1 - part * part);
	half_s = UNITS_PI / p[OMEGA];
	respond_make(&respond, scene->input, p[DECAY], p[OMEGA]);
	if (!respond_crest(&respond, axis->peak[1]->sign, &crest))
		return false;
	if (peak->time_s > crest.time_s)
		solution->late = (unsigned)((peak->time_s - crest.time_s) / half_s + 0.5);
	p[DELAY] = peak->time_s - crest.time_s - back * half_s;
	p[GAIN] = (back % 2 ? -1 : 1) * peak->value_g / crest.value * exp(back * p[DECAY] * half_s);
	p[OFFSET] = 0;
	driven_collect(axis, p[DELAY], cycles * 2 * UNITS_PI / p[OMEGA], p[OMEGA], scene);
	if (!lm_fit(&problem, p, &result))
		return false;
	respond_make(&respond, scene->input, p[DECAY], p[OMEGA]);
	return driven_judge(axis, scene, &respond, &result, solution);
}

static bool better(const struct solution *a, const struct solution *than)
{
	return a->chi_square - 1 < LIMIT_EXPLAINS * (than->chi_square - 1);
}

/* Noise may lift a later swing above the first, and a clipped one is as high as the limit on either side. */
static bool solve_window(const struct driven_axis *axis, struct scene *scene, double cycles,
                         struct solution *solution)
{
	bool found = driven_solve(axis, scene, cycles, 0, solution);
	unsigned late = solution->late;
	struct solution first;

	/* with a delay of its own S1 peaks later by up to one more */
	for (unsigned back = late; back > 0 && back + 2 > late && !(found && !solution->refused); back--) {
		if (!driven_solve(axis, scene, cycles, back, &first) || (found && !better(&first, solution)))
			continue;
		*solution = first;
		found = true;
	}
	return found;
}

static bool has_peak(const struct peak *peak, enum estimate_status *status)
{
	if (isfinite(peak->result.value_g) && isfinite(peak->result.time_s))
		return true;
	*status = peak->result.how.status;
	return false;
}

/* Whether there is something to work on; why not goes into the status. */
static bool driven_possible(const struct driven_axis *axis, enum estimate_status *status)
{
	const struct estimate_ringdown *ring = &axis->ringdown->result;

	if (!has_peak(axis->peak[1], status) || !has_peak(axis->peak[0], status))
		return false;
	*status = ring->how.status;
	if (!isfinite(ring->frequency_hz) || !(ring->damping_ratio > 0) || !(ring->damping_ratio < 1))
		return false;
	*status = ESTIMATE_NO_PEAK;
	return ring->amplitude_g >= LIMIT_EDGE * fabs(axis->peak[0]->result.value_g);
}

static unsigned flaws(const struct driven_axis *axis)
{
	unsigned flags = 0;

	for (unsigned i = 0; i < 2; i++) {
		const struct local_span *span = &axis->peak[i]->span;

		if (trace_any(axis->trace[i], span->from_s, span->until_s, SAMPLE_LOST | SAMPLE_BAD))
			flags |= ESTIMATE_FLAG_GAPS;
		if (trace_any(axis->trace[i], span->from_s, span->until_s, SAMPLE_CLIPPED))
			flags |= ESTIMATE_FLAG_EXTRAPOLATED;
	}
	return flags;
}

/* Over the long window, and over the short one if that is refused. */
static bool solve_both(const struct driven_axis *axis, struct scene *scene, struct solution *solution)
{
	struct solution brief;

	if (!solve_window(axis, scene, CYCLES, solution))
		return false;
	if (solution->refused && solve_window(axis, scene, CYCLES_SHORT, &brief) &&
	    better(&brief, solution)) {
		*solution = brief;
		solution->refused = true;
	}
	return true;
}

/* A refused fit may miss the peak by as much as it misses S1's own. input_s: what noise as input moves it by.
 */
static void driven_express(const struct driven_axis *axis, const struct solution *solution, double from_s,
                           double sigma_from_s, double input_s, struct driven *driven)
{
	double fit = solution->spread_s * solution->noise_g, sigma, strain;

	if (solution->refused)
		fit = hypot(fit * sqrt(fmax(solution->chi_square, 1)),
		            solution->peak_s - axis->peak[0]->result.time_s);
	fit = hypot(fit, input_s);
	sigma = hypot(fit, sigma_from_s);
	if (!(sigma < LIMIT_SLIGHT * axis->peak[1]->width_s))
		return;
	if (solution->refused)
		driven->flags |= ESTIMATE_FLAG_MODEL;
	driven->status = ESTIMATE_OK;
	driven->chi_square = solution->chi_square;
	driven->lag_s = solution->peak_s - from_s;
	driven->sigma_s = sigma;
	if (solution->refused)
		return;
	strain = sqrt(fmax(solution->chi_square, 1));
	driven->peak_g = solution->peak_g;
	driven->sigma_peak_g = strain * solution->peak_spread_g * solution->noise_g;
	driven->peak_s = solution->peak_s;
	driven->sigma_peak_s = strain * fit;
}

static void driven_draw(const struct solution *solution, const struct driven *driven,
                        struct driven_curve *curve)
{
	respond_make(&curve->respond, &curve->input, solution->p[DECAY], solution->p[OMEGA]);
	curve->gain = solution->p[GAIN];
	curve->delay_s = solution->p[DELAY];
	curve->sigma_g = driven->sigma_peak_g;
	curve->sigma_s = driven->sigma_peak_s;
}

void driven_find(const struct driven_axis *axis, struct driven *driven, struct driven_curve *curve)
{
	const struct trace *s2 = axis->trace[1];
	const struct peak *peak = axis->peak[1];
	struct solution smooth, sampled;
	struct scene scene;
	struct cosine_pulse cosine;
	bool has_smooth, has_sampled = false;

	*driven = (struct driven){.lag_s = NAN,
	                          .sigma_s = NAN,
	                          .peak_g = NAN,
	                          .sigma_peak_g = NAN,
	                          .peak_s = NAN,
	                          .sigma_peak_s = NAN,
	                          .free_s = NAN,
	                          .chi_square = NAN,
	                          .status = ESTIMATE_SHORT};
	if (!driven_possible(axis, &driven->status))
		return;
	driven->status = ESTIMATE_NOT_CONVERGED;
	driven->flags = flaws(axis);
	scene.input = &curve->input;
	driven->smooth = has_smooth = cosine_pulse_fit(s2, peak, &cosine);
	if (has_smooth) {
		input_from_cosine_pulse(&cosine, &curve->input);
		has_smooth = solve_both(axis, &scene, &smooth);
	}
	if (!(has_smooth && !smooth.refused) &&
	    !trace_any(s2, peak->span.from_s, peak->span.until_s, TRACE_LIMIT)) {
		driven->sampled = true;
		input_from_samples(s2, peak, &curve->input);
		has_sampled = solve_both(axis, &scene, &sampled);
	}
	if (has_sampled && !(has_smooth && !better(&sampled, &smooth))) {
		driven_express(axis, &sampled, peak->result.time_s, peak->result.sigma_time_s,
		               sampled.input_spread_s * s2->noise_g, driven);
		driven->doubt_s = peak->doubt_s;
	} else if (has_smooth) {
		driven_express(axis, &smooth, cosine.centre_s, hypot(cosine.sigma_centre_s, peak->ripple_s),
		               0, driven);
		driven->doubt_s = peak->ripple_s;
	}
	if (isnan(driven->peak_g))
		return;
	driven_draw(has_sampled ? &sampled : &smooth, driven, curve);
	if (!has_sampled)
		driven->free_s = smooth.free_s;
}

void driven_at(const struct driven_curve *curve, double time_s, double derivative[3], double variance[2])
{
	respond_bend(&curve->respond, time_s - curve->delay_s, derivative);
	for (unsigned i = 0; i < 3; i++)
		derivative[i] *= curve->gain;
	if (variance == NULL)
		return;
	variance[0] = pow(curve->sigma_g, 2) + pow(derivative[1] * curve->sigma_s, 2);
	variance[1] = pow(derivative[2] * curve->sigma_s, 2);
}
