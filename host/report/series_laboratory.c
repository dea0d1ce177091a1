/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What ISO/IEC 17025, 7.8 wants of a report beside what was measured: the laboratory's profile, what is
 * missing of it, sensors whose calibration was overdue, and the statements.
 */
#include <string.h>

#include "host/report/series_private.h"

/* Of the drops that count, the last one's day: what is due later was valid for all. */
static const char *last_day(const struct series_page *page)
{
	const char *day = "";

	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && strcmp(page->drop[i]->a.time, day) > 0)
			day = page->drop[i]->a.time;
	return day;
}

bool series_is_overdue(const struct series_page *page)
{
	const struct laboratory *l = page->request->laboratory;

	return l != NULL && (laboratory_is_overdue(l, LABORATORY_s1_due, last_day(page)) ||
	                     laboratory_is_overdue(l, LABORATORY_s2_due, last_day(page)));
}

static void laboratory_row(const struct series_page *page, enum laboratory_field field)
{
	const struct laboratory_row *row = &laboratory_rows[field];
	const char *text = page->request->laboratory->text[field];
	bool due = strcmp(row->key, "due") == 0;
	FILE *out = page->page.out;

	if (!text[0] && !row->needed)
		return;
	fprintf(out, "<tr><th>%s</th><td>", row->label);
	if (text[0])
		html_text(out, text);
	else
		fputs("<b style=\"color:var(--bad)\">missing</b>", out);
	if (due && laboratory_is_overdue(page->request->laboratory, field, last_day(page)))
		fputs(" <b style=\"color:var(--bad)\">OVERDUE when the drops were made</b>", out);
	fprintf(out, "</td><td class=\"soft\">%s</td></tr>\n", row->clause);
}

static void statements(const struct series_page *page, bool final)
{
	const struct laboratory *l = page->request->laboratory;
	FILE *out = page->page.out;

	fputs("<p class=\"note\">The results relate only to the items tested (7.8.2.1 l). This report shall "
	      "not be "
	      "reproduced except in full without the laboratory's approval (7.8.2.2). &plusmn; is one "
	      "standard "
	      "uncertainty u; U = k u with k = 2, in the unit of the result, is the expanded uncertainty for "
	      "about "
	      "95 % (7.8.3.1 c). It holds noise and fit; the measuring chain's part is in it only where the "
	      "limits state one. Differences from a prediction of the model are no uncertainty.</p>\n",
	      out);
	if (!final)
		return;
	fputs("<p>Authorised: ", out);
	html_text(out, l->text[LABORATORY_laboratory_signatory]);
	fputs(", ", out);
	html_text(out, l->text[LABORATORY_report_issued]);
	fputs(" &emsp; ______________________________</p>\n", out);
}

void series_laboratory(struct series_page *page)
{
	const struct laboratory *l = page->request->laboratory;
	bool overdue = series_is_overdue(page);
	unsigned missing;
	FILE *out = page->page.out;

	if (l == NULL)
		return;
	missing = laboratory_missing(l);
	fputs("<h2>Test report", out);
	if (l->text[LABORATORY_report_number][0]) {
		fputs(" ", out);
		html_text(out, l->text[LABORATORY_report_number]);
	}
	fputs("</h2>\n", out);
	if (missing > 0)
		fprintf(out,
		        "<div class=\"verdict bad\">DRAFT: %u fields that ISO/IEC 17025, 7.8 wants are "
		        "missing</div>\n",
		        missing);
	if (overdue)
		fputs("<div class=\"verdict bad\">OVERDUE: a sensor's calibration was due before a drop was "
		      "made; "
		      "not under accreditation</div>\n",
		      out);
	fputs("<table class=\"facts\">", out);
	for (int i = 0; i < LABORATORY_FIELDS; i++)
		laboratory_row(page, (enum laboratory_field)i);
	fputs("</table>\n", out);
	statements(page, missing == 0 && !overdue);
}
