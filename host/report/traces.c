/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/traces.h"

#include <math.h>
#include <string.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit.h>

#include "common/units.h"

enum {
	COLUMNS_MAX = 1500, /* of a picture; above it a column holds a smallest and a largest */
	BANDS_MAX = 100,    /* shaded runs of lost samples */
	CLIPPED_MAX = 500,  /* marks */
	MODEL_POINTS = 400,
	RINGDOWN_CYCLES = 5,
	RINGDOWN_DOTS = 70,
};

#define COLOUR_S1 "#0072B2"
#define COLOUR_S2 "#D55E00"
#define COLOUR_CLIPPED "#E69F00"
#define COLOUR_LOST "#999999"

struct range {
	double low, high;
};

static void reach(struct range *range, double value)
{
	range->low = fmin(range->low, value);
	range->high = fmax(range->high, value);
}

static double sample_time(const struct channel *channel, size_t k)
{
	return channel->start_s + (double)k / channel->rate_hz;
}

/* A lost or bad one is NAN. */
static bool sample_good(const struct channel *channel, size_t k)
{
	return isfinite(channel->value_g[k]);
}

/* First sample at or after time_s, at most count. */
static size_t sample_from(const struct channel *channel, double time_s)
{
	double k = ceil((time_s - channel->start_s) * channel->rate_hz - 1e-6);

	return k <= 0.0 ? 0 : k >= (double)channel->count ? channel->count : (size_t)k;
}

static double baseline(const struct estimate_channel *estimate)
{
	return isfinite(estimate->baseline.offset_g) ? estimate->baseline.offset_g : 0.0;
}

struct traces_window traces_whole(const struct record *record)
{
	struct traces_window window = {0.0, 0.0};

	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *c = &record->channels[i];

		window.from_s = fmin(window.from_s, c->start_s);
		if (c->count > 0)
			window.to_s = fmax(window.to_s, sample_time(c, c->count - 1));
	}
	return window;
}

struct traces_window traces_impact(const struct report *report, const struct report_zero *zero)
{
	struct traces_window whole = traces_whole(report->record), window;
	double width_s = zero->width_s;

	if (!isfinite(width_s) && report->record->is_drop && isfinite(report->record->trigger_s))
		width_s = 0.003;
	if (!isfinite(width_s))
		return whole;
	window.from_s = fmax(whole.from_s, zero->time_s - 1.5 * width_s);
	window.to_s = fmin(whole.to_s, zero->time_s + 6.5 * width_s);
	return window;
}

/* One column of samples [k, end): its good ones, smallest and largest in the order they come. A column
 * with a bad sample in it ends with a break. */
static size_t write_column(FILE *out, const struct channel *c, double offset, double zero_s, size_t k,
                           size_t end)
{
	size_t low = end, high = end;
	bool whole = true;

	for (size_t i = k; i < end; i++) {
		if (!sample_good(c, i)) {
			whole = false;
			continue;
		}
		if (low == end || c->value_g[i] < c->value_g[low])
			low = i;
		if (high == end || c->value_g[i] > c->value_g[high])
			high = i;
	}
	for (size_t i = k; i < end; i++)
		if (i == low || i == high)
			fprintf(out, "%.6f %.4f\n", (sample_time(c, i) - zero_s) * 1e3,
			        c->value_g[i] - offset);
	if (!whole)
		fputc('\n', out);
	return low != end;
}

/* $name, from the samples in the window. Returns how many points there are: 0 means the block must not be
 * plotted. */
static size_t write_samples(FILE *out, const char *name, const struct channel *c, double offset,
                            double zero_s, struct traces_window window)
{
	size_t first = sample_from(c, window.from_s), last = sample_from(c, window.to_s);
	size_t step = (last > first ? last - first : 0) / COLUMNS_MAX + 1, points = 0;

	fprintf(out, "$%s << EOD\n", name);
	for (size_t k = first; k < last; k += step)
		points += write_column(out, c, offset, zero_s, k, k + step < last ? k + step : last);
	fprintf(out, "EOD\n");
	return points;
}

static void reach_samples(struct range *range, const struct channel *c, double offset,
                          struct traces_window window)
{
	size_t last = sample_from(c, window.to_s);

