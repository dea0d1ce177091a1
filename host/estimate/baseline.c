/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/baseline.h"

#include <float.h>
#include <math.h>

#include "common/units.h"
#include "host/estimate/cholesky.h"
#include "host/estimate/median.h"
#include "host/estimate/pair.h"

/* As long as the study's pre-trigger and more; longer reaches into what happened before the fall. */
#define QUIET_S 0.25
#define RISE_LEVEL 0.1

enum {
	QUIET_SAMPLES_MIN = 32,
	DIFFERENCES_MIN = 16,
	GLANCE = 31, /* samples that tell roughly where the middle is, and how wide */
};

/* A Gaussian's standard deviation over its median absolute deviation. */
#define MAD_TO_SIGMA 1.482602218505602
#define OUTLIER 6.0

/* Means of this length carry the mains nearly whole, and a slope. */
#define BLOCK_S 2e-3

enum {
	BLOCK_SAMPLES_MIN = 4,
	BLOCKS_MAX = 128, /* QUIET_S / BLOCK_S and one that is not full */
	DRIFT_BLOCKS_MIN = 20,
	HUM_BLOCKS_MIN = 40,
	HUMS_MAX = 1 + ESTIMATE_TONES_MAX,
	TERMS_MAX = 2 + 2 * HUMS_MAX /* offset, slope, cosine and sine of each hum */
};

/* Once in a million quiet records: F of two, and of one more unknown. */
#define HUM_F 15.0
#define DRIFT_F 26.0

/* Smaller lines than this are rounding. */
#define LEAST_G 1e-3

/* Hum that would be significant makes the means scatter by more than this, in squares. */
#define HUM_SIGN 1.2

/* Hum of no mains frequency is looked for where they scatter by this many standard deviations more: between
 * what is no longer motion and what the means show, in steps of this part of what the quiet part resolves,
 * and then this often at half the step. One of many frequencies needs more than one of two to be no chance.
 */
#define TONE_SIGN 4.0
#define TONE_LEAST_HZ 15.0
#define TONE_CYCLES 3.0
#define TONE_MOST 0.47
#define TONE_STEP 0.35
#define TONE_F 20.0

enum { TONE_HALVINGS = 14 };

/* A tone that is there takes this part of its power from the samples. */
#define TONE_SEEN 0.5

/* The means may scatter by this much more, in squares, than the samples' noise asks. */
#define COLOUR_MAX 3.0

/* Noise spreads each block of samples by more than this in its standard deviations, and no block by so much
 * more than another. */
#define QUIET_SPREAD 2.0
#define QUIET_UNLIKE 8.0
#define QUIET_ALIKE 3.0

/* A sensor on a high-pass and gravity leave less; of the pulse, what its uncertainty should be. */
#define OFFSET_MIN_G 3.0
#define OFFSET_PART 0.01

struct block {
	double mean, weight;
	double place; /* -1..1 over the quiet part */
};

/* The quiet part in blocks. */
struct quiet {
	const struct trace *trace;
	const struct estimate_baseline *zero; /* is taken off each sample; NULL: nothing is */
	size_t from, until;                   /* [from, until) */
	size_t length;                        /* of a block */
	size_t count;
	bool doubtful;
	struct block block[BLOCKS_MAX];
};

struct moments {
	double mean, deviation;
	size_t count, good; /* used, of so many */
};

static const struct estimate_baseline nothing_found = {
        .noise_g = NAN, .deviation_g = NAN, .hum_hz = NAN, .from_s = NAN, .until_s = NAN};

static double noise_of_differences(const struct trace *trace, double *scratch)
{
	size_t n = 0;

	for (size_t k = 2; k < trace->count; k++)
		if (trace_good(trace, k - 2) && trace_good(trace, k - 1) && trace_good(trace, k))
			scratch[n++] =
			        fabs(trace->value_g[k - 2] - 2 * trace->value_g[k - 1] + trace->value_g[k]);
	if (n < DIFFERENCES_MIN)
		return NAN;
	return MAD_TO_SIGMA * median_find(scratch, n) / sqrt(6.0);
}

