/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/peak_private.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/crest.h"
#include "host/estimate/limits.h"

/* A hole at the summit wider than this part of the width may hide more than the fit can know. */
#define HOLE_MAX 0.35

/* A pulse whose middles at half and at a tenth of its height lie further apart than this part of its width,
 * and LIMIT_HINT times the noise's part of its height, is no symmetric one. */
#define SKEW_MAX 0.06

/* A top that stands aside of the middle at half its height by this part of what it is wide there is flatter
 * on one side than a polynomial tells: saw-tooths of 0.25 to 0.75 have 0.25 and are 0.02 of a width off; an
 * impact has LIMIT_SLIGHT. */
#define ASIDE_WHOLE 0.18
#define ASIDE_TIME 0.02

/* A top this wide at nine tenths of its height, in parts of what it is wide at half, is flat: a half-sine has
 * 0.43, a trapezoid more than 0.6. Its highest instant is anywhere on it. */
#define FLAT 0.6

/* A crest this much sharper than a half-sine as wide may be a hump. */
#define SHARP 1.5

/* A plate's top is bent by what the case does under it: of the width, so much is one smooth curve. */
#define BENT 0.55

/* A half-sine is two thirds of its base wide at half height. */
#define BASE_PER_HALF_WIDTH 1.5

/* From so many sigma of the polynomials on, what their time differs by from a symmetric family's is its
 * doubt. */
#define LEAN_SIGMAS 1.5

/* What no polynomial follows has a top that three samples tell to this part of a sample. */
#define SHIFT_MIN 0.35

enum {
	SAMPLES_MIN = 3,
	END = 4, /* so many samples at an end of the trace, and so narrow, a spike may pass for a peak */
};

void peak_tried(struct estimate_how *how, const char *name)
{
	for (int i = 0; i < ESTIMATE_PATH_MAX; i++) {
		if (how->path[i] && strcmp(how->path[i], name) != 0)
			continue;
		how->path[i] = name;
		return;
	}
}

