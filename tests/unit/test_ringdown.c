/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include <gsl/gsl_blas.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "host/estimate/ringdown.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

/* The study's decay on X of geometry 2A: 129 Hz damped, ratio 0.1, 314 g at the end of contact. */
struct decay {
	double hz, damping, amplitude_g, phase, offset_g, noise_g, rate_hz, length_s;
};

static const struct decay plain = {129, 0.1, 314, 0.7, 0, 0, 7000, 0.2};

static struct channel make(const struct decay *d, struct synth_random *random)
{
	struct channel channel = synth_channel("S1X", d->rate_hz, 0, (size_t)(d->length_s * d->rate_hz));
	double w = 2 * PI * d->hz, a = w * d->damping / sqrt(1 - d->damping * d->damping);

	for (size_t k = 0; k < channel.count; k++) {
		double t = (double)k / d->rate_hz;

		channel.value_g[k] = d->offset_g + d->amplitude_g * exp(-a * t) * cos(w * t + d->phase);
		if (d->noise_g > 0)
			channel.value_g[k] += d->noise_g * synth_normal(random);
	}
	return channel;
}

static struct ringdown find(const struct channel *channel, double noise_g, double until_s)
{
	struct ringdown ringdown;
	struct trace trace;

	assert_int_equal(trace_open(&trace, channel, -INFINITY, INFINITY), 0);
	trace.noise_g = noise_g;
	ringdown_find(&trace, 0, until_s, 400, &ringdown);
	trace_close(&trace);
	return ringdown;
}

static void exact(void **state)
{
	static const double damping[] = {0.003, 0.01, 0.05, 0.1, 0.2};

	(void)state;
	for (size_t i = 0; i < sizeof(damping) / sizeof(damping[0]); i++) {
		for (int phase = 0; phase < 8; phase++) {
			struct decay d = plain;
			struct channel channel;
			struct ringdown r;

			d.damping = damping[i];
			d.phase = phase * PI / 4;
			d.offset_g = -3;
			channel = make(&d, NULL);
			r = find(&channel, 0.01, INFINITY);
			assert_int_equal(r.result.how.status, ESTIMATE_OK);
			assert_near(r.result.frequency_hz, 129, 1e-6);
			assert_near(r.result.damping_ratio, damping[i], 1e-8);
			assert_near(r.result.natural_frequency_hz, 129 / sqrt(1 - damping[i] * damping[i]),
			            1e-6);
			assert_near(r.amplitude_g, 314, 1e-3);
			assert_near(r.offset_g, -3, 1e-3);
			/* Exact but for straight lines at the crossings; not there once it has died away. */
			if (damping[i] < 0.15)
				assert_near(r.result.three_cycle_frequency_hz, 129, 0.05);
			synth_free(&channel);
		}
	}
}

/* The bound, for 45 ms and no offset: 0.01886 Hz and 1.36e-4 at 1 g; the offset and five cycles cost little.
 * The study's fits lie within 1.1 of it. */