/* Roughly where the middle of [from, until) is, from a few of its samples; *sigma_g, unless NULL, is the
 * standard deviation from their distances. */
static double glance(const struct trace *trace, size_t from, size_t until, double *sigma_g)
{
	double seen[GLANCE], middle;
	size_t step = (until - from) / GLANCE + 1, n = 0;

	for (size_t k = from; k < until; k += step)
		if (trace_good(trace, k))
			seen[n++] = trace->value_g[k];
	if (n == 0)
		return 0;
	middle = median_find(seen, n);
	for (size_t i = 0; sigma_g && i < n; i++)
		seen[i] = fabs(seen[i] - middle);
	if (sigma_g)
		*sigma_g = MAD_TO_SIGMA * median_find(seen, n);
	return middle;
}

/* The largest good sample about middle_g; count when none differs from it. */
static size_t largest(const struct trace *trace, double middle_g)
{
	size_t at = trace->count;
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++) {
		const struct trace_block *block = &trace->block[k / TRACE_BLOCK];
		double value;

		if (!(fmax(block->high_g - middle_g, middle_g - block->low_g) > most)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		value = fabs(trace->value_g[k] - middle_g);
		if (value > most && trace_good(trace, k)) {
			most = value;
			at = k;
		}
	}
	return at;
}

/* The samples [from, until) of the quiet part before the largest. */
static void quiet_part(const struct trace *trace, size_t *from, size_t *until)
{
	double middle = glance(trace, 0, trace->count, NULL), quiet = floor(QUIET_S * trace->rate_hz), level;
	size_t peak = largest(trace, middle), k = peak, rise;

	*from = 0;
	*until = (double)trace->count > quiet ? (size_t)quiet : trace->count;
	if (peak == trace->count)
		return;
	level = RISE_LEVEL * fabs(trace->value_g[peak] - middle);
	while (k > 0 && (!trace_good(trace, k) || fabs(trace->value_g[k] - middle) >= level))
		k--;
	rise = peak - k + 2;
	*until = k > rise ? k - rise : 0;
	*from = (double)*until > quiet ? *until - (size_t)quiet : 0;
}

struct rotor {
	double cosine, sine, step_cosine, step_sine;
};

static inline void turn(struct rotor *r)
{
	double cosine = r->cosine * r->step_cosine - r->sine * r->step_sine;

	r->sine = r->sine * r->step_cosine + r->cosine * r->step_sine;
	r->cosine = cosine;
}

static struct rotor rotor(double angle, double step)
{
	return (struct rotor){cos(angle), sin(angle), cos(step), sin(step)};
}

/* Zero from one sample to the next. */
struct walk {
	const struct estimate_baseline *baseline;
	struct rotor hum[HUMS_MAX];
	double hum_g[HUMS_MAX];
	unsigned hums;
	double middle_s, reach_s, time_s, step_s;
};

static void walk_with(struct walk *w, double hum_g, double hum_hz, double phase)
{
	double turns = 2 * UNITS_PI * hum_hz;

	w->hum_g[w->hums] = hum_g;
	w->hum[w->hums++] = rotor(turns * (w->time_s - w->middle_s) + phase, turns * w->step_s);
}

static struct walk walk_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k)
{
	struct walk w = {.baseline = baseline,
	                 .middle_s = (baseline->from_s + baseline->until_s) / 2,
	                 .reach_s = (baseline->until_s - baseline->from_s) / 2 + DRIFT_REACH_S,
	                 .time_s = trace_time(trace, k),
	                 .step_s = 1 / trace->rate_hz};

	if (baseline->hum_g > 0)
		walk_with(&w, baseline->hum_g, baseline->hum_hz, baseline->hum_phase);
	for (unsigned i = 0; i < baseline->tones; i++)
		walk_with(&w, baseline->tone[i].amplitude_g, baseline->tone[i].hz, baseline->tone[i].phase);
	return w;
}

static inline double walk(struct walk *w)
{
	double u = w->time_s - w->middle_s, zero = w->baseline->offset_g;

	u = u < -w->reach_s ? -w->reach_s : u;
	u = u > w->reach_s ? w->reach_s : u;
	w->time_s += w->step_s;
	for (unsigned i = 0; i < w->hums; i++) {
		zero += w->hum_g[i] * w->hum[i].cosine;
		turn(&w->hum[i]);
	}
	return zero + w->baseline->drift_g_s * u;
}

