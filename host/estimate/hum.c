/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/hum.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/cholesky.h"
#include "host/estimate/gram.h"
#include "host/estimate/limits.h"

enum {
	BLOCK_SAMPLES_MIN = 4,
	DRIFT_BLOCKS_MIN = 20,
	HUM_BLOCKS_MIN = 40,
	SHORT_BLOCKS = 40, /* of a quiet part that is too short for blocks of a length, at most */
};

/* Hum of no mains frequency is looked for where the means scatter by more than chance: from so many cycles,
 * slower is motion, to as near half the means' rate, where they do not tell its phase, in steps of this part
 * of what the quiet part resolves, and then this often at half the step. */
#define TONE_CYCLES 3.0
#define TONE_STEP 0.35

enum { TONE_HALVINGS = 14 };

/* Adds up the normal equations, means taken from that of the first block on. */
static void hum_add_blocks(struct hum_line *line, const struct quiet *quiet, double half_s, struct gram *gram)
{
	const struct quiet_block *block = quiet->block;
	const unsigned first = line->has_slope ? 2 : 1;
	struct phasor hum[ZERO_HUMS_MAX];
	double row[GRAM_MAX] = {0};

	for (unsigned h = 0; h < line->hums; h++) {
		double turns = 2 * UNITS_PI * line->hum_hz[h] * half_s;

		hum[h] = phasor_at(turns * block[0].place, turns * (block[1].place - block[0].place));
	}
	for (size_t i = 0; i < quiet->count; i++) {
		double w = sqrt(block[i].weight);

		row[0] = w;
		row[1] = w * block[i].place;
		for (unsigned h = 0; h < line->hums; h++) {
			row[first + 2 * h] = w * hum[h].cosine;
			row[first + 2 * h + 1] = w * hum[h].sine;
			phasor_turn(&hum[h]);
		}
		row[line->terms] = w * (block[i].mean - block[0].mean);
		gram_add(gram, row);
	}
}

/* Least squares; half_s is half of the quiet part. False when the means do not tell. */
static bool fit_line(struct hum_line *line, const struct quiet *quiet, double half_s)
{
	static const double second[HUM_TERMS_MAX] = {0, 1};
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0};
	struct cholesky factor;
	struct gram gram;

	line->terms = 1u + (line->has_slope ? 1 : 0) + 2 * line->hums;
	line->squares = 0;
	gram_start(&gram, line->terms);
	hum_add_blocks(line, quiet, half_s, &gram);
	gram_finish(&gram, normal, right, &line->squares);
	if (!cholesky_factor(&factor, line->terms, normal))
		return false;
	cholesky_solve(&factor, right, line->term);
	for (unsigned a = 0; a < line->terms; a++)
		line->squares -= line->term[a] * right[a];
	line->squares = fmax(line->squares, 0);
	line->slope_variance = line->has_slope ? cholesky_variance(&factor, second) : 0;
	line->term[0] += quiet->block[0].mean;
	return true;
}

/* What is left, per block and degree of freedom. */
static double left(const struct hum_line *line, size_t count)
{
	return line->squares / (double)(count - line->terms);
}

/* Hum h at hz, if that leaves less. */
static void try_hz(struct hum_line *best, const struct quiet *quiet, double half_s, unsigned h, double hz)
{
	struct hum_line trial = *best;

	trial.hum_hz[h] = hz;
	if (hz > 0 && fit_line(&trial, quiet, half_s) && trial.squares < best->squares)
		*best = trial;
}

/* The frequency of hum h within reach_hz of what it is. */
static void hum_refine(struct hum_line *line, const struct quiet *quiet, double half_s, unsigned h,
                       double reach_hz)
{
	for (int i = 0; i < TONE_HALVINGS; i++, reach_hz /= 2) {
		double hz = line->hum_hz[h];

		try_hz(line, quiet, half_s, h, hz - reach_hz);
		try_hz(line, quiet, half_s, h, hz + reach_hz);
	}
}

/* Mains may be off their nominal frequency, and one hum beside another. */
static void refine_all(struct hum_line *line, const struct quiet *quiet, double half_s)
{
	for (unsigned h = 0; h < line->hums; h++) {
		struct hum_line trial = *line;

		hum_refine(&trial, quiet, half_s, h, 0.5 / (2 * half_s));
		if (line->squares - trial.squares > LIMIT_F * left(&trial, quiet->count))
			*line = trial;
	}
}

/* What the line leaves of the means, weighted. */
static void take_rest(const struct hum_line *line, const struct quiet *quiet, double half_s,
                      double rest[QUIET_BLOCKS_MAX])
{
	const double *hum = line->term + (line->has_slope ? 2 : 1);

	for (size_t i = 0; i < quiet->count; i++) {
		const struct quiet_block *block = &quiet->block[i];
		double fit = line->term[0] + (line->has_slope ? line->term[1] * block->place : 0);

		for (unsigned h = 0; h < line->hums; h++) {
			double angle = 2 * UNITS_PI * line->hum_hz[h] * half_s * block->place;

			fit += hum[2 * h] * cos(angle) + hum[2 * h + 1] * sin(angle);
		}
		rest[i] = block->weight * (block->mean - fit);
	}
}

