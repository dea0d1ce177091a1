/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_SRS_H
#define DT_HOST_SHOCK_SRS_H
/*
 * Shock response spectrum: the extremes of single oscillators that stand on a base which moves as the record
 * says. Ramp-invariant digital filter (ISO 18431-4; Smallwood 1981): exact for a base acceleration that is
 * straight between its samples.
 *
 * Primary: extremes at the samples while the record lasts. Residual: extremes of the free response after it,
 * in closed form at their own instants. Before its first and after its last sample the base acceleration runs
 * straight to zero within one sample.
 *
 * The extremes of sampled values are within 5 % of the true ones where a cycle has ten samples. A frequency
 * above a tenth of the rate is therefore computed from the signal up-sampled to 32 points a cycle or more by
 * a Kaiser-windowed sinc of 32 taps: the samples stay as they are, what is below 0.42 of the rate passes; at
 * its ends the signal is continued by its point reflection.
 *
 * The recursion runs in increments, and its coefficients come from power series: as exact at a millionth of
 * the rate as at a tenth of it. Stateless, any thread; memory is taken for a call only.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

/* Of the oscillator: absolute acceleration, frequency times relative displacement, and mass minus base. */
enum srs_quantity { SRS_ACCELERATION, SRS_VELOCITY, SRS_DISPLACEMENT, SRS_QUANTITIES };
enum srs_side { SRS_POSITIVE, SRS_NEGATIVE, SRS_MAXIMAX, SRS_SIDES };
enum srs_part { SRS_PRIMARY, SRS_RESIDUAL, SRS_TOTAL, SRS_PARTS };

/* "acceleration" "velocity" "displacement"; "positive" ...; "primary" ...; "g" "m_s" "m" as in JSON keys. */
extern const char *const srs_quantity_names[SRS_QUANTITIES];
extern const char *const srs_quantity_units[SRS_QUANTITIES];
extern const char *const srs_side_names[SRS_SIDES];
extern const char *const srs_part_names[SRS_PARTS];

struct srs_options {
	double damping; /* ratio, 0 to below 1: 1/(2 Q) */
	enum srs_quantity quantity;
	bool keep_rate; /* never up-sample: as programs do that stop at the standard's minimum */
};

/* Of one frequency, in g, m/s or m; high >= 0 >= low, as the oscillator starts and ends at rest. */
struct srs_value {
	double primary_high, primary_low;
	double residual_high, residual_low;
};

/* value_g: count finite samples at rate_hz. Writes value[frequency_count]. DT_E_ARGUMENT: damping outside
 * [0, 1), a frequency or sample that is no such number, no samples; DT_E_RANGE: a frequency above half the
 * rate (0.45 of it with keep_rate); DT_E_MEMORY. */
DT_MUST_USE int srs_compute(const double *value_g, size_t count, double rate_hz, const double *frequency_hz,
                            size_t frequency_count, const struct srs_options *options,
                            struct srs_value *value);

/* The spectrum's ordinate: a magnitude, for the negative side too. */
double srs_pick(const struct srs_value *value, enum srs_side side, enum srs_part part);

#endif