/* Of samples, taken from about, so that nothing cancels. */
struct sums {
	size_t good, used;
	double first, second;
};

/* Whether all of [from, until) is good and within reach of about. */
static bool is_plain(const struct quiet *quiet, size_t from, size_t until, double about, double reach)
{
	const struct trace_block *block = quiet->trace->block;

	for (size_t i = from / TRACE_BLOCK; i * TRACE_BLOCK < until; i++)
		if (!block[i].whole || block[i].high_g - about > reach || about - block[i].low_g > reach)
			return false;
	return quiet->zero == NULL;
}

static void add_plain(const struct quiet *quiet, size_t from, size_t until, double about, struct sums *sums)
{
	const double *value = quiet->trace->value_g;
	PAIR first = {0}, second = {0};
	size_t k = from;

	for (; k + 2 <= until; k += 2) {
		const PAIR d = pair_load(value + k) - about;

		first += d;
		second += d * d;
	}
	if (k < until) {
		double d = value[k] - about;

		first[0] += d;
		second[0] += d * d;
	}
	sums->good += until - from;
	sums->used += until - from;
	sums->first += first[0] + first[1];
	sums->second += second[0] + second[1];
}

/* Adds the samples [from, until) that lie within reach of about. */
static void add_up(const struct quiet *quiet, size_t from, size_t until, double about, double reach,
                   struct sums *sums)
{
	const double *value = quiet->trace->value_g;
	struct sums s = *sums;
	struct walk zero = {0};

	if (quiet->zero)
		zero = walk_from(quiet->zero, quiet->trace, from);
	for (size_t k = from; k < until; k++) {
		size_t good = trace_good(quiet->trace, k), used;
		double d = value[k] - about;

		if (quiet->zero)
			d -= walk(&zero);
		used = good & (fabs(d) <= reach);
		d = used ? d : 0;
		s.good += good;
		s.used += used;
		s.first += d;
		s.second += d * d;
	}
	*sums = s;
}

/* Moments of what lies within reach of about, and the means of the blocks. */
static struct moments take_blocks(struct quiet *quiet, double about, double reach)
{
	double all = (double)(quiet->until - quiet->from), n, mean;
	bool plain = is_plain(quiet, quiet->from, quiet->until, about, reach);
	struct sums sums = {0};

	quiet->count = 0;
	for (size_t k = quiet->from; k < quiet->until && quiet->count < BLOCKS_MAX; k += quiet->length) {
		size_t end = k + quiet->length < quiet->until ? k + quiet->length : quiet->until;
		struct block *block = &quiet->block[quiet->count++];
		struct sums before = sums;

		if (plain || is_plain(quiet, k, end, about, reach))
			add_plain(quiet, k, end, about, &sums);
		else
			add_up(quiet, k, end, about, reach, &sums);
		n = (double)(sums.used - before.used);
		block->weight = n;
		block->mean = n > 0 ? about + (sums.first - before.first) / n : about;
		block->place = (double)(k + end - 2 * quiet->from) / all - 1;
	}
	if ((quiet->until - quiet->from) % quiet->length != 0)
		quiet->count--; /* the last one is not full: no place among the others */
	n = (double)sums.used;
	mean = sums.first / n;
	return (struct moments){about + mean,
	                        n > 1 ? sqrt(fmax(sums.second - n * mean * mean, 0) / (n - 1)) : 0, sums.used,
	                        sums.good};
}

/* Offset, then slope over half the quiet part if asked for, then cosine and sine of each hum. */
struct line {
	bool has_slope;
	unsigned hums;
	double hum_hz[HUMS_MAX];
	unsigned terms; /* of fit_line */
	double term[TERMS_MAX];
	double squares; /* left, weighted */
	double slope_variance;
};

