/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "common/units.h"
#include "host/estimate/doubt.h"
#include "host/estimate/limits.h"

enum {
	DEAD_SAMPLES = 256, /* at the record's end, and of the quiet part */
	DEAD_CHANGES = 128, /* of the quiet part's differ from the one before: finer than noise */
	SKIP_SIDE = 3,      /* samples beside two that one is missing between */
	LATE_PARTS = 8,
	LATE_SAMPLES = 16, /* of each */
};

/* What is left of noise where nothing is connected. */
#define DEAD_NOISE 0.33

/* A rise from sample to sample that tells whether one is missing, in sigmas of noise, and in what the samples
 * beside it bend; how far such rises may be from what those beside them foretell. */
#define RISE_SIGMAS 16.0
#define RISE_BENDS 5.0
#define RISE_APART 0.35

/* Root mean square of second differences of the samples [from, from + DEAD_SAMPLES), and how many samples
 * differ from the one before; NAN where one is missing. */
static double dead_noise(const struct trace *trace, size_t from, unsigned *changes)
{
	const double *v = trace->value_g;
	double square = 0;

	*changes = 0;
	for (size_t k = from + 1; k + 1 < from + DEAD_SAMPLES; k++) {
		if (!trace_usable(trace, k + 1))
			return NAN;
		square += pow(v[k + 1] - 2 * v[k] + v[k - 1], 2);
		*changes += fabs(v[k] - v[k - 1]) > 0;
	}
	return sqrt(square / (DEAD_SAMPLES - 2));
}

/* Whether the record ends without the noise that it had before the pulse. */
static bool chain_dead(const struct trace *trace, const struct estimate_baseline *baseline)
{
	size_t until = trace_index(trace, baseline->until_s);
	unsigned before, after;

	if (until < DEAD_SAMPLES || trace->count < until + DEAD_SAMPLES)
		return false;
	return dead_noise(trace, trace->count - DEAD_SAMPLES, &after) <
	               DEAD_NOISE * dead_noise(trace, until - DEAD_SAMPLES, &before) &&
	       before > DEAD_CHANGES;
}

/* Mean of the good samples [from, from + n). */
static double chain_mean(const struct trace *trace, size_t from, size_t n)
{
	double sum = 0, good = 0;

	for (size_t k = from; k < from + n; k++)
		if (trace_good(trace, k)) {
			sum += trace->value_g[k];
			good++;
		}
	return sum / good;
}

/* By how much zero at the record's end is off zero before; 0 where swing and noise hide it. */
static double chain_late(const struct trace *trace, const struct estimate_baseline *baseline,
                         const struct estimate_pulse *pulse)
{
	size_t end = trace_index(trace, pulse->end_s), from = end + (trace->count - end) / 2;
	size_t n = (trace->count - from) / LATE_PARTS, quiet = trace_index(trace, baseline->from_s);
	double part[LATE_PARTS], mean = 0, square = 0, before = 0, parts = 0;

	if (n < LATE_SAMPLES)
		return 0;
	for (size_t i = 0; i < LATE_PARTS; i++)
		mean += (part[i] = chain_mean(trace, from + i * n, n)) / LATE_PARTS;
	for (size_t i = 0; i < LATE_PARTS; i++)
		square += pow(part[i] - mean, 2) / (LATE_PARTS - 1);
	for (; quiet + n <= trace_index(trace, baseline->until_s); quiet += n, parts++)
		before += pow(chain_mean(trace, quiet, n), 2);
	square = fmax(square, parts > 0 ? before / parts : 0);
	square = fmax(square, trace->noise_g * trace->noise_g / (double)n);
	return fabs(mean) > LIMIT_NOISE * sqrt(square / LATE_PARTS) ? fabs(mean) : 0;
}

/* |second difference| about a sample. */
static double chain_bend(const double *v)
{
	return fabs(v[-1] - 2 * v[0] + v[1]);
}

/* Whether between v[0] and v[1] nothing rises, or twice what does beside them. */
static bool chain_skip(const double *v, double noise_g)
{
	double before = v[0] - v[-1], after = v[2] - v[1], rise = (before + after) / 2;
	double times = (v[1] - v[0]) / rise;
	double bend =
	        fmax(fmax(chain_bend(v - 2), chain_bend(v - 1)), fmax(chain_bend(v + 2), chain_bend(v + 3)));

	return fabs(rise) > fmax(RISE_SIGMAS * noise_g, RISE_BENDS * (bend - LIMIT_SIGNIFICANT * noise_g)) &&
	       fabs(before - after) < RISE_APART * fabs(rise) &&
	       (fabs(times) < RISE_APART / 2 || fabs(times - 2) < RISE_APART);
}

/* Whether v[0] and v[1] are one fine number between rises that noise does not make level. */
static bool chain_twice(const double *v, double noise_g)
{
	double before = v[0] - v[-1], after = v[2] - v[1];

	return !(fabs(v[1] - v[0]) > 0) && before * after > 0 &&
	       fmin(fabs(before), fabs(after)) > RISE_SIGMAS * noise_g;
}

/* Whether a sample on a flank is there twice, or one is missing. */
static bool chain_skips(const struct trace *trace, const struct estimate_pulse *pulse)
{
	size_t from = trace_index(trace, pulse->start_s), until = trace_index(trace, pulse->end_s);

	for (size_t k = from < SKIP_SIDE ? SKIP_SIDE : from; k < until && k + SKIP_SIDE + 1 < trace->count;
	     k++) {
		bool whole = chain_skip(trace->value_g + k, trace->noise_g) ||
		             (!(trace->step_g > 0) && chain_twice(trace->value_g + k, trace->noise_g));

		for (size_t i = k - SKIP_SIDE; whole && i <= k + SKIP_SIDE + 1; i++)
			whole = trace_usable(trace, i);
		if (whole)
			return true;
	}
	return false;
}

void doubt_chain(struct trace *trace, const struct estimate_baseline *baseline, struct peak *peak,
                 struct estimate_pulse *pulse)
{
	struct estimate_peak *top = &peak->result;
	double late_g;

	if (!isfinite(pulse->duration_s) || baseline->samples == 0)
		return;
	if (chain_dead(trace, baseline))
		trace->flags |= RECORD_FLAG_CABLE;
	if (chain_skips(trace, pulse)) {
		top->how.flags |= ESTIMATE_FLAG_STEP;
		pulse->flags |= ESTIMATE_FLAG_STEP;
	}
	late_g = chain_late(trace, baseline, pulse);
	if (!(late_g > LIMIT_PART * fabs(top->value_g)))
		return;
	top->sigma_g = hypot(top->sigma_g, late_g);
	pulse->sigma_velocity_m_s =
	        hypot(pulse->sigma_velocity_m_s, UNITS_G_M_S2 * late_g * pulse->duration_s);
	top->how.flags |= ESTIMATE_FLAG_TAIL;
	pulse->flags |= ESTIMATE_FLAG_TAIL;
}
