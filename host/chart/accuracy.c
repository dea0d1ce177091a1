/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "host/chart/compare.h"
#include "host/chart/chart.h"
#include "host/chart/file.h"

/* Over the sensor's own. */
static const double noises[] = {0.3, 1, 3, 10};

enum { NOISES = sizeof(noises) / sizeof(noises[0]), WIDTH = 1000, HEIGHT = 470 };

/* Colours that the colour-blind tell apart, and marks: open for others' methods, filled for ours. */
static const struct {
	const char *colour;
	int open, filled;
} marks[] = {{"#56b4e9", 4, 5},   {"#e69f00", 8, 9}, {"#009e73", 10, 11},
             {"#cc79a7", 12, 13}, {"#0072b2", 6, 7}, {"#d55e00", 14, 15}};
enum { MARKS = sizeof(marks) / sizeof(marks[0]) };

struct panel {
	const struct chart_options *options;
	const struct compare *compare;
	enum quantity quantity;
	const struct method *method; /* [methods], all quantities' */
	size_t methods;
	double low, high;         /* of the error, shown */
	double cheapest, dearest; /* us */
};

static int accuracy_write_csv(const struct chart_options *options, const struct panel *p, char *message)
{
	struct text text;
	int status = file_begin(&text, message);

	if (status)
		return status;
	fputs("quantity_si,seed,about,method,of,family_told,noise_g,drops,values,gross,bias,rmse,bound,ratio,"
	      "cost_us\n",
	      text.out);
	for (size_t m = 0; m < p->methods; m++)
		for (size_t i = 0; i < NOISES && p->method[m].quantity == p->quantity; i++) {
			const struct tally *t = &p->compare->cells[i].tally[m];

			fprintf(text.out,
			        "\"%s\",%lu,\"%s\",\"%s\",%s,%d,%g,%u,%u,%u,%.9g,%.9g,%.9g,%.6g,%.4g\n",
			        quantity_text(p->quantity)->title, options->seed, options->about,
			        p->method[m].name, p->method[m].ours ? "droptower" : "others",
			        p->method[m].told, p->compare->cells[i].scene.noise_g, p->compare->drops,
			        t->values, compare_gross(p->compare, t), tally_bias(t), tally_rms(t),
			        t->bound, tally_ratio(t), p->compare->cells[i].cost_us[m]);
		}
	status = file_write(&text, options->folder, "accuracy", quantity_text(p->quantity)->name, "csv",
	                    message);
	file_drop(&text);
	return status;
}

/* ---- the picture: a panel for each noise, the legend to their right -------------------------------------
 */

static void find_ranges(struct panel *p)
{
	double shown = quantity_text(p->quantity)->shown;

	p->low = p->cheapest = INFINITY;
	p->high = p->dearest = 0;
	for (size_t m = 0; m < p->methods; m++)
		for (size_t i = 0; i < NOISES && p->method[m].quantity == p->quantity; i++) {
			const struct tally *t = &p->compare->cells[i].tally[m];

			p->low = fmin(p->low, t->bound * shown);
			p->cheapest = fmin(p->cheapest, p->compare->cells[i].cost_us[m]);
			p->dearest = fmax(p->dearest, p->compare->cells[i].cost_us[m]);
			if (t->values == 0)
				continue;
			p->low = fmin(p->low, tally_rms(t) * shown);
			p->high = fmax(p->high, tally_rms(t) * shown);
		}
}

static void draw_bounds(FILE *out, const struct panel *p, size_t i)
{
	double shown = quantity_text(p->quantity)->shown, last = NAN;

	for (size_t m = 0; m < p->methods; m++) {
		double bound = p->compare->cells[i].tally[m].bound * shown;

		if (p->method[m].quantity != p->quantity || fabs(bound - last) < 1e-12 * bound)
			continue;
		fprintf(out,
		        "set arrow from graph 0, first %.6g to graph 1, first %.6g nohead lw 2 lc rgb "
		        "'#000000'\n",
		        bound, bound);
		last = bound;
	}
}

