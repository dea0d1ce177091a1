/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/peak_private.h"

#include <math.h>

#include "host/estimate/limits.h"

bool peak_is_weak(const struct trace *trace, const struct peak *peak)
{
	if (peak->result.how.status == ESTIMATE_NO_PEAK)
		return true;
	return (peak->result.how.status == ESTIMATE_OK || peak->result.how.status == ESTIMATE_AMBIGUOUS) &&
	       fabs(trace->value_g[peak->at]) < PEAK_WEAK_SIGMAS * trace->noise_g;
}

/* Sums of one amplitude: the strong axis' samples, between them by straight lines, as the shape. */
struct amplitude {
	double value, sigma; /* by unit height of the shape */
	double chi_square;
};

static bool fit_amplitude(const struct trace *trace, const struct trace *strong_trace,
                          const struct peak *strong, struct amplitude *amplitude)
{
	double square = 0, product = 0, squares = 0, shape;
	unsigned used = 0;

	for (size_t k = trace_index(trace, strong->span.from_s);
	     k < trace->count && trace_time(trace, k) <= strong->span.until_s; k++) {
		if (!trace_good(trace, k) || !trace_at(strong_trace, trace_time(trace, k), &shape))
			continue;
		shape /= strong->result.value_g;
		square += shape * shape;
		product += shape * trace->value_g[k];
		squares += trace->value_g[k] * trace->value_g[k];
		used++;
	}
	if (used < 3 || !(square > 0))
		return false;
	amplitude->value = product / square;
	amplitude->sigma = trace->noise_g / sqrt(square);
	amplitude->chi_square =
	        (squares - product * amplitude->value) / ((used - 1) * trace->noise_g * trace->noise_g);
	return !(amplitude->chi_square > 1 + LIMIT_CHI * sqrt(2.0 / (used - 1)));
}

bool peak_weak(const struct trace *trace, const struct trace *strong_trace, const struct peak *strong,
               struct peak *peak)
{
	const struct estimate_peak *from = &strong->result;
	struct estimate_peak result = {
	        .time_s = from->time_s,
	        .sigma_time_s = from->sigma_time_s,
	        .how = {.method = "strong-axis", .flags = ESTIMATE_FLAG_WEAK | from->how.flags}};
	struct amplitude amplitude;

	if (from->how.status != ESTIMATE_OK || strong->model == PEAK_MODEL_NONE || !(trace->noise_g > 0) ||
	    fabs(from->value_g) < LIMIT_OVER * PEAK_WEAK_SIGMAS * trace->noise_g ||
	    !fit_amplitude(trace, strong_trace, strong, &amplitude) ||
	    /* Chance has one number to get there, not as many as there are samples. */
	    fabs(amplitude.value) < LIMIT_AGREE * amplitude.sigma)
		return false;
	result.value_g = amplitude.value;
	result.sigma_g = amplitude.sigma;
	result.how.chi_square = amplitude.chi_square;
	result.how.flags |= peak->result.how.flags & (ESTIMATE_FLAG_GAPS | ESTIMATE_FLAG_SPIKE);
	for (int i = 0; i < ESTIMATE_PATH_MAX; i++)
		result.how.path[i] = peak->result.how.path[i];
	peak_tried(&result.how, result.how.method);
	*peak = *strong;
	peak->result = result;
	peak->at = trace_index(trace, from->time_s);
	if (peak->at == trace->count)
		peak->at--;
	peak->sign = amplitude.value < 0 ? -1 : 1;
	peak->scale = amplitude.value / from->value_g;
	return true;
}

void peak_weak_time(const struct peak *strong, struct peak *peak)
{
	peak->result.time_s = strong->result.time_s;
	peak->result.sigma_time_s = strong->result.sigma_time_s;
}
