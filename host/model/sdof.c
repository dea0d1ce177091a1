/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/sdof.h"

#include <complex.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "common/units.h"
#include "host/model/root.h"

enum { SERIES_TERMS = 16, SCAN_PER_CYCLE = 24 };

/* Points nearer than this: the divided difference comes from its series, not from a quotient. */
#define NEAR 0.5

/* Extremes this close to the largest may still turn out to be it. */
#define RIVAL_SHARE 0.99

/* ---- divided differences of the exponential ---- */

static double distance(double complex p, double complex q)
{
	return fabs(creal(p - q)) + fabs(cimag(p - q));
}

/* exp[p, q] = (exp p - exp q)/(p - q); ep and eq are the exponentials. */
static double complex pair(double complex p, double complex ep, double complex q, double complex eq)
{
	double complex x = p - q, sum = 1.0;

	if (distance(p, q) >= NEAR)
		return (ep - eq) / x;
	for (int n = SERIES_TERMS; n > 1; n--)
		sum = 1.0 + sum * x / n;
	return eq * sum;
}

/* exp[p, q, r] with all three close together: the series about q. */
static double complex triple_series(double complex p, double complex q, double complex eq, double complex r)
{
	double complex x = p - q, y = r - q, sum = 0.0, homogeneous = 1.0, power = 1.0;
	double factorial = 2.0;

	for (int n = 0; n < SERIES_TERMS; n++) {
		sum += homogeneous / factorial;
		power *= y;
		homogeneous = homogeneous * x + power;
		factorial *= n + 3;
	}
	return eq * sum;
}

/* exp[p, q, r] = (exp[p, q] - exp[q, r])/(p - r), taken over the two that are furthest apart. */
static double complex triple(double complex p, double complex ep, double complex q, double complex eq,
                             double complex r, double complex er)
{
	double pq = distance(p, q), qr = distance(q, r), pr = distance(p, r);

	if (pq < NEAR && qr < NEAR && pr < NEAR)
		return triple_series(p, q, eq, r);
	if (pr >= pq && pr >= qr)
		return (pair(p, ep, q, eq) - pair(q, eq, r, er)) / (p - r);
	if (pq >= qr)
		return (pair(p, ep, r, er) - pair(r, er, q, eq)) / (p - q);
	return (pair(q, eq, p, ep) - pair(p, ep, r, er)) / (q - r);
}

/* z and z' under the base acceleration -exp(i pulse_omega t), from rest. */
static void sdof_respond(const struct sdof *sdof, double t, double complex *z, double complex *v)
{
	const struct oscillator *o = &sdof->mount;
	double complex slow, fast, e_slow, e_fast, pulse = sdof->pulse_omega * t * I, e_pulse, both;

	e_pulse = cos(cimag(pulse)) + sin(cimag(pulse)) * I;
	if (o->overdamped) {
		slow = -o->omega * o->omega / (o->decay + o->split) * t;
		fast = -(o->decay + o->split) * t;
		e_slow = exp(creal(slow));
		e_fast = exp(creal(fast));
	} else {
		double e = exp(-o->decay * t);

		slow = (-o->decay + o->split * I) * t;
		fast = conj(slow);
		e_slow = e * cos(cimag(slow)) + e * sin(cimag(slow)) * I;
		e_fast = conj(e_slow);
	}
	both = t * triple(slow, e_slow, fast, e_fast, pulse, e_pulse);
	*z = t * both;
	*v = t * pair(fast, e_fast, pulse, e_pulse) + slow * both;
}

/* ---- the motion ---- */

static struct sdof_motion motion(const struct sdof *sdof, double z, double v)
{
	const struct oscillator *o = &sdof->mount;

	return (struct sdof_motion){
	        .z = z,
	        .v = v,
	        .acceleration = -(2.0 * o->decay * v + o->omega * o->omega * z),
	};
}

static struct sdof_motion motion_in_pulse(const struct sdof *sdof, double t)
{
	double complex z, v;

	sdof_respond(sdof, t, &z, &v);
	return motion(sdof, -sdof->amplitude * cimag(z), -sdof->amplitude * cimag(v));
}

int sdof_init(struct sdof *sdof, double frequency_hz, double damping_ratio, double amplitude, double pulse_s)
{
	struct sdof s = {
	        .pulse_omega = UNITS_PI / pulse_s,
	        .pulse_s = pulse_s,
	        .amplitude = amplitude,
	};
	struct sdof_motion end;
	int error = oscillator_init(&s.mount, 2.0 * UNITS_PI * frequency_hz, damping_ratio);

	if (error || !(pulse_s > 0.0) || !isfinite(pulse_s) || !isfinite(amplitude))
		return DT_E_ARGUMENT;
	end = motion_in_pulse(&s, pulse_s);
	s.z_end = end.z;
	s.v_end = end.v;
	*sdof = s;
	return 0;
}

struct sdof_motion sdof_motion(const struct sdof *sdof, double time_s)
{
	double z = sdof->z_end, v = sdof->v_end;

	if (!(time_s > 0.0))
		return (struct sdof_motion){0};
	if (time_s <= sdof->pulse_s)
		return motion_in_pulse(sdof, time_s);
	oscillator_move(&sdof->mount, time_s - sdof->pulse_s, &z, &v);
	return motion(sdof, z, v);
}

/* ---- the peak ---- */

