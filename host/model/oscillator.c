/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/oscillator.h"

#include <math.h>

int oscillator_init(struct oscillator *oscillator, double omega, double zeta)
{
	if (!(omega > 0.0) || !isfinite(omega) || !(zeta >= 0.0) || !isfinite(zeta))
		return DT_E_ARGUMENT;
	*oscillator = (struct oscillator){
	        .omega = omega,
	        .zeta = zeta,
	        .decay = zeta * omega,
	        .split = omega * sqrt(fabs((1.0 - zeta) * (1.0 + zeta))),
	        .overdamped = zeta > 1.0,
	};
	return 0;
}

/* even = exp(-decay tau) cosine, odd = exp(-decay tau) sine/split; hyperbolic ones when overdamped. */
static void shapes(const struct oscillator *o, double tau, double *even, double *odd)
{
	double x = o->split * tau;

	if (o->overdamped) {
		double slow = exp(-o->omega * tau * o->omega / (o->decay + o->split));
		double drop = expm1(-2.0 * x);

		*even = slow * (1.0 + 0.5 * drop);
		*odd = -0.5 * slow * drop / o->split;
	} else {
		double e = exp(-o->decay * tau);

		*even = e * cos(x);
		*odd = o->split > 0.0 ? e * sin(x) / o->split : e * tau;
	}
}

void oscillator_move(const struct oscillator *o, double tau, double *z, double *v)
{
	double z0 = *z, v0 = *v, even, odd;

	shapes(o, tau, &even, &odd);
	*z = z0 * (even + o->decay * odd) + v0 * odd;
	*v = v0 * (even - o->decay * odd) - o->omega * o->omega * z0 * odd;
}

/* v = 0 where odd/even = v0/(decay v0 + omega^2 z0). */
double oscillator_turn(const struct oscillator *o, double z, double v)
{
	double rise = fabs(v), pull = v < 0.0 ? -(o->decay * v + o->omega * o->omega * z)
	                                      : o->decay * v + o->omega * o->omega * z;

	if (!(rise > 0.0))
		return 0.0;
	if (!o->overdamped && o->split > 0.0)
		return atan2(o->split * rise, pull) / o->split;
	if (!(pull > o->split * rise))
		return 0.0;
	return o->overdamped ? atanh(o->split * rise / pull) / o->split : rise / pull;
}

int oscillator_steady(double r, double zeta, double *transmissibility, double *phase_rad)
{
	double damper = 2.0 * zeta * r, below = hypot((1.0 - r) * (1.0 + r), damper);

	if (!(r > 0.0) || !isfinite(r) || !(zeta >= 0.0) || !isfinite(zeta))
		return DT_E_ARGUMENT;
	if (!(below > 0.0))
		return DT_E_NUMERIC;
	*transmissibility = hypot(1.0, damper) / below;
	*phase_rad = atan2(damper, (1.0 - r) * (1.0 + r)) - atan(damper);
	return 0;
}
