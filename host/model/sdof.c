/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/sdof.h"

#include <complex.h>
#include <float.h>
#include <math.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_roots.h>

#include "common/units.h"

enum { SERIES_TERMS = 14, SCAN_PER_CYCLE = 48, ROOT_STEPS_MAX = 100 };

/* (e^x - 1)/x near 0, where the quotient cancels. */
static double complex phi_series(double complex x)
{
	double complex sum = 1.0;

	for (int n = SERIES_TERMS; n > 1; n--)
		sum = 1.0 + sum * x / n;
	return sum;
}

/* (e^(pt) - e^(qt))/(p - q): the convolution of e^(pt) with e^(qt), for p near q as well. */
static double complex convolve(double complex p, double complex q, double t)
{
	double complex x = (p - q) * t;

	if (cabs(x) < 0.3)
		return cexp(q * t) * t * phi_series(x);
	return (cexp(p * t) - cexp(q * t)) / (p - q);
}

static struct sdof_motion motion(const struct sdof *sdof, double z, double v)
{
	return (struct sdof_motion){
	        .z = z,
	        .v = v,
	        .acceleration = -(2.0 * sdof->zeta * sdof->omega * v + sdof->omega * sdof->omega * z),
	};
}

static struct sdof_motion motion_in_pulse(const struct sdof *sdof, double t)
{
	double decay = sdof->zeta * sdof->omega, wd = sdof->omega_d;
	double complex pulse = sdof->pulse_omega * I;
	double complex plus = convolve(pulse, -decay - wd * I, t);
	double complex minus = convolve(pulse, -decay + wd * I, t);
	double difference = creal(plus) - creal(minus);
	double z = -sdof->amplitude / (2.0 * wd) * difference;
	double v = -sdof->amplitude * ((cimag(plus) + cimag(minus)) / 2.0 - decay / (2.0 * wd) * difference);

	return motion(sdof, z, v);
}

static struct sdof_motion motion_after_pulse(const struct sdof *sdof, double t)
{
	double decay = sdof->zeta * sdof->omega, wd = sdof->omega_d;
	double tau = t - sdof->pulse_s, e = exp(-decay * tau);
	double c = cos(wd * tau), s = sin(wd * tau);
	double z = sdof->z_end, v = sdof->v_end;

	return motion(sdof, e * (z * c + (v + decay * z) * s / wd),
	              e * (v * c - (decay * v + sdof->omega * sdof->omega * z) * s / wd));
}

int sdof_init(struct sdof *sdof, double frequency_hz, double damping_ratio, double amplitude, double pulse_s)
{
	struct sdof s = {
	        .omega = 2.0 * UNITS_PI * frequency_hz,
	        .omega_d =
	                2.0 * UNITS_PI * frequency_hz * sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio)),
	        .zeta = damping_ratio,
	        .pulse_omega = UNITS_PI / pulse_s,
	        .pulse_s = pulse_s,
	        .amplitude = amplitude,
	};
	struct sdof_motion end;

	if (!(frequency_hz > 0.0) || !isfinite(frequency_hz) || !(pulse_s > 0.0) || !isfinite(pulse_s) ||
	    !(damping_ratio >= 0.0) || !(damping_ratio < 1.0) || !isfinite(amplitude))
		return DT_E_ARGUMENT;
	end = motion_in_pulse(&s, pulse_s);
	s.z_end = end.z;
	s.v_end = end.v;
	*sdof = s;
	return 0;
}

struct sdof_motion sdof_motion(const struct sdof *sdof, double time_s)
{
	if (!(time_s > 0.0))
		return (struct sdof_motion){0};
	return time_s <= sdof->pulse_s ? motion_in_pulse(sdof, time_s) : motion_after_pulse(sdof, time_s);
}

/* u''' within the pulse: its zeros are found to the last digit, the maximum of u'' itself only to half of
 * the digits. */