static double jerk_of(const struct sdof *sdof, struct sdof_motion m, double base)
{
	const struct oscillator *o = &sdof->mount;

	return -2.0 * o->decay * (m.acceleration - base) - o->omega * o->omega * m.v;
}

/* u''' within the pulse: its zeros are found to the last digit, the maximum of u'' itself only to half of
 * the digits. */
static double jerk(double t, void *context)
{
	const struct sdof *sdof = context;

	return jerk_of(sdof, motion_in_pulse(sdof, t), sdof->amplitude * sin(sdof->pulse_omega * t));
}

/* Two neighbouring points of the scan with an extreme between them. */
struct bracket {
	double low_s, high_s;
	double about; /* the extreme's magnitude, roughly */
};

/* Equal steps through the pulse: from one to the next the motion is a fixed linear map. */
struct scan {
	double step_s, even_z, odd_z, even_v, odd_v; /* the free motion over a step */
	double complex turn, z, v;                   /* the pulse over a step, and the answer to it */
};

static struct scan scan_make(const struct sdof *sdof, int steps)
{
	struct scan s = {.step_s = sdof->pulse_s / steps, .even_z = 1.0, .odd_v = 1.0};

	oscillator_move(&sdof->mount, s.step_s, &s.even_z, &s.even_v);
	oscillator_move(&sdof->mount, s.step_s, &s.odd_z, &s.odd_v);
	sdof_respond(sdof, s.step_s, &s.z, &s.v);
	s.turn = cos(UNITS_PI / steps) + sin(UNITS_PI / steps) * I;
	return s;
}

/* Keeps the two largest extremes, the larger first. */
static void sdof_keep(struct bracket best[2], struct bracket b)
{
	if (b.about > best[0].about) {
		best[1] = best[0];
		best[0] = b;
	} else if (b.about > best[1].about) {
		best[1] = b;
	}
}

static void sdof_scan(const struct sdof *sdof, int steps, struct bracket best[2])
{
	const struct scan s = scan_make(sdof, steps);
	double complex phase = 1.0;
	double z = 0.0, v = 0.0, a = 0.0, j = 0.0;

	for (int k = 0; k < steps; k++) {
		double complex forced_z = phase * s.z, forced_v = phase * s.v;
		double next_z = z * s.even_z + v * s.odd_z - sdof->amplitude * cimag(forced_z);
		double next_v = z * s.even_v + v * s.odd_v - sdof->amplitude * cimag(forced_v);
		struct sdof_motion m = motion(sdof, next_z, next_v);
		double next_j;

		phase *= s.turn;
		next_j = jerk_of(sdof, m, sdof->amplitude * cimag(phase));
		if (j * next_j < 0.0)
			sdof_keep(best, (struct bracket){k * s.step_s, (k + 1) * s.step_s,
			                                 fabs(a + 0.5 * s.step_s * j * j / (j - next_j))});
		z = next_z;
		v = next_v;
		a = m.acceleration;
		j = next_j;
	}
}

/* Takes time_s to the extreme within the bracket when that is larger than the one at time_s. */
static int sdof_refine(struct sdof *sdof, const struct bracket *b, double *time_s)
{
	double t;
	int error = 0;

	if (!(b->about > 0.0))
		return 0;
	if (jerk(b->low_s, sdof) * jerk(b->high_s, sdof) > 0.0) /* at the very edge of a step */
		t = fabs(jerk(b->low_s, sdof)) < fabs(jerk(b->high_s, sdof)) ? b->low_s : b->high_s;
	else
		error = root_find(jerk, sdof, b->low_s, b->high_s, &t);
	if (!error && fabs(sdof_motion(sdof, t).acceleration) > fabs(sdof_motion(sdof, *time_s).acceleration))
		*time_s = t;
	return error;
}

/* The largest within the pulse; its end when u'' still rises there. */
static int peak_in_pulse(const struct sdof *sdof, double *time_s)
{
	struct sdof copy = *sdof;
	struct bracket best[2] = {{0}};
	double cycles = sdof->mount.omega * sdof->pulse_s / (2.0 * UNITS_PI);
	int error;

	if (!(cycles <= SDOF_CYCLES_MAX))
		return DT_E_NUMERIC;
	sdof_scan(sdof, (int)(SCAN_PER_CYCLE * (cycles + 1.0)), best);
	*time_s = sdof->pulse_s;
	error = sdof_refine(&copy, &best[0], time_s);
	if (!error && best[1].about > RIVAL_SHARE * best[0].about)
		error = sdof_refine(&copy, &best[1], time_s);
	return error;
}

int sdof_peak(const struct sdof *sdof, double *value, double *time_s)
{
	struct sdof_motion end = motion(sdof, sdof->z_end, sdof->v_end);
	double t, after, largest;
	int error = peak_in_pulse(sdof, &t);

	if (error)
		return error;
	/* in free decay only the first extreme counts */
	after = sdof->pulse_s + oscillator_turn(&sdof->mount, end.acceleration, jerk_of(sdof, end, 0.0));
	largest = sdof_motion(sdof, t).acceleration;
	if (fabs(sdof_motion(sdof, after).acceleration) > fabs(largest) * (1.0 + 4.0 * DBL_EPSILON)) {
		t = after;
		largest = sdof_motion(sdof, t).acceleration;
	}
	*value = largest;
	*time_s = t;
	return 0;
}
