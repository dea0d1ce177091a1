/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "host/estimate/shape.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846
#define HEIGHT_G 485.1
#define BASE_S 3e-3
#define RATE_HZ 7000.0
#define ONSET_S 0.02

enum { SAMPLES = 400 };

/* Width at half height over the base. */
static const double half_width[SYNTH_SHAPES] = {2.0 / 3, 0.5, 0.58, 0.36};

static struct channel make(enum synth_shape shape, double height_g, double phase, double noise_g,
                           struct synth_random *random)
{
	struct channel channel = synth_channel("a", RATE_HZ, 0, SAMPLES);

	for (size_t k = 0; k < channel.count; k++) {
		double t = ((double)k - phase) / RATE_HZ - ONSET_S;

		channel.value_g[k] = height_g * synth_pulse(shape, t / BASE_S);
		if (noise_g > 0)
			channel.value_g[k] += noise_g * synth_normal(random);
	}
	return channel;
}

/* Started a little off everywhere. */
static bool fit(const struct channel *channel, enum synth_shape truth, double height_g, double noise_g,
                enum estimate_family family, struct shape *shape)
{
	struct shape_start start = {0.97 * height_g, ONSET_S + synth_pulse_summit(truth) * BASE_S + 50e-6,
	                            1.05 * half_width[truth] * BASE_S, INFINITY, -INFINITY};
	struct trace trace;
	bool fitted;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	trace.noise_g = noise_g;
	fitted = shape_fit(shape, &trace, family, &start);
	trace_close(&trace);
	return fitted;
}

/* ---- the reference: GSL, plain formulas, numeric derivatives of its own ---- */

struct reference {
	const struct channel *channel;
	size_t first, last;
	int family; /* 1 half-sine, 2 haversine, 3 sine-power */
};

static int residual(const gsl_vector *p, void *context, gsl_vector *f)
{
	const struct reference *r = context;
	double exponent = r->family == 3 ? gsl_vector_get(p, 3) : r->family;

	for (size_t k = r->first; k < r->last; k++) {
		double x =
		        ((double)k / RATE_HZ - 1e-3 * gsl_vector_get(p, 1)) / (1e-3 * gsl_vector_get(p, 2));
		double value = fabs(x) < 0.5 ? gsl_vector_get(p, 0) * pow(cos(PI * x), exponent) : 0;

		gsl_vector_set(f, k - r->first, value - r->channel->value_g[k]);
	}
	return GSL_SUCCESS;
}

static void reference_fit(struct reference *reference, const double start[4], double out[4])
{
	gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters();
	size_t size = reference->family == 3 ? 4 : 3, n = reference->last - reference->first;
	gsl_multifit_nlinear_workspace *work;
	gsl_multifit_nlinear_fdf problem = {.f = residual, .n = n, .p = size, .params = reference};
	gsl_vector *p = gsl_vector_alloc(size);
	int info;

	parameters.fdtype = GSL_MULTIFIT_NLINEAR_CTRDIFF;
	parameters.h_df = 1e-5;
	work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &parameters, n, size);
	for (size_t i = 0; i < size; i++)
		gsl_vector_set(p, i, start[i]);
	assert_int_equal(gsl_multifit_nlinear_init(p, &problem, work), GSL_SUCCESS);
	assert_int_equal(gsl_multifit_nlinear_driver(200, 1e-12, 1e-12, 0, NULL, NULL, &info, work),
	                 GSL_SUCCESS);
	for (size_t i = 0; i < size; i++)
		out[i] = gsl_vector_get(gsl_multifit_nlinear_position(work), i);
	gsl_multifit_nlinear_free(work);
	gsl_vector_free(p);
}

