/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/traces.h"

#include <math.h>
#include <string.h>

#include "host/report/curves.h"
#include "host/report/script.h"

/* Around the impact: wide enough for the pulse and what follows it. The whole record if there is none. */
static struct script_window impact_window(const struct report *report, const struct report_zero *zero)
{
	struct script_window whole = script_whole(report->record), window;
	double width_s = zero->width_s;

	if (!isfinite(width_s) && report->record->is_drop && isfinite(report->record->trigger_s))
		width_s = 0.003;
	if (!isfinite(width_s))
		return whole;
	window.from_s = fmax(whole.from_s, zero->time_s - 1.5 * width_s);
	window.to_s = fmin(whole.to_s, zero->time_s + 6.5 * width_s);
	return window;
}

/* ---- the model ---- */

static bool model_axis_of(const struct channel *channel, enum model_axis *axis)
{
	if (channel->sensor == 0 || channel->axis == 'Z')
		return false;
	if (channel->sensor == 1)
		*axis = channel->axis == 'X' ? MODEL_S1X : MODEL_S1Y;
	else
		*axis = channel->axis == 'X' ? MODEL_S2X : MODEL_S2Y;
	return true;
}

bool traces_has_model(const struct report *report, const struct channel *channel)
{
	enum model_axis axis;
	double start_s;

	return model_axis_of(channel, &axis) && curves_model_start(report, &start_s);
}

/* value_g[SCRIPT_CURVE_POINTS] over the window; false without a model. */
static bool model_values(const struct report *report, enum model_axis axis, struct script_window window,
                         double *value_g)
{
	double start_s, step_s = (window.to_s - window.from_s) / (SCRIPT_CURVE_POINTS - 1);
	enum model_fidelity fidelity;

	return curves_model_start(report, &start_s) &&
	       model_fidelity_parse(report->prediction->fidelity, &fidelity) == 0 &&
	       model_history(report->scene, fidelity, axis, window.from_s - start_s, step_s, value_g,
	                     SCRIPT_CURVE_POINTS) == 0;
}

/* ---- one channel ---- */

/* Channels of the tower along the same axis are drawn to the same scale. */
static bool same_scale(const struct channel *a, const struct channel *b)
{
	return a == b || (a->sensor > 0 && b->sensor > 0 && a->axis == b->axis);
}

static struct script_range channel_range(const struct report *report, size_t channel,
                                         struct script_window window)
{
	const struct record *record = report->record;
	struct script_range range = {0.0, 0.0};
	double model[SCRIPT_CURVE_POINTS];
	enum model_axis axis;

	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *c = &record->channels[i];

		if (!same_scale(c, &record->channels[channel]))
			continue;
		script_reach_samples(&range, c, report_offset(&report->analysis->channels[i]), window);
		if (!model_axis_of(c, &axis) || !model_values(report, axis, window, model))
			continue;
		for (int k = 0; k < SCRIPT_CURVE_POINTS; k++)
			script_reach(&range, model[k]);
	}
	return range;
}

static const char *colour(const struct channel *channel)
{
	return channel->sensor == 2 ? SCRIPT_COLOUR_S2 : SCRIPT_COLOUR_S1;
}

bool traces_channel(FILE *out, const struct report *report, const struct report_zero *zero, size_t channel)
{
	const struct channel *c = &report->record->channels[channel];
	const struct estimate_channel *e = &report->analysis->channels[channel];
	struct script_window window = impact_window(report, zero);
	struct script_range range = channel_range(report, channel, window);
	double offset = report_offset(e), model[SCRIPT_CURVE_POINTS];
	enum model_axis axis;
	bool has_model = model_axis_of(c, &axis) && model_values(report, axis, window, model);
	bool has_peak = isfinite(e->peak.time_s) && isfinite(e->peak.value_g);
	size_t points, clipped;

	script_axes(out, 560, 270, window, zero->time_s, range);
	script_bands(out, c, zero->time_s, window);
	script_limits(out, c, offset, range);
	points = script_samples(out, "measured", c, offset, zero->time_s, window);
	clipped = script_clipped(out, "clipped", c, offset, zero->time_s, window);
	if (!points)
		return false;
	if (has_model)
		script_curve(out, "model", model, window, zero->time_s);
	if (has_peak)
		fprintf(out, "$peak << EOD\n%.6f %.4f\nEOD\n", (e->peak.time_s - zero->time_s) * 1e3,
		        e->peak.value_g);
	fprintf(out, "plot $measured with lines linewidth 1.8 linecolor rgb '%s'", colour(c));
	if (has_model)
		fprintf(out, ", $model with lines dashtype (6,4) linewidth 1.6 linecolor rgb 'black'");
	if (clipped)
		fprintf(out, ", $clipped with points pointtype 9 pointsize 0.8 linecolor rgb "
		             "'" SCRIPT_COLOUR_CLIPPED "'");
	if (has_peak)
		fprintf(out,
		        ", $peak with points pointtype 6 pointsize 1.1 linewidth 1.4 linecolor rgb 'black'");
	fputc('\n', out);
	return true;
}