	for (size_t k = sample_from(c, window.from_s); k < last; k++)
		if (sample_good(c, k))
			reach(range, c->value_g[k] - offset);
}

/* Shades every run of samples that are not there. */
static void write_bands(FILE *out, const struct channel *c, double zero_s, struct traces_window window)
{
	size_t last = sample_from(c, window.to_s), bands = 0;

	for (size_t k = sample_from(c, window.from_s); k < last && bands < BANDS_MAX; k++) {
		size_t end = k;

		while (end < last && !sample_good(c, end))
			end++;
		if (end == k)
			continue;
		fprintf(out,
		        "set object rectangle from %.6f, graph 0 to %.6f, graph 1 behind fillcolor rgb "
		        "'" COLOUR_LOST "' fillstyle transparent solid 0.3 noborder\n",
		        (fmax(sample_time(c, k) - 1.0 / c->rate_hz, window.from_s) - zero_s) * 1e3,
		        (sample_time(c, end) - zero_s) * 1e3);
		bands++;
		k = end;
	}
}

static size_t write_clipped(FILE *out, const struct channel *c, double offset, double zero_s,
                            struct traces_window window)
{
	size_t last = sample_from(c, window.to_s), points = 0;

	fprintf(out, "$clipped << EOD\n");
	for (size_t k = sample_from(c, window.from_s); k < last && points < CLIPPED_MAX; k++) {
		if (!(c->sample[k] & SAMPLE_CLIPPED) || !sample_good(c, k))
			continue;
		fprintf(out, "%.6f %.4f\n", (sample_time(c, k) - zero_s) * 1e3, c->value_g[k] - offset);
		points++;
	}
	fprintf(out, "EOD\n");
	return points;
}

/* The sensor's range, where the samples come near it. */
static void write_limits(FILE *out, const struct channel *c, double offset, struct range range)
{
	const double limits[] = {c->range_g, -c->range_g};

	for (int i = 0; i < 2 && c->range_g > 0.0; i++)
		if (limits[i] - offset > range.low && limits[i] - offset < range.high)
			fprintf(out,
			        "set arrow from graph 0, first %.4f to graph 1, first %.4f nohead "
			        "dashtype 3 linecolor rgb '" COLOUR_CLIPPED "' linewidth 1.5\n",
			        limits[i] - offset, limits[i] - offset);
}

static void write_axes(FILE *out, int width, int height, struct traces_window window, double zero_s,
                       struct range range)
{
	double margin = 0.07 * (range.high - range.low);

	if (!(margin > 0.0))
		margin = 1.0;
	fprintf(out, "set terminal svg size %d,%d dynamic noenhanced font 'sans-serif,15'\n", width, height);
	fprintf(out, "set encoding utf8\nunset key\nset border 3 linecolor rgb '#777777'\n");
	fprintf(out, "set tics nomirror out scale 0.5 textcolor rgb 'black'\nset grid linecolor rgb "
	             "'#999999' linewidth 0.4 "
	             "dashtype 1\n");
	fprintf(out,
	        "set xlabel 'ms' offset 0,0.7\nset label 'g' at graph 0, graph 1.07 right offset -1,0\n");
	fprintf(out, "set tmargin 1.5\nset rmargin 1\nset lmargin 7\nset bmargin 2.6\n");
	fprintf(out, "set xrange [%.6f:%.6f]\n", (window.from_s - zero_s) * 1e3,
	        (window.to_s - zero_s) * 1e3);
	fprintf(out, "set yrange [%.4f:%.4f]\n", range.low - margin, range.high + margin);
}

/* ---- the model ---- */

static bool model_axis_of(const char *channel, enum model_axis *axis)
{
	static const char *const names[MODEL_AXES] = {"S1X", "S1Y", "S2X", "S2Y"};

	for (enum model_axis a = 0; a < MODEL_AXES; a++)
		if (!strcmp(names[a], channel)) {
			*axis = a;
			return true;
		}
	return false;
}

/* The instant of the record at which the model's first touch lies, so that its S2 peaks where S2 did. */
static bool model_start(const struct report *report, double *start_s)
{
	const struct estimate_channel *s2x = report_estimate(report, "S2X");
	double peak_s = s2x ? s2x->peak.time_s : (double)NAN;

	for (size_t i = 0; i < report->analysis->resultant_count; i++)
		if (!strcmp(report->analysis->resultants[i].sensor, "S2"))
			peak_s = report->analysis->resultants[i].time_s;
	if (!report->scene || !report->prediction || !isfinite(peak_s))
		return false;
	*start_s = peak_s - report->prediction->resultant[1].time_s;
	return true;
}

