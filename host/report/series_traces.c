/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/report/series_private.h"

static const char *const sensors[] = {"S1", "S2"};
static const char *const colours[] = {SCRIPT_COLOUR_S1, SCRIPT_COLOUR_S2};

static enum model_axis model_axis(size_t sensor, char axis)
{
	return sensor == 0 ? (axis == 'X' ? MODEL_S1X : MODEL_S1Y) : (axis == 'X' ? MODEL_S2X : MODEL_S2Y);
}

const struct channel *series_channel(const struct series_drop *drop, size_t sensor, char axis)
{
	char name[] = {'S', (char)('1' + sensor), axis, '\0'};

	return series_is_drawn(drop) ? record_axis(&drop->record, name) : NULL;
}

static double offset_of(const struct series_drop *drop, const struct channel *channel)
{
	return report_offset(&drop->analysis.channels[channel - drop->record.channels]);
}

/* The pictures' window on a drop's own time. */
static struct script_window window_of(const struct series_page *page, const struct series_drop *drop)
{
	return (struct script_window){page->window.from_s + drop->zero.time_s,
	                              page->window.to_s + drop->zero.time_s};
}

/* One range for every picture along an axis, so that heights compare by eye. */
static struct script_range range_of(const struct series_page *page, char axis)
{
	struct script_range range = {0.0, 0.0};

	for (size_t i = 0; i < page->count; i++)
		for (size_t sensor = 0; sensor < 2; sensor++) {
			const struct series_drop *d = page->drop[i];
			const struct channel *c = series_channel(d, sensor, axis);

			if (c)
				script_reach_samples(&range, c, offset_of(d, c), window_of(page, d));
		}
	for (size_t k = 0; k < SCRIPT_CURVE_POINTS && page->has_model; k++)
		for (size_t sensor = 0; sensor < 2; sensor++)
			script_reach(&range, page->curve_g[k][model_axis(sensor, axis)]);
	return range;
}

/* $name, the model with its first touch at touch_s; false when there is none to lay. */
static bool series_traces_write_model(FILE *out, const struct series_page *page, const char *name,
                                      enum model_axis axis, double touch_s)
{
	double value_g[SCRIPT_CURVE_POINTS];

	if (!page->has_model || !isfinite(touch_s))
		return false;
	for (size_t k = 0; k < SCRIPT_CURVE_POINTS; k++)
		value_g[k] = page->curve_g[k][axis];
	script_curve(out, name, value_g, page->curve, -touch_s);
	return true;
}

/* ---- all drops ---- */

static double mean_touch(const struct series_page *page)
{
	double sum = 0.0;
	unsigned n = 0;

	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && isfinite(page->drop[i]->model_s)) {
			sum += page->drop[i]->model_s;
			n++;
		}
	return n ? sum / n : (double)NAN;
}

bool series_traces_over(FILE *out, const struct series_page *page, size_t sensor, char axis)
{
	size_t drawn = 0;
	bool model =
	        series_traces_write_model(out, page, "model", model_axis(sensor, axis), mean_touch(page));

	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];
		const struct channel *c = d->counts ? series_channel(d, sensor, axis) : NULL;
		char name[16];

		snprintf(name, sizeof(name), "d%zu", drawn);
		if (c && script_samples(out, name, c, offset_of(d, c), d->zero.time_s, window_of(page, d)))
			drawn++;
	}
	if (!drawn)
		return false;
	script_axes(out, 560, 300, page->window, 0.0, range_of(page, axis));
	fprintf(out, "plot NaN notitle");
	for (size_t i = 0; i < drawn; i++)
		fprintf(out, ", $d%zu with lines linewidth 1.3 linecolor rgb '%s'", i, colours[sensor]);
	if (model)
		fprintf(out, ", $model with lines dashtype (4,8) linewidth 1.3 linecolor rgb 'black'");
	fputc('\n', out);
	return true;
}

/* ---- one drop ---- */

/* What one sensor adds to the picture of a drop. */
struct layer {
	bool samples, clipped, model;
};

static struct layer series_traces_write_layer(FILE *out, const struct series_page *page,
                                              const struct series_drop *drop, size_t sensor, char axis)
{
	const struct channel *c = series_channel(drop, sensor, axis);
	struct script_window window = window_of(page, drop);
	struct layer layer = {false, false, false};
	char name[24];

	if (!c)
		return layer;
	snprintf(name, sizeof(name), "%s", sensors[sensor]);
	layer.samples = script_samples(out, name, c, offset_of(drop, c), drop->zero.time_s, window) > 0;
	snprintf(name, sizeof(name), "%sclipped", sensors[sensor]);
	layer.clipped = script_clipped(out, name, c, offset_of(drop, c), drop->zero.time_s, window) > 0;
	snprintf(name, sizeof(name), "%smodel", sensors[sensor]);
	layer.model = series_traces_write_model(out, page, name, model_axis(sensor, axis), drop->model_s);
	script_bands(out, c, drop->zero.time_s, window);
	return layer;
}

bool series_traces_drop(FILE *out, const struct series_page *page, const struct series_drop *drop, char axis)
{
	struct layer layer[2];

	for (size_t s = 0; s < 2; s++)
		layer[s] = series_traces_write_layer(out, page, drop, s, axis);
	if (!layer[0].samples && !layer[1].samples)
		return false;
	script_axes(out, 560, 250, page->window, 0.0, range_of(page, axis));
	fprintf(out, "plot NaN notitle");
	for (size_t s = 0; s < 2; s++) {
		if (layer[s].model)
			fprintf(out, ", $%smodel with lines dashtype (6,4) linewidth 1.4 linecolor rgb '%s'",
			        sensors[s], colours[s]);
		if (layer[s].samples)
			fprintf(out, ", $%s with lines linewidth 1.8 linecolor rgb '%s'", sensors[s],
			        colours[s]);
		if (layer[s].clipped)
			fprintf(out,
			        ", $%sclipped with points pointtype 9 pointsize 0.7 linecolor rgb "
			        "'" SCRIPT_COLOUR_CLIPPED "'",
			        sensors[s]);
	}
	fputc('\n', out);
	return true;
}
