/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page of a fit: what came out, what is left, and what follows from it over the angle. */
#include <math.h>

#include "host/report/fitted.h"
#include "host/report/page.h"
#include "host/report/script.h"

enum { CURVE_POINTS = 61, WIDTH = 560, HEIGHT = 300 };

/* ---- over the angle ---- */

/* A value of the drop's true motion. */
struct told {
	enum motion_derived which;
	const char *label, *unit;
	double scale;
};

static const struct told over_angle[] = {
        {MOTION_S1R_G, "S1, largest resultant", "g", 1.0},
        {MOTION_S2R_G, "S2, largest resultant", "g", 1.0},
        {MOTION_LAG_S, "S1 after S2", "ms", 1e3},
        {MOTION_RESTITUTION, "restitution of the centre of gravity", "", 1.0},
        {MOTION_CONTACT_S, "contact time", "ms", 1e3},
        {MOTION_SPIN_RAD_S, "spin after the contact", "rad/s", 1.0},
};

/* $band: angle, two standard uncertainties below, the value, and above. */
static size_t write_band(FILE *out, const struct fit *fit, const struct told *told)
{
	struct scene at = fit->scene;
	size_t points = 0;

	fputs("$band << EOD\n", out);
	for (int i = 0; i < CURVE_POINTS; i++) {
		double value[MOTION_DERIVED], sd[MOTION_DERIVED], v, u;

		at.drop_angle_deg =
		        FITTED_FROM_DEG + (FITTED_TO_DEG - FITTED_FROM_DEG) * i / (CURVE_POINTS - 1.0);
		if (fit_predict(&at, value, sd) != 0 || !isfinite(value[told->which]))
			continue;
		v = value[told->which] * told->scale;
		u = 2.0 * sd[told->which] * told->scale;
		fprintf(out, "%.3f %.8g %.8g %.8g\n", at.drop_angle_deg, v - u, v, v + u);
		points++;
	}
	fputs("EOD\n", out);
	return points;
}

/* $drops: angle, value and two standard uncertainties of each drop. */
static size_t write_drops(FILE *out, const struct fit *fit, const struct told *told)
{
	size_t points = 0;

	fputs("$drops << EOD\n", out);
	for (unsigned k = 0; k < fit->drops; k++) {
		const struct fit_drop_result *r = &fit->drop[k];

		if (!isfinite(r->derived[told->which]))
			continue;
		fprintf(out, "%.4f %.8g %.8g\n", r->own[FIT_GAMMA_DEG], r->derived[told->which] * told->scale,
		        2.0 * r->derived_sd[told->which] * told->scale);
		points++;
	}
	fputs("EOD\n", out);
	return points;
}

static void picture_over_angle(struct page *page, const struct fit *fit, const struct told *told)
{
	struct text script;
	size_t band, drops;

	if (!page_begin_script(page, &script))
		return;
	fprintf(page->out, "<figure><figcaption><b>%s</b><span>%s%sover deg</span></figcaption>", told->label,
	        told->unit, told->unit[0] ? " " : "");
	band = write_band(script.out, fit, told);
	drops = write_drops(script.out, fit, told);
	script_paper(script.out, WIDTH, HEIGHT, "deg", told->unit);
	fprintf(script.out,
	        "set lmargin 9\nset offsets 1, 1, graph 0.05, graph 0.05\nset xrange [%d:%d]\nplot ",
	        FITTED_FROM_DEG - 1, FITTED_TO_DEG + 1);
	if (band > 0)
		fputs("$band using 1:2:4 with filledcurves fillcolor rgb '" SCRIPT_COLOUR_LOST
		      "' fillstyle transparent solid 0.4 noborder, $band using 1:3 with lines linewidth 1.5 "
		      "linecolor rgb '" SCRIPT_COLOUR_S1 "'",
		      script.out);
	if (drops > 0)
		fprintf(script.out,
		        "%s$drops using 1:2:3 with yerrorbars pointtype 7 pointsize 0.6 linewidth 1.5 "
		        "linecolor "
		        "rgb '" SCRIPT_COLOUR_S2 "'",
		        band > 0 ? ", " : "");
	fputc('\n', script.out);
	page_draw(page, &script, band + drops > 0, told->label);
	fputs("</figure>\n", page->out);
}

/* ---- what is left ---- */

struct left {
	FILE *out;
	unsigned axis;
	bool whole; /* what was read and what was fitted, not their difference */
	size_t points;
	double before_s;
};

static void write_left(void *context, const struct fit_trace *trace)
{
	struct left *left = context;

	if (trace->axis != left->axis)
		return;
	if (left->whole)
		fprintf(left->out, "%.5f %.5g %.5g\n", trace->time_s * 1e3, trace->measured_g,
		        trace->fitted_g);
	else
		fprintf(left->out, "%.5f %.5g\n", trace->time_s * 1e3, trace->measured_g - trace->fitted_g);
	left->points++;
}

/* Of drops from number k on, one after the other with a gap between. */
static int write_lefts(const struct fitted *f, unsigned k, unsigned drops, struct left *left)
{
	int error = 0;

	fputs("$left << EOD\n", left->out);
	for (unsigned i = k; i < k + drops && error == 0; i++) {
		error = fit_traces(f->fit, i, f->start, &f->drop[i], f->options, write_left, left);
		fputs("\n\n", left->out);
	}
	fputs("EOD\n", left->out);
	return error;
}

