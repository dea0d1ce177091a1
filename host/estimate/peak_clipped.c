/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/peak_private.h"

#include <math.h>

#include "host/estimate/limits.h"

/* Flanks tell of no cut that lasts this many times the shorter one: that is a channel that hangs at its
 * limit. */
#define FLANKS_LAST 20.0

/* The clipped samples under the pulse. */
struct clipped {
	size_t first, last, n;
	bool limit;       /* some of them stand at one */
	double low, high; /* of their magnitudes */
};

static struct clipped clipped_under(const struct trace *trace, const struct peak *peak)
{
	struct clipped found = {0, 0, 0, false, INFINITY, -INFINITY};

	for (size_t k = trace_index(trace, peak->span.from_s);
	     k < trace->count && trace_time(trace, k) <= peak->span.until_s; k++) {
		if (!trace_good(trace, k) || !(trace->sample[k] & SAMPLE_CLIPPED))
			continue;
		found.first = found.n == 0 ? k : found.first;
		found.last = k;
		found.n++;
		found.limit = found.limit || trace->sample[k] & TRACE_LIMIT;
		found.low = fmin(found.low, fabs(trace->value_g[k]));
		found.high = fmax(found.high, fabs(trace->value_g[k]));
	}
	return found;
}

/* The flanks speak against the family, yet the truth lies beyond the limit. */
static void take_suspect(struct peak *peak, const struct clipped *clipped)
{
	struct estimate_peak *result = &peak->result;
	double half = (peak->clipped_until_s - peak->clipped_from_s) / 2;
	double beyond = fmax(fabs(peak->shape.peak_g) - clipped->low, 0);

	peak_take_shape(peak);
	result->sigma_g = hypot(sqrt(fmax(peak->shape.chi_square, 1)) * result->sigma_g, beyond / 2);
	result->sigma_time_s = fmax(result->sigma_time_s, half);
	result->how.flags |= ESTIMATE_FLAG_MODEL;
}

/* Into peak->shape the first family that fits; a doubtful one stands against those of more freedom. */
static enum shape_verdict fit_flanks(const struct trace *trace, enum estimate_family family,
                                     struct peak *peak)
{
	enum shape_verdict best = SHAPE_REFUSED;

	for (unsigned i = 0; i < SHAPE_LADDER; i++) {
		struct shape before = peak->shape;
		enum shape_verdict verdict;

		if (family != ESTIMATE_FAMILY_AUTO && family != shape_ladder[i])
			continue;
		if (best == SHAPE_DOUBTFUL && shape_ladder[i] == ESTIMATE_FAMILY_SINE_POWER)
			break;
		if (!peak_fit(trace, shape_ladder[i], peak)) {
			peak->shape = before;
			continue;
		}
		verdict = shape_judge(&peak->shape);
		if (verdict > best || (verdict == best && best == SHAPE_DOUBTFUL))
			peak->shape = before;
		best = verdict < best ? verdict : best;
		if (best == SHAPE_FITS)
			break;
	}
	return best;
}

/* About the value of the family that is taken, where every other one may be the pulse's, as likely as its
 * residual is beside that one's: the root mean square of all their errors, so weighted. Without a noise to
 * hold the residuals against one is as likely as another. */
static double sigma_of_all(const struct trace *trace, struct peak *peak)
{
	const struct shape taken = peak->shape;
	double square = pow(taken.sigma_peak_g, 2), sum = 1;

	for (unsigned i = 0; i < SHAPE_LADDER; i++) {
		const struct shape *other = &peak->shape;
		double worse, chance;

		if (shape_ladder[i] == taken.family || !peak_fit(trace, shape_ladder[i], peak))
			continue;
		worse = other->chi_square * other->freedom - taken.chi_square * taken.freedom;
		chance = isnan(worse) ? 1 : exp(-worse / 2);
		square += chance * (pow(other->sigma_peak_g, 2) + pow(other->peak_g - taken.peak_g, 2));
		sum += chance;
	}
	peak->shape = taken;
	return sqrt(square / sum);
}

/* The family was not given. */
static void peak_clipped_take_choice(const struct trace *trace, enum shape_verdict verdict,
                                     const struct clipped *clipped, struct peak *peak)
{
	double *sigma_g = &peak->result.sigma_g;

	/* Of the other ones none was left. */
	if (peak->shape.family == ESTIMATE_FAMILY_SINE_POWER)
		*sigma_g = hypot(*sigma_g, LIMIT_KNOWN * (fabs(peak->shape.peak_g) - clipped->low));
	else if (verdict == SHAPE_FITS)
		*sigma_g = sigma_of_all(trace, peak);
}

/* Whether the flanks are too little of the pulse to say how high it went. */
static bool flanks_silent(const struct clipped *clipped, const struct peak *peak)
{
	double before = peak->clipped_from_s - peak->span.from_s;
	double after = peak->span.until_s - peak->clipped_until_s;

	return peak->shape.family == ESTIMATE_FAMILY_AUTO ||
	       !(fabs(peak->shape.peak_g) <= LIMIT_GROSS * clipped->high) ||
	       peak->clipped_until_s - peak->clipped_from_s > FLANKS_LAST * fmin(before, after);
}

/* From the flanks alone. */
static void extrapolate(const struct trace *trace, const struct estimate_options *options,
                        const struct clipped *clipped, struct peak *peak)
{
	enum shape_verdict verdict = fit_flanks(trace, options->family, peak);

	if (flanks_silent(clipped, peak)) {
		peak->shape.family = ESTIMATE_FAMILY_AUTO;
		peak_tried(&peak->result.how, "sample");
		peak->result.how.method = "sample";
		peak->result.value_g = trace->value_g[peak->at];
		peak->result.sigma_g = NAN;
		peak->result.time_s = (peak->clipped_from_s + peak->clipped_until_s) / 2;
		peak->result.sigma_time_s = (peak->clipped_until_s - peak->clipped_from_s) / 2;
		return;
	}
	if (verdict == SHAPE_FITS)
		peak_take_shape(peak);
	else
		take_suspect(peak, clipped);
	if (options->family == ESTIMATE_FAMILY_AUTO)
		peak_clipped_take_choice(trace, verdict, clipped, peak);
	peak->result.how.flags |= ESTIMATE_FLAG_EXTRAPOLATED;
}

bool peak_unclip(const struct trace *trace, const struct estimate_options *options, struct peak *peak)
{
	const struct clipped clipped = clipped_under(trace, peak);
	struct estimate_peak *result = &peak->result;
	double half = 0.5 / trace->rate_hz;
	/* Two samples to either side of a summit are alike by chance. */
	bool flat = clipped.n > 2 && clipped.high - clipped.low <= LIMIT_NOISE * trace->noise_g;

	if (clipped.n == 0)
		return false;
	/* One that trembles takes along what lies between. */
	if (clipped.limit || flat) {
		peak->clipped_from_s = trace_time(trace, clipped.first) - half;
		peak->clipped_until_s = trace_time(trace, clipped.last) + half;
	}
	if (flat && !clipped.limit) {
		peak->start.limit_from_s = peak->clipped_from_s;
		peak->start.limit_until_s = peak->clipped_until_s;
	}
	if (clipped.limit || flat) {
		extrapolate(trace, options, &clipped, peak);
	} else {
		peak_climb(trace, options, peak);
		result->sigma_g =
		        hypot(result->sigma_g, LIMIT_SLIGHT * fmax(fabs(result->value_g) - clipped.low, 0));
	}
	result->how.status = ESTIMATE_CLIPPED;
	return true;
}
