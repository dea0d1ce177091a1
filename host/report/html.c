/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/atomic_file.h"
#include "host/record/metadata.h"
#include "host/result/measured.h"
#include "host/report/page.h"
#include "host/report/shock.h"

static const char *title(const struct report *report)
{
	const char *slash = strrchr(report->record->file, '/');

	if (report->scene)
		return report->scene->title[0] ? report->scene->title : report->scene->name;
	return slash ? slash + 1 : report->record->file;
}

/* When and by whom. */
static void put_origin(const struct record *r, FILE *out)
{
	char date[METADATA_TEXT_MAX];

	if (r->time_s == 0)
		return;
	metadata_format(r, metadata_find("date"), date);
	fprintf(out, "<time>%c%s%c</time>", HTML_OWN, date, HTML_OWN_END);
	fputs(r->operator_name[0] != '\0' ? ", " : "", out);
	html_own(out, r->operator_name);
	fputs(". ", out);
}

static void html_head(struct page *page)
{
	const struct report *report = page->report;
	const struct record *r = report->record;
	char verdict[160], processing[160];
	bool good = report_verdict(report, verdict, sizeof(verdict));
	FILE *out = page->out;

	page_begin(out, title(report), "");
	fputs("<p>", out);
	if (report->scene)
		fprintf(out, "Dropped from %g m at %g&deg;. ", report->scene->drop_height_m,
		        report->scene->drop_angle_deg);
	if (r->is_drop)
		fprintf(out, "Drop %u", (unsigned)r->drop_id);
	if (r->is_drop && isfinite(r->frame_speed_m_s))
		fprintf(out, ", frame %.3f m/s between the light gates", r->frame_speed_m_s);
	fputs(r->is_drop ? ". " : "", out);
	put_origin(r, out);
	fputs("<span class=\"soft file\">", out);
	html_own(out, r->file);
	fprintf(out, " (%c%s%c%s)</span></p>\n<div class=\"verdict %s\">%s %s</div>\n", HTML_OWN, r->format,
	        HTML_OWN_END, record_lacks_seal(r) ? ", not sealed" : "", good ? "good" : "bad",
	        good ? "&#10003;" : "&#9888;", verdict);
	if (report->simulated || r->simulated != 0)
		fputs("<p><b>Simulated tower: no product fell.</b></p>\n", out);
	if (report_processing(report, processing, sizeof(processing)))
		fprintf(out, "<p class=\"soft\">Processing: %s.</p>\n", processing);
}

static void band(struct page *page)
{
	const struct band *band = page->report->band;
	struct text line;

	if (!band)
		return;
	page->error = text_open(&line);
	if (page->error)
		return;
	shock_write_band(band, line.out);
	page->error = text_close(&line, 0);
	if (!page->error) {
		fprintf(page->out, "<div><div class=\"verdict %s\">%s ", band->verdict.pass ? "good" : "bad",
		        band->verdict.pass ? "&#10003;" : "&#9888;");
		html_text(page->out, line.bytes);
		fputs("</div></div>\n", page->out);
	}
	free(line.bytes);
}

static const char *unless_ok(enum estimate_status status, const char *note)
{
	return status == ESTIMATE_OK ? note : estimate_status_name(status);
}

static const char *axes_note(const struct estimate_resultant *r)
{
	if (!isfinite(r->axes_apart_s))
		return "one axis has no peak";
	return r->axes_coincide ? "X and Y peak together" : "X and Y peak apart";
}

static void html_cards(struct page *page)
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
		page_begin_card(out, label);
		html_with_sigma(out, 1, r->peak_g, r->sigma_g);
		page_end_card(out, "g", unless_ok(r->how.status, axes_note(r)));
	}
	if (a->has_lag) {
		page_begin_card(out, "S1 after S2");
		if (report_driven(page->report)) {
			html_with_sigma(out, 3, a->lag.driven_s * 1e3, a->lag.sigma_driven_s * 1e3);
			page_end_card(out, "ms", "as a driven oscillator");
		} else {
			html_number(out, 3, a->lag.largest_peak_s * 1e3);
			page_end_card(out, "ms", unless_ok(a->lag.status, "between largest peaks"));
		}
	}
	if (a->has_plate) {
		page_begin_card(out, "Plate frequency, damped");
		html_number(out, 1, a->plate.frequency_hz);
		page_end_card(out, "Hz", unless_ok(a->plate.how.status, "ring-down of S1"));
		page_begin_card(out, "Plate damping ratio");
		html_number(out, 3, a->plate.damping_ratio);
		page_end_card(out, "", unless_ok(a->plate.how.status, "of critical"));
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
		page_note_subject(page->out, note[i].of);
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
	char tower[400];

	fputs("<footer>", out);
	measured_text(r, tower, sizeof(tower));
	if (r->is_drop) {
		const struct record_counters *c = &r->counters;

		fprintf(out,
		        "<p>Frames: %" PRIu64 " block%s held, %" PRIu64 " gap%s, %" PRIu64 " resent, %" PRIu64
		        " repeated, %" PRIu64 " reordered, %" PRIu64 " corrupt, %" PRIu64 " conflicting. ",
		        c->blocks, report_plural(c->blocks), c->gaps, report_plural(c->gaps), c->resent,
		        c->repeated, c->reordered, c->corrupt, c->conflicting);
		if (r->crc_known)
			fprintf(out, "Capture CRC-32 %08" PRIX32 ". ", r->crc32);
		if (tower[0] != '\0')
			fprintf(out, "Tower: %s. ", tower);
		fprintf(out, "Ticks %" PRIu32 " to %" PRIu32 " ms.</p>\n", r->first_tick_ms, r->last_tick_ms);
	}
	page_end(out, page->report->version);
}

static void html_verdict(struct page *page)
{
	const struct verdict *v = page->report->verdict;

	if (v == NULL)
		return;
	fprintf(page->out, "<h2>Limits</h2>\n<div class=\"verdict %s\">",
	        decide_meets(v->decision) ? "good" : "bad");
	verdict_line(v, page->out);
	fputs("</div>\n", page->out);
	if (verdict_table(v, TABLE_HTML, page->out) != 0)
		page->error = DT_E_MEMORY;
	page_limits_by(page->out, v);
	fprintf(page->out, "<p class=\"note\">Decision rule: %s.</p>\n", v->rule);
}

static void html_write_page(struct page *page)
{
	html_head(page);
	band(page);
	html_cards(page);
	html_verdict(page);
	flags(page);
	page_pictures(page);
	page_tables(page);
	foot(page);
}

int report_html(const struct report *report, const char *file, char *message, size_t size)
{
	struct page page = {.report = report,
	                    .zero = report_zero(report),
	                    .translation = report->translation,
	                    .message = message,
	                    .size = size};
	struct text text;
	int result = text_open(&text);

	snprintf(message, size, "%s", error_text(DT_E_MEMORY));
	if (result != 0)
		return result;
	result = page_open(&page, text.out);
	if (result == 0) {
		html_write_page(&page);
		result = page_close(&page);
	}
	result = text_close(&text, result);
	if (result == 0)
		result = atomic_file_write(file, text.bytes, text.size, message, size);
	free(text.bytes);
	return result;
}