static double power(const double rest[QUIET_BLOCKS_MAX], size_t count, double step)
{
	struct phasor turning = phasor_at(0, step);
	double cosine = 0, sine = 0;

	for (size_t i = 0; i < count; i++, phasor_turn(&turning)) {
		cosine += rest[i] * turning.cosine;
		sine += rest[i] * turning.sine;
	}
	return cosine * cosine + sine * sine;
}

/* One hum more, of any frequency: the strongest in what is left, then fitted with the rest. */
static struct hum_line one_more(const struct hum_line *line, const struct quiet *quiet, double half_s)
{
	double step = TONE_STEP / (2 * half_s), block_s = (double)quiet->length / quiet->trace->rate_hz;
	double rest[QUIET_BLOCKS_MAX], most = 0;
	struct hum_line best = *line;

	take_rest(line, quiet, half_s, rest);
	best.hum_hz[best.hums] = 0;
	for (double hz = TONE_CYCLES / (2 * half_s); hz < 0.5 / block_s - TONE_CYCLES / (2 * half_s);
	     hz += step) {
		double here = power(rest, quiet->count, 2 * UNITS_PI * hz * block_s);

		if (here > most) {
			most = here;
			best.hum_hz[best.hums] = hz;
		}
	}
	best.hums++;
	if (!(most > 0) || !fit_line(&best, quiet, half_s) ||
	    !(line->squares - best.squares > LIMIT_F * left(&best, quiet->count)))
		return *line;
	hum_refine(&best, quiet, half_s, best.hums - 1, step / 2);
	return best;
}

/* The strongest is the one that has a place of its own. */
static void note_hum(double amplitude_g, double hz, double phase, struct estimate_baseline *baseline)
{
	struct estimate_tone tone = {amplitude_g, hz, phase};

	if (amplitude_g > baseline->hum_g) {
		tone = (struct estimate_tone){baseline->hum_g, baseline->hum_hz, baseline->hum_phase};
		baseline->hum_g = amplitude_g;
		baseline->hum_hz = hz;
		baseline->hum_phase = phase;
	}
	if (tone.amplitude_g > 0)
		baseline->tone[baseline->tones++] = tone;
}

void hum_note(const struct hum_line *line, double half_s, double block_s, struct estimate_baseline *baseline)
{
	const double *hum = line->term + (line->has_slope ? 2 : 1);

	baseline->offset_g = line->term[0];
	if (line->has_slope)
		baseline->drift_g_s = line->term[1] / half_s;
	for (unsigned h = 0; h < line->hums; h++, hum += 2) {
		/* A mean shows a sine smaller than it is. */
		double x = UNITS_PI * line->hum_hz[h] * block_s;

		note_hum(hypot(hum[0], hum[1]) * x / sin(x), line->hum_hz[h], atan2(-hum[1], hum[0]),
		         baseline);
	}
}

/* Noise of the samples, squared, with the line taken off; reach about it. */
static double variance_off(const struct hum_line *line, const struct quiet *quiet, double half_s,
                           double reach)
{
	struct estimate_baseline zero = {.from_s = trace_time(quiet->trace, quiet->from),
	                                 .until_s = trace_time(quiet->trace, quiet->until - 1)};
	struct quiet off = *quiet;

	hum_note(line, half_s, (double)quiet->length / quiet->trace->rate_hz, &zero);
	off.zero = &zero;
	return pow(quiet_take(&off, 0, reach).deviation, 2);
}

/* Amplitude of a frequency in the samples. */
static double in_samples(const struct quiet *quiet, double hz, const struct quiet_moments *moments,
                         double reach)
{
	const struct trace *trace = quiet->trace;
	struct phasor turning = phasor_at(0, 2 * UNITS_PI * hz / trace->rate_hz);
	double cosine = 0, sine = 0;

	for (size_t k = quiet->from; k < quiet->until; k++, phasor_turn(&turning)) {
		double d = trace->value_g[k] - moments->mean;

		if (!trace_good(trace, k) || fabs(d) > reach)
			continue;
		cosine += d * turning.cosine;
		sine += d * turning.sine;
	}
	return 2 * hypot(cosine, sine) / (double)moments->count;
}

/* Of the last hum, as the means show it: a mean shows a sine smaller than it is. */
static double last_hum_g(const struct hum_line *line, const struct quiet *quiet)
{
	const double *hum = line->term + line->terms - 2;
	double x = UNITS_PI * line->hum_hz[line->hums - 1] * (double)quiet->length / quiet->trace->rate_hz;

	return hypot(hum[0], hum[1]) * x / sin(x);
}

/* Block means show a tone beyond half their rate as a slower one: the samples tell which it is. False when
 * it is neither. */
