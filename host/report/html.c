/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <gsl/gsl_version.h>

#include "common/wire.h"
#include "host/report/facts.h"
#include "host/report/picture.h"
#include "host/report/traces.h"

enum { HTML_CHANNELS_MAX = 12, HTML_GAPS_MAX = 20 };

/* A page being written; the first picture that fails is remembered and the rest are left out. */
struct page {
	FILE *out;
	const struct report *report;
	struct report_zero zero;
	size_t pictures;
	int error;
	char *message;
	size_t size;
};

/* The pictures' colours stand in them as attributes; the style gives them their dark counterparts. */
static const char style[] =
        ":root{color-scheme:light "
        "dark;--ink:#1c2126;--soft:#56606b;--line:#d8dee4;--page:#fff;--panel:#f5f7f9;"
        "--s1:#0072b2;--s2:#d55e00;--clip:#e69f00;--good:#00694d;--bad:#a23c00}"
        "@media screen and (prefers-color-scheme:dark){:root{--ink:#e6e9ec;--soft:#a0abb6;--line:#343b43;"
        "--page:#14181c;--panel:#1d2329;--s1:#56b4e9;--s2:#f0853a;--clip:#f0b429;--good:#"
        "4fd1a5;"
        "--bad:#ff9a5c}}"
        "*{box-sizing:border-box}body{margin:0;background:var(--page);color:var(--ink);"
        "font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'Liberation Sans',Arial,sans-serif}"
        "main{max-width:1180px;margin:0 auto;padding:28px 20px 40px}"
        "h1{font-size:1.7rem;line-height:1.25;margin:0 0 4px;overflow-wrap:anywhere}"
        "h2{font-size:1.15rem;margin:36px 0 6px}p{margin:4px 0 10px}.soft{color:var(--soft)}"
        ".file{overflow-wrap:anywhere}"
        ".verdict{display:inline-block;margin:12px 0 4px;padding:5px 12px;border-left:5px "
        "solid;border-radius:4px;"
        "background:var(--panel);font-weight:600}.good{color:var(--good)}.bad{color:var(--bad)}"
        ".cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px;margin:18px 0 "
        "0}"
        ".card{background:var(--panel);border-radius:8px;padding:12px 14px}.card span{display:block}"
        ".card .value{font-size:1.55rem;font-weight:600;line-height:1.3;font-variant-numeric:tabular-nums}"
        ".card .value small{font-size:.95rem;font-weight:400}.label,.note{font-size:.85rem;color:var(--soft)}"
        ".grid{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:16px 20px}"
        "figure{margin:0;break-inside:avoid}figcaption{display:flex;flex-wrap:wrap;justify-content:space-"
        "between;"
        "gap:0 12px;font-size:.92rem}figcaption span{color:var(--soft);font-variant-numeric:tabular-nums}"
        "svg{display:block;width:100%;height:auto}svg text{font-family:inherit}"
        "figure g[font-family]{font-family:inherit}"
        "svg g[fill='black'],svg g[fill='rgb(0,0,0)']{fill:var(--soft)}"
        "svg [stroke='rgb(  0,   0,   0)']{stroke:var(--ink)}svg [color='rgb(  0,   0,   "
        "0)']{color:var(--ink)}"
        "svg [stroke='rgb(  0, 114, 178)']{stroke:var(--s1)}svg [color='rgb(  0, 114, 178)']{color:var(--s1)}"
        "svg [stroke='rgb(213,  94,   0)']{stroke:var(--s2)}svg [color='rgb(213,  94,   0)']{color:var(--s2)}"
        "svg [stroke='rgb(153, 153, 153)']{stroke:var(--line)}"
        ".legend{display:flex;flex-wrap:wrap;gap:2px 18px;font-size:.85rem;color:var(--soft);margin:0 0 10px}"
        ".legend i{display:inline-block;width:22px;height:0;border-top:3px solid;vertical-align:middle;"
        "margin-right:6px}.legend .band{height:14px;border:0;background:#999;opacity:.45}.legend "
        ".dash{border-top:"
        "2px dashed var(--ink)}.legend .mark{width:auto;height:auto;border:0;font-style:normal}"
        ".scroll{overflow-x:auto}.scroll "
        "svg{min-width:720px}table{border-collapse:collapse;width:100%;font-size:.92rem;"
        "font-variant-numeric:tabular-nums}th,td{padding:5px 10px;text-align:right;border-bottom:1px solid "
        "var(--line);white-space:nowrap}th{font-weight:600;color:var(--soft)}"
        ".small{max-width:640px}"
        "th:first-child,td:first-child,td.text,th.text{text-align:left}"
        "ul{margin:6px 0;padding-left:20px}footer{margin-top:36px;padding-top:10px;border-top:1px solid "
        "var(--line);"
        "font-size:.85rem;color:var(--soft)}"
        "@media(max-width:760px){th,td{padding:5px "
        "6px}td:first-child{white-space:normal}.grid{grid-template-columns:minmax(0,1fr)}main{padding:18px "
        "12px}"
        "h1{font-size:1.35rem}.cards{grid-template-columns:repeat(2,minmax(0,1fr));gap:8px}"
        ".card{padding:9px 10px}.card .value{font-size:1.25rem}}"
        "@media print{main{max-width:none;padding:0}body{font-size:12px}h2{break-after:avoid}"
        ".card,.verdict{border:1px solid var(--line)}}";

