/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/synth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

enum { TABLE = 8000 };

double synth_uniform(struct synth_random *random)
{
	uint64_t z = (random->state += 0x9E3779B97F4A7C15u);

	z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
	z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
	return (double)((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}

double synth_normal(struct synth_random *random)
{
	double radius = sqrt(-2 * log(1 - synth_uniform(random)));

	return radius * cos(2 * PI * synth_uniform(random));
}

double synth_table(const double *value, size_t count, double step, double x)
{
	double place = x / step;
	size_t k;

	if (!(place >= 0) || place >= (double)(count - 1))
		return 0;
	k = (size_t)place;
	place -= (double)k;
	return value[k] * (1 - place) + value[k + 1] * place;
}

/* d'' = -d^1.5 (1 + damping d') from d = 0, d' = 1 until the force is gone, then scaled to 1 by 1. Damping
 * 0 is Hertz; 1.43275053327 is Hunt-Crossley with a restitution of 0.5. */
struct contact {
	double force[TABLE + 1];
	double area;
	int ready;
};

static double push(double d, double v, double damping)
{
	double force = d > 0 ? d * sqrt(d) * (1 + damping * v) : 0;

	return force > 0 ? force : 0;
}

static double runge_kutta(double *d, double *v, double h, double damping)
{
	double v1 = *v, a1 = -push(*d, *v, damping);
	double v2 = *v + h / 2 * a1, a2 = -push(*d + h / 2 * v1, v2, damping);
	double v3 = *v + h / 2 * a2, a3 = -push(*d + h / 2 * v2, v3, damping);
	double v4 = *v + h * a3, a4 = -push(*d + h * v3, v4, damping);

	*d += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
	*v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
	return push(*d, *v, damping);
}

static void make_contact(struct contact *contact, double damping, double base)
{
	double d = 0, v = 1, h = base / TABLE, most = 0, sum = 0;

	contact->force[0] = 0;
	for (int i = 1; i <= TABLE; i++) {
		contact->force[i] = runge_kutta(&d, &v, h, damping);
		most = fmax(most, contact->force[i]);
	}
	for (int i = 0; i <= TABLE; i++) {
		contact->force[i] /= most;
		sum += contact->force[i] / TABLE;
	}
	contact->area = sum;
	contact->ready = 1;
}

/* Durations in these units: 2.94327518433 * 1.25^0.4 and, from a quadrature elsewhere, 3.60356058405. */
static const struct contact *contact_of(enum synth_shape shape)
{
	static struct contact hertz, hunt_crossley;

	if (!hertz.ready)
		make_contact(&hertz, 0, 2.94327518433 * pow(1.25, 0.4));
	if (!hunt_crossley.ready)
		make_contact(&hunt_crossley, 1.43275053327138, 3.60356058404614);
	return shape == SYNTH_HERTZ ? &hertz : &hunt_crossley;
}

double synth_pulse(enum synth_shape shape, double x)
{
	if (!(x > 0) || x >= 1)
		return 0;
	if (shape == SYNTH_HALF_SINE)
		return sin(PI * x);
	if (shape == SYNTH_HAVERSINE)
		return pow(sin(PI * x), 2);
	return synth_table(contact_of(shape)->force, TABLE + 1, 1.0 / TABLE, x);
}

double synth_pulse_summit(enum synth_shape shape)
{
	return shape == SYNTH_HUNT_CROSSLEY ? 0.251244620 : 0.5;
}

double synth_pulse_area(enum synth_shape shape)
{
	if (shape == SYNTH_HALF_SINE)
		return 2 / PI;
	return shape == SYNTH_HAVERSINE ? 0.5 : contact_of(shape)->area;
}

void synth_plate(double *value, size_t count, enum synth_shape shape, double base_s, double natural_hz,
                 double damping)
{
	double w = 2 * PI * natural_hz, z = 0, v = 0, h = SYNTH_STEP_S;

	for (size_t i = 0; i < count; i++) {
		double t = (double)i * h;
		double b1 = synth_pulse(shape, t / base_s), b2 = synth_pulse(shape, (t + h / 2) / base_s);
		double b3 = synth_pulse(shape, (t + h) / base_s);
		double v1 = v, a1 = -b1 - 2 * damping * w * v - w * w * z;
		double v2 = v + h / 2 * a1, a2 = -b2 - 2 * damping * w * v2 - w * w * (z + h / 2 * v1);
		double v3 = v + h / 2 * a2, a3 = -b2 - 2 * damping * w * v3 - w * w * (z + h / 2 * v2);
		double v4 = v + h * a3, a4 = -b3 - 2 * damping * w * v4 - w * w * (z + h * v3);

		value[i] = -(2 * damping * w * v + w * w * z);
		z += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
		v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
	}
}

double synth_plate_peak(const double *value, size_t count, double *height)
{
	size_t at = 1;
	double a, b, c, shift;

	for (size_t k = 1; k + 1 < count; k++)
		if (value[k] > value[at])
			at = k;
	a = value[at - 1], b = value[at], c = value[at + 1];
	shift = (a - c) / (2 * (a - 2 * b + c));
	*height = b - (a - c) * shift / 4;
	return ((double)at + shift) * SYNTH_STEP_S;
}

struct channel synth_channel(const char *name, double rate_hz, double start_s, size_t count)
{
	struct channel channel = {.rate_hz = rate_hz, .start_s = start_s, .count = count};

	snprintf(channel.name, sizeof(channel.name), "%s", name);
	channel.value_g = calloc(count + 1, sizeof(*channel.value_g));
	channel.sample = calloc(count + 1, 1);
	if (!channel.value_g || !channel.sample)
		abort();
	return channel;
}

void synth_free(struct channel *channel)
{
	free(channel->value_g);
	free(channel->sample);
}

void synth_lose(struct channel *channel, size_t first, size_t count)
{
	for (size_t k = first; k < first + count && k < channel->count; k++) {
		channel->value_g[k] = NAN;
		channel->sample[k] = SAMPLE_LOST;
	}
}
