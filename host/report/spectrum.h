/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_SPECTRUM_H
#define DT_HOST_REPORT_SPECTRUM_H
/*
 * Shock response spectra for people and programs. The functions only read what they are given; all return 0,
 * DT_E_SYSTEM or DT_E_MEMORY.
 *
 * JSON: one object on one line; per channel the three sides of the part asked for, and the maximax of primary
 * and residual alone, in keys that end in _g, _m_s or _m; null where there is no value.
 */
#include <stdio.h>

#include "host/shock/spectrum.h"

struct spectrum_report {
	const char *file;
	const struct spectrum_options *options;
	const struct spectrum *spectrum;
	unsigned shock, shocks; /* which of how many of the record; 0: not cut by shocks */
};

DT_MUST_USE int spectrum_text(const struct spectrum_report *report, FILE *out);
DT_MUST_USE int spectrum_json(const struct spectrum_report *report, FILE *out);

/* frequency_hz and a column for each channel: the side and part asked for; an empty cell where there is no
 * value. */
DT_MUST_USE int spectrum_csv(const struct spectrum_report *report, FILE *out);

/* A picture with both axes logarithmic, made by gnuplot. Errors with a line in message. */
DT_MUST_USE int spectrum_svg(const struct spectrum_report *report, FILE *out, char *message, size_t size);

#endif