static void noise(void **state)
{
	static const double level[] = {0.3, 1, 3, 10};
	enum { TIMES = 300 };

	(void)state;
	for (size_t l = 0; l < sizeof(level) / sizeof(level[0]); l++) {
		double hz = 0, damping = 0, mean = 0;
		int covered = 0, damping_covered = 0;
		struct synth_random random = {500 + l};

		for (int i = 0; i < TIMES; i++) {
			struct decay d = plain;
			struct channel channel;
			struct ringdown r;

			d.phase = 2 * PI * synth_uniform(&random);
			d.offset_g = -3;
			d.noise_g = level[l];
			channel = make(&d, &random);
			r = find(&channel, level[l], INFINITY);
			assert_int_equal(r.result.how.status, ESTIMATE_OK);
			mean += (r.result.frequency_hz - 129) / TIMES;
			hz += pow(r.result.frequency_hz - 129, 2) / TIMES;
			damping += pow(r.result.damping_ratio - 0.1, 2) / TIMES;
			covered += fabs(r.result.frequency_hz - 129) < 2 * r.result.sigma_hz;
			damping_covered += fabs(r.result.damping_ratio - 0.1) < 2 * r.result.sigma_damping;
			synth_free(&channel);
		}
		hz = sqrt(hz) / (0.01886 * level[l]);
		damping = sqrt(damping) / (1.36e-4 * level[l]);
		printf("seed %zu, %g g: %.3f and %.3f of the bounds, bias %+.4f Hz, covered %d and %d of "
		       "%d\n",
		       500 + l, level[l], hz, damping, mean, covered, damping_covered, TIMES);
		assert_true(hz > 0.85 && hz < 1.15 && damping > 0.85 && damping < 1.15);
		assert_true(fabs(mean) < 0.2 * 0.01886 * level[l]);
		assert_true(covered > 0.9 * TIMES && covered < 0.99 * TIMES);
		assert_true(damping_covered > 0.9 * TIMES && damping_covered < 0.99 * TIMES);
	}
}

/* 3 g of offset moves neither value. */
static void offset(void **state)
{
	struct synth_random random = {600}, again = {600};
	struct decay d = plain;
	struct channel without, with;
	struct ringdown a, b;

	(void)state;
	d.noise_g = 1;
	without = make(&d, &random);
	d.offset_g = 3;
	with = make(&d, &again);
	a = find(&without, 1, INFINITY);
	b = find(&with, 1, INFINITY);
	assert_near(a.result.frequency_hz, b.result.frequency_hz, 1e-5);
	assert_near(a.result.damping_ratio, b.result.damping_ratio, 1e-7);
	assert_near(a.result.three_cycle_frequency_hz, b.result.three_cycle_frequency_hz, 0.01);
	assert_near(b.result.three_cycle_frequency_hz, 129, 0.6);
	synth_free(&without);
	synth_free(&with);
}

/* Holes and clipped samples are left out, not filled. */
static void holes(void **state)
{
	struct synth_random random = {700};
	struct decay d = plain;
	struct channel channel;
	struct ringdown r;

	(void)state;
	d.noise_g = 1;
	channel = make(&d, &random);
	synth_lose(&channel, 20, 7);
	synth_lose(&channel, 55, 21);
	for (size_t k = 0; k < channel.count; k++) {
		if (synth_uniform(&random) < 0.1)
			synth_lose(&channel, k, 1);
		if (fabs(channel.value_g[k]) > 200) {
			channel.value_g[k] = channel.value_g[k] < 0 ? -200 : 200;
			channel.sample[k] |= SAMPLE_CLIPPED;
		}
	}
	r = find(&channel, 1, INFINITY);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_near(r.result.frequency_hz, 129, 3 * r.result.sigma_hz);
	assert_near(r.result.damping_ratio, 0.1, 3 * r.result.sigma_damping);
	assert_true(r.result.sigma_hz > 0.02 && r.result.sigma_hz < 0.08);
	synth_free(&channel);
}

/* Mounts that stiffen by 5 % as the swing dies away: no single frequency is right, and the bar must say so.
 */
static void stiffening(void **state)
{
	struct synth_random random = {750};
	struct decay d = plain;
	struct channel channel = make(&d, NULL);
	double angle = 0.7, a = 2 * PI * 129 * 0.1 / sqrt(0.99), step = 1 / d.rate_hz;
	struct ringdown r;

	(void)state;
	for (size_t k = 0; k < channel.count; k++) {
		double swing = exp(-a * (double)k * step);

		channel.value_g[k] = 314 * swing * cos(angle) + 0.3 * synth_normal(&random);
		angle += 2 * PI * 129 * step * (1.05 - 0.05 * swing);
	}
	r = find(&channel, 0.3, INFINITY);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_true(r.result.frequency_hz > 129 && r.result.frequency_hz < 129 * 1.05);
	/* Four times what noise alone would leave, 0.0057 Hz. */
	assert_true(r.result.sigma_hz > 4 * 0.0057 && r.result.sigma_hz < 1);
	assert_true(r.result.three_cycle_frequency_hz > 129 &&
	            r.result.three_cycle_frequency_hz < 129 * 1.05);
	synth_free(&channel);
}

