/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_PLOT_H
#define DT_HOST_CHART_PLOT_H
/*
 * A picture of up to three panels side by side, and a CSV of all it shows. A panel is a map (a value for each
 * cell of a grid, the cells that fail hatched and outlined) or curves, with regions of failure over the whole
 * height. Regions and cells are named by labels.
 *
 * All memory is the caller's. The texts become part of a gnuplot script: they must be ours.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/chart/chart.h"

enum { PLOT_PANELS = 3, PLOT_SERIES = 12, PLOT_LABELS = 12, PLOT_REGIONS = 4, PLOT_SHADES = 5 };

struct plot_axis {
	const char *label; /* with its unit */
	const char *name;  /* of the CSV's column */
	double from, to;
	bool log;
	const char *format; /* of the tics, gnuplot's; NULL: its own */
};

/* NULL text: not there. dot: marks the place, the text after it, or
 * before it; else the text is centred on it. */
struct plot_label {
	const char *text;
	double x, y;
	bool dot, before;
};

/* A line through its points, with marks; a point alone is a mark. */
struct plot_series {
	const char *name;
	const double *x, *y; /* NAN: not shown */
	size_t count;
	bool marks;
	bool judged; /* its points within a region fail */
	int colour;
};

/* x from, to and y low, high: hatched and outlined. */
struct plot_region {
	double from, to, low, high;
};

struct plot_panel {
	const char *title;
	struct plot_axis x, y;
	const double
	        *cell; /* [rows][columns], from the lower left; NAN: no value, which fails. NULL: no map */
	size_t columns, rows;
	double fails; /* a cell above this */
	struct plot_series series[PLOT_SERIES];
	struct plot_region region[PLOT_REGIONS];
	struct plot_label label[PLOT_LABELS];
	const char *key; /* where gnuplot puts the names of series, "top left"; NULL: none */
};

struct plot {
	const char *name; /* of the files */
	const char *title;
	const char *note[2]; /* what is shown; what to conclude */
	const char *value;   /* what the cells' shade is, with its unit */
	double shade[PLOT_SHADES - 1];
	const char *shade_text[PLOT_SHADES];
	const struct plot_panel *panel;
	size_t panels;
};

/* folder/kind-name.svg and .csv. 0, or DT_E_* with a line in message. */
DT_MUST_USE int plot_write(const struct plot *plot, const char *folder, const char *kind, char *message);

/* Centre of cell i of count along an axis; its lower edge (i = count: the upper of the last). */
double plot_centre(const struct plot_axis *axis, size_t i, size_t count);
double plot_edge(const struct plot_axis *axis, size_t i, size_t count);

/* Whether it fails. */
bool plot_fails(const struct plot_panel *panel, size_t row, size_t column);

#endif
