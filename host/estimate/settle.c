/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/settle.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/quiet.h"

enum {
	BLOCKS = 192,  /* at most, of equal length */
	FIRST = 32,    /* samples of the first try */
	STRETCH = 24,  /* blocks whose sum tells what is no noise */
	BEGINNING = 16 /* whose mean is held against the samples before the pulse */
};

/* From try to try. */
#define GROWTH 1.2

/* Time constants after which hardly any is left; seen for less than half of these it is a guess. */
#define ENDED 4.0

/* Of the way to the pulse. */
#define COVERS 0.3

/* Grid of time constants, per factor of e, and golden sections after it. */
enum { GRID = 3, SECTIONS = 24 };

struct blocks {
	double mean[BLOCKS], middle; /* of the trace's samples; middle is subtracted */
	bool used[BLOCKS];
	size_t count, length; /* blocks, samples of one */
};

struct fit {
	double constant, slope, amplitude; /* of y = constant + slope t + amplitude e^-t/tau */
	double rate;                       /* blocks per time constant, inverse */
	double leaves;                     /* root mean square */
};

static void take_blocks(const struct trace *trace, size_t samples, struct blocks *blocks)
{
	size_t length = (samples + BLOCKS - 1) / BLOCKS;
	double all = 0;
	size_t n = 0;

	blocks->length = length;
	blocks->count = samples / length;
	for (size_t i = 0; i < blocks->count; i++) {
		double sum = 0;
		size_t good = 0;

		for (size_t k = i * length; k < (i + 1) * length; k++)
			if (trace_good(trace, k)) {
				sum += trace->value_g[k];
				good++;
			}
		/* half of a block's samples would have their mean at another time */
		blocks->used[i] = good == length;
		blocks->mean[i] = good == length ? sum / (double)good : 0;
		all += blocks->mean[i];
		n += blocks->used[i];
	}
	blocks->middle = n > 0 ? all / (double)n : 0;
	for (size_t i = 0; i < blocks->count; i++)
		blocks->mean[i] -= blocks->middle;
}

/* Least squares of a constant and one more function of the block's number. */
static void settle_fit_two(const struct blocks *blocks, const double *function, struct fit *fit,
                           double *factor)
{
	double n = 0, f = 0, ff = 0, y = 0, fy = 0, left = 0, below;

	for (size_t i = 0; i < blocks->count; i++) {
		if (!blocks->used[i])
			continue;
		n++;
		f += function[i];
		ff += function[i] * function[i];
		y += blocks->mean[i];
		fy += function[i] * blocks->mean[i];
	}
	below = n * ff - f * f;
	*factor = below > 1e-12 * n * ff ? (n * fy - f * y) / below : 0;
	fit->constant = n > 0 ? (y - *factor * f) / n : 0;
	for (size_t i = 0; i < blocks->count; i++)
		if (blocks->used[i]) {
			double e = blocks->mean[i] - fit->constant - *factor * function[i];

			left += e * e;
		}
	fit->leaves = n > 3 ? sqrt(left / (n - 3)) : INFINITY;
}

static double try_rate(const struct blocks *blocks, double rate, struct fit *fit)
{
	double function[BLOCKS] = {0}, value = 1, part = exp(-rate);

	for (size_t i = 0; i < blocks->count; i++, value *= part)
		function[i] = value;
	*fit = (struct fit){.rate = rate};
	settle_fit_two(blocks, function, fit, &fit->amplitude);
	return fit->leaves;
}

/* The best time constant between a third of a block and four times all blocks. */
static void fit_exponential(const struct blocks *blocks, struct fit *fit)
{
	const double golden = 0.6180339887498949;
	double low = log(0.25 / (double)blocks->count), high = log(3), best = low, least = INFINITY;
	double step = 1.0 / GRID;
	struct fit tried;

	for (double x = low; x <= high; x += step)
		if (try_rate(blocks, exp(x), &tried) < least) {
			least = tried.leaves;
			best = x;
		}
	low = best - step;
	high = best + step;
	for (int i = 0; i < SECTIONS; i++) {
		double a = high - golden * (high - low), b = low + golden * (high - low);

		if (try_rate(blocks, exp(a), &tried) < try_rate(blocks, exp(b), fit))
			high = b;
		else
			low = a;
	}
	(void)try_rate(blocks, exp((low + high) / 2), fit);
}

/* Blocks that are far off, and a second time without them. */
static void fit_robustly(struct blocks *blocks, struct fit *fit)
{
	size_t dropped = 0;

	fit_exponential(blocks, fit);
	for (size_t i = 0; i < blocks->count; i++) {
		double e = blocks->mean[i] - fit->constant - fit->amplitude * exp(-fit->rate * (double)i);

		if (blocks->used[i] && fabs(e) > LIMIT_NOISE * fit->leaves) {
			blocks->used[i] = false;
			dropped++;
		}
	}
	if (dropped > 0)
		fit_exponential(blocks, fit);
}

static double leaves_by_slope(const struct blocks *blocks)
{
	double function[BLOCKS] = {0}, factor;
	struct fit fit;

	for (size_t i = 0; i < blocks->count; i++)
		function[i] = (double)i;
	settle_fit_two(blocks, function, &fit, &factor);
	return fit.leaves;
}

