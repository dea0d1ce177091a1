/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_version.h>

#include "common/wire.h"
#include "host/record/whole.h"
#include "host/report/page.h"

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
	page_text(out, title(report));
	fprintf(out, "</title>\n<style>%s</style></head>\n<body><main>\n<h1>", style);
	page_text(out, title(report));
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
	page_text(out, r->file);
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
		page_with_sigma(out, 1, r->peak_g, r->sigma_g);
		end_card(out, "g",
		         unless_ok(r->how.status,
		                   r->axes_coincide ? "X and Y peak together" : "X and Y peak apart"));
	}
	if (a->has_lag) {
		begin_card(out, "S1 after S2");
		if (report_driven(page->report)) {
			page_with_sigma(out, 3, a->lag.driven_s * 1e3, a->lag.sigma_driven_s * 1e3);
			end_card(out, "ms", "as a driven oscillator");
		} else {
			page_number(out, 3, a->lag.largest_peak_s * 1e3);
			end_card(out, "ms", unless_ok(a->lag.status, "between largest peaks"));
		}
	}
	if (a->has_plate) {
		begin_card(out, "Plate frequency, damped");
		page_number(out, 1, a->plate.frequency_hz);
		end_card(out, "Hz", unless_ok(a->plate.how.status, "ring-down of S1"));
		begin_card(out, "Plate damping ratio");
		page_number(out, 3, a->plate.damping_ratio);
		end_card(out, "", unless_ok(a->plate.how.status, "of critical"));
	}
	fputs("</div>\n", out);
}

static void notes(struct page *page, const struct report_note *note, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		bool first = i == 0 || note[i].flag != note[i - 1].flag;
		bool last = i + 1 == count || note[i].flag != note[i + 1].flag;

		if (first)
			fprintf(page->out, "<li><b>%s</b>: ", estimate_flag_name(note[i].flag));
		page_text(page->out, note[i].of);
		if (last)
			fprintf(page->out, ": %s.</li>", report_note_words(note[i].flag));
		else
			fputs(", ", page->out);
	}
}

static void flags(struct page *page)
{
	struct report_note note[REPORT_NOTES_MAX];
	size_t count = report_notes(page->report, note);
	const struct record *r = page->report->record;
	const struct analysis *a = page->report->analysis;
	unsigned all = report_flags(page->report);
	FILE *out = page->out;

	if (!all && !count)
		return;
	fputs("<h2>What to know about this record</h2>\n<ul>", out);
	for (unsigned f = all; f; f &= f - 1) {
		size_t named = 0;

		fprintf(out, "<li><b>%s</b>: %s", record_flag_name(f), report_flag_words(f & ~(f - 1)));
		for (size_t i = 0; i < a->channel_count; i++)
			if (a->channels[i].flags & f & ~(f - 1)) {
				fputs(named++ ? ", " : " (", out);
				page_channel_name(out, r->channels[i].name);
			}
		fputs(named ? ").</li>" : ".</li>", out);
	}
	notes(page, note, count);
	fputs("</ul>\n", out);
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
		page_text(out, page->report->version);
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
	page_pictures(page);
	page_tables(page);
	foot(page);
}

static int write_file(const char *file, const char *page, size_t length, char *message, size_t size)
{
	struct whole whole;
	int result = whole_open(&whole, file, message, size);

	if (result)
		return result;
	if (fwrite(page, 1, length, whole.out) != length)
		result = DT_E_SYSTEM;
	return whole_close(&whole, result, message, size);
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
