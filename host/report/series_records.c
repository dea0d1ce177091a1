/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Remarks in plain words, and what proves the rest: logs, versions, decisions, sensors.
 */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <nettle/base64.h>

#include "host/record/seal.h"
#include "host/report/series_private.h"

/* ---- remarks ---- */

enum remark_kind { OF_RECORD, OF_ESTIMATE, OF_STATUS, OF_TABLE };

/* One thing to know of one quantity, and the drops that it is true of. */
struct remark {
	enum remark_kind kind;
	unsigned flag; /* RECORD_FLAG_*, ESTIMATE_FLAG_* or enum estimate_status; 0: told */
	char of[48];   /* "" is the whole drop */
	char drops[120];
	size_t count;
};

enum { REMARKS_MAX = 200 };

struct remarks {
	struct remark item[REMARKS_MAX];
	size_t count;
};

static void add_remark(struct remarks *remarks, enum remark_kind kind, unsigned flag, const char *of,
                       unsigned drop)
{
	struct remark *r = remarks->item;
	size_t used;

	while (r < remarks->item + remarks->count &&
	       (r->flag != flag || r->kind != kind || strcmp(r->of, of)))
		r++;
	if (r == remarks->item + REMARKS_MAX)
		return;
	if (r == remarks->item + remarks->count) {
		*r = (struct remark){.flag = flag, .kind = kind};
		snprintf(r->of, sizeof(r->of), "%s", of);
		remarks->count++;
	}
	used = strlen(r->drops);
	if (used < sizeof(r->drops) - 24)
		snprintf(r->drops + used, sizeof(r->drops) - used, "%s%u", r->count ? ", " : "", drop);
	else if (r->drops[used - 1] != '.')
		snprintf(r->drops + used, sizeof(r->drops) - used, ", ...");
	r->count++;
}

static const char *status_words(unsigned status)
{
	switch (status) {
	case ESTIMATE_CLIPPED:
		return "the true value lies beyond what the sensor shows";
	case ESTIMATE_SHORT:
		return "the record does not hold enough samples";
	case ESTIMATE_AMBIGUOUS:
		return "more than one answer fits; the value is the likeliest";
	case ESTIMATE_NOT_CONVERGED:
		return "the fit failed; the value is the best there is";
	default:
		return "nothing stands out of the noise";
	}
}

/* What marks a value with *. */
static void add_status(struct remarks *remarks, const struct series_drop *drop, enum archive_value value,
                       const char *of, enum estimate_status status)
{
	if (isfinite(drop->a.value[value]) && (drop->a.not_ok >> value & 1u) && status != ESTIMATE_OK)
		add_remark(remarks, OF_STATUS, status, of, drop->a.number);
}

static void add_statuses(struct remarks *remarks, const struct series_drop *drop)
{
	static const struct {
		const char *channel, *of;
		enum archive_value value;
	} peak[] = {{"S1X", "S1 X", ARCHIVE_S1_X}, {"S1Y", "S1 Y", ARCHIVE_S1_Y},
	            {"S1Z", "S1 Z", ARCHIVE_S1_Z}, {"S2X", "S2 X", ARCHIVE_S2_X},
	            {"S2Y", "S2 Y", ARCHIVE_S2_Y}, {"S2Z", "S2 Z", ARCHIVE_S2_Z}};
	const struct analysis *a = &drop->analysis;

	for (size_t i = 0; i < sizeof(peak) / sizeof(peak[0]); i++) {
		const struct estimate_channel *e = report_axis(&drop->report, peak[i].channel);

		if (e)
			add_status(remarks, drop, peak[i].value, peak[i].of, e->peak.how.status);
	}
	for (size_t i = 0; i < a->resultant_count; i++)
		if (!strcmp(a->resultants[i].sensor, "S1") || !strcmp(a->resultants[i].sensor, "S2"))
			add_status(remarks, drop,
			           a->resultants[i].sensor[1] == '1' ? ARCHIVE_S1_R : ARCHIVE_S2_R,
			           a->resultants[i].sensor[1] == '1' ? "S1 XY" : "S2 XY",
			           a->resultants[i].how.status);
	add_status(remarks, drop, ARCHIVE_LAG, "lag", a->lag.status);
	add_status(remarks, drop, ARCHIVE_LAG_DRIVEN, "driven lag", a->lag.driven.status);
	add_status(remarks, drop, ARCHIVE_FREQUENCY, "plate", a->plate.how.status);
}