static void accuracy_draw_panel(FILE *out, const struct panel *p, size_t i)
{
	size_t kind = 0, drawn = 0;
	double left = 0.072 + 0.178 * (double)i;

	fprintf(out, "unset arrow\nunset label\nset lmargin at screen %.4f\nset rmargin at screen %.4f\n",
	        left, left + 0.168);
	fprintf(out, "set title 'noise %g g' font ',14' offset 0,-0.5\n", p->compare->cells[i].scene.noise_g);
	if (i > 0)
		fputs("set format y ''\nunset ylabel\n", out);
	draw_bounds(out, p, i);
	for (size_t m = 0; m < p->methods; m++) {
		const struct tally *t = &p->compare->cells[i].tally[m];
		size_t k = kind % MARKS;

		if (p->method[m].quantity != p->quantity)
			continue;
		kind++;
		if (t->values == 0)
			continue;
		fprintf(out,
		        "%s '+' using (%.5g):(%.6g) every ::0::0 with points pt %d ps %s lw 2 lc rgb '%s' "
		        "notitle",
		        drawn++ ? ", \\\n" : "plot", p->compare->cells[i].cost_us[m],
		        tally_rms(t) * quantity_text(p->quantity)->shown,
		        p->method[m].ours ? marks[k].filled : marks[k].open,
		        p->method[m].ours ? "1.5" : "1.1", marks[k].colour);
	}
	fputs("\n", out);
}

static bool is_told(const struct panel *p)
{
	bool told = false;

	for (size_t m = 0; m < p->methods; m++)
		told |= p->method[m].quantity == p->quantity && p->method[m].told;
	return told;
}

/* Whether there is a bound of both axes besides that of one. */
static bool has_pair(const struct panel *p)
{
	bool pair = false;

	for (size_t m = 0; m < p->methods; m++)
		pair |= p->method[m].quantity == p->quantity &&
		        (p->method[m].bound == offsetof(struct bound, pair_hz) ||
		         p->method[m].bound == offsetof(struct bound, pair_damping));
	return pair;
}

/* Drawn with the last panel. */
static void accuracy_draw_legend(FILE *out, const struct panel *p)
{
	size_t kind = 0;
	double y = 0.77;

	fputs("reset\nset lmargin at screen 0.785\nset rmargin at screen 0.99\nunset border\nunset tics\n"
	      "set xrange [0:1]\nset yrange [0:1]\nset tmargin at screen 0.80\nset bmargin at screen 0.13\n",
	      out);
	fprintf(out, "set label \"%s: error against cost\" at screen 0.012,0.955 font ',17'\n",
	        quantity_text(p->quantity)->title);
	fprintf(out,
	        "set label \"Root mean square error over %u drops of known truth: %s.\" at screen "
	        "0.012,0.91 font ',12'\n"
	        "set label \"Down and left is better; no unbiased method lies below the line.\" at screen "
	        "0.012,0.87 font ',12'\n",
	        p->compare->drops, p->options->about);
	for (int ours = 1; ours >= 0; ours--) {
		kind = 0;
		fprintf(out, "set label '%s' at screen 0.790,%.3f font ',14'\n",
		        ours ? "droptower" : "other methods", y);
		for (size_t m = 0; m < p->methods; m++) {
			size_t k = kind % MARKS;

			if (p->method[m].quantity != p->quantity)
				continue;
			kind++;
			if (p->method[m].ours != (ours == 1))
				continue;
			y -= 0.05;
			fprintf(out,
			        "set label \"%s%s\" at screen 0.808,%.3f font ',12' point pt %d ps %s lw 2 "
			        "lc "
			        "rgb '%s' "
			        "offset 0.8,0\n",
			        p->method[m].name, p->method[m].told ? " *" : "", y,
			        ours ? marks[k].filled : marks[k].open, ours ? "1.5" : "1.1",
			        marks[k].colour);
		}
		y -= 0.08;
	}
	fprintf(out, "set arrow from screen 0.795,%.3f to screen 0.822,%.3f nohead lw 2 lc rgb '#000000'\n",
	        y, y);
	fprintf(out, "set label 'Cramer-Rao bound' at screen 0.832,%.3f font ',12'\n", y);
	if (has_pair(p))
		fprintf(out, "set label '(lower: of X and Y)' at screen 0.832,%.3f font ',12'\n", y -= 0.04);
	if (is_told(p))
		fprintf(out,
		        "set label '* is told that it' at screen 0.790,%.3f font ',12'\n"
		        "set label 'is a half-sine' at screen 0.790,%.3f font ',12'\n",
		        y - 0.06, y - 0.10);
	fputs("plot 2 notitle\n", out);
}