/* Of what it moves by over its blocks. */
static double span_of(const struct blocks *blocks, const struct fit *fit)
{
	return fabs(fit->amplitude) * -expm1(-fit->rate * (double)blocks->count);
}

static bool is_one(const struct blocks *blocks, const struct fit *fit, double noise_g)
{
	double span = span_of(blocks, fit), noise = noise_g > 0 ? noise_g : 0;
	double than_slope = sqrt(1 + LIMIT_F / (double)blocks->count);

	return span > LIMIT_NOISE * fit->leaves && than_slope * fit->leaves < leaves_by_slope(blocks) &&
	       fit->leaves <= fmax(LIMIT_AGREE * noise, ESTIMATE_TOLERANCE * span);
}

/* Whether what it leaves keeps its sign over many blocks, more than noise of a sensor's band does. */
static bool is_inexact(const struct blocks *blocks, const struct fit *fit)
{
	double squares = 0, n = 0;

	for (size_t i = 0; i + STRETCH <= blocks->count; i += STRETCH) {
		double sum = 0, used = 0;

		for (size_t k = i; k < i + STRETCH; k++)
			if (blocks->used[k]) {
				sum += blocks->mean[k] - fit->constant -
				       fit->amplitude * exp(-fit->rate * (double)k);
				used++;
			}
		squares += used > 0 ? sum * sum / used : 0;
		n++;
	}
	return n > 0 && sqrt(squares / n) > LIMIT_AGREE * fit->leaves;
}

/* Whether the record begins elsewhere than it is before its pulse. Most do not, and are done with here. */
static bool may_settle(const struct trace *trace)
{
	double before, beginning, sigma = 0;
	size_t from, until;

	if (trace->count < 2 * FIRST)
		return false;
	quiet_find(trace, &from, &until);
	if (until < 2 * FIRST)
		return true;
	beginning = quiet_glance(trace, 0, BEGINNING, NULL);
	before = quiet_glance(trace, until - (until - from) / 4, until, &sigma);
	return fabs(beginning - before) > 2 * sigma;
}

/* The largest good sample once it is taken off. */
static size_t largest_without(const struct trace *trace, const struct settle *settle, double constant)
{
	double part = exp(-1 / (trace->rate_hz * settle->time_constant_s)), value = settle->amplitude_g,
	       most = 0;
	size_t at = trace->count;

	for (size_t k = 0; k < trace->count; k++, value *= part)
		if (trace_good(trace, k) && fabs(trace->value_g[k] - value - constant) > most) {
			most = fabs(trace->value_g[k] - value - constant);
			at = k;
		}
	return at;
}

/* The most samples, from the first on, that are one, without what may be the foot of something else; 0 if
 * none are. */
static size_t settle_grow(const struct trace *trace)
{
	double before = INFINITY;
	size_t samples = FIRST, fits = 0;
	struct blocks blocks;
	struct fit fit;

	while (samples <= trace->count) {
		double now;

		take_blocks(trace, samples, &blocks);
		fit_robustly(&blocks, &fit);
		now = fit.leaves * sqrt((double)blocks.length) + 1e-6 * fabs(fit.amplitude);
		if (now > LIMIT_OVER * before)
			break;
		if (is_one(&blocks, &fit, quiet_noise(trace, 0, samples)))
			fits = samples;
		if (fit.rate * (double)blocks.count > 2 * ENDED && blocks.length > 1)
			break;
		before = now;
		samples = (size_t)(GROWTH * (double)samples) + 1;
	}
	/* The last of them may hold a foot. */
	return fits - (size_t)(LIMIT_EDGE * (double)fits);
}

bool settle_find(const struct trace *trace, struct settle *settle)
{
	struct settle found;
	struct blocks blocks;
	struct fit fit;
	double block_s, part;
	size_t samples;

	if (!may_settle(trace))
		return false;
	samples = settle_grow(trace);
	if (samples == 0)
		return false;
	take_blocks(trace, samples, &blocks);
	fit_robustly(&blocks, &fit);
	if (!is_one(&blocks, &fit, quiet_noise(trace, 0, samples)))
		return false;
	block_s = (double)blocks.length / trace->rate_hz;
	found = (struct settle){.time_constant_s = block_s / fit.rate,
	                        .until_s = (double)blocks.count * block_s,
	                        .inexact = is_inexact(&blocks, &fit)};
	/* a block's mean is its first sample's value times the mean of the decay over it */
	part = fit.rate / (double)blocks.length;
	found.amplitude_g = fit.amplitude * (double)blocks.length * expm1(-part) / expm1(-fit.rate);
	found.extrapolated = found.until_s < ENDED / 2 * found.time_constant_s;
	if (found.until_s < ENDED * found.time_constant_s) {
		size_t at = largest_without(trace, &found, fit.constant + blocks.middle);

		if (at == trace->count || (double)samples < COVERS * (double)at)
			return false;
	}
	*settle = found;
	return true;
}

void settle_remove(struct trace *trace, const struct settle *settle)
{
	double part = exp(-1 / (trace->rate_hz * settle->time_constant_s)), value = settle->amplitude_g;

	for (size_t k = 0; k < trace->count; k++, value *= part)
		trace->value_g[k] -= value;
	trace_changed(trace);
	trace->flags |= RECORD_FLAG_SETTLING;
}
