/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/report/page.h"
#include "host/report/traces.h"

enum { CHANNELS_MAX = 12 }; /* drawn */

static void picture_of_channel(struct page *page, size_t channel)
{
	const struct channel *c = &page->report->record->channels[channel];
	const struct estimate_channel *e = &page->report->analysis->channels[channel];
	struct text script;
	char status[48];

	if (!page_begin_script(page, &script))
		return;
	fputs("<figure><figcaption><b>", page->out);
	page_channel_name(page->out, c->name);
	fputs("</b><span>", page->out);
	if (isfinite(e->peak.value_g)) {
		html_with_sigma(page->out, 1, e->peak.value_g, e->peak.sigma_g);
		fputs(" g at ", page->out);
		html_number(page->out, 3, (e->peak.time_s - page->zero.time_s) * 1e3);
		fputs(" ms ", page->out);
	}
	if (strcmp(report_channel_status(e, status, sizeof(status)), "ok") != 0)
		fprintf(page->out, "(%s)", status);
	fputs("</span></figcaption>", page->out);
	page_draw(page, &script, traces_channel(script.out, page->report, &page->zero, channel), c->name);
	fputs("</figure>\n", page->out);
}

/* One picture over the whole width. */
static void wide_picture(struct page *page,
                         bool (*traces)(FILE *, const struct report *, const struct report_zero *),
                         const char *name)
{
	struct text script;

	if (!page_begin_script(page, &script))
		return;
	fputs("<figure class=\"scroll\" tabindex=\"0\">", page->out);
	page_draw(page, &script, traces(script.out, page->report, &page->zero), name);
	fputs("</figure>\n", page->out);
}

static void picture_of_ringdown(struct page *page, char axis)
{
	struct text script;

	if (!page_begin_script(page, &script))
		return;
	fprintf(page->out, "<figure><figcaption><b>S1 %c</b></figcaption>", axis);
	page_draw(page, &script, traces_ringdown(script.out, page->report, &page->zero, axis), "ring-down");
	fputs("</figure>\n", page->out);
}

static bool any_model(const struct report *report)
{
	for (size_t i = 0; i < report->record->channel_count; i++)
		if (traces_has_model(report, &report->record->channels[i]))
			return true;
	return false;
}

static void page_pictures_legend(struct page *page)
{
	const struct record *r = page->report->record;
	bool two = record_axis(r, "S2X") != NULL;
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
	char video[96];

	fputs("<h2>Traces around the impact</h2>\n<p class=\"soft\">Baselines taken off, otherwise as "
	      "recorded. Time 0: ",
	      page->out);
	html_text(page->out, page->zero.name);
	if (report_video(page->report, &page->zero, video, sizeof(video)))
		fprintf(page->out, ". %s", video);
	fputs(any_model(page->report) ? ". The model is laid so that its S2 peaks where S2 did.</p>\n"
	                              : ".</p>\n",
	      page->out);
	page_pictures_legend(page);
	fputs("<div class=\"grid\">", page->out);
	for (size_t i = 0; i < sizeof(order) / sizeof(order[0]); i++)
		tower += record_axis(r, order[i]) != NULL;
	for (size_t i = 0; i < sizeof(order) / sizeof(order[0]) && tower == r->channel_count; i++) {
		const struct channel *c = record_axis(r, order[i]);

		if (c)
			picture_of_channel(page, (size_t)(c - r->channels));
	}
	for (size_t i = 0; i < r->channel_count && tower != r->channel_count && drawn < CHANNELS_MAX;
	     i++, drawn++)
		picture_of_channel(page, i);
	fputs("</div>\n", page->out);
	if (tower != r->channel_count && r->channel_count > CHANNELS_MAX)
		fprintf(page->out, "<p class=\"soft\">The first %d of %zu channels are drawn.</p>\n",
		        CHANNELS_MAX, r->channel_count);
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
		wide_picture(page, traces_resultant, "resultants");
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
	        record_axis(report->record, "S1X") || record_axis(report->record, "S2X")
	                ? "Along X"
	                : "The channel with the largest peak");
	wide_picture(page, traces_overview, "whole capture");
}

void page_pictures(struct page *page)
{
	traces(page);
	more_pictures(page);
}
