/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/curves.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/report/facts.h"
#include "host/report/script.h"

bool curves_axes(const struct report *report, const char *sensor, struct curves_axes *axes)
{
	char x[12], y[12];

	snprintf(x, sizeof(x), "%.8sX", sensor);
	snprintf(y, sizeof(y), "%.8sY", sensor);
	axes->x = record_axis(report->record, x);
	axes->y = record_axis(report->record, y);
	if (!axes->x || !axes->y)
		return false;
	axes->x_offset_g = report_offset(report_axis(report, x));
	axes->y_offset_g = report_offset(report_axis(report, y));
	return true;
}

static double curves_value_at(const struct channel *c, double offset_g, double time_s)
{
	double place = (time_s - c->start_s) * c->rate_hz, whole = floor(place);
	size_t k;

	if (!(whole >= 0.0) || whole + 1.0 >= (double)c->count)
		return (double)NAN;
	k = (size_t)whole;
	if (!script_good(c, k) || !script_good(c, k + 1))
		return (double)NAN;
	return c->value_g[k] + (place - whole) * (c->value_g[k + 1] - c->value_g[k]) - offset_g;
}

double curves_resultant(const struct curves_axes *axes, size_t k)
{
	const struct channel *y = axes->y;

	if (!script_good(y, k))
		return (double)NAN;
	return hypot(curves_value_at(axes->x, axes->x_offset_g, script_time(y, k)),
	             y->value_g[k] - axes->y_offset_g);
}

bool curves_model_start(const struct report *report, double *start_s)
{
	const struct estimate_channel *s2x = report_axis(report, "S2X");
	double peak_s = s2x ? s2x->peak.time_s : (double)NAN;

	for (size_t i = 0; i < report->analysis->resultant_count; i++)
		if (!strcmp(report->analysis->resultants[i].sensor, "S2"))
			peak_s = report->analysis->resultants[i].time_s;
	if (!report->scene || !report->prediction || !isfinite(peak_s))
		return false;
	*start_s = peak_s - report->prediction->resultant[1].time_s;
	return true;
}
