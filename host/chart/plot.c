/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/plot.h"

#include <math.h>
#include <string.h>

#include "host/chart/file.h"

/* Shown 838 px wide, as a README is, the smallest text (12) still has 10 px. */
enum {
	WIDTH = 1000,
	LEFT = 76,
	GAP = 90,
	RIGHT = 20,
	HEAD = 94, /* down to the first panel's title, with one line of notes */
	LINE = 20,
	TITLE = 46,
	PLOT = 340,
	BOTTOM = 60,
	LEGEND = 40,
	COLUMNS = 2,
	NOTE_MOST = 150 /* letters of a line */
};

/* Pale to dark in one hue: the colour-blind tell by lightness. */
static const char *const shades[PLOT_SHADES] = {"#f7fbff", "#d3e4f3", "#9ecae1", "#4a90c4", "#08519c"};

#define NO_VALUE "#b8b8b8"
#define FAIL "#d55e00"

/* As accuracy.c's, with their marks. */
static const struct {
	const char *colour;
	int mark;
} styles[] = {{"#000000", 7},  {"#0072b2", 5},  {"#d55e00", 9}, {"#009e73", 11},
              {"#cc79a7", 13}, {"#e69f00", 15}, {"#56b4e9", 4}, {"#888888", 6},
              {"#888888", 2},  {"#009e73", 10}, {"#d55e00", 8}};
enum { STYLES = sizeof(styles) / sizeof(styles[0]) };

double plot_edge(const struct plot_axis *axis, size_t i, size_t count)
{
	double part = (double)i / (double)count;

	return axis->log ? axis->from * pow(axis->to / axis->from, part)
	                 : axis->from + (axis->to - axis->from) * part;
}

double plot_centre(const struct plot_axis *axis, size_t i, size_t count)
{
	return plot_edge(axis, 2 * i + 1, 2 * count);
}

static double plot_cell(const struct plot_panel *panel, size_t row, size_t column)
{
	return panel->cell[row * panel->columns + column];
}

bool plot_fails(const struct plot_panel *panel, size_t row, size_t column)
{
	return !(plot_cell(panel, row, column) <= panel->fails);
}

/* ---- the table ------------------------------------------------------------------------------------------
 */

static void table_of_map(FILE *out, const struct plot *plot, const struct plot_panel *p)
{
	for (size_t r = 0; r < p->rows; r++)
		for (size_t c = 0; c < p->columns; c++)
			fprintf(out, "\"%s\",\"%s\",map,%s,%.6g,%s,%.6g,\"%s\",%.6g,%d\n", plot->title,
			        p->title, p->x.name, plot_centre(&p->x, c, p->columns), p->y.name,
			        plot_centre(&p->y, r, p->rows), plot->value ? plot->value : "",
			        plot_cell(p, r, c), plot_fails(p, r, c));
}

static bool in_region(const struct plot_panel *p, double x, double y)
{
	for (size_t i = 0; i < PLOT_REGIONS; i++)
		if (x >= p->region[i].from && x <= p->region[i].to && y >= p->region[i].low &&
		    y <= p->region[i].high && p->region[i].to > p->region[i].from)
			return true;
	return false;
}

static void table_of_series(FILE *out, const struct plot *plot, const struct plot_panel *p)
{
	for (size_t s = 0; s < PLOT_SERIES && p->series[s].name; s++)
		for (size_t i = 0; i < p->series[s].count; i++)
			fprintf(out, "\"%s\",\"%s\",\"%s\",%s,%.6g,%s,%.6g,,,%d\n", plot->title, p->title,
			        p->series[s].name, p->x.name, p->series[s].x[i], p->y.name, p->series[s].y[i],
			        p->series[s].judged && in_region(p, p->series[s].x[i], p->series[s].y[i]));
}

static int write_table(const struct plot *plot, const char *folder, const char *kind, char *message)
{
	struct text text;
	int status = file_begin(&text, message);

	if (status)
		return status;
	fputs("title,panel,series,x_is,x,y_is,y,value_is,value,fails\n", text.out);
	for (size_t i = 0; i < plot->panels; i++) {
		if (plot->panel[i].cell)
			table_of_map(text.out, plot, &plot->panel[i]);
		table_of_series(text.out, plot, &plot->panel[i]);
	}
	status = file_write(&text, folder, kind, plot->name, "csv", message);
	file_drop(&text);
	return status;
}