bool traces_has_model(const struct report *report, const char *channel)
{
	enum model_axis axis;
	double start_s;

	return model_axis_of(channel, &axis) && model_start(report, &start_s);
}

/* value_g[MODEL_POINTS] over the window; false without a model. */
static bool model_values(const struct report *report, enum model_axis axis, struct traces_window window,
                         double *value_g)
{
	double start_s, step_s = (window.to_s - window.from_s) / (MODEL_POINTS - 1);
	enum model_fidelity fidelity;

	return model_start(report, &start_s) &&
	       model_fidelity_parse(report->prediction->fidelity, &fidelity) == 0 &&
	       model_history(report->scene, fidelity, axis, window.from_s - start_s, step_s, value_g,
	                     MODEL_POINTS) == 0;
}

static void write_curve(FILE *out, const char *name, const double *value_g, struct traces_window window,
                        double zero_s)
{
	fprintf(out, "$%s << EOD\n", name);
	for (int k = 0; k < MODEL_POINTS; k++) {
		double t = window.from_s + (window.to_s - window.from_s) * k / (MODEL_POINTS - 1);

		fprintf(out, "%.6f %.4f\n", (t - zero_s) * 1e3, value_g[k]);
	}
	fprintf(out, "EOD\n");
}

/* ---- one channel ---- */

/* Channels of the tower along the same axis are drawn to the same scale. */
static bool same_scale(const struct channel *a, const struct channel *b)
{
	return a == b || (strlen(a->name) == 3 && strlen(b->name) == 3 && a->name[0] == 'S' &&
	                  b->name[0] == 'S' && a->name[2] == b->name[2]);
}

static struct range channel_range(const struct report *report, size_t channel, struct traces_window window)
{
	const struct record *record = report->record;
	struct range range = {0.0, 0.0};
	double model[MODEL_POINTS];
	enum model_axis axis;

	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *c = &record->channels[i];

		if (!same_scale(c, &record->channels[channel]))
			continue;
		reach_samples(&range, c, baseline(&report->analysis->channels[i]), window);
		if (!model_axis_of(c->name, &axis) || !model_values(report, axis, window, model))
			continue;
		for (int k = 0; k < MODEL_POINTS; k++)
			reach(&range, model[k]);
	}
	return range;
}

static const char *colour(const struct channel *channel)
{
	return !strncmp(channel->name, "S2", 2) ? COLOUR_S2 : COLOUR_S1;
}

bool traces_channel(FILE *out, const struct report *report, const struct report_zero *zero, size_t channel)
{
	const struct channel *c = &report->record->channels[channel];
	const struct estimate_channel *e = &report->analysis->channels[channel];
	struct traces_window window = traces_impact(report, zero);
	struct range range = channel_range(report, channel, window);
	double offset = baseline(e), model[MODEL_POINTS];
	enum model_axis axis;
	bool has_model = model_axis_of(c->name, &axis) && model_values(report, axis, window, model);
	bool has_peak = isfinite(e->peak.time_s) && isfinite(e->peak.value_g);
	size_t points, clipped;

	write_axes(out, 560, 270, window, zero->time_s, range);
	write_bands(out, c, zero->time_s, window);
	write_limits(out, c, offset, range);
	points = write_samples(out, "measured", c, offset, zero->time_s, window);
	clipped = write_clipped(out, c, offset, zero->time_s, window);
	if (!points)
		return false;
	if (has_model)
		write_curve(out, "model", model, window, zero->time_s);
	if (has_peak)
		fprintf(out, "$peak << EOD\n%.6f %.4f\nEOD\n", (e->peak.time_s - zero->time_s) * 1e3,
		        e->peak.value_g);
	fprintf(out, "plot $measured with lines linewidth 1.8 linecolor rgb '%s'", colour(c));
	if (has_model)
		fprintf(out, ", $model with lines dashtype (6,4) linewidth 1.6 linecolor rgb 'black'");
	if (clipped)
		fprintf(out, ", $clipped with points pointtype 9 pointsize 0.8 linecolor rgb '" COLOUR_CLIPPED
		             "'");
	if (has_peak)
		fprintf(out,
		        ", $peak with points pointtype 6 pointsize 1.1 linewidth 1.4 linecolor rgb 'black'");
	fputc('\n', out);
	return true;
}

