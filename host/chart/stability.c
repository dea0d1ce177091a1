/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/chart/compare.h"
#include "host/chart/chart.h"
#include "host/chart/file.h"

/* A failing method: so far above the bound (struct quantity_text), or gross errors in more than this. */
#define GROSS_MOST 0.01

/* px; shown 838 px wide, as a README is, the smallest text (12) still has 10 px. */
enum { VALUES_MAX = 7, ROW = 32, COLUMN = 17, LEFT = 230, TOP = 150, BOTTOM = 185, RIGHT = 35 };

#define PLAY_S 1e-3 /* of a drop's onset */

enum { PEAK_LOST_MOST = 8 }; /* more, and nothing is left of the pulse */

/* What grows from left to right. */
struct sweep {
	const char *name, *unit;
	void (*apply)(struct synthetic_scene *scene, double value);
	double value[VALUES_MAX];
	size_t count;
};

static void noise(struct synthetic_scene *scene, double value)
{
	scene->noise_g *= value; /* over the sensor's own */
}

static void stability_damping(struct synthetic_scene *scene, double value)
{
	scene->damping = value / 100;
}

static void length(struct synthetic_scene *scene, double value)
{
	scene->post_s = scene->contact_s + value / scene->damped_hz + PLAY_S;
}

static void set_rate(struct synthetic_scene *scene, double value)
{
	scene->rate_hz[0] = value * 1e3;
	scene->rate_hz[1] = value * 1e3 * 10 / 7;
}

static void family(struct synthetic_scene *scene, double value)
{
	scene->family = (enum synthetic_family)value;
}

static void clipping(struct synthetic_scene *scene, double value)
{
	scene->clip_g = scene->peak_g[0] * (1 - value / 100);
}

static void stability_missing(struct synthetic_scene *scene, double value)
{
	scene->missing = value / 100;
}

static void lost(struct synthetic_scene *scene, double value)
{
	scene->gap = (unsigned)value;
	scene->lost_at_peak = value < PEAK_LOST_MOST ? (unsigned)value : PEAK_LOST_MOST;
}

static void offset(struct synthetic_scene *scene, double value)
{
	scene->shift_g = value;
}

static void hum(struct synthetic_scene *scene, double value)
{
	scene->hum_g = value;
}

static void spikes(struct synthetic_scene *scene, double value)
{
	scene->spikes = (unsigned)value;
}

static void second(struct synthetic_scene *scene, double value)
{
	scene->second_part = value / 100;
	scene->second_apart_hz = 20;
}

static void jitter(struct synthetic_scene *scene, double value)
{
	scene->jitter_s = value * 1e-6;
}

static void skew(struct synthetic_scene *scene, double value)
{
	scene->skew_s = value * 1e-3;
}

static const struct sweep sweeps[] = {
        {"noise", "g", noise, {0.1, 0.3, 1, 3, 10, 30, 100}, 7},
        {"pulse", "", family, {0, 1, 2, 3}, 4},
        {"Y after X", "ms", skew, {0.1, 0.2, 0.5, 1}, 4},
        {"rate", "kHz", set_rate, {28, 14, 7, 3.5, 2}, 5},
        {"clipped", "% of peak", clipping, {1, 3, 10, 20, 30, 50}, 6},
        {"missing", "%", stability_missing, {1, 5, 10, 20, 40}, 5},
        {"run lost", "samples", lost, {1, 2, 4, 8, 20}, 5},
        {"jitter", "us", jitter, {1, 2, 5, 10, 20, 50}, 6},
        {"damping", "%", stability_damping, {1, 3, 10, 20, 30, 50}, 6},
        {"record", "cycles", length, {5, 3, 2, 1.5, 1, 0.5}, 6},
        {"offset left", "g", offset, {0.3, 1, 3, 10, 30}, 5},
        {"50 Hz hum", "g", hum, {0.3, 1, 3, 5, 10}, 5},
        {"300 g spikes", "", spikes, {1, 2, 3, 5, 10}, 5},
        {"2nd mode", "%, +20 Hz", second, {2, 5, 10, 20, 30, 50}, 6},
};