/* ---- the cells: neighbours in a row that look alike are one rectangle ------------------------------------
 */

static int plot_shade_of(const struct plot *plot, double value)
{
	int i = 0;

	while (i < PLOT_SHADES - 1 && value > plot->shade[i])
		i++;
	return isnan(value) ? PLOT_SHADES : i;
}

/* What a layer holds: a shade, PLOT_SHADES for no value, or those that fail. */
enum { LAYER_FAILS = PLOT_SHADES + 1, LAYERS };

static bool plot_in_layer(const struct plot *plot, const struct plot_panel *p, size_t row, size_t column,
                          int layer)
{
	return layer == LAYER_FAILS ? plot_fails(p, row, column)
	                            : plot_shade_of(plot, plot_cell(p, row, column)) == layer;
}

/* One point out of sight, so that no layer is empty. */
static void plot_write_layer(FILE *out, const struct plot *plot, const struct plot_panel *p, size_t number,
                             int layer)
{
	fprintf(out, "$cells%zu_%d << EOD\nNaN NaN NaN NaN\n", number, layer);
	for (size_t r = 0; r < p->rows; r++)
		for (size_t c = 0, next; c < p->columns; c = next) {
			for (next = c; next < p->columns && plot_in_layer(plot, p, r, next, layer); next++)
				;
			if (next > c)
				fprintf(out, "%.5g %.5g %.5g %.5g\n", plot_edge(&p->x, c, p->columns),
				        plot_edge(&p->x, next, p->columns), plot_edge(&p->y, r, p->rows),
				        plot_edge(&p->y, r + 1, p->rows));
			else
				next = c + 1;
		}
	fputs("EOD\n", out);
}

/* Whether the boundary runs below (or, turned, left of) the cell. */
static bool is_boundary(const struct plot_panel *p, size_t row, size_t column, bool turned)
{
	return plot_fails(p, row, column) !=
	       (turned ? plot_fails(p, row, column - 1) : plot_fails(p, row - 1, column));
}

static void write_boundary(FILE *out, const struct plot_panel *p, size_t number)
{
	fprintf(out, "$edge%zu << EOD\nNaN NaN\n\n", number);
	for (size_t r = 1; r < p->rows; r++)
		for (size_t c = 0, next; c < p->columns; c = next) {
			for (next = c; next < p->columns && is_boundary(p, r, next, false); next++)
				;
			if (next > c)
				fprintf(out, "%.5g %.5g\n%.5g %.5g\n\n", plot_edge(&p->x, c, p->columns),
				        plot_edge(&p->y, r, p->rows), plot_edge(&p->x, next, p->columns),
				        plot_edge(&p->y, r, p->rows));
			else
				next = c + 1;
		}
	for (size_t c = 1; c < p->columns; c++)
		for (size_t r = 0, next; r < p->rows; r = next) {
			for (next = r; next < p->rows && is_boundary(p, next, c, true); next++)
				;
			if (next > r)
				fprintf(out, "%.5g %.5g\n%.5g %.5g\n\n", plot_edge(&p->x, c, p->columns),
				        plot_edge(&p->y, r, p->rows), plot_edge(&p->x, c, p->columns),
				        plot_edge(&p->y, next, p->rows));
			else
				next = r + 1;
		}
	fputs("EOD\n", out);
}

/* ---- one panel -------------------------------------------------------------------------------------------
 */

static void write_data(FILE *out, const struct plot *plot, const struct plot_panel *p, size_t number)
{
	if (p->cell) {
		for (int layer = 0; layer < LAYERS; layer++)
			plot_write_layer(out, plot, p, number, layer);
		write_boundary(out, p, number);
	}
	fprintf(out, "$regions%zu << EOD\nNaN NaN NaN NaN\n", number);
	for (size_t i = 0; i < PLOT_REGIONS; i++)
		if (p->region[i].to > p->region[i].from)
			fprintf(out, "%.6g %.6g %.6g %.6g\n", p->region[i].from, p->region[i].to,
			        p->region[i].low, p->region[i].high);
	fputs("EOD\n", out);
	for (size_t s = 0; s < PLOT_SERIES && p->series[s].name; s++) {
		fprintf(out, "$series%zu_%zu << EOD\n", number, s);
		for (size_t i = 0; i < p->series[s].count; i++)
			fprintf(out, "%.6g %.6g\n", p->series[s].x[i], p->series[s].y[i]);
		fputs("EOD\n", out);
	}
}

