/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/fit_private.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Noise is taken from this part before the touch. */
#define QUIET_FROM_S 60e-3
#define QUIET_TO_S 1.5e-3

enum { QUIET_MIN = 20, COLOUR_LAGS = 8 };

/* The touch is this much before a tenth of S2X's peak. */
#define TOUCH_BEFORE_TENTH_S 50e-6

/* A peak is looked for so long after the signal passes half of the record's largest. */
#define PEAK_REACH_S 4e-3

#define ENVELOPE_S 0.5e-3
#define PEAK_MIN_NOISES 20.0
#define ZERO_SD_G 1.0

/* Impulses are compared over this time from the touch. */
#define IMPULSE_S 8e-3

static double channel_time(const struct fit_channel *c, size_t i)
{
	return c->start_s + (double)i / c->rate_hz;
}

static bool usable(const struct fit_channel *c, size_t i)
{
	return c->sample[i] == 0 && isfinite(c->value_g[i]);
}

static size_t channel_index(const struct fit_channel *c, double t)
{
	double i = ceil((t - c->start_s) * c->rate_hz);

	return i < 0.0 ? 0 : i > (double)c->count ? c->count : (size_t)i;
}

/* Where a share of the first high peak is reached on its rise. NAN: nowhere. */
static double rise(const struct fit_channel *c, double share, double *peak_g)
{
	double most = 0.0;
	size_t first = 0, top;

	for (size_t i = 0; i < c->count; i++)
		if (isfinite(c->value_g[i]))
			most = fmax(most, fabs(c->value_g[i]));
	while (first < c->count && !(fabs(c->value_g[first]) >= 0.5 * most))
		first++;
	top = first;
	for (size_t i = first; i < c->count && channel_time(c, i) < channel_time(c, first) + PEAK_REACH_S;
	     i++)
		if (isfinite(c->value_g[i]) && !(fabs(c->value_g[i]) <= fabs(c->value_g[top])))
			top = i;
	if (top >= c->count || top == 0)
		return (double)NAN;
	*peak_g = c->value_g[top];
	while (top > 0 && !(c->value_g[top - 1] / *peak_g < share))
		top--;
	if (top == 0)
		return (double)NAN;
	return channel_time(c, top - 1) + (share - c->value_g[top - 1] / *peak_g) /
	                                          ((c->value_g[top] - c->value_g[top - 1]) / *peak_g) /
	                                          c->rate_hz;
}

/* ---- before the touch: a straight line and what trembles about it ---- */

static double quiet_colour(const double *left, size_t n, double variance)
{
	double sum = 1.0;

	for (size_t k = 1; k <= COLOUR_LAGS; k++) {
		double with = 0.0;

		for (size_t i = k; i < n; i++)
			with += left[i] * left[i - k];
		sum += 2.0 * with / ((double)n * variance);
	}
	return sum > 1.0 + 2.5 * 2.0 * sqrt(COLOUR_LAGS / (double)n) ? sum : 1.0;
}

static bool quiet_find(const struct fit_channel *c, double touch_s, double *noise_g, double *colour,
                       double *zero_g)
{
	size_t from = channel_index(c, touch_s - QUIET_FROM_S), to = channel_index(c, touch_s - QUIET_TO_S),
	       n = 0;
	double mean = 0.0, lean = 0.0, spread = 0.0, variance = 0.0, middle = 0.5 * (double)(from + to),
	       *left;

	left = to > from ? calloc(to - from, sizeof(*left)) : NULL;
	if (!left)
		return false;
	for (size_t i = from; i < to; i++)
		if (usable(c, i)) {
			double x = (double)i - middle;

			mean += c->value_g[i];
			lean += x * c->value_g[i];
			spread += x * x;
			n++;
		}
	if (n >= QUIET_MIN) {
		mean /= (double)n;
		lean /= spread;
		n = 0;
		for (size_t i = from; i < to; i++)
			if (usable(c, i)) {
				left[n] = c->value_g[i] - mean - lean * ((double)i - middle);
				variance += left[n] * left[n];
				n++;
			}
		variance /= (double)(n - 2);
		*noise_g = sqrt(fmax(variance, 1e-6));
		*colour = quiet_colour(left, n, *noise_g * *noise_g);
		*zero_g = mean + lean * ((double)to - middle);
	}
	free(left);
	return n >= QUIET_MIN;
}

/* ---- wiring ---- */

static double impulse(const struct fit_channel *c, double touch_s, double zero_g)
{
	double sum = 0.0;

	for (size_t i = channel_index(c, touch_s); i < channel_index(c, touch_s + IMPULSE_S); i++)
		if (isfinite(c->value_g[i]))
			sum += c->value_g[i] - zero_g;
	return sum / c->rate_hz;
}

static int refuse_drop(char *message, const char *text)
{
	snprintf(message, FIT_MESSAGE_MAX, "%s", text);
	return DT_E_ARGUMENT;
}

