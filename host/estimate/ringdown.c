/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/crossings.h"
#include "host/estimate/limits.h"
#include "host/estimate/ringdown_private.h"
#include "host/estimate/spring.h"

/* Of these the plain decay is not the whole. */
#define RICHER (ESTIMATE_FLAG_TWO_MODES | ESTIMATE_FLAG_AMPLITUDE | ESTIMATE_FLAG_HUM | ESTIMATE_FLAG_MODEL)

enum {
	MEAN_CYCLES = 3,
	MEAN_STEPS = 64,  /* a cycle, for the value */
	SLOPE_STEPS = 24, /* for what it hangs on */
	SAMPLES_MIN = 10,
};

void ringdown_try(struct ringdown_job *job, const char *method)
{
	if (job->tried < ESTIMATE_PATH_MAX)
		job->path[job->tried++] = method;
}

bool ringdown_decays(const struct modes *modes, unsigned m)
{
	double decay = modes->p[MODES_DECAY + MODES_EACH * m], omega = modes->p[MODES_OMEGA + MODES_EACH * m];

	return decay > 0 && decay < MODES_DAMPING_MAX * hypot(decay, omega);
}

/* Of the mode that the values are of. */
static bool estimate_ringdown_decays(const struct modes *modes)
{
	return ringdown_decays(modes, modes_stronger(modes));
}

static enum estimate_status ringdown_judge(const struct ringdown_job *job)
{
	if (ringdown_explained(job) < LIMIT_EXPLAINS || ringdown_gain(job) < LIMIT_SURE * LIMIT_SURE ||
	    modes_swing_g(&job->modes, 0) < LIMIT_FADED * job->span->peak_g)
		return ESTIMATE_NO_PEAK;
	return estimate_ringdown_decays(&job->modes) ? ESTIMATE_OK : ESTIMATE_NOT_CONVERGED;
}

/* From the block fit to whatever the residual needs. */
static void escalate(struct ringdown_job *job)
{
	ringdown_try(job, job->series.block > 1 ? "block" : "full");
	if (ringdown_passes(job, &job->modes))
		return;
	if (job->series.block > 1)
		ringdown_try(job, "full");
	if (!ringdown_full(job) || ringdown_passes(job, &job->modes))
		return;
	ringdown_try_hum(job);
	if (!ringdown_passes(job, &job->modes))
		ringdown_try_richer(job);
}

/* ---- expression ---- */

/* Of the samples, where the series starts. A soft spring pushes less than its deflection says. */
static double start_swing_g(const struct ringdown_job *job, unsigned m)
{
	struct modes samples = job->modes;
	double swing;

	modes_unblock(&samples, &job->series);
	swing = modes_swing_g(&samples, m);
	if (samples.law == MODES_LAW_SPRING)
		swing *= spring_softness(samples.p);
	return swing * exp(samples.p[MODES_DECAY + MODES_EACH * m] *
	                   (job->span->from_s - trace_time(job->trace, job->first)));
}

static double ringdown_spread(const struct ringdown_job *job, unsigned m, double by_decay, double by_omega,
                              double sigma)
{
	double row[CHOLESKY_MAX] = {0};

	row[MODES_DECAY + MODES_EACH * m] = by_decay;
	row[MODES_OMEGA + MODES_EACH * m] = by_omega;
	return hypot(sigma * sqrt(cholesky_variance(&job->modes.fit.factor, row)),
	             hypot(by_decay * job->doubt_decay, by_omega * job->doubt_omega));
}

/* What a law's mean has instead of the vanishing swing's. */
enum { MEAN_HZ, MEAN_NATURAL, MEAN_DAMPING, MEAN_VALUES };

static void mean_values(const struct modes *modes, unsigned steps, double value[MEAN_VALUES])
{
	const double *p = modes->p;

	value[MEAN_HZ] = modes_mean_hz(modes, MEAN_CYCLES, steps);
	value[MEAN_NATURAL] = value[MEAN_HZ] * hypot(1, p[MODES_DECAY] / p[MODES_OMEGA]);
	value[MEAN_DAMPING] = p[MODES_DECAY] / (2 * UNITS_PI * value[MEAN_NATURAL]);
}

/* Of value. The vanishing swing is extrapolated; a mean of cycles that are there is far more certain. */
static void mean_sigmas(const struct ringdown_job *job, double sigma[MEAN_VALUES])
{
	double row[MEAN_VALUES][CHOLESKY_MAX] = {{0}}, point = ringdown_sigma_point(job, &job->modes);
	double value[MEAN_VALUES];

	mean_values(&job->modes, SLOPE_STEPS, value);
	for (unsigned i = MODES_DECAY; i < modes_size(&job->modes); i++) {
		struct modes above = job->modes;
		double high[MEAN_VALUES];
		double step = LIMIT_SMALL * fmax(fabs(job->modes.p[i]), LIMIT_LEAST);

		above.p[i] += step;
		mean_values(&above, SLOPE_STEPS, high);
		for (unsigned v = 0; v < MEAN_VALUES; v++)
			row[v][i] = (high[v] - value[v]) / step;
	}
	for (unsigned v = 0; v < MEAN_VALUES; v++)
		sigma[v] = point * sqrt(cholesky_variance(&job->modes.fit.factor, row[v]));
}