static void set_axis(FILE *out, char which, const struct plot_axis *axis)
{
	fprintf(out,
	        "set %crange [%.6g:%.6g]\nset %clabel \"%s\" offset %d\n%s logscale %c\nset format %c "
	        "\"%s\"\n",
	        which, axis->from, axis->to, which, axis->label, which == 'y', axis->log ? "set" : "unset",
	        which, which, axis->format ? axis->format : "%g");
}

static void set_labels(FILE *out, const struct plot_panel *p)
{
	for (size_t i = 0; i < PLOT_LABELS && p->label[i].text; i++) {
		const struct plot_label *l = &p->label[i];

		if (l->dot)
			fprintf(out,
			        "set label \"%s\" at %.6g,%.6g %s front boxed font ',12' "
			        "point pt 7 ps "
			        "0.8 lc rgb '#000000'\n",
			        l->text, l->x, l->y, l->before ? "right offset -0.9,0" : "left offset 0.9,0");
		else
			fprintf(out, "set label \"%s\" at %.6g,%.6g center front boxed font ',12'\n", l->text,
			        l->x, l->y);
	}
}

static void plot_map(FILE *out, size_t number)
{
	for (int layer = 0; layer <= PLOT_SHADES; layer++)
		fprintf(out,
		        "$cells%zu_%d using ($1):($3):1:2:3:4 with boxxyerror fs solid noborder lc rgb '%s' "
		        "notitle, "
		        "\\\n",
		        number, layer, layer < PLOT_SHADES ? shades[layer] : NO_VALUE);
	fprintf(out,
	        "$cells%zu_%d using ($1):($3):1:2:3:4 with boxxyerror fs transparent pattern 4 noborder lc "
	        "rgb '" FAIL "' notitle, \\\n$edge%zu using 1:2 with lines lw 2.5 lc rgb '" FAIL
	        "' notitle, \\\n",
	        number, LAYER_FAILS, number);
}

static void plot_panel(FILE *out, const struct plot_panel *p, size_t number)
{
	fputs("plot ", out);
	if (p->cell)
		plot_map(out, number);
	fprintf(out,
	        "$regions%zu using ($1):($3):1:2:3:4 with boxxyerror fs transparent pattern 4 border lc rgb "
	        "'" FAIL "' lc rgb '" FAIL "' lw 2 notitle",
	        number);
	for (size_t s = 0; s < PLOT_SERIES && p->series[s].name; s++) {
		const struct plot_series *series = &p->series[s];
		size_t k = (size_t)series->colour % STYLES;

		fprintf(out, ", \\\n$series%zu_%zu using 1:2 with %s lc rgb '%s' lw 2", number, s,
		        series->count == 1 ? "points"
		        : series->marks    ? "linespoints"
		                           : "lines",
		        styles[k].colour);
		if (series->marks)
			fprintf(out, " pt %d ps %s", styles[k].mark, series->count == 1 ? "1.3" : "0.8");
		fprintf(out, " title \"%s\"", series->name);
	}
	fputs("\n", out);
}

/* top: of the first panel, from the picture's upper edge. */
static void plot_draw_panel(FILE *out, const struct plot *plot, size_t number, double top, double height)
{
	const struct plot_panel *p = &plot->panel[number];
	double each = (WIDTH - LEFT - RIGHT - GAP * (COLUMNS - 1.0)) / COLUMNS;
	double left = LEFT + (double)(number % COLUMNS) * (each + GAP);

	top += (double)(number / COLUMNS) * (TITLE + PLOT + BOTTOM);
	write_data(out, plot, p, number);
	fprintf(out,
	        "unset label\nset lmargin at screen %.4f\nset rmargin at screen %.4f\nset tmargin at screen "
	        "%.4f\n"
	        "set bmargin at screen %.4f\nset title \"%s\" font ',14' offset 0,-0.4\n",
	        left / WIDTH, (left + each) / WIDTH, 1 - top / height, (height - top - PLOT) / height,
	        p->title);
	set_axis(out, 'x', &p->x);
	set_axis(out, 'y', &p->y);
	if (p->key)
		fprintf(out, "set key %s Left reverse opaque box lc rgb '#888888' font ',12' samplen 2.5\n",
		        p->key);
	else
		fputs("unset key\n", out);
	set_labels(out, p);
	plot_panel(out, p, number);
}

/* ---- the picture ------------------------------------------------------------------------------------------
 */

