/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What ISO/IEC 17025, 7.8 wants of a report beside what was measured: the laboratory's profile, what is
 * missing of it, sensors whose calibration was overdue, and the statements.
 */
#include <math.h>
#include <string.h>

#include "host/report/series_private.h"

/* ---- the sensors of the drops that count ---- */

static void copy_field(char *to, size_t room, const char *from)
{
	snprintf(to, room, "%s", from);
}

static struct series_sensor *sensor_of(struct series_page *page, const struct sensor_used *used)
{
	struct series_sensor *s = page->sensor;

	for (; s < page->sensor + page->sensors; s++)
		if (strcmp(s->file_sha256, used->file_sha256) == 0 && strcmp(s->name, used->name) == 0 &&
		    s->overdue == used->overdue)
			return s;
	if (page->sensors == SERIES_SENSORS_MAX)
		return NULL;
	page->sensors++;
	s->overdue = used->overdue;
	copy_field(s->name, sizeof(s->name), used->name);
	copy_field(s->serial, sizeof(s->serial), used->serial);
	copy_field(s->model, sizeof(s->model), used->model);
	copy_field(s->certificate, sizeof(s->certificate), used->certificate);
	copy_field(s->laboratory, sizeof(s->laboratory), used->laboratory);
	copy_field(s->date, sizeof(s->date), used->date);
	copy_field(s->due, sizeof(s->due), used->due);
	copy_field(s->file_sha256, sizeof(s->file_sha256), used->file_sha256);
	return s;
}

int series_take_sensor(void *context, const struct sensor_used *used)
{
	const struct series_drop_of_page *of = context;
	struct series_sensor *s = sensor_of(of->page, used);
	size_t length;

	if (s == NULL)
		return DT_E_RANGE;
	length = strlen(s->drops);
	if (length < sizeof(s->drops) - 16)
		snprintf(s->drops + length, sizeof(s->drops) - length, "%s%u", s->count > 0 ? ", " : "",
		         of->drop->a.number);
	else if (s->drops[length - 1] != '.')
		snprintf(s->drops + length, sizeof(s->drops) - length, ", ...");
	s->count++;
	return 0;
}

bool series_is_overdue(const struct series_page *page)
{
	for (size_t i = 0; i < page->sensors; i++)
		if (page->sensor[i].overdue)
			return true;
	return false;
}

bool series_is_suspect(const struct series_page *page)
{
	for (size_t i = 0; i < page->sensors; i++)
		if (page->sensor[i].suspect)
			return true;
	return false;
}

int series_check_sensors(struct series_page *page)
{
	const char *time[2] = {"9", ""}; /* of the first and the last drop that counts */

	for (size_t i = 0; i < page->count; i++) {
		const struct archive_drop *a = &page->drop[i]->a;

		if (!page->drop[i]->counts)
			continue;
		time[0] = strcmp(a->time, time[0]) < 0 ? a->time : time[0];
		time[1] = strcmp(a->time, time[1]) > 0 ? a->time : time[1];
	}
	for (size_t i = 0; i < 2 * page->sensors; i++) {
		struct series_sensor *s = &page->sensor[i / 2];
		struct archive_check check;
		int result = archive_check(page->request->archive, s->serial, time[i % 2], i % 2, &check);

		if (result)
			return result;
		if (isnan(check.e_n))
			continue;
		snprintf(s->checks[i % 2], sizeof(s->checks[0]), "%s: E_n %.2f", check.drop, check.e_n);
		s->suspect |= fabs(check.e_n) > 1.0;
	}
	return 0;
}

/* Whether each drop that counts has that sensor's file. */
static bool has_sensor(const struct series_page *page, const char *name)
{
	size_t drops = 0;

	for (size_t i = 0; i < page->sensors; i++)
		if (strcmp(page->sensor[i].name, name) == 0)
			drops += page->sensor[i].count;
	return drops > 0 && drops == series_counted(page);
}

void series_sensors(struct series_page *page)
{
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct series_sensor, member, .width = -1, __VA_ARGS__)
	static const struct table_column columns[] = {
	        COLUMN(CHARS, name, .own = true, .title = "sensor"),
	        COLUMN(CHARS, serial, .own = true, .title = "serial number"),
	        COLUMN(CHARS, model, .own = true, .title = "model"),
	        COLUMN(CHARS, certificate, .own = true, .title = "certificate"),
	        COLUMN(CHARS, laboratory, .own = true, .title = "calibrated by"),
	        COLUMN(CHARS, date, .title = "on"),
	        COLUMN(CHARS, due, .title = "due"),
	        COLUMN(YES, overdue, .title = "overdue"),
	        COLUMN(CHARS, drops, .title = "drops"),
	        COLUMN(CHARS, checks[0], .title = "check before"),
	        COLUMN(CHARS, checks[1], .title = "check after"),
	};
