/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/peak_private.h"

/* Mean of four samples at the top beyond the crest, in its sigmas. */
#define CORNER_SIGMAS 1.7

/* Samples whose mean tells a level of the top, and how many of the width's samples they are. */
#define LEVEL_PART (1.0 / 9)

/* A level is as high as the highest within LIMIT_HINT standard deviations of their difference; a top that is
 * so much wider there than the crest's bend makes it is flat. */
#define LEVEL_WIDER 1.6

/* The time from the first to the last mean of n samples under the pulse that is within fall_g of the highest.
 */
static double top_level(const struct trace *trace, const struct peak *peak, size_t n, double fall_g)
{
	size_t from = trace_index(trace, peak->start.peak_s - peak->start.half_width_s / 2);
	size_t until = trace_index(trace, peak->start.peak_s + peak->start.half_width_s / 2), first = until,
	       last = from;
	double low = (double)n * fall_g, most = -INFINITY;

	for (int pass = 0; pass < 2; pass++)
		for (size_t k = from; k + n <= until && k + n <= trace->count; k++) {
			double sum = 0;

			for (size_t i = k; i < k + n; i++)
				sum += trace_good(trace, i) ? peak->sign * trace->value_g[i] : -INFINITY;
			if (pass == 0) {
				most = fmax(most, sum);
			} else if (sum > most - low) {
				first = k < first ? k : first;
				last = k;
			}
		}
	return first < last ? (double)(last - first) / trace->rate_hz : 0;
}

/* How far the top is one level by the samples alone, where the crest is sharper than that: a hump that noise
 * lifted. */
static double flat_doubt(const struct trace *trace, const struct peak *peak, const double d[3])
{
	size_t n = (size_t)fmax(LEVEL_PART * peak->width_s * trace->rate_hz, 1);
	/* A summit between two samples shows less in their mean. */
	double fall = LIMIT_HINT * trace->noise_g * sqrt(2.0 / (double)n) +
	              fabs(d[2]) / (8 * trace->rate_hz * trace->rate_hz);
	double level = top_level(trace, peak, n, fall);
	double bent = 2 * sqrt(2 * fall / fabs(d[2])) + 1 / trace->rate_hz;

	return level > LEVEL_WIDER * bent ? level / 2 : 0;
}

/* Samples at the top that lie above or below the crest by more than noise: a corner no polynomial follows. */
static double corner_doubt(const struct trace *trace, const struct peak *peak)
{
	size_t k = trace_index(trace, peak->result.time_s), n = 0;
	double sum = 0, most = 0, d[3];

	for (size_t i = k < 2 ? 0 : k - 2; i < k + 2 && i < trace->count; i++) {
		double beyond;

		if (!trace_usable(trace, i))
			continue;
		local_at(&peak->local, trace_time(trace, i), d);
		beyond = peak->sign * (trace->value_g[i] - d[0]);
		sum += beyond;
		most = fmax(most, beyond);
		n++;
	}
	if (n == 0)
		return 0;
	sum = fabs(sum) / (double)n;
	sum = sum > CORNER_SIGMAS * trace->noise_g / sqrt((double)n) ? sum : 0;
	return most > LIMIT_AGREE * trace->noise_g ? fmax(sum, most) : sum;
}

/* A flank from half of the height on, the sample at the top left out, as a straight line. */
struct flank {
	double n, at_s, mean_g, slope_g_s; /* of the top's sign */
	double rest, bent;                 /* squares left of the line, and of a half-sine's flank */
};

/* Samples of a flank that a line is asked of; a line through two is none. */
enum { FLANK_SAMPLES = 2 };

/* How far sample i of the flank is along, in samples, or along a half-sine as wide. */
static double flank_place(const struct peak *peak, double rate_hz, double i, bool bent)
{
	return bent ? 1 - cos(UNITS_PI * i / (peak->width_s * rate_hz)) : i;
}