static void text(FILE *out, const char *s)
{
	for (; *s; s++) {
		switch (*s) {
		case '&':
			fputs("&amp;", out);
			break;
		case '<':
			fputs("&lt;", out);
			break;
		case '>':
			fputs("&gt;", out);
			break;
		case '"':
			fputs("&quot;", out);
			break;
		default:
			fputc(*s, out);
		}
	}
}

static void number(FILE *out, int decimals, double value)
{
	if (isfinite(value))
		fprintf(out, "%s%.*f", value < 0.0 ? "&minus;" : "", decimals, fabs(value));
	else
		fputs("&ndash;", out);
}

static void with_sigma(FILE *out, int decimals, double value, double sigma)
{
	number(out, decimals, value);
	if (isfinite(value) && isfinite(sigma)) {
		fputs(" &plusmn; ", out);
		number(out, decimals, sigma);
	}
}

/* "S1X" as "S1 X"; other names as they are. */
static void channel_name(FILE *out, const char *name)
{
	if (strlen(name) == 3 && name[0] == 'S')
		fprintf(out, "%.2s %c", name, name[2]);
	else
		text(out, name);
}

/* ---- pictures ---- */

static const char *after(const char *s, const char *end)
{
	const char *found = strstr(s, end);

	return found ? found + strlen(end) : s + strlen(s);
}

/* The <svg> element alone. What every picture of gnuplot repeats (symbols, an id) may stand only once in
 * a page, and its <title>s would pop up as hints. */
static void inline_svg(FILE *out, const char *svg, bool first, const char *label)
{
	const char *s = strstr(svg, "<svg");

	if (!s)
		return;
	fputs("<svg role=\"img\" aria-label=\"", out);
	text(out, label);
	fputc('"', out);
	s += strlen("<svg");
	while (*s) {
		if (!strncmp(s, "<title>", 7))
			s = after(s, "</title>");
		else if (!strncmp(s, "<desc>", 6))
			s = after(s, "</desc>");
		else if (!first && !strncmp(s, "<defs>", 6))
			s = after(s, "</defs>");
		else if (!strncmp(s, " id=\"gnuplot", 12))
			s = after(s + 5, "\"");
		else
			fputc(*s++, out);
	}
}

static void draw(struct page *page, FILE *script, char **buffer, const size_t *length, bool drawn,
                 const char *label)
{
	char *svg = NULL;

	if (fclose(script) != 0) {
		page->error = DT_E_MEMORY;
	} else if (drawn) {
		page->error = picture_draw(*buffer, *length, &svg, page->message, page->size);
		if (!page->error)
			inline_svg(page->out, svg, page->pictures++ == 0, label);
		free(svg);
	} else {
		fputs("<p class=\"soft\">Nothing to draw: no good sample here.</p>", page->out);
	}
	free(*buffer);
}

/* A script in the making; NULL, with the page's error set, without memory or after an earlier error. */
static FILE *begin_script(struct page *page, char **buffer, size_t *length)
{
	FILE *script = page->error ? NULL : open_memstream(buffer, length);

	if (!script && !page->error)
		page->error = DT_E_MEMORY;
	return script;
}