/* Adds up the normal equations, means taken from that of the first block on; returns the sum of squares. */
static double add_blocks(struct line *line, const struct quiet *quiet, double half_s,
                         double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX])
{
	const struct block *block = quiet->block;
	const unsigned first = line->has_slope ? 2 : 1;
	struct rotor hum[HUMS_MAX];
	double row[TERMS_MAX] = {1}, squares = 0;

	for (unsigned h = 0; h < line->hums; h++) {
		double turns = 2 * UNITS_PI * line->hum_hz[h] * half_s;

		hum[h] = rotor(turns * block[0].place, turns * (block[1].place - block[0].place));
	}
	for (size_t i = 0; i < quiet->count; i++) {
		double w = block[i].weight, y = block[i].mean - block[0].mean;

		if (line->has_slope)
			row[1] = block[i].place;
		for (unsigned h = 0; h < line->hums; h++) {
			row[first + 2 * h] = hum[h].cosine;
			row[first + 2 * h + 1] = hum[h].sine;
			turn(&hum[h]);
		}
		for (unsigned a = 0; a < line->terms; a++) {
			right[a] += w * row[a] * y;
			for (unsigned b = 0; b <= a; b++)
				normal[a][b] += w * row[a] * row[b];
		}
		squares += w * y * y;
	}
	return squares;
}

/* Least squares; half_s is half of the quiet part. False when the means do not tell. */
static bool fit_line(struct line *line, const struct quiet *quiet, double half_s)
{
	static const double second[TERMS_MAX] = {0, 1};
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0};
	struct cholesky factor;

	line->terms = 1u + (line->has_slope ? 1 : 0) + 2 * line->hums;
	line->squares = add_blocks(line, quiet, half_s, normal, right);
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
static double left(const struct line *line, size_t count)
{
	return line->squares / (double)(count - line->terms);
}

/* Hum h at hz, if that leaves less. */
static void try_hz(struct line *best, const struct quiet *quiet, double half_s, unsigned h, double hz)
{
	struct line trial = *best;

	trial.hum_hz[h] = hz;
	if (hz > 0 && fit_line(&trial, quiet, half_s) && trial.squares < best->squares)
		*best = trial;
}

/* The frequency of hum h within reach_hz of what it is. */
static void refine(struct line *line, const struct quiet *quiet, double half_s, unsigned h, double reach_hz)
{
	for (int i = 0; i < TONE_HALVINGS; i++, reach_hz /= 2) {
		double hz = line->hum_hz[h];

		try_hz(line, quiet, half_s, h, hz - reach_hz);
		try_hz(line, quiet, half_s, h, hz + reach_hz);
	}
}

/* Mains may be off their nominal frequency, and one hum beside another. */
static void refine_all(struct line *line, const struct quiet *quiet, double half_s)
{
	for (unsigned h = 0; h < line->hums; h++) {
		struct line trial = *line;

		refine(&trial, quiet, half_s, h, 0.5 / (2 * half_s));
		if (line->squares - trial.squares > TONE_F * left(&trial, quiet->count))
			*line = trial;
	}
}

/* What the line leaves of the means, weighted. */
static void take_rest(const struct line *line, const struct quiet *quiet, double half_s,
                      double rest[BLOCKS_MAX])
{
	const double *hum = line->term + (line->has_slope ? 2 : 1);

	for (size_t i = 0; i < quiet->count; i++) {
		const struct block *block = &quiet->block[i];
		double fit = line->term[0] + (line->has_slope ? line->term[1] * block->place : 0);

		for (unsigned h = 0; h < line->hums; h++) {
			double angle = 2 * UNITS_PI * line->hum_hz[h] * half_s * block->place;

			fit += hum[2 * h] * cos(angle) + hum[2 * h + 1] * sin(angle);
		}
		rest[i] = block->weight * (block->mean - fit);
	}
}

static double power(const double rest[BLOCKS_MAX], size_t count, double step)
{
	struct rotor turning = rotor(0, step);
	double cosine = 0, sine = 0;

	for (size_t i = 0; i < count; i++, turn(&turning)) {
		cosine += rest[i] * turning.cosine;
		sine += rest[i] * turning.sine;
	}
	return cosine * cosine + sine * sine;
}

