/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/report/series_private.h"

static bool any_clipped(const struct series_page *page)
{
	for (size_t i = 0; i < page->count; i++)
		if (series_is_drawn(page->drop[i]) && (page->drop[i]->record.flags & RECORD_FLAG_CLIPPED))
			return true;
	return false;
}

static void series_pictures_legend(const struct series_page *page)
{
	FILE *out = page->page.out;

	fputs("<div class=\"legend\"><span><i style=\"color:var(--s1)\"></i>S1 measured</span>"
	      "<span><i style=\"color:var(--s2)\"></i>S2 measured</span>",
	      out);
	if (page->has_model)
		fprintf(out, "<span><i class=\"dash\"></i>model %s</span>", page->prediction.fidelity);
	if (any_clipped(page))
		fputs("<span><i class=\"mark\" style=\"color:var(--clip)\">&#9650;</i>beyond the sensor's "
		      "range</span>",
		      out);
	fputs("</div>\n", out);
}

static void picture_over(struct series_page *page, size_t sensor, char axis)
{
	struct page *p = &page->page;
	struct text script;
	char label[40];

	if (!page_begin_script(p, &script))
		return;
	snprintf(label, sizeof(label), "S%zu %c of all drops that count", sensor + 1, axis);
	fprintf(p->out, "<figure><figcaption><b>S%zu %c</b><span>g over ms</span></figcaption>", sensor + 1,
	        axis);
	page_draw(p, &script, series_traces_over(script.out, page, sensor, axis), label);
	fputs("</figure>\n", p->out);
}

static void picture_drop(struct series_page *page, const struct series_drop *drop, char axis)
{
	struct page *p = &page->page;
	struct text script;
	char label[48];

	if (!page_begin_script(p, &script))
		return;
	snprintf(label, sizeof(label), "drop %u, S1 and S2 along %c", drop->a.number, axis);
	fprintf(p->out, "<figure><figcaption><b>%c</b></figcaption>", axis);
	page_draw(p, &script, series_traces_drop(script.out, page, drop, axis), label);
	fputs("</figure>\n", p->out);
}

static void drop_heading(FILE *out, const struct series_drop *drop)
{
	fprintf(out, "<h3>Drop %u <span>", drop->a.number);
	series_time(out, drop->a.time);
	if (isfinite(drop->a.value[ARCHIVE_S1_R]) || isfinite(drop->a.value[ARCHIVE_S2_R])) {
		fputs(", resultants: S1 ", out);
		html_with_sigma(out, 1, drop->a.value[ARCHIVE_S1_R], drop->a.sigma[ARCHIVE_S1_R]);
		fputs(" g, S2 ", out);
		html_with_sigma(out, 1, drop->a.value[ARCHIVE_S2_R], drop->a.sigma[ARCHIVE_S2_R]);
		fputs(" g", out);
	}
	fputs("</span></h3>\n", out);
	if (drop->a.note[0]) {
		fputs("<p>Note: ", out);
		html_own(out, drop->a.note);
		fputs("</p>\n", out);
	}
}

static void drop_pictures(struct series_page *page, const struct series_drop *drop)
{
	FILE *out = page->page.out;

	if (drop->as_read) {
		fputs("<p class=\"soft\">No trace: the scene's sensor files are not those of its "
		      "result.</p>\n",
		      out);
		return;
	}
	if (!series_is_drawn(drop)) {
		fputs("<p class=\"soft\">No trace: ", out);
		(drop->quoted ? html_own : html_text)(
		        out, drop->no_log[0] ? drop->no_log : "it has no result to lay its time by");
		fputs(".</p>\n", out);
		return;
	}
	fputs("<div class=\"grid\">", out);
	picture_drop(page, drop, 'X');
	picture_drop(page, drop, 'Y');
	fputs("</div>\n", out);
}

/* Why it is in no mean. */
static void excluded_reason(FILE *out, const struct series_drop *drop)
{
	const char *decision = series_decision(drop);

	fprintf(out, "<p><b>%c%s</b>", decision[0] - 'a' + 'A', decision + 1);
	if (!strcmp(decision, "rejected")) {
		fputs(": ", out);
		if (drop->a.reason[0])
			html_own(out, drop->a.reason);
		else
			fputs("no reason was noted", out);
	} else if (archive_is_faulty(&drop->a)) {
		fputs(": what is kept of it is not what was recorded, or is not there", out);
	} else if (!strcmp(decision, "undecided")) {
		fputs(": nobody has accepted or rejected it yet", out);
	} else if (!drop->a.sha256[0]) {
		fputs(": its recording was never finished; what is there of it is kept", out);
	}
	fputs("</p>\n", out);
}

/* The drops that count, or those that do not, under a heading that stays with the first of them on paper. */
static void drops(struct series_page *page, bool counting, const char *heading)
{
	FILE *out = page->page.out;
	bool first = true;

	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];

		if (d->counts != counting)
			continue;
		if (first)
			fprintf(out, "<div class=\"keep\">%s", heading);
		fputs(counting ? "<section class=\"drop\">" : "<section class=\"drop out\">", out);
		drop_heading(out, d);
		if (!counting)
			excluded_reason(out, d);
		if (d->a.sha256[0])
			drop_pictures(page, d);
		series_photos(page, d);
		fputs(first ? "</section></div>\n" : "</section>\n", out);
		first = false;
	}
}

void series_pictures(struct series_page *page)
{
	FILE *out = page->page.out;

	if (!page->cell.drops)
		return;
	fputs("<h2>The drops that count, laid over each other</h2>\n<p class=\"soft\">Baselines taken off, "
	      "S1 and S2 "
	      "to the same scale. Time 0 of each drop: where S2 X leaves 10 % of its peak.",
	      out);
	fputs(page->has_model ? " The model is laid so that its S2 peaks where S2 did.</p>\n" : "</p>\n",
	      out);
	series_pictures_legend(page);
	fputs("<div class=\"grid\">", out);
	picture_over(page, 0, 'X');
	picture_over(page, 1, 'X');
	picture_over(page, 0, 'Y');
	picture_over(page, 1, 'Y');
	fputs("</div>\n", out);
	series_spectra(page);
	drops(page, true,
	      "<h2>Drop by drop</h2>\n<p class=\"soft\">S1 and S2 along X and along Y, g over ms; dashed in "
	      "their "
	      "colours: the model.</p>\n");
}

void series_excluded(struct series_page *page)
{
	drops(page, false,
	      "<h2>Drops that do not count</h2>\n<p class=\"soft\">Kept, and in none of the means, cards and "
	      "overlays.</p>\n");
}