static void picture_of_channel(struct page *page, size_t channel)
{
	const struct channel *c = &page->report->record->channels[channel];
	const struct estimate_channel *e = &page->report->analysis->channels[channel];
	size_t length;
	char *buffer, status[48];
	FILE *script = begin_script(page, &buffer, &length);

	if (!script)
		return;
	fputs("<figure><figcaption><b>", page->out);
	channel_name(page->out, c->name);
	fputs("</b><span>", page->out);
	with_sigma(page->out, 1, e->peak.value_g, e->peak.sigma_g);
	fputs(" g at ", page->out);
	number(page->out, 3, (e->peak.time_s - page->zero.time_s) * 1e3);
	fputs(" ms", page->out);
	if (strcmp(report_channel_status(e, status, sizeof(status)), "ok") != 0)
		fprintf(page->out, " (%s)", status);
	fputs("</span></figcaption>", page->out);
	draw(page, script, &buffer, &length, traces_channel(script, page->report, &page->zero, channel),
	     c->name);
	fputs("</figure>\n", page->out);
}

static void picture_of_resultant(struct page *page)
{
	size_t length;
	char *buffer;
	FILE *script = begin_script(page, &buffer, &length);

	if (!script)
		return;
	fputs("<figure class=\"scroll\">", page->out);
	draw(page, script, &buffer, &length, traces_resultant(script, page->report, &page->zero),
	     "resultants");
	fputs("</figure>\n", page->out);
}

static void picture_of_whole(struct page *page)
{
	size_t length;
	char *buffer;
	FILE *script = begin_script(page, &buffer, &length);

	if (!script)
		return;
	fputs("<figure class=\"scroll\">", page->out);
	draw(page, script, &buffer, &length, traces_overview(script, page->report, &page->zero),
	     "whole capture");
	fputs("</figure>\n", page->out);
}

static void picture_of_ringdown(struct page *page, char axis)
{
	size_t length;
	char *buffer;
	FILE *script = begin_script(page, &buffer, &length);

	if (!script)
		return;
	fprintf(page->out, "<figure><figcaption><b>S1 %c</b></figcaption>", axis);
	draw(page, script, &buffer, &length, traces_ringdown(script, page->report, &page->zero, axis),
	     "ring-down");
	fputs("</figure>\n", page->out);
}

/* ---- sections ---- */

static const char *title(const struct report *report)
{
	const char *slash = strrchr(report->record->file, '/');

	if (report->scene)
		return report->scene->title[0] ? report->scene->title : report->scene->name;
	return slash ? slash + 1 : report->record->file;
}

static void head(struct page *page)
{
	const struct report *report = page->report;
	const struct record *r = report->record;
	char verdict[160];
	bool good = report_verdict(report, verdict, sizeof(verdict));
	FILE *out = page->out;

	fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
	      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>",
	      out);
	text(out, title(report));
	fprintf(out, "</title>\n<style>%s</style></head>\n<body><main>\n<h1>", style);
	text(out, title(report));
	fputs("</h1>\n<p>", out);
	if (report->scene)
		fprintf(out, "Dropped from %g m at %g&deg;. ", report->scene->drop_height_m,
		        report->scene->drop_angle_deg);
	if (r->is_drop)
		fprintf(out, "Drop %u", (unsigned)r->drop_id);
	if (r->is_drop && isfinite(r->frame_speed_m_s))
		fprintf(out, ", frame %.3f m/s between the light gates", r->frame_speed_m_s);
	fputs(r->is_drop ? ". " : "", out);
	fputs("<span class=\"soft file\">", out);
	text(out, r->file);
	fprintf(out, " (%s)</span></p>\n<div class=\"verdict %s\">%s %s</div>\n", r->format,
	        good ? "good" : "bad", good ? "&#10003;" : "&#9888;", verdict);
}

static void begin_card(FILE *out, const char *label)
{
	fprintf(out, "<div class=\"card\"><span class=\"label\">%s</span><span class=\"value\">", label);
}

static void end_card(FILE *out, const char *unit, const char *note)
{
	fprintf(out, "<small> %s</small></span><span class=\"note\">%s</span></div>\n", unit, note);
}