/* ---- resultants ---- */

static size_t write_resultant(FILE *out, const struct report *report, const char *sensor, double zero_s,
                              struct script_window window, struct script_range *range)
{
	struct curves_axes axes;
	size_t last, points = 0;

	if (!curves_axes(report, sensor, &axes))
		return 0;
	last = script_from(axes.y, window.to_s);
	fprintf(out, "$%s << EOD\n", sensor);
	for (size_t k = script_from(axes.y, window.from_s); k < last; k++) {
		double r = curves_resultant(&axes, k);

		if (!isfinite(r)) {
			fputc('\n', out);
			continue;
		}
		fprintf(out, "%.6f %.4f\n", (script_time(axes.y, k) - zero_s) * 1e3, r);
		script_reach(range, r);
		points++;
	}
	fprintf(out, "EOD\n");
	return points;
}

static bool write_model_resultant(FILE *out, const struct report *report, const char *sensor, double zero_s,
                                  struct script_window window, struct script_range *range)
{
	bool s1 = !strcmp(sensor, "S1");
	double x[SCRIPT_CURVE_POINTS], y[SCRIPT_CURVE_POINTS];
	char name[16];

	if (!model_values(report, s1 ? MODEL_S1X : MODEL_S2X, window, x) ||
	    !model_values(report, s1 ? MODEL_S1Y : MODEL_S2Y, window, y))
		return false;
	for (int k = 0; k < SCRIPT_CURVE_POINTS; k++) {
		x[k] = hypot(x[k], y[k]);
		script_reach(range, x[k]);
	}
	snprintf(name, sizeof(name), "%smodel", sensor);
	script_curve(out, name, x, window, zero_s);
	return true;
}

bool traces_resultant(FILE *out, const struct report *report, const struct report_zero *zero)
{
	static const char *const sensors[] = {"S1", "S2"}, *const colours[] = {SCRIPT_COLOUR_S1,
	                                                                       SCRIPT_COLOUR_S2};
	struct script_window window = impact_window(report, zero);
	struct script_range range = {0.0, 0.0};
	bool drawn[2], model[2];

	for (int i = 0; i < 2; i++) {
		drawn[i] = write_resultant(out, report, sensors[i], zero->time_s, window, &range) > 0;
		model[i] = drawn[i] &&
		           write_model_resultant(out, report, sensors[i], zero->time_s, window, &range);
	}
	if (!drawn[0] && !drawn[1])
		return false;
	script_axes(out, 1140, 340, window, zero->time_s, range);
	fprintf(out, "plot NaN notitle");
	for (int i = 0; i < 2; i++) {
		if (drawn[i])
			fprintf(out, ", $%s with lines linewidth 2 linecolor rgb '%s'", sensors[i],
			        colours[i]);
		if (model[i])
			fprintf(out, ", $%smodel with lines dashtype (6,4) linewidth 1.6 linecolor rgb '%s'",
			        sensors[i], colours[i]);
	}
	fputc('\n', out);
	return true;
}

/* ---- the whole record ---- */

static bool overview_shows(const struct report *report, size_t channel)
{
	const struct analysis *a = report->analysis;
	const struct channel *x[] = {record_axis(report->record, "S1X"), record_axis(report->record, "S2X")};

	if (x[0] || x[1])
		return x[0] == &report->record->channels[channel] ||
		       x[1] == &report->record->channels[channel];
	for (size_t i = 0; i < a->channel_count; i++)
		if (fabs(a->channels[i].peak.value_g) > fabs(a->channels[channel].peak.value_g))
			return false;
	return true;
}

bool traces_overview(FILE *out, const struct report *report, const struct report_zero *zero)
{
	struct script_window window = script_whole(report->record), impact = impact_window(report, zero);
	struct script_range range = {0.0, 0.0};
	size_t drawn[2], count = 0;

	for (size_t i = 0; i < report->record->channel_count && count < 2; i++) {
		const struct channel *c = &report->record->channels[i];
		char name[16];

		if (!overview_shows(report, i))
			continue;
		snprintf(name, sizeof(name), "c%zu", count);
		script_reach_samples(&range, c, report_offset(&report->analysis->channels[i]), window);
		script_bands(out, c, zero->time_s, window);
		if (script_samples(out, name, c, report_offset(&report->analysis->channels[i]), zero->time_s,
		                   window))
			drawn[count++] = i;
	}
	if (!count)
		return false;
	script_axes(out, 1140, 260, window, zero->time_s, range);
	fprintf(out,
	        "set object rectangle from %.6f, graph 0 to %.6f, graph 1 behind fillcolor rgb '#56B4E9' "
	        "fillstyle transparent solid 0.15 noborder\nplot NaN notitle",
	        (impact.from_s - zero->time_s) * 1e3, (impact.to_s - zero->time_s) * 1e3);
	for (size_t i = 0; i < count; i++)
		fprintf(out, ", $c%zu with lines linewidth 1.2 linecolor rgb '%s'", i,
		        colour(&report->record->channels[drawn[i]]));
	fputc('\n', out);
	return true;
}
