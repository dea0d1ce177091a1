/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/doubt.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/quiet.h"

enum {
	PLATEAU_SAMPLES = 3,
	REST_SAMPLES = 4,  /* at rest after a step */
	WIDTH_SAMPLES = 8, /* of a pulse whose width straight lines and curves tell without a bias */
	BATCHES_MIN = 8,   /* of the quiet part, for the scatter of their means */
	AFTER_BLOCKS = 12, /* of half a width, that follow the pulse */
};

/* A limit trembles less than noise would in so many of as many tops. */
#define PLATEAU_CHANCE 1e-4

/* A fall to rest over the steepest of the three steps before it: 1.2 at the end of a half-sine. */
#define STEP_STEEPER 3.0

/* A pulse's force has faded this part of its width after its 10 % point. */
#define AFTER_FROM 0.3

/* What a width of n samples is off, times n squared: kinks between the samples. */
#define WIDTH_BIAS 1.4

/* The samples of a flat top, both included. */
struct plateau {
	size_t from, until;
};

/* Whether two good samples lie on either side. */
static bool plateau_inside(const struct trace *trace, const struct plateau *top)
{
	return top->from >= 2 && top->until + 2 < trace->count && trace_good(trace, top->from - 1) &&
	       trace_good(trace, top->from - 2) && trace_good(trace, top->until + 1) &&
	       trace_good(trace, top->until + 2);
}

/* The largest good sample of the event by magnitude; count when there is none. */
static size_t plateau_largest(const struct trace *trace)
{
	size_t at = trace->count;
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++) {
		if (!(trace_most(trace, k) > most)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		if (trace_good(trace, k) && fabs(trace->value_g[k]) > most) {
			most = fabs(trace->value_g[k]);
			at = k;
		}
	}
	return at;
}

/* Whether more than noise falls off beside them, on both sides within two samples, and a round top that falls
 * off so would be as round between them that it shows. */
static bool plateau_ends(const struct trace *trace, double sign, const struct plateau *top, double noise_g)
{
	double left = sign * (trace->value_g[top->from] - trace->value_g[top->from - 2]);
	double right = sign * (trace->value_g[top->until] - trace->value_g[top->until + 2]);
	double fall = fmin(left, right), half = (double)(top->until - top->from) / 2;

	return fall > LIMIT_NOISE * noise_g && fall * half * half / (4 * half + 4) > LIMIT_AGREE * noise_g;
}

/* Chance, at most, that noise trembles no more than the samples do about their mean: the first term of
 * chi-square's distribution. */
static double plateau_chance(const struct trace *trace, const struct plateau *top, double noise_g)
{
	double n = (double)(top->until - top->from + 1), sum = 0, square = 0, half = (n - 1) / 2;

	for (size_t k = top->from; k <= top->until; k++)
		sum += trace->value_g[k];
	for (size_t k = top->from; k <= top->until; k++)
		square += pow(trace->value_g[k] - sum / n, 2);
	return pow(square / (2 * noise_g * noise_g), half) / tgamma(half + 1);
}

/* Sample by sample outward from the largest one, to the ends of what noise hardly leaves as flat.
 */
static bool plateau_find(const struct trace *trace, double noise_g, struct plateau *top)
{
	size_t at = plateau_largest(trace);
	double high, low, sign;

	if (at == trace->count || trace->sample[at] & SAMPLE_CLIPPED)
		return false;
	*top = (struct plateau){at, at};
	high = low = fabs(trace->value_g[at]);
	sign = trace->value_g[at] < 0 ? -1 : 1;
	while (low > LIMIT_MOST * high && plateau_inside(trace, top)) {
		double before = sign * trace->value_g[top->from - 1];
		double after = sign * trace->value_g[top->until + 1];

		if (top->until - top->from + 1 >= PLATEAU_SAMPLES &&
		    plateau_ends(trace, sign, top, noise_g) &&
		    plateau_chance(trace, top, noise_g) < PLATEAU_CHANCE)
			return true;
		low = fmin(low, fmax(before, after));
		top->from -= before > after;
		top->until += !(before > after);
	}
	return false;
}

/* Noise of samples side by side: less than all of them have where it is not white. */
static double plateau_noise(const struct trace *trace, double noise_g)
{
	size_t from, until;

	quiet_find(trace, &from, &until);
	return fmin(noise_g, quiet_noise(trace, from, until));
}

void doubt_plateau(struct trace *trace, double noise_g)
{
	struct plateau top;

	if (!plateau_find(trace, plateau_noise(trace, noise_g), &top))
		return;
	trace->flags |= RECORD_FLAG_CLIPPED;
	for (size_t k = top.from; k <= top.until; k++)
		trace->sample[k] |= SAMPLE_CLIPPED | TRACE_LIMIT;
}

/* Where the pulse, on its way down, comes to rest within one sample, steeper than a sensor can stop. */
static bool doubt_step(const struct trace *trace, const struct peak *peak, const struct estimate_pulse *pulse)
{
	double rest = LIMIT_NOISE * trace->noise_g, height = fabs(peak->result.value_g);
	size_t end = trace_index(trace, pulse->end_s), last = end < 1 ? 0 : end - 1;
	double step, steepest = 0;

	if (last < 3 || end + REST_SAMPLES > trace->count)
		return false;
	for (size_t k = last - 3; k < end + REST_SAMPLES; k++)
		if (!trace_usable(trace, k))
			return false;
	for (size_t k = end; k < end + REST_SAMPLES; k++)
		if (fabs(trace->value_g[k]) > fmax(rest, LIMIT_PART * height))
			return false;
	step = fabs(trace->value_g[end] - trace->value_g[last]);
	for (size_t k = last - 3; k < last; k++)
		steepest = fmax(steepest, fabs(trace->value_g[k + 1] - trace->value_g[k]));
	return step > LIMIT_EDGE * height && step > STEP_STEEPER * steepest + rest;
}

