/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_REFERENCE_H
#define DT_HOST_CHART_REFERENCE_H
/*
 * Methods that others use, each in its plain form, to see what they cost and where they fail. The product
 * uses none of them. They work on a series: one axis, the pre-trigger mean taken off, holes bridged by
 * straight lines. Those of the decay are handed the true end of the contact.
 *
 * Every function returns NAN (or false) when it finds nothing.
 */
#include <stdbool.h>
#include <stddef.h>

struct reference_series {
	const double *y; /* [count], positive pulse */
	size_t count;
	double rate_hz; /* sample k is at k / rate_hz */
};

/* The largest sample, and a parabola through it and its neighbours. */
struct reference_peak {
	double value, time_s;
};
struct reference_peak reference_maximum(const struct reference_series *s);
struct reference_peak reference_parabola(const struct reference_series *s);

/* X drawn linearly onto Y's instants, largest hypot. */
double reference_resultant(const struct reference_series *x, const struct reference_series *y);

/* Width at 10 % of the largest sample, as if the pulse were a half-sine; and pi dv / 2 A, likewise. */
double reference_width(const struct reference_series *s);
double reference_area_width(const struct reference_series *s);

/* Sum over three contact times to either side of the largest sample, m/s. */
double reference_velocity(const struct reference_series *s, double contact_s);

/* GSL's multifit_nlinear on A, t, T of a half-sine. */
struct reference_pulse {
	double value, time_s, base_s;
};
bool reference_fit_pulse(const struct reference_series *s, struct reference_pulse *pulse);

/* Shift of b against a, same rate, 0 to 6 ms, with the largest product sum, parabola on top. */
double reference_correlation(const struct reference_series *a, const struct reference_series *b);

/* The decay: s begins where it does. */
struct reference_decay {
	double hz, damping; /* NAN where the method gives none */
};
struct reference_decay reference_crossings(const struct reference_series *s); /* three cycles end to end */
struct reference_decay reference_decrement(const struct reference_series *s); /* peaks, log of their ratios */
struct reference_decay reference_spectrum(const struct reference_series *s);  /* FFT peak, half-power width */
struct reference_decay reference_pencil(const struct reference_series *s);    /* matrix pencil, block means */
struct reference_decay reference_fit_decay(const struct reference_series *s); /* GSL's multifit_nlinear */

#endif