/* The largest good sample; count unless there are three to look at. */
static size_t highest(const struct trace *trace)
{
	size_t at = trace->count, good = 0;
	double most = -1;

	for (size_t k = trace->first; k < trace->last && good < SAMPLES_MIN; k++)
		good += trace_good(trace, k);
	for (size_t k = trace->first; k < trace->last; k++) {
		double value;

		if (!(trace_most(trace, k) > most)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		value = fabs(trace->value_g[k]);
		if (value > most && trace_good(trace, k)) {
			most = value;
			at = k;
		}
	}
	return good < SAMPLES_MIN ? trace->count : at;
}

/* Goes below zero by a tenth of its height and more than noise. */
static bool swings_back(const struct trace *trace, const struct peak *peak, double from_s, double until_s)
{
	double level = LIMIT_EDGE * fabs(trace->value_g[peak->at]) + LIMIT_NOISE * trace->noise_g;

	for (size_t k = trace_index(trace, from_s), end = trace_index(trace, until_s); k < end; k++)
		if (trace_good(trace, k) && peak->sign * trace->value_g[k] < -level)
			return true;
	return false;
}

/* Nobody can tell where an edge lies in a hole: then it is not. */
static bool is_lopsided(const struct trace *trace, const struct peak *peak)
{
	double value = fabs(trace->value_g[peak->at]), from, until;

	if (!trace_edge(trace, peak->at, -1, peak->sign, LIMIT_EDGE * value, &from) ||
	    !trace_edge(trace, peak->at, 1, peak->sign, LIMIT_EDGE * value, &until) ||
	    trace_any(trace, from, until, SAMPLE_LOST | SAMPLE_BAD | SAMPLE_SPIKE))
		return false;
	return swings_back(trace, peak, until, until + (until - from) / 2) ||
	       fabs((until + from) / 2 - peak->start.peak_s) >
	               (SKEW_MAX + LIMIT_HINT * trace->noise_g / value) * (until - from);
}

/* Half width and feet around the highest sample. A side cut off by the end of the trace is taken as wide
 * as the other one. */
static bool measure_width(const struct trace *trace, struct peak *peak)
{
	double value = fabs(trace->value_g[peak->at]), time = trace_time(trace, peak->at);
	double left, right;
	bool has_left = trace_edge(trace, peak->at, -1, peak->sign, value / 2, &left);
	bool has_right = trace_edge(trace, peak->at, 1, peak->sign, value / 2, &right);

	if (!has_left && !has_right)
		return false;
	left = time - left;
	right = right - time;
	if (!has_left)
		left = right;
	if (!has_right)
		right = left;
	peak->width_s = BASE_PER_HALF_WIDTH * (left + right);
	peak->start = (struct shape_start){trace->value_g[peak->at], time + (right - left) / 2, left + right,
	                                   INFINITY, -INFINITY};
	trace_edge(trace, peak->at, -1, peak->sign, PEAK_FOOT_LEVEL * value, &peak->span.from_s);
	trace_edge(trace, peak->at, 1, peak->sign, PEAK_FOOT_LEVEL * value, &peak->span.until_s);
	peak->lopsided = has_left && has_right && is_lopsided(trace, peak);
	return true;
}

/* Time from the last good sample before time_s to the first one after it; INFINITY at the trace's ends. */
static double hole(const struct trace *trace, double time_s)
{
	size_t after = trace_index(trace, time_s), before = after;

	while (after < trace->count && !trace_good(trace, after))
		after++;
	while (before > 0 && !trace_good(trace, before - 1))
		before--;
	if (before == 0 || after == trace->count)
		return INFINITY;
	return (double)(after - before + 1) / trace->rate_hz;
}

/* The raw sample; it stands at a hole, or at an end of the trace. */
static void peak_take_sample(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *result = &peak->result;
	size_t k = peak->at;

	result->how.method = "sample";
	result->value_g = trace->value_g[k];
	result->time_s = trace_time(trace, k);
	result->sigma_g = NAN;
	result->sigma_time_s = 1 / trace->rate_hz;
	result->how.status = ESTIMATE_AMBIGUOUS;
}

/* The parabola through the highest sample and its neighbours: its top is shift samples later and rise
 * higher. False where it has none there. */
static bool peak_parabola(const struct trace *trace, const struct peak *peak, double *shift, double *rise,
                          double *bend)
{
	size_t k = peak->at;
	double before, after;

	if (k == 0 || k + 1 >= trace->count || !trace_good(trace, k - 1) || !trace_good(trace, k + 1))
		return false;
	before = trace->value_g[k - 1];
	after = trace->value_g[k + 1];
	*bend = before - 2 * trace->value_g[k] + after;
	if (!(peak->sign * *bend < 0))
		return false;
	*shift = (before - after) / (2 * *bend);
	*rise = (before - after) * *shift / -4;
	return fabs(*shift) <= 1;
}

/* How sharp the top of a half-sine as wide is, per s^2. */
static double half_sine_bend(const struct peak *peak)
{
	return fabs(peak->result.value_g) * pow(UNITS_PI / peak->width_s, 2);
}

static bool take_parabola(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *result = &peak->result;
	double shift, rise, bend, bent, late;

	if (!peak_parabola(trace, peak, &shift, &rise, &bend))
		return false;
	result->how.method = "parabola";
	result->value_g = trace->value_g[peak->at] + rise;
	bent = fmin(fabs(bend), SHARP * half_sine_bend(peak) / (trace->rate_hz * trace->rate_hz));
	late = hypot(trace->noise_g / (sqrt(2.0) * bent), shift / 2);
	result->time_s = trace_time(trace, peak->at) + shift / trace->rate_hz;
	result->sigma_g = hypot(trace->noise_g, fmax(fabs(rise), fabs(bend) / 8));
	result->sigma_time_s = (late < SHIFT_MIN ? SHIFT_MIN : late) / trace->rate_hz;
	return true;
}

/* How ill the time is told of a crest that no polynomial follows: far from the middle of the pulse, on a flat
 * top, or on a hump that noise or a ripple may have lifted. */
static double crest_doubt(const struct trace *trace, const struct peak *peak, const struct crest *crest)
{
	double half_s = peak->start.half_width_s, level = (1 - LIMIT_EDGE) * fabs(trace->value_g[peak->at]);
	double aside = fabs(crest->time_s - peak->start.peak_s) / half_s - LIMIT_SLIGHT;
	double doubt_s = ASIDE_TIME * peak->width_s * fmin(fmax(aside / (ASIDE_WHOLE - LIMIT_SLIGHT), 0), 1);
	double noise = pow(crest->sigma_time_s, 2) - pow(crest->model_s, 2), from, until, d[3], sharper;

	if (trace_edge(trace, peak->at, -1, peak->sign, level, &from) &&
	    trace_edge(trace, peak->at, 1, peak->sign, level, &until) && until - from > FLAT * half_s)
		doubt_s = fmax(doubt_s, LIMIT_SLIGHT * (until - from));
	local_at(&crest->axis[0], crest->time_s, d);
	sharper = fabs(d[2]) / (SHARP * half_sine_bend(peak));
	return sharper > 1 ? hypot(doubt_s, sqrt(fmax(noise, 0)) * sharper) : doubt_s;
}

static bool take_crest(const struct trace *trace, double width_s, struct peak *peak)
{
	const struct trace *axes[1] = {trace};
	struct estimate_peak *result = &peak->result;
	double near = trace_time(trace, peak->at), shift, rise, bend;
	struct crest crest;

	peak_tried(&result->how, "poly4/poly6");
	if (peak_parabola(trace, peak, &shift, &rise, &bend))
		near += shift / trace->rate_hz;
	if (!crest_fit(&crest, axes, 1, near, width_s, &peak->span))
		return false;
	result->how.method = "poly4/poly6";
	result->how.chi_square = crest.chi_square;
	result->value_g = peak->sign * crest.value_g;
	result->sigma_g = crest.sigma_g;
	result->time_s = crest.time_s;
	peak->doubt_s = crest_doubt(trace, peak, &crest);
	result->sigma_time_s = hypot(crest.sigma_time_s, peak->doubt_s);
	peak->doubt_s = hypot(peak->doubt_s, crest.model_s);
	peak->model = PEAK_MODEL_LOCAL;
	peak->local = crest.axis[0];
	peak->noise_g = crest_noise(&peak->local, trace);
	if (hole(trace, crest.time_s) > fmax(HOLE_MAX * peak->width_s, 1.5 / trace->rate_hz))
		result->how.status = ESTIMATE_AMBIGUOUS;
	return true;
}

/* A value without any model: it says so in its uncertainty. */
static void peak_take_samples(const struct trace *trace, struct peak *peak)
{
	struct estimate_how *how = &peak->result.how;

	if (!take_parabola(trace, peak))
		peak_take_sample(trace, peak);
	peak_tried(how, how->method);
}

bool peak_fit(const struct trace *trace, enum estimate_family family, struct peak *peak)
{
	if (peak->shape.family == family)
		return true;
	if (peak->half_sine.family == family) {
		peak->shape = peak->half_sine;
		return true;
	}
	peak_tried(&peak->result.how, estimate_family_name(family));
	if (!shape_fit(&peak->shape, trace, family, &peak->start))
		return false;
	if (family == ESTIMATE_FAMILY_HALF_SINE)
		peak->half_sine = peak->shape;
	return true;
}

void peak_take_shape(struct peak *peak)
{
	struct estimate_peak *result = &peak->result;

	result->how.method = estimate_family_name(peak->shape.family);
	result->how.chi_square = peak->shape.chi_square;
	result->value_g = peak->shape.peak_g;
	result->sigma_g = peak->shape.sigma_peak_g;
	result->time_s = peak->shape.peak_s;
	result->sigma_time_s = peak->shape.sigma_peak_s;
	peak->doubt_s = 0;
	peak->model = PEAK_MODEL_SHAPE;
}

static bool peak_meets(const struct peak *peak, const struct estimate_options *options)
{
	return estimate_meets(peak->result.sigma_g, peak->result.value_g, options->tolerance) &&
	       estimate_meets(peak->result.sigma_time_s, peak->width_s, options->tolerance);
}

/* Sine-power in place of the polynomials, if nothing speaks against it. */
static void sharpen(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak local = peak->result;
	double apart_g, apart_s, sigma_g;

	/* Both are enough to see that no symmetric family will do. */
	if (peak->lopsided ||
	    (peak_fit(trace, ESTIMATE_FAMILY_HALF_SINE, peak) && shape_hopeless(&peak->shape)))
		return;
	if (!peak_fit(trace, ESTIMATE_FAMILY_SINE_POWER, peak)) {
		peak->shape.family = ESTIMATE_FAMILY_AUTO;
		return;
	}
	apart_g = fabs(peak->shape.peak_g - local.value_g);
	apart_s = fabs(peak->shape.peak_s - local.time_s);
	sigma_g = hypot(peak->shape.sigma_peak_g, LIMIT_UNSEEN * local.value_g);
	if (shape_judge(&peak->shape) != SHAPE_FITS || isnan(peak->shape.chi_square) ||
	    apart_g > LIMIT_SIGNIFICANT * local.sigma_g || apart_s > LIMIT_SIGNIFICANT * local.sigma_time_s ||
	    sigma_g > local.sigma_g)
		return;
	peak->plain = local;
	peak_take_shape(peak);
	peak->result.sigma_g = hypot(sigma_g, apart_g / 2);
	/* A symmetric family knows nothing of a lean. */
	if (apart_s > LEAN_SIGMAS * local.sigma_time_s)
		peak->result.sigma_time_s = hypot(peak->result.sigma_time_s, apart_s);
}

/* Without polynomials: a hole over the summit, and a family that reaches across. It stays ambiguous. */
static void reach_across(const struct trace *trace, struct peak *peak)
{
	double sample = fabs(trace->value_g[peak->at]);

	if ((peak_fit(trace, ESTIMATE_FAMILY_HALF_SINE, peak) && shape_hopeless(&peak->shape)) ||
	    !peak_fit(trace, ESTIMATE_FAMILY_SINE_POWER, peak) || shape_judge(&peak->shape) != SHAPE_FITS)
		return;
	peak_take_shape(peak);
	peak->result.sigma_g = hypot(peak->result.sigma_g, LIMIT_KNOWN * (fabs(peak->shape.peak_g) - sample));
}

/* The family that is given; half of what is there without it differs by enters its uncertainty. */
static void take_doubtful(struct peak *peak)
{
	struct estimate_peak *result = &peak->result, plain = *result;

	peak_take_shape(peak);
	result->sigma_g = hypot(result->sigma_g, (result->value_g - plain.value_g) / 2);
	result->sigma_time_s = hypot(result->sigma_time_s, (result->time_s - plain.time_s) / 2);
}

/* Without polynomials. */
static void climb_samples(const struct trace *trace, enum shape_verdict verdict, struct peak *peak)
{
	struct estimate_how *how = &peak->result.how;

	peak_take_samples(trace, peak);
	if (verdict == SHAPE_DOUBTFUL)
		take_doubtful(peak);
	else if (how->status == ESTIMATE_AMBIGUOUS && how->flags & ESTIMATE_FLAG_GAPS)
		reach_across(trace, peak);
}

/* The family that is given, or the ladder. */
void peak_climb(const struct trace *trace, const struct estimate_options *options, struct peak *peak)
{
	struct estimate_how *how = &peak->result.how;
	enum shape_verdict verdict = SHAPE_REFUSED;

	if (options->family != ESTIMATE_FAMILY_AUTO) {
		if (peak_fit(trace, options->family, peak))
			verdict = shape_judge(&peak->shape);
		if (verdict == SHAPE_FITS) {
			peak_take_shape(peak);
			return;
		}
		how->flags |= ESTIMATE_FLAG_MODEL;
	}
	if (!take_crest(trace, peak->width_s, peak))
		climb_samples(trace, verdict, peak);
	else if (verdict == SHAPE_DOUBTFUL)
		take_doubtful(peak);
	else if ((how->status == ESTIMATE_AMBIGUOUS || !peak_meets(peak, options)) &&
	         options->family != ESTIMATE_FAMILY_SINE_POWER)
		sharpen(trace, peak);
}

/* Whether another pulse of the event is as high: sampling and noise then decided which one was taken. */
static bool has_rival(const struct trace *trace, const struct peak *peak)
{
	double noise = trace->noise_g > 0 ? trace->noise_g : 0, height = fabs(trace->value_g[peak->at]);
	double level = (1 - LIMIT_PART) * height - LIMIT_AGREE * noise;
	size_t from = trace_index(trace, peak->span.from_s), until = trace_index(trace, peak->span.until_s);

	return (trace->first < from && trace_reaches(trace, trace->first, from, level) < from) ||
	       (until < trace->last && trace_reaches(trace, until, trace->last, level) < trace->last);
}

/* Whether it may be a spike that is too near an end to be found out (spike.h), whatever fits it. */
static bool may_be_spike(const struct trace *trace, const struct peak *peak)
{
	return (peak->at < END || peak->at + END >= trace->count) &&
	       (peak->model == PEAK_MODEL_NONE || peak->start.half_width_s * trace->rate_hz < END);
}

void peak_find(const struct trace *trace, const struct estimate_options *options, struct peak *peak)
{
	double height;

	*peak = (struct peak){
	        .result = {NAN, NAN, NAN, NAN, {.method = "", .chi_square = NAN, .status = ESTIMATE_SHORT}},
	        .at = highest(trace),
	        .scale = 1};
	if (peak->at == trace->count)
		return;
	peak->sign = trace->value_g[peak->at] < 0 ? -1 : 1;
	height = fabs(trace->value_g[peak->at]);
	if (!(height > 0) || height < LIMIT_SIGNIFICANT * trace->noise_g) {
		peak->result.how.status = ESTIMATE_NO_PEAK;
		return;
	}
	if (!measure_width(trace, peak))
		return;
	peak->result.how.status = ESTIMATE_OK;
	if (trace_any(trace, peak->span.from_s, peak->span.until_s, SAMPLE_LOST | SAMPLE_BAD))
		peak->result.how.flags |= ESTIMATE_FLAG_GAPS;
	if (trace->flags & RECORD_FLAG_SPIKE &&
	    trace_any(trace, peak->span.from_s, peak->span.until_s, SAMPLE_SPIKE))
		peak->result.how.flags |= ESTIMATE_FLAG_SPIKE;
	if (has_rival(trace, peak))
		peak->result.how.flags |= ESTIMATE_FLAG_RIVAL;
	if (!peak_unclip(trace, options, peak))
		peak_climb(trace, options, peak);
	peak_top_doubt(trace, peak);
	if (peak->result.how.status == ESTIMATE_OK && may_be_spike(trace, peak))
		peak->result.how.status = ESTIMATE_AMBIGUOUS;
}

void peak_narrow(const struct trace *trace, struct peak *peak)
{
	if (peak->model != PEAK_MODEL_LOCAL || peak->result.how.status != ESTIMATE_OK ||
	    peak->result.how.flags & ESTIMATE_FLAG_WEAK || !take_crest(trace, BENT * peak->width_s, peak))
		return;
	peak_top_doubt(trace, peak);
}

bool peak_at(const struct peak *peak, double time_s, double derivative[3], double variance[2])
{
	switch (peak->model) {
	case PEAK_MODEL_LOCAL:
		if (fabs(time_s - peak->local.centre_s) > peak->local.half_s)
			return false;
		local_at(&peak->local, time_s, derivative);
		for (unsigned i = 0; variance && i < 2; i++)
			variance[i] = pow(peak->noise_g * local_spread(&peak->local, time_s, i), 2);
		break;
	case PEAK_MODEL_SHAPE:
		shape_at(&peak->shape, time_s, derivative, variance);
		break;
	default:
		return false;
	}
	for (unsigned i = 0; i < 3; i++)
		derivative[i] *= peak->scale;
	if (variance && peak->result.how.flags & ESTIMATE_FLAG_WEAK) {
		double part = peak->result.sigma_g / peak->result.value_g;

		variance[0] = pow(part * derivative[0], 2);
		variance[1] = pow(part * derivative[1], 2);
	}
	return true;
}