/* The same least squares by GSL, from the true values. */
struct gsl_data {
	const struct channel *channel;
	size_t count;
};

static int gsl_residual(const gsl_vector *p, void *context, gsl_vector *residual)
{
	const struct gsl_data *data = context;

	for (size_t k = 0; k < data->count; k++) {
		double t = (double)k / data->channel->rate_hz, w = gsl_vector_get(p, 1);
		double swing = gsl_vector_get(p, 2) * cos(w * t) + gsl_vector_get(p, 3) * sin(w * t);

		gsl_vector_set(residual, k,
		               exp(-gsl_vector_get(p, 0) * t) * swing + gsl_vector_get(p, 4) -
		                       data->channel->value_g[k]);
	}
	return GSL_SUCCESS;
}

static void against_gsl(void **state)
{
	struct synth_random random = {800};
	struct decay d = plain;
	struct channel channel;
	struct ringdown r;
	struct gsl_data data;
	gsl_multifit_nlinear_parameters how = gsl_multifit_nlinear_default_parameters();
	double w = 2 * PI * 129, start[5] = {0.1 * w, w, 314 * cos(0.7), -314 * sin(0.7), 0}, sigma, squares;
	gsl_vector_view view = gsl_vector_view_array(start, 5);
	gsl_matrix *covariance = gsl_matrix_alloc(5, 5);
	gsl_multifit_nlinear_workspace *work;
	gsl_multifit_nlinear_fdf system;
	int info;

	(void)state;
	gsl_set_error_handler_off();
	d.noise_g = 2;
	channel = make(&d, &random);
	/* A noise of 0 known: the residual alone tells. Five cycles of the start frequency, which the zero
	 * crossings give to a few parts in a thousand: end between two samples, for both the same. */
	r = find(&channel, 0, 0.0385);
	data = (struct gsl_data){&channel, (size_t)ceil(0.0385 * 7000)};
	system = (gsl_multifit_nlinear_fdf){.f = gsl_residual, .n = data.count, .p = 5, .params = &data};
	work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &how, data.count, 5);
	assert_int_equal(gsl_multifit_nlinear_init(&view.vector, &system, work), GSL_SUCCESS);
	assert_int_equal(gsl_multifit_nlinear_driver(100, 1e-12, 1e-12, 0, NULL, NULL, &info, work),
	                 GSL_SUCCESS);
	gsl_multifit_nlinear_covar(gsl_multifit_nlinear_jac(work), 0, covariance);
	gsl_blas_ddot(gsl_multifit_nlinear_residual(work), gsl_multifit_nlinear_residual(work), &squares);
	sigma = sqrt(squares / (double)(data.count - 5) * gsl_matrix_get(covariance, 1, 1)) / (2 * PI);
	w = gsl_vector_get(gsl_multifit_nlinear_position(work), 1) / (2 * PI);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_near(r.result.frequency_hz, w, 1e-5);
	assert_near_part(r.result.sigma_hz, sigma, 1e-3);
	gsl_multifit_nlinear_free(work);
	gsl_matrix_free(covariance);
	synth_free(&channel);
}

