/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/text.h"
#include "hil/study/tables.h"
#include "host/record/read.h"
#include "host/report/picture.h"

/* S1, S2. Okabe and Ito's colours, the same as everywhere. */
static const char *const sensors[] = {"plate, S1", "box, S2"};
static const char *const colours[] = {"#0072B2", "#D55E00"};

enum { WIDTH = 1100, ROW_HEIGHT = 430, CURVE_POINTS = 231 };
static const double history_from_s = -0.001, history_to_s = 0.022;

const char *const study_figure_name[STUDY_FIGURES] = {"figure-10", "figure-11", "figure-12", "figures"};
const char *const study_figure_title[STUDY_FIGURES] = {"Figure 10: peaks in X over the contact angle",
                                                       "Figure 11: peaks in Y over the contact angle",
                                                       "Figure 12: histories at 25 deg", "Figures 10 to 12"};
const char *const study_figure_text[STUDY_FIGURES] = {
        "The mounts of 2A leave the plate 60 to 75 % of its box's peak, those of 2B 75 to 90 %; all fall "
        "with the angle. study: measured, means of five drops; simulated: means of the drops here; bars are "
        "SDs of five drops. planar is fitted to the study's means, coupled predicted without them.",
        "With the angle the box's peak falls and the plate's rises; above 25 deg 2B's plate gets more than "
        "its box. coupled, whose box does not turn, has neither right.",
        "The plate follows later, longer and lower, then rings; the softer mount more so. The dotted "
        "line is planar, fitted to the study's means; the simulated tower has its equations, so that they "
        "must "
        "lie on each other. The study gives no samples to draw.",
        ""};

struct drawing {
	const struct study *study;
	FILE *script;
	char *message;
	int blocks; /* data blocks so far: their names */
};

/* ---- peaks over the angle (Figures 10 and 11) ---- */

static void draw_prediction(struct drawing *d, size_t g, size_t s, enum study_quantity q, bool planar)
{
	struct scene scene = d->study->scene[g];

	fprintf(d->script, "$b%d << EOD\n", d->blocks++);
	for (int deg = 13; deg <= 37; deg++) {
		struct model_prediction p;

		scene.drop_angle_deg = deg;
		if (model_solve(&scene, planar ? MODEL_PLANAR : MODEL_COUPLED, NULL, &p, NULL) == 0)
			fprintf(d->script, "%d %.2f\n", deg, p.peak[2 * s + q].value_g);
	}
	fputs("EOD\n", d->script);
}

static void draw_means(struct drawing *d, size_t g, size_t s, enum study_quantity q, bool published)
{
	fprintf(d->script, "$b%d << EOD\n", d->blocks++);
	for (size_t a = 0; a < STUDY_ANGLES; a++) {
		const struct study_series *series = &d->study->series[g][a];
		struct study_value v = published ? series->published[s][q] : study_peak(series, s, q);

		/* side by side, so that neither hides the other; a point without SD has no bar */
		if (isfinite(v.mean))
			fprintf(d->script, "%.2f %.2f %.2f\n", study_angle_deg[a] + (published ? -0.3 : 0.3),
			        v.mean, isfinite(v.sd) ? v.sd : 0.0);
	}
	fputs("EOD\n", d->script);
}

/* One panel: both sensors of one geometry along one axis. */
static void draw_peaks(struct drawing *d, size_t g, enum study_quantity q, const char *label)
{
	int first = d->blocks;

	for (size_t s = 0; s < STUDY_SENSORS; s++) {
		draw_prediction(d, g, s, q, true);
		draw_prediction(d, g, s, q, false);
		draw_means(d, g, s, q, true);
		draw_means(d, g, s, q, false);
	}
	fprintf(d->script,
	        "set title '%s  geometry %s, %c direction'\nset xrange [13:37]\nset xtics 5\n"
	        "set xlabel 'contact angle, deg'\nset ylabel 'peak, g'\nset yrange [0:%d]\nplot ",
	        label, study_geometry[g], "XY"[q], q == STUDY_X ? 900 : 450);
	for (int s = STUDY_SENSORS - 1; s >= 0; s--) {
		const char *c = colours[s];
		int b = first + 4 * s;

		fprintf(d->script, "$b%d using 1:2 with lines lc rgb '%s' lw 2 title '%s: planar, fitted', ",
		        b, c, sensors[s]);
		fprintf(d->script,
		        "$b%d using 1:2 with lines lc rgb '%s' lw 1.5 dt 2 title 'coupled, predicted', ",
		        b + 1, c);
		fprintf(d->script, "$b%d with yerrorbars lc rgb '%s' pt 7 ps 0.9 title 'study, measured', ",
		        b + 2, c);
		fprintf(d->script, "$b%d with yerrorbars lc rgb '%s' pt 4 ps 0.9 title 'simulated here'%s",
		        b + 3, c, s > 0 ? ", " : "\n");
	}
}

/* ---- histories (Figure 12) ---- */

static void draw_samples(struct drawing *d, const struct record *record, const char *name, double zero_s)
{
	const struct channel *c = record_channel(record, name);

	fprintf(d->script, "$b%d << EOD\n", d->blocks++);
	for (size_t k = 0; c != NULL && k < c->count; k++) {
		double t = c->start_s + (double)k / c->rate_hz - zero_s;

		if (t >= history_from_s && t <= history_to_s && isfinite(c->value_g[k]))
			fprintf(d->script, "%.4f %.2f\n", 1e3 * t, c->value_g[k]);
	}
	fputs("EOD\n", d->script);
}