static void series_records_add_drop(struct remarks *remarks, const struct series_drop *drop)
{
	struct report_note note[REPORT_NOTES_MAX];
	size_t notes = report_notes(&drop->report, note);
	const struct record *r = &drop->record;

	if (strcmp(drop->a.quantities, quantity_version()))
		add_remark(remarks, OF_TABLE, 1, "", drop->a.number);
	add_statuses(remarks, drop);
	for (unsigned f = report_flags(&drop->report); f; f &= f - 1) {
		unsigned flag = f & ~(f - 1), named = 0;

		for (size_t i = 0; i < r->channel_count; i++)
			if (drop->analysis.channels[i].flags & flag) {
				add_remark(remarks, OF_RECORD, flag, r->channels[i].name, drop->a.number);
				named++;
			}
		if (!named)
			add_remark(remarks, OF_RECORD, flag, "", drop->a.number);
	}
	for (size_t i = 0; i < notes; i++)
		add_remark(remarks, OF_ESTIMATE, note[i].flag, note[i].of, drop->a.number);
}

/* All remarks with the flag of the first one, in one sentence; marks them as told. */
static void series_records_tell(FILE *out, struct remarks *remarks, size_t first, size_t counted)
{
	const struct remark *head = &remarks->item[first];
	unsigned flag = head->flag;
	enum remark_kind kind = head->kind;
	size_t told = 0;

	fprintf(out, "<li>%s: <b>",
	        kind == OF_RECORD     ? report_flag_words(flag)
	        : kind == OF_ESTIMATE ? report_note_words(flag)
	        : kind == OF_TABLE
	                ? "results by another table of quantities: what it did not have is missing,"
	                  " and 'droptower series reanalyse' makes it"
	                : status_words(flag));
	for (size_t i = first; i < remarks->count; i++) {
		struct remark *r = &remarks->item[i];

		if (r->flag != flag || r->kind != kind)
			continue;
		fputs(told++ ? "; " : "", out);
		page_note_subject(out, r->of);
		fputs(r->of[0] ? " of " : "", out);
		if (r->count == counted)
			fputs("all drops", out);
		else
			fprintf(out, "drop%s %s", r->count > 1 ? "s" : "", r->drops);
		r->flag = 0;
	}
	fprintf(out, "</b> <span class=\"soft\">(%s)</span></li>\n",
	        kind == OF_RECORD     ? record_flag_name(flag)
	        : kind == OF_ESTIMATE ? estimate_flag_name(flag)
	        : kind == OF_TABLE    ? "quantities"
	                              : estimate_status_name((enum estimate_status)flag));
}

void series_remarks(struct series_page *page)
{
	struct remarks *remarks = calloc(1, sizeof(*remarks));
	FILE *out = page->page.out;

	if (!remarks) {
		page->page.error = DT_E_MEMORY;
		return;
	}
	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && page->drop[i]->has_result)
			series_records_add_drop(remarks, page->drop[i]);
	if (remarks->count)
		fputs("<h2>Remarks on the drops that count</h2>\n<ul>", out);
	for (size_t i = 0; i < remarks->count; i++)
		if (remarks->item[i].flag)
			series_records_tell(out, remarks, i, series_counted(page));
	if (remarks->count)
		fputs("</ul>\n", out);
	free(remarks);
}

/* ---- records ---- */

static void record_row(FILE *out, const struct series_drop *drop)
{
	const struct record *r = &drop->record;
	char verdict[160] = "";

	if (drop->has_result)
		(void)report_verdict(&drop->report, verdict, sizeof(verdict));
	fprintf(out, "<tr><td>%u</td><td class=\"text\">", drop->a.number);
	series_time(out, drop->a.time);
	fputs("</td><td class=\"text\">", out);
	html_own(out, drop->a.operator_name);
	fputs("</td><td>", out);
	html_number(out, 3, r->frame_speed_m_s > 0.0 ? r->frame_speed_m_s : (double)NAN);
	fputs("</td><td class=\"text wrap\">", out);
	(drop->quoted ? html_own : html_text)(out, drop->no_log[0] ? drop->no_log
	                                           : verdict[0]    ? verdict
	                                                           : "no result");
	fputs("</td><td class=\"text\">", out);
	if (drop->a.version)
		html_own(out, drop->a.version);
	else
		fputs("no result", out);
	fputs("</td></tr>\n", out);
}