static double jerk(double t, void *context)
{
	const struct sdof *sdof = context;
	struct sdof_motion m = sdof_motion(sdof, t);
	double base = sdof->amplitude * sin(sdof->pulse_omega * t);

	return -2.0 * sdof->zeta * sdof->omega * (m.acceleration - base) - sdof->omega * sdof->omega * m.v;
}

/* The zero of u''' between low and high, where it has different signs. */
static int jerk_zero(struct sdof *sdof, double low, double high, double *time_s)
{
	gsl_function function = {.function = jerk, .params = sdof};
	gsl_root_fsolver *solver = gsl_root_fsolver_alloc(gsl_root_fsolver_brent);
	int status = solver ? gsl_root_fsolver_set(solver, &function, low, high) : GSL_ENOMEM;

	if (status == GSL_SUCCESS)
		status = GSL_CONTINUE;
	for (int i = 0; i < ROOT_STEPS_MAX && status == GSL_CONTINUE; i++) {
		status = gsl_root_fsolver_iterate(solver);
		if (status == GSL_SUCCESS)
			status = gsl_root_test_interval(gsl_root_fsolver_x_lower(solver),
			                                gsl_root_fsolver_x_upper(solver), 0.0,
			                                4.0 * DBL_EPSILON);
	}
	if (status == GSL_SUCCESS)
		*time_s = gsl_root_fsolver_root(solver);
	if (solver)
		gsl_root_fsolver_free(solver);
	return status == GSL_SUCCESS ? 0 : DT_E_NUMERIC;
}

/* Within the pulse: the largest of a dense scan, then the zero of u''' beside it. */
static int peak_in_pulse(const struct sdof *sdof, double *time_s)
{
	struct sdof copy = *sdof;
	double cycles = sdof->omega * sdof->pulse_s / (2.0 * UNITS_PI);
	double largest = 0.0, low, high;
	int steps, best = 0;

	if (cycles > SDOF_CYCLES_MAX)
		return DT_E_NUMERIC;
	steps = (int)(SCAN_PER_CYCLE * (cycles + 1.0));
	for (int k = 1; k <= steps; k++) {
		double a = fabs(sdof_motion(sdof, sdof->pulse_s * k / steps).acceleration);

		if (a > largest) {
			largest = a;
			best = k;
		}
	}
	low = sdof->pulse_s * (best > 0 ? best - 1 : 0) / steps;
	high = sdof->pulse_s * (best < steps ? best + 1 : steps) / steps;
	*time_s = sdof->pulse_s * best / steps;
	if (jerk(low, &copy) * jerk(high, &copy) >= 0.0)
		return 0; /* still rising at the pulse's end: the peak comes after it */
	return jerk_zero(&copy, low, high, time_s);
}

/* In free decay every extreme is smaller than the one before: only the first counts. */
static double first_peak_after_pulse(const struct sdof *sdof)
{
	double decay = sdof->zeta * sdof->omega, wd = sdof->omega_d;
	double w2 = sdof->omega * sdof->omega, z = sdof->z_end, v = sdof->v_end;
	/* u'' = e^(-decay tau) (c cos(wd tau) + s sin(wd tau)) */
	double c = -(2.0 * decay * v + w2 * z);
	double s = (2.0 * decay * (decay * v + w2 * z) - w2 * (v + decay * z)) / wd;
	double phase = atan2(wd * s - decay * c, decay * s + wd * c);

	if (phase < 0.0)
		phase += UNITS_PI;
	return sdof->pulse_s + phase / wd;
}

int sdof_peak(const struct sdof *sdof, double *value, double *time_s)
{
	double t, after = first_peak_after_pulse(sdof);
	int error;

	gsl_set_error_handler_off();
	error = peak_in_pulse(sdof, &t);
	if (error)
		return error;
	if (fabs(sdof_motion(sdof, after).acceleration) > fabs(sdof_motion(sdof, t).acceleration))
		t = after;
	*value = sdof_motion(sdof, t).acceleration;
	*time_s = t;
	return 0;
}