/* The n samples beside k by a line over their places. Squares that are left. */
static double flank_line(const struct trace *trace, const struct peak *peak, size_t k, ptrdiff_t step,
                         double n, bool bent, struct flank *flank)
{
	double at = 0, sum = 0, square = 0, along = 0, values = 0, slope;

	for (double i = 1; i <= n; i++) {
		double value = peak->sign * trace->value_g[k + (size_t)((ptrdiff_t)i * step)];
		double place = flank_place(peak, trace->rate_hz, i, bent);

		at += place / n;
		sum += value / n;
		square += place * place;
		along += place * value;
		values += value * value;
	}
	slope = (along - n * at * sum) / (square - n * at * at);
	*flank = (struct flank){n, (double)step * at, sum, (double)step * slope, 0, 0};
	return fmax(values - n * sum * sum - slope * (along - n * at * sum), 0);
}

/* step is -1 for the one before sample k, +1 for the one after it. False where it is curved by more than
 * noise, too short or missing. */
static bool flank_fit(const struct trace *trace, const struct peak *peak, size_t k, ptrdiff_t step,
                      struct flank *flank)
{
	double level = fabs(trace->value_g[k]) / 2, n = 0, bent, rest;
	double noise = fmax(trace->noise_g, LIMIT_UNSEEN * fabs(trace->value_g[k]));

	for (size_t i = k + (size_t)step; i < trace->count && trace_usable(trace, i); i += (size_t)step) {
		if (peak->sign * trace->value_g[i] < level)
			break;
		n++;
	}
	if (n < FLANK_SAMPLES)
		return false;
	bent = flank_line(trace, peak, k, step, n, true, flank);
	rest = flank_line(trace, peak, k, step, n, false, flank);
	flank->rest = rest;
	flank->bent = bent;
	return n < 3 || flank->rest < noise * noise * (n - 2) * (1 + LIMIT_CHI * sqrt(2 / (n - 2)));
}

/* Two straight flanks meet in a corner, whose top lies between the samples: how far above the value, and how
 * far aside. */
static bool flanks_meet(const struct trace *trace, const struct peak *peak, double *above_g, double *aside_s)
{
	size_t k = trace_index(trace, peak->result.time_s);
	struct flank left, right;
	double meet;

	k -= k > 0 && (k == trace->count || fabs(trace->value_g[k - 1]) > fabs(trace->value_g[k]));
	if (!flank_fit(trace, peak, k, -1, &left) || !flank_fit(trace, peak, k, 1, &right) ||
	    left.rest + right.rest > left.bent + right.bent || !(left.slope_g_s > 0) ||
	    !(right.slope_g_s < 0))
		return false;
	meet = (right.mean_g - left.mean_g + left.slope_g_s * left.at_s - right.slope_g_s * right.at_s) /
	       (left.slope_g_s - right.slope_g_s);
	meet = fmin(fmax(meet, -1), 1);
	*above_g = left.mean_g + left.slope_g_s * (meet - left.at_s) - fabs(peak->result.value_g);
	*aside_s = fabs(trace_time(trace, k) + meet / trace->rate_hz - peak->result.time_s);
	return *above_g > 0;
}

void peak_top_doubt(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *result = &peak->result;
	double corner, flat, above, aside, level, d[3];

	if (peak->model == PEAK_MODEL_SHAPE)
		return;
	if (result->how.status == ESTIMATE_OK && flanks_meet(trace, peak, &above, &aside)) {
		result->sigma_g = hypot(result->sigma_g, above / 2);
		result->sigma_time_s = hypot(result->sigma_time_s, aside);
	}
	if (peak->model != PEAK_MODEL_LOCAL) {
		/* No polynomial follows: any sample that is as high may be the peak. */
		level = top_level(trace, peak, 1, LIMIT_HINT * sqrt(2.0) * trace->noise_g);
		result->sigma_time_s = hypot(result->sigma_time_s, level / 2);
		return;
	}
	local_at(&peak->local, result->time_s, d);
	corner = corner_doubt(trace, peak);
	flat = hypot(flat_doubt(trace, peak, d), corner > 0 ? 0.5 / trace->rate_hz : 0);
	result->sigma_g = hypot(result->sigma_g, corner);
	result->sigma_time_s = hypot(result->sigma_time_s, flat);
	peak->doubt_s = hypot(peak->doubt_s, flat);
}