static const char *unless_ok(enum estimate_status status, const char *note)
{
	return status == ESTIMATE_OK ? note : estimate_status_name(status);
}

static void cards(struct page *page)
{
	const struct analysis *a = page->report->analysis;
	FILE *out = page->out;

	if (!a->resultant_count && !a->has_lag && !a->has_plate)
		return;
	fputs("<div class=\"cards\">", out);
	for (size_t i = 0; i < a->resultant_count; i++) {
		const struct estimate_resultant *r = &a->resultants[i];
		char label[32];

		snprintf(label, sizeof(label), "%s, resultant peak", r->sensor);
		begin_card(out, label);
		with_sigma(out, 1, r->peak_g, r->sigma_g);
		end_card(out, "g",
		         unless_ok(r->status,
		                   r->axes_coincide ? "X and Y peak together" : "X and Y peak apart"));
	}
	if (a->has_lag) {
		begin_card(out, "S1 after S2");
		number(out, 3, a->lag.largest_peak_s * 1e3);
		end_card(out, "ms", unless_ok(a->lag.status, "between largest peaks"));
	}
	if (a->has_plate) {
		begin_card(out, "Plate frequency, damped");
		number(out, 1, a->plate.frequency_hz);
		end_card(out, "Hz", unless_ok(a->plate.status, "ring-down of S1"));
		begin_card(out, "Plate damping ratio");
		number(out, 3, a->plate.damping_ratio);
		end_card(out, "", unless_ok(a->plate.status, "of critical"));
	}
	fputs("</div>\n", out);
}

static void flags(struct page *page)
{
	const struct record *r = page->report->record;
	const struct analysis *a = page->report->analysis;
	unsigned all = report_flags(page->report);
	FILE *out = page->out;

	if (!all && !r->gap_count)
		return;
	fputs("<h2>What to know about this record</h2>\n<ul>", out);
	for (unsigned f = all; f; f &= f - 1) {
		size_t named = 0;

		fprintf(out, "<li><b>%s</b>: %s", record_flag_name(f), report_flag_words(f & ~(f - 1)));
		for (size_t i = 0; i < a->channel_count; i++)
			if (a->channels[i].flags & f & ~(f - 1)) {
				fputs(named++ ? ", " : " (", out);
				channel_name(out, r->channels[i].name);
			}
		fputs(named ? ").</li>" : ".</li>", out);
	}
	fputs("</ul>\n", out);
	if (!r->gap_count)
		return;
	fputs("<table class=\"small\"><tr><th class=\"text\">missing</th><th>first tick, ms</th><th>last "
	      "tick, ms</th>"
	      "<th>blocks</th></tr>",
	      out);
	for (size_t i = 0; i < r->gap_count && i < HTML_GAPS_MAX; i++)
		fprintf(out,
		        "<tr><td>S%u</td><td>%" PRIu32 "</td><td>%" PRIu32 "</td><td>%" PRIu32 "</td></tr>",
		        r->gaps[i].sensor, r->gaps[i].first_tick_ms, r->gaps[i].last_tick_ms,
		        r->gaps[i].last_tick_ms - r->gaps[i].first_tick_ms + 1);
	fputs("</table>\n", out);
	if (r->gap_count > HTML_GAPS_MAX)
		fprintf(out, "<p class=\"soft\">and %zu more gaps.</p>\n", r->gap_count - HTML_GAPS_MAX);
}

static bool any_model(const struct report *report)
{
	for (size_t i = 0; i < report->record->channel_count; i++)
		if (traces_has_model(report, report->record->channels[i].name))
			return true;
	return false;
}

static void legend(struct page *page)
{
	const struct record *r = page->report->record;
	bool two = record_channel(r, "S2X") != NULL;
	FILE *out = page->out;

	fputs("<div class=\"legend\">", out);
	fprintf(out, "<span><i style=\"color:var(--s1)\"></i>%s</span>", two ? "S1 measured" : "measured");
	if (two)
		fputs("<span><i style=\"color:var(--s2)\"></i>S2 measured</span>", out);
	if (any_model(page->report))
		fprintf(out, "<span><i class=\"dash\"></i>model %s</span>",
		        page->report->prediction->fidelity);
	fputs("<span><i class=\"mark\">&#9675;</i>peak, as estimated</span>", out);
	if (r->flags & RECORD_FLAG_CLIPPED)
		fputs("<span><i class=\"mark\" style=\"color:var(--clip)\">&#9650;</i>beyond the sensor's "
		      "range</span>",
		      out);
	if (r->flags & (RECORD_FLAG_LOST | RECORD_FLAG_BAD | RECORD_FLAG_OVERRUN))
		fputs("<span><i class=\"band\"></i>samples missing</span>", out);
	fputs("</div>\n", out);
}