/* Same answer as GSL's, to 1e-6. Phases that put no sample on a foot, where the model has a kink. */
static void against_gsl(void **state)
{
	static const double power[] = {1, 2, 1.4};

	(void)state;
	gsl_set_error_handler_off();
	for (int family = 1; family <= 3; family++) {
		for (int i = 0; i < 8; i++) {
			struct synth_random random = {100 + (uint64_t)i};
			enum synth_shape truth =
			        family == 3 ? (enum synth_shape)(i % 3) : (enum synth_shape)(family - 1);
			struct channel channel = make(truth, HEIGHT_G, 0.2 + 0.08 * i, 1, &random);
			struct reference reference = {&channel, 130, 175, family};
			double start[4] = {480, 21.55, 3.05, power[family - 1]}, p[4];
			struct shape shape;

			if (family == 3)
				start[3] = truth == SYNTH_HAVERSINE ? 1.9 : 1.2;
			assert_true(fit(&channel, truth, HEIGHT_G, 1, (enum estimate_family)family, &shape));
			reference_fit(&reference, start, p);
			assert_near_part(shape.peak_g, p[0], 1e-6);
			assert_near_part(shape.peak_s, 1e-3 * p[1], 1e-6);
			assert_near_part(shape.base_s, 1e-3 * p[2], 1e-6);
			if (family == 3)
				assert_near_part(shape.power, p[3], 2e-6);
			synth_free(&channel);
		}
	}
}

/* Cramer-Rao bounds of amplitude, time and base from the derivatives of the synthetic pulse, averaged over
 * the onset; samples above limit_g do not count. */
static void bounds(enum synth_shape truth, double height_g, double noise_g, double limit_g, double bound[3])
{
	enum { PHASES = 16 };

	bound[0] = bound[1] = bound[2] = 0;
	for (int phase = 0; phase < PHASES; phase++) {
		double j[3][3] = {{0}}, det, h = 1e-7;

		for (int k = -5; k < 30; k++) {
			double t = (k - (phase + 0.5) / PHASES) / RATE_HZ - BASE_S / 2, d[3];

			if (height_g * synth_pulse(truth, t / BASE_S + 0.5) > limit_g)
				continue;
			d[0] = synth_pulse(truth, t / BASE_S + 0.5) / noise_g;
			d[1] = height_g / noise_g / (2 * h) *
			       (synth_pulse(truth, (t - h) / BASE_S + 0.5) -
			        synth_pulse(truth, (t + h) / BASE_S + 0.5));
			d[2] = height_g / noise_g / (2 * h) *
			       (synth_pulse(truth, t / (BASE_S + h) + 0.5) -
			        synth_pulse(truth, t / (BASE_S - h) + 0.5));
			for (int a = 0; a < 3; a++)
				for (int b = 0; b < 3; b++)
					j[a][b] += d[a] * d[b];
		}
		det = j[0][0] * (j[1][1] * j[2][2] - j[1][2] * j[1][2]) -
		      j[0][1] * (j[0][1] * j[2][2] - j[1][2] * j[0][2]) +
		      j[0][2] * (j[0][1] * j[1][2] - j[1][1] * j[0][2]);
		bound[0] += (j[1][1] * j[2][2] - j[1][2] * j[1][2]) / det / PHASES;
		bound[1] += (j[0][0] * j[2][2] - j[0][2] * j[0][2]) / det / PHASES;
		bound[2] += (j[0][0] * j[1][1] - j[0][1] * j[0][1]) / det / PHASES;
	}
	for (int i = 0; i < 3; i++)
		bound[i] = sqrt(bound[i]);
}

struct scatter {
	double ratio[3], bias[3], covered[3], area_covered;
	int doubtful, refused;
};

static struct scatter repeat(enum synth_shape truth, double height_g, double noise_g, double limit_g,
                             enum estimate_family family, uint64_t seed, int times)
{
	struct synth_random random = {seed};
	struct scatter s = {{0}, {0}, {0}, 0, 0, 0};
	double bound[3], square[3] = {0};