/* A frequency that follows the swing has a value only for a swing: that of the first three cycles, as the
 * study counts them. */
static void express_mean(const struct ringdown_job *job, struct estimate_ringdown *result)
{
	double value[MEAN_VALUES], sigma[MEAN_VALUES];

	mean_values(&job->modes, MEAN_STEPS, value);
	mean_sigmas(job, sigma);
	result->small_swing_hz = result->frequency_hz;
	result->frequency_hz = value[MEAN_HZ];
	result->sigma_hz = sigma[MEAN_HZ];
	result->natural_frequency_hz = value[MEAN_NATURAL];
	result->sigma_natural_hz = sigma[MEAN_NATURAL];
	result->damping_ratio = value[MEAN_DAMPING];
	result->sigma_damping = sigma[MEAN_DAMPING];
}

/* For the other axes: a spring that its residual allows. */
static struct ringdown_law law_of(const struct ringdown_job *job)
{
	const double *p = job->modes.p, swing = modes_swing_g(&job->modes, 0);

	if (job->modes.law != MODES_LAW_SPRING || !ringdown_passes(job, &job->modes))
		return (struct ringdown_law){.found = false};
	return (struct ringdown_law){true, p[MODES_DECAY], p[MODES_OMEGA], p[MODES_LAW] * swing * swing,
	                             p[MODES_LAW + 1]};
}

/* Values and uncertainties of the stronger mode, and the other's values. */
static void ringdown_express(const struct ringdown_job *job, struct ringdown *ringdown)
{
	struct estimate_ringdown *result = &ringdown->result;
	const unsigned m = modes_stronger(&job->modes);
	const double decay = job->modes.p[MODES_DECAY + MODES_EACH * m],
	             omega = job->modes.p[MODES_OMEGA + MODES_EACH * m];
	double natural = hypot(omega, decay), cube = natural * natural * natural;
	double sigma = ringdown_sigma_point(job, &job->modes);

	result->frequency_hz = omega / (2 * UNITS_PI);
	result->sigma_hz = ringdown_spread(job, m, 0, 1, sigma) / (2 * UNITS_PI);
	result->natural_frequency_hz = natural / (2 * UNITS_PI);
	result->sigma_natural_hz =
	        ringdown_spread(job, m, decay / natural, omega / natural, sigma) / (2 * UNITS_PI);
	result->damping_ratio = decay / natural;
	result->sigma_damping = ringdown_spread(job, m, omega * omega / cube, -decay * omega / cube, sigma);
	result->amplitude_g = start_swing_g(job, m);
	if (job->modes.count > 1) {
		const double *other = job->modes.p + (m ? 0 : MODES_EACH);

		result->second_frequency_hz = other[MODES_OMEGA] / (2 * UNITS_PI);
		result->second_damping_ratio =
		        other[MODES_DECAY] / hypot(other[MODES_OMEGA], other[MODES_DECAY]);
	}
	if (job->modes.law != MODES_LAW_NONE)
		express_mean(job, result);
	ringdown->amplitude_g = result->amplitude_g;
	ringdown->offset_g = job->modes.p[MODES_OFFSET];
	ringdown->start_s = trace_time(job->trace, job->first);
	ringdown->law = law_of(job);
}

static const char *method_of(const struct ringdown_job *job)
{
	if (job->modes.count > 1)
		return "two-modes";
	if (job->modes.law != MODES_LAW_NONE)
		return "amplitude";
	if (job->modes.hum_hz > 0)
		return "full+hum";
	return job->series.block > 1 ? "block" : "full";
}

/* Values that their residual allows may still be less certain than what was asked for. */
static bool meets_tolerance(const struct ringdown_job *job, const struct estimate_ringdown *result)
{
	double tolerance = job->span->tolerance;

	return estimate_meets(result->sigma_hz, result->frequency_hz, tolerance) &&
	       estimate_meets(result->sigma_damping, result->damping_ratio, tolerance);
}

static unsigned shape_flags(const struct ringdown_job *job)
{
	unsigned flags = job->flags;

	if (job->modes.count > 1)
		flags |= ESTIMATE_FLAG_TWO_MODES;
	if (job->modes.law != MODES_LAW_NONE)
		flags |= ESTIMATE_FLAG_AMPLITUDE;
	if (job->modes.hum_hz > 0)
		flags |= ESTIMATE_FLAG_HUM;
	for (unsigned k = 0; k < job->series.count * job->series.block; k++)
		if (!trace_usable(job->trace, job->first + k))
			return flags | ESTIMATE_FLAG_GAPS;
	return flags;
}