/* ---- resultants ---- */

/* X between its samples, straight; NAN beside a bad one. */
static double value_at(const struct channel *c, double offset, double time_s)
{
	double place = (time_s - c->start_s) * c->rate_hz, whole = floor(place);
	size_t k;

	if (!(whole >= 0.0) || whole + 1.0 >= (double)c->count)
		return (double)NAN;
	k = (size_t)whole;
	if (!sample_good(c, k) || !sample_good(c, k + 1))
		return (double)NAN;
	return c->value_g[k] + (place - whole) * (c->value_g[k + 1] - c->value_g[k]) - offset;
}

static size_t write_resultant(FILE *out, const struct report *report, const char *sensor, double zero_s,
                              struct traces_window window, struct range *range)
{
	char x_name[12], y_name[12];
	const struct channel *x, *y;
	double x_offset, y_offset;
	size_t last, points = 0;

	snprintf(x_name, sizeof(x_name), "%sX", sensor);
	snprintf(y_name, sizeof(y_name), "%sY", sensor);
	x = record_channel(report->record, x_name);
	y = record_channel(report->record, y_name);
	if (!x || !y)
		return 0;
	x_offset = baseline(report_estimate(report, x_name));
	y_offset = baseline(report_estimate(report, y_name));
	last = sample_from(y, window.to_s);
	fprintf(out, "$%s << EOD\n", sensor);
	for (size_t k = sample_from(y, window.from_s); k < last; k++) {
		double r = hypot(value_at(x, x_offset, sample_time(y, k)), y->value_g[k] - y_offset);

		if (!sample_good(y, k) || !isfinite(r)) {
			fputc('\n', out);
			continue;
		}
		fprintf(out, "%.6f %.4f\n", (sample_time(y, k) - zero_s) * 1e3, r);
		reach(range, r);
		points++;
	}
	fprintf(out, "EOD\n");
	return points;
}

static bool write_model_resultant(FILE *out, const struct report *report, const char *sensor, double zero_s,
                                  struct traces_window window, struct range *range)
{
	bool s1 = !strcmp(sensor, "S1");
	double x[MODEL_POINTS], y[MODEL_POINTS];
	char name[16];

	if (!model_values(report, s1 ? MODEL_S1X : MODEL_S2X, window, x) ||
	    !model_values(report, s1 ? MODEL_S1Y : MODEL_S2Y, window, y))
		return false;
	for (int k = 0; k < MODEL_POINTS; k++) {
		x[k] = hypot(x[k], y[k]);
		reach(range, x[k]);
	}
	snprintf(name, sizeof(name), "%smodel", sensor);
	write_curve(out, name, x, window, zero_s);
	return true;
}

bool traces_resultant(FILE *out, const struct report *report, const struct report_zero *zero)
{
	static const char *const sensors[] = {"S1", "S2"}, *const colours[] = {COLOUR_S1, COLOUR_S2};
	struct traces_window window = traces_impact(report, zero);
	struct range range = {0.0, 0.0};
	bool drawn[2], model[2];

	for (int i = 0; i < 2; i++) {
		drawn[i] = write_resultant(out, report, sensors[i], zero->time_s, window, &range) > 0;
		model[i] = drawn[i] &&
		           write_model_resultant(out, report, sensors[i], zero->time_s, window, &range);
	}
	if (!drawn[0] && !drawn[1])
		return false;
	write_axes(out, 1140, 340, window, zero->time_s, range);
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
	const char *name = report->record->channels[channel].name;

	if (record_channel(report->record, "S1X") || record_channel(report->record, "S2X"))
		return !strcmp(name, "S1X") || !strcmp(name, "S2X");
	for (size_t i = 0; i < a->channel_count; i++)
		if (fabs(a->channels[i].peak.value_g) > fabs(a->channels[channel].peak.value_g))
			return false;
	return true;
}

