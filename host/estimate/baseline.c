/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/baseline.h"

#include <math.h>

#include <gsl/gsl_statistics_double.h>

/* As long as the study's pre-trigger and more; longer reaches into what happened before the fall. */
#define QUIET_S 0.25
#define RISE_LEVEL 0.1

enum { QUIET_SAMPLES_MIN = 32, DIFFERENCES_MIN = 16 };

/* A Gaussian's standard deviation over its median absolute deviation. */
#define MAD_TO_SIGMA 1.482602218505602

static size_t collect(const struct trace *trace, size_t from, size_t until, double *out)
{
	size_t n = 0;

	for (size_t k = from; k < until; k++)
		if (trace_good(trace, k))
			out[n++] = trace->value_g[k];
	return n;
}

/* Mean and deviation of what lies within 5 sigma of the median. */
static void spread_of(const double *value, size_t n, double *work, struct estimate_baseline *baseline)
{
	double median, sigma, sum = 0, squares = 0;
	size_t used = 0;

	for (size_t i = 0; i < n; i++)
		work[i] = value[i];
	median = gsl_stats_median(work, 1, n);
	sigma = MAD_TO_SIGMA * gsl_stats_mad0(value, 1, n, work);
	for (size_t i = 0; i < n; i++) {
		double deviation = value[i] - median;

		if (sigma > 0 && fabs(deviation) > 5 * sigma)
			continue;
		sum += deviation;
		squares += deviation * deviation;
		used++;
	}
	/* More than half of the samples equal: the median deviation is blind there. */
	if (!(sigma > 0))
		sigma = sqrt(squares / (double)used);
	baseline->offset_g = median + sum / (double)used;
	baseline->noise_g = sigma;
	baseline->samples = used;
}

static double noise_of_differences(const struct trace *trace, double *scratch)
{
	size_t n = 0;

	for (size_t k = 2; k < trace->count; k++)
		if (trace_good(trace, k - 2) && trace_good(trace, k - 1) && trace_good(trace, k))
			scratch[n++] =
			        fabs(trace->value_g[k - 2] - 2 * trace->value_g[k - 1] + trace->value_g[k]);
	if (n < DIFFERENCES_MIN)
		return NAN;
	return MAD_TO_SIGMA * gsl_stats_median(scratch, 1, n) / sqrt(6.0);
}

/* The largest good sample about middle_g; count when none differs from it. */
static size_t largest(const struct trace *trace, double middle_g)
{
	size_t at = trace->count;
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++) {
		if (trace_good(trace, k) && fabs(trace->value_g[k] - middle_g) > most) {
			most = fabs(trace->value_g[k] - middle_g);
			at = k;
		}
	}
	return at;
}

/* The samples [from, until) of the quiet part before sample peak. */
static void quiet_part(const struct trace *trace, size_t peak, double middle_g, size_t *from, size_t *until)
{
	double level = RISE_LEVEL * fabs(trace->value_g[peak] - middle_g);
	double quiet = floor(QUIET_S * trace->rate_hz);
	size_t k = peak, rise;

	while (k > 0 && (!trace_good(trace, k) || fabs(trace->value_g[k] - middle_g) >= level))
		k--;
	rise = peak - k + 2;
	*until = k > rise ? k - rise : 0;
	*from = (double)*until > quiet ? *until - (size_t)quiet : 0;
}

void baseline_find(const struct trace *trace, double *scratch, struct estimate_baseline *baseline)
{
	struct estimate_baseline found = {.offset_g = 0, .noise_g = NAN, .samples = 0};
	size_t n = collect(trace, 0, trace->count, scratch);
	size_t peak, from = 0, until = trace->count;
	double middle = n > 0 ? gsl_stats_median(scratch, 1, n) : 0;

	peak = largest(trace, middle);
	if (peak < trace->count)
		quiet_part(trace, peak, middle, &from, &until);
	n = collect(trace, from, until, scratch);
	if (n >= QUIET_SAMPLES_MIN)
		spread_of(scratch, n, scratch + trace->count, &found);
	else
		found.noise_g = noise_of_differences(trace, scratch);
	*baseline = found;
}

void baseline_remove(struct trace *trace, const struct estimate_baseline *baseline)
{
	trace->noise_g = baseline->noise_g;
	for (size_t k = 0; k < trace->count; k++)
		if (trace_good(trace, k))
			trace->value_g[k] -= baseline->offset_g;
}