static int accuracy_draw(const struct chart_options *options, struct panel *p, char *message)
{
	const struct quantity_text *text = quantity_text(p->quantity);
	struct text script;
	int status = file_begin(&script, message);
	FILE *out = script.out;

	if (status)
		return status;
	find_ranges(p);
	fprintf(out,
	        "set terminal svg size %d,%d dynamic noenhanced font 'sans-serif,13' background '#ffffff'\n"
	        "set multiplot\nset samples 2\nset logscale xy\nset tmargin at screen 0.80\n"
	        "set bmargin at screen 0.13\nset grid back lc rgb '#dddddd' lw 1\n",
	        WIDTH, HEIGHT);
	fprintf(out, "set xrange [%.4g:%.4g]\nset yrange [%.4g:%.4g]\n", p->cheapest / 2, p->dearest * 2,
	        p->low / 1.5, p->high * 1.5);
	fprintf(out, "set xlabel 'us per call'\nset ylabel 'error, %s' offset 1,0\n", text->unit);
	fputs("set xtics (0.01,0.1,1,10,100,1000,10000)\n", out);
	for (size_t i = 0; i < NOISES; i++)
		accuracy_draw_panel(out, p, i);
	accuracy_draw_legend(out, p);
	fputs("unset multiplot\n", out);
	status = file_draw(&script, options->folder, "accuracy", text->name, message);
	file_drop(&script);
	return status;
}

/* ---- the table
 * ---------------------------------------------------------------------------------------------- */

static void accuracy_print_table(FILE *out, const struct panel *p)
{
	const struct quantity_text *text = quantity_text(p->quantity);

	fprintf(out, "\n%-46s", text->title);
	for (size_t i = 0; i < NOISES; i++)
		fprintf(out, " %6g g", p->compare->cells[i].scene.noise_g);
	fprintf(out, "  us a call\n");
	for (size_t m = 0; m < p->methods; m++) {
		if (p->method[m].quantity != p->quantity)
			continue;
		fprintf(out, "  %-10s %-24s %-8s", p->method[m].ours ? "droptower" : "others",
		        p->method[m].name, p->method[m].told ? "told" : "");
		for (size_t i = 0; i < NOISES; i++)
			fprintf(out, " %8.2f", tally_ratio(&p->compare->cells[i].tally[m]));
		fprintf(out, " %10.2f\n", p->compare->cells[1].cost_us[m]);
	}
}

int chart_accuracy(const struct chart_options *options, FILE *out, char *message)
{
	struct compare compare = {.drops = options->drops, .timed = true, .count = NOISES};
	struct panel panel = {.options = options, .compare = &compare};
	int status;

	panel.method = method_table(&panel.methods);
	compare.cells = compare_cells(NOISES);
	if (!compare.cells) {
		snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	for (size_t i = 0; i < NOISES; i++) {
		compare.cells[i].scene = options->drop;
		compare.cells[i].scene.seed = 7919 * options->seed;
		compare.cells[i].scene.noise_g *= noises[i];
	}
	status = compare_run(&compare);
	if (status)
		snprintf(message, CHART_MESSAGE_MAX, "the simulated drops failed: %s", error_text(status));
	else
		fprintf(out,
		        "Error over the Cramer-Rao bound; %u drops of known truth a figure, seed %lu; %s\n",
		        options->drops, options->seed, options->about);
	for (int q = 0; q < QUANTITIES && !status; q++) {
		panel.quantity = (enum quantity)q;
		if (options->no_plate && quantity_text(panel.quantity)->of_plate)
			continue;
		accuracy_print_table(out, &panel);
		status = accuracy_write_csv(options, &panel, message);
		if (!status)
			status = accuracy_draw(options, &panel, message);
	}
	compare_free(compare.cells, NOISES);
	return status;
}