/* What is no decay gives no frequency. */
static void nothing(void **state)
{
	struct synth_random random = {900};
	struct channel channel = synth_channel("S2X", 7000, 0, 2800);
	struct ringdown r;

	(void)state;
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = synth_normal(&random) - 3 * exp(-(double)k / 7000 / 0.3);
	r = find(&channel, 1, INFINITY);
	assert_int_equal(r.result.how.status, ESTIMATE_NO_PEAK);
	assert_true(isnan(r.result.frequency_hz) && isnan(r.result.damping_ratio) &&
	            isnan(r.result.sigma_hz));
	/* The tail of a pulse, without noise. */
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 40 * exp(-(double)k / 7000 / 0.001);
	assert_int_equal(find(&channel, 0, INFINITY).result.how.status, ESTIMATE_NO_PEAK);
	/* Something that grows, and noise alone. */
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 50 * exp((double)k / 500) * cos((double)k / 10);
	assert_true(find(&channel, 1, INFINITY).result.how.status != ESTIMATE_OK);
	for (size_t k = 0; k < channel.count; k++)
		channel.value_g[k] = 100 * synth_normal(&random);
	assert_true(find(&channel, 1, INFINITY).result.how.status != ESTIMATE_OK);
	synth_free(&channel);
}

static void too_short(void **state)
{
	struct channel channel = make(&plain, NULL);
	struct ringdown r;

	(void)state;
	/* Less than a cycle, by the trace's end or by the next contact. */
	assert_int_equal(find(&channel, 0.1, 0.005).result.how.status, ESTIMATE_SHORT);
	channel.count = 40;
	assert_int_equal(find(&channel, 0.1, INFINITY).result.how.status, ESTIMATE_SHORT);
	for (size_t n = 0; n < 3; n++) {
		channel.count = n;
		assert_int_equal(find(&channel, 0.1, INFINITY).result.how.status, ESTIMATE_SHORT);
	}
	/* Two cycles are enough for a fit, not for three cycles end to end. */
	channel.count = 110;
	r = find(&channel, 0.1, INFINITY);
	assert_int_equal(r.result.how.status, ESTIMATE_OK);
	assert_near(r.result.frequency_hz, 129, 1e-4);
	assert_true(isnan(r.result.three_cycle_frequency_hz));
	synth_free(&channel);
}

static void combined(void **state)
{
	struct ringdown x = {.result = {.frequency_hz = 129,
	                                .sigma_hz = 0.02,
	                                .natural_frequency_hz = 130,
	                                .damping_ratio = 0.1,
	                                .sigma_damping = 1e-4,
	                                .three_cycle_frequency_hz = 128,
	                                .how = {.method = "least_squares", .status = ESTIMATE_OK}}},
	                y = x;
	struct estimate_ringdown both;

	(void)state;
	y.result.frequency_hz = 129.06;
	y.result.sigma_hz = 0.04;
	y.result.three_cycle_frequency_hz = 129;
	ringdown_combine(&x, &y, &both);
	assert_int_equal(both.how.status, ESTIMATE_OK);
	assert_near(both.frequency_hz, 129 + 0.06 / 5, 1e-9);
	/* 1/sqrt(1/.02^2 + 1/.04^2), widened by sqrt(chi2) = 0.06 / hypot(.02, .04). */
	assert_near(both.sigma_hz, 0.0178885438 * 0.06 / 0.0447213595, 1e-8);
	assert_near(both.three_cycle_frequency_hz, 128.5, 1e-9);
	y.result.how.status = ESTIMATE_NO_PEAK;
	ringdown_combine(&x, &y, &both);
	assert_near(both.frequency_hz, 129, 0);
	ringdown_combine(&y, &x, &both);
	assert_near(both.frequency_hz, 129, 0);
	y.result.how.status = ESTIMATE_OK;
	y.result.frequency_hz = 177;
	ringdown_combine(&x, &y, &both);
	assert_int_equal(both.how.status, ESTIMATE_AMBIGUOUS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(exact),   cmocka_unit_test(noise),      cmocka_unit_test(offset),
	        cmocka_unit_test(holes),   cmocka_unit_test(stiffening), cmocka_unit_test(against_gsl),
	        cmocka_unit_test(nothing), cmocka_unit_test(too_short),  cmocka_unit_test(combined),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