/* One hum more, of any frequency: the strongest in what is left, then fitted with the rest. */
static struct line one_more(const struct line *line, const struct quiet *quiet, double half_s)
{
	double step = TONE_STEP / (2 * half_s), block_s = (double)quiet->length / quiet->trace->rate_hz;
	double rest[BLOCKS_MAX], most = 0;
	struct line best = *line;

	take_rest(line, quiet, half_s, rest);
	best.hum_hz[best.hums] = 0;
	for (double hz = fmax(TONE_LEAST_HZ, TONE_CYCLES / (2 * half_s)); hz < TONE_MOST / block_s;
	     hz += step) {
		double here = power(rest, quiet->count, 2 * UNITS_PI * hz * block_s);

		if (here > most) {
			most = here;
			best.hum_hz[best.hums] = hz;
		}
	}
	best.hums++;
	if (!(most > 0) || !fit_line(&best, quiet, half_s) ||
	    !(line->squares - best.squares > TONE_F * left(&best, quiet->count)))
		return *line;
	refine(&best, quiet, half_s, best.hums - 1, step / 2);
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

static void note_line(const struct line *line, double half_s, double block_s,
                      struct estimate_baseline *baseline)
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
static double variance_off(const struct line *line, const struct quiet *quiet, double half_s, double reach)
{
	struct estimate_baseline zero = {.from_s = trace_time(quiet->trace, quiet->from),
	                                 .until_s = trace_time(quiet->trace, quiet->until - 1)};
	struct quiet off = *quiet;

	note_line(line, half_s, (double)quiet->length / quiet->trace->rate_hz, &zero);
	off.zero = &zero;
	return pow(take_blocks(&off, 0, reach).deviation, 2);
}

/* Amplitude of a frequency in the samples. */
static double in_samples(const struct quiet *quiet, double hz, const struct moments *moments, double reach)
{
	const struct trace *trace = quiet->trace;
	struct rotor turning = rotor(0, 2 * UNITS_PI * hz / trace->rate_hz);
	double cosine = 0, sine = 0;

	for (size_t k = quiet->from; k < quiet->until; k++, turn(&turning)) {
		double d = trace->value_g[k] - moments->mean;

		if (!trace_good(trace, k) || fabs(d) > reach)
			continue;
		cosine += d * turning.cosine;
		sine += d * turning.sine;
	}
	return 2 * hypot(cosine, sine) / (double)moments->count;
}

/* Of the last hum, as the means show it: a mean shows a sine smaller than it is. */
static double last_hum_g(const struct line *line, const struct quiet *quiet)
{
	const double *hum = line->term + line->terms - 2;
	double x = UNITS_PI * line->hum_hz[line->hums - 1] * (double)quiet->length / quiet->trace->rate_hz;

	return hypot(hum[0], hum[1]) * x / sin(x);
}

/* Block means show a tone beyond half their rate as a slower one: the samples tell which it is. False when
 * it is neither. */
static bool unfold(struct line *line, const struct quiet *quiet, double half_s, const struct moments *moments,
                   double reach)
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
	return fmax(fast_g, slow_g) > TONE_SEEN * last_hum_g(line, quiet);
}

/* Whether the means scatter by more than the samples' noise makes them. */
static bool coloured(const struct line *line, size_t count, double variance)
{
	return left(line, count) > (1 + TONE_SIGN * sqrt(2.0 / (double)(count - line->terms))) * variance;
}

/* What the two frequencies of mains leave: their own true frequency first, then whatever else hums. Returns
 * the square of the samples' noise. */
static double find_tones(struct line *best, const struct quiet *quiet, double half_s,
                         const struct moments *moments, double reach)
{
	double variance = variance_off(best, quiet, half_s, reach);
	size_t count = quiet->count;

	if (best->hums > 0 && coloured(best, count, variance)) {
		refine_all(best, quiet, half_s);
		variance = variance_off(best, quiet, half_s, reach);
	}
	while (best->hums < HUMS_MAX && coloured(best, count, variance)) {
		struct line trial = one_more(best, quiet, half_s);
		if (trial.hums == best->hums ||
		    !(best->squares - trial.squares > 2 * TONE_F * left(&trial, count)) ||
		    !unfold(&trial, quiet, half_s, moments, reach) || !(last_hum_g(&trial, quiet) > LEAST_G))
			break;
		*best = trial;
		refine_all(best, quiet, half_s);
		variance = variance_off(best, quiet, half_s, reach);
	}
	return variance;
}

