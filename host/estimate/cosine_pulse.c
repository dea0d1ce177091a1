/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/cosine_pulse.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/gram.h"
#include "host/estimate/limits.h"
#include "host/estimate/lm.h"
#include "host/estimate/phasor.h"
#include "host/estimate/shape_private.h"

/* Samples this many bases to either side of the peak take part: beyond the feet zero is fitted. */
#define REACH_BASES 0.8

/* Reduced chi-square of a right model stays below 1 + this times sqrt(2 / freedom). Generous: what is left of
 * a wrong shape then is less than the samples' noise, as input, would do. */
#define REFUSE 7.0

/* Samples at the feet come and go with the base. */
#define KINK 0.1

enum { HEIGHT, CENTRE, BASE, POWER, BULGE, PARAMETERS, RESIDUAL = PARAMETERS, COLUMNS };

struct scene {
	const struct trace *trace;
	size_t first, last;
	double noise_g;
};

/* The pulse of height 1 at the angle whose cosine is c, and its derivative by the angle; row gets those by
 * height, power and bulge. */
static inline double cosine_pulse_shape(const double p[PARAMETERS], double c, double sine,
                                        double row[PARAMETERS])
{
	double logarithm = log(c), flank = exp(p[POWER] * logarithm), rise = 1 - c * c;
	double value = flank * (1 + p[BULGE] * rise);

	row[HEIGHT] = value;
	row[POWER] = p[HEIGHT] * value * logarithm;
	row[BULGE] = p[HEIGHT] * flank * rise;
	return p[HEIGHT] * sine * (2 * p[BULGE] * flank * c - p[POWER] * value / c);
}

/* From sample to sample through the pulse. */
struct walk {
	double angle, step;
	struct phasor at;
};

static struct walk start_walk(const struct scene *scene, const double p[PARAMETERS])
{
	double per_s = UNITS_PI / p[BASE], step = per_s / scene->trace->rate_hz;
	double angle = (trace_time(scene->trace, scene->first) - p[CENTRE]) * per_s;

	return (struct walk){angle, step, phasor_at(angle, step)};
}

static inline void cosine_pulse_turn(struct walk *walk)
{
	phasor_turn(&walk->at);
	walk->angle += walk->step;
}

static inline bool is_inside(const struct walk *walk)
{
	return fabs(walk->angle) < UNITS_PI / 2 && walk->at.cosine > 0;
}

static size_t cosine_pulse_normal(const void *model, double *p, double matrix[CHOLESKY_MAX][CHOLESKY_MAX],
                                  double right[CHOLESKY_MAX], double *squares)
{
	const struct scene *scene = model;
	double prior = scene->noise_g / LIMIT_KNOWN;
	struct walk walk;
	size_t used = 0;
	struct gram gram;

	if (!(p[POWER] > SHAPE_POWER_MIN && p[POWER] < SHAPE_POWER_MAX) || !(p[BASE] > 0))
		return 0;
	walk = start_walk(scene, p);
	gram_start(&gram, PARAMETERS);
	for (size_t k = scene->first; k < scene->last; k++, cosine_pulse_turn(&walk)) {
		double row[COLUMNS], residual = scene->trace->value_g[k];

		if (!trace_usable(scene->trace, k))
			continue;
		used++;
		if (!is_inside(&walk)) {
			*squares += residual * residual;
			continue;
		}
		row[CENTRE] = cosine_pulse_shape(p, walk.at.cosine, walk.at.sine, row);
		row[BASE] = -row[CENTRE] * walk.angle / p[BASE];
		row[CENTRE] *= -UNITS_PI / p[BASE];
		row[RESIDUAL] = residual - p[HEIGHT] * row[HEIGHT];
		gram_add(&gram, row);
	}
	gram_finish(&gram, matrix, right, squares);
	matrix[BULGE][BULGE] += prior * prior;
	right[BULGE] -= prior * prior * p[BULGE];
	*squares += prior * prior * p[BULGE] * p[BULGE];
	return used;
}

/* From the widths at half and at a tenth of the height: of a half-sine 2/3 and 0.9362 of the base, of a
 * haversine 1/2 and 0.7952. */