/* S1 beside S2, axis by axis; other channels in their order. */
static void traces(struct page *page)
{
	static const char *const order[] = {"S1X", "S2X", "S1Y", "S2Y", "S1Z", "S2Z"};
	const struct record *r = page->report->record;
	size_t tower = 0, drawn = 0;

	fputs("<h2>Traces around the impact</h2>\n<p class=\"soft\">Baselines taken off. Time 0: ",
	      page->out);
	text(page->out, page->zero.name);
	fputs(any_model(page->report) ? ". The model is laid so that its S2 peaks where S2 did.</p>\n"
	                              : ".</p>\n",
	      page->out);
	legend(page);
	fputs("<div class=\"grid\">", page->out);
	for (size_t i = 0; i < sizeof(order) / sizeof(order[0]); i++)
		tower += record_channel(r, order[i]) != NULL;
	for (size_t i = 0; i < sizeof(order) / sizeof(order[0]) && tower == r->channel_count; i++) {
		const struct channel *c = record_channel(r, order[i]);

		if (c)
			picture_of_channel(page, (size_t)(c - r->channels));
	}
	for (size_t i = 0; i < r->channel_count && tower != r->channel_count && drawn < HTML_CHANNELS_MAX;
	     i++, drawn++)
		picture_of_channel(page, i);
	fputs("</div>\n", page->out);
	if (tower != r->channel_count && r->channel_count > HTML_CHANNELS_MAX)
		fprintf(page->out, "<p class=\"soft\">The first %d of %zu channels are drawn.</p>\n",
		        HTML_CHANNELS_MAX, r->channel_count);
}

static void more_pictures(struct page *page)
{
	const struct report *report = page->report;
	FILE *out = page->out;

	if (report->analysis->resultant_count) {
		fputs("<h2>Resultants of X and Y</h2>\n<p class=\"soft\">For the picture X is read between "
		      "its "
		      "samples at Y's instants; the figures come from the curves fitted to each axis. ",
		      out);
		fputs(any_model(report) ? "Dashed: the model.</p>\n" : "</p>\n", out);
		picture_of_resultant(page);
	}
	if (report->analysis->has_plate && report->analysis->plate.frequency_hz > 0.0) {
		fputs("<h2>Ring-down of the plate</h2>\n<p class=\"soft\">Circles: measured. Line: a damped "
		      "cosine "
		      "with the frequency and damping of the table; amplitude, phase and offset are fitted "
		      "for "
		      "the picture.</p>\n<div class=\"grid\">",
		      out);
		picture_of_ringdown(page, 'X');
		picture_of_ringdown(page, 'Y');
		fputs("</div>\n", out);
	}
	fprintf(out, "<h2>The whole record</h2>\n<p class=\"soft\">%s. Shaded: the part shown above.</p>\n",
	        record_channel(report->record, "S1X") || record_channel(report->record, "S2X")
	                ? "Along X"
	                : "The channel with the largest peak");
	picture_of_whole(page);
}

static void result_row(struct page *page, size_t i)
{
	const struct channel *c = &page->report->record->channels[i];
	const struct estimate_channel *e = &page->report->analysis->channels[i];
	FILE *out = page->out;
	char status[48];

	fputs("<tr><td>", out);
	channel_name(out, c->name);
	fputs("</td><td>", out);
	number(out, 1, c->rate_hz);
	fputs("</td><td>", out);
	with_sigma(out, 2, e->peak.value_g, e->peak.sigma_g);
	fputs("</td><td>", out);
	with_sigma(out, 4, (e->peak.time_s - page->zero.time_s) * 1e3, e->peak.sigma_time_s * 1e3);
	fputs("</td><td>", out);
	with_sigma(out, 3, e->pulse.duration_s * 1e3, e->pulse.sigma_duration_s * 1e3);
	fputs("</td><td>", out);
	with_sigma(out, 3, e->pulse.velocity_change_m_s, e->pulse.sigma_velocity_m_s);
	fputs("</td><td>", out);
	number(out, 2, e->baseline.noise_g);
	fprintf(out, "</td><td class=\"text\">%s</td></tr>\n",
	        report_channel_status(e, status, sizeof(status)));
}