static void picture_left(struct page *page, const struct fitted *f, unsigned k, unsigned drops, unsigned axis,
                         bool whole)
{
	struct left left = {.axis = axis, .whole = whole};
	const char *colour = axis < MOTION_S2X ? SCRIPT_COLOUR_S1 : SCRIPT_COLOUR_S2;
	struct text script;

	if (!page_begin_script(page, &script))
		return;
	left.out = script.out;
	page->error = write_lefts(f, k, drops, &left);
	if (page->error) {
		page->error = text_close(&script, page->error);
		snprintf(page->message, page->size, "%s", error_text(page->error));
		return;
	}
	fputs("<figure><figcaption><b>", page->out);
	page_channel_name(page->out, fit_axis_names[axis]);
	fprintf(page->out, "</b><span>g over ms after the touch</span></figcaption>");
	script_paper(script.out, WIDTH, HEIGHT, "ms", "g");
	fprintf(script.out, "set xrange [-2:*]\nplot $left using 1:2 with %s linecolor rgb '%s'",
	        whole ? "points pointtype 7 pointsize 0.35" : "lines linewidth 0.6", colour);
	if (whole)
		fputs(", $left using 1:3 with lines linewidth 1.5 linecolor rgb 'black'", script.out);
	fputc('\n', script.out);
	page_draw(page, &script, left.points > 0, fit_axis_names[axis]);
	fputs("</figure>\n", page->out);
}

static void pictures_left(struct page *page, const struct fitted *f, unsigned k, unsigned drops, bool whole)
{
	fputs("<div class=\"grid\">", page->out);
	for (unsigned axis = 0; axis < MOTION_AXES; axis++)
		picture_left(page, f, k, drops, axis, whole);
	fputs("</div>\n", page->out);
}

/* The drop that is furthest from what was said of it. */
static unsigned worst_drop(const struct fit *fit)
{
	unsigned worst = 0;

	for (unsigned k = 1; k < fit->drops; k++)
		if (fit->drop[k].pull > fit->drop[worst].pull)
			worst = k;
	return worst;
}

/* ---- the page ---- */

static void fitted_head(FILE *out, const struct fitted *f)
{
	const struct scene *scene = f->start;
	bool holds = fitted_holds(f->fit);

	page_begin(out, scene->title[0] ? scene->title : scene->name, "");
	fprintf(out, "<p>A product's parameters, fitted to the whole histories of %u drop%s.</p>\n",
	        f->fit->drops, f->fit->drops == 1 ? "" : "s");
	fprintf(out, "<div class=\"verdict %s\">%s ", holds ? "good" : "bad", holds ? "&#10003;" : "&#9888;");
	if (holds) {
		fputs("Nothing is left unexplained.</div>\n", out);
		return;
	}
	fputs("No uncertainty holds.</div>\n<p>", out);
	if (f->fit->doubt.words[0])
		html_text(out, f->fit->doubt.words);
	else
		fputs("A parameter came out beyond what the scene allows", out);
	fputs(".</p>\n", out);
}

static void fitted_residuals(struct page *page, const struct fitted *f)
{
	const struct fit_doubt *doubt = &f->fit->doubt;
	unsigned worst = worst_drop(f->fit);

	fprintf(page->out,
	        "<h2>What is left</h2>\n<p class=\"soft\">Measured less fitted, all drops: %.3f of the "
	        "noise's "
	        "squares over %zu samples, largest oscillation %.1f at %.0f Hz.</p>\n",
	        doubt->chi2 / (double)doubt->samples, doubt->samples, doubt->periodogram,
	        doubt->periodogram_hz);
	pictures_left(page, f, 0, f->fit->drops, false);
	fputs("<h2>", page->out);
	html_own(page->out, f->name[worst]);
	fputs("</h2>\n<p class=\"soft\">The drop whose angle, speed and gains are furthest from what was "
	      "said of "
	      "them: samples, and the fit as a line.</p>\n",
	      page->out);
	pictures_left(page, f, worst, 1, true);
}

static void fitted_write(struct page *page, const struct fitted *f)
{
	FILE *out = page->out;

	fitted_head(out, f);
	fputs("<h2>Parameters</h2>\n", out);
	fitted_parameters(f->fit, TABLE_HTML, out);
	fputs("<p class=\"soft\">+-: standard uncertainty; the law's own error is not in "
	      "it.</p>\n<h2>Drops</h2>\n",
	      out);
	fitted_drops(f, TABLE_HTML, out);
	if (fitted_holds(f->fit)) {
		fputs("<h2>Over the angle</h2>\n<p class=\"soft\">Predicted, with two standard uncertainties "
		      "of the "
		      "parameters; the drops' points have their own.</p>\n<div class=\"grid\">",
		      out);
		for (size_t i = 0; i < TABLE_COUNT(over_angle); i++)
			picture_over_angle(page, f->fit, &over_angle[i]);
		fputs("</div>\n", out);
		fitted_predictions(f->fit, TABLE_HTML, out);
		fputs("<p>", out);
		fitted_next(f->fit, TABLE_HTML, out);
		fputs("</p>\n", out);
	}
	fitted_residuals(page, f);
	fputs("<footer>", out);
	page_end(out, f->version);
}

int fitted_page(const struct fitted *f, FILE *out, char *message, size_t size)
{
	struct page page = {.translation = f->translation, .message = message, .size = size};
	int result = page_open(&page, out);

	snprintf(message, size, "%s", error_text(DT_E_MEMORY));
	if (result != 0)
		return result;
	fitted_write(&page, f);
	return page_close(&page);
}