static bool cosine_pulse_start(const struct trace *trace, const struct peak *peak, double p[PARAMETERS])
{
	double height = fabs(peak->result.value_g), from[2], until[2], ratio;
	static const double level[] = {0.5, 0.1};

	for (unsigned i = 0; i < 2; i++)
		if (!trace_edge(trace, peak->at, -1, peak->sign, level[i] * height, &from[i]) ||
		    !trace_edge(trace, peak->at, 1, peak->sign, level[i] * height, &until[i]))
			return false;
	ratio = (until[1] - from[1]) / (until[0] - from[0]);
	p[HEIGHT] = peak->result.value_g;
	p[CENTRE] = (until[0] + from[0]) / 2;
	p[POWER] = fmin(fmax(1 + (ratio - 1.404) / 0.186, 0.5), 3);
	p[BASE] = (until[0] - from[0]) * UNITS_PI / (2 * acos(pow(0.5, 1 / p[POWER])));
	p[BULGE] = 0;
	return p[BASE] > 0;
}

/* How much the residual asks for a summit moved against the feet, in standard deviations: the score (Rao
 * 1948) of an odd part, less what the centre can take up of it. */
static double lopsided(const struct scene *scene, const double p[PARAMETERS])
{
	double odd_odd = 0, odd_centre = 0, centre_centre = 0, odd_residual = 0;
	struct walk walk = start_walk(scene, p);

	for (size_t k = scene->first; k < scene->last; k++, cosine_pulse_turn(&walk)) {
		double row[PARAMETERS], value, odd, centre;

		if (!trace_usable(scene->trace, k) || !is_inside(&walk))
			continue;
		centre = cosine_pulse_shape(p, walk.at.cosine, walk.at.sine, row);
		value = p[HEIGHT] * row[HEIGHT];
		odd = value * walk.at.sine;
		odd_odd += odd * odd;
		odd_centre += odd * centre;
		centre_centre += centre * centre;
		odd_residual += odd * (scene->trace->value_g[k] - value);
	}
	return odd_residual / (scene->noise_g * sqrt(odd_odd - odd_centre * odd_centre / centre_centre));
}

bool cosine_pulse_fit(const struct trace *trace, const struct peak *peak, struct cosine_pulse *cosine)
{
	static const double centre_row[PARAMETERS] = {[CENTRE] = 1};
	double noise = fmax(trace->noise_g, LIMIT_MISFIT * fabs(peak->result.value_g));
	struct scene scene = {.trace = trace, .noise_g = noise};
	struct lm_problem problem = {
	        .size = PARAMETERS, .model = &scene, .normal = cosine_pulse_normal, .kink = KINK};
	struct lm_result result;
	double p[PARAMETERS], freedom;

	if (peak->lopsided || !cosine_pulse_start(trace, peak, p))
		return false;
	scene.first = trace_index(trace, p[CENTRE] - REACH_BASES * p[BASE]);
	scene.last = trace_index(trace, p[CENTRE] + REACH_BASES * p[BASE]);
	if (!lm_fit(&problem, p, &result))
		return false;
	freedom = (double)(result.used - PARAMETERS + 1);
	cosine->chi_square = result.squares / freedom / (noise * noise);
	cosine->height_g = p[HEIGHT];
	cosine->centre_s = p[CENTRE];
	cosine->base_s = p[BASE];
	cosine->power = p[POWER];
	cosine->bulge = p[BULGE];
	cosine->sigma_centre_s = noise * sqrt(cholesky_variance(&result.factor, centre_row));
	return cosine->chi_square <= 1 + REFUSE * sqrt(2 / freedom) &&
	       fabs(lopsided(&scene, p)) <= LIMIT_SIGNIFICANT;
}

double cosine_pulse_of(const struct cosine_pulse *cosine, double c)
{
	double flank = c;

	/* The named families' without the cost of a power. */
	if (cosine->power == 2)
		flank = c * c;
	else if (cosine->power != 1)
		flank = pow(c, cosine->power);
	return cosine->height_g * flank * (1 + cosine->bulge * (1 - c * c));
}

double cosine_pulse_at(const struct cosine_pulse *cosine, double time_s)
{
	double angle = UNITS_PI * (time_s - cosine->centre_s) / cosine->base_s, c = cos(angle);

	if (!(fabs(angle) < UNITS_PI / 2) || !(c > 0))
		return 0;
	return cosine_pulse_of(cosine, c);
}

double cosine_pulse_area(const struct cosine_pulse *cosine)
{
	double flank = shape_mean_cosine(cosine->power);

	return cosine->height_g * cosine->base_s *
	       (flank + cosine->bulge * (flank - shape_mean_cosine(cosine->power + 2)));
}
