/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/resultant.h"

#include <math.h>

#include "host/estimate/crest.h"

/* A local maximum is one once the resultant has come down from it by this part of the largest, and by this
 * many sigma: less is noise on a flank. */
#define FALL_LEVEL 0.1
#define FALL_NOISE 5.0
#define FIRST_LEVEL 0.5

/* Magnitude at a sample of axis i, the other axis interpolated; false where either is missing. Good enough
 * to know where to look. */
static bool magnitude(const struct resultant_axes *axes, unsigned i, size_t k, double *value_g)
{
	double other;

	if (!trace_good(axes->trace[i], k) ||
	    !trace_at(axes->trace[1 - i], trace_time(axes->trace[i], k), &other))
		return false;
	*value_g = hypot(axes->trace[i]->value_g[k], other);
	return true;
}

/* The instants of the faster axis; count when there is none that has both axes. */
static size_t largest(const struct resultant_axes *axes, unsigned i, double *value_g)
{
	size_t at = axes->trace[i]->count;
	double value;

	*value_g = 0;
	for (size_t k = axes->trace[i]->first; k < axes->trace[i]->last; k++) {
		if (magnitude(axes, i, k, &value) && value > *value_g) {
			*value_g = value;
			at = k;
		}
	}
	return at;
}

/* The first local maximum above half of the largest one, by its instant of the faster axis. */
static size_t first_local(const struct resultant_axes *axes, unsigned i, size_t largest_at, double largest_g)
{
	double noise = fmax(axes->trace[0]->noise_g, axes->trace[1]->noise_g);
	double fall = fmax(FALL_LEVEL * largest_g, noise > 0 ? FALL_NOISE * noise : 0), top = 0, value;
	size_t at = largest_at;

	for (size_t k = axes->trace[i]->first; k < largest_at; k++) {
		if (!magnitude(axes, i, k, &value))
			continue;
		if (value > top) {
			top = value;
			at = k;
		}
		if (top > FIRST_LEVEL * largest_g && value < top - fall)
			return at;
		if (value < top - fall)
			top = 0;
	}
	return largest_at;
}

/* Feet of the stronger axis' pulse around its sample nearest to time_s. */
static struct local_span span_around(const struct resultant_axes *axes, unsigned strong, double time_s)
{
	const struct trace *trace = axes->trace[strong];
	struct local_span span = axes->peak[strong]->span;
	size_t k = trace_index(trace, time_s);
	double sign;

	if (time_s >= span.from_s && time_s <= span.until_s)
		return span;
	while (k > 0 && (k == trace->count || !trace_good(trace, k)))
		k--;
	sign = trace->value_g[k] < 0 ? -1 : 1;
	trace_edge(trace, k, -1, sign, 0.05 * fabs(trace->value_g[k]), &span.from_s);
	trace_edge(trace, k, 1, sign, 0.05 * fabs(trace->value_g[k]), &span.until_s);
	return span;
}

static bool usable(const struct peak *peak)
{
	return peak->result.how.status != ESTIMATE_SHORT && peak->result.how.status != ESTIMATE_NO_PEAK;
}

/* X and Y against each other, and what a hole or a limit under the pulse does to the resultant. */
static void compare_axes(const struct resultant_axes *axes, unsigned strong, struct resultant *found)
{
	const struct peak *x = axes->peak[0], *y = axes->peak[1];
	enum estimate_status status = axes->peak[strong]->result.how.status;

	if (usable(x) && usable(y)) {
		found->result.axes_apart_s = y->result.time_s - x->result.time_s;
		found->result.axes_coincide = fabs(found->result.axes_apart_s) <= RESULTANT_COINCIDE_S;
	}
	if (status == ESTIMATE_OK && usable(axes->peak[1 - strong]))
		status = axes->peak[1 - strong]->result.how.status;
	if (trace_any(axes->trace[0], found->span.from_s, found->span.until_s, SAMPLE_CLIPPED) ||
	    trace_any(axes->trace[1], found->span.from_s, found->span.until_s, SAMPLE_CLIPPED)) {
		status = ESTIMATE_CLIPPED;
		found->result.sigma_g = NAN;
	}
	found->result.how.status = status;
}

void resultant_find(const struct resultant_axes *axes, struct resultant *resultant)
{
	const struct peak *x = axes->peak[0], *y = axes->peak[1];
	unsigned strong = !usable(x) || (usable(y) && fabs(y->result.value_g) > fabs(x->result.value_g));
	unsigned fast = axes->trace[1]->rate_hz > axes->trace[0]->rate_hz;
	struct resultant found = {
	        .result = {.peak_g = NAN, .sigma_g = NAN, .time_s = NAN, .axes_apart_s = NAN},
	        .sigma_time_s = NAN,
	        .first_peak_s = NAN};
	struct crest crest;
	double top;
	size_t at, first;

	found.result.how.status = axes->peak[strong]->result.how.status;
	*resultant = found;
	if (!usable(axes->peak[strong]))
		return;
	resultant->result.how.status = ESTIMATE_SHORT;
	found.width_s = axes->peak[strong]->width_s;
	at = largest(axes, fast, &top);
	if (at == axes->trace[fast]->count)
		return;
	found.span = span_around(axes, strong, trace_time(axes->trace[fast], at));
	if (!crest_fit(&crest, axes->trace, 2, trace_time(axes->trace[fast], at), found.width_s, &found.span))
		return;
	found.result.peak_g = crest.value_g;
	found.result.sigma_g = crest.sigma_g;
	found.result.time_s = found.first_peak_s = crest.time_s;
	found.sigma_time_s = crest.sigma_time_s;
	first = first_local(axes, fast, at, top);
	if (first != at) {
		struct local_span span = span_around(axes, strong, trace_time(axes->trace[fast], first));

		found.first_peak_s = trace_time(axes->trace[fast], first);
		if (crest_fit(&crest, axes->trace, 2, found.first_peak_s, found.width_s, &span))
			found.first_peak_s = crest.time_s;
	}
	compare_axes(axes, strong, &found);
	*resultant = found;
}