static void plot_draw_shade(FILE *out, const char *style, const char *text, double x, double y, double height)
{
	fprintf(out,
	        "set object rectangle from screen %.4f,%.4f to screen %.4f,%.4f fc rgb %s\n"
	        "set label \"%s\" at screen %.4f,%.4f font ',12'\n",
	        x, y - 8 / height, x + 0.024, y + 8 / height, style, text, x + 0.029, y);
}

static void plot_draw_legend(FILE *out, const struct plot *plot, double height)
{
	double y = 20 / height, x = 0.01;
	char style[64];

	fprintf(out, "set label \"%s:\" at screen %.4f,%.4f font ',12'\n", plot->value, x, y);
	x += 0.0082 * (double)strlen(plot->value) + 0.012;
	for (int i = 0; i < PLOT_SHADES; i++, x += 0.1) {
		snprintf(style, sizeof(style), "'%s' fs solid border lc rgb '#888888'", shades[i]);
		plot_draw_shade(out, style, plot->shade_text[i], x, y, height);
	}
	plot_draw_shade(out, "'" NO_VALUE "' fs solid border lc rgb '#888888'", "no value", x, y, height);
	plot_draw_shade(out, "'" FAIL "' fs transparent pattern 4 border lc rgb '" FAIL "' lw 2", "fails",
	                x + 0.115, y, height);
}

/* Letters of a note's first line. */
static size_t plot_fit(const char *note)
{
	size_t most = strlen(note);

	if (most > NOTE_MOST)
		for (most = NOTE_MOST; most > 1 && note[most] != ' '; most--)
			;
	return most;
}

static const char *plot_next_line(const char *note)
{
	note += plot_fit(note);
	return note + strspn(note, " ");
}

static double plot_height_of(const char *note)
{
	double height = 0;

	for (; *note; note = plot_next_line(note))
		height += LINE;
	return height;
}

/* From y down, px from the upper edge. */
static void plot_draw_note(FILE *out, const char *note, const char *colour, double y, double height)
{
	for (; *note; note = plot_next_line(note), y += LINE)
		fprintf(out, "set label \"%.*s\" at screen 0.01,%.4f font ',12' tc rgb '%s'\n",
		        (int)plot_fit(note), note, 1 - y / height, colour);
}

static void plot_draw_heads(FILE *out, const struct plot *plot, double height)
{
	double y = 48;

	fprintf(out, "set label \"%s\" at screen 0.01,%.4f font ',17'\n", plot->title, 1 - 22 / height);
	plot_draw_note(out, plot->note[0], "#000000", y, height);
	plot_draw_note(out, plot->note[1], "#08519c", y + plot_height_of(plot->note[0]), height);
	if (plot->value)
		plot_draw_legend(out, plot, height);
}

int plot_write(const struct plot *plot, const char *folder, const char *kind, char *message)
{
	double rows = (double)((plot->panels + COLUMNS - 1) / COLUMNS);
	double top = HEAD - LINE + plot_height_of(plot->note[0]) + plot_height_of(plot->note[1]);
	double height = top + rows * (TITLE + PLOT + BOTTOM) - TITLE + (plot->value ? LEGEND : 0);
	struct text script;
	int status = write_table(plot, folder, kind, message);

	if (!status)
		status = file_begin(&script, message);
	if (status)
		return status;
	fprintf(script.out,
	        "set terminal svg size %d,%.0f dynamic noenhanced font 'sans-serif,13' background '#ffffff'\n"
	        "set multiplot\nset style textbox opaque noborder margins 2,1\nset tics front\n",
	        WIDTH, height);
	/* an empty plot that carries what belongs to no panel */
	fputs("set lmargin at screen 0\nset rmargin at screen 1\nset tmargin at screen 1\nset bmargin at "
	      "screen 0\n"
	      "unset border\nunset tics\nunset key\nset xrange [0:1]\nset yrange [0:1]\n",
	      script.out);
	plot_draw_heads(script.out, plot, height);
	fputs("plot NaN notitle\nunset object\nset border\nset tics front\nset grid back lc rgb '#dddddd' lw "
	      "1\n",
	      script.out);
	for (size_t i = 0; i < plot->panels; i++)
		plot_draw_panel(script.out, plot, i, top, height);
	fputs("unset multiplot\n", script.out);
	status = file_draw(&script, folder, kind, plot->name, message);
	file_drop(&script);
	return status;
}