enum { SWEEPS = sizeof(sweeps) / sizeof(sweeps[0]), CELLS_MAX = SWEEPS * VALUES_MAX };

/* The cell that changes nothing: noise of 1 g. */
enum { CLEAN = 2 };

struct map {
	const struct compare *compare;
	enum quantity quantity;
	const struct method *method;
	size_t methods;
};

static const char *value_text(const struct sweep *sweep, size_t i, char text[32])
{
	if (sweep->apply == family)
		return synthetic_family_name((enum synthetic_family)sweep->value[i]);
	snprintf(text, 32, "%g", sweep->value[i]);
	return text;
}

static bool is_failing(const struct map *map, const struct tally *t)
{
	return !(tally_ratio(t) <= quantity_text(map->quantity)->fails) ||
	       compare_gross(map->compare, t) > GROSS_MOST * map->compare->drops;
}

static int stability_write_csv(const struct chart_options *options, const struct map *map, char *message)
{
	struct text text;
	int status = file_begin(&text, message);

	if (status)
		return status;
	fputs("quantity_si,seed,fails_above_ratio,fails_above_gross_percent,method,of,family_told,sweep,"
	      "value,"
	      "unit,drops,values,gross,doubted,bias,rmse,bound,ratio,"
	      "fails\n",
	      text.out);
	for (size_t m = 0; m < map->methods; m++) {
		const struct compare_cell *cell = map->compare->cells;

		for (size_t s = 0; s < SWEEPS && map->method[m].quantity == map->quantity; s++)
			for (size_t i = 0; i < sweeps[s].count; i++, cell++) {
				const struct tally *t = &cell->tally[m];
				char value[32];

				fprintf(text.out,
				        "\"%s\",%lu,%g,%g,\"%s\",%s,%d,%s,%s,\"%s\",%u,%u,%u,%u,%.9g,%.9g,%."
				        "9g,"
				        "%.6g,%d\n",
				        quantity_text(map->quantity)->title, options->seed,
				        quantity_text(map->quantity)->fails, 100 * GROSS_MOST,
				        map->method[m].name, map->method[m].ours ? "droptower" : "others",
				        map->method[m].told, sweeps[s].name, value_text(&sweeps[s], i, value),
				        sweeps[s].unit, map->compare->drops, t->values,
				        compare_gross(map->compare, t), t->doubted, tally_bias(t),
				        tally_rms(t), t->bound, tally_ratio(t), is_failing(map, t));
			}
	}
	status = file_write(&text, options->folder, "stability", quantity_text(map->quantity)->name, "csv",
	                    message);
	file_drop(&text);
	return status;
}

/* ---- the map: a row for each method, a column for each value; one unit of x is one column
 * ------------------ */

/* From the bound, pale, to a hundred times it, dark; the colour-blind tell by lightness. */
static const struct {
	double ratio;
	const char *colour;
} shades[] = {{1.15, "#f7fbff"}, {1.6, "#deebf7"}, {3, "#b5d1e8"},
              {10, "#6baed6"},   {30, "#3182bd"},  {INFINITY, "#08519c"}};
enum { SHADES = sizeof(shades) / sizeof(shades[0]) };

#define NO_VALUE "#c8c8c8"
#define CROSS "#d55e00"

/* Index of the cell's shade; SHADES: no value at all. */
static int stability_shade_of(const struct tally *t)
{
	double ratio = tally_ratio(t);
	int i = 0;

	while (i < SHADES && !(ratio <= shades[i].ratio))
		i++;
	return i;
}

/* The map has two bands, one below the other; one row of each method in both. */
enum { BANDS = 2, BAND = SWEEPS / BANDS };
#define BETWEEN 5.6 /* rows: the values of a band, the names of the next */

/* x of a sweep's first column in its band: half a column between sweeps. s may be the band's end. */
static double column(size_t band, size_t s)
{
	double x = 0;

	for (size_t i = band * BAND; i < s; i++)
		x += (double)sweeps[i].count + 0.6;
	return x;
}