static int draw_curves(struct drawing *d, const struct scene *scene, enum study_quantity q)
{
	double value[CURVE_POINTS][MODEL_AXES];
	double step = (history_to_s - history_from_s) / (CURVE_POINTS - 1);
	int status = model_histories(scene, MODEL_PLANAR, NULL, history_from_s, step, value, CURVE_POINTS,
	                             d->message);

	for (size_t s = 0; s < STUDY_SENSORS && status == 0; s++) {
		fprintf(d->script, "$b%d << EOD\n", d->blocks++);
		for (size_t k = 0; k < CURVE_POINTS; k++)
			fprintf(d->script, "%.4f %.2f\n", 1e3 * (history_from_s + (double)k * step),
			        value[k][2 * s + q]);
		fputs("EOD\n", d->script);
	}
	return status;
}

/* One panel: the first drop at 25 deg and the model, laid so that S2 peaks at the same instant. */
static int draw_history(struct drawing *d, size_t g, enum study_quantity q, const char *label)
{
	size_t a = study_reference(d->study, g);
	const struct study_series *series = &d->study->series[g][a];
	struct scene scene = d->study->scene[g];
	double zero_s = series->s2_peak_s - series->planar.resultant[1].time_s;
	int first = d->blocks, status = 0;
	struct record record;

	scene.drop_angle_deg = study_angle_deg[a];
	record_init(&record);
	if (series->cell.drops > 0)
		status = read_record(&record, series->log, NULL, d->message);
	if (status != 0)
		return status;
	draw_samples(d, &record, q == STUDY_X ? "S1X" : "S1Y", zero_s);
	draw_samples(d, &record, q == STUDY_X ? "S2X" : "S2Y", zero_s);
	record_free(&record);
	status = draw_curves(d, &scene, q);
	fprintf(d->script,
	        "set title '%s  geometry %s, %c direction, %.0f deg'\nset xrange [%g:%g]\nset xtics 5\n"
	        "set xlabel 'time after first touch, ms'\nset ylabel 'acceleration, g'\nset yrange [%d:%d]\n"
	        "plot ",
	        label, study_geometry[g], "XY"[q], study_angle_deg[a], 1e3 * history_from_s,
	        1e3 * history_to_s, q == STUDY_X ? -350 : -200, q == STUDY_X ? 600 : 340);
	for (int s = STUDY_SENSORS - 1; s >= 0; s--) {
		fprintf(d->script, "$b%d with lines lc rgb '%s' lw 1.5 title '%s: one simulated drop', ",
		        first + s, colours[s], sensors[s]);
		fprintf(d->script, "$b%d with lines lc rgb 'black' lw 1 dt 3 title 'planar, fitted'%s",
		        first + 2 + s, s > 0 ? ", " : "\n");
	}
	return status;
}

/* ---- the documents ---- */

static void figures_begin(FILE *script, int rows)
{
	fprintf(script,
	        "set terminal svg size %d,%d dynamic noenhanced background rgb 'white' font 'sans-serif,14'\n"
	        "set encoding utf8\nset border 3 linecolor rgb '#777777'\nset tics nomirror out scale 0.5 "
	        "textcolor rgb 'black'\nset grid linecolor rgb '#999999' linewidth 0.4 dashtype 1\n"
	        "set key inside top center vertical maxrows 4 samplen 2 width -1\nset bars 0.5\n"
	        "set lmargin 8\nset rmargin 2\n"
	        "set multiplot layout %d,2\n",
	        WIDTH, rows * ROW_HEIGHT, rows);
}

static int draw_panels(struct drawing *d, enum study_figure figure)
{
	int status = 0;

	if (figure == STUDY_FIGURE_10 || figure == STUDY_FIGURE_ALL) {
		draw_peaks(d, 1, STUDY_X, "10 (a)");
		draw_peaks(d, 2, STUDY_X, "10 (b)");
	}
	if (figure == STUDY_FIGURE_11 || figure == STUDY_FIGURE_ALL) {
		draw_peaks(d, 1, STUDY_Y, "11 (a)");
		draw_peaks(d, 2, STUDY_Y, "11 (b)");
	}
	if (figure == STUDY_FIGURE_12 || figure == STUDY_FIGURE_ALL) {
		status = draw_history(d, 1, STUDY_X, "12 (a)");
		if (status == 0)
			status = draw_history(d, 1, STUDY_Y, "12 (b)");
	}
	if (figure == STUDY_FIGURE_12 && status == 0) {
		status = draw_history(d, 2, STUDY_X, "12, as (a):");
		if (status == 0)
			status = draw_history(d, 2, STUDY_Y, "12, as (b):");
	}
	return status;
}

int study_draw(const struct study *study, enum study_figure figure, char **svg,
               char message[STUDY_MESSAGE_MAX])
{
	static const int rows[STUDY_FIGURES] = {1, 1, 2, 3};
	struct drawing drawing = {.study = study, .message = message};
	struct text script;
	int status = text_open(&script);

	snprintf(message, STUDY_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
	if (status != 0)
		return status;
	drawing.script = script.out;
	figures_begin(drawing.script, rows[figure]);
	status = text_close(&script, draw_panels(&drawing, figure));
	if (status == 0)
		status = picture_draw(script.bytes, script.size, svg, message, STUDY_MESSAGE_MAX);
	free(script.bytes);
	return status;
}
