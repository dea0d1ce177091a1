/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/script.h"

#include <math.h>

enum {
	COLUMNS_MAX = 1500, /* of a picture; above it a column holds a smallest and a largest */
	BANDS_MAX = 100,    /* shaded runs of lost samples */
	CLIPPED_MAX = 500,  /* marks */
};

void script_reach(struct script_range *range, double value)
{
	range->low = fmin(range->low, value);
	range->high = fmax(range->high, value);
}

double script_time(const struct channel *channel, size_t k)
{
	return channel->start_s + (double)k / channel->rate_hz;
}

bool script_good(const struct channel *channel, size_t k)
{
	return isfinite(channel->value_g[k]);
}

size_t script_from(const struct channel *channel, double time_s)
{
	double k = ceil((time_s - channel->start_s) * channel->rate_hz - 1e-6);

	return k <= 0.0 ? 0 : k >= (double)channel->count ? channel->count : (size_t)k;
}

struct script_window script_whole(const struct record *record)
{
	struct script_window window = {0.0, 0.0};

	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *c = &record->channels[i];

		window.from_s = fmin(window.from_s, c->start_s);
		if (c->count > 0)
			window.to_s = fmax(window.to_s, script_time(c, c->count - 1));
	}
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
		if (!script_good(c, i)) {
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
			fprintf(out, "%.6f %.4f\n", (script_time(c, i) - zero_s) * 1e3,
			        c->value_g[i] - offset);
	if (!whole)
		fputc('\n', out);
	return low != end;
}

size_t script_samples(FILE *out, const char *name, const struct channel *c, double offset, double zero_s,
                      struct script_window window)
{
	size_t first = script_from(c, window.from_s), last = script_from(c, window.to_s);
	size_t step = (last > first ? last - first : 0) / COLUMNS_MAX + 1, points = 0;

	fprintf(out, "$%s << EOD\n", name);
	for (size_t k = first; k < last; k += step)
		points += write_column(out, c, offset, zero_s, k, k + step < last ? k + step : last);
	fprintf(out, "EOD\n");
	return points;
}

void script_reach_samples(struct script_range *range, const struct channel *c, double offset,
                          struct script_window window)
{
	size_t last = script_from(c, window.to_s);

	for (size_t k = script_from(c, window.from_s); k < last; k++)
		if (script_good(c, k))
			script_reach(range, c->value_g[k] - offset);
}

void script_bands(FILE *out, const struct channel *c, double zero_s, struct script_window window)
{
	size_t last = script_from(c, window.to_s), bands = 0;

	for (size_t k = script_from(c, window.from_s); k < last && bands < BANDS_MAX; k++) {
		size_t end = k;

		while (end < last && !script_good(c, end))
			end++;
		if (end == k)
			continue;
		fprintf(out,
		        "set object rectangle from %.6f, graph 0 to %.6f, graph 1 behind fillcolor rgb "
		        "'" SCRIPT_COLOUR_LOST "' fillstyle transparent solid 0.3 noborder\n",
		        (fmax(script_time(c, k) - 1.0 / c->rate_hz, window.from_s) - zero_s) * 1e3,
		        (script_time(c, end) - zero_s) * 1e3);
		bands++;
		k = end;
	}
}

size_t script_clipped(FILE *out, const char *name, const struct channel *c, double offset, double zero_s,
                      struct script_window window)
{
	size_t last = script_from(c, window.to_s), points = 0;

	fprintf(out, "$%s << EOD\n", name);
	for (size_t k = script_from(c, window.from_s); k < last && points < CLIPPED_MAX; k++) {
		if (!(c->sample[k] & SAMPLE_CLIPPED) || !script_good(c, k))
			continue;
		fprintf(out, "%.6f %.4f\n", (script_time(c, k) - zero_s) * 1e3, c->value_g[k] - offset);
		points++;
	}
	fprintf(out, "EOD\n");
	return points;
}

void script_limits(FILE *out, const struct channel *c, double offset, struct script_range range)
{
	const double limits[] = {c->range_g, -c->range_g};

	for (int i = 0; i < 2 && c->range_g > 0.0; i++)
		if (limits[i] - offset > range.low && limits[i] - offset < range.high)
			fprintf(out,
			        "set arrow from graph 0, first %.4f to graph 1, first %.4f nohead "
			        "dashtype 3 linecolor rgb '" SCRIPT_COLOUR_CLIPPED "' linewidth 1.5\n",
			        limits[i] - offset, limits[i] - offset);
}

void script_paper(FILE *out, int width, int height, const char *x_unit, const char *y_unit)
{
	fprintf(out, "set terminal svg size %d,%d dynamic noenhanced font 'sans-serif,15'\n", width, height);
	fprintf(out, "set encoding utf8\nunset key\nset border 3 linecolor rgb '#777777'\n");
	fprintf(out, "set tics nomirror out scale 0.5 textcolor rgb 'black'\nset grid linecolor rgb "
	             "'#999999' linewidth 0.4 "
	             "dashtype 1\n");
	fprintf(out, "set xlabel '%s' offset 0,0.7\nset label '%s' at graph 0, graph 1 right offset -1,1\n",
	        x_unit, y_unit);
	fprintf(out, "set tmargin 1.5\nset rmargin 1\nset lmargin 7\nset bmargin 2.6\n");
}

void script_axes(FILE *out, int width, int height, struct script_window window, double zero_s,
                 struct script_range range)
{
	double margin = 0.07 * (range.high - range.low);

	if (!(margin > 0.0))
		margin = 1.0;
	script_paper(out, width, height, "ms", "g");
	fprintf(out, "set xrange [%.6f:%.6f]\n", (window.from_s - zero_s) * 1e3,
	        (window.to_s - zero_s) * 1e3);
	fprintf(out, "set yrange [%.4f:%.4f]\n", range.low - margin, range.high + margin);
}

void script_spectrum_axes(FILE *out, int width, int height, double from_hz, double to_hz,
                          struct script_range range)
{
	script_paper(out, width, height, "Hz", "g");
	fprintf(out, "set logscale xy\nset rmargin 3\nset xrange [%.6g:%.6g]\nset yrange [%.4g:%.4g]\n",
	        from_hz, to_hz, 0.8 * range.low, 1.25 * range.high);
}

void script_curve(FILE *out, const char *name, const double *value_g, struct script_window window,
                  double zero_s)
{
	fprintf(out, "$%s << EOD\n", name);
	for (int k = 0; k < SCRIPT_CURVE_POINTS; k++) {
		double t = window.from_s + (window.to_s - window.from_s) * k / (SCRIPT_CURVE_POINTS - 1);

		fprintf(out, "%.6f %.4f\n", (t - zero_s) * 1e3, value_g[k]);
	}
	fprintf(out, "EOD\n");
}
