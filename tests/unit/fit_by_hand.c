/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/fit_by_hand.h"

#include <math.h>
#include <string.h>

#include <gsl/gsl_randist.h>

#include "common/units.h"
#include "hil/product.h"
#include "hil/sensor.h"

#define STEP_S 5e-6

static void go_on(struct product *p, double span_s)
{
	while (span_s > 0)
		span_s -= product_step(p, span_s);
}

static void reading(const struct product *p, const struct by_hand *h, double mix[2][4], double felt[4])
{
	struct product_reading r;
	double x[2], y[2];

	product_read(p, &r);
	x[0] = r.s1_x / UNITS_G_M_S2;
	y[0] = r.s1_y / UNITS_G_M_S2;
	x[1] = r.s2_x / UNITS_G_M_S2;
	y[1] = r.s2_y / UNITS_G_M_S2;
	for (int s = 0; s < 2; s++) {
		felt[2 * s] = (mix[s][0] + h->common[2 * s]) * x[s] + mix[s][1] * y[s];
		felt[2 * s + 1] = mix[s][2] * x[s] + (mix[s][3] + h->common[2 * s + 1]) * y[s];
	}
}

static void sample(const struct by_hand *h, gsl_rng *random, double *tremble, double g, double *value,
                   uint8_t *mark)
{
	double keep = h->colour;

	*tremble = keep * *tremble + sqrt(1 - keep * keep) * gsl_ran_gaussian_ziggurat(random, h->noise_g);
	*value = round((g + *tremble) * 32) / 32;
	*mark = 0;
	if (h->clip_g > 0 && fabs(*value) > h->clip_g) {
		*value = copysign(h->clip_g, *value);
		*mark = 2;
	}
}

static void scatter(const struct by_hand *h, gsl_rng *random, struct by_hand_drop *d, double mix[2][4])
{
	const struct scene *s = &h->truth;

	d->angle_deg = s->drop_angle_deg + gsl_ran_gaussian_ziggurat(random, 1);
	d->speed_m_s = sqrt(2 * s->drop_gravity_m_s2 * s->drop_height_m) *
	               (1 + gsl_ran_gaussian_ziggurat(random, .003));
	for (int k = 0; k < 2; k++)
		for (int i = 0; i < 4; i++)
			mix[k][i] = (i % 3 == 0) + gsl_ran_gaussian_ziggurat(random, h->gain_sd[k]);
}

void by_hand_drop(const struct by_hand *h, gsl_rng *random, struct by_hand_drop *d)
{
	const double rate[] = {7000, 10000};
	double mix[2][4], felt[4], t = 0, touch = BY_HAND_BEFORE_MS * 1e-3 + gsl_rng_uniform(random) * 1e-3;
	double tremble[4] = {0}, ring = 0, ring_rate = 0;
	size_t done[4] = {0};
	struct product p;
	struct sensor sensor[4];

	memset(d, 0, sizeof(*d));
	scatter(h, random, d, mix);
	product_init(&p, &h->truth, UNITS_RAD(d->angle_deg));
	product_strike(&p, d->speed_m_s);
	for (int a = 0; a < 4; a++) {
		sensor[a] = (struct sensor){h->truth.sensor_iepe_time_constant_s, 0, 0, 0};
		d->drop.axis[a] = (struct fit_channel){d->value[a], d->sample[a],
		                                       a % 2 ? BY_HAND_Y : BY_HAND_X, rate[a % 2], 0};
	}
	for (;; t += STEP_S) {
		double before[4], w = 2 * UNITS_PI * h->mode_hz;
		bool all = true;

		for (int a = 0; a < 4; a++)
			before[a] = sensor[a].output_g;
		if (t > 0)
			go_on(&p, STEP_S);
		reading(&p, h, mix, felt);
		if (h->mode_hz > 0) {
			ring_rate +=
			        STEP_S * (w * w * (h->mode_share * felt[2] - ring) - 2 * .02 * w * ring_rate);
			ring += STEP_S * ring_rate;
			felt[3] += ring;
		}
		for (int a = 0; a < 4; a++) {
			double late = a >= 2 ? h->late_s : 0, at;

			sensor_advance(&sensor[a],
			               sensor_fading(sensor[a].time_constant_s, t > 0 ? STEP_S : 0),
			               t > 0 ? felt[a] : 0);
			for (; done[a] < d->drop.axis[a].count; done[a]++) {
				at = (double)done[a] / rate[a % 2] - touch - late;
				if (at > t)
					break;
				sample(h, random, &tremble[a],
				       at <= 0 ? 0
				               : before[a] + (sensor[a].output_g - before[a]) *
				                                     (1 - (t - at) / STEP_S),
				       &d->value[a][done[a]], &d->sample[a][done[a]]);
			}
			all = all && done[a] == d->drop.axis[a].count;
		}
		if (all)
			break;
	}
	d->drop.angle_deg = h->truth.drop_angle_deg;
	d->drop.height_m = h->truth.drop_height_m;
}

struct peak {
	double at_s, most, before, last;
};

/* The top of the parabola through three readings 1 us apart. */
static void peak_follow(struct peak *k, double t, double now)
{
	double bend = k->before - 2 * k->last + now;

	if (k->last > k->most && k->last >= k->before && k->last >= now && bend < 0) {
		k->most = k->last;
		k->at_s = t - 1e-6 - .5 * (now - k->before) / bend * 1e-6;
	}
	k->before = k->last;
	k->last = now;
}

struct by_hand_truth by_hand_truth(const struct by_hand *h, const struct by_hand_drop *d)
{
	struct by_hand_truth truth = {0};
	struct product p;
	struct product_reading r;
	struct peak peak[2] = {{0}}, x[2] = {{0}};
	double mass = h->truth.mount_plate_mass_kg + h->truth.product_case_mass_kg;
	double low = 0, depth = 0, up = 0;

	product_init(&p, &h->truth, UNITS_RAD(d->angle_deg));
	product_strike(&p, d->speed_m_s);
	for (double t = 1e-6; t < 20e-3; t += 1e-6) {
		double c, s, now, now_up;

		go_on(&p, 1e-6);
		product_read(&p, &r);
		peak_follow(&peak[0], t, hypot(r.s1_x, r.s1_y));
		peak_follow(&peak[1], t, hypot(r.s2_x, r.s2_y));
		peak_follow(&x[0], t, r.s1_x);
		peak_follow(&x[1], t, r.s2_x);
		c = cos(p.state[PRODUCT_ANGLE]);
		s = sin(p.state[PRODUCT_ANGLE]);
		now = -(p.state[PRODUCT_Y] - p.lever_x_m * c - p.lever_y_m * s);
		now_up = (h->truth.product_case_mass_kg * p.state[PRODUCT_VY] +
		          h->truth.mount_plate_mass_kg * p.state[PRODUCT_PLATE_VY]) /
		         mass;
		if (truth.contact_s == 0 && now <= 0 && t > 1e-4) {
			low = depth / (depth - now);
			truth.contact_s = t - 1e-6 + low * 1e-6;
			truth.restitution = (up + low * (now_up - up)) / d->speed_m_s;
			truth.spin_rad_s = fabs(p.state[PRODUCT_SPIN]);
		}
		depth = now;
		up = now_up;
	}
	truth.lag_s = peak[0].at_s - peak[1].at_s;
	truth.lag_x_s = x[0].at_s - x[1].at_s;
	return truth;
}
