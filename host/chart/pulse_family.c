/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include <gsl/gsl_math.h>

#include "host/chart/synthetic.h"

/*
 * A contact with force x^1.5 (1 + c v) on a mass, all of size 1, entered at speed 1. Where the speed v says
 * how far the contact has gone, force and time have quadratures: dx = -v dv / F, and with
 * p = x^2.5 / 2.5: p = integral of v / (1 + c v) from v to 1. No differential equation is solved.
 * Tabulated over v = (1 - e) / 2 + (1 + e) / 2 cos a with a itself dense at both ends, in which nothing is
 * singular, then resampled to even steps of time.
 */
enum { ANGLES = 20000, STEPS = 4000 };

struct family {
	double force[STEPS + 1];
	double summit, area;
	bool ready;
};

/* Loss for a restitution of 0.5: the root of p(-e) = 0, ln((1 + c) / (1 - c e)) = c (1 + e). */
static double loss_of(double restitution)
{
	double low = 1e-6, high = (1 - 1e-12) / restitution;

	if (restitution >= 1)
		return 0;
	for (int i = 0; i < 200; i++) {
		double c = (low + high) / 2;

		if (log1p(c) - log1p(-c * restitution) < c * (1 + restitution))
			low = c;
		else
			high = c;
	}
	return (low + high) / 2;
}

/* The force where the speed is 1 - lost = gained - restitution: from the end that is nearer, as the other's
 * terms cancel. */
static double force_at(double lost, double gained, double restitution, double c)
{
	double speed = 1 - lost, p;

	if (c <= 0)
		p = lost * gained / 2;
	else if (lost < gained)
		p = lost / c - log1p(c * lost / (1 + c * speed)) / (c * c);
	else
		p = log1p(c * gained / (1 - c * restitution)) / (c * c) - gained / c;
	return pow(2.5 * fmax(0, p), 0.6) * (1 + c * speed);
}

/* At u of 0..1 the half angle is pi/2 sin^2(pi u / 2). */
static double force_along(double u, double restitution, double c)
{
	double sine = sin(M_PI_2 * gsl_pow_2(sin(M_PI_2 * u)));
	double cosine = sin(M_PI_2 * gsl_pow_2(cos(M_PI_2 * u)));

	return force_at((1 + restitution) * sine * sine, (1 + restitution) * cosine * cosine, restitution, c);
}

static void resample(struct family *family, const double *time, const double *force)
{
	double before, after, shift, most;
	size_t k = 0;
	int at = 1;

	for (int i = 0; i <= STEPS; i++) {
		double t = time[ANGLES] * i / STEPS, part;

		while (k < ANGLES - 1 && time[k + 1] < t)
			k++;
		part = (t - time[k]) / (time[k + 1] - time[k]);
		family->force[i] = force[k] + (force[k + 1] - force[k]) * part;
	}
	for (int i = 1; i < STEPS; i++)
		if (family->force[i] > family->force[at])
			at = i;
	before = family->force[at - 1], after = family->force[at + 1];
	shift = (before - after) / (2 * (before - 2 * family->force[at] + after));
	most = family->force[at] - (before - after) * shift / 4;
	family->summit = (at + shift) / STEPS;
	family->force[0] = family->force[STEPS] = 0;
	for (int i = 0; i <= STEPS; i++)
		family->force[i] /= most;
	family->area = 0;
	for (int i = 0; i < STEPS; i++)
		family->area += (family->force[i] + family->force[i + 1]) / (2.0 * STEPS);
}

static void pulse_family_make(struct family *family, double restitution)
{
	static double time[ANGLES + 1], force[ANGLES + 1];
	double c = loss_of(restitution);

	for (int i = 0; i < ANGLES; i++) { /* dt = -dv / F, at the middle of each step */
		double u = (i + 0.5) / ANGLES, angle = M_PI * gsl_pow_2(sin(M_PI_2 * u));
		double dv = (1 + restitution) / 2 * sin(angle) * M_PI_2 * sin(M_PI * u) * M_PI / ANGLES;

		time[i + 1] = time[i] + dv / force_along(u, restitution, c);
		force[i + 1] = force_along((i + 1.0) / ANGLES, restitution, c);
	}
	resample(family, time, force);
	family->ready = true;
}

static const struct family *family_of(enum synthetic_family which)
{
	static struct family hertz, hunt_crossley;

	if (!hertz.ready) {
		pulse_family_make(&hertz, 1);
		pulse_family_make(&hunt_crossley, 0.5);
	}
	return which == SYNTHETIC_HERTZ ? &hertz : &hunt_crossley;
}

double synthetic_between(const double *y, size_t last, double place)
{
	size_t k = (size_t)place;
	double s = place - (double)k, before, after;

	if (k >= last)
		return y[last];
	before = k > 0 ? y[k - 1] : 2 * y[0] - y[1];
	after = k + 1 < last ? y[k + 2] : 2 * y[last] - y[last - 1];
	return y[k] + s / 2 *
	                      (y[k + 1] - before +
	                       s * (2 * before - 5 * y[k] + 4 * y[k + 1] - after +
	                            s * (3 * (y[k] - y[k + 1]) + after - before)));
}

double synthetic_pulse(enum synthetic_family family, double s)
{
	if (!(s > 0) || s >= 1)
		return 0;
	if (family == SYNTHETIC_HALF_SINE)
		return sin(M_PI * s);
	if (family == SYNTHETIC_HAVERSINE)
		return gsl_pow_2(sin(M_PI * s));
	return synthetic_between(family_of(family)->force, STEPS, s * STEPS);
}

double synthetic_pulse_summit(enum synthetic_family family)
{
	return family == SYNTHETIC_HUNT_CROSSLEY ? family_of(family)->summit : 0.5;
}

double synthetic_pulse_area(enum synthetic_family family)
{
	if (family == SYNTHETIC_HALF_SINE)
		return M_2_PI;
	return family == SYNTHETIC_HAVERSINE ? 0.5 : family_of(family)->area;
}

const char *synthetic_family_name(enum synthetic_family family)
{
	static const char *const names[SYNTHETIC_FAMILIES] = {"half-sine", "haversine", "Hertz",
	                                                      "Hunt-Crossley"};

	return names[family];
}