static void results(struct page *page)
{
	const struct analysis *a = page->report->analysis;
	FILE *out = page->out;

	fputs("<h2>Results</h2>\n<div class=\"scroll\"><table><tr><th>channel</th><th>rate, Hz</th><th>peak, "
	      "g</th><th>at, ms</th><th>width at 10 %, ms</th><th>velocity change, m/s</th><th>noise, g</th>"
	      "<th class=\"text\">status</th></tr>\n",
	      out);
	for (size_t i = 0; i < a->channel_count; i++)
		result_row(page, i);
	for (size_t i = 0; i < a->resultant_count; i++) {
		const struct estimate_resultant *r = &a->resultants[i];

		fprintf(out, "<tr><td>%s X, Y</td><td></td><td>", r->sensor);
		with_sigma(out, 2, r->peak_g, r->sigma_g);
		fputs("</td><td>", out);
		number(out, 4, (r->time_s - page->zero.time_s) * 1e3);
		fputs("</td><td colspan=\"3\" class=\"text soft\">Y peaks ", out);
		number(out, 3, fabs(r->axes_apart_s) * 1e3);
		fprintf(out, " ms %s X</td><td class=\"text\">%s</td></tr>\n",
		        r->axes_apart_s < 0.0 ? "before" : "after", estimate_status_name(r->status));
	}
	fputs("</table></div>\n<p class=\"note\">&plusmn; is one standard uncertainty. Velocity change: the "
	      "integral over the pulse.</p>\n",
	      out);
}

static void joint_row(FILE *out, const char *label, const char *unit, int decimals, double value,
                      double sigma, enum estimate_status status)
{
	fprintf(out, "<tr><td>%s</td><td>", label);
	with_sigma(out, decimals, value, sigma);
	fprintf(out, " %s</td><td class=\"text\">%s</td></tr>\n", unit, estimate_status_name(status));
}

static void joint(struct page *page)
{
	const struct analysis *a = page->report->analysis;
	FILE *out = page->out;

	if (!a->has_lag && !a->has_plate)
		return;
	fputs("<h2>S1 against S2</h2>\n<div class=\"scroll\"><table "
	      "class=\"small\"><tr><th>quantity</th><th>value</th>"
	      "<th class=\"text\">status</th></tr>\n",
	      out);
	if (a->has_lag) {
		const struct estimate_lag *l = &a->lag;

		joint_row(out, "S1 after S2, first peaks", "ms", 3, l->first_peak_s * 1e3, (double)NAN,
		          l->status);
		joint_row(out, "S1 after S2, largest peaks", "ms", 4, l->largest_peak_s * 1e3,
		          l->sigma_s * 1e3, l->status);
		joint_row(out, "S1 after S2, cross-correlation", "ms", 3, l->cross_correlation_s * 1e3,
		          (double)NAN, l->status);
		joint_row(out, "spread of the three", "ms", 3, l->spread_s * 1e3, (double)NAN, l->status);
	}
	if (a->has_plate) {
		const struct estimate_ringdown *p = &a->plate;

		joint_row(out, "plate frequency, damped", "Hz", 2, p->frequency_hz, p->sigma_hz, p->status);
		joint_row(out, "plate frequency, undamped", "Hz", 2, p->natural_frequency_hz, (double)NAN,
		          p->status);
		joint_row(out, "plate frequency over three cycles", "Hz", 2, p->three_cycle_frequency_hz,
		          (double)NAN, p->status);
		joint_row(out, "plate damping ratio", "", 4, p->damping_ratio, p->sigma_damping, p->status);
	}
	fputs("</table></div>\n", out);
}

