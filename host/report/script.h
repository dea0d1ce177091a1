/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_SCRIPT_H
#define DT_HOST_REPORT_SCRIPT_H
/*
 * The parts of a gnuplot script: axes, samples, curves, shading. What traces*.c, series*.c and fitted*.c
 * share; private to them.
 *
 * Times given are s after the record's first instant, those in the script ms after zero_s; values are less
 * offset, in g. A data block that has no point ($name empty) must not be plotted.
 */
#include <stdbool.h>
#include <stdio.h>

#include "host/record/record.h"

enum { SCRIPT_CURVE_POINTS = 400 };

#define SCRIPT_COLOUR_S1 "#0072B2"
#define SCRIPT_COLOUR_S2 "#D55E00"
#define SCRIPT_COLOUR_CLIPPED "#E69F00"
#define SCRIPT_COLOUR_LOST "#999999"

struct script_window {
	double from_s, to_s;
};

/* Of values; begins as {0, 0}, so that 0 is always in the picture. */
struct script_range {
	double low, high;
};

double script_time(const struct channel *channel, size_t k);

/* Neither lost nor bad. */
bool script_good(const struct channel *channel, size_t k);

/* First sample at or after time_s, at most count. */
size_t script_from(const struct channel *channel, double time_s);

struct script_window script_whole(const struct record *record);

void script_reach(struct script_range *range, double value);
void script_reach_samples(struct script_range *range, const struct channel *c, double offset,
                          struct script_window window);

/* Terminal, size in pixels, border, tics, grid and the axes' units. */
void script_paper(FILE *out, int width, int height, const char *x_unit, const char *y_unit);

/* The same of g over ms, with both ranges. */
void script_axes(FILE *out, int width, int height, struct script_window window, double zero_s,
                 struct script_range range);

/* The same of a spectrum, both axes logarithmic; a range above 0. */
void script_spectrum_axes(FILE *out, int width, int height, double from_hz, double to_hz,
                          struct script_range range);

/* $name from the samples in the window; returns how many points there are. A sample that is not good breaks
 * the line. */
size_t script_samples(FILE *out, const char *name, const struct channel *c, double offset, double zero_s,
                      struct script_window window);

/* $name from the clipped samples, for marks; returns how many. */
size_t script_clipped(FILE *out, const char *name, const struct channel *c, double offset, double zero_s,
                      struct script_window window);

/* $name from SCRIPT_CURVE_POINTS values spread evenly over the window, both ends included. */
void script_curve(FILE *out, const char *name, const double *value_g, struct script_window window,
                  double zero_s);

/* Shades every run of samples that are not there. */
void script_bands(FILE *out, const struct channel *c, double zero_s, struct script_window window);

/* The sensor's range, where the samples come near it. */
void script_limits(FILE *out, const struct channel *c, double offset, struct script_range range);

#endif