bool traces_overview(FILE *out, const struct report *report, const struct report_zero *zero)
{
	struct traces_window window = traces_whole(report->record), impact = traces_impact(report, zero);
	struct range range = {0.0, 0.0};
	size_t drawn[2], count = 0;

	for (size_t i = 0; i < report->record->channel_count && count < 2; i++) {
		const struct channel *c = &report->record->channels[i];
		char name[16];

		if (!overview_shows(report, i))
			continue;
		snprintf(name, sizeof(name), "c%zu", count);
		reach_samples(&range, c, baseline(&report->analysis->channels[i]), window);
		write_bands(out, c, zero->time_s, window);
		if (write_samples(out, name, c, baseline(&report->analysis->channels[i]), zero->time_s,
		                  window))
			drawn[count++] = i;
	}
	if (!count)
		return false;
	write_axes(out, 1140, 260, window, zero->time_s, range);
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

/* ---- ring-down ---- */

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
static bool fit_decay(struct decay *d, const struct channel *c, double offset, struct traces_window window)
{
	size_t first = sample_from(c, window.from_s), last = sample_from(c, window.to_s), rows = 0;
	double chi2;
	gsl_matrix *design, *covariance;
	gsl_vector *value;
	gsl_multifit_linear_workspace *work;
	bool fitted = false;

	for (size_t k = first; k < last; k++)
		rows += sample_good(c, k);
	if (rows < 8)
		return false;
	design = gsl_matrix_alloc(rows, 3);
	covariance = gsl_matrix_alloc(3, 3);
	value = gsl_vector_alloc(rows);
	work = gsl_multifit_linear_alloc(rows, 3);
	if (design && covariance && value && work) {
		gsl_vector_view result = gsl_vector_view_array(d->c, 3);
		size_t row = 0;

		for (size_t k = first; k < last; k++) {
			if (!sample_good(c, k))
				continue;
			decay_terms(d, sample_time(c, k), gsl_matrix_ptr(design, row, 0));
			gsl_vector_set(value, row++, c->value_g[k] - offset);
		}
		fitted = gsl_multifit_linear(design, value, &result.vector, covariance, &chi2, work) ==
		                 GSL_SUCCESS &&
		         isfinite(d->c[0] + d->c[1] + d->c[2]);
	}
	gsl_matrix_free(design);
	gsl_matrix_free(covariance);
	gsl_vector_free(value);
	if (work)
		gsl_multifit_linear_free(work);
	return fitted;
}

/* The plate is free from the end of the contact on, which is a little after S2's pulse meets 10 %. */
static bool decay_of_plate(const struct report *report, struct decay *decay)
{
	const struct estimate_ringdown *plate = &report->analysis->plate;
	const struct estimate_channel *s2 = report_estimate(report, "S2X");
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
	const struct channel *c = record_channel(report->record, name);
	struct traces_window whole = traces_whole(report->record), window;
	struct range range = {0.0, 0.0};
	struct decay decay;
	double offset, fit[MODEL_POINTS];
	size_t points;

	gsl_set_error_handler_off();
	if (!c || !decay_of_plate(report, &decay))
		return false;
	offset = baseline(report_estimate(report, name));
	window.from_s = decay.start_s;
	window.to_s = fmin(whole.to_s, decay.start_s + RINGDOWN_CYCLES * 2.0 * UNITS_PI / decay.omega);
	if (!(window.to_s > window.from_s) || !fit_decay(&decay, c, offset, window))
		return false;
	for (int k = 0; k < MODEL_POINTS; k++) {
		fit[k] = decay_value(&decay,
		                     window.from_s + (window.to_s - window.from_s) * k / (MODEL_POINTS - 1));
		reach(&range, fit[k]);
	}
	reach_samples(&range, c, offset, window);
	write_axes(out, 560, 270, window, zero->time_s, range);
	write_bands(out, c, zero->time_s, window);
	write_curve(out, "fit", fit, window, zero->time_s);
	points = write_samples(out, "measured", c, offset, zero->time_s, window);
	if (!points)
		return false;
	fprintf(out,
	        "plot $measured every %zu with points pointtype 6 pointsize 0.6 linewidth 2 linecolor rgb "
	        "'" COLOUR_S1 "', $fit with lines linewidth 1.2 linecolor rgb 'black'\n",
	        points / RINGDOWN_DOTS + 1);
	return true;
}