	bounds(truth, height_g, noise_g, limit_g, bound);
	for (int i = 0; i < times; i++) {
		double phase = synth_uniform(&random), error[3], sigma[3];
		struct channel channel = make(truth, height_g, phase, noise_g, &random);
		struct shape shape;

		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] = fmin(channel.value_g[k], limit_g);
		if (!fit(&channel, truth, fmin(height_g, limit_g), noise_g, family, &shape))
			fail_msg("seed %u, drop %d: no fit", (unsigned)seed, i);
		error[0] = shape.peak_g - height_g;
		error[1] = shape.peak_s - ONSET_S - phase / RATE_HZ - BASE_S / 2;
		error[2] = shape.base_s - BASE_S;
		sigma[0] = shape.sigma_peak_g;
		sigma[1] = shape.sigma_peak_s;
		sigma[2] = shape.sigma_base_s;
		for (int j = 0; j < 3; j++) {
			square[j] += error[j] * error[j] / times;
			s.bias[j] += error[j] / times / bound[j];
			s.covered[j] += fabs(error[j]) <= 2 * sigma[j] ? 100.0 / times : 0;
		}
		s.area_covered += fabs(shape.area_g_s - height_g * BASE_S * synth_pulse_area(truth)) <=
		                                  2 * shape.sigma_area_g_s
		                          ? 100.0 / times
		                          : 0;
		s.doubtful += shape_judge(&shape) == SHAPE_DOUBTFUL;
		s.refused += shape_judge(&shape) == SHAPE_REFUSED;
		synth_free(&channel);
	}
	for (int j = 0; j < 3; j++)
		s.ratio[j] = sqrt(square[j]) / bound[j];
	printf("seed %u, shape %d by %s, %g g of %g: ratio %.3f %.3f %.3f, covered %.1f %.1f %.1f, area %.1f "
	       "%%, "
	       "doubtful %d refused %d\n",
	       (unsigned)seed, (int)truth, estimate_family_name(family), noise_g, height_g, s.ratio[0],
	       s.ratio[1], s.ratio[2], s.covered[0], s.covered[1], s.covered[2], s.area_covered, s.doubtful,
	       s.refused);
	return s;
}

/* At the bound, with bars that hold, for the family that is the pulse's. 500 drops: the ratio's own
 * standard deviation is 0.03. */
static void at_the_bound(void **state)
{
	static const double level[] = {0.3, 3, 10};

	(void)state;
	for (int family = 1; family <= 2; family++) {
		for (unsigned i = 0; i < 3; i++) {
			struct scatter s = repeat((enum synth_shape)(family - 1), HEIGHT_G, level[i],
			                          INFINITY, (enum estimate_family)family, 200 + i, 500);

			for (int j = 0; j < 3; j++) {
				assert_true(s.ratio[j] > 0.9 && s.ratio[j] < 1.12);
				assert_true(fabs(s.bias[j]) < 0.15);
				assert_true(s.covered[j] > 92 && s.covered[j] < 98.5);
			}
			assert_true(s.area_covered > 92 && s.area_covered < 98.5);
			assert_true(s.doubtful < 15 && s.refused <= 1);
		}
	}
}

/* A free power costs a sixth in height and nothing in time. */
static void free_power(void **state)
{
	struct scatter s =
	        repeat(SYNTH_HALF_SINE, HEIGHT_G, 1, INFINITY, ESTIMATE_FAMILY_SINE_POWER, 210, 500);

	(void)state;
	assert_true(s.ratio[0] > 1.05 && s.ratio[0] < 1.28);
	assert_true(s.ratio[1] > 0.9 && s.ratio[1] < 1.12);
	assert_true(s.covered[0] > 92 && s.covered[1] > 92 && s.covered[2] > 92);
}

/* Flat tops: as good as leaving out what is above the limit, and better than that near it. */
static void censored(void **state)
{
	static const double height[] = {520, 696};
	static const double level[] = {1, 10};

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		struct scatter s = repeat(SYNTH_HALF_SINE, height[i % 2], level[i / 2], 500,
		                          ESTIMATE_FAMILY_HALF_SINE, 220 + i, 400);

		for (int j = 0; j < 2; j++)
			assert_true(s.ratio[j] > 0.85 && s.ratio[j] < 1.15);
		assert_true(fabs(s.bias[0]) < 0.2);
		assert_true(s.covered[0] > 90 && s.covered[0] < 98.5);
	}
}