#undef COLUMN
	struct table table = {.out = page->page.out, .format = TABLE_HTML};

	fputs("<h2>Sensors and their certificates</h2>\n", table.out);
	if (page->sensors == 0) {
		fputs("<p class=\"soft\">No sensor's file was applied: uncertainties are of noise and fit "
		      "alone.</p>\n",
		      table.out);
		return;
	}
	table_begin(&table, columns, TABLE_COUNT(columns));
	for (size_t i = 0; i < page->sensors; i++) {
		table.row_class = page->sensor[i].overdue || page->sensor[i].suspect
		                          ? " style=\"color:var(--bad)\""
		                          : "";
		table_row(&table, &page->sensor[i]);
	}
	(void)table_end(&table);
	if (series_is_suspect(page))
		fputs("<p class=\"note\">A check of a sensor against a reference is met where "
		      "|E<sub>n</sub>| is 1 at "
		      "most. It is not: all results back to the last good check are suspect.</p>\n",
		      table.out);
	for (size_t i = 0; i < page->sensors; i++) {
		fputs(i == 0 ? "<p class=\"note\">Files, by their SHA-256: <span class=\"hash\">" : "; ",
		      table.out);
		html_own(table.out, page->sensor[i].serial);
		fputc(' ', table.out);
		html_own(table.out, page->sensor[i].file_sha256);
	}
	fputs("</span></p>\n", table.out);
}

/* ---- the laboratory's profile ---- */

static void laboratory_row(const struct series_page *page, enum laboratory_field field)
{
	const struct laboratory_row *row = &laboratory_rows[field];
	const char *text = page->request->laboratory->text[field];
	FILE *out = page->page.out;

	if (!text[0] && !row->needed)
		return;
	fprintf(out, "<tr><th>%s</th><td>", row->label);
	if (text[0])
		html_own(out, text);
	else
		fputs("<b style=\"color:var(--bad)\">missing</b>", out);
	fprintf(out, "</td><td class=\"soft\">%c%s%c</td></tr>\n", HTML_OWN, row->clause, HTML_OWN_END);
}

static void sensor_row(const struct series_page *page, const char *name)
{
	fprintf(page->page.out, "<tr><th>sensor %s</th><td>%s</td><td class=\"soft\">7.8.3.1</td></tr>\n",
	        name,
	        has_sensor(page, name) ? "see the sensors and their certificates"
	                               : "<b style=\"color:var(--bad)\">missing</b>: no file of its "
	                                 "certificate was applied");
}

static void statements(const struct series_page *page, bool final)
{
	const struct laboratory *l = page->request->laboratory;
	FILE *out = page->page.out;

	fputs("<p class=\"note\">The results relate only to the items tested (7.8.2.1 l). This report shall "
	      "not be "
	      "reproduced except in full without the laboratory's approval (7.8.2.2). &plusmn; in "
	      "the tables of drops is one standard uncertainty of noise and fit. U = k u, in the unit of the "
	      "result, is the expanded uncertainty for 95.45 % (7.8.3.1 c), with the measuring chain's parts "
	      "by "
	      "the certificates of the sensors. Differences from a prediction of the model are no "
	      "uncertainty.</p>\n",
	      out);
	if (!final)
		return;
	fputs("<p>Authorised: ", out);
	html_own(out, l->text[LABORATORY_laboratory_signatory]);
	fputs(", ", out);
	html_own(out, l->text[LABORATORY_report_issued]);
	fputs(" &emsp; ______________________________</p>\n", out);
}

void series_laboratory(struct series_page *page)
{
	const struct laboratory *l = page->request->laboratory;
	bool overdue = series_is_overdue(page);
	unsigned missing;
	size_t photos;
	FILE *out = page->page.out;

	if (l == NULL)
		return;
	missing = laboratory_missing(l) + !has_sensor(page, "S1") + !has_sensor(page, "S2");
	fputs("<h2>Test report", out);
	if (l->text[LABORATORY_report_number][0]) {
		fputs(" ", out);
		html_own(out, l->text[LABORATORY_report_number]);
	}
	fputs("</h2>\n", out);
	if (missing > 0)
		fprintf(out,
		        "<div class=\"verdict bad\">DRAFT: %u fields that ISO/IEC 17025, 7.8 wants are "
		        "missing</div>\n",
		        missing);
	if (overdue)
		fputs("<div class=\"verdict bad\">OVERDUE when the drops were made: a sensor's calibration; "
		      "not under accreditation</div>\n",
		      out);
	if (series_is_suspect(page))
		fputs("<div class=\"verdict bad\">SUSPECT: a sensor failed its check against a reference, "
		      "see "
		      "the sensors</div>\n",
		      out);
	fputs("<table class=\"facts\">", out);
	for (int i = 0; i < LABORATORY_FIELDS; i++)
		laboratory_row(page, (enum laboratory_field)i);
	photos = series_photos_count(page);
	if (photos > 0)
		fprintf(out,
		        "<tr><th>photos of the item</th><td>%zu, with their drops</td>"
		        "<td class=\"soft\">%c7.8.2.1 g%c</td></tr>\n",
		        photos, HTML_OWN, HTML_OWN_END);
	sensor_row(page, "S1");
	sensor_row(page, "S2");
	fputs("</table>\n", out);
	statements(page, missing == 0 && !overdue && !series_is_suspect(page));
}
