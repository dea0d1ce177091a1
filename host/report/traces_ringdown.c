/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The picture of the plate's free decay, with the one fit that is made for a picture alone.
 */
#include "host/report/traces.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/cholesky.h"
#include "host/report/script.h"

enum { RINGDOWN_CYCLES = 5, RINGDOWN_DOTS = 70 };

struct decay {
	double rate, omega; /* 1/s, rad/s */
	double start_s;
	double c[3]; /* e^(-rate t) (c0 cos + c1 sin) + c2 */
};

static void decay_terms(const struct decay *d, double time_s, double terms[3])
{
	double t = time_s - d->start_s, e = exp(-d->rate * t);

	terms[0] = e * cos(d->omega * t);
	terms[1] = e * sin(d->omega * t);
	terms[2] = 1.0;
}

static double decay_value(const struct decay *d, double time_s)
{
	double terms[3];

	decay_terms(d, time_s, terms);
	return d->c[0] * terms[0] + d->c[1] * terms[1] + d->c[2] * terms[2];
}

/* Least squares for d->c over the good samples of the window. */
static bool fit_decay(struct decay *d, const struct channel *c, double offset, struct script_window window)
{
	size_t first = script_from(c, window.from_s), last = script_from(c, window.to_s), rows = 0;
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0.0}}, moment[3] = {0.0}, terms[3];
	struct cholesky factor;

	for (size_t k = first; k < last; k++) {
		if (!script_good(c, k))
			continue;
		decay_terms(d, script_time(c, k), terms);
		for (int i = 0; i < 3; i++) {
			moment[i] += terms[i] * (c->value_g[k] - offset);
			for (int j = 0; j <= i; j++)
				normal[i][j] += terms[i] * terms[j];
		}
		rows++;
	}
	if (rows < 8 || !cholesky_factor(&factor, 3, normal))
		return false;
	cholesky_solve(&factor, moment, d->c);
	return isfinite(d->c[0] + d->c[1] + d->c[2]);
}

/* The plate is free from the end of the contact on, which is a little after S2's pulse meets 10 %. */
static bool decay_of_plate(const struct report *report, struct decay *decay)
{
	const struct estimate_ringdown *plate = &report->analysis->plate;
	const struct estimate_channel *s2 = report_axis(report, "S2X");
	double frequency_hz = plate->frequency_hz, zeta = plate->damping_ratio;

	if (!report->analysis->has_plate || !s2 || !(frequency_hz > 0.0) || !(zeta >= 0.0 && zeta < 1.0))
		return false;
	*decay = (struct decay){.omega = 2.0 * UNITS_PI * frequency_hz,
	                        .start_s = s2->pulse.end_s + 0.1 * s2->pulse.duration_s};
	decay->rate = decay->omega * zeta / sqrt(1.0 - zeta * zeta);
	return isfinite(decay->start_s) && isfinite(decay->omega);
}

bool traces_ringdown(FILE *out, const struct report *report, const struct report_zero *zero, char axis)
{
	const char name[] = {'S', '1', axis, '\0'};
	const struct channel *c = record_axis(report->record, name);
	struct script_window whole = script_whole(report->record), window;
	struct script_range range = {0.0, 0.0};
	struct decay decay;
	double offset, fit[SCRIPT_CURVE_POINTS];
	size_t points;

	if (!c || !decay_of_plate(report, &decay))
		return false;
	offset = report_offset(report_axis(report, name));
	window.from_s = decay.start_s;
	window.to_s = fmin(whole.to_s, decay.start_s + RINGDOWN_CYCLES * 2.0 * UNITS_PI / decay.omega);
	if (!(window.to_s > window.from_s) || !fit_decay(&decay, c, offset, window))
		return false;
	for (int k = 0; k < SCRIPT_CURVE_POINTS; k++) {
		fit[k] = decay_value(&decay, window.from_s + (window.to_s - window.from_s) * k /
		                                                     (SCRIPT_CURVE_POINTS - 1));
		script_reach(&range, fit[k]);
	}
	script_reach_samples(&range, c, offset, window);
	script_axes(out, 560, 270, window, zero->time_s, range);
	script_bands(out, c, zero->time_s, window);
	script_curve(out, "fit", fit, window, zero->time_s);
	points = script_samples(out, "measured", c, offset, zero->time_s, window);
	if (!points)
		return false;
	fprintf(out,
	        "plot $measured every %zu with points pointtype 6 pointsize 0.6 linewidth 2 linecolor rgb "
	        "'" SCRIPT_COLOUR_S1 "', $fit with lines linewidth 1.2 linecolor rgb 'black'\n",
	        points / RINGDOWN_DOTS + 1);
	return true;
}
