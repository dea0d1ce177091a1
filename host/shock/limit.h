/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_LIMIT_H
#define DT_HOST_SHOCK_LIMIT_H
/*
 * What a result must stay within, as the user's CSV says: a limit curve over frequency for spectra, a
 * tolerance band over time for pulses.
 *
 *     frequency_hz,limit            or  time_s,lower_g,upper_g
 *     5,20                              0,-5,50
 *     100,400                           0.0015,420,520
 *
 * The first line may name the columns, in any words: it does when it begins with no number. Lines that begin
 * with # and empty ones are skipped; separators are commas, semicolons, tabs and blanks. Frequencies and
 * times must increase. Between its points a limit curve is straight on double logarithmic paper, a band on
 * plain. Beyond its ends neither says anything.
 *
 * A curve belongs to its owner: limit_read, limit_free. Errors are told in one line, "FILE:LINE: ...".
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/estimate/trace.h"
#include "host/record/read.h"

struct limit_point {
	double x;            /* Hz or s */
	double lower, upper; /* lower 0 in a limit curve's file */
};

struct limit_curve {
	struct limit_point *point; /* [count], at least 2 */
	size_t count;
};

enum limit_kind { LIMIT_SPECTRUM, LIMIT_BAND };

/* 0, DT_E_FORMAT and others with message told. */
DT_MUST_USE int limit_read(struct limit_curve *curve, const char *file, enum limit_kind kind,
                           char message[READ_MESSAGE_MAX]);
void limit_free(struct limit_curve *curve);

/* Lower and upper at x; false beyond the ends. */
bool limit_at(const struct limit_curve *curve, enum limit_kind kind, double x, struct limit_point *at);

/* What came of it. */
struct limit_verdict {
	bool pass;       /* nothing outside, and something was checked */
	size_t checked;  /* points of the result that the curve speaks of */
	size_t missing;  /* samples that were not there to be checked; only of a band */
	double margin;   /* the least: dB below the limit, or g inside the band; negative outside */
	double margin_x; /* where, Hz or s after the alignment */
	double first_x;  /* where it is first outside; NAN when nowhere */
};

/* A spectrum against its limit. */
struct limit_verdict limit_spectrum(const struct limit_curve *curve, const double *frequency_hz,
                                    const double *value, size_t count);

/* A pulse against its band, whose time 0 is at zero_s of the trace. */
struct limit_verdict limit_pulse(const struct limit_curve *curve, const struct trace *trace, double zero_s);

#endif
