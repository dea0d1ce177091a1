/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/crest.h"

#include <math.h>

#include "host/estimate/limits.h"

enum {
	CREST_PASSES = 6,
	CREST_STEPS = 24, /* coarse steps across the reach */
	CREST_NEWTON = 8,
};

/* Half windows of order 6 and 4, in widths. */
#define FINE_HALF 0.465
#define COARSE_HALF 0.35

/* Windows shrink by this much where the polynomial does not fit, so many times; by little where so much would
 * leave too few samples at once. */
#define SHRINK 0.75
#define LITTLE_SHRINK 0.93

enum { SHRINKS = 12 };

/* Where the pulse itself gives too few samples, the window in samples that is tried instead: enough for both
 * orders even where the foot of the pulse cuts one side. */
#define NARROWEST 15.0

/* A window is around the summit when it is off by less than this part of a sample. */
#define OFF_CENTRE 0.2

/* How far from its centre a fit is believed, in half widths of its window. */
#define REACH 0.6

struct surface {
	unsigned count;
	struct local axis[CREST_AXES_MAX];
};

/* Half of the square's value, slope and curvature. */
static void crest_square_at(const struct surface *surface, double time_s, double half[3])
{
	half[0] = half[1] = half[2] = 0;
	for (unsigned i = 0; i < surface->count; i++) {
		double d[3];

		local_at(&surface->axis[i], time_s, d);
		half[0] += d[0] * d[0] / 2;
		half[1] += d[0] * d[1];
		half[2] += d[1] * d[1] + d[0] * d[2];
	}
}

/* Newton's way to the maximum near time_s; false where it leaves the next step_s to either side. */
static bool newton(const struct surface *surface, double step_s, double *time_s, double half[3])
{
	double time = *time_s;

	for (int i = 0; i < CREST_NEWTON; i++) {
		double move;

		crest_square_at(surface, time, half);
		if (!(half[2] < 0))
			return false;
		move = half[1] / half[2];
		time -= move;
		if (!(fabs(time - *time_s) <= step_s))
			return false;
		if (fabs(move) < LIMIT_SMALL * step_s)
			break;
	}
	*time_s = time;
	return true;
}

/* The highest instant within reach of the centre: 0 inside, -1 or +1 at that end of the reach. */
static int crest_summit(const struct surface *surface, double *time_s)
{
	double centre = surface->axis[0].centre_s, reach = REACH * surface->axis[0].half_s;
	double step = 2 * reach / CREST_STEPS, best = -1, half[3], left[3], right[3];
	int at = 0;

	/* Most often it is where it was looked for. */
	*time_s = centre;
	crest_square_at(surface, centre - reach, left);
	crest_square_at(surface, centre + reach, right);
	if (newton(surface, 2 * step, time_s, half) && half[0] > fmax(left[0], right[0]))
		return 0;
	for (int i = 0; i <= CREST_STEPS; i++) {
		crest_square_at(surface, centre - reach + i * step, half);
		if (half[0] > best) {
			best = half[0];
			at = i;
		}
	}
	*time_s = centre - reach + at * step;
	if (at == 0 || at == CREST_STEPS)
		return at == 0 ? -1 : 1;
	(void)newton(surface, step, time_s, half);
	return 0;
}

/* Fits all axes around near_s and again around the summit until it stays, so that it ends in the middle
 * of its window. */
static bool climb(struct surface *surface, const struct trace *const axes[], unsigned count, double *near_s,
                  double half_s, const struct local_span *span, unsigned order)
{
	int side = 1;

	surface->count = count;
	for (int pass = 0; pass < CREST_PASSES; pass++) {
		double top;

		for (unsigned i = 0; i < count; i++)
			if (!local_fit(&surface->axis[i], axes[i], *near_s, half_s, span, order))
				return false;
		side = crest_summit(surface, &top);
		if (side == 0 && fabs(top - *near_s) * axes[0]->rate_hz < OFF_CENTRE) {
			*near_s = top;
			return true;
		}
		if (top < span->from_s || top > span->until_s)
			return false;
		*near_s = top;
	}
	return side == 0;
}

/* Whether a residual is what noise leaves: chi-square within chance. */
static bool is_noise(const struct local *local, const struct trace *trace)
{
	return local->residual_g <= trace->noise_g * sqrt(1 + LIMIT_CHI * sqrt(2.0 / local->freedom));
}

