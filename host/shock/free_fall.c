/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/free_fall.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_statistics_double.h>

#define FALL_G 0.35
#define EDGE_G 0.5
#define LEFT_G 0.9
#define IMPACT_G 2.0
#define IMPACT_S 0.03
#define FALL_MIN_S 0.05
#define LOOK_S 0.02

/* What comes before: from 1 s to 0.1 s before the fall, the release itself left out. */
#define REST_FROM_S 1.0
#define REST_UNTIL_S 0.1
#define REST_MIN_S 0.1
#define REST_G_PART 0.15
#define REST_SPREAD_G 0.1

enum { REST_SAMPLES = 256, REST_SAMPLES_MIN = 10 };

static bool free_fall_magnitude(const struct axes *axes, size_t k, double *value_g)
{
	static const double no_offset[AXES_MAX] = {0};
	double value[AXES_MAX];

	if (!axes_read(axes, k, no_offset, value))
		return false;
	*value_g = fabs(axes_value(axes, value));
	return true;
}

/* From sample k outward: where the magnitude first reaches level_g, or the last sample before the ends and
 * holes of reach_s. False when it does not. */
static bool free_fall_reach(const struct axes *axes, size_t k, int step, double level_g, double reach_s,
                            double *time_s)
{
	double begin = axes_time(axes, k), last = begin, inside = 0, value;
	size_t count = axes->axis[0]->count;

	(void)free_fall_magnitude(axes, k, &inside);
	while (step < 0 ? k > 0 : k + 1 < count) {
		double now;

		k = step < 0 ? k - 1 : k + 1;
		now = axes_time(axes, k);
		if (fabs(now - begin) > reach_s)
			return false;
		if (!free_fall_magnitude(axes, k, &value))
			continue;
		if (value >= level_g) {
			*time_s = inside < level_g
			                  ? last + (now - last) * (level_g - inside) / (value - inside)
			                  : last;
			return true;
		}
		last = now;
		inside = value;
	}
	return false;
}

/* Steady at 1 g before the fall: the sensor feels gravity. */
static bool rests_before(const struct axes *axes, double start_s)
{
	double rate = axes->axis[0]->rate_hz, first = axes->axis[0]->start_s;
	double from = fmax(start_s - REST_FROM_S, first), until = start_s - REST_UNTIL_S;
	double value[REST_SAMPLES], work[REST_SAMPLES], median, spread;
	size_t n = 0, begin, step;

	if (!(until - from >= REST_MIN_S))
		return false;
	begin = (size_t)ceil((from - first) * rate);
	step = (size_t)((until - from) * rate) / REST_SAMPLES + 1;
	for (size_t k = begin; n < REST_SAMPLES && axes_time(axes, k) < until; k += step)
		if (free_fall_magnitude(axes, k, &value[n]))
			n++;
	if (n < REST_SAMPLES_MIN)
		return false;
	memcpy(work, value, n * sizeof(*value));
	median = gsl_stats_median(work, 1, n);
	spread = gsl_stats_mad0(value, 1, n, work);
	return fabs(median - 1) <= REST_G_PART && spread <= REST_SPREAD_G;
}

/* The run of samples [first, last] as a fall; false when it is none. */
static bool free_fall_judge(const struct axes *axes, double gravity_m_s2, size_t first, size_t last,
                            struct free_fall *fall)
{
	double dt = 1 / axes->axis[0]->rate_hz, left, met, impact, release, stop;

	if (!(axes_time(axes, last) - axes_time(axes, first) >= FALL_MIN_S))
		return false;
	if (!free_fall_reach(axes, first, -1, EDGE_G, REST_UNTIL_S, &fall->start_s) ||
	    !free_fall_reach(axes, last, +1, EDGE_G, IMPACT_S, &fall->end_s) ||
	    !free_fall_reach(axes, last, +1, IMPACT_G, IMPACT_S, &impact) ||
	    !rests_before(axes, fall->start_s))
		return false;
	if (!free_fall_reach(axes, first, -1, LEFT_G, REST_UNTIL_S, &left))
		left = fall->start_s - REST_UNTIL_S;
	if (!free_fall_reach(axes, last, +1, LEFT_G, IMPACT_S, &met))
		met = impact;
	release = hypot(axes_time(axes, first) - left, dt) / sqrt(12);
	stop = hypot(met - axes_time(axes, last), dt) / sqrt(12);
	memcpy(fall->name, axes->name, sizeof(fall->name));
	fall->sensor = axes->count > 1;
	fall->duration_s = fall->end_s - fall->start_s;
	fall->sigma_duration_s = hypot(release, stop);
	fall->height_m = gravity_m_s2 * fall->duration_s * fall->duration_s / 2;
	fall->sigma_height_m = gravity_m_s2 * fall->duration_s * fall->sigma_duration_s;
	return true;
}

static void free_fall_keep(struct free_falls *falls, const struct free_fall *fall)
{
	for (size_t i = 0; i < falls->count; i++)
		if (fall->start_s < falls->fall[i].end_s && fall->end_s > falls->fall[i].start_s)
			return;
	if (falls->count < FREE_FALLS_MAX)
		falls->fall[falls->count++] = *fall;
}

/* The last sample from k on, step +1 or -1, before the magnitude leaves the fall. */
static size_t run_end(const struct axes *axes, size_t k, int step)
{
	size_t end = k;
	double value;

	while (step < 0 ? k > 0 : k + 1 < axes->axis[0]->count) {
		k = step < 0 ? k - 1 : k + 1;
		if (!free_fall_magnitude(axes, k, &value))
			continue;
		if (value >= FALL_G)
			break;
		end = k;
	}
	return end;
}

/* Looks often enough to meet every fall, and closer where there may be one. */
static void free_fall_scan(const struct axes *axes, double gravity_m_s2, struct free_falls *falls)
{
	size_t step = (size_t)(LOOK_S * axes->axis[0]->rate_hz) + 1, k = 0;

	while (k < axes->axis[0]->count) {
		struct free_fall fall = {0};
		double value;
		size_t last;

		if (!free_fall_magnitude(axes, k, &value)) {
			k++;
			continue;
		}
		if (value >= FALL_G) {
			k += step;
			continue;
		}
		last = run_end(axes, k, +1);
		if (free_fall_judge(axes, gravity_m_s2, run_end(axes, k, -1), last, &fall))
			free_fall_keep(falls, &fall);
		k = last + step;
	}
}

int free_fall_find(const struct record *record, double gravity_m_s2, struct free_falls *falls)
{
	struct axes *axes = malloc((record->channel_count + 1) * sizeof(*axes));
	size_t count;

	if (!axes)
		return DT_E_MEMORY;
	count = axes_find(record, axes);
	falls->count = 0;
	for (size_t most = AXES_MAX; most > 0; most--)
		for (size_t i = 0; i < count; i++)
			if (axes[i].count == most)
				free_fall_scan(&axes[i], gravity_m_s2, falls);
	free(axes);
	return 0;
}