static size_t stability_band_end(size_t band)
{
	return band + 1 < BANDS ? (band + 1) * BAND : SWEEPS;
}

static size_t stability_band_of(size_t s)
{
	return s / BAND < BANDS ? s / BAND : BANDS - 1;
}

static double stability_columns(void)
{
	double most = 0;

	for (size_t band = 0; band < BANDS; band++)
		most = fmax(most, column(band, stability_band_end(band)));
	return most;
}

/* What a data block holds of each cell. */
enum layer { LAYER_FAILS = SHADES + 1, LAYER_SAYS_SO, LAYERS };

static bool stability_in_layer(const struct map *map, const struct tally *t, int layer)
{
	if (layer == LAYER_FAILS)
		return is_failing(map, t);
	if (layer == LAYER_SAYS_SO)
		return is_failing(map, t) && 2 * t->doubted >= map->compare->drops;
	return stability_shade_of(t) == layer;
}

/* row: in the first band; drop: how far below the next one is. */
static void write_cells(FILE *out, const struct map *map, size_t m, double row, double drop, int layer)
{
	const struct compare_cell *cell = map->compare->cells;

	for (size_t s = 0; s < SWEEPS; s++)
		for (size_t i = 0; i < sweeps[s].count; i++, cell++)
			if (stability_in_layer(map, &cell->tally[m], layer))
				fprintf(out, "%.1f %.1f\n", column(stability_band_of(s), s) + (double)i,
				        row - drop * (double)stability_band_of(s));
}

/* Ours above the others', in the table's order. */
static double stability_row_of(const struct map *map, size_t m)
{
	double row = 0;

	for (size_t i = 0; i < map->methods; i++) {
		if (map->method[i].quantity != map->quantity)
			continue;
		if (map->method[m].ours ? !map->method[i].ours || i > m : !map->method[i].ours && i > m)
			row += 1;
	}
	return row + (map->method[m].ours ? 0.2 : 0);
}

static double stability_rows(const struct map *map)
{
	double rows = 0;

	for (size_t m = 0; m < map->methods; m++)
		if (map->method[m].quantity == map->quantity)
			rows = fmax(rows, stability_row_of(map, m) + 1);
	return rows;
}

/* What a sweep's columns are called, above and below them. */
static void stability_draw_heads(FILE *out, double rows, double drop)
{
	for (size_t s = 0; s < SWEEPS; s++) {
		size_t band = stability_band_of(s);
		double x = column(band, s), y = -drop * (double)band;

		fprintf(out, "set label \"%s\" at %.2f,%g font ',13' left rotate by 35\n", sweeps[s].name,
		        x + 0.3 * (double)sweeps[s].count, y + rows + 0.15);
		fprintf(out, "set label '%s' at %.2f,%g font ',12' center\n", sweeps[s].unit,
		        x + (double)sweeps[s].count / 2, y - 2.55);
		for (size_t i = 0; i < sweeps[s].count; i++) {
			char text[32];
			const char *value = value_text(&sweeps[s], i, text);

			fprintf(out, "set label '%.9s' at %.2f,%g font ',12' right rotate by 90\n", value,
			        x + (double)i + 0.5, y - 0.12);
		}
	}
}