double crest_noise(const struct local *local, const struct trace *trace)
{
	return is_noise(local, trace) ? trace->noise_g : local->residual_g;
}

static bool follows(const struct surface *surface, const struct trace *const axes[], double value_g)
{
	for (unsigned i = 0; i < surface->count; i++)
		if (!is_noise(&surface->axis[i], axes[i]) &&
		    surface->axis[i].residual_g > LIMIT_MISFIT * value_g)
			return false;
	return true;
}

/* Noise through the fit: dR = sum X dX / R, dt = sum X dX' / (sum X'^2 + X X''). */
static void propagate(const struct surface *surface, const struct trace *const axes[], struct crest *crest)
{
	double half[3], variance = 0, slope_variance = 0;

	crest_square_at(surface, crest->time_s, half);
	for (unsigned i = 0; i < surface->count; i++) {
		double d[3], noise = crest_noise(&surface->axis[i], axes[i]);

		local_at(&surface->axis[i], crest->time_s, d);
		variance += pow(d[0] * noise * local_spread(&surface->axis[i], crest->time_s, 0), 2);
		slope_variance += pow(d[0] * noise * local_spread(&surface->axis[i], crest->time_s, 1), 2);
	}
	crest->value_g = sqrt(2 * half[0]);
	crest->sigma_g = sqrt(variance) / crest->value_g;
	crest->sigma_time_s = sqrt(slope_variance) / fabs(half[2]);
	/* A maximum over noise is too high by what its wandering gains. */
	crest->value_g -= slope_variance / (2 * fabs(half[2]) * crest->value_g);
}

static double chi_square(const struct surface *surface, const struct trace *const axes[])
{
	double squares = 0, freedom = 0;

	for (unsigned i = 0; i < surface->count; i++) {
		if (!(axes[i]->noise_g > 0))
			return NAN;
		squares += surface->axis[i].freedom * pow(surface->axis[i].residual_g / axes[i]->noise_g, 2);
		freedom += surface->axis[i].freedom;
	}
	return squares / freedom;
}

/* Both orders at one width; *good says whether they follow the samples. */
static bool fit_pair(struct crest *crest, const struct trace *const axes[], unsigned count, double near_s,
                     double width_s, const struct local_span *span, bool *good)
{
	struct surface fine, coarse;
	struct crest six, four;
	double noise_g;

	six.time_s = near_s;
	if (!climb(&fine, axes, count, &six.time_s, FINE_HALF * width_s, span, 6))
		return false;
	four.time_s = six.time_s;
	if (!climb(&coarse, axes, count, &four.time_s, COARSE_HALF * width_s, span, 4))
		return false;
	propagate(&fine, axes, &six);
	propagate(&coarse, axes, &four);
	if (!isfinite(six.value_g) || !isfinite(six.time_s))
		return false;
	six.model_g = fabs(six.value_g - four.value_g) / 2;
	six.model_s = fabs(six.time_s - four.time_s) / 2;
	noise_g = six.sigma_g;
	six.sigma_g = hypot(six.sigma_g, six.model_g);
	six.sigma_time_s = hypot(six.sigma_time_s, six.model_s);
	six.chi_square = chi_square(&fine, axes);
	for (unsigned i = 0; i < count; i++)
		six.axis[i] = fine.axis[i];
	*crest = six;
	*good = follows(&fine, axes, six.value_g) && six.model_g <= fmax(noise_g, LIMIT_MISFIT * six.value_g);
	return true;
}

bool crest_fit(struct crest *crest, const struct trace *const axes[], unsigned count, double near_s,
               double width_s, const struct local_span *span)
{
	bool good = false, fitted = fit_pair(crest, axes, count, near_s, width_s, span, &good);
	double shrink = SHRINK;

	if (!fitted) {
		for (unsigned i = 0; i < count; i++)
			width_s = fmax(width_s, NARROWEST / axes[i]->rate_hz);
		fitted = fit_pair(crest, axes, count, near_s, width_s, span, &good);
	}
	for (int i = 0; i < SHRINKS && fitted && !good; i++) {
		if (fit_pair(crest, axes, count, near_s, shrink * width_s, span, &good))
			width_s *= shrink;
		else if (i == 0)
			shrink = LITTLE_SHRINK;
		else
			break;
	}
	return fitted;
}
