/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/quiet.h"

#include <math.h>

#include "host/estimate/limits.h"
#include "host/estimate/median.h"
#include "host/estimate/simd2.h"
#include "host/estimate/zero.h"

enum { GLANCE = 31 }; /* samples that tell roughly where the middle is, and how wide */
enum { SECOND_DIFFERENCES = 255 };

/* Noise is coloured when samples side by side tremble by less than this part of it: white noise does once in
 * a million quiet parts. Its colour is that of means of two blocks, of no fewer. */
#define COLOURED 0.7
#define COLOUR_UNSURE 1.5 /* over their number: Student's factor beyond 2, of 2 / 3 as many */

enum { COLOUR_MEANS = 16 };

double quiet_glance(const struct trace *trace, size_t from, size_t until, double *sigma_g)
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
static size_t quiet_largest(const struct trace *trace, double middle_g)
{
	size_t at = trace->count;
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++) {
		const struct trace_block *block = &trace->block[k / TRACE_BLOCK];
		double value;

		if (!(block->high_g - middle_g > most || middle_g - block->low_g > most)) {
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

/* Whether the first samples lie within level_g of 0. */
static bool starts_at_rest(const struct trace *trace, double level_g)
{
	bool rest = trace->count > QUIET_SAMPLES_MIN;

	for (size_t k = 0; rest && k < QUIET_SAMPLES_MIN; k++)
		rest = !trace_good(trace, k) || fabs(trace->value_g[k]) < level_g;
	return rest;
}

/* The largest sample about the middle, whose place is returned. What is in motion for the most part has no
 * zero in its middle, but where it begins if that is at rest. */
static double find_peak(const struct trace *trace, size_t *peak)
{
	double sigma = 0, middle = quiet_glance(trace, 0, trace->count, &sigma), level;

	*peak = quiet_largest(trace, middle);
	if (*peak == trace->count)
		return middle;
	level = LIMIT_EDGE * fabs(trace->value_g[*peak] - middle);
	if (sigma > level && starts_at_rest(trace, level)) {
		middle = quiet_glance(trace, 0, QUIET_SAMPLES_MIN, NULL);
		*peak = quiet_largest(trace, middle);
	}
	return middle;
}

void quiet_find(const struct trace *trace, size_t *from, size_t *until)
{
	size_t peak, k, rise;
	double middle = find_peak(trace, &peak), quiet = floor(QUIET_S * trace->rate_hz), level;

	k = peak;
	*from = 0;
	*until = (double)trace->count > quiet ? (size_t)quiet : trace->count;
	if (peak == trace->count)
		return;
	level = LIMIT_EDGE * fabs(trace->value_g[peak] - middle);
	while (k > 0 && (!trace_good(trace, k) || fabs(trace->value_g[k] - middle) >= level))
		k--;
	rise = peak - k + 2;
	*until = k > rise ? k - rise : 0;
	if (*until > trace->still)
		*until = trace->still;
	*from = (double)*until > quiet ? *until - (size_t)quiet : 0;
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

/* Adds the samples [from, until) that lie within reach of about; zero, unless NULL, begins there. */
static void quiet_add_up(const struct quiet *quiet, size_t from, size_t until, double about, double reach,
                         struct zero *zero, struct sums *sums)
{
	const double *value = quiet->trace->value_g;
	PAIR first = {0}, second = {0};

	for (size_t k = from; k < until; k += 2) {
		const bool more = k + 1 < until;
		size_t good[2] = {trace_good(quiet->trace, k), more && trace_good(quiet->trace, k + 1)},
		       used[2];
		PAIR d = (PAIR){value[k], more ? value[k + 1] : 0} - about;

		if (zero)
			d -= zero_next(zero);
		for (unsigned i = 0; i < 2; i++)
			used[i] = good[i] & (fabs(d[i]) <= reach);
		d = (PAIR){used[0] ? d[0] : 0, used[1] ? d[1] : 0};
		sums->good += good[0] + good[1];
		sums->used += used[0] + used[1];
		first += d;
		second += d * d;
	}
	sums->first += first[0] + first[1];
	sums->second += second[0] + second[1];
}

struct quiet_moments quiet_take(struct quiet *quiet, double about, double reach)
{
	const double all = (double)(quiet->until - quiet->from);
	bool plain = is_plain(quiet, quiet->from, quiet->until, about, reach);
	struct sums sums = {0};
	struct zero zero;
	double n, mean;

	quiet->count = 0;
	for (size_t k = quiet->from; k < quiet->until && quiet->count < QUIET_BLOCKS_MAX;
	     k += quiet->length) {
		size_t end = k + quiet->length < quiet->until ? k + quiet->length : quiet->until;
		struct quiet_block *block = &quiet->block[quiet->count++];
		struct sums here = {0};

		/* Two by two a block of an odd length leaves it a sample too far. */
		if (quiet->zero && (k == quiet->from || quiet->length % 2))
			zero = zero_from(quiet->zero, quiet->trace, k);
		if (plain || is_plain(quiet, k, end, about, reach))
			add_plain(quiet, k, end, about, &here);
		else
			quiet_add_up(quiet, k, end, about, reach, quiet->zero ? &zero : NULL, &here);
		block->weight = (double)here.used;
		block->mean = here.used > 0 ? about + here.first / (double)here.used : about;
		block->place = (double)(k + end - 2 * quiet->from) / all - 1;
		sums.good += here.good;
		sums.used += here.used;
		sums.first += here.first;
		sums.second += here.second;
	}
	if ((quiet->until - quiet->from) % quiet->length != 0)
		quiet->count--; /* the last one is not full: no place among the others */
	n = (double)sums.used;
	mean = sums.first / n;
	return (struct quiet_moments){about + mean,
	                              n > 1 ? sqrt(fmax(sums.second - n * mean * mean, 0) / (n - 1)) : 0,
	                              sums.used, sums.good};
}

/* What noise there is in the samples of a block, by their extremes; 0 where nobody can tell. */
static double quiet_spread_of(const struct trace *trace, size_t block)
{
	const struct trace_block *b = &trace->block[block];

	return b->whole ? b->high_g - b->low_g : 0;
}

bool quiet_restless(const struct quiet *quiet, double noise_g)
{
	for (size_t i = quiet->from / TRACE_BLOCK + 1; (i + 1) * TRACE_BLOCK <= quiet->until; i++) {
		double spread = quiet_spread_of(quiet->trace, i);

		if (spread > 0 && spread < LIMIT_OVER * noise_g)
			return true;
	}
	return false;
}

bool quiet_narrow(struct quiet *quiet)
{
	size_t first = quiet->from / TRACE_BLOCK + 1, last = quiet->until / TRACE_BLOCK, run = 0, longest = 0;
	double least = INFINITY, most = 0;

	for (size_t i = first; i < last; i++) {
		double spread = quiet_spread_of(quiet->trace, i);

		least = spread > 0 ? fmin(least, spread) : least;
		most = fmax(most, spread);
	}
	if (!(most > LIMIT_SURE * least))
		return false;
	for (size_t i = first; i < last; i++) {
		run = quiet_spread_of(quiet->trace, i) <= LIMIT_OVER * least ? run + 1 : 0;
		if (run > longest) {
			longest = run;
			quiet->from = (i + 1 - run) * TRACE_BLOCK;
			quiet->until = (i + 1) * TRACE_BLOCK;
		}
	}
	return true;
}

double quiet_noise(const struct trace *trace, size_t from, size_t until)
{
	double seen[SECOND_DIFFERENCES];
	size_t step = (until - from) / SECOND_DIFFERENCES + 1, n = 0;

	for (size_t k = from; k + 2 < until && n < SECOND_DIFFERENCES; k += step)
		if (trace_good(trace, k) && trace_good(trace, k + 1) && trace_good(trace, k + 2))
			seen[n++] =
			        fabs(trace->value_g[k] - 2 * trace->value_g[k + 1] + trace->value_g[k + 2]);
	return n < GLANCE / 2 ? NAN : MAD_TO_SIGMA * median_find(seen, n) / sqrt(6.0);
}

double quiet_colour(const struct trace *trace, const struct estimate_baseline *baseline)
{
	size_t from = trace_index(trace, baseline->from_s), until = trace_index(trace, baseline->until_s);
	size_t length = (size_t)ceil(2 * QUIET_BLOCK_S * trace->rate_hz), means = 0;
	double square = 0;

	if (baseline->samples == 0 || !(quiet_noise(trace, from, until) < COLOURED * trace->noise_g))
		return 1;
	for (; from + length <= until; from += (length + 1) / 2) {
		double sum = 0;
		size_t n = 0;

		for (size_t k = from; k < from + length; k++)
			if (trace_good(trace, k)) {
				sum += trace->value_g[k];
				n++;
			}
		square += n < length ? 0 : sum * sum / (double)n;
		means += n == length;
	}
	if (means < COLOUR_MEANS)
		return 1;
	return fmax(sqrt(square / (double)means) / trace->noise_g * (1 + COLOUR_UNSURE / (double)means), 1);
}

/* Whether the means of its quarters fall, or rise, each by more than noise and no faster at the end. */
static bool quiet_decays(const struct trace *trace, size_t from, size_t until)
{
	double mean[4] = {0}, noise = quiet_noise(trace, from, until), sign;
	size_t length = (until - from) / 4;

	for (size_t i = 0; i < 4; i++) {
		size_t n = 0;

		for (size_t k = from + i * length; k < from + (i + 1) * length; k++)
			if (trace_good(trace, k)) {
				mean[i] += trace->value_g[k];
				n++;
			}
		if (n == 0)
			return false;
		mean[i] /= (double)n;
	}
	noise = LIMIT_SURE * noise / sqrt((double)length);
	sign = mean[0] > mean[1] ? 1 : -1;
	for (size_t i = 0; i < 3; i++)
		if (!(sign * (mean[i] - mean[i + 1]) > noise))
			return false;
	return fabs(mean[2] - mean[3]) < fabs(mean[0] - mean[1]);
}

bool quiet_settled(struct quiet *quiet)
{
	bool any = false;

	while (quiet_decays(quiet->trace, quiet->from, quiet->until)) {
		any = true;
		if (quiet->until - quiet->from < 4 * QUIET_SAMPLES_MIN)
			break;
		quiet->from = quiet->until - (quiet->until - quiet->from) / 2;
	}
	return any;
}

bool quiet_enough(const struct quiet *quiet)
{
	size_t n = 0;

	for (size_t k = quiet->from; k < quiet->until && n < QUIET_SAMPLES_MIN; k++)
		n += trace_good(quiet->trace, k);
	return n >= QUIET_SAMPLES_MIN;
}
