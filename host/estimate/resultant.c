/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/resultant.h"

#include <math.h>

#include "host/estimate/crest.h"
#include "host/estimate/interpolate.h"
#include "host/estimate/limits.h"

/* The first local maximum is looked for above this part of the largest. */
#define FIRST_LEVEL 0.5

/* The axes' own models are of the resultant's pulse when its largest sample lies no further from between
 * their peaks than this part of its width, and two curves or families lie no further apart. */
#define SAME_PULSE 0.3

/* Instants tried between the peaks of the axes, and Newton's steps from the best. */
enum { STEPS = 8, NEWTON = 8 };

/* Magnitude at a sample of axis i, the other axis interpolated; false where either is missing. Good enough
 * to know where to look. */
static bool resultant_magnitude(const struct resultant_axes *axes, unsigned i, size_t k, double *value_g)
{
	double value = axes->trace[i]->value_g[k], other;

	if (!trace_good(axes->trace[i], k) ||
	    !trace_at(axes->trace[1 - i], trace_time(axes->trace[i], k), &other))
		return false;
	*value_g = sqrt(value * value + other * other);
	return true;
}

/* The time from the first to the last sample of either axis that reaches level_g within the event. */
static struct local_span reaching(const struct resultant_axes *axes, double level_g)
{
	struct local_span span = {INFINITY, -INFINITY};

	for (unsigned i = 0; i < 2; i++) {
		const struct trace *trace = axes->trace[i];
		size_t k = trace_reaches(trace, trace->first, trace->last, level_g), end = trace->last;

		if (k == end)
			continue;
		while (trace_most(trace, end - 1) < level_g)
			end = (end - 1) / TRACE_BLOCK * TRACE_BLOCK;
		while (!(fabs(trace->value_g[end - 1]) >= level_g && trace_good(trace, end - 1)))
			end--;
		span.from_s = fmin(span.from_s, trace_time(trace, k));
		span.until_s = fmax(span.until_s, trace_time(trace, end - 1));
	}
	return span;
}

/* The instants of the faster axis; count when there is none that has both axes. One of the axes must reach
 * the stronger one's peak over the square root of two there. */
static size_t resultant_largest(const struct resultant_axes *axes, unsigned i, double strong_g,
                                double *value_g)
{
	const struct trace *trace = axes->trace[i];
	struct local_span span = reaching(axes, 0.99 * strong_g / sqrt(2.0));
	size_t at = trace->count;
	double value, step = 1 / trace->rate_hz;

	*value_g = 0;
	for (size_t k = trace_index(trace, span.from_s - step);
	     k < trace->last && trace_time(trace, k) <= span.until_s + step; k++) {
		if (resultant_magnitude(axes, i, k, &value) && value > *value_g) {
			*value_g = value;
			at = k;
		}
	}
	return at;
}

/* The first local maximum above half of the largest one, by its instant of the faster axis. It is one once
 * the resultant has come down from it: by less, that is noise on a flank. */
