/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_CURVES_H
#define DT_HOST_REPORT_CURVES_H
/*
 * What pictures draw that is no channel: the resultant of a sensor's X and Y, and where the model lies on the
 * record's time axis. Pure functions; times in s after the record's first instant, accelerations in g.
 */
#include "host/report/report.h"

struct curves_axes {
	const struct channel *x, *y;
	double x_offset_g, y_offset_g; /* baselines, taken off */
};

/* Of sensor "S1" or "S2"; false when it lacks one. */
bool curves_axes(const struct report *report, const char *sensor, struct curves_axes *axes);

/* hypot(X, Y) at sample k of Y, X read between its samples, straight; NAN beside one that is not good. */
double curves_resultant(const struct curves_axes *axes, size_t k);

/* The instant of the model's first touch, so that its S2 resultant peaks where the measured one does. False
 * without a model, or without such a peak. */
bool curves_model_start(const struct report *report, double *start_s);

#endif