/* Another pulse than the family's must not look good, not even under much noise. */
static void other_pulses(void **state)
{
	static const struct {
		enum synth_shape truth;
		enum estimate_family family;
		double noise_g;
		int seen; /* of 200, at least */
	} pair[] = {
	        {SYNTH_HAVERSINE, ESTIMATE_FAMILY_HALF_SINE, 1, 200},
	        {SYNTH_HAVERSINE, ESTIMATE_FAMILY_HALF_SINE, 10, 195},
	        {SYNTH_HERTZ, ESTIMATE_FAMILY_HALF_SINE, 3, 200},
	        {SYNTH_HERTZ, ESTIMATE_FAMILY_HALF_SINE, 10, 190},
	        {SYNTH_HALF_SINE, ESTIMATE_FAMILY_HAVERSINE, 10, 195},
	        {SYNTH_HERTZ, ESTIMATE_FAMILY_HAVERSINE, 1, 150},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(pair) / sizeof(pair[0]); i++) {
		struct scatter s = repeat(pair[i].truth, HEIGHT_G, pair[i].noise_g, INFINITY, pair[i].family,
		                          230 + i, 200);

		assert_true(s.doubtful + s.refused >= pair[i].seen);
	}
}

static void lopsided(void **state)
{
	(void)state;
	for (unsigned truth = 0; truth < SYNTH_SHAPES; truth++) {
		for (int i = 0; i < 40; i++) {
			struct synth_random random = {240 + (uint64_t)i};
			double noise = i % 2 ? 0.3 : 10;
			struct channel channel = make(truth, HEIGHT_G, i / 40.0, noise, &random);
			struct shape shape;

			assert_true(fit(&channel, truth, HEIGHT_G, noise, ESTIMATE_FAMILY_HALF_SINE, &shape));
			if (truth == SYNTH_HUNT_CROSSLEY)
				assert_int_equal(shape_judge(&shape), SHAPE_REFUSED);
			if (shape_lopsided(&shape) != (truth == SYNTH_HUNT_CROSSLEY) ||
			    shape_hopeless(&shape) != (truth == SYNTH_HUNT_CROSSLEY))
				fail_msg("shape %u, seed %d: skew %.1f, chi-square %.1f", truth, 240 + i,
				         shape.skew_z, shape.chi_square);
			synth_free(&channel);
		}
	}
}

/* What a plate does is no contact pulse, of whatever family; a half-sine's fit alone tells. */
static void hopeless(void **state)
{
	enum { POINTS = 60000 };
	static double plate[POINTS];
	struct synth_random random = {245};

	(void)state;
	for (unsigned truth = 0; truth < SYNTH_HUNT_CROSSLEY; truth++) {
		struct channel channel = make(truth, 0, 0, 1, &random);
		struct shape_start start = {560, ONSET_S + 3.13e-3, 2.7e-3, INFINITY, -INFINITY};
		struct shape shape;
		struct trace trace;

		synth_plate(plate, POINTS, truth, BASE_S, 129, 0.1);
		for (size_t k = 0; k < channel.count; k++)
			channel.value_g[k] += HEIGHT_G * synth_table(plate, POINTS, SYNTH_STEP_S,
			                                             (double)k / RATE_HZ - ONSET_S);
		assert_int_equal(trace_open(&trace, &channel, -INFINITY, INFINITY), 0);
		trace.noise_g = 1;
		assert_true(shape_fit(&shape, &trace, ESTIMATE_FAMILY_HALF_SINE, &start));
		assert_true(shape_hopeless(&shape));
		trace_close(&trace);
		synth_free(&channel);
	}
}