static size_t first_local(const struct resultant_axes *axes, unsigned i, size_t largest_at, double largest_g)
{
	double noise = fmax(axes->trace[0]->noise_g, axes->trace[1]->noise_g);
	double fall = fmax(LIMIT_EDGE * largest_g, noise > 0 ? LIMIT_NOISE * noise : 0), top = 0, value;
	struct local_span span = reaching(axes, FIRST_LEVEL * largest_g / sqrt(2.0));
	size_t at = largest_at;

	for (size_t k = trace_index(axes->trace[i], span.from_s); k < largest_at; k++) {
		if (!resultant_magnitude(axes, i, k, &value))
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
	trace_edge(trace, k, -1, sign, PEAK_FOOT_LEVEL * fabs(trace->value_g[k]), &span.from_s);
	trace_edge(trace, k, 1, sign, PEAK_FOOT_LEVEL * fabs(trace->value_g[k]), &span.until_s);
	return span;
}

static bool resultant_usable(const struct peak *peak)
{
	return peak->result.how.status != ESTIMATE_SHORT && peak->result.how.status != ESTIMATE_NO_PEAK;
}

/* As peak_at, by what gave the axis' peak. */
static bool model_at(const struct resultant_axes *axes, unsigned i, double time_s, double derivative[3],
                     double variance[2])
{
	if (axes->curve[i] == NULL)
		return peak_at(axes->peak[i], time_s, derivative, variance);
	driven_at(axes->curve[i], time_s, derivative, variance);
	return true;
}

/* Half of the square's value, slope and curvature at an instant, by the axes' own models. */
static bool resultant_square_at(const struct resultant_axes *axes, double time_s, double half[3])
{
	half[0] = half[1] = half[2] = 0;
	for (unsigned i = 0; i < 2; i++) {
		double d[3];

		if (!model_at(axes, i, time_s, d, NULL))
			return false;
		half[0] += d[0] * d[0] / 2;
		half[1] += d[0] * d[1];
		half[2] += d[1] * d[1] + d[0] * d[2];
	}
	return true;
}

/* The highest instant between the peaks of the axes. */
static bool resultant_summit(const struct resultant_axes *axes, double *time_s, double half[3])
{
	double x = axes->peak[0]->result.time_s, y = axes->peak[1]->result.time_s, best = -1;
	double slack = fabs(y - x) / STEPS + 1e-7;

	*time_s = x;
	for (int i = 0; i <= STEPS; i++) {
		double time = x + (y - x) * i / STEPS;

		if (!resultant_square_at(axes, time, half))
			return false;
		if (half[0] > best) {
			best = half[0];
			*time_s = time;
		}
	}
	for (int i = 0; i < NEWTON; i++) {
		double step;

		if (!resultant_square_at(axes, *time_s, half) || !(half[2] < 0))
			return false;
		step = half[1] / half[2];
		*time_s -= step;
		if (fabs(step) < LIMIT_ROUNDING)
			break;
	}
	return *time_s >= fmin(x, y) - slack && *time_s <= fmax(x, y) + slack;
}

/* Noise through the models, as in crest.h, and what the axes' own uncertainties hold beyond it, the models'
 * error, which two axes of one shape have alike. Variances of half the square's value, of its slope, and of
 * its slope by noise alone. */
static void resultant_spread(const struct resultant_axes *axes, double time_s, double variance[3])
{
	double model[2] = {0, 0};

	variance[0] = variance[1] = 0;
	for (unsigned i = 0; i < 2; i++) {
		const struct estimate_peak *own = &axes->peak[i]->result;
		double d[3], noise[2], top[3], top_noise[2], beyond;

		if (!model_at(axes, i, time_s, d, noise) || !model_at(axes, i, own->time_s, top, top_noise))
			continue;
		variance[0] += d[0] * d[0] * noise[0];
		variance[1] += d[0] * d[0] * noise[1] + d[1] * d[1] * noise[0];
		beyond = own->sigma_g * own->sigma_g - top_noise[0];
		model[0] += fabs(d[0]) * sqrt(fmax(beyond, 0));
		beyond = pow(own->sigma_time_s * top[2], 2) - top_noise[1];
		model[1] += fabs(d[0]) * sqrt(fmax(beyond, 0));
	}
	variance[2] = variance[1];
	variance[0] += model[0] * model[0];
	variance[1] += model[1] * model[1];
}

/* Models of different swings or pulses say nothing together; a polynomial does not reach that far, a curve
 * and a family do. */
static bool resultant_reach(const struct resultant_axes *axes, double width_s)
{
	double apart = fabs(axes->peak[1]->result.time_s - axes->peak[0]->result.time_s);

	for (unsigned i = 0; i < 2; i++)
		if ((axes->curve[i] != NULL || axes->peak[i]->model == PEAK_MODEL_SHAPE) &&
		    apart > SAME_PULSE * width_s)
			return false;
	return true;
}

/* By the axes' own models. False when they are not of the pulse whose largest sample is at near_s. */
static bool resultant_combine(const struct resultant_axes *axes, unsigned strong, double near_s,
                              struct resultant *found)
{
	const struct peak *lead = axes->peak[strong];
	struct estimate_resultant *result = &found->result;
	double x = axes->peak[0]->result.time_s, y = axes->peak[1]->result.time_s;
	double slack = SAME_PULSE * found->width_s, time, half[3], variance[3];

	if (!(near_s >= fmin(x, y) - slack && near_s <= fmax(x, y) + slack) ||
	    !resultant_reach(axes, found->width_s) || !resultant_summit(axes, &time, half))
		return false;
	resultant_spread(axes, time, variance);
	result->how.method = lead->result.how.method;
	result->how.chi_square = lead->result.how.chi_square;
	result->peak_g = sqrt(2 * half[0]);
	result->sigma_g = sqrt(variance[0]) / result->peak_g;
	result->time_s = time;
	result->sigma_time_s = sqrt(variance[1]) / fabs(half[2]);
	/* As in crest.h: a polynomial's maximum over noise is too high by what its wandering gains. */
	if (lead->model == PEAK_MODEL_LOCAL && axes->curve[strong] == NULL)
		result->peak_g -= variance[2] / (2 * fabs(half[2]) * result->peak_g);
	return true;
}

/* Around the largest sample, whatever the axes' own peaks are. */
static bool refit(const struct resultant_axes *axes, double near_s, struct resultant *found)
{
	struct crest crest;

	if (!crest_fit(&crest, axes->trace, 2, near_s, found->width_s, &found->span))
		return false;
	found->result.peak_g = crest.value_g;
	found->result.sigma_g = crest.sigma_g;
	found->result.time_s = crest.time_s;
	found->result.sigma_time_s = crest.sigma_time_s;
	found->result.how.chi_square = crest.chi_square;
	found->result.how.method = "poly4/poly6";
	return true;
}

static bool silent(const struct peak *peak)
{
	return peak->result.how.status == ESTIMATE_NO_PEAK;
}

/* Whether the stronger axis' own peak tells more than samples of both: the other one has none, or samples are
 * at a limit, which that peak sees beyond. */
static bool leads(const struct resultant_axes *axes, unsigned strong)
{
	return silent(axes->peak[1 - strong]) || axes->peak[strong]->result.how.status == ESTIMATE_CLIPPED;
}

/* The stronger axis' own peak, and what the other one has then. */
static void add_to(const struct estimate_peak *lead, double other_g, double sigma_g, struct resultant *found)
{
	struct estimate_resultant *result = &found->result;

	result->peak_g = hypot(lead->value_g, other_g);
	result->sigma_g = hypot(lead->value_g * lead->sigma_g, other_g * sigma_g) / result->peak_g;
	result->time_s = lead->time_s;
	result->sigma_time_s = lead->sigma_time_s;
	result->how.chi_square = lead->how.chi_square;
	result->how.method = lead->how.method;
}

/* A weak axis has the stronger one's shape, so that both peak at once. */
static bool share(const struct resultant_axes *axes, unsigned strong, struct resultant *found)
{
	const struct estimate_peak *lead = &axes->peak[strong]->result,
	                           *weak = &axes->peak[1 - strong]->result;

	if (!(weak->how.flags & ESTIMATE_FLAG_WEAK) ||
	    fabs(weak->time_s - lead->time_s) > SAME_PULSE * found->width_s)
		return false;
	add_to(lead, weak->value_g, weak->sigma_g, found);
	return true;
}

/* Whether most of the samples within are there: a hole is not silence. */
static bool was_read(const struct trace *trace, const struct local_span *span)
{
	double good = 0;

	for (size_t k = trace_index(trace, span->from_s);
	     k < trace->count && trace_time(trace, k) <= span->until_s; k++)
		good += trace_good(trace, k);
	return 2 * good > (span->until_s - span->from_s) * trace->rate_hz;
}

/* What the other axis reads counts unless it is silent. False where its samples are missing. */
static bool resultant_follow(const struct resultant_axes *axes, unsigned strong, struct resultant *found)
{
	const struct estimate_peak *lead = &axes->peak[strong]->result;
	const struct trace *other = axes->trace[1 - strong];

	found->span = span_around(axes, strong, lead->time_s);
	if (!was_read(other, &found->span))
		return false;
	add_to(lead, silent(axes->peak[1 - strong]) ? 0 : interpolate_at(other, lead->time_s),
	       fmax(other->noise_g, 0), found);
	return true;
}

/* near_s: the largest sample. */
static bool resultant_solve(const struct resultant_axes *axes, unsigned strong, double near_s,
                            struct resultant *found)
{
	bool two = resultant_usable(axes->peak[0]) && resultant_usable(axes->peak[1]);

	if (two && (share(axes, strong, found) || resultant_combine(axes, strong, near_s, found)))
		return true;
	if (leads(axes, strong) ? resultant_follow(axes, strong, found) : refit(axes, near_s, found))
		return true;
	return two && resultant_combine(axes, strong, axes->peak[strong]->result.time_s, found);
}

/* X and Y against each other, and what a hole or a limit under the pulse does to the resultant. */
static void compare_axes(const struct resultant_axes *axes, unsigned strong, struct resultant *found)
{
	const struct peak *x = axes->peak[0], *y = axes->peak[1];
	enum estimate_status status = axes->peak[strong]->result.how.status;

	if (resultant_usable(x) && resultant_usable(y)) {
		found->result.axes_apart_s = y->result.time_s - x->result.time_s;
		found->result.axes_coincide = fabs(found->result.axes_apart_s) <= RESULTANT_COINCIDE_S;
	}
	if (status == ESTIMATE_OK && resultant_usable(axes->peak[1 - strong]))
		status = axes->peak[1 - strong]->result.how.status;
	if (trace_any(axes->trace[0], found->span.from_s, found->span.until_s, SAMPLE_CLIPPED) ||
	    trace_any(axes->trace[1], found->span.from_s, found->span.until_s, SAMPLE_CLIPPED))
		status = ESTIMATE_CLIPPED;
	found->result.how.status = status;
}

static bool meets(const struct resultant_axes *axes, const struct resultant *found)
{
	return estimate_meets(found->result.sigma_g, found->result.peak_g, axes->tolerance) &&
	       estimate_meets(found->result.sigma_time_s, found->width_s, axes->tolerance);
}

static void take_flags(const struct resultant_axes *axes, struct resultant *found)
{
	unsigned *flags = &found->result.how.flags;

	for (unsigned i = 0; i < 2; i++)
		if (resultant_usable(axes->peak[i]))
			*flags |= axes->peak[i]->result.how.flags;
	if (!meets(axes, found))
		*flags |= ESTIMATE_FLAG_TOLERANCE;
}

static void find_first(const struct resultant_axes *axes, unsigned fast, unsigned strong, size_t at,
                       double top, struct resultant *found)
{
	struct local_span span;
	struct crest crest;
	size_t first;

	found->first_peak_s = found->result.time_s;
	if (at == axes->trace[fast]->count)
		return;
	first = first_local(axes, fast, at, top);
	if (first == at)
		return;
	found->first_peak_s = trace_time(axes->trace[fast], first);
	span = span_around(axes, strong, found->first_peak_s);
	if (crest_fit(&crest, axes->trace, 2, found->first_peak_s, found->width_s, &span))
		found->first_peak_s = crest.time_s;
}

void resultant_find(const struct resultant_axes *axes, struct resultant *resultant)
{
	const struct peak *x = axes->peak[0], *y = axes->peak[1];
	unsigned strong = !resultant_usable(x) ||
	                  (resultant_usable(y) && fabs(y->result.value_g) > fabs(x->result.value_g));
	unsigned fast = axes->trace[1]->rate_hz > axes->trace[0]->rate_hz;
	const struct peak *lead = axes->peak[strong];
	struct resultant found = {.result = {.peak_g = NAN,
	                                     .sigma_g = NAN,
	                                     .time_s = NAN,
	                                     .sigma_time_s = NAN,
	                                     .axes_apart_s = NAN,
	                                     .how = {.method = "", .chi_square = NAN}},
	                          .first_peak_s = NAN};
	double top, near;
	size_t at;

	found.result.how.status = lead->result.how.status;
	*resultant = found;
	if (!resultant_usable(lead))
		return;
	resultant->result.how.status = ESTIMATE_SHORT;
	found.width_s = lead->width_s;
	at = resultant_largest(axes, fast, fabs(axes->trace[strong]->value_g[lead->at]), &top);
	/* Where no instant has both axes, their models may meet all the same; a curve knows its own pulse. */
	near = at < axes->trace[fast]->count && axes->curve[strong] == NULL
	               ? trace_time(axes->trace[fast], at)
	               : lead->result.time_s;
	found.span = span_around(axes, strong, near);
	if (!resultant_solve(axes, strong, near, &found))
		return;
	found.result.how.path[0] = found.result.how.method;
	find_first(axes, fast, strong, at, top, &found);
	compare_axes(axes, strong, &found);
	take_flags(axes, &found);
	*resultant = found;
}