static bool unfold(struct hum_line *line, const struct quiet *quiet, double half_s,
                   const struct quiet_moments *moments, double reach)
{
	double *hz = &line->hum_hz[line->hums - 1],
	       fast = quiet->trace->rate_hz / (double)quiet->length - *hz;
	double slow_g = in_samples(quiet, *hz, moments, reach),
	       fast_g = in_samples(quiet, fast, moments, reach);

	if (fast_g > slow_g) {
		*hz = fast;
		if (!fit_line(line, quiet, half_s))
			return false;
	}
	return fmax(fast_g, slow_g) > LIMIT_EXPLAINS * last_hum_g(line, quiet);
}

/* Whether the means scatter by more than the samples' noise makes them. */
static bool coloured(const struct hum_line *line, size_t count, double variance)
{
	return left(line, count) > (1 + LIMIT_CHI * sqrt(2.0 / (double)(count - line->terms))) * variance;
}

/* What the two frequencies of mains leave: their own true frequency first, then whatever else hums. Returns
 * the square of the samples' noise. */
static double find_tones(struct hum_line *best, const struct quiet *quiet, double half_s,
                         const struct quiet_moments *moments, double reach)
{
	double variance = variance_off(best, quiet, half_s, reach);
	size_t count = quiet->count;

	if (best->hums > 0 && coloured(best, count, variance)) {
		refine_all(best, quiet, half_s);
		variance = variance_off(best, quiet, half_s, reach);
	}
	while (best->hums < ZERO_HUMS_MAX && coloured(best, count, variance)) {
		struct hum_line trial = one_more(best, quiet, half_s);
		if (trial.hums == best->hums ||
		    !(best->squares - trial.squares > 2 * LIMIT_F * left(&trial, count)) ||
		    !unfold(&trial, quiet, half_s, moments, reach) ||
		    !(last_hum_g(&trial, quiet) > LIMIT_LEAST))
			break;
		*best = trial;
		refine_all(best, quiet, half_s);
		variance = variance_off(best, quiet, half_s, reach);
	}
	return variance;
}

/* Whether short blocks differ by more than what scatters within them: a part too short for a line still tells
 * whether it is noise. */
static bool short_coloured(const struct quiet *quiet, double about, double reach)
{
	size_t samples = quiet->until - quiet->from, length = (samples + SHORT_BLOCKS - 1) / SHORT_BLOCKS;
	double between = 0, within, count, blocks = 0, limit;
	struct quiet_moments moments;
	struct quiet fine = *quiet;

	fine.length = length > BLOCK_SAMPLES_MIN ? length : BLOCK_SAMPLES_MIN;
	moments = quiet_take(&fine, about, reach);
	for (size_t i = 0; i < fine.count; i++) {
		between += fine.block[i].weight * pow(fine.block[i].mean - moments.mean, 2);
		blocks += fine.block[i].weight > 0;
	}
	count = (double)moments.count;
	if (blocks < 2 || count < blocks + 2)
		return false;
	within = (moments.deviation * moments.deviation * (count - 1) - between) / (count - blocks);
	limit = 1 + LIMIT_CHI_REFUSED * sqrt(2 / (blocks - 1) + 2 / (count - blocks));
	return between / (blocks - 1) > fmax(fmax(LIMIT_GROSS, limit) * within, LIMIT_LEAST * LIMIT_LEAST);
}

struct hum_line hum_find(struct quiet *quiet, double half_s, const struct quiet_moments *moments,
                         double reach)
{
	static const double mains_hz[] = {50, 60};
	struct hum_line none = {.term = {0}}, best = {.has_slope = true}, start;
	size_t count = quiet->count;
	double variance = moments->deviation * moments->deviation;

	if (quiet->length < BLOCK_SAMPLES_MIN || count < DRIFT_BLOCKS_MIN) {
		quiet->doubtful = short_coloured(quiet, moments->mean, reach);
		return none;
	}
	if (!fit_line(&best, quiet, half_s))
		return none;
	start = best;
	for (unsigned i = 0; count >= HUM_BLOCKS_MIN && i < 2; i++) {
		struct hum_line trial = {.has_slope = true, .hums = 1, .hum_hz = {mains_hz[i]}};

		if (fit_line(&trial, quiet, half_s) && trial.squares < best.squares &&
		    start.squares - trial.squares > 2 * LIMIT_F * left(&trial, count))
			best = trial;
	}
	if (count >= HUM_BLOCKS_MIN && (best.hums > 0 || coloured(&best, count, variance)))
		variance = find_tones(&best, quiet, half_s, moments, reach);
	quiet->doubtful = left(&best, count) > fmax(LIMIT_GROSS * variance, LIMIT_LEAST * LIMIT_LEAST);
	if (quiet->doubtful)
		return none;
	if (best.term[1] * best.term[1] > LIMIT_F * best.slope_variance * left(&best, count) &&
	    fabs(best.term[1]) > LIMIT_LEAST)
		return best;
	best.has_slope = false;
	return best.hums > 0 && fit_line(&best, quiet, half_s) ? best : none;
}