/* Holes cost certainty only, and the sign is the pulse's. */
static void holes_and_sign(void **state)
{
	struct synth_random random = {250};
	struct channel channel = make(SYNTH_HAVERSINE, -HEIGHT_G, 0.3, 1, &random);
	struct shape whole, shape;

	(void)state;
	assert_true(fit(&channel, SYNTH_HAVERSINE, -HEIGHT_G, 1, ESTIMATE_FAMILY_HAVERSINE, &whole));
	assert_near(whole.peak_g, -HEIGHT_G, 1.5);
	assert_near(whole.area_g_s, -HEIGHT_G * BASE_S / 2, 3e-3);
	synth_lose(&channel, 148, 5);
	assert_true(fit(&channel, SYNTH_HAVERSINE, -HEIGHT_G, 1, ESTIMATE_FAMILY_HAVERSINE, &shape));
	assert_near(shape.peak_g, -HEIGHT_G, 3 * shape.sigma_peak_g);
	assert_true(shape.sigma_peak_g > 1.2 * whole.sigma_peak_g &&
	            shape.sigma_peak_g < 4 * whole.sigma_peak_g);
	synth_free(&channel);
	/* A sign of its own against a limit, too. */
	channel = make(SYNTH_HALF_SINE, -560, 0.3, 1, &random);
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = fmax(channel.value_g[k], -500);
	assert_true(fit(&channel, SYNTH_HALF_SINE, -500, 1, ESTIMATE_FAMILY_HALF_SINE, &shape));
	assert_near(shape.peak_g, -560, 3 * shape.sigma_peak_g);
	synth_free(&channel);
}

/* Value, slope and curvature against differences, and the variance of the value at the peak is the peak's. */
static void evaluated(void **state)
{
	(void)state;
	for (int family = 1; family <= 3; family++) {
		struct synth_random random = {260};
		struct channel channel = make(SYNTH_HERTZ, HEIGHT_G, 0.7, 1, &random);
		double d[3], before[3], after[3], variance[2], none[2], h = 1e-6;
		struct shape shape;

		assert_true(fit(&channel, SYNTH_HERTZ, HEIGHT_G, 1, (enum estimate_family)family, &shape));
		shape_at(&shape, shape.peak_s, d, variance);
		assert_near_part(d[0], shape.peak_g, 1e-12);
		assert_near_part(sqrt(variance[0]), shape.sigma_peak_g, 1e-9);
		assert_near_part(sqrt(variance[1]) / fabs(d[2]), shape.sigma_peak_s, 1e-4);
		shape_at(&shape, shape.peak_s + 0.6e-3, d, variance);
		shape_at(&shape, shape.peak_s + 0.6e-3 - h, before, none);
		shape_at(&shape, shape.peak_s + 0.6e-3 + h, after, none);
		assert_near_part(d[1], (after[0] - before[0]) / (2 * h), 1e-5);
		assert_near_part(d[2], (after[1] - before[1]) / (2 * h), 1e-4);
		shape_at(&shape, shape.peak_s + 2 * shape.base_s, d, variance);
		assert_near(d[0], 0, 0);
		synth_free(&channel);
	}
}

static void degenerate(void **state)
{
	struct synth_random random = {270};
	struct channel channel = make(SYNTH_HALF_SINE, HEIGHT_G, 0.3, 0, &random);
	struct shape shape;

	(void)state;
	/* No noise known: fits exactly, and nothing is refused. */
	assert_true(fit(&channel, SYNTH_HALF_SINE, HEIGHT_G, NAN, ESTIMATE_FAMILY_HALF_SINE, &shape));
	assert_near_part(shape.peak_g, HEIGHT_G, 1e-9);
	assert_true(isnan(shape.chi_square) && shape_judge(&shape) == SHAPE_FITS);
	synth_lose(&channel, 140, 19);
	assert_false(fit(&channel, SYNTH_HALF_SINE, HEIGHT_G, 1, ESTIMATE_FAMILY_HALF_SINE, &shape));
	synth_free(&channel);
	channel = make(SYNTH_HALF_SINE, 0, 0, 1, &random);
	for (int family = 1; family <= 3; family++)
		if (fit(&channel, SYNTH_HALF_SINE, 2, 1, (enum estimate_family)family, &shape))
			assert_true(isfinite(shape.sigma_peak_g) && isfinite(shape.base_s));
	synth_free(&channel);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(against_gsl), cmocka_unit_test(at_the_bound),   cmocka_unit_test(free_power),
	        cmocka_unit_test(censored),    cmocka_unit_test(other_pulses),   cmocka_unit_test(lopsided),
	        cmocka_unit_test(hopeless),    cmocka_unit_test(holes_and_sign), cmocka_unit_test(evaluated),
	        cmocka_unit_test(degenerate),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