/* Below the map, in units of its own: shades, the cross, the dot. */
static void stability_draw_legend(FILE *out, const struct map *map, double height)
{
	double y = 50 / height, x = 0.12;
	char text[32];

	fprintf(out, "set label 'error / bound' at screen 0.01,%.4f font ',12'\n", y);
	for (int i = 0; i <= SHADES; i++, x += 0.085) {
		snprintf(text, sizeof(text),
		         i + 1 < SHADES ? "to %g"
		         : i < SHADES   ? "more"
		                        : "no value",
		         i + 1 < SHADES ? shades[i].ratio : 0.0);
		fprintf(out,
		        "set object rectangle from screen %.3f,%.4f to screen %.3f,%.4f fc rgb '%s' fs solid "
		        "border lc rgb '#888888' lw 1\nset label '%s' at screen %.3f,%.4f font ',12'\n",
		        x, y - 8 / height, x + 0.02, y + 8 / height, i < SHADES ? shades[i].colour : NO_VALUE,
		        text, x + 0.025, y);
	}
	y = 22 / height;
	for (int up = -1; up <= 1; up += 2)
		fprintf(out,
		        "set arrow from screen 0.122,%.4f to screen 0.138,%.4f nohead lw 1.6 lc rgb '" CROSS
		        "'\n",
		        y - up * 7 / height, y + up * 7 / height);
	fprintf(out,
	        "set label 'fails: above %g, or gross errors in over 1 %%' at screen 0.145,%.4f font ',12'\n"
	        "set label 'it says so itself' at screen 0.56,%.4f font ',12' point pt 7 ps 0.75 lc rgb "
	        "'#000000' offset 0.6,0\n",
	        quantity_text(map->quantity)->fails, y, y);
}

static void draw_names(FILE *out, const struct map *map, double drop)
{
	for (size_t m = 0; m < map->methods; m++)
		for (int band = 0; band < BANDS && map->method[m].quantity == map->quantity; band++)
			fprintf(out, "set label \"%s%s%s\" at -0.6,%g right\n",
			        map->method[m].ours ? "droptower: " : "", map->method[m].name,
			        map->method[m].told ? " *" : "",
			        stability_row_of(map, m) + 0.5 - drop * band);
}

/* A data block for each layer, with one point out of sight so that none is empty. */
static void draw_cells(FILE *out, const struct map *map, double drop)
{
	for (int layer = 0; layer < LAYERS; layer++) {
		fprintf(out, "$layer%d << EOD\n-99 -99\n", layer);
		for (size_t m = 0; m < map->methods; m++)
			if (map->method[m].quantity == map->quantity)
				write_cells(out, map, m, stability_row_of(map, m), drop, layer);
		fputs("EOD\n", out);
	}
	fputs("plot ", out);
	for (int i = 0; i <= SHADES; i++)
		fprintf(out,
		        "$layer%d using ($1+0.5):($2+0.5):($1+0.03):($1+0.97):($2+0.04):($2+0.96) with "
		        "boxxyerror "
		        "fs solid noborder lc rgb '%s' notitle, \\\n",
		        i, i < SHADES ? shades[i].colour : NO_VALUE);
	fprintf(out,
	        "$layer%d using ($1+0.12):($2+0.12):(0.76):(0.76) with vectors nohead lw 1.6 lc rgb '" CROSS
	        "' notitle, \\\n"
	        "$layer%d using ($1+0.12):($2+0.88):(0.76):(-0.76) with vectors nohead lw 1.6 lc rgb '" CROSS
	        "' notitle, \\\n"
	        "$layer%d using ($1+0.5):($2+0.5) with points pt 7 ps 0.75 lc rgb '#000000' notitle\n",
	        LAYER_FAILS, LAYER_FAILS, LAYER_SAYS_SO);
}