/* The slope, and the mains frequency that explains most if that is more than chance; no terms when neither
 * does, or when what is left is no noise, which makes zero doubtful. */
static struct line find_line(struct quiet *quiet, double half_s, const struct moments *moments, double reach)
{
	static const double mains_hz[] = {50, 60};
	struct line none = {.term = {0}}, best = {.has_slope = true}, start;
	size_t count = quiet->count;
	double variance = moments->deviation * moments->deviation;

	if (quiet->length < BLOCK_SAMPLES_MIN || count < DRIFT_BLOCKS_MIN || !fit_line(&best, quiet, half_s))
		return none;
	start = best;
	for (unsigned i = 0; count >= HUM_BLOCKS_MIN && left(&start, count) > HUM_SIGN * variance && i < 2;
	     i++) {
		struct line trial = {.has_slope = true, .hums = 1, .hum_hz = {mains_hz[i]}};

		if (fit_line(&trial, quiet, half_s) && trial.squares < best.squares &&
		    start.squares - trial.squares > 2 * HUM_F * left(&trial, count))
			best = trial;
	}
	if (count >= HUM_BLOCKS_MIN && (best.hums > 0 || coloured(&best, count, variance)))
		variance = find_tones(&best, quiet, half_s, moments, reach);
	quiet->doubtful = left(&best, count) > fmax(COLOUR_MAX * variance, LEAST_G * LEAST_G);
	if (quiet->doubtful)
		return none;
	if (best.term[1] * best.term[1] > DRIFT_F * best.slope_variance * left(&best, count) &&
	    fabs(best.term[1]) > LEAST_G)
		return best;
	best.has_slope = false;
	return best.hums > 0 && fit_line(&best, quiet, half_s) ? best : none;
}

/* What noise there is in the samples of a block, by their extremes; 0 where nobody can tell. */
static double spread_of(const struct trace *trace, size_t block)
{
	const struct trace_block *b = &trace->block[block];

	return b->whole ? b->high_g - b->low_g : 0;
}

/* Whether [from, until) holds more than noise: some of it is far quieter than the whole. */
static bool restless(const struct quiet *quiet, double noise_g)
{
	for (size_t i = quiet->from / TRACE_BLOCK + 1; (i + 1) * TRACE_BLOCK <= quiet->until; i++) {
		double spread = spread_of(quiet->trace, i);

		if (spread > 0 && spread < QUIET_SPREAD * noise_g)
			return true;
	}
	return false;
}

/* The longest run of blocks that are as quiet as the quietest, where others are not by far; false where there
 * is none. */
static bool narrow(struct quiet *quiet)
{
	size_t first = quiet->from / TRACE_BLOCK + 1, last = quiet->until / TRACE_BLOCK, run = 0, longest = 0;
	double least = INFINITY, most = 0;

	for (size_t i = first; i < last; i++) {
		double spread = spread_of(quiet->trace, i);

		least = spread > 0 ? fmin(least, spread) : least;
		most = fmax(most, spread);
	}
	if (!(most > QUIET_UNLIKE * least))
		return false;
	for (size_t i = first; i < last; i++) {
		run = spread_of(quiet->trace, i) <= QUIET_ALIKE * least ? run + 1 : 0;
		if (run > longest) {
			longest = run;
			quiet->from = (i + 1 - run) * TRACE_BLOCK;
			quiet->until = (i + 1) * TRACE_BLOCK;
		}
	}
	return true;
}

