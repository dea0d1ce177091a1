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
	TERMS_MAX = 4 /* offset, slope, cosine, sine */
};

/* Once in a million quiet records: F of two, and of one more unknown. */
#define HUM_F 15.0
#define DRIFT_F 26.0

/* Smaller lines than this are rounding. */
#define LEAST_G 1e-3

/* Hum that would be significant makes the means scatter by more than this, in squares. */
#define HUM_SIGN 1.2

/* The means may scatter by this much more, in squares, than the samples' noise asks. */
#define COLOUR_MAX 3.0

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
	struct block block[BLOCKS_MAX];
};

struct moments {
	double mean, deviation;
	size_t count, good; /* used, of so many */
};

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
	struct rotor mains;
	double middle_s, reach_s, time_s, step_s;
};

static struct walk walk_from(const struct estimate_baseline *baseline, const struct trace *trace, size_t k)
{
	double middle = (baseline->from_s + baseline->until_s) / 2, step = 1 / trace->rate_hz;
	double turns = baseline->hum_g > 0 ? 2 * UNITS_PI * baseline->hum_hz : 0, time = trace_time(trace, k);

	return (struct walk){.baseline = baseline,
	                     .mains = rotor(turns * (time - middle) + baseline->hum_phase, turns * step),
	                     .middle_s = middle,
	                     .reach_s = (baseline->until_s - baseline->from_s) / 2 + DRIFT_REACH_S,
	                     .time_s = time,
	                     .step_s = step};
}

static inline double walk(struct walk *w)
{
	double u = w->time_s - w->middle_s, mains = w->mains.cosine;

	u = u < -w->reach_s ? -w->reach_s : u;
	u = u > w->reach_s ? w->reach_s : u;
	w->time_s += w->step_s;
	turn(&w->mains);
	return w->baseline->offset_g + w->baseline->drift_g_s * u + w->baseline->hum_g * mains;
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

/* Offset, then slope over half the quiet part if asked for, then cosine and sine of the mains if any. */
struct line {
	bool has_slope;
	double hum_hz; /* 0: none */
	unsigned terms;
	double term[TERMS_MAX];
	double squares; /* left, weighted */
	double slope_variance;
};

/* Adds up the normal equations, means taken from that of the first block on; returns the sum of squares. */
static double add_blocks(struct line *line, const struct quiet *quiet, double half_s,
                         double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX])
{
	double turns = 2 * UNITS_PI * line->hum_hz * half_s, squares = 0;
	const struct block *block = quiet->block;
	struct rotor mains = rotor(turns * block[0].place, turns * (block[1].place - block[0].place));

	for (size_t i = 0; i < quiet->count; i++, turn(&mains)) {
		double row[TERMS_MAX] = {1, block[i].place, mains.cosine, mains.sine};
		double w = block[i].weight, y = block[i].mean - block[0].mean;

		if (!line->has_slope) {
			row[1] = row[2];
			row[2] = row[3];
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
	static const double second[TERMS_MAX] = {0, 1, 0, 0};
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0};
	struct cholesky factor;

	line->terms = 1u + (line->has_slope ? 1 : 0) + (line->hum_hz > 0 ? 2 : 0);
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

/* The slope, and the mains frequency that explains most if that is more than chance; no terms when neither
 * does, or when what is left is no noise. */
static struct line find_line(const struct quiet *quiet, double half_s, double deviation_g)
{
	static const double mains_hz[] = {50, 60};
	struct line none = {.term = {0}}, best = {.has_slope = true}, start;
	size_t count = quiet->count;
	double variance = deviation_g * deviation_g;

	if (quiet->length < BLOCK_SAMPLES_MIN || count < DRIFT_BLOCKS_MIN || !fit_line(&best, quiet, half_s))
		return none;
	start = best;
	for (unsigned i = 0; count >= HUM_BLOCKS_MIN && left(&start, count) > HUM_SIGN * variance && i < 2;
	     i++) {
		struct line trial = {.has_slope = true, .hum_hz = mains_hz[i]};

		if (fit_line(&trial, quiet, half_s) && trial.squares < best.squares &&
		    start.squares - trial.squares > 2 * HUM_F * left(&trial, count))
			best = trial;
	}
	if (left(&best, count) > COLOUR_MAX * variance)
		return none;
	if (best.term[1] * best.term[1] > DRIFT_F * best.slope_variance * left(&best, count) &&
	    fabs(best.term[1]) > LEAST_G)
		return best;
	best.has_slope = false;
	return best.hum_hz > 0 && fit_line(&best, quiet, half_s) ? best : none;
}

static void note_line(const struct line *line, double half_s, double block_s,
                      struct estimate_baseline *baseline)
{
	const double *mains = line->term + (line->has_slope ? 2 : 1);
	double x = UNITS_PI * line->hum_hz * block_s;

	baseline->offset_g = line->term[0];
	if (line->has_slope)
		baseline->drift_g_s = line->term[1] / half_s;
	if (!(line->hum_hz > 0))
		return;
	/* A mean shows a sine smaller than it is. */
	baseline->hum_g = hypot(mains[0], mains[1]) * x / sin(x);
	baseline->hum_hz = line->hum_hz;
	baseline->hum_phase = atan2(-mains[1], mains[0]);
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
	line = find_line(quiet, half_s, inner.deviation);
	found->offset_g = inner.mean;
	found->noise_g = inner.deviation;
	found->deviation_g = plain.deviation;
	found->samples = inner.count;
	found->from_s = trace_time(trace, quiet->from);
	found->until_s = trace_time(trace, quiet->until - 1);
	if (line.terms == 0)
		return;
	note_line(&line, half_s, (double)quiet->length / trace->rate_hz, found);
	quiet->zero = found;
	found->noise_g = take_blocks(quiet, 0, reach).deviation;
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
	struct estimate_baseline found = {
	        .noise_g = NAN, .deviation_g = NAN, .hum_hz = NAN, .from_s = NAN, .until_s = NAN};
	double length = ceil(BLOCK_S * trace->rate_hz - 1e-6);
	struct quiet quiet = {.trace = trace};

	quiet_part(trace, &quiet.from, &quiet.until);
	if (count_good(&quiet) >= QUIET_SAMPLES_MIN) {
		quiet.length = length > 1 ? (size_t)length : 1;
		measure(&quiet, &found);
	} else {
		found.noise_g = found.deviation_g = noise_of_differences(trace, scratch);
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
	if (fabs(baseline->drift_g_s) > 0)
		trace->flags |= RECORD_FLAG_DRIFT;
	if (baseline->hum_g > 0)
		trace->flags |= RECORD_FLAG_HUM;
	trace->noise_g = baseline->noise_g;
	trace->hum_g = baseline->hum_g;
	trace->hum_hz = baseline->hum_hz;
}