static void model(struct page *page)
{
	struct report_row rows[REPORT_ROWS_MAX];
	size_t count = report_compare(page->report, rows);
	FILE *out = page->out;

	if (!count)
		return;
	fputs("<h2>Model against drop</h2>\n<p class=\"soft\">Model ", out);
	text(out, page->report->prediction->fidelity);
	fputs(", ", out);
	text(out, page->report->prediction->reason);
	fputs(".</p>\n<div class=\"scroll\"><table "
	      "class=\"small\"><tr><th>quantity</th><th>model</th><th>measured</th>"
	      "<th>difference</th></tr>\n",
	      out);
	for (size_t i = 0; i < count; i++) {
		fprintf(out, "<tr><td>%s%s%s</td><td>", rows[i].label, rows[i].unit[0] ? ", " : "",
		        rows[i].unit);
		number(out, rows[i].decimals, rows[i].predicted * rows[i].scale);
		fputs("</td><td>", out);
		number(out, rows[i].decimals, rows[i].measured * rows[i].scale);
		fprintf(out, "</td><td>%s", rows[i].difference_percent > 0.0 ? "+" : "");
		number(out, 1, rows[i].difference_percent);
		fputs(isfinite(rows[i].difference_percent) ? " %</td></tr>\n" : "</td></tr>\n", out);
	}
	fputs("</table></div>\n<p class=\"note\">Difference: model less measured, over measured. A dash: not "
	      "known well enough to compare.</p>\n",
	      out);
}

static void foot(struct page *page)
{
	const struct record *r = page->report->record;
	FILE *out = page->out;

	fputs("<footer>", out);
	if (r->is_drop) {
		const struct record_counters *c = &r->counters;

		fprintf(out,
		        "<p>Frames: %" PRIu64 " blocks held, %" PRIu64 " gaps, %" PRIu64 " resent, %" PRIu64
		        " repeated, %" PRIu64 " reordered, %" PRIu64 " corrupt, %" PRIu64 " conflicting. ",
		        c->blocks, c->gaps, c->resent, c->repeated, c->reordered, c->corrupt, c->conflicting);
		if (r->crc_known)
			fprintf(out, "Capture CRC-32 %08" PRIX32 ". ", r->crc32);
		fprintf(out, "Ticks %" PRIu32 " to %" PRIu32 " ms.</p>\n", r->first_tick_ms, r->last_tick_ms);
	}
	fputs("<p>droptower", out);
	if (page->report->version) {
		fputc(' ', out);
		text(out, page->report->version);
	}
	fprintf(out,
	        ", wire %08" PRIX32 ", GSL %s, pictures by gnuplot.</p></footer>\n</main></body></html>\n",
	        wire_hash(), gsl_version);
}

static void write_page(struct page *page)
{
	head(page);
	cards(page);
	flags(page);
	traces(page);
	more_pictures(page);
	results(page);
	joint(page);
	model(page);
	foot(page);
}

/* Beside the file, then renamed over it. */
static int write_file(const char *file, const char *page, size_t length, char *message, size_t size)
{
	char *beside = NULL;
	FILE *out = NULL;
	int fd, result = DT_E_SYSTEM;

	if (asprintf(&beside, "%s.%ld.part", file, (long)getpid()) < 0) {
		snprintf(message, size, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	fd = open(beside, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666);
	out = fd < 0 ? NULL : fdopen(fd, "w");
	if (!out) {
		if (fd >= 0)
			close(fd);
	} else {
		bool whole = fwrite(page, 1, length, out) == length;

		whole = fclose(out) == 0 && whole;
		if (whole && rename(beside, file) == 0)
			result = 0;
	}
	if (result) {
		snprintf(message, size, "%s: cannot be written: %s", file, strerror(errno));
		if (fd >= 0)
			unlink(beside);
	}
	free(beside);
	return result;
}

int report_html(const struct report *report, const char *file, char *message, size_t size)
{
	char *buffer = NULL;
	size_t length = 0;
	struct page page = {.out = open_memstream(&buffer, &length),
	                    .report = report,
	                    .zero = report_zero(report),
	                    .message = message,
	                    .size = size};

	snprintf(message, size, "%s", error_text(DT_E_MEMORY));
	if (!page.out)
		return DT_E_MEMORY;
	write_page(&page);
	if (fclose(page.out) != 0 && !page.error)
		page.error = DT_E_MEMORY;
	if (!page.error)
		page.error = write_file(file, buffer, length, message, size);
	free(buffer);
	return page.error;
}