/* Of a quiet part that is long enough. */
static void measure(struct quiet *quiet, struct estimate_baseline *found)
{
	const struct trace *trace = quiet->trace;
	double half_s = (double)(quiet->until - quiet->from) / (2 * trace->rate_hz), sigma = 0;
	double about = glance(trace, quiet->from, quiet->until, &sigma);
	/* More than half of the samples equal: the median deviation is blind there. */
	double reach = sigma > 0 ? OUTLIER * sigma : DBL_MAX;
	struct moments inner = take_blocks(quiet, about, reach), plain = inner;
	struct line line;

	if (inner.count < inner.good) {
		plain = take_blocks(quiet, about, DBL_MAX);
		reach = OUTLIER * inner.deviation; /* of many more samples than the glance took */
		inner = take_blocks(quiet, inner.mean, reach);
	}
	line = find_line(quiet, half_s, &inner, reach);
	found->offset_g = inner.mean;
	found->noise_g = inner.deviation;
	found->deviation_g = plain.deviation;
	found->samples = inner.count;
	found->from_s = trace_time(trace, quiet->from);
	found->until_s = trace_time(trace, quiet->until - 1);
	found->doubtful = found->doubtful || quiet->doubtful;
	if (line.terms == 0)
		return;
	note_line(&line, half_s, (double)quiet->length / trace->rate_hz, found);
	quiet->zero = found;
	found->noise_g = take_blocks(quiet, 0, reach).deviation;
	quiet->zero = NULL;
}

/* Once more without what moved before the pulse. */
static void measure_quietest(struct quiet *quiet, struct estimate_baseline *found)
{
	measure(quiet, found);
	if (!restless(quiet, found->noise_g))
		return;
	found->doubtful = true;
	if (!narrow(quiet))
		return;
	*found = nothing_found;
	found->doubtful = true;
	measure(quiet, found);
}

static size_t count_good(const struct quiet *quiet)
{
	size_t n = 0;

	for (size_t k = quiet->from; k < quiet->until && n < QUIET_SAMPLES_MIN; k++)
		n += trace_good(quiet->trace, k);
	return n;
}

void baseline_find(const struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	struct estimate_baseline found = nothing_found;
	double length = ceil(BLOCK_S * trace->rate_hz - 1e-6);
	struct quiet quiet = {.trace = trace};

	quiet_part(trace, &quiet.from, &quiet.until);
	if (count_good(&quiet) >= QUIET_SAMPLES_MIN) {
		quiet.length = length > 1 ? (size_t)length : 1;
		measure_quietest(&quiet, &found);
	} else {
		found.noise_g = found.deviation_g = noise_of_differences(trace, scratch);
		found.doubtful = true;
	}
	*baseline = found;
}

static void subtract(struct trace *trace, const struct estimate_baseline *baseline)
{
	double offset = baseline->offset_g, *value = trace->value_g;
	size_t k = 0;

	if (baseline->hum_g > 0 || fabs(baseline->drift_g_s) > 0) {
		struct walk zero = walk_from(baseline, trace, 0);

		for (; k < trace->count; k++)
			value[k] -= walk(&zero);
		trace_changed(trace);
		return;
	}
	for (; k + 4 <= trace->count; k += 4) {
		pair_store(value + k, pair_load(value + k) - offset);
		pair_store(value + k + 2, pair_load(value + k + 2) - offset);
	}
	for (; k < trace->count; k++)
		value[k] -= offset;
	for (size_t i = 0; i < trace_blocks(trace); i++) {
		trace->block[i].low_g -= offset;
		trace->block[i].high_g -= offset;
	}
}

void baseline_remove(struct trace *trace, const struct estimate_baseline *baseline)
{
	double offset = baseline->offset_g, most = 0;

	for (size_t i = 0; i < trace_blocks(trace); i++) {
		double high = trace->block[i].high_g - offset, low = offset - trace->block[i].low_g;

		most = high > most ? high : most;
		most = low > most ? low : most;
	}
	subtract(trace, baseline);
	if (fabs(offset) > fmax(OFFSET_MIN_G, OFFSET_PART * most))
		trace->flags |= RECORD_FLAG_OFFSET;
	if (baseline->doubtful && baseline->samples > 0)
		trace->flags |= RECORD_FLAG_ZERO_UNSURE;
	if (fabs(baseline->drift_g_s) > 0)
		trace->flags |= RECORD_FLAG_DRIFT;
	if (baseline->hum_g > 0)
		trace->flags |= RECORD_FLAG_HUM;
	trace->noise_g = baseline->noise_g;
	trace->hum_g = baseline->hum_g;
	trace->hum_hz = baseline->hum_hz;
}