/* Mean of n samples from k on; false where one of them is missing. */
static bool doubt_mean(const struct trace *trace, size_t k, size_t n, double *mean_g)
{
	double sum = 0;

	if (k + n > trace->count)
		return false;
	for (size_t i = k; i < k + n; i++) {
		if (!trace_usable(trace, i))
			return false;
		sum += trace->value_g[i];
	}
	*mean_g = sum / (double)n;
	return true;
}

/* Standard deviation of the mean of n samples side by side, by such means of the quiet part. */
static double doubt_mean_sigma(const struct trace *trace, const struct estimate_baseline *baseline, size_t n)
{
	size_t until = trace_index(trace, baseline->until_s), batches = 0;
	double square = 0, white = trace->noise_g / sqrt((double)n), mean;

	for (size_t k = trace_index(trace, baseline->from_s); k + n <= until; k += n) {
		if (!doubt_mean(trace, k, n, &mean))
			continue;
		square += mean * mean;
		batches++;
	}
	return batches < BATCHES_MIN ? white : fmax(white, sqrt(square / (double)batches));
}

/* What follows the pulse in blocks of half a width. */
struct after {
	size_t n, samples;
	double mean_g[AFTER_BLOCKS], sigma_g; /* of each, by the quiet part */
};

/* As far as to a hole or to what rises again. */
static void after_find(const struct trace *trace, const struct estimate_baseline *baseline,
                       const struct peak *peak, const struct estimate_pulse *pulse, struct after *after)
{
	double again = LIMIT_EDGE * fabs(peak->result.value_g);
	size_t k = trace_index(trace, pulse->end_s + AFTER_FROM * pulse->duration_s);

	/* The sum of straight lines goes on to where the reading is back at zero. */
	while (peak->lopsided && k < trace->count &&
	       trace_time(trace, k) < pulse->end_s + pulse->duration_s && peak->sign * trace->value_g[k] > 0)
		k++;
	after->n = 0;
	after->samples = (size_t)fmax(pulse->duration_s * trace->rate_hz / 2, 1);
	after->sigma_g = doubt_mean_sigma(trace, baseline, after->samples);
	for (; after->n < AFTER_BLOCKS; after->n++, k += after->samples) {
		double *mean = &after->mean_g[after->n];

		if (!doubt_mean(trace, k, after->samples, mean))
			break;
		*mean *= peak->sign;
		if (after->n > 0 && *mean > mean[-1] + again)
			break;
	}
}

/* By how much zero after differs from zero before: of a supply or a sensor that was shifted; a plate that the
 * case feels swings about it. */
static double after_shift(const struct after *after)
{
	double mean = 0, square = 0, n = (double)after->n, sigma;

	if (after->n < AFTER_BLOCKS / 2)
		return 0;
	for (size_t i = 0; i < after->n; i++)
		mean += after->mean_g[i] / n;
	for (size_t i = 0; i < after->n; i++)
		square += pow(after->mean_g[i] - mean, 2) / (n - 1);
	sigma = fmax(after->sigma_g, sqrt(square)) / sqrt(n);
	return fabs(mean) > LIMIT_SIGNIFICANT * sigma ? fabs(mean) : 0;
}

/* Area in g s of a force that fades on: never below zero, and gone at last. */
static double after_tail(const struct trace *trace, const struct after *after)
{
	double sum = 0;

	if (after->n < AFTER_BLOCKS / 2)
		return 0;
	for (size_t i = 0; i < after->n; i++) {
		if (after->mean_g[i] < -LIMIT_AGREE * after->sigma_g)
			return 0;
		sum += after->mean_g[i];
	}
	if (!(sum > LIMIT_SIGNIFICANT * after->sigma_g * sqrt((double)after->n)))
		return 0;
	return sum * (double)after->samples / trace->rate_hz;
}

/* Nobody knows when zero shifted: it may have by the peak, and before the pulse. */
static void doubt_after(const struct trace *trace, const struct estimate_baseline *baseline,
                        struct peak *peak, struct estimate_pulse *pulse)
{
	struct estimate_peak *top = &peak->result;
	struct after after;
	double shift_g, beyond_m_s;

	if (baseline->samples == 0)
		return;
	after_find(trace, baseline, peak, pulse, &after);
	shift_g = after_shift(&after);
	beyond_m_s = UNITS_G_M_S2 * fmax(shift_g * pulse->duration_s, after_tail(trace, &after));
	if (beyond_m_s > LIMIT_PART * fabs(pulse->velocity_change_m_s)) {
		pulse->sigma_velocity_m_s = hypot(pulse->sigma_velocity_m_s, beyond_m_s);
		pulse->flags |= ESTIMATE_FLAG_TAIL;
	}
	if (shift_g > LIMIT_PART * fabs(top->value_g)) {
		top->sigma_g = hypot(top->sigma_g, shift_g);
		top->how.flags |= ESTIMATE_FLAG_TAIL;
	}
}

void doubt_channel(const struct trace *trace, const struct estimate_baseline *baseline, struct peak *peak,
                   struct estimate_pulse *pulse)
{
	double samples = pulse->duration_s * trace->rate_hz;

	if (!isfinite(pulse->duration_s))
		return;
	if (doubt_step(trace, peak, pulse))
		pulse->flags |= ESTIMATE_FLAG_STEP;
	if (samples < WIDTH_SAMPLES)
		pulse->sigma_duration_s =
		        hypot(pulse->sigma_duration_s, WIDTH_BIAS / (samples * samples) * pulse->duration_s);
	doubt_after(trace, baseline, peak, pulse);
}