/* The frequency as the study has it. */
static double three_cycles(const struct ringdown_job *job)
{
	double noise = isfinite(job->trace->noise_g) ? job->trace->noise_g : 0;
	struct crossings crossings;

	crossings_find(&crossings, job->trace, job->first, job->last, job->modes.p[MODES_OFFSET],
	               fmax(LIMIT_SIGNIFICANT * noise, LIMIT_FADED * job->span->peak_g));
	if (crossings.count < CROSSINGS_MAX)
		return NAN;
	return 3 / (crossings.time_s[CROSSINGS_MAX - 1] - crossings.time_s[0]);
}

static bool has_tried(const struct ringdown_job *job, const char *method)
{
	for (unsigned i = 0; i < job->tried; i++)
		if (strcmp(job->path[i], method) == 0)
			return true;
	return false;
}

static void ringdown_conclude(struct ringdown_job *job, struct ringdown *ringdown)
{
	struct estimate_how *how = &ringdown->result.how;

	ringdown_express(job, ringdown);
	if (!ringdown_passes(job, &job->modes))
		job->flags |= ESTIMATE_FLAG_MODEL;
	else if (!meets_tolerance(job, &ringdown->result))
		job->flags |= ESTIMATE_FLAG_TOLERANCE;
	how->method = method_of(job);
	/* Another window may have taken it from blocks to samples, or back. */
	if (!has_tried(job, how->method))
		ringdown_try(job, how->method);
	how->chi_square = ringdown_chi_square(job, &job->modes);
	how->flags = shape_flags(job);
	how->status = ESTIMATE_OK;
	memcpy(how->path, job->path, sizeof(how->path));
}

static void ringdown_begin(struct ringdown_job *job, const struct trace *trace,
                           const struct ringdown_span *span)
{
	memset(job, 0, offsetof(struct ringdown_job, series));
	job->trace = trace;
	job->span = span;
	job->first = trace_index(trace, span->from_s);
	job->last = trace_index(trace, span->until_s);
}

void ringdown_refine(const struct trace *trace, const struct ringdown_span *span, struct ringdown *ringdown)
{
	const struct estimate_ringdown *before = &ringdown->result;
	double omega = 2 * UNITS_PI * before->frequency_hz, part = before->damping_ratio;
	struct ringdown_job job;

	if (before->how.status != ESTIMATE_OK || before->how.flags & RICHER)
		return;
	ringdown_begin(&job, trace, span);
	if (job.first + SAMPLES_MIN > job.last ||
	    !ringdown_restart(&job, omega, omega * part / sqrt(1 - part * part)))
		return;
	while (job.tried < ESTIMATE_PATH_MAX && before->how.path[job.tried]) {
		job.path[job.tried] = before->how.path[job.tried];
		job.tried++;
	}
	if (strcmp(before->how.method, "full") == 0 && !ringdown_full(&job))
		return;
	if (estimate_ringdown_decays(&job.modes) && ringdown_passes(&job, &job.modes))
		ringdown_conclude(&job, ringdown);
}

void ringdown_find(const struct trace *trace, const struct ringdown_span *span, struct ringdown *ringdown)
{
	struct ringdown found = {.result = {.frequency_hz = NAN,
	                                    .sigma_hz = NAN,
	                                    .natural_frequency_hz = NAN,
	                                    .sigma_natural_hz = NAN,
	                                    .damping_ratio = NAN,
	                                    .sigma_damping = NAN,
	                                    .small_swing_hz = NAN,
	                                    .amplitude_g = NAN,
	                                    .second_frequency_hz = NAN,
	                                    .second_damping_ratio = NAN,
	                                    .three_cycle_frequency_hz = NAN,
	                                    .how = {.method = "", .chi_square = NAN}}};
	struct ringdown_job job;
	enum estimate_status *status = &found.result.how.status;

	ringdown_begin(&job, trace, span);
	*status = ESTIMATE_SHORT;
	if (isfinite(span->from_s) && job.first + SAMPLES_MIN <= job.last &&
	    (span->peak_g > 0 || trace->noise_g > 0)) {
		*status = ringdown_start(&job);
		if (*status == ESTIMATE_OK)
			*status = ringdown_judge(&job);
		if (*status == ESTIMATE_OK) {
			escalate(&job);
			ringdown_reach_back(&job);
			/* outliers may have taken the last sample to spare */
			if (job.series.used <= modes_size(&job.modes))
				*status = ESTIMATE_SHORT;
			else if (!estimate_ringdown_decays(&job.modes))
				*status = ESTIMATE_NOT_CONVERGED;
		}
		if (*status == ESTIMATE_OK) {
			ringdown_conclude(&job, &found);
			found.result.three_cycle_frequency_hz = three_cycles(&job);
		}
	}
	*ringdown = found;
}