static int check_wiring(const struct scene *scene, const struct fit_drop *in, const struct solve_drop *d,
                        char message[FIT_MESSAGE_MAX])
{
	static const unsigned pushed[] = {MOTION_S2X, MOTION_S1X, MOTION_S1Y};

	for (size_t i = 0; i < 3; i++)
		if (impulse(&in->axis[pushed[i]], d->touch_s, d->own[FIT_ZERO + pushed[i]]) < 0.0) {
			snprintf(message, FIT_MESSAGE_MAX,
			         "%s is driven the wrong way by the impact, expected a positive impulse: is "
			         "its polarity "
			         "reversed?",
			         fit_axis_names[pushed[i]]);
			return DT_E_ARGUMENT;
		}
	if (scene->mount_plate_mass_kg > 0.0 && d->quarter_s[MOTION_S1X] < d->quarter_s[MOTION_S2X])
		return refuse_drop(
		        message,
		        "S1 feels the impact before S2, expected the plate's sensor after the box's: are "
		        "the sensors swapped?");
	return 0;
}

/* ---- samples ---- */

static double envelope(const struct fit_channel *c, double zero_g, double t)
{
	double most = 0.0;

	for (size_t i = channel_index(c, t - ENVELOPE_S); i < channel_index(c, t + ENVELOPE_S); i++)
		if (isfinite(c->value_g[i]))
			most = fmax(most, fabs(c->value_g[i] - zero_g));
	return most;
}

static int take_samples(const struct fit_drop *in, struct solve_drop *d)
{
	size_t room = 0;

	for (unsigned a = 0; a < MOTION_AXES; a++)
		room += channel_index(&in->axis[a], d->touch_s + PREPARE_AFTER_S) -
		        channel_index(&in->axis[a], d->touch_s - PREPARE_BEFORE_S);
	d->sample = calloc(room + 1, sizeof(*d->sample));
	if (!d->sample)
		return DT_E_MEMORY;
	for (unsigned a = 0; a < MOTION_AXES; a++) {
		const struct fit_channel *c = &in->axis[a];

		for (size_t i = channel_index(c, d->touch_s - PREPARE_BEFORE_S);
		     i < channel_index(c, d->touch_s + PREPARE_AFTER_S); i++)
			if (usable(c, i))
				d->sample[d->count++] = (struct solve_sample){
				        (uint8_t)a, channel_time(c, i) - d->touch_s, c->value_g[i],
				        envelope(c, d->own[FIT_ZERO + a], channel_time(c, i))};
	}
	return 0;
}

static void set_priors(const struct scene *scene, const struct fit_drop *in, const struct fit_options *o,
                       struct solve_drop *d)
{
	d->centre[FIT_GAMMA_DEG] = d->own[FIT_GAMMA_DEG] = in->angle_deg;
	d->prior_sd[FIT_GAMMA_DEG] = o->angle_sd_deg;
	d->centre[FIT_LN_SPEED] = d->own[FIT_LN_SPEED] =
	        0.5 * log(2.0 * scene->drop_gravity_m_s2 * in->height_m);
	d->prior_sd[FIT_LN_SPEED] = o->speed_sd;
	for (unsigned i = 0; i < 8; i++)
		d->prior_sd[FIT_MIX + i] = o->gain_sd[i / 4];
	for (unsigned a = 0; a < MOTION_AXES; a++) {
		d->centre[FIT_ZERO + a] = d->own[FIT_ZERO + a];
		d->prior_sd[FIT_ZERO + a] = ZERO_SD_G;
	}
}

int prepare_drop(const struct scene *scene, const struct fit_drop *in, const struct fit_options *options,
                 struct solve_drop *d, char message[FIT_MESSAGE_MAX])
{
	double tenth, peak[MOTION_AXES];
	int error;

	*d = (struct solve_drop){.count = 0};
	tenth = rise(&in->axis[MOTION_S2X], 0.1, &peak[MOTION_S2X]);
	if (!isfinite(tenth))
		return refuse_drop(message,
		                   "S2X shows no impact, expected one pulse with a quiet part before it");
	d->touch_s = tenth - TOUCH_BEFORE_TENTH_S;
	for (unsigned a = 0; a < MOTION_AXES; a++) {
		if (!quiet_find(&in->axis[a], d->touch_s, &d->noise_g[a], &d->colour[a],
		                &d->own[FIT_ZERO + a])) {
			snprintf(message, FIT_MESSAGE_MAX,
			         "%s has too few samples before the impact, expected %d of them",
			         fit_axis_names[a], QUIET_MIN);
			return DT_E_ARGUMENT;
		}
		d->quarter_s[a] = rise(&in->axis[a], 0.25, &peak[a]);
	}
	if (fabs(peak[MOTION_S2X]) < PEAK_MIN_NOISES * d->noise_g[MOTION_S2X])
		return refuse_drop(message, "S2X shows no impact above its noise");
	error = check_wiring(scene, in, d, message);
	if (!error)
		error = take_samples(in, d);
	if (error == DT_E_MEMORY)
		snprintf(message, FIT_MESSAGE_MAX, "no memory");
	set_priors(scene, in, options, d);
	return error;
}

void prepare_free(struct solve_drop *d)
{
	free(d->sample);
	d->sample = NULL;
}