static void logs(const struct series_page *page)
{
	FILE *out = page->page.out;

	fputs("<h2>Records</h2>\n<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th>drop</th><th "
	      "class=\"text\">time "
	      "(UTC)</th><th class=\"text\">operator</th><th>frame, m/s</th><th "
	      "class=\"text\">record</th><th "
	      "class=\"text\">analysed by</th></tr></thead><tbody>\n",
	      out);
	for (size_t i = 0; i < page->count; i++)
		record_row(out, page->drop[i]);
	fputs("</tbody></table></div>\n<div class=\"scroll\" "
	      "tabindex=\"0\"><table><thead><tr><th>drop</th><th "
	      "class=\"text\">raw log and its SHA-256</th><th>bytes</th></tr></thead><tbody>\n",
	      out);
	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];

		fprintf(out, "<tr><td>%u</td><td class=\"text wrap hash\">", d->a.number);
		html_own(out, d->a.raw);
		fputs("<br>", out);
		if (d->a.sha256[0])
			html_own(out, d->a.sha256);
		else
			fputs("none: never finished", out);
		fprintf(out, "</td><td>%" PRId64 "</td></tr>\n", d->a.bytes);
	}
	fputs("</tbody></table></div>\n", out);
	if (page->seal.entry > 0)
		fprintf(out,
		        "<p class=\"note\">Chain of the archive: entry %" PRId64
		        ", which stands for all before "
		        "it, head <span class=\"hash\">%c%s%c</span></p>\n",
		        page->seal.entry, HTML_OWN, page->seal.head, HTML_OWN_END);
	else
		fputs("<p class=\"note\">Not sealed: recorded before the archive had a chain.</p>\n", out);
}

/* No letter of it means anything to HTML or PDF. */
int series_base64(FILE *out, const void *bytes, size_t size)
{
	char *text = malloc(BASE64_ENCODE_RAW_LENGTH(size) + 1);

	if (!text)
		return DT_E_MEMORY;
	base64_encode_raw(text, size, bytes);
	fwrite(text, 1, BASE64_ENCODE_RAW_LENGTH(size), out);
	free(text);
	return 0;
}

/* The table of drops. */
static int put_data(const struct series_page *page)
{
	return series_base64(page->page.out, page->request->data, page->request->data_size);
}

static void series_data(struct series_page *page)
{
	FILE *out = page->page.out;

	fprintf(out,
	        "<p class=\"screen\">The table of these drops goes along with this file: <a "
	        "download=\"%s.csv\" "
	        "href=\"data:text/csv;base64,",
	        page->series.name);
	page->page.error = put_data(page);
	fputs("\">save it as CSV</a>.</p>\n", out);
}

void series_evidence(struct series_page *page)
{
	FILE *out = page->page.out;

	fprintf(out, SERIES_EVIDENCE "series %s\n", page->series.name);
	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->a.sha256[0])
			fprintf(out, "log %s %s\n", page->drop[i]->a.raw, page->drop[i]->a.sha256);
	if (page->seal.entry > 0)
		fprintf(out, "chain %" PRId64 " %s\n", page->seal.entry, page->seal.head);
	fputs("data ", out);
	if (!page->page.error)
		page->page.error = put_data(page);
	fputs("\n" SEAL_BLANK "\n-->\n", out);
}

/* ---- decisions ---- */

struct history {
	FILE *out;
	unsigned drop;
	size_t rows;
};

static int history_row(void *context, const struct archive_event *event)
{
	struct history *h = context;

	if (h->rows++ == 0)
		fputs("<h2>Decisions and notes</h2>\n<div "
		      "class=\"scroll\" tabindex=\"0\"><table><thead><tr><th>drop</th><th "
		      "class=\"text\">time (UTC)</th><th class=\"text\">what</th><th "
		      "class=\"text\">who</th><th "
		      "class=\"text\">why</th></tr></thead><tbody>\n",
		      h->out);
	fprintf(h->out, "<tr><td>%u</td><td class=\"text\">", h->drop);
	series_time(h->out, event->time);
	fputs("</td><td class=\"text\">", h->out);
	html_text(h->out, event->what);
	fputs("</td><td class=\"text\">", h->out);
	html_own(h->out, event->operator_name);
	fputs("</td><td class=\"text wrap\">", h->out);
	html_own(h->out, event->text);
	fputs("</td></tr>\n", h->out);
	return 0;
}

static int series_records_history(struct series_page *page)
{
	struct history h = {.out = page->page.out};
	int result = 0;

	for (size_t i = 0; i < page->count && result == 0; i++) {
		char name[ARCHIVE_NAME_MAX + 16];

		h.drop = page->drop[i]->a.number;
		snprintf(name, sizeof(name), "%.60s/%u", page->series.name, h.drop);
		result = archive_each_event(page->request->archive, name, history_row, &h);
	}
	if (h.rows)
		fputs("</tbody></table></div>\n", h.out);
	return result;
}

void series_records(struct series_page *page)
{
	struct history h = {.out = page->page.out};
	int result = 0;

	if (page->count) {
		logs(page);
		result = series_records_history(page);
	}
	series_sensors(page);
	if (!page->page.error)
		series_data(page);
	fprintf(h.out, "<footer><p>Series made ");
	series_time(h.out, page->series.created);
	fputs(" UTC. Every raw log whose trace is drawn was read again and has the SHA-256 above.</p>\n",
	      h.out);
	if (result && !page->page.error) {
		page->page.error = result;
		snprintf(page->page.message, page->page.size, "%s", archive_message(page->request->archive));
	}
}