static int stability_draw(const struct chart_options *options, const struct map *map, char *message)
{
	const struct quantity_text *text = quantity_text(map->quantity);
	double columns = stability_columns(), rows = stability_rows(map), drop = rows + BETWEEN;
	double deep = drop * (BANDS - 1), width, height;
	struct text script;
	int status = file_begin(&script, message);
	FILE *out = script.out;

	if (status)
		return status;
	width = LEFT + RIGHT + columns * COLUMN;
	height = TOP + BOTTOM + (rows + deep) * ROW;
	fprintf(out,
	        "set terminal svg size %.0f,%.0f dynamic noenhanced font 'sans-serif,13' background "
	        "'#ffffff'\n"
	        "unset border\nunset tics\nunset key\nset lmargin at screen %.4f\nset rmargin at screen "
	        "%.4f\n"
	        "set tmargin at screen %.4f\nset bmargin at screen %.4f\nset xrange [0:%g]\nset yrange "
	        "[%g:%g]\n",
	        width, height, LEFT / width, 1 - RIGHT / width, 1 - TOP / height, BOTTOM / height, columns,
	        -deep, rows);
	fprintf(out, "set label \"%s: where methods fail\" at screen 0.01,%.4f font ',17'\n", text->title,
	        1 - 24 / height);
	fprintf(out,
	        "set label \"One trouble at a time on a drop of %s, noise %g g.\" at screen 0.01,%.4f font "
	        "',12'\nset label \"%u drops a cell. * is told that it is a half-sine.\" at screen "
	        "0.01,%.4f font ',12'\n",
	        options->about, options->drop.noise_g, 1 - 48 / height, map->compare->drops, 1 - 68 / height);
	draw_names(out, map, drop);
	stability_draw_heads(out, rows, drop);
	stability_draw_legend(out, map, height);
	draw_cells(out, map, drop);
	status = file_draw(&script, options->folder, "stability", text->name, message);
	file_drop(&script);
	return status;
}

/* Of each method, what it does not survive: the first value of each sweep from which on it fails. */
static void stability_print_table(FILE *out, const struct map *map)
{
	fprintf(out, "\n%s\n", quantity_text(map->quantity)->title);
	for (size_t m = 0; m < map->methods; m++) {
		const struct compare_cell *cell = map->compare->cells;
		unsigned failing = 0;

		if (map->method[m].quantity != map->quantity)
			continue;
		fprintf(out, "  %-10s %-24s %-5s", map->method[m].ours ? "droptower" : "others",
		        map->method[m].name, map->method[m].told ? "told" : "");
		if (is_failing(map, &cell[CLEAN].tally[m])) {
			fputs("a drop with nothing wrong\n", out);
			continue;
		}
		for (size_t s = 0; s < SWEEPS; s++) {
			bool said = false;

			for (size_t i = 0; i < sweeps[s].count; i++, cell++) {
				char value[32];

				if (said || !is_failing(map, &cell->tally[m]))
					continue;
				said = true;
				fprintf(out, "%s%s %s%s%s", failing++ ? ", " : "", sweeps[s].name,
				        value_text(&sweeps[s], i, value), sweeps[s].unit[0] ? " " : "",
				        sweeps[s].unit);
			}
		}
		fprintf(out, "%s\n", failing ? "" : "nothing");
	}
}

static size_t make_scenes(const struct chart_options *options, struct compare_cell *cells)
{
	size_t n = 0;

	for (size_t s = 0; s < SWEEPS; s++)
		for (size_t i = 0; i < sweeps[s].count; i++) {
			cells[n].scene = options->drop;
			cells[n].scene.seed = 7919 * options->seed;
			sweeps[s].apply(&cells[n++].scene, sweeps[s].value[i]);
		}
	return n;
}

int chart_stability(const struct chart_options *options, FILE *out, char *message)
{
	struct compare compare = {.drops = options->drops};
	struct map map = {.compare = &compare};
	int status;

	map.method = method_table(&map.methods);
	compare.cells = compare_cells(CELLS_MAX);
	if (!compare.cells) {
		snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	compare.count = make_scenes(options, compare.cells);
	status = compare_run(&compare);
	if (status)
		snprintf(message, CHART_MESSAGE_MAX, "the simulated drops failed: %s", error_text(status));
	else
		fprintf(out,
		        "What each method fails at first; %u drops of known truth a cell, seed %lu; %s\n",
		        options->drops, options->seed, options->about);
	for (int q = 0; q < QUANTITIES && !status; q++) {
		map.quantity = (enum quantity)q;
		if (options->no_plate && quantity_text(map.quantity)->of_plate)
			continue;
		stability_print_table(out, &map);
		status = stability_write_csv(options, &map, message);
		if (!status)
			status = stability_draw(options, &map, message);
	}
	compare_free(compare.cells, CELLS_MAX);
	return status;
}
